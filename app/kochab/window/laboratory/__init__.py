"""The Laboratory: identification methods side by side."""
