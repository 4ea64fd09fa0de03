"""The bright stars and the figures of the constellations, for a small chart of the whole sky."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from app.core.errors import CatalogueError
from app.core.progress import Progress, Task
from app.sky.catalogue import shipped_folder

if TYPE_CHECKING:
    from app.sky import Catalogue

Floats = NDArray[np.float64]
FAINTEST = 4.3


@dataclass(frozen=True, slots=True, eq=False)
class SkyPoints:
    """``stars`` (N, 3) ICRS unit vectors, ``mag`` (N,); ``strokes`` (M, 2, 3) make the figures."""

    stars: Floats
    mag: Floats
    strokes: Floats


def sky_points(catalogue: "Catalogue") -> Task[SkyPoints]:
    """What the chart shows of the sky; CatalogueError when the list of figures is damaged."""
    yield Progress("chart")
    rows = catalogue.cone(np.array([0.0, 0.0, 1.0]), np.pi, FAINTEST)
    stars, mag = catalogue.vectors(rows), catalogue.mag(rows)
    yield Progress("chart")
    numbers = catalogue.names.bright.column("hip")
    strokes = [np.zeros((0, 2, 3))]
    for line in _lines():
        places = np.searchsorted(numbers, line)
        there = places < len(numbers)
        deep = [catalogue.deep_row(int(at)) for at in places[there]]
        line_of = catalogue.vectors(np.array(deep, dtype=np.int64))
        strokes.append(np.stack([line_of[:-1], line_of[1:]], axis=1))
        yield Progress("chart")
    return SkyPoints(stars, mag, np.concatenate(strokes))


def _lines() -> list[NDArray[np.int64]]:
    path = shipped_folder() / "lines.tsv"
    try:
        rows = path.read_text(encoding="utf-8").splitlines()[1:]
        return [np.array(row.split("\t")[1].split(), dtype=np.int64) for row in rows if row]
    except (OSError, ValueError, IndexError):
        raise CatalogueError(
            f"The list of constellation figures {path} is missing or damaged."
        ) from None
