"""Attitudes of a turning mount -> where its axis points, how far off the pole, how surely."""
