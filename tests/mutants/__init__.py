"""Deliberate bugs, and whether the tests notice: ``make mutants`` (``python -m tests.mutants --help``)."""
