"""What owns the mount's line, the cameras and the equipment profile: one of each in a window."""
