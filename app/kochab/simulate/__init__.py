"""A simulated sky, camera and mount: what the camera sees is where the mount points."""
