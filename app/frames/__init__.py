"""Files to frames and solutions to files; one format a file, libraries imported when used."""

from app.frames.formats import FORMATS, SUFFIXES, read_frame

__all__ = ["FORMATS", "SUFFIXES", "read_frame"]
