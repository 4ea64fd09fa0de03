"""One driver a file: what a make of mount does with its protocol."""
