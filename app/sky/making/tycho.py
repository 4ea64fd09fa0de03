"""The star table inside an astrometry.net index file (series 4100, 5000 and their like).

A FITS file of tables, each one column of raw bytes. The stars are the data of a kd-tree: unsigned
integers x 3 that span the range given beside them. Rows of the tag-along table follow the order
of the stars. The file's byte order is stated in the header's ENDIAN card.
"""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.core.errors import CatalogueError

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class IndexStars:
    """Stars of an index: ``vector`` (N, 3) unit vectors, ``columns`` tag-along arrays (N,)."""

    vector: Floats
    columns: dict[str, NDArray[Any]]


@contextmanager
def _quietly() -> Iterator[None]:
    """Leave out astropy's remarks on files that are refused, or fine, in any case."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def read_index(path: Path) -> IndexStars:
    """The stars of an astrometry.net index file."""
    from astropy.io import fits

    try:
        with _quietly(), fits.open(path, memmap=False) as hdus:
            names = {h.columns.names[0]: i for i, h in enumerate(hdus) if i and h.columns.names}
            reach = hdus[names["kdtree_range_stars"]].data
            data = hdus[names["kdtree_data_stars"]].data
            tags = hdus[-1].data
            stars = np.frombuffer(data.tobytes(), "<u4").reshape(-1, 3)
            span = np.frombuffer(reach.tobytes(), "<f8")
            vector = stars / span[6] + span[:3]
            columns = {
                n: np.array(tags[n]) for n in tags.names if np.issubdtype(tags[n].dtype, np.number)
            }
    except (OSError, KeyError, ValueError, IndexError, AttributeError) as error:
        raise CatalogueError(
            f"{path.name} is not an index file with a star table ({error})."
        ) from error
    length = np.linalg.norm(vector, axis=1, keepdims=True)
    if len(vector) == 0 or not np.all(np.abs(length - 1.0) < 1e-3):
        raise CatalogueError(f"{path.name} holds stars that are not directions.")
    columns = {n: c for n, c in columns.items() if len(c) == len(vector)}
    return IndexStars(vector / length, columns)
