"""The stars inside an astrometry.net index file."""

import mmap
import re
import warnings
from pathlib import Path

import numpy as np

from kochab.core.arrays import Array, Floats
from kochab.core.errors import CatalogueError

# -- The star table inside an astrometry.net index file (series 4100, 5000 and their like) -----
# A FITS file of tables, each one column of raw bytes. The stars are the data of a kd-tree: unsigned
# integers x 3 that span the range given beside them. Rows of the tag-along table follow the order
# of the stars. The file's byte order is stated in the header's ENDIAN card.


def read_index(path: Path) -> tuple[Floats, dict[str, Array]]:
    """Unit vectors (N, 3) of the stars of an astrometry.net index file, and tag-along columns (N,)."""
    from astropy.io import fits

    try:
        _check_counts(path)
        # astropy remarks on files that are refused, or fine, in any case
        with warnings.catch_warnings(action="ignore"), fits.open(path, memmap=False) as hdus:
            names = {h.columns.names[0]: i for i, h in enumerate(hdus) if i and h.columns.names}
            reach = hdus[names["kdtree_range_stars"]].data
            data = hdus[names["kdtree_data_stars"]].data
            tags = hdus[-1].data
            stars = np.frombuffer(data.tobytes(), "<u4").reshape(-1, 3)
            span = np.frombuffer(reach.tobytes(), "<f8")
            vector = stars / span[6] + span[:3]
            columns = {n: np.array(tags[n]) for n in tags.names if np.issubdtype(tags[n].dtype, np.number)}
    except Exception as error:  # a damaged header fails in astropy in a dozen ways
        why = " ".join(str(error).split())[:200]
        raise CatalogueError(
            "{name} is not an index file with a star table ({why}).", name=path.name, why=why
        ) from error
    length = np.linalg.norm(vector, axis=1, keepdims=True)
    if len(vector) == 0 or not np.all(np.abs(length - 1.0) < 1e-3):
        raise CatalogueError("{name} holds stars that are not directions.", name=path.name)
    return vector / length, {n: c for n, c in columns.items() if len(c) == len(vector)}


_COUNTS = re.compile(rb"(?:NAXIS   |TFIELDS )= *([^ /]*)")
_MOST_COUNTED = 999  # FITS standard 4.0, sections 4.4.1 and 7.3.1


def _check_counts(path: Path) -> None:
    """Refuse more axes and columns than the standard allows, through which astropy would count for ever."""
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        if data[:9] != b"SIMPLE  =":
            raise ValueError("it is not FITS")
        for found in _COUNTS.finditer(data):
            at_a_card = found.start() % 80 == 0
            if at_a_card and not (found[1].isdigit() and len(found[1]) < 9 and int(found[1]) <= _MOST_COUNTED):
                raise ValueError("it has more axes or columns than FITS allows")
