"""Attitudes of a turning mount to its polar axis: where it points, how far off the pole, how surely."""
