"""The default method: quads of neighbouring stars, looked up by shape and verified.

Blind at any scale and for both parities. Where the scale is known and the stars are few, their
triangles are looked up first (:mod:`kochab.identification.triangles`): that needs fewer stars. Of quads,
the brightest detections are tried first; each stage takes more of them and allows larger errors. A
pointing is accepted only when chance cannot explain it (:mod:`kochab.identification.verification`),
whatever found it.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Floats, Ints
from kochab.core.attitude import Attitude
from kochab.core.camera import Camera
from kochab.core.errors import DamagedPatternsError
from kochab.core.frame import Detections, Hint
from kochab.core.progress import Progress, Task
from kochab.core.solution import Identification, Matches, NoSolution, Reason
from kochab.core.values import frozen
from kochab.identification import with_places
from kochab.identification.index import LEVEL_FIELDS_DEG, PER_FIELD, Volume, drop_fine, fine, shipped
from kochab.identification.quads import (
    SUPPOSED,
    FieldStars,
    Hypotheses,
    QuadQuery,
    QuadShapes,
    image_quads,
    propose,
    quad_marks,
)
from kochab.identification.verification import ACCEPT_LOG10, FEWEST, CandidatePointing, Verdict, support, verify
from kochab.text.translation import tr, tr_n

if TYPE_CHECKING:
    from kochab.identification.pair_table import PairTable
    from kochab.identification.triangles import KnownSearch

# -- One frame's search: which patterns to ask about, in what order, and which answers hold ----

POOR_SEARCH = 16  # frames with no more stars than this are searched exhaustively
CROWD = 400  # more pointings than this are thinned before the closer look
FINE = 3  # the volume that may have to be made first


@frozen
class SearchStage:
    """How deep one round of the search goes; see :func:`kochab.identification.quads.propose`.

    ``noise`` is the allowed error of a position in thousandths of the frame's larger side.
    ``focal`` are supposed focal lengths in units of the larger side: 0 supposes none.
    ``fine`` is whether the volume of small fields is asked too.
    """

    stars: int
    neighbours: int
    noise: float
    slack: float
    use: int  # brightest detections that a pointing is verified with
    focal: tuple[float, ...] = ()
    volume: int = 0
    spread: float = 2.0  # factor by which a level's field may miss the one that shows so many stars in the frame
    max_verified: int = 40  # most pointings that are verified one by one, the best supported first


WIDE = (2.5, 1.9, 1.42, 1.08, 0.83, 0.64, 0.5)  # the last two, of 70 deg and more, are rare
STAGES = (
    SearchStage(10, 5, 0.9, 0.003, 30, volume=1, max_verified=4, spread=1.6),
    SearchStage(10, 5, 0.9, 0.003, 30, volume=2, max_verified=4, spread=1.6),
    SearchStage(10, 5, 0.9, 0.003, 30, volume=3, max_verified=4, spread=1.6),
    SearchStage(14, 5, 0.9, 0.010, 40, focal=WIDE[:5], max_verified=20),
    SearchStage(18, 6, 0.9, 0.003, 40, volume=1, max_verified=20),
    SearchStage(18, 6, 0.9, 0.003, 40, volume=2, max_verified=20),
    SearchStage(18, 6, 0.9, 0.003, 40, volume=3, max_verified=20),
    SearchStage(30, 6, 1.0, 0.003, 50, volume=1),
    SearchStage(24, 6, 1.0, 0.012, 50, focal=WIDE, spread=3.0),
    SearchStage(30, 6, 1.0, 0.003, 50, volume=2),
    SearchStage(30, 6, 1.0, 0.003, 50, volume=3),
    SearchStage(40, 6, 1.0, 0.004, 60, volume=1, spread=3.0),
    SearchStage(40, 6, 1.0, 0.004, 60, volume=2, spread=3.0),
    SearchStage(40, 6, 1.0, 0.004, 60, volume=3, spread=3.0),
)


class Search:
    """One frame's search: what was tried already, and how many pointings."""

    def __init__(self, detections: Detections, hint: Hint | None) -> None:
        middle = np.array([(detections.width - 1) / 2, (detections.height - 1) / 2])
        self.xy = detections.xy - middle
        self.half = np.array([detections.width / 2, detections.height / 2])
        self.side = float(max(detections.width, detections.height))
        self.tried = 0
        self.earlier_tried = 0  # pointings of another search, which has counted them itself
        self.n_searches = 1  # so many searches may answer: each gets its share of the false alarms
        self.least = 0.0  # the smallest false-alarm bound of any pointing, log10
        self.asked = 0
        # what each volume was asked so far, and by that what the next stage asks of any volume alike
        self.history: dict[tuple[int, tuple[float, ...]], tuple[SearchStage, ...]] = {}
        self.shapes: dict[tuple[SearchStage, ...], tuple[QuadShapes | None, Ints]] = {}
        # fields of 127 down to 0.32 deg when nothing is known
        self.scale = (hint.focal_px if hint else None) or (0.25 * self.side, 180.0 * self.side)
        self.centre = None
        if hint is not None and hint.centre_deg is not None:
            from kochab.core.attitude import unit_vectors

            ra, dec, radius = hint.centre_deg
            self.centre = (unit_vectors(ra, dec), float(np.radians(radius)))

    def plan(self, stages: tuple[SearchStage, ...], volumes: tuple[Volume, ...]) -> list[SearchStage]:
        """The stages that the scale allows; of equal depth, the likeliest volume first."""
        kept = []
        narrow, wide = self.scale[1] / self.side, self.scale[0] / self.side
        smallest, largest = self.field_deg(self.scale[1]), self.field_deg(self.scale[0])
        for stage in stages:
            if stage.volume >= len(volumes):
                continue
            # In a field surely over 31 deg the shapes of flat pixels are not the sky's; in one surely under 19 deg
            # they are, whatever the focal length.
            if (narrow < 1.8 and not stage.focal) or (wide > 3.0 and stage.focal):
                continue
            first, last = volumes[stage.volume].span_deg
            low, high = self._per_field(stage)
            largest_wanted, smallest_wanted = largest * high, smallest * low
            # below the finest level of all there is still nothing better than that one
            if largest_wanted < first and stage.volume != FINE:
                continue
            if smallest_wanted > last:
                continue
            middle = math.sqrt(largest_wanted * smallest_wanted)
            miss = max(0.0, math.log(first / middle), math.log(middle / last))
            # depths: to 14 stars, 18 and 24, 30 and more; where the scale is vague, in the list's order within each
            kept.append((stage.stars // 15, miss if self.scale[1] < 2 * self.scale[0] else 0.0, stage))
        return [s for _, _, s in sorted(kept, key=lambda k: k[:2])]

    def wants_small_fields(self, stages: tuple[SearchStage, ...]) -> bool:
        """Whether the allowed scales reach down to fields that only the fine volume serves."""
        field = self.field_deg(self.scale[1])
        return any(field * self._per_field(s)[0] < LEVEL_FIELDS_DEG[2] for s in stages)

    def field_deg(self, focal_px: float) -> float:
        """The side of a square field as large as the frame's, degrees."""
        return math.degrees(2.0 * math.atan(math.sqrt(self.half[0] * self.half[1]) / focal_px))

    def allows(self, boresight: Floats, focal: Floats | float) -> NDArray[np.bool_]:
        """Whether the hint's place allows boresights (..., 3) with focal lengths (...), px."""
        if self.centre is None:
            return np.ones(np.shape(focal), dtype=bool)
        # the place may be anywhere in the frame: half a diagonal beside the boresight at most
        wide = np.arctan(np.hypot(*self.half) / focal)
        dot = boresight @ self.centre[0]
        return np.asarray(dot > np.cos(np.minimum(self.centre[1] + wide, np.pi)))

    def alarm(self, verdict: Verdict) -> float:
        """The verdict's false-alarm bound after counting all pointings and ways tried."""
        return min(0.0, verdict.log10_chance + math.log10(max(1, self.tried) * self.n_searches))

    def round(self, volume: Volume, stage: SearchStage) -> Iterator[Verdict]:
        """Accepted verdicts of one stage in one volume, best first."""
        view = FieldStars(self.xy, self.half, self.scale)
        shapes = self._shapes(view, stage)
        if shapes is None:
            return
        found = propose(volume, view, shapes)
        if self.centre is not None:
            found = found.take(self.allows(found.matrix[:, 2], found.focal))
        # all of them, before the quick look drops most: each was a chance of error
        self.tried += len(found)
        self.asked += shapes.quads
        yield from self._check(volume, view, stage, found)

    def _per_field(self, stage: SearchStage) -> tuple[float, float]:
        """Lowest and highest ratio of a level's field to the frame's, for stars so bright.

        A frame with hardly more stars than the stage takes may show all the catalogue has there, so
        that any finer level will do.
        """
        n = len(self.xy)
        density = math.sqrt(PER_FIELD / min(stage.stars, n))
        low = density / stage.spread if n >= 2 * stage.stars else 0.3
        return low, density * stage.spread

    def _shapes(self, view: FieldStars, stage: SearchStage) -> QuadShapes | None:
        """What ``stage`` asks that no stage before it has asked of its volume; None where that is nothing."""
        key = (stage.volume, stage.focal)
        before = self.history.get(key, ())
        now = self.history[key] = (*before, replace(stage, volume=0))
        if now not in self.shapes:
            old = self.shapes[before][1] if before else np.zeros(0, dtype=np.int64)
            quads = self._quads(stage)
            marks = quad_marks(quads)
            new = ~np.isin(marks, old)
            self.shapes[now] = self._asked(view, stage, quads[new]), np.concatenate([old, marks[new]])
        return self.shapes[now][0]

    def _quads(self, stage: SearchStage) -> Ints:
        # a poor frame is asked about in every way there is: its few stars cost little
        neighbours = stage.neighbours if len(self.xy) > POOR_SEARCH or stage.focal else 9
        return image_quads(self.xy[: stage.stars], neighbours, 12.0 * self._noise_px(stage))

    def _noise_px(self, stage: SearchStage) -> float:
        return stage.noise * self.side / 1000.0

    def _asked(self, view: FieldStars, stage: SearchStage, quads: Ints) -> QuadShapes | None:
        focal = None
        if stage.focal:
            supposed = np.array(stage.focal) * self.side
            supposed = supposed[(supposed * SUPPOSED >= self.scale[0]) & (supposed / SUPPOSED <= self.scale[1])]
            # one in the middle stands for all of them: a third of the time saved at 20 to 60 deg
            if len(supposed) > 1 and self.scale[1] <= self.scale[0] * SUPPOSED**2:
                supposed = np.array([math.sqrt(self.scale[0] * self.scale[1])])
            focal = np.repeat(supposed, len(quads))
            quads = np.tile(quads, (len(supposed), 1))
        if len(quads) == 0:
            return None
        query = QuadQuery(quads, focal, self._noise_px(stage), stage.slack, self._per_field(stage))
        return QuadShapes.of(view, query)

    def _check(self, volume: Volume, view: FieldStars, stage: SearchStage, found: Hypotheses) -> Iterator[Verdict]:
        reach = 0.010 * self.side
        votes, first = np.zeros(len(found), dtype=np.int64), 0
        if len(found) > CROWD:
            votes, first = support(volume, self.xy[:8], found, reach), 8
            found, votes = found.take(votes > 0), votes[votes > 0]
        votes = votes + support(volume, self.xy[first:16], found, reach, first)
        # fewer cannot pass: verification wants two stars besides the proposers as well
        order = np.argsort(-votes, kind="stable")[: min(stage.max_verified, int((votes > 1).sum()))]
        for h in order:
            start = CandidatePointing(found.matrix[h], float(found.focal[h]), bool(found.mirrored[h]))
            verdict = verify(
                volume,
                int(found.level[h]),
                view,
                start,
                found.detections[h],
                found.stars[h],
                reach,
                stage.use,
                ACCEPT_LOG10 - 6.0,  # believed even after a million pointings
            )
            if verdict is None:
                continue
            self.least = min(self.least, self.alarm(verdict))
            if self.alarm(verdict) < ACCEPT_LOG10:
                yield verdict


# -- What a search has found, in the words of ``core`` -----------------------------------------


def identification_of(
    verdict: Verdict,
    detections: Detections,
    rows: NDArray[np.integer],
    vectors: NDArray[np.floating],
    log10_false_alarm: float,
    tried: int,
) -> Identification:
    """The default method's answer from a verdict.

    Parameters
    ----------
    verdict : Verdict
        The pointing that was accepted and its matches.
    detections : Detections
        The frame's detections.
    rows : NDArray[np.integer]
        Catalogue rows (N,) of the stars that the verdict numbers.
    vectors : NDArray[np.floating]
        Their ICRS unit vectors (N, 3).
    log10_false_alarm : float
        Chance of a match by accident, log10.
    tried : int
        How many pointings were looked at.
    """
    p, w, h = verdict.pointing, detections.width, detections.height
    camera = Camera(w, h, p.focal, (w - 1) / 2, (h - 1) / 2, k1=p.k1, mirrored=p.mirrored)
    matches = Matches(
        verdict.detections.astype(np.int64),
        rows[verdict.stars].astype(np.int64),
        detections.xy[verdict.detections],
        vectors[verdict.stars].astype(np.float64),
    )
    return Identification(matches, camera, Attitude(p.matrix), log10_false_alarm, "patterns", tried)


# -- When the quick road of a known camera is taken, and what its answer is made of ------------

FEWEST_FOR_TRIANGLES, MOST_FOR_TRIANGLES = 3, 24
"""So many detections are looked at so; of more the quads make as short work without a table."""
COMPLETE = 6
"""Of so many detections quads have found none that triangles had not."""
POOR_FIELD = 8
"""Of so many detections all triangles are tried, else only those of the brightest."""
KNOWN, ROUGHLY = 1.03, 1.25
"""Highest over lowest scale: of any frame, and of one with few stars."""


PairsFor = Callable[[float, float], "PairTable | None"]
"""The pairs for a field, degrees, of which a frame shows so many stars and more."""


def known_camera(search: Search, pairs: PairsFor) -> tuple["KnownSearch", ...]:
    """The searches by triangles to make; none where the scale or the field is not for them.

    Where the stars are so few that chance has room, a table of fewer stars is asked first.
    """
    low, high = search.scale
    poor = len(search.xy) <= POOR_FIELD
    if high > low * (ROUGHLY if poor else KNOWN) or not FEWEST_FOR_TRIANGLES <= len(search.xy) <= MOST_FOR_TRIANGLES:
        return ()
    from kochab.identification.pair_table import DENSE, SPARSE
    from kochab.identification.triangles import BRIGHTEST, FEW, DetectionAngles, KnownSearch

    field_deg = search.field_deg((low * high) ** 0.5)
    wanted = (SPARSE, DENSE) if len(search.xy) <= FEW else (DENSE,)
    tables = [pairs(field_deg, density) for density in wanted]
    there = [table for table in tables if table is not None]
    if not there:
        return ()
    asked = POOR_FIELD if poor and high <= low * KNOWN else BRIGHTEST
    angles = DetectionAngles.of(search.xy[:asked], search.scale)
    # where the quads are asked as well, they are one more way to a false alarm
    search.n_searches = len(there) + (len(search.xy) > COMPLETE)
    return tuple(KnownSearch(t, search.xy, search.half, angles, search.n_searches) for t in there)


def triangle_search(
    search: Search, searches: tuple["KnownSearch", ...], detections: Detections
) -> Task[Identification | None]:
    """What the triangles say, if they say anything where the hint allows it."""
    for known in searches:
        yield Progress("identify", 0.0, "triangles of the known camera")
        for verdict in known.verdicts():
            p = verdict.pointing
            if search.allows(p.matrix[2], p.focal):
                table = known.table
                return identification_of(
                    verdict, detections, table.rows, table.vectors, verdict.log10_chance, known.tried
                )
        search.least = min(search.least, known.least)
        search.earlier_tried += known.tried
        search.asked += known.triangles
    return None


class Patterns:
    """Lost in space by quads; see the module's text.

    ``volumes`` are by default the installation's; ``pairs`` finds the table of triangles, by default one of theirs.
    """

    def __init__(
        self,
        volumes: tuple[Volume, ...] | None = None,
        stages: tuple[SearchStage, ...] = STAGES,
        pairs: PairsFor | None = None,
    ) -> None:
        self.volumes = volumes
        self.stages = stages
        self.pairs = pairs

    def identify(
        self, detections: Detections, hint: Hint | None = None, year: float = 2016.0
    ) -> Task[Identification | NoSolution]:
        """Name the stars of one frame; see :class:`kochab.identification.Identifier`.

        The first frame that only the patterns for small fields can answer waits while those are
        made, and says so. So does one that finds them damaged.
        """
        places = partial(self._identify, hint=hint, year=year)
        try:
            return (yield from with_places(detections, places))
        except DamagedPatternsError as error:
            if self.volumes is not None or not drop_fine(error.folder):
                raise
        return (yield from with_places(detections, places))

    def _identify(self, detections: Detections, hint: Hint | None, year: float) -> Task[Identification | NoSolution]:
        search = Search(detections, hint)
        known = known_camera(search, self.pairs or partial(self._table, year))
        found = yield from triangle_search(search, known, detections)
        if found is not None:
            return found
        if len(search.xy) < FEWEST:
            return NoSolution(
                Reason.TOO_FEW_STARS,
                tr("Expose longer or point at a richer part of the sky."),
                tr_n("{n} star", "{n} stars", len(search.xy)),
                len(detections),
            )
        if known and len(search.xy) <= COMPLETE:
            return self._none(search, detections)
        volumes = self.volumes
        if volumes is None:
            ready = fine()
            volumes = (*shipped(), ready) if ready else shipped()
        found = yield from self._search(search, volumes, self.stages, detections)
        if found is None and self.volumes is None and len(volumes) == FINE:
            # the other stages have failed already; the volume is made only for a scale that may need it
            late = tuple(s for s in self.stages if s.volume == FINE)
            if search.wants_small_fields(late):
                from kochab.identification.index_build import make_fine

                made = yield from make_fine()
                found = yield from self._search(search, (*volumes, made), late, detections)
        return found or self._none(search, detections)

    def _table(self, year: float, field_deg: float, density: float) -> "PairTable | None":
        from kochab.identification.pair_table import table_for

        return table_for(self.volumes or shipped(), field_deg, year, density)

    def _none(self, search: Search, detections: Detections) -> NoSolution:
        return NoSolution(
            Reason.NO_PATTERN_AGREED,
            tr("Check that the frame shows stars in focus."),
            tr("{n} pointings from {m} star patterns", n=search.earlier_tried + search.tried, m=search.asked),
            len(detections),
            measured={"pointings": search.earlier_tried + search.tried, "log10_false_alarm": search.least},
        )

    def _search(
        self, search: Search, volumes: tuple[Volume, ...], stages: tuple[SearchStage, ...], detections: Detections
    ) -> Task[Identification | None]:
        plan = search.plan(stages, volumes)
        for k, stage in enumerate(plan):
            yield Progress("identify", k / len(plan), f"{stage.stars} brightest stars")
            volume = volumes[stage.volume]
            for verdict in search.round(volume, stage):
                return identification_of(
                    verdict, detections, volume.rows, volume.stars, search.alarm(verdict), search.tried
                )
        return None
