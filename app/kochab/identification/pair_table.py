"""Pairs of bright stars by their angle, for frames whose scale is known.

The stars are those of one level of the pattern index, so that every part of the sky has about as
many in a frame. The pairs lie twice in memory: all of them by angle, to find the pairs that two
detections may be, and each star's own by distance, in rings of equal area, to find a third star.
10,000 stars make 225,000 pairs in a twentieth of a second.
"""

import math
from dataclasses import replace
from functools import lru_cache
from hashlib import sha256

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Floats, Ints, Ints32
from kochab.core.values import frozen
from kochab.identification.index import PER_FIELD, Volume, is_shipped
from kochab.identification.table_cache import Arrays, cached_table

STEPS = np.arange(4096, dtype=np.int32)
RINGS = 48
"""Rings about each star: one neighbour in each, more or less."""
BINS = 8192
"""Bins of angle, to find pairs without a search."""
REACH = 0.71
"""Widest pair, over the level's field: the diagonal of half a field's area."""
DENSE, SPARSE = 12.0, 6.0
"""So many stars of a level are at least in a frame, on average, and less than twice as many."""
NARROWEST_DEG = 7.0
"""Levels for smaller fields have a million pairs and more: their frames are left to the quads."""


@frozen(eq=False)
class PairTable:
    """The pairs of N stars up to ``reach_rad``, each both ways round: P of them.

    The stars are those of ``volume``'s ``level``, over ``area_sr`` of the sky. ``rows`` (N,) are catalogue rows,
    ``vectors`` (N, 3) ICRS unit vectors at the table's year, ``rough`` (3, N) the same in single precision.
    ``one`` and ``other`` (P,) number stars and ``angle`` (P,) rad is ascending; ``first`` has where
    each of its bins begins. The neighbours of
    star s in ring r are ``neighbour[begin[r, s] : begin[r + 1, s]]``, as far from it as ``apart``.
    """

    volume: Volume
    level: int
    rows: Ints
    vectors: Floats
    rough: NDArray[np.float32]
    one: Ints32
    other: Ints32
    angle: Floats
    first: list[int]
    begin: Ints32
    neighbour: Ints32
    apart: NDArray[np.float32]
    reach_rad: float
    area_sr: float = 4.0 * math.pi

    def between(self, low_rad: float, high_rad: float) -> slice:
        """The pairs of which the angle is from ``low_rad`` to ``high_rad``, and a few more."""
        scale = BINS / self.reach_rad
        low, high = int(max(low_rad, 0.0) * scale), int(high_rad * scale) + 1
        return slice(self.first[min(low, BINS)], self.first[min(high, BINS)])

    def near(self, centre: tuple[float, float, float], cosine: float) -> Ints:
        """Stars within the angle of ``cosine`` of a unit vector (3,): all are looked at."""
        inside: Ints = (np.array(centre, dtype=np.float32) @ self.rough > cosine).nonzero()[0]
        return inside

    def rings(self, star: Ints32, low_rad: float, high_rad: float) -> tuple[Ints32, Ints32]:
        """First entry, and the one after the last, of the neighbours of stars (K,).

        Whole rings: some are nearer than ``low_rad`` or farther than ``high_rad``.
        """
        # rings of equal area: their number goes with the square of the angle
        first = int(max(low_rad / self.reach_rad, 0.0) ** 2 * RINGS)
        last = int((high_rad / self.reach_rad) ** 2 * RINGS) + 1
        return (self.begin[min(first, RINGS)].take(star), self.begin[min(last, RINGS)].take(star))

    def in_one_ring(self, angle: float, wide: float) -> bool:
        """Whether ``wide`` either way of ``angle`` is less than a ring, rad."""
        # a ring at this angle is reach^2 / (2 RINGS angle) wide
        return 4.0 * RINGS * angle * wide < self.reach_rad * self.reach_rad

    def rings_each(self, star: Ints32, low_rad: float, high_rad: float, more_rad: Floats) -> tuple[Ints32, Ints32]:
        """The same with limits of each star's own.

        Parameters
        ----------
        star : Ints32
            Stars (K,) whose neighbours are wanted.
        low_rad, high_rad : float
            Least and largest distance, radians.
        more_rad : Floats
            What is added (K,) to both, radians.
        """
        stars, scale = len(self.rows), RINGS / self.reach_rad**2
        low, high = np.maximum(more_rad + low_rad, 0.0), more_rad + high_rad
        first = np.minimum(low * low * scale, RINGS).astype(np.int64)
        last = np.minimum(high * high * scale + 1.0, RINGS).astype(np.int64)
        flat = self.begin.ravel()
        return flat.take(first * stars + star), flat.take(last * stars + star)

    def neighbours(self, entry: Ints32, end: Ints32, wanted_rad: Floats | float, error_rad: float) -> tuple[Ints, Ints]:
        """Of runs of entries those as far away as wanted: rows, and entries.

        Parameters
        ----------
        entry, end : Ints32
            First entry (K,) of each run, and the one after its last (K,).
        wanted_rad : Floats or float
            Distance, one or (K, 1), radians.
        error_rad : float
            Largest difference from it, radians.
        """
        width = int((end - entry).max())
        entries = entry[:, None] + STEPS[:width]
        # every row is as wide as the longest: what it reads beyond its own end is masked
        near = np.abs(self.apart.take(entries, mode="clip") - wanted_rad) < error_rad
        near &= entries < end[:, None]
        row, column = near.nonzero()
        return row, entry.take(row) + column


def table_for(volumes: tuple[Volume, ...], field_deg: float, year: float, density: float = DENSE) -> PairTable | None:
    """The pair table for frames of one size, or None: none fits.

    Parameters
    ----------
    volumes : tuple[Volume, ...]
        The volumes of the index.
    field_deg : float
        Root of the frame's area, degrees.
    year : float
        Epoch of the stars' places, Julian year.
    density : float
        The fewest stars a frame shows on average.
    """
    for volume in volumes:
        for level, size in enumerate(volume.fields_deg.tolist()):
            # so many stars of this level a frame shows on average
            stars = PER_FIELD * (field_deg / size) ** 2
            if size >= NARROWEST_DEG and density <= stars < 2.0 * density:
                return _at_year(volume, level, round(year))
    return None


@lru_cache(maxsize=8)
def _at_year(volume: Volume, level: int, year: int) -> PairTable:
    """The table with its stars where they are in ``year``: their pairs outlive decades."""
    table = _opened(volume, level)
    if not is_shipped(volume):
        return table
    from kochab.sky import open_catalogue

    vectors = open_catalogue().vectors(table.rows, float(year))
    return replace(table, vectors=vectors, rough=_rough(vectors))


@lru_cache(maxsize=4)
def _opened(volume: Volume, level: int) -> PairTable:
    """The table with its stars where the index has them."""
    stars = _stars_of(volume, level)
    reach = float(min(np.radians(REACH * volume.fields_deg[level]), 1.0))
    key = {"stars": sha256(stars.tobytes()).hexdigest(), "reach": reach, "rings": RINGS}
    found = cached_table("known", key, lambda: make_pairs(stars.astype(np.float64), reach))
    return _assembled(volume, level, reach, found)


def table_of(volume: Volume, level: int, reach_rad: float, area_sr: float) -> PairTable:
    """The table of a volume's level, made anew.

    Parameters
    ----------
    volume : Volume
        Of a part of the sky.
    level : int
        Which of its levels.
    reach_rad : float
        Widest pair, radians.
    area_sr : float
        Over which the stars lie.
    """
    found = make_pairs(_stars_of(volume, level).astype(np.float64), reach_rad)
    return replace(_assembled(volume, level, reach_rad, found), area_sr=area_sr)


def _stars_of(volume: Volume, level: int) -> NDArray[np.float32]:
    return np.ascontiguousarray(volume.stars[int(volume.offsets[level]) : int(volume.offsets[level + 1])])


def _assembled(volume: Volume, level: int, reach: float, found: Arrays) -> PairTable:
    a, b = int(volume.offsets[level]), int(volume.offsets[level + 1])
    vectors = _stars_of(volume, level).astype(np.float64)
    # a pair and its reverse stand next to each other
    angle = found["angle"].repeat(2)
    return PairTable(
        volume,
        level,
        volume.rows[a:b].astype(np.int64),
        vectors,
        _rough(vectors),
        found["pairs"].ravel(),
        np.ascontiguousarray(found["pairs"][:, ::-1]).ravel(),
        angle,
        angle.searchsorted(np.linspace(0.0, reach, BINS + 1)).tolist(),
        _by_ring(found["begin"], len(vectors)),
        found["neighbour"],
        found["apart"],
        reach,
    )


def _rough(vectors: Floats) -> NDArray[np.float32]:
    return np.ascontiguousarray(vectors.T.astype(np.float32))


def make_pairs(vectors: Floats, reach_rad: float) -> Arrays:
    """What a :class:`PairTable` is made of, but for its stars' places; of unit vectors (N, 3).

    ``pairs`` (P / 2, 2) and their ``angle``, ascending; ``begin`` (N * RINGS + 1,), star by star.
    """
    from scipy.spatial import cKDTree

    chord = 2.0 * np.sin(reach_rad / 2.0)
    pairs = cKDTree(vectors).query_pairs(chord, output_type="ndarray").astype(np.int32)
    # from the chord: an arc cosine would lose the digits of small angles
    gap = vectors[pairs[:, 0]] - vectors[pairs[:, 1]]
    angle = 2.0 * np.arcsin(np.minimum(np.sqrt((gap * gap).sum(axis=1)) / 2.0, 1.0))
    order = np.argsort(angle, kind="stable")
    pairs, angle = pairs[order], angle[order]
    cell = pairs * np.int64(RINGS) + _ring(angle, reach_rad)[:, None]
    place = np.argsort(cell.ravel(), kind="stable")
    begin = np.zeros(len(vectors) * RINGS + 1, dtype=np.int32)
    np.cumsum(np.bincount(cell.ravel(), minlength=len(vectors) * RINGS), out=begin[1:])
    return {
        "pairs": pairs,
        "angle": angle,
        "begin": begin,
        "neighbour": pairs[:, ::-1].ravel()[place],
        "apart": angle.repeat(2)[place].astype(np.float32),
    }


def _ring(angle: Floats, reach_rad: float) -> Ints:
    return np.minimum((angle / reach_rad) ** 2 * RINGS, RINGS - 1).astype(np.int64)


def _by_ring(begin: Ints32, stars: int) -> Ints32:
    """Where each ring of each star begins, (RINGS + 1, N): a ring's row lies together."""
    inner = begin[:-1].reshape(stars, RINGS)
    return np.ascontiguousarray(np.column_stack([inner, begin[RINGS::RINGS]]).T)
