"""A chart of the sky with the open frame on it."""
