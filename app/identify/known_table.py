"""Pairs of bright stars by their angle, for frames whose scale is known.

The stars are those of one level of the pattern index, so that every part of the sky has about as
many in a frame. The pairs lie twice in memory: all of them by angle, to find the pairs that two
detections may be, and each star's own by distance, in rings of equal area, to find a third star.
10,000 stars make 225,000 pairs in a twentieth of a second.
"""

from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256

import numpy as np
from numpy.typing import NDArray

from app.identify.index import Volume
from app.identify.table_cache import Arrays, kept
from app.identify.volumes import is_shipped
from app.identify.zones import ranges

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Index = NDArray[np.int32]

RINGS = 48
"""Rings about each star: one neighbour in each, more or less."""
REACH = 0.71
"""Widest pair, over the level's field: the diagonal of half a field's area."""
FEWEST_PER_FIELD = 12.0
"""A level's stars in a frame must be at least so many, on average."""
NARROWEST_DEG = 5.0
"""Levels for smaller fields have a million pairs and more: their frames are left to the quads."""


@dataclass(frozen=True, slots=True, eq=False)
class PairTable:
    """The pairs of N stars up to ``reach_rad``, P of them.

    The stars are those of ``volume``'s ``level``. ``rows`` (N,) are catalogue rows, ``vectors``
    (N, 3) ICRS unit vectors at the table's year, ``rough`` (3, N) the same in single precision.
    ``first``, ``second`` (P,) number stars, ``angle`` (P,) is ascending, rad. The neighbours of
    star s in ring r are ``neighbour[begin[s * RINGS + r] : begin[s * RINGS + r + 1]]``, as far from
    it as ``apart`` says.
    """

    volume: Volume
    level: int
    rows: Ints
    vectors: Floats
    rough: NDArray[np.float32]
    first: Index
    second: Index
    angle: Floats
    begin: Index
    neighbour: Index
    apart: NDArray[np.float32]
    reach_rad: float

    def ring(self, angle: Floats) -> Ints:
        """The ring (K,) in which angles (K,) lie; the last one for all that are wider."""
        share = angle / self.reach_rad
        return np.minimum(share * np.abs(share) * RINGS, RINGS - 1.0).astype(np.int64)

    def near(self, centre: Floats, cosine: float) -> Ints:
        """Stars within the angle of ``cosine`` of a unit vector (3,): all are looked at."""
        return np.flatnonzero(centre.astype(np.float32) @ self.rough > cosine)

    def about(self, star: Ints, low: Floats, high: Floats) -> tuple[Ints, Ints]:
        """Neighbours of stars (K,) in all the rings that reach from ``low`` to ``high`` (K,), rad.

        Returns the row of the question and the entry of ``neighbour`` of each.
        """
        at = star * RINGS
        start = self.begin[at + self.ring(np.maximum(low, 0.0))]
        count = self.begin[at + self.ring(high) + 1] - start
        return np.arange(len(star)).repeat(count), ranges(start, count)


def table_for(volumes: tuple[Volume, ...], field_deg: float, year: float) -> PairTable | None:
    """The table for frames of ``field_deg`` (the root of their area), or None: none fits."""
    from app.identify.levels import PER_FIELD

    for volume in volumes:
        for level, size in enumerate(volume.fields_deg.tolist()):
            per_frame = PER_FIELD * (field_deg / size) ** 2
            if size >= NARROWEST_DEG and FEWEST_PER_FIELD <= per_frame < 2.0 * FEWEST_PER_FIELD:
                return _dated(volume, level, round(year))
    return None


@lru_cache(maxsize=8)
def _dated(volume: Volume, level: int, year: int) -> PairTable:
    """The table with its stars where they are in ``year``: their pairs outlive decades."""
    a, b = int(volume.offsets[level]), int(volume.offsets[level + 1])
    rows, stars = volume.rows[a:b].astype(np.int64), volume.stars[a:b]
    reach = float(min(np.radians(REACH * volume.fields_deg[level]), 1.0))
    told = {
        "stars": sha256(np.ascontiguousarray(stars).tobytes()).hexdigest(),
        "reach": reach, "rings": RINGS,
    }  # fmt: skip
    found = _opened(told, stars, reach)
    vectors = stars.astype(np.float64)
    if is_shipped(volume):
        from app.sky import open_catalogue

        vectors = open_catalogue().vectors(rows, float(year))
    rough = np.ascontiguousarray(vectors.T.astype(np.float32))
    return PairTable(volume, level, rows, vectors, rough, **found, reach_rad=reach)


def _opened(told: dict[str, object], stars: NDArray[np.float32], reach: float) -> Arrays:
    return kept("known", told, lambda: make_pairs(stars.astype(np.float64), reach))


def make_pairs(vectors: Floats, reach_rad: float) -> Arrays:
    """All arrays of a :class:`PairTable` but its stars' places, for unit vectors (N, 3)."""
    from scipy.spatial import cKDTree

    chord = 2.0 * np.sin(reach_rad / 2.0)
    pairs = cKDTree(vectors).query_pairs(chord, output_type="ndarray").astype(np.int32)
    gap = vectors[pairs[:, 0]] - vectors[pairs[:, 1]]
    angle = 2.0 * np.arcsin(np.minimum(np.sqrt((gap * gap).sum(axis=1)) / 2.0, 1.0))
    order = np.argsort(angle, kind="stable")
    first, second, angle = pairs[order, 0], pairs[order, 1], angle[order]
    one, other = np.concatenate([first, second]), np.concatenate([second, first])
    apart = np.concatenate([angle, angle])
    ring = np.minimum((apart / reach_rad) ** 2 * RINGS, RINGS - 1).astype(np.int64)
    cell = one * np.int64(RINGS) + ring
    place = np.argsort(cell, kind="stable")
    begin = np.zeros(len(vectors) * RINGS + 1, dtype=np.int32)
    np.cumsum(np.bincount(cell, minlength=len(vectors) * RINGS), out=begin[1:])
    return {
        "first": first, "second": second, "angle": angle, "begin": begin,
        "neighbour": other[place], "apart": apart[place].astype(np.float32),
    }  # fmt: skip
