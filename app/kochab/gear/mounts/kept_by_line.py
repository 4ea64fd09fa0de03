"""Where what is known of a mount is kept between programs: a file a line and purpose."""

import re
from pathlib import Path


def kept_file(folder: Path, line: str, purpose: str) -> Path:
    """``com3-syncs.json`` in ``folder`` for the mount at a port or an address."""
    return folder / f"{re.sub('[^A-Za-z0-9]+', '-', line)}-{purpose}.json"
