"""Polar alignment: the panel, the view at the bolts, and the page on a phone."""
