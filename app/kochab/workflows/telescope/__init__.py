"""Kochab as a telescope for other programs."""
