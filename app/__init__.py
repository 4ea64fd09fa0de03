"""Kochab: where the camera points, the axis on the pole, the mount on the sky."""

__version__ = "0.1.0"
