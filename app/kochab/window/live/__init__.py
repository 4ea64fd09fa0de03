"""The Live view: a camera that runs, and where it points now."""
