"""The spherical-triangle method: area and polar moment, pivoting on two shared stars.

The thesis on spherical triangles, sections 2.4-2.6, 3.5, 3.8.2 and 5.3. Its 662,799 triangles took
four hours to list; here the brightest 8,118 stars make 1,112,819 from the pair table in a few
seconds, 31 MB on disk. The thesis has fewer because it has fewer angles, fewer than so many stars
would make if they were spread evenly over the sky.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import permutations
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from app.core.camera import Camera
from app.core.detections import Detections
from app.core.errors import UsageError
from app.core.hint import Hint
from app.core.options import integer, number, switch
from app.core.progress import Progress, Task
from app.core.solution import Identification, NoSolution
from app.identify.confirm import Names, confirm
from app.identify.finite import with_places
from app.identify.kvector import PARABOLIC, KVector, make_kvector
from app.identify.pairs import Pairs, catalogue_pairs
from app.identify.pivoting import Chain, approach, pivot_order
from app.identify.refusals import known_focal, no_scale, not_agreed, too_few
from app.identify.table_cache import kept
from app.identify.table_file import Arrays
from app.identify.triangle_features import (
    area,
    area_sigma,
    field,
    polar_moment,
    polar_moment_sigma,
    sides,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
MOST_TRIANGLES = 4_000_000
"""Looked at: some seconds. The thesis' list and circle need 1.9 million."""


@dataclass(frozen=True, slots=True)
class SphericalTriangles:
    """The method and its options, the thesis' values as defaults; for its errors see `Angles`."""

    paper: ClassVar[str] = "Spherical triangles, chapters 2.4 to 2.6 and 5.3"

    sigma_urad: float = number(
        87.2665 / 3.0, "microradian", 0.1, 1000.0, "error of a star's place a coordinate"
    )
    bound_sigma: float = number(
        3.0,
        "sigma",
        1.0,
        6.0,
        "half-width of a range in errors of area and moment (section 2.2.2: 3)",
    )
    sigma_px: float = number(0.2, "px", 0.0, 3.0, "the error is never taken to be less than this")
    limit_deg: float = number(
        6.94, "deg", 1.0, 10.0, "largest circle about a triangle (section 3.5: 6.94)"
    )
    stars: int = integer(25, "stars", 4, 60, "brightest detections used")
    brightest: int = integer(
        8118, "stars", 100, 10000, "brightest catalogue stars used (the thesis' list had 8,118)"
    )
    mag_limit: float | None = number(
        None, "mag V", 2.0, 8.0, "faintest catalogue star, instead of their number", "by number"
    )
    pivots: int = integer(3, "pivots", 1, 1000, "most pivots (table 6.2: 3)")
    most: int = integer(
        10_000, "solutions", 10, 1_000_000, "triangles with more are left out (6.1: 10,000)"
    )
    as_printed: bool = switch(
        False, "pivot as the thesis' programs do: give up when a pivot leaves more finalists"
    )

    def identify(
        self, detections: Detections, hint: Hint | None = None, year: float = 2016.0
    ) -> Task[Identification | NoSolution]:
        """Name the stars of one frame; see :class:`app.identify.Identifier`."""
        return (yield from with_places(detections, lambda d: self._identify(d, hint, year)))

    def _identify(
        self, detections: Detections, hint: Hint | None, year: float
    ) -> Task[Identification | NoSolution]:
        focal = known_focal(detections, hint)
        if focal is None:
            return no_scale(detections)
        if len(detections) < 4:
            return too_few(detections, 4)
        yield Progress("identify", 0.0, "triangles of the catalogue")
        table = triangle_table(self.limit_deg, self.brightest, self.mag_limit, year)
        yield Progress("identify", 0.5, "pivots")
        camera = Camera.centred(detections.width, detections.height, focal)
        body = camera.unproject(detections.xy[: self.stars])
        sigma = max(self.sigma_urad * 1e-6, self.sigma_px / focal)
        figures, chain = self.recognise(body, table, sigma)
        if chain.entries is not None:
            pairs = table.pairs
            seen, star = named(
                figures[chain.figures], table.stars[chain.entries], body, pairs.vectors
            )
            names = Names(seen, pairs.rows[star], pairs.vectors[star], 6 * chain.compared)
            reach = max(2.0, 2.0 * self.bound_sigma * sigma * focal)
            found = confirm(detections, names, focal, reach, year, "spherical_triangles")
            if found is not None:
                return found
        return not_agreed(detections, f"{chain.pivots} pivots from triangle to triangle")

    def recognise(self, body: Floats, table: "TriangleTable", sigma: float) -> tuple[Ints, Chain]:
        """The triangles (F, 3) of directions ``body`` (n, 3) and the chain that pivoting gives.

        ``sigma`` is the error of a direction a coordinate, radians.
        """
        i, j, k = np.meshgrid(*[np.arange(len(body))] * 3, indexing="ij")
        figures = np.stack([i, j, k], axis=-1)[(i < j) & (j < k)].astype(np.int64)
        figures = figures[field(body[figures]) <= np.radians(self.limit_deg)]
        corners = body[figures]
        size, error = area(corners), self.bound_sigma * area_sigma(corners, sigma)
        start, stop = table.index.between(size - error, size + error)
        use = stop - start <= self.most
        figures, size, start, stop = figures[use], size[use], start[use], stop[use]
        if len(figures) == 0:
            return figures, Chain(np.zeros(0, dtype=np.int64), None, 0, 0)
        order = pivot_order(size, two_shared(figures), self.pivots)
        moment = polar_moment(body[figures[order]])
        of = moment[:1].repeat(len(moment)) if self.as_printed else moment
        room = self.bound_sigma * polar_moment_sigma(of, sigma)
        lists = []
        for f, m, r in zip(order, moment, room, strict=True):
            inside = np.abs(table.moment[start[f] : stop[f]] - m) <= r
            lists.append(np.flatnonzero(inside) + start[f])
        return figures, approach(order, lists, table.keys, self.as_printed)


@dataclass(frozen=True, slots=True, eq=False)
class TriangleTable:
    """``stars`` (T, 3) of ``pairs``, smallest area first; ``moment`` (T,); ``keys`` (T, 3)."""

    pairs: Pairs
    stars: Ints
    keys: Ints
    moment: Floats
    index: KVector


def two_shared(figures: Ints) -> Ints:
    """Keys (F, 3), one for each two stars of ascending ``figures`` (F, 3)."""
    a, b, c = figures.T
    return np.stack([a << 32 | b, b << 32 | c, a << 32 | c], axis=1)


def triangle_table(
    limit_deg: float, brightest: int, mag_limit: float | None, year: float = 2016.0
) -> TriangleTable:
    """Triangles of the catalogue within circles of ``limit_deg``; see `angle_table`."""
    number = brightest if mag_limit is None else None
    return _tabled(limit_deg, number, mag_limit, round(year))


@lru_cache(maxsize=2)
def _tabled(
    limit_deg: float, brightest: int | None, mag_limit: float | None, year: int
) -> TriangleTable:
    """The table, from memory, from disk, or made."""
    pairs = catalogue_pairs(limit_deg, brightest=brightest, mag_limit=mag_limit, year=year)
    options = {
        "limit_deg": limit_deg, "brightest": brightest, "mag_limit": mag_limit, "year": year
    }  # fmt: skip
    found = kept("triangles", options, lambda: make_triangles(pairs, limit_deg))
    return triangles_of(pairs, found)


def triangles_of(pairs: Pairs, made: Arrays) -> TriangleTable:
    """The table of what `make_triangles` gave of ``pairs``."""
    stars = made["stars"].astype(np.int64)
    index = make_kvector(made["area"], PARABOLIC)
    return TriangleTable(pairs, stars, two_shared(stars), made["moment"], index)


def make_triangles(pairs: Pairs, limit_deg: float) -> Arrays:
    """``stars`` (T, 3) of ``pairs``, ``area`` (T,) ascending and ``moment`` (T,)."""
    order = np.lexsort((pairs.second, pairs.first))
    first, second = pairs.first[order].astype(np.int64), pairs.second[order].astype(np.int64)
    edges = first * pairs.stars + second
    start = np.searchsorted(first, second, "left")  # the pairs that begin with the second star
    end = np.searchsorted(first, second, "right")
    if int((end - start).sum()) > MOST_TRIANGLES:
        raise UsageError(
            f"{pairs.stars} stars make too many triangles of up to {limit_deg:.3g} degrees: take"
            " fewer stars, or smaller triangles."
        )
    which, third = pairs.spread(start, end)
    closing = first[which] * pairs.stars + second[third]
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


def named(figures: Ints, entries: Ints, body: Floats, sky: Floats) -> tuple[Ints, Ints]:
    """Detections and stars of a chain of triangles (F, 3), corners paired by the sides.

    A star that the chain names in two ways is left out.
    """
    told: dict[int, set[int]] = {}
    for figure, entry in zip(figures, entries, strict=True):
        ways = np.array(list(permutations(entry.tolist())))
        off = np.square(sides(sky[ways]) - sides(body[figure])).sum(axis=1)
        for detection, star in zip(figure.tolist(), ways[off.argmin()].tolist(), strict=True):
            told.setdefault(detection, set()).add(star)
    sure = {d: min(s) for d, s in told.items() if len(s) == 1}
    once = [d for d, s in sorted(sure.items()) if list(sure.values()).count(s) == 1]
    return np.array(once, dtype=np.int64), np.array([sure[d] for d in once], dtype=np.int64)
