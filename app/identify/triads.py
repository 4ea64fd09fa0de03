"""Triads: three detections at a time against catalogue stars as far apart and turned alike.

The thesis "Attitude from stellar images", chapter 2.3: angular separations of the brightest
detections, lists of catalogue pairs, triads, the rotation-angle test (2.3.4.1), the enclosed-angle
test (2.3.4.2), grouping by mean rotation, votes with a `vote number`, multiple stars merged and the
final check of separations (2.3.4.3). The rooms: :mod:`app.identify.triad_search` finds triads that
agree in separations, :mod:`app.identify.triad_tests` and :mod:`app.identify.triad_fixed` test them
in floating and in fixed point, :mod:`app.identify.triad_votes` groups and names.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from app.core.detections import Detections
from app.core.fixed_point import FixedPointOverflowError
from app.core.hint import Hint
from app.core.options import choice, integer, number, pair, switch
from app.core.progress import Progress, Task
from app.core.solution import Identification, NoSolution
from app.identify import triad_fixed, triad_tests
from app.identify.confirm import Names, confirm
from app.identify.finite import with_places
from app.identify.pairs import Pairs, catalogue_pairs
from app.identify.refusals import known_focal, no_scale, not_agreed, table_deg, too_few
from app.identify.triad_search import (
    Allowance,
    Sight,
    TooManyTriadsError,
    Unit,
    separated,
)
from app.identify.triad_tests import Tests
from app.identify.triad_votes import agreeing, grouped, named

Floats = NDArray[np.float64]
GRACE = 40_000_000  # triads more for all stars, once some have told the scale
GLANCE = 7  # so many of the brightest look for the scale first, where it is not known
LIKELIEST = 3  # so many scales, the nearest, are tried with all when that has found nothing


@dataclass(frozen=True, slots=True)
class Triads:
    """The method and its options, the thesis' values (section 4.2.1) as defaults.

    ``field_deg`` is for frames whose pixels are not square: separations then follow equation 2.4
    with a scale for each axis, as in the thesis; otherwise the scale of the hint and the gnomonic
    camera are used. ``planar`` takes right ascension and declination for plane coordinates in the
    rotation-angle test, as the thesis does for the sake of its processor. That fails far from the
    equator; the default does it on the sphere, which the thesis recommends where floats are at
    hand.
    """

    paper: ClassVar[str] = "Attitude from stellar images, chapters 2 and 3"

    stars: int = integer(12, "stars", 3, 15, "brightest detections used")
    separation_deg: float = number(0.15, "deg", 0.001, 1.0, "tolerance of a separation")
    rotation_deg: float = number(5.0, "deg", 0.1, 20.0, "tolerance of the rotation-angle test")
    enclosed_deg: float = number(1.0, "deg", 0.1, 20.0, "tolerance of the enclosed-angle test")
    group_deg: float = number(5.0, "deg", 0.1, 20.0, "tolerance of grouping by rotation")
    vote_number: int = integer(2, "triads", 1, 50, "fewest triads that give a star its name")
    merge_px: float = number(
        8.0, "px", 0.0, 50.0, "catalogue stars closer than this are seen as one"
    )
    mag_limit: float = number(6.0, "mag V", 3.0, 7.0, "faintest catalogue star")
    dec_deg: tuple[float, float] = pair(
        (-90.0, 90.0), "deg", -90.0, 90.0, "declinations searched (the thesis: 30 to 90)"
    )
    field_deg: tuple[float, float] | None = pair(
        None, "deg", 0.1, 40.0, "width and height of the frame", "by the hint's scale"
    )
    planar: bool = switch(False, "rotations in plane coordinates, as the thesis has them")
    arithmetic: str = choice(
        "float", ("float", "fixed"), "fixed: 32-bit integers and look-up tables, chapter 3"
    )
    scales: int = integer(
        15, "scales", 1, 101, "scales tried within the hint's range (the thesis knows its own: 1)"
    )
    most: int = integer(
        60, "million triads", 1, 10_000, "of the catalogue looked at before it is given up"
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
        if self.field_deg is not None:
            focal = detections.width / 2.0 / float(np.tan(np.radians(self.field_deg[0]) / 2.0))
        if focal is None:
            return no_scale(detections)
        if len(detections) < 3:
            return too_few(detections, 3)
        yield Progress("identify", 0.0, "pairs of catalogue stars")
        pairs = catalogue_pairs(
            table_deg(detections, focal), mag_limit=self.mag_limit, year=year
        ).within_declinations(*self.dec_deg)
        scales = self._scales(detections, focal, hint)
        plan = [(self.stars, focal * scale) for scale in scales]
        if len(scales) > 1 and min(self.stars, len(detections)) > GLANCE:
            plan = [(GLANCE, focal * scale) for scale in scales] + plan[:LIKELIEST]
        most = tried = 0
        allowance = Allowance(self.most * 1_000_000)
        try:
            for stars, length in plan:
                found, named_, looked = yield from self._at_scale(
                    detections.take(slice(0, stars)),
                    detections,
                    pairs,
                    length,
                    year,
                    tried,
                    allowance,
                )
                tried += 2 * looked
                most = max(most, named_)
                if found is None:
                    continue
                if stars < self.stars:  # the scale is known now: the others' turn
                    whole, _, _ = yield from self._at_scale(
                        detections.take(slice(0, self.stars)), detections, pairs,
                        found.camera.focal_px, year, tried, Allowance(allowance.left + GRACE),
                    )  # fmt: skip
                    return whole or found
                return found
        except FixedPointOverflowError as error:
            return not_agreed(detections, f"fixed-point arithmetic: {error}")
        except TooManyTriadsError:
            return not_agreed(
                detections,
                f"{self.most} million triads of catalogue stars, the most it looks at; a field so "
                "wide needs its scale told more closely",
            )
        return not_agreed(detections, f"{most} stars got names, too few to be sure")

    def _at_scale(
        self, bright: Detections, everyone: Detections, pairs: Pairs, focal: float, year: float,
        before: int, allowance: Allowance,
    ) -> Task[tuple[Identification | None, int, int]]:  # fmt: skip
        """The answer with one focal length, px, how many got names, the pairs looked at a parity.

        ``bright`` are the detections that form triads, ``before`` the pairs looked at until now.
        """
        tests = Tests(*np.radians([self.separation_deg, self.rotation_deg, self.enclosed_deg]))
        reach = max(np.radians(self.separation_deg) * focal, 3.0)
        merge = self.merge_px * self._widest_pixel(bright, focal)
        fixed = self.arithmetic == "fixed"
        sight = Sight.of(bright, focal, False, self.field_deg)
        separation = triad_fixed.separations(sight) if fixed else sight.separation
        unit = triad_fixed.DEGREES if fixed else Unit()
        seen, stars, looked = yield from separated(
            pairs, separation, tests.separation, unit, allowance
        )
        most = 0
        for mirrored in (False, True):
            sight = Sight.of(bright, focal, mirrored, self.field_deg)
            if fixed:
                triads = triad_fixed.passed(sight, seen, stars, pairs, tests)
            else:
                triads = triad_tests.passed(sight, seen, stars, pairs, tests, self.planar)
            groups = grouped(triads, np.radians(self.group_deg))
            for group in groups:
                if len(group) < len(groups[0]):
                    break  # only the groups with the most triads are considered
                votes = named(triads, group, len(sight.body), pairs, self.vote_number, merge)
                taken = agreeing(*votes, unit.radians(separation), pairs, tests.separation)
                kept = np.flatnonzero(taken >= 0)
                most = max(most, len(kept))
                rows, vectors = pairs.rows[taken[kept]], pairs.vectors[taken[kept]]
                tried = 2 * (before + (1 + mirrored) * looked)  # each pair both ways round
                names = Names(kept, rows, vectors, tried, mirrored)
                found = confirm(everyone, names, focal, reach, year, "triads")
                if found is not None:
                    return found, most, looked
        return None, most, looked

    def _scales(self, detections: Detections, focal: float, hint: Hint | None) -> list[float]:
        """Factors of the focal length to try, those near one first.

        The thesis knows its camera. A hint is a range: the tolerance of separations absorbs an
        error of the scale of ``separation_deg`` over the field, and the next factor is twice that.
        """
        if self.field_deg is not None or hint is None or hint.scale_arcsec_px is None:
            return [1.0]
        low, high = hint.scale_arcsec_px
        step = 2.0 * self.separation_deg / table_deg(detections, focal)
        rungs = min(int(np.ceil(np.log(high / low) / 2.0 / np.log1p(step) - 0.1)), self.scales // 2)
        ladder = sorted(range(-rungs, rungs + 1), key=abs)
        return [float((1.0 + step) ** k) for k in ladder]

    def _widest_pixel(self, detections: Detections, focal_px: float) -> float:
        """The larger side of a pixel on the sky, radians."""
        if self.field_deg is None:
            return 1.0 / focal_px
        wide, high = np.radians(self.field_deg)
        return float(max(wide / detections.width, high / detections.height))
