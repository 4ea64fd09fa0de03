"""ASTAP's star databases: folders of ``<name>_RRCC.290`` or ``.1476`` files.

Each file is one area of the sky: a text header of 110 bytes whose last byte is the record size (a
space stands for 11), then records, brightest first. A record holds RA in 3 bytes and the lower
two bytes of Dec; a record whose RA is all ones opens a section of one magnitude and one upper
byte of Dec. A sixth byte is the colour.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.core.errors import CatalogueError
from app.core.progress import Progress, Task
from app.sky.importing.stars import ForeignStars, v_of_gaia

HEADER = 110
SUFFIXES = (".290", ".1476")
MARK = 0xFFFFFF
FULL_RA = 2**24 - 1
FULL_DEC = 2**23 - 1


def read_astap(folder: Path) -> Task[ForeignStars]:
    """Every star of an ASTAP database; its epoch is not stated in the files.

    Magnitudes are taken as they stand: V in databases with colour, Gaia's BP, some 0.2 fainter, in
    those without.
    """
    files = sorted(_files(folder))
    parts = []
    for i, path in enumerate(files):
        if i % 20 == 0:
            yield Progress("Reading the catalogue", 0.6 * i / len(files), path.name)
        parts.append(decode(path.read_bytes(), path.name))
    ra, dec, mag, colour = np.concatenate(parts, axis=1)
    _, bv = v_of_gaia(mag, colour)
    unknown = np.full((len(mag), 2), np.nan)
    return ForeignStars(ra, dec, mag, bv, unknown, None, "ASTAP")


def _files(folder: Path) -> Iterator[Path]:
    return (p for p in folder.iterdir() if p.suffix in SUFFIXES)


def decode(data: bytes, name: str) -> NDArray[np.float64]:
    """RA, Dec (deg), magnitude and BP-RP (4, N) of one file."""
    size = data[HEADER - 1] if len(data) >= HEADER else 0  # a space stands for 11
    if size not in (5, 6) or (len(data) - HEADER) % size:
        raise CatalogueError(
            f"{name} is not an ASTAP star file with records of 5 or 6 bytes, or is cut short."
        )
    rows = np.frombuffer(data, np.uint8, offset=HEADER).reshape(-1, size).astype(np.int64)
    ra = rows[:, 0] | rows[:, 1] << 8 | rows[:, 2] << 16
    mark = ra == MARK
    if len(rows) and not mark[0]:
        raise CatalogueError(f"{name} does not begin with a section, so it is damaged.")
    section = np.maximum.accumulate(np.where(mark, np.arange(len(rows)), 0))
    star = ~mark
    high, mag = rows[section, 3] - 128, (rows[section, 4] - 16) / 10.0
    dec = high << 16 | rows[:, 4] << 8 | rows[:, 3]
    colour = np.full(len(rows), np.nan)
    if size == 6:
        colour = rows[:, 5].astype(np.uint8).view(np.int8) / 10.0
    places = [ra * (360.0 / FULL_RA), dec * (90.0 / FULL_DEC), mag, colour]
    return np.stack([p[star] for p in places])
