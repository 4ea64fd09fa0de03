"""Data that comes with Kochab: its icon and sample frames, all drawn by the project itself."""
