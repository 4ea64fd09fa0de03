"""Polar alignment: measure the axis, turn the adjusters, measure again."""
