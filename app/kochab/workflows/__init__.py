"""What a person does, as generators without Qt; each yield is progress and a place to cancel."""
