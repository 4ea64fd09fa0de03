"""Triads: three detections at a time against catalogue stars as far apart and turned alike.

The thesis "Attitude from stellar images", chapter 2.3: angular separations of the brightest detections, lists of
catalogue pairs, triads, the rotation-angle test (2.3.4.1), the enclosed-angle test (2.3.4.2), grouping by mean
rotation, votes with a `vote number`, multiple stars merged and the final check of separations (2.3.4.3).
:mod:`kochab.lab.methods.triad_tests` finds triads that agree in separations and tests them, in fixed point
:mod:`kochab.lab.methods.triads_fixed_point`; here they are group_by_rotation and named (tables 4.2 to 4.4).
"""

import cmath
from bisect import bisect_left, insort
from typing import ClassVar

import numpy as np

from kochab.core.arrays import Floats, Ints
from kochab.core.frame import Detections, Hint
from kochab.core.progress import Progress, Task
from kochab.core.registry import choice, integer, number, pair, switch
from kochab.core.solution import Identification
from kochab.core.values import frozen
from kochab.identification import Answer
from kochab.lab.fixed_point import FixedPointOverflowError
from kochab.lab.methods import triad_tests, triads_fixed_point
from kochab.lab.methods.confirmation import AngularMethod, CandidateNames, confirm, known_focal, refused, table_deg
from kochab.lab.methods.pairs import Pairs, angles_between, catalogue_pairs
from kochab.lab.methods.triad_tests import (
    AngleUnit,
    FoundTriads,
    Tests,
    TooManyTriadsError,
    TriadBudget,
    TriadDetections,
    triads_by_separation,
    wrapped,
)


def group_by_rotation(triads: FoundTriads, tolerance: float) -> list[Ints]:
    """Triads whose rotation is within ``tolerance`` (rad) of their group's mean; largest first.

    One after the other, as in the thesis; each joins the group with the nearest mean.
    """
    groups: list[list[int]] = []
    total: list[complex] = []
    means: list[tuple[float, int]] = []  # the groups' mean rotations, ascending
    for triad, turn in enumerate(wrapped(triads.rotation).tolist()):
        place = bisect_left(means, (turn, -1))
        # Only the two means beside a rotation can be the nearest, and the modulo closes the circle at half a turn.
        adjacent = {(place - 1) % len(means), place % len(means)} if means else set()
        turns = ((abs((turn - means[k][0] + np.pi) % (2.0 * np.pi) - np.pi), k) for k in adjacent)
        gap, at = min(turns, default=(np.inf, -1))
        if gap <= tolerance:
            _, group = means.pop(at)
            groups[group].append(triad)
        else:
            group = len(groups)
            groups.append([triad])
            total.append(0j)
        # Unit vectors are summed because angles near half a turn have no mean as numbers.
        total[group] += cmath.rect(1.0, turn)
        insort(means, (cmath.phase(total[group]), group))
    return [np.array(g) for g in sorted(groups, key=len, reverse=True)]


def named(
    triads: FoundTriads, group: Ints, detections: int, pairs: Pairs, vote_number: int, merge_rad: float
) -> tuple[Ints, Floats]:
    """The star each detection is taken for (n,), -1 for none, and its extent (n,), radians.

    Possibilities that the camera would see as one star are merged under the brightest's name and their votes summed;
    the extent is how far the others are from it. A name needs more votes than any other.

    Parameters
    ----------
    triads : FoundTriads
        Those that passed the tests.
    group : Ints
        Numbers of those that agree on the rotation.
    detections : int
        How many there are, n.
    pairs : Pairs
        Of the catalogue, which the stars' numbers refer to.
    vote_number : int
        The fewest votes of a name.
    merge_rad : float
        How near stars are seen as one.
    """
    out, extent = np.full(detections, -1, dtype=np.int64), np.zeros(detections)
    seen, star = triads.detection[group].ravel(), triads.star[group].ravel()
    for k in np.unique(seen):
        stars, votes = np.unique(star[seen == k], return_counts=True)  # brightest first
        place = pairs.vectors[stars]
        gap = np.linalg.norm(place[:, None] - place[None], axis=2)
        close = gap <= merge_rad
        summed: list[int] = []
        reach: list[float] = []
        free = np.ones(len(stars), dtype=bool)
        for lead in range(len(stars)):
            mine = close[lead] & free if free[lead] else np.zeros(len(stars), dtype=bool)
            summed.append(int(votes[mine].sum()))
            reach.append(float(gap[lead][mine].max(initial=0.0)))
            free &= ~mine
        top = max(summed)
        # A tie names nobody: either star could be the one.
        if top >= vote_number and summed.count(top) == 1:
            out[k], extent[k] = stars[summed.index(top)], reach[summed.index(top)]
    return out, extent


def without_disagreeing(stars: Ints, extent: Floats, separation: Floats, pairs: Pairs, tolerance: float) -> Ints:
    """The same names without those whose separations disagree with the image's, worst first.

    Parameters
    ----------
    stars : Ints
        The star each detection is taken for (n,), -1 for none.
    extent : Floats
        How far a merged star's image may lie from it (n,), radians: allowed for.
    separation : Floats
        Of the detections (n, n), radians.
    pairs : Pairs
        Of the catalogue, with the stars' directions.
    tolerance : float
        How far separations may differ, radians.
    """
    out = stars.copy()
    while True:
        kept = np.flatnonzero(out >= 0)
        place = pairs.vectors[out[kept]]
        real = angles_between(place[:, None], place)
        room = tolerance + extent[kept][:, None] + extent[kept][None]
        off = np.abs(real - separation[np.ix_(kept, kept)]) > room
        # Two detections taken for one star disagree, however near they are.
        off |= (real == 0.0) & ~np.eye(len(kept), dtype=bool)
        wrong = off.sum(axis=1)
        if not len(kept) or wrong.max() == 0:
            return out
        out[kept[wrong.argmax()]] = -1


GRACE = 40_000_000  # triads more for all stars, once some have given the scale
GLANCE = 7  # so many of the brightest look for the scale first, where it is not known
LIKELIEST = 3  # so many scales, the nearest, are tried with all when that has found nothing


@frozen
class Triads(AngularMethod):
    """The method and its options, the thesis' values (section 4.2.1) as defaults.

    ``field_deg`` is for frames whose pixels are not square: separations then follow equation 2.4 with a scale for
    each axis, as in the thesis; otherwise the scale of the hint and the gnomonic camera are used. ``planar`` takes
    right ascension and declination for plane coordinates in the rotation-angle test, as the thesis does for the
    sake of its processor. That fails far from the equator; the default does it on the sphere, which the thesis
    recommends where floats are at hand.
    """

    paper: ClassVar[str] = "Attitude from stellar images, chapters 2 and 3"
    fewest: ClassVar[int] = 3

    stars: int = integer(12, "stars", 3, 15, "brightest detections used")
    separation_deg: float = number(0.15, "deg", 0.001, 1.0, "tolerance of a separation")
    rotation_deg: float = number(5.0, "deg", 0.1, 20.0, "tolerance of the rotation-angle test")
    enclosed_deg: float = number(1.0, "deg", 0.1, 20.0, "tolerance of the enclosed-angle test")
    group_deg: float = number(5.0, "deg", 0.1, 20.0, "tolerance of grouping by rotation")
    vote_number: int = integer(2, "triads", 1, 50, "fewest triads that give a star its name")
    merge_px: float = number(8.0, "px", 0.0, 50.0, "catalogue stars closer than this are seen as one")
    mag_limit: float = number(6.0, "mag V", 3.0, 7.0, "faintest catalogue star")
    dec_deg: tuple[float, float] = pair(
        (-90.0, 90.0), "deg", -90.0, 90.0, "declinations searched (the thesis: 30 to 90)"
    )
    field_deg: tuple[float, float] | None = pair(
        None, "deg", 0.1, 40.0, "width and height of the frame", "by the hint's scale"
    )
    planar: bool = switch(False, "rotations in plane coordinates, as the thesis has them")
    arithmetic: str = choice("float", ("float", "fixed"), "fixed: 32-bit integers and look-up tables, chapter 3")
    scales: int = integer(15, "scales", 1, 101, "scales tried within the hint's range (the thesis knows its own: 1)")
    most: int = integer(60, "million triads", 1, 10_000, "of the catalogue looked at before it is given up")

    def focal_px(self, detections: Detections, hint: Hint | None) -> float | None:
        """That of ``field_deg``, or the hint's."""
        if self.field_deg is None:
            return known_focal(hint)
        return detections.width / 2.0 / float(np.tan(np.radians(self.field_deg[0]) / 2.0))

    def search(self, detections: Detections, focal: float, hint: Hint | None, year: float) -> Task[Answer]:
        """Name the stars of a frame.

        Parameters
        ----------
        detections : Detections
            Of one frame; every one has a place.
        focal : float
            Focal length, px.
        hint : Hint or None
            What else is known of the frame; None: nothing.
        year : float
            Epoch of the stars' places, Julian year.
        """
        yield Progress("identify", 0.0, "pairs of catalogue stars")
        pairs = catalogue_pairs(table_deg(detections, focal), mag_limit=self.mag_limit, year=year)
        pairs = pairs.within_declinations(*self.dec_deg)
        scales = self._scales(detections, focal, hint)
        plan = [(self.stars, focal * scale) for scale in scales]
        if len(scales) > 1 and min(self.stars, len(detections)) > GLANCE:
            # 7 stars make 35 triads and 12 make 220: the glance tries every scale for a sixth of the work.
            plan = [(GLANCE, focal * scale) for scale in scales] + plan[:LIKELIEST]
        budget = TriadBudget(self.most * 1_000_000)
        try:
            for stars, length in plan:
                found = yield from self._at_scale(stars, detections, pairs, length, year, budget)
                if found is not None and stars < self.stars:  # the scale is known now: the others' turn
                    budget.left += GRACE
                    length = found.camera.focal_px
                    whole = yield from self._at_scale(self.stars, detections, pairs, length, year, budget)
                    return whole or found
                if found is not None:
                    return found
        except FixedPointOverflowError as error:
            return refused(detections, f"fixed-point arithmetic: {error}")
        except TooManyTriadsError:
            return refused(
                detections,
                f"{self.most} million triads of catalogue stars, the most it looks at; a field so "
                "wide needs a closer scale",
            )
        return refused(detections, f"{budget.named} stars got names, too few to be sure")

    def _at_scale(
        self, stars: int, detections: Detections, pairs: Pairs, focal: float, year: float, budget: TriadBudget
    ) -> Task[Identification | None]:
        """The answer with one focal length, px; the ``stars`` brightest detections form triads."""
        bright = detections.take(slice(0, stars))
        tests = Tests(*np.radians([self.separation_deg, self.rotation_deg, self.enclosed_deg]))
        reach = max(np.radians(self.separation_deg) * focal, 3.0)
        # Radians a pixel at the centre.
        pixel = 1.0 / focal
        if self.field_deg is not None:  # the larger side of a pixel on the sky
            pixel = float(np.max(np.radians(self.field_deg) / [bright.width, bright.height]))
        merge = self.merge_px * pixel
        fixed = self.arithmetic == "fixed"
        sight = TriadDetections.of(bright, focal, False, self.field_deg)
        separation = triads_fixed_point.separations(sight) if fixed else sight.separation
        unit = triads_fixed_point.DEGREES if fixed else AngleUnit()
        seen, real, looked = yield from triads_by_separation(pairs, separation, tests.separation, unit, budget)
        # confirm() must count the pairs of every scale and parity tried so far, those of this one included.
        before, budget.tried = budget.tried, budget.tried + 2 * looked
        # Separations do not depend on the parity, so the triads are found once and only the tests are repeated.
        for mirrored in (False, True):
            sight = TriadDetections.of(bright, focal, mirrored, self.field_deg)
            if fixed:
                triads = triads_fixed_point.passing_triads(sight, seen, real, pairs, tests)
            else:
                triads = triad_tests.passing_triads(sight, seen, real, pairs, tests, self.planar)
            groups = group_by_rotation(triads, np.radians(self.group_deg))
            for group in groups:
                if len(group) < len(groups[0]):
                    break  # only the groups with the most triads are considered
                votes = named(triads, group, len(sight.body), pairs, self.vote_number, merge)
                taken = without_disagreeing(*votes, unit.radians(separation), pairs, tests.separation)
                kept = np.flatnonzero(taken >= 0)
                budget.named = max(budget.named, len(kept))
                rows, vectors = pairs.rows[taken[kept]], pairs.vectors[taken[kept]]
                tried = 2 * (before + (1 + mirrored) * looked)  # each pair both ways round
                names = CandidateNames(kept, rows, vectors, tried, mirrored)
                found = confirm(detections, names, focal, reach, year, "triads")
                if found is not None:
                    return found
        return None

    def _scales(self, detections: Detections, focal: float, hint: Hint | None) -> list[float]:
        """Factors of the focal length to try, those near one first.

        The thesis knows its camera. A hint is a range: the tolerance of separations absorbs an
        error of the scale of ``separation_deg`` over the field, and the next factor is twice that.
        """
        if self.field_deg is not None or hint is None or hint.scale_arcsec_px is None:
            return [1.0]
        low, high = hint.scale_arcsec_px
        # A scale off by s shifts a separation by s times the field at most; the tolerance takes it either way.
        step = 2.0 * self.separation_deg / table_deg(detections, focal)
        rungs = min(int(np.ceil(np.log(high / low) / 2.0 / np.log1p(step) - 0.1)), self.scales // 2)
        ladder = sorted(range(-rungs, rungs + 1), key=abs)
        return [float((1.0 + step) ** k) for k in ladder]
