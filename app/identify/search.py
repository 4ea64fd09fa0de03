"""One frame's search: which patterns to ask about, in what order, and which answers hold."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.core.detections import Detections
from app.core.hint import Hint
from app.identify.chance import ACCEPT_LOG10
from app.identify.hypotheses import SUPPOSED, Hypotheses, Question, View, propose
from app.identify.imagequads import image_quads, quad_marks
from app.identify.index import Volume
from app.identify.levels import LEVEL_FIELDS_DEG, PER_FIELD
from app.identify.support import support
from app.identify.verify import Pointing, Verdict, verify

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

POOR = 16  # frames with no more stars than this are searched exhaustively
CROWD = 400  # more pointings than this are thinned before the closer look
FINE = 2  # the volume that may have to be made first


@dataclass(frozen=True, slots=True)
class Stage:
    """How deep one round of the search goes; see :func:`app.identify.hypotheses.propose`.

    ``noise`` is the allowed error of a position in thousandths of the frame's larger side.
    ``focal`` are supposed focal lengths in units of the larger side: 0 supposes none.
    ``fine`` is whether the volume of small fields is asked too.
    """

    stars: int
    neighbours: int
    noise: float
    slack: float
    use: int
    focal: tuple[float, ...] = ()
    volume: int = 0
    spread: float = 2.0
    alone: int = 40


WIDE = (2.5, 1.9, 1.42, 1.08, 0.83, 0.64, 0.5)  # the last two, of 70 deg and more, are rare
STAGES = (
    Stage(10, 5, 0.9, 0.003, 30, volume=1, alone=4, spread=1.6),
    Stage(10, 5, 0.9, 0.003, 30, volume=2, alone=4, spread=1.6),
    Stage(14, 5, 0.9, 0.010, 40, focal=WIDE[:5], alone=20),
    Stage(18, 6, 0.9, 0.003, 40, volume=1, alone=20),
    Stage(18, 6, 0.9, 0.003, 40, volume=2, alone=20),
    Stage(30, 6, 1.0, 0.003, 50, volume=1),
    Stage(24, 6, 1.0, 0.012, 50, focal=WIDE, spread=3.0),
    Stage(30, 6, 1.0, 0.003, 50, volume=2),
    Stage(40, 6, 1.0, 0.004, 60, volume=1, spread=3.0),
    Stage(40, 6, 1.0, 0.004, 60, volume=2, spread=3.0),
)


class Search:
    """One frame's search: what was tried already, and how many pointings."""

    def __init__(self, detections: Detections, hint: Hint | None) -> None:
        middle = np.array([(detections.width - 1) / 2, (detections.height - 1) / 2])
        self.xy = detections.xy - middle
        self.half = np.array([detections.width / 2, detections.height / 2])
        self.side = float(max(detections.width, detections.height))
        self.tried = 0
        self.before = 0  # pointings of another search, which has counted them itself
        self.ways = 1  # so many searches may answer: each gets its share of the false alarms
        self.least = 0.0  # the smallest false-alarm bound of any pointing, log10
        self.asked = 0
        self.done: dict[tuple[int, tuple[float, ...]], Ints] = {}
        lo, hi = 0.25 * self.side, 180.0 * self.side
        if hint is not None and hint.scale_arcsec_px is not None:
            a, b = (206264.806 / s for s in hint.scale_arcsec_px)
            lo, hi = min(a, b), max(a, b)
        self.scale = (lo, hi)
        self.centre = None
        if hint is not None and hint.centre_deg is not None:
            from app.core.attitude import unit_vectors

            ra, dec, radius = hint.centre_deg
            self.centre = (unit_vectors(ra, dec), float(np.radians(radius)))

    def plan(self, stages: tuple[Stage, ...], volumes: tuple[Volume, ...]) -> list[Stage]:
        """The stages that the scale allows; of equal depth, the likeliest volume first."""
        kept = []
        narrow, wide = self.scale[1] / self.side, self.scale[0] / self.side
        smallest, largest = self.field_deg(self.scale[1]), self.field_deg(self.scale[0])
        for stage in stages:
            if stage.volume >= len(volumes):
                continue
            if (narrow < 1.8 and not stage.focal) or (wide > 3.0 and stage.focal):
                continue
            first, last = volumes[stage.volume].span_deg
            low, high = self._per_field(stage)
            largest_wanted, smallest_wanted = largest * high, smallest * low
            if largest_wanted < first and stage.volume != FINE:
                continue
            if smallest_wanted > last:
                continue
            middle = math.sqrt(largest_wanted * smallest_wanted)
            miss = max(0.0, math.log(first / middle), math.log(middle / last))
            kept.append(
                (stage.stars // 15, miss if self.scale[1] < 2 * self.scale[0] else 0.0, stage)
            )
        return [s for _, _, s in sorted(kept, key=lambda k: k[:2])]

    def wants_small_fields(self, stages: tuple[Stage, ...]) -> bool:
        """Whether the allowed scales reach down to fields that only the fine volume serves."""
        field = self.field_deg(self.scale[1])
        return any(field * self._per_field(s)[0] < LEVEL_FIELDS_DEG[4] for s in stages)

    def field_deg(self, focal_px: float) -> float:
        """The side of a square field as large as the frame's, degrees."""
        return math.degrees(2.0 * math.atan(math.sqrt(self.half[0] * self.half[1]) / focal_px))

    def allows(self, boresight: Floats, focal: Floats | float) -> NDArray[np.bool_]:
        """Whether the hint's place allows boresights (..., 3) with focal lengths (...), px."""
        if self.centre is None:
            return np.ones(np.shape(focal), dtype=bool)
        wide = np.arctan(np.hypot(*self.half) / focal)
        dot = boresight @ self.centre[0]
        return np.asarray(dot > np.cos(np.minimum(self.centre[1] + wide, np.pi)))

    def alarm(self, verdict: Verdict) -> float:
        """The verdict's false-alarm bound after counting all pointings and ways tried."""
        return min(0.0, verdict.log10_tail + math.log10(max(1, self.tried) * self.ways))

    def round(self, volume: Volume, stage: Stage) -> Iterator[Verdict]:
        """Accepted verdicts of one stage in one volume, best first."""
        noise = stage.noise * self.side / 1000.0
        quads = self._new_quads(stage, noise)
        focal = None
        if stage.focal:
            supposed = np.array(stage.focal) * self.side
            supposed = supposed[
                (supposed * SUPPOSED >= self.scale[0]) & (supposed / SUPPOSED <= self.scale[1])
            ]
            focal = np.repeat(supposed, len(quads))
            quads = np.tile(quads, (len(supposed), 1))
        if len(quads) == 0:
            return
        view = View(self.xy, self.half, self.scale)
        per_field = self._per_field(stage)
        found = propose(volume, view, Question(quads, focal, noise, stage.slack, per_field))
        if self.centre is not None:
            found = found.take(self.allows(found.matrix[:, 2], found.focal))
        self.tried += len(found)
        self.asked += len(quads)
        yield from self._check(volume, view, stage, found)

    def _per_field(self, stage: Stage) -> tuple[float, float]:
        """Lowest and highest ratio of a level's field to the frame's, for stars so bright.

        A frame with hardly more stars than the stage takes may show all the catalogue has there, so
        that any finer level will do.
        """
        n = len(self.xy)
        density = math.sqrt(PER_FIELD / min(stage.stars, n))
        low = density / stage.spread if n >= 2 * stage.stars else 0.3
        return low, density * stage.spread

    def _new_quads(self, stage: Stage, noise: float) -> Ints:
        # a poor frame is asked about in every way there is: its few stars cost little
        neighbours = stage.neighbours if len(self.xy) > POOR or stage.focal else 9
        quads = image_quads(self.xy[: stage.stars], neighbours, 12.0 * noise)
        marks = quad_marks(quads)
        key = (stage.volume, stage.focal)
        old = self.done.get(key, np.zeros(0, dtype=np.int64))
        new = ~np.isin(marks, old)
        self.done[key] = np.concatenate([old, marks[new]])
        return quads[new]

    def _check(
        self, volume: Volume, view: View, stage: Stage, found: Hypotheses
    ) -> Iterator[Verdict]:
        reach = 0.010 * self.side
        if len(found) > CROWD:
            found = found.take(support(volume, self.xy[:8], found, reach) > 0)
        votes = support(volume, self.xy[:16], found, reach)
        # fewer cannot pass: verification wants two stars besides the proposers as well
        order = np.argsort(-votes, kind="stable")[: min(stage.alone, int((votes > 1).sum()))]
        for h in order:
            start = Pointing(found.matrix[h], float(found.focal[h]), bool(found.mirrored[h]))
            verdict = verify(
                volume,
                int(found.level[h]),
                view,
                start,
                found.detections[h],
                found.stars[h],
                reach,
                stage.use,
                ACCEPT_LOG10 - 6.0,
            )
            if verdict is None:
                continue
            self.least = min(self.least, self.alarm(verdict))
            if self.alarm(verdict) < ACCEPT_LOG10:
                yield verdict
