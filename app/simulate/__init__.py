"""The rendered sky: frames as a camera would make them."""
