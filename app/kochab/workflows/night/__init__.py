"""The morning after: what a folder of frames says of the night, each number with its uncertainty."""
