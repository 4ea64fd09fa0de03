"""Triangles of detections among the catalogue's, when the scale is known: side, side, side.

The shortest side finds the pairs of stars that it may be, each with the scale that this would mean;
the rings about one end have the stars that are as far away as the third corner; the last side
decides. No table of triangles is needed, and nothing is compared that a side has not chosen.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from app.identify.known_table import PairTable

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Corners = tuple[int, int, int]

RANGE = 8.0
"""Where the scale moves a side by so many errors, each pair is asked for rings of its own."""
STEPS = np.arange(1024)
NONE = np.zeros((0, 3), dtype=np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """The brightest n detections through a camera known to a share of its focal length.

    ``focal`` is the middle of the focal lengths allowed, px, and ``room`` how far they go, as a
    share. ``angle`` (n, n) are the separations at the middle, rad, and ``growth`` (n, n) what is
    taken off them at the end of the range, where the focal length is (1 + room) times the middle's.
    Both are lists: they are asked for one by one.
    """

    focal: float
    room: float
    angle: list[list[float]]
    growth: list[list[float]]

    @classmethod
    def of(cls, xy: Floats, scale: tuple[float, float]) -> "Sight":
        """Of detections (n, 2) px from the middle; ``scale`` the focal lengths allowed, px."""
        focal = (scale[0] * scale[1]) ** 0.5
        dot = xy @ xy.T
        both = np.array([focal * focal, scale[1] * scale[1]])[:, None, None] + dot
        length = np.sqrt(both.diagonal(axis1=1, axis2=2))
        angle = np.arccos(np.minimum(both / (length[:, :, None] * length[:, None]), 1.0))
        return cls(
            focal, scale[1] / focal - 1.0, angle[0].tolist(), (angle[0] - angle[1]).tolist()
        )


@lru_cache(maxsize=16)
def triangles(n: int) -> tuple[Corners, ...]:
    """All corners of triangles of n detections, those of the brightest first."""
    return tuple((i, j, k) for k in range(2, n) for j in range(1, k) for i in range(j))


def turned(corners: Corners, angle: list[list[float]]) -> Corners:
    """The same triangle: first the corner of its two shorter sides, of which the shortest first."""
    i, j, k = corners
    opposite = sorted(((angle[j][k], i), (angle[k][i], j), (angle[i][j], k)), reverse=True)
    return opposite[0][1], opposite[1][1], opposite[2][1]


def guess(table: PairTable, sight: Sight, corners: Corners, error_rad: float) -> Ints:
    """Every triangle (H, 3) of stars with the sides of ``corners``, which `turned` gave.

    ``error_rad`` is allowed in each side, after the scale has been taken from the first.
    """
    a, b, c = corners
    base, room = sight.angle[a][b], sight.growth[a][b]
    start = int(table.angle.searchsorted(base - room - error_rad))
    stop = int(table.angle.searchsorted(base + room + error_rad))
    if start == stop:
        return NONE
    wide, far = sight.growth[a][c], sight.growth[b][c]
    here: Floats | float = sight.angle[a][c]
    there: Floats | float = sight.angle[b][c]
    one = table.one[start:stop]
    loose = far > 0.1 * error_rad
    if loose:
        off = (table.angle[start:stop] - base) / room
        off = np.minimum(np.maximum(off, -1.0), 1.0)
    if wide > RANGE * error_rad:
        here = here + wide * off
        entry, end = table.rings_each(one, here - error_rad, here + error_rad)
        here = here[:, None]
    else:
        first, last = table.rings(here - wide - error_rad, here + wide + error_rad)
        entry, end = first.take(one), last.take(one)
        if loose:
            here = (here + wide * off)[:, None]
    if loose:
        there = there + far * off
    width = int((end - entry).max())
    if width == 0:
        return NONE
    entries = entry[:, None] + STEPS[:width]
    near = np.abs(table.apart.take(entries, mode="clip") - here) < error_rad
    near &= entries < end[:, None]
    row, column = near.nonzero()
    third = table.neighbour.take(entry.take(row) + column)
    second = table.other[start:stop].take(row)
    v = table.vectors
    cosine = (v.take(second, axis=0) * v.take(third, axis=0)).sum(axis=1)
    apart = np.arccos(np.minimum(cosine, 1.0))
    fits = (np.abs(apart - (there[row] if loose else there)) < error_rad).nonzero()[0]
    return np.stack([one[row[fits]], second[fits], third[fits]], axis=1).astype(np.int64)
