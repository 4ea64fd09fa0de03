"""The words every room speaks: frozen values over numpy, no input or output."""
