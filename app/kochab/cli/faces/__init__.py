"""Other programs' command lines, each answered as the original answers."""
