"""The angle method: separations of two stars, narrowed down by pivoting on a shared star.

The thesis on spherical triangles, sections 2.2, 2.3, 3.8.1 and 5.2. The largest angle comes first;
each further one shares a star with the one before. Its table of 106,308 angles took a few hours;
the brightest 8,118 stars of this catalogue make 139,964 of them in hundredths of a second.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from app.core.camera import Camera
from app.core.detections import Detections
from app.core.hint import Hint
from app.core.options import integer, number, switch
from app.core.progress import Progress, Task
from app.core.solution import Identification, NoSolution
from app.identify.confirm import Names, confirm
from app.identify.finite import with_places
from app.identify.kvector import LINEAR, KVector, make_kvector
from app.identify.pairs import Pairs, catalogue_pairs
from app.identify.pivoting import Chain, approach, pivot_order
from app.identify.refusals import known_focal, no_scale, not_agreed, too_few

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Angles:
    """The method and its options, the thesis' values as defaults.

    Of the error of a star's place the thesis says 0.87 microradian in section 2.2.2; its programs
    use 87.2665 / 3, which is the reading that gives its results.
    """

    paper: ClassVar[str] = "Spherical triangles, chapters 2.2, 2.3 and 5.2"

    sigma_urad: float = number(
        87.2665 / 3.0, "microradian", 0.1, 1000.0, "error of a star's place a coordinate"
    )
    bound_sigma: float = number(
        3.0, "sigma", 1.0, 6.0, "half-width of a range in errors of the angle (section 2.2.2: 3)"
    )
    sigma_px: float = number(0.2, "px", 0.0, 3.0, "the error is never taken to be less than this")
    limit_deg: float = number(6.94, "deg", 1.0, 40.0, "largest angle used (section 3.3: 6.94)")
    stars: int = integer(25, "stars", 3, 60, "brightest detections used")
    brightest: int = integer(
        8118, "stars", 100, 20000, "brightest catalogue stars used (the thesis' list had 8,118)"
    )
    mag_limit: float | None = number(
        None, "mag V", 2.0, 8.0, "faintest catalogue star, instead of their number", "by number"
    )
    pivots: int = integer(9, "pivots", 1, 1000, "most pivots (table 6.2: 9)")
    most: int = integer(
        10_000, "solutions", 10, 1_000_000, "angles with more are left out (6.1: 10,000)"
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
        if len(detections) < 3:
            return too_few(detections, 3)
        yield Progress("identify", 0.0, "angles of the catalogue")
        table = angle_table(self.limit_deg, self.brightest, self.mag_limit, year)
        yield Progress("identify", 0.5, "pivots")
        camera = Camera.centred(detections.width, detections.height, focal)
        body = camera.unproject(detections.xy[: self.stars])
        sigma = max(self.sigma_urad * 1e-6, self.sigma_px / focal)
        figures, chain = self.recognise(body, table, sigma)
        if chain.entries is not None:
            seen, star = named(figures[chain.figures], table.stars[chain.entries])
            pairs = table.pairs
            names = Names(seen, pairs.rows[star], pairs.vectors[star], 2 * chain.compared)
            reach = max(2.0, 2.0 * self.bound_sigma * sigma * focal)
            found = confirm(detections, names, focal, reach, year, "angles")
            if found is not None:
                return found
        return not_agreed(detections, f"{chain.pivots} pivots from angle to angle")

    def recognise(self, body: Floats, table: "AngleTable", sigma: float) -> tuple[Ints, Chain]:
        """The angles (F, 2) of directions ``body`` (n, 3) and the chain that pivoting gives.

        ``sigma`` is the error of a direction a coordinate, radians.
        """
        figures = np.stack(np.triu_indices(len(body), 1), axis=1).astype(np.int64)
        cosine = np.clip((body[figures[:, 0]] * body[figures[:, 1]]).sum(axis=1), -1.0, 1.0)
        angle = np.arccos(cosine)
        bound = self.bound_sigma * np.sqrt(2.0) * sigma  # equation 2.15
        start, stop = table.index.between(
            np.cos(angle + bound), np.cos(np.maximum(angle - bound, 0.0))
        )
        use = (angle < np.radians(self.limit_deg)) & (stop - start <= self.most)
        figures, angle, start, stop = figures[use], angle[use], start[use], stop[use]
        if len(figures) == 0:
            return figures, Chain(np.zeros(0, dtype=np.int64), None, 0, 0)
        order = pivot_order(angle, figures, self.pivots)
        lists = [np.arange(start[f], stop[f]) for f in order]
        return figures, approach(order, lists, table.stars, self.as_printed)


@dataclass(frozen=True, slots=True, eq=False)
class AngleTable:
    """``stars`` (P, 2) of the pairs, the widest first, so that ``index`` has cosines ascending."""

    pairs: Pairs
    stars: Ints
    index: KVector


def angle_table(
    limit_deg: float, brightest: int, mag_limit: float | None, year: float = 2016.0
) -> AngleTable:
    """The angles of the catalogue up to ``limit_deg``; ``mag_limit`` overrides ``brightest``."""
    number = brightest if mag_limit is None else None
    return angles_of(catalogue_pairs(limit_deg, brightest=number, mag_limit=mag_limit, year=year))


@lru_cache(maxsize=4)
def angles_of(pairs: Pairs) -> AngleTable:
    """The angles of any pairs; kept while they are."""
    stars = np.stack([pairs.first, pairs.second], axis=1)[::-1].astype(np.int64)
    return AngleTable(pairs, stars, make_kvector(np.cos(pairs.angle[::-1]), LINEAR))


def named(figures: Ints, entries: Ints) -> tuple[Ints, Ints]:
    """Detections and stars of a chain of angles (F, 2) whose neighbours share a star.

    A star that the chain names in two ways is left out.
    """
    told: dict[int, set[int]] = {}
    for k in range(len(figures) - 1):
        ours = [set(map(int, figures[k])), set(map(int, figures[k + 1]))]
        theirs = [set(map(int, entries[k])), set(map(int, entries[k + 1]))]
        for mine, its in (
            (ours[0] & ours[1], theirs[0] & theirs[1]),
            (ours[0] - ours[1], theirs[0] - theirs[1]),
            (ours[1] - ours[0], theirs[1] - theirs[0]),
        ):
            for detection, star in zip(mine, its, strict=True):
                told.setdefault(detection, set()).add(star)
    sure = {d: min(s) for d, s in told.items() if len(s) == 1}
    once = [d for d, s in sorted(sure.items()) if list(sure.values()).count(s) == 1]
    return np.array(once, dtype=np.int64), np.array([sure[d] for d in once], dtype=np.int64)
