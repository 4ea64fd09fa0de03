"""From places on the sky and what a mount reported there to what is wrong with it, and to its pointing model."""
