"""The spherical-triangle method: area and polar moment, pivoting on two shared stars.

The thesis on spherical triangles, sections 2.4-2.6, 3.5, 3.8.2 and 5.3. Its 662,799 triangles took four hours to
list; here the brightest 8,118 stars make 1,112,819 from the pair table in a few seconds, 31 MB on disk. The thesis
has fewer because it has fewer angles, fewer than so many stars would make if they were spread evenly over the sky.
"""

from functools import lru_cache
from itertools import permutations
from typing import ClassVar

import numpy as np

from kochab.core.arrays import Floats, Ints
from kochab.core.attitude import cross_product, unit
from kochab.core.errors import UsageError
from kochab.core.registry import integer
from kochab.core.values import frozen
from kochab.identification.table_cache import Arrays, cached_table
from kochab.lab.methods.angles import Chain, FigureTable, PivotingMethod, pivot, pivot_order
from kochab.lab.methods.pairs import Pairs, angles_between, between, catalogue_pairs, spread

# -- Area and polar moment of spherical triangles, with their errors, many at once -------------
# The thesis on spherical triangles, sections 2.4 and 2.5. All take corners (..., 3, 3): three unit
# vectors a triangle; areas are in steradians, moments in rad^4.


def sides(corners: Floats) -> Floats:
    """Sides (..., 3), radians: 1-2, 2-3, 3-1 (equations 2.18-2.20, by the chord)."""
    return angles_between(corners, np.roll(corners, -1, axis=-2))


def _tangents(side: Floats) -> Floats:
    """The four tangents (..., 4) of equation 2.16: of s/2, (s-a)/2, (s-b)/2, (s-c)/2."""
    # Rounding makes s - a of flat triangles slightly negative, and the product of the tangents with it.
    half = side.sum(axis=-1, keepdims=True) / 2.0
    return np.asarray(np.tan(np.concatenate([half, np.maximum(half - side, 0.0)], axis=-1) / 2.0))


def area(corners: Floats) -> Floats:
    """Areas (...,) by equation 2.16."""
    return np.asarray(4.0 * np.arctan(np.sqrt(_tangents(sides(corners)).prod(axis=-1))))


def area_sigma(corners: Floats, sigma_rad: float) -> Floats:
    """Errors (...,) of the areas, each coordinate of a corner being off by ``sigma_rad``.

    Equations 2.25-2.34; the variance of a side is twice that of a place (2.14), as the thesis'
    programs have it and equation 2.34 leaves out. Flat triangles give inf.
    """
    t = _tangents(sides(corners))
    product = t.prod(axis=-1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = product / t * (1.0 + t * t)  # 1 / cos^2 = 1 + tan^2
        # d/da of s/2, (s-a)/2, (s-b)/2, (s-c)/2 is 1/4 times a row; with d(4 atan(sqrt(p))) that gives the 8 below.
        signs = np.array([[1, -1, 1, 1], [1, 1, -1, 1], [1, 1, 1, -1]], dtype=np.float64)
        slope = 4.0 / (1.0 + product) * (u @ signs.T) / (8.0 * np.sqrt(product))
    error = np.sqrt(2.0) * sigma_rad * np.linalg.norm(slope, axis=-1)
    return np.where(np.isfinite(error), error, np.inf)


def field(corners: Floats) -> Floats:
    """Diameters (...,), radians, of the smallest circles that hold the triangles (3.5.1).

    That is the longest side of an obtuse triangle, else the circumscribed circle's diameter.
    """
    chord = np.sort(2.0 * np.sin(sides(corners) / 2.0), axis=-1)
    a, b, c = np.moveaxis(chord, -1, 0)
    # Circumscribed circle of the flat triangle of chords: d = 2 abc / sqrt(16 area^2), by Heron.
    heron = (a + b + c) * (b + c - a) * (a + c - b) * (a + b - c)
    with np.errstate(divide="ignore", invalid="ignore"):
        round_ = 2.0 * a * b * c / np.sqrt(np.maximum(heron, 0.0))
    # The chords are sorted, so c is the longest: obtuse when c^2 is more than the other two squares.
    width = np.where(a * a + b * b <= c * c, c, round_)
    return np.asarray(2.0 * np.arcsin(np.minimum(width / 2.0, 1.0)))


# Radon's seven points in barycentric coordinates: the centroid, and three each on two rings around it.
_ROOT = np.sqrt(15.0)
_NEAR, _FAR = (6.0 - _ROOT) / 21.0, (6.0 + _ROOT) / 21.0
POINTS = np.array(
    [[1 / 3, 1 / 3, 1 / 3]] + [np.roll([1.0 - 2.0 * p, p, p], k).tolist() for p in (_NEAR, _FAR) for k in range(3)]
)
WEIGHTS = np.array([270.0, *[155.0 - _ROOT] * 3, *[155.0 + _ROOT] * 3]) / 1200.0


def polar_moment(corners: Floats) -> Floats:
    """Polar moments (...,) in closed form: no recursion, and closer than the thesis' level 3.

    ``theta^2`` is integrated over the flat triangle through the corners, each point weighing as much sky as it
    covers, ``h / r^3`` at distance r from the centre of the sphere and h of the plane; Radon's seven points (1948)
    are exact to the fifth degree. The leading term is the flat triangle's ``A (a^2 + b^2 + c^2) / 36``.
    """
    centre = unit(corners.sum(axis=-2))
    #
    # n . corner
    #  is twice the flat area times the plane's distance h, whichever corner is taken.
    normal = cross_product(corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :])
    volume = np.abs((normal * corners[..., 0, :]).sum(axis=-1)) / 2.0  # flat area times h
    point = POINTS @ corners
    r = np.linalg.norm(point, axis=-1)
    theta = angles_between(point / r[..., None], centre[..., None, :])
    return np.asarray(volume * (theta * theta / r**3 @ WEIGHTS))


def polar_moment_sigma(moment: Floats, sigma_rad: float) -> Floats:
    """The thesis' bound of the moments' errors (...,): the line above figure 2.8.

    It was drawn for places off by 87.2665 / 3 microradians and grows with the error.
    """
    return np.asarray((7.14e-4 * moment + 3e-9) * (sigma_rad / (87.2665e-6 / 3.0)))


MOST_TRIANGLES = 4_000_000
"""Looked at: some seconds. The thesis' list and circle need 1.9 million."""


@frozen(eq=False)
class TriangleTable(FigureTable):
    """Triangles (T, 3), the smallest area first, with ``keys`` (T, 3) and ``moment`` (T,)."""

    keys: Ints
    moment: Floats


@frozen
class SphericalTriangles(PivotingMethod):
    """The spherical-triangle method; for its options see `PivotingMethod`."""

    paper: ClassVar[str] = "Spherical triangles, chapters 2.4 to 2.6 and 5.3"
    name: ClassVar[str] = "spherical_triangles"
    figure: ClassVar[str] = "triangle"
    corners: ClassVar[int] = 3
    fewest: ClassVar[int] = 4

    pivots: int = integer(3, "pivots", 1, 1000, "most pivots (table 6.2: 3)")

    def table(self, year: float = 2016.0) -> TriangleTable:
        """The catalogue's triangles for these options."""
        return triangle_table(self.limit_deg, self.brightest, self.mag_limit, year)

    def recognise(self, body: Floats, table: TriangleTable, sigma: float) -> tuple[Ints, Chain]:
        """The triangles (F, 3) of directions ``body`` (n, 3) and the chain that pivoting gives."""
        # 25 stars make 2,300 triangles of 15,625 triples: small enough to make them all and throw away the rest.
        i, j, k = np.meshgrid(*[np.arange(len(body))] * 3, indexing="ij")
        figures = np.stack([i, j, k], axis=-1)[(i < j) & (j < k)].astype(np.int64)
        figures = figures[field(body[figures]) <= np.radians(self.limit_deg)]
        corners = body[figures]
        size, error = area(corners), self.bound_sigma * area_sigma(corners, sigma)
        # Flat triangles have an infinite error and so match everything; the next line leaves them out.
        start, stop = between(table.values, size - error, size + error)
        use = stop - start <= self.most
        figures, size, start, stop = figures[use], size[use], start[use], stop[use]
        if len(figures) == 0:
            return figures, Chain(np.zeros(0, dtype=np.int64), None, 0, 0)
        order = pivot_order(size, two_shared(figures), self.pivots)
        moment = polar_moment(body[figures[order]])
        # The thesis' programs bound every moment by the error of the first triangle's (E.34, E.35).
        of = moment[:1].repeat(len(moment)) if self.as_printed else moment
        room = self.bound_sigma * polar_moment_sigma(of, sigma)
        lists = []
        for f, m, r in zip(order, moment, room, strict=True):
            inside = np.abs(table.moment[start[f] : stop[f]] - m) <= r
            lists.append(np.flatnonzero(inside) + start[f])
        return figures, pivot(order, lists, table.keys, self.as_printed)

    def named(self, figures: Ints, entries: Ints, body: Floats, sky: Floats) -> dict[int, set[int]]:
        """Corners of a chain of triangles (F, 3) paired by the sides.

        Parameters
        ----------
        figures : Ints
            Detections of each figure of the chain (F, c).
        entries : Ints
            Stars of the catalogue's entry for each (F, c).
        body : Floats
            Directions of the detections (D, 3), camera axes.
        sky : Floats
            ICRS unit vectors of the stars (N, 3).
        """
        stars_of: dict[int, set[int]] = {}
        for figure, entry in zip(figures, entries, strict=True):
            # An entry says which three stars, not which is which: of the six orders the sides choose.
            ways = np.array(list(permutations(entry.tolist())))
            off = np.square(sides(sky[ways]) - sides(body[figure])).sum(axis=1)
            for detection, star in zip(figure.tolist(), ways[off.argmin()].tolist(), strict=True):
                stars_of.setdefault(detection, set()).add(star)
        return stars_of


def two_shared(figures: Ints) -> Ints:
    """Keys (F, 3), one for each two stars of ascending ``figures`` (F, 3)."""
    # Two star numbers in one int64, so that pivoting compares one key instead of two.
    a, b, c = figures.T
    return np.stack([a << 32 | b, b << 32 | c, a << 32 | c], axis=1)


def triangle_table(limit_deg: float, brightest: int, mag_limit: float | None, year: float = 2016.0) -> TriangleTable:
    """Triangles of the catalogue; see `angle_table`.

    Parameters
    ----------
    limit_deg : float
        Size of the circle that holds one, degrees.
    brightest : int
        How many stars.
    mag_limit : float or None
        V down to which all stars count, in place of ``brightest``; None: not used.
    year : float
        Epoch of their places, Julian year.
    """
    return _tabled(limit_deg, None if mag_limit is not None else brightest, mag_limit, round(year))


@lru_cache(maxsize=2)
def _tabled(limit_deg: float, brightest: int | None, mag_limit: float | None, year: int) -> TriangleTable:
    """The table, from memory, from disk, or made."""
    pairs = catalogue_pairs(limit_deg, brightest=brightest, mag_limit=mag_limit, year=year)
    options = {"limit_deg": limit_deg, "brightest": brightest, "mag_limit": mag_limit, "year": year}
    found = cached_table("triangles", options, lambda: make_triangles(pairs, limit_deg))
    return triangles_of(pairs, found)


def triangles_of(pairs: Pairs, made: Arrays) -> TriangleTable:
    """The table of what `make_triangles` gave of ``pairs``."""
    stars = made["stars"].astype(np.int64)
    return TriangleTable(pairs, stars, made["area"], two_shared(stars), made["moment"])


def make_triangles(pairs: Pairs, limit_deg: float) -> Arrays:
    """``stars`` (T, 3) of ``pairs``, ``area`` (T,) ascending and ``moment`` (T,)."""
    order = np.lexsort((pairs.second, pairs.first))
    first, second = pairs.first[order].astype(np.int64), pairs.second[order].astype(np.int64)
    edges = first * pairs.stars + second
    start = np.searchsorted(first, second, "left")  # the pairs that begin with the second star
    end = np.searchsorted(first, second, "right")
    # A triangle is a path i < j < k of two pairs whose third pair is in the table too; paths are counted before
    # they are listed.
    if int((end - start).sum()) > MOST_TRIANGLES:
        raise UsageError(
            f"{pairs.stars} stars make too many triangles of up to {limit_deg:.3g} degrees: take"
            " fewer stars, or smaller triangles."
        )
    which, third = spread(start, end)
    closing = first[which] * pairs.stars + second[third]
    # edges ascends because the pairs were sorted by first and then second star.
    at = np.minimum(np.searchsorted(edges, closing), len(edges) - 1)
    whole = edges[at] == closing
    stars = np.stack([first[which], second[which], second[third]], axis=1)[whole]
    found = [(np.zeros((0, 3), dtype=np.int64), np.zeros(0), np.zeros(0))]
    for part in np.array_split(stars, max(1, len(stars) // 100_000)):  # to keep memory low
        inside = part[field(pairs.vectors[part]) <= np.radians(limit_deg)]
        corners = pairs.vectors[inside]
        found.append((inside, area(corners), polar_moment(corners)))
    stars, size, moment = (np.concatenate(column) for column in zip(*found, strict=True))
    rank = np.argsort(size, kind="stable")
    return {"stars": stars[rank].astype(np.int32), "area": size[rank], "moment": moment[rank]}
