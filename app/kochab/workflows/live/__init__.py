"""Live solving: a camera runs, and every frame's pointing is known."""
