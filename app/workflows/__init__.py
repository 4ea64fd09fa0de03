"""What a person does, as generators without a window: each yield is progress and a cancel point."""
