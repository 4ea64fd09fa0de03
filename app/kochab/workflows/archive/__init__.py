"""Frames by the million as one table: what goes in, a row each, and the dataset that holds the rows.

inputs (URLs, their stamps) - rows that are done = chunks -> rows -> parts of the dataset
"""
