"""What the all-sky chart shows: bright stars, constellation figures, and the trail of the pointing."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Floats
from kochab.core.errors import CatalogueError
from kochab.core.progress import Progress, Task
from kochab.core.values import frozen
from kochab.sky import shipped_folder

if TYPE_CHECKING:
    from kochab.sky import Catalogue


FAINTEST = 4.3  # V of the stars


@frozen(eq=False)
class SkyPoints:
    """``stars`` (N, 3) ICRS unit vectors, ``mag`` (N,); ``strokes`` (M, 2, 3) make the figures."""

    stars: Floats
    mag: Floats
    strokes: Floats


def sky_points(open_catalogue: Callable[[], "Catalogue"]) -> Task[SkyPoints]:
    """Read the chart's stars and figures; CatalogueError when the list of figures is damaged."""
    yield Progress("chart")
    catalogue = open_catalogue()
    rows = catalogue.cone(np.array([0.0, 0.0, 1.0]), np.pi, FAINTEST)
    stars, mag = catalogue.vectors(rows), catalogue.mag(rows)
    yield Progress("chart")
    numbers = catalogue.names.bright.column("hip")
    strokes = [np.zeros((0, 2, 3))]
    for line in _lines():
        places = np.searchsorted(numbers, line)
        there = places < len(numbers)
        deep = [catalogue.deep_row(int(at)) for at in places[there]]
        ends = catalogue.vectors(np.array(deep, dtype=np.int64))
        strokes.append(np.stack([ends[:-1], ends[1:]], axis=1))
        yield Progress("chart")
    return SkyPoints(stars, mag, np.concatenate(strokes))


def _lines() -> list[NDArray[np.int64]]:
    path = shipped_folder() / "lines.tsv"
    try:
        rows = path.read_text(encoding="utf-8").splitlines()[1:]
        return [np.array(row.split("\t")[1].split(), dtype=np.int64) for row in rows if row]
    except (OSError, ValueError, IndexError):
        raise CatalogueError("The list of constellation figures {path} is missing or damaged.", path=path) from None


MOST = 2000
STEP_RAD = np.radians(0.02)


class Trail:
    """The directions the camera has pointed to, thinned so that it stays small all night."""

    def __init__(self) -> None:
        self._points: list[Floats] = []
        self.here: Floats | None = None
        self.old = False

    def add(self, centre: Floats, old: bool = False) -> None:
        """The camera points to the ICRS unit vector (3,), or did when that is ``old``."""
        self.here, self.old = centre, old
        # The chord is the angle, in radians, at such a size.
        if self._points and float(np.linalg.norm(self._points[-1] - centre)) < STEP_RAD:
            return
        self._points.append(centre)
        if len(self._points) > MOST:  # the older half loses every other point
            half = MOST // 2
            self._points = self._points[:half:2] + self._points[half:]

    def clear(self) -> None:
        """Forget all."""
        self._points, self.here, self.old = [], None, False

    @property
    def points(self) -> Floats:
        """All directions (N, 3)."""
        return np.array(self._points).reshape(-1, 3)
