"""The Mount view: a mount on its line, what it says, and what the sky says."""
