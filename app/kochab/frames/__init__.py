"""Files to frames and back; what other rooms need of it is named here."""

from kochab.frames.readers import (
    FORMATS,
    file_pattern,
    format_names,
    frames_of,
    named_as_frame,
    read_fits_bytes,
    read_frame,
    reading,
    suffixes,
)
from kochab.frames.samples import finite, shifted, split

__all__ = [
    "FORMATS",
    "file_pattern",
    "finite",
    "format_names",
    "frames_of",
    "named_as_frame",
    "read_fits_bytes",
    "read_frame",
    "reading",
    "shifted",
    "split",
    "suffixes",
]
