"""Triangles of detections among the catalogue's, when the scale is known: side, side, side.

The shortest side finds the pairs of stars that it may be, each with the scale that this would mean;
the rings about its ends have the stars that are as far away as the third corner; the last side
decides. No table of triangles is needed, and nothing is compared that a side has not chosen.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from app.identify.known_table import PairTable
from app.identify.zones import ranges

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

FLAT = 3.0
"""A triangle no higher than so many errors tells nothing of the parity."""


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """The brightest n detections through a camera known to a share of its focal length.

    ``xy`` (n, 2) px from the frame's middle; ``focal`` the middle of the focal lengths, px, and
    ``room`` how far they go either way, as a share. ``angle`` (n, n) are the separations at the
    middle, rad, and ``growth`` (n, n) what is added at the end of the range, (1 + room) focal.
    """

    xy: Floats
    focal: float
    room: float
    angle: Floats
    growth: Floats

    @classmethod
    def of(cls, xy: Floats, scale: tuple[float, float]) -> "Sight":
        """Of detections (n, 2) px from the middle; ``scale`` the focal lengths allowed, px."""
        focal = (scale[0] * scale[1]) ** 0.5
        room = scale[1] / focal - 1.0
        dot = xy @ xy.T
        square = dot.diagonal()
        angle = []
        for f2 in (focal * focal, scale[1] * scale[1]):
            length = np.sqrt(square + f2)
            cosine = (dot + f2) / (length[:, None] * length)
            angle.append(np.arccos(np.minimum(cosine, 1.0)))
        return cls(xy, focal, room, angle[0], angle[1] - angle[0])


@dataclass(frozen=True, slots=True, eq=False)
class Guesses:
    """Supposed triangles, H: detections and stars (H, 3), focal lengths (H,) px and parities."""

    detections: Ints
    stars: Ints
    focal: Floats
    mirrored: Bools

    def __len__(self) -> int:
        return len(self.focal)


@lru_cache(maxsize=16)
def triangles(n: int) -> Ints:
    """All corners (T, 3) of n detections, those of the brightest first."""
    found = [(i, j, k) for k in range(2, n) for j in range(1, k) for i in range(j)]
    return np.array(found, dtype=np.int64).reshape(-1, 3)


def turned(corners: Ints, angle: Floats) -> Ints:
    """The same triangles (T, 3): first the corner of the two shorter sides, the shortest first."""
    opposite = angle[corners[:, [1, 2, 0]], corners[:, [2, 0, 1]]]  # of corner 0, 1, 2
    order = np.argsort(-opposite, axis=1, kind="stable")  # the longest side's corner first
    # first-second is opposite the last corner, so that must be opposite the shortest side
    return np.asarray(np.take_along_axis(corners, order, axis=1))


def guess(table: PairTable, sight: Sight, corners: Ints, error_rad: float) -> Guesses:
    """Every triangle of the table with the sides of one of ``corners`` (T, 3), as `turned`.

    ``error_rad`` is allowed in each side, after the scale has been taken from the first.
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    base, spread = sight.angle[a, b], np.abs(sight.growth[a, b])
    room = spread + error_rad
    start = table.angle.searchsorted(base - room)
    count = table.angle.searchsorted(base + room) - start
    which = np.repeat(np.arange(len(corners)), count)
    pair = ranges(start, count)
    off = (table.angle[pair] - base[which]) / -np.maximum(spread, 1e-12)[which]
    share = np.minimum(np.maximum(off, -1.0), 1.0)
    here, there = sight.angle[a, c][which], sight.angle[b, c][which]
    here = here + sight.growth[a, c][which] * share
    there = there + sight.growth[b, c][which] * share
    # both ways round: either star of the pair may be the first corner
    one = np.concatenate([table.first[pair], table.second[pair]])
    other = np.concatenate([table.second[pair], table.first[pair]])
    wanted = np.concatenate([here, here])
    asked, entry = table.about(one, wanted - error_rad, wanted + error_rad)
    near = np.flatnonzero(np.abs(table.apart[entry] - wanted[asked]) < error_rad)
    asked, third = asked[near], table.neighbour[entry[near]]
    second = other[asked]
    v = table.vectors
    apart = np.arccos(np.minimum((v[second] * v[third]).sum(axis=1), 1.0))
    fits = np.flatnonzero(np.abs(apart - np.concatenate([there, there])[asked]) < error_rad)
    asked, second, third = asked[fits], second[fits], third[fits]
    row = asked % len(pair) if len(pair) else asked
    return _with_parity(
        sight, corners[which[row]], np.stack([one[asked], second, third], axis=1),
        sight.focal * (1.0 + sight.room * share[row]), v, error_rad,
    )  # fmt: skip


def _with_parity(
    sight: Sight, corners: Ints, stars: Ints, focal: Floats, vectors: Floats, error_rad: float
) -> Guesses:
    """The guesses with the parity that each triangle's sense means; both where it is flat."""
    if len(focal) == 0:
        return Guesses(corners, stars, focal, np.zeros(0, dtype=bool))
    p, v = sight.xy[corners], vectors[stars]
    u, w = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    seen = u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0]
    true = np.linalg.det(v)
    flat = np.abs(seen) < FLAT * error_rad * sight.focal * np.hypot(w[:, 0], w[:, 1])
    mirrored = (seen > 0) != (true > 0)
    if flat.any():
        both = np.flatnonzero(flat)
        rows = np.concatenate([np.arange(len(focal)), both])
        mirrored = np.concatenate([mirrored, ~mirrored[both]])
        corners, stars, focal = corners[rows], stars[rows], focal[rows]
    return Guesses(corners, stars, focal, mirrored)
