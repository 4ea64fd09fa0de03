"""The default method: quads of neighbouring stars, looked up by shape, voted on and verified.

Blind at any scale and for both parities. The brightest detections are tried first; each stage
takes more of them and allows larger errors. A pointing is accepted only when chance cannot explain
it (:mod:`app.identify.chance`), whatever the stage that found it.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import Attitude
from app.core.camera import Camera
from app.core.detections import Detections
from app.core.hint import Hint
from app.core.progress import Progress, Task
from app.core.solution import Identification, Matches, NoSolution, Reason
from app.identify.hypotheses import (
    SUPPOSED,
    Hypotheses,
    Question,
    View,
    propose,
)
from app.identify.imagequads import image_quads, quad_marks
from app.identify.index import Volume
from app.identify.levels import LEVEL_FIELDS_DEG, PER_FIELD
from app.identify.support import support
from app.identify.verify import FEWEST, Pointing, Verdict, verify
from app.identify.volumes import fine, make_fine, shipped

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ACCEPT_LOG10 = -6.0
CROWD = 600  # more pointings than this are thinned to those in company
MAX_CANDIDATES = 40  # pointings verified in one stage and volume


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
    alone: int = 60


WIDE = (2.5, 1.9, 1.42, 1.08, 0.83, 0.64, 0.5)
STAGES = (
    Stage(10, 6, 0.9, 0.003, 30, volume=1, alone=10, spread=1.6),
    Stage(10, 6, 0.9, 0.003, 30, volume=2, alone=10, spread=1.6),
    Stage(14, 5, 0.9, 0.010, 40, focal=WIDE, alone=20),
    Stage(18, 6, 0.9, 0.003, 40, volume=1, alone=20),
    Stage(18, 6, 0.9, 0.003, 40, volume=2, alone=20),
    Stage(30, 6, 1.0, 0.003, 50, volume=1),
    Stage(24, 6, 1.0, 0.012, 50, focal=WIDE, spread=3.0),
    Stage(30, 6, 1.0, 0.003, 50, volume=2),
    Stage(40, 6, 1.0, 0.004, 60, volume=1, spread=3.0),
    Stage(40, 6, 1.0, 0.004, 60, volume=2, spread=3.0),
)


FINE = 2  # the volume that may have to be made first


class Patterns:
    """Lost in space by quads; see the module's text.

    ``volumes`` are the shipped ones and, for tests, all there are; by default the installation's.
    """

    def __init__(
        self, volumes: tuple[Volume, ...] | None = None, stages: tuple[Stage, ...] = STAGES
    ) -> None:
        self.volumes = volumes
        self.stages = stages

    def identify(
        self, detections: Detections, hint: Hint | None = None, year: float = 2016.0
    ) -> Task[Identification | NoSolution]:
        """Name the stars of one frame; see :class:`app.identify.Identifier`.

        The first frame that only the patterns for small fields can answer waits while those are
        made, and says so.
        """
        search = Search(detections, hint)
        if len(search.xy) < FEWEST:
            return NoSolution(
                Reason.TOO_FEW_STARS,
                "Expose longer or point at a richer part of the sky.",
                f"{len(search.xy)} stars",
                len(detections),
            )
        volumes = self.volumes
        if volumes is None:
            ready = fine()
            volumes = (*shipped(), ready) if ready else shipped()
        found = yield from self._search(search, volumes, self.stages, detections)
        if found is None and self.volumes is None and len(volumes) == FINE:
            late = tuple(s for s in self.stages if s.volume == FINE)
            if search.wants_small_fields(late):
                made = yield from make_fine()
                found = yield from self._search(search, (*volumes, made), late, detections)
        return found or NoSolution(
            Reason.NO_PATTERN_AGREED,
            "Check that the frame shows stars in focus.",
            f"{search.tried} pointings from {search.asked} star patterns",
            len(detections),
        )

    def _search(
        self,
        search: "Search",
        volumes: tuple[Volume, ...],
        stages: tuple[Stage, ...],
        detections: Detections,
    ) -> Task[Identification | None]:
        plan = search.plan(stages, volumes)
        for k, stage in enumerate(plan):
            yield Progress("identify", k / len(plan), f"{stage.stars} brightest stars")
            volume = volumes[stage.volume]
            for verdict in search.round(volume, stage):
                return self._answer(volume, search, verdict, detections)
        return None

    def _answer(
        self, volume: Volume, search: "Search", verdict: Verdict, detections: Detections
    ) -> Identification:
        p = verdict.pointing
        w, h = detections.width, detections.height
        camera = Camera(
            w, h, p.focal, (w - 1) / 2, (h - 1) / 2, k1=p.k1, mirrored=p.mirrored
        )  # fmt: skip
        matches = Matches(
            verdict.detections,
            volume.rows[verdict.stars].astype(np.int64),
            detections.xy[verdict.detections],
            volume.stars[verdict.stars].astype(np.float64),
        )
        return Identification(
            matches, camera, Attitude(p.matrix), search.alarm(verdict), "patterns", search.tried
        )


class Search:
    """One frame's search: what was tried already, and how many pointings."""

    def __init__(self, detections: Detections, hint: Hint | None) -> None:
        middle = np.array([(detections.width - 1) / 2, (detections.height - 1) / 2])
        self.xy = detections.xy - middle
        self.half = np.array([detections.width / 2, detections.height / 2])
        self.side = float(max(detections.width, detections.height))
        self.tried = 0
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
        for stage in stages:
            if stage.volume >= len(volumes):
                continue
            narrow, wide = self.scale[1] / self.side, self.scale[0] / self.side
            if (narrow < 1.8 and not stage.focal) or (wide > 3.0 and stage.focal):
                continue
            fields = volumes[stage.volume].fields_deg
            want = np.degrees(2 * np.arctan(np.sqrt(np.prod(self.half)) / np.array(self.scale)))
            want = want * self._per_field(stage)[::-1]
            if want[0] < fields[0] and stage.volume != FINE:
                continue
            if want[1] > fields[-1]:
                continue
            middle = np.sqrt(want[0] * want[1])
            miss = max(0.0, np.log(fields[0] / middle), np.log(middle / fields[-1]))
            kept.append(
                (stage.stars // 15, miss if self.scale[1] < 2 * self.scale[0] else 0.0, stage)
            )
        return [s for _, _, s in sorted(kept, key=lambda k: k[:2])]

    def wants_small_fields(self, stages: tuple[Stage, ...]) -> bool:
        """Whether the allowed scales reach down to fields that only the fine volume serves."""
        field = np.degrees(2 * np.arctan(np.sqrt(np.prod(self.half)) / self.scale[1]))
        return any(field * self._per_field(s)[0] < LEVEL_FIELDS_DEG[4] for s in stages)

    def alarm(self, verdict: Verdict) -> float:
        """The verdict's false-alarm bound after counting all pointings tried."""
        return min(0.0, verdict.log10_tail + float(np.log10(max(1, self.tried))))

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
            dot = found.matrix[:, 2] @ self.centre[0]
            wide = np.arctan(np.hypot(*self.half) / found.focal)
            found = found.take(dot > np.cos(np.minimum(self.centre[1] + wide, np.pi)))
        self.tried += len(found)
        self.asked += len(quads)
        yield from self._check(volume, view, stage, found)

    def _per_field(self, stage: Stage) -> tuple[float, float]:
        """Lowest and highest ratio of a level's field to the frame's, for stars so bright.

        A frame with fewer stars than the stage would take shows all the catalogue has there, so
        that any finer level will do.
        """
        n = len(self.xy)
        density = float(np.sqrt(PER_FIELD / min(stage.stars, n)))
        low = density / stage.spread if n > stage.stars else 0.3
        return low, density * stage.spread

    def _new_quads(self, stage: Stage, noise: float) -> Ints:
        quads = image_quads(self.xy[: stage.stars], stage.neighbours, 12.0 * noise)
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
        looks = 8 if len(found) > 400 else 14
        extra = support(volume, self.xy[:looks], found, reach)
        votes = extra
        found, votes = found.take(extra > 0), extra[extra > 0]
        if looks == 8 and len(found):
            votes = support(volume, self.xy[:16], found, reach)
        order = np.argsort(-votes, kind="stable")[: stage.alone]
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
            if verdict is not None and self.alarm(verdict) < ACCEPT_LOG10:
                yield verdict
