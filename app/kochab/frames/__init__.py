"""Files to frames and back; what other rooms need of it is named here."""

from kochab.frames.readers import FORMATS, SUFFIXES, read_fits_bytes, read_frame, reading
from kochab.frames.samples import finite, shifted, split

__all__ = ["FORMATS", "SUFFIXES", "finite", "read_fits_bytes", "read_frame", "reading", "shifted", "split"]
