"""The owners of the cameras' and the mount's lines and of the equipment profile, one of each in a window."""
