"""The words every room speaks: frozen values over numpy, errors, array types and registries; no input or output."""

__version__ = "0.2.0"
