"""What is connected: mounts, cameras, and the journal of what was sent to them."""
