"""Kochab as a telescope, in the protocols that planetarium programs speak."""
