"""Last night: what a folder of frames says, as ``kochab night`` does."""
