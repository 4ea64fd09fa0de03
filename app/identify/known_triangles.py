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
Index = NDArray[np.int32]
Corners = tuple[int, int, int]

PART = 0.2
"""Where the scale moves a side by less than this share of the error, it is left out of account."""


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
        return cls(focal, scale[1] / focal - 1.0, angle[0].tolist(), (angle[0] - angle[1]).tolist())


@lru_cache(maxsize=16)
def triangles(n: int) -> tuple[Corners, ...]:
    """All corners of triangles of n detections, those of the brightest first."""
    return tuple((i, j, k) for k in range(2, n) for j in range(1, k) for i in range(j))


def turned(corners: Corners, angle: list[list[float]]) -> Corners:
    """The same triangle: first the corner of its two shorter sides, of which the shortest first."""
    i, j, k = corners
    a, b, c = angle[j][k], angle[i][k], angle[i][j]  # opposite the corners
    if a < b:
        i, j, a, b = j, i, b, a
    if b < c:
        j, k, b, c = k, j, c, b
        if a < b:
            i, j = j, i
    return i, j, k


def guess(table: PairTable, sight: Sight, corners: Corners, error_rad: float) -> list[Corners]:
    """Every triangle of stars with the sides of ``corners``, which `turned` gave.

    ``error_rad`` is allowed in each side, at the scale that the longest side means.
    """
    a, b, c = corners
    base, room = sight.angle[a][b], sight.growth[a][b]
    here, wide = sight.angle[a][c], sight.growth[a][c]
    pairs = table.between(base - room - error_rad, base + room + error_rad)
    one = table.one[pairs]
    if len(one) == 0:
        return []
    fixed = sight.growth[b][c] < PART * error_rad
    if fixed:
        entry, end = table.rings(one, here - error_rad, here + error_rad)
        row, found = table.neighbours(entry, end, here, error_rad)
    else:
        # the shortest side tells the scale, but no better than its own error
        off = (table.angle[pairs] - base) / room
        np.minimum(np.maximum(off, -1.0, out=off), 1.0, out=off)
        error = error_rad + min(error_rad * wide / room, 2.0 * wide)
        if table.in_one_ring(here, wide):
            entry, end = table.rings(one, here - wide - error_rad, here + wide + error_rad)
        else:
            entry, end = table.rings_each(one, here - error, here + error, wide * off)
        row, found = table.neighbours(entry, end, (here + wide * off)[:, None], error)
    if len(row) == 0:
        return []
    first, second, third = one.take(row), table.other[pairs].take(row), table.neighbour.take(found)
    far = _apart(table, second, third)
    if fixed:
        off_rad = np.abs(far - sight.angle[b][c])
    else:
        sides = np.empty((3, len(row)))
        sides[0], sides[1], sides[2] = table.angle[pairs].take(row), table.apart.take(found), far
        off_rad = _misfit(sight, corners, sides)
    fits = (off_rad < error_rad).nonzero()[0]
    if len(fits) == 0:
        return []
    if len(fits) > 1:
        fits = fits.take(off_rad.take(fits).argsort())  # the likeliest first
    stars = first.take(fits), second.take(fits), third.take(fits)
    return list(zip(*(column.tolist() for column in stars), strict=True))


def _apart(table: PairTable, one: Index, other: Index) -> Floats:
    """Angles (K,) between stars, rad."""
    v = table.vectors
    cosine = (v.take(one, axis=0) * v.take(other, axis=0)).sum(axis=1)
    return np.asarray(np.arccos(np.minimum(cosine, 1.0)))


def _misfit(sight: Sight, corners: Corners, sides: Floats) -> Floats:
    """The largest error (K,) of sides (3, K), rad, where the last and longest gives the scale."""
    a, b, c = corners
    pairs = ((a, b), (a, c), (b, c))
    growth = np.array([[sight.growth[i][j]] for i, j in pairs])
    sides -= np.array([[sight.angle[i][j]] for i, j in pairs])
    off = sides[2] / growth[2]
    np.minimum(np.maximum(off, -1.0, out=off), 1.0, out=off)
    sides -= growth * off
    return np.asarray(np.abs(sides).max(axis=0))
