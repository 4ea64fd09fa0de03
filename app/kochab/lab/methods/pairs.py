"""Pairs of bright catalogue stars by their angle.

The methods that compare angular separations share it. Kolomenkin et al. (2008, IEEE Trans. Aerosp. Electron. Syst.
44, 441) and the theses that follow them fill it in hours; here a k-d tree names the pairs: 8,870 stars (V <= 6.5)
and 8 degrees give about 200,000 of them in a few hundredths of a second, so the table is made where it is first
needed and kept, 16 bytes a pair; large ones also on disk.
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from kochab.core.arrays import Bools, Floats, Ints, Ints32
from kochab.core.errors import UsageError
from kochab.core.values import frozen
from kochab.identification.table_cache import Arrays, cached_table
from kochab.sky import open_catalogue

MOST_PAIRS = 12_000_000
"""Some seconds and a gigabyte; the widest field of stars to V 5.9 has 10 million."""
KEPT = ("rows", "vectors", "first", "second", "angle")


@frozen(eq=False)
class Pairs:
    """All pairs of ``N`` stars up to an angle; P pairs, the closest first.

    ``rows`` (N,) are catalogue rows, brightest first; ``vectors`` (N, 3) ICRS unit vectors of the same
    stars at the table's year. ``first`` and ``second`` (P,)
    number stars in those arrays, first < second, so ``first`` is the brighter one; ``angle`` (P,)
    is their separation in radians, ascending. ``max_rad`` is the largest angle asked for.
    """

    rows: Ints
    vectors: Floats
    first: Ints32
    second: Ints32
    angle: Floats
    max_rad: float

    def __len__(self) -> int:
        return len(self.angle)

    @property
    def stars(self) -> int:
        """N, the number of stars."""
        return len(self.rows)

    def within_declinations(self, low_deg: float, high_deg: float) -> "Pairs":
        """The pairs of which both stars lie between two declinations; the stars stay numbered."""
        if low_deg <= -90.0 and high_deg >= 90.0:
            return self
        low, high = np.sin(np.radians([low_deg, high_deg]))
        inside = (self.vectors[:, 2] >= low) & (self.vectors[:, 2] <= high)
        return self.take(inside[self.first] & inside[self.second])

    def take(self, chosen: Bools) -> "Pairs":
        """Of all pairs (P,) these; the stars stay numbered."""
        return replace(self, first=self.first[chosen], second=self.second[chosen], angle=self.angle[chosen])


def between(values: Floats, low: ArrayLike, high: ArrayLike) -> tuple[Ints, Ints]:
    """Slices of ascending ``values`` (N,) with ``low <= value <= high``, for any number of ranges.

    Returns ``start`` and ``stop`` in the shape of ``low``; an empty range gives ``start == stop``.
    Two binary searches do what the theses use Mortari's k-vector for.
    """
    start = np.searchsorted(values, np.asarray(low, dtype=np.float64), "left")
    stop = np.searchsorted(values, np.asarray(high, dtype=np.float64), "right")
    return start.astype(np.int64), np.maximum(stop, start).astype(np.int64)


def spread(start: Ints, stop: Ints) -> tuple[Ints, Ints]:
    """Every entry of many slices at once: which slice it is in, and the entry's number.

    Both (K,) with K the sum of the slices' lengths; an entry comes once for each slice.
    """
    length = stop - start
    which = np.repeat(np.arange(len(start), dtype=np.int64), length)
    # Where each slice begins in the result.
    before = np.cumsum(length) - length
    return which, np.arange(int(length.sum()), dtype=np.int64) - before[which] + start[which]


def angles_between(a: Floats, b: Floats) -> Floats:
    """Angles (...), radians, between unit vectors (..., 3); by the chord, exact for close ones too."""
    chord = np.linalg.norm(a - b, axis=-1)
    return np.asarray(2.0 * np.arcsin(np.minimum(chord / 2.0, 1.0)))


def make_pairs(rows: Ints, vectors: Floats, max_rad: float) -> Pairs:
    """The table of stars given brightest first: ``rows`` (N,), ``vectors`` (N, 3)."""
    chord = 2.0 * np.sin(min(max_rad, np.pi) / 2.0)
    if len(vectors) ** 2 * chord**2 / 8.0 > MOST_PAIRS:  # the share of the sky, N^2 / 2 times
        raise UsageError(
            f"{len(vectors)} stars make too many pairs of up to {np.degrees(max_rad):.3g} degrees:"
            " take fewer stars, or a smaller field."
        )
    # The tree measures chords: for unit vectors as good as angles, and monotonic in them.
    found = cKDTree(vectors).query_pairs(chord, output_type="ndarray").astype(np.int32)
    # Stars are numbered brightest first, so the smaller number is the brighter star.
    first, second = found.min(axis=1), found.max(axis=1)
    angle = angles_between(vectors[first], vectors[second])
    # Ties are broken by the stars, so that the table does not depend on the tree's order.
    order = np.lexsort((second, first, angle))
    return Pairs(rows, vectors, first[order], second[order], angle[order], max_rad)


def catalogue_pairs(
    max_deg: float, *, brightest: int | None = None, mag_limit: float | None = None, year: float = 2016.0
) -> Pairs:
    """Pairs of the shipped catalogue's bright stars; kept.

    Parameters
    ----------
    max_deg : float
        The largest separation, degrees.
    brightest : int or None
        How many stars (8,118 reproduces the thesis on spherical triangles); None: by magnitude.
    mag_limit : float or None
        V down to which all stars count; None: by number.
    year : float
        Epoch, applied to the whole Julian year: no bright star moves 6 arcsec in one.
    """
    if brightest is None and mag_limit is None:
        raise ValueError("Give either the number of stars or the limiting magnitude.")
    return _tabled(max_deg, None if mag_limit is not None else brightest, mag_limit, round(year))


@lru_cache(maxsize=6)
def _tabled(max_deg: float, brightest: int | None, mag_limit: float | None, year: int) -> Pairs:
    """The table, from memory, from disk, or made."""
    options = {"max_deg": max_deg, "brightest": brightest, "mag_limit": mag_limit, "year": year}

    def make() -> Arrays:
        made = make_pairs(*bright_stars(brightest, mag_limit, year), np.radians(max_deg))
        return {name: getattr(made, name) for name in KEPT}

    found = cached_table("pairs", options, make)  # older files hold more
    return Pairs(**{name: found[name] for name in KEPT}, max_rad=float(np.radians(max_deg)))


def bright_stars(brightest: int | None, mag_limit: float | None, year: float) -> tuple[Ints, Floats]:
    """Rows (N,) and unit vectors (N, 3) of the catalogue's bright stars."""
    catalogue, pole = open_catalogue(), np.array([0.0, 0.0, 1.0])
    rows = catalogue.cone(pole, np.pi, mag_limit) if brightest is None else catalogue.brightest(pole, np.pi, brightest)
    return rows, catalogue.vectors(rows, year)
