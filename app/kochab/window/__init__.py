"""The window. Qt is used in this room and nowhere else."""
