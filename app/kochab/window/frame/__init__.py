"""The open frame: read, solved, shown, picked at, exported, and the files beside it."""
