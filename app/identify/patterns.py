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
from app.identify.hypotheses import Hypotheses, View, agreement, propose
from app.identify.imagequads import image_quads, quad_marks
from app.identify.index import Volume
from app.identify.verify import Pointing, Verdict, verify

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ACCEPT_LOG10 = -6.0
MAX_CANDIDATES = 40  # pointings verified in one stage and volume


@dataclass(frozen=True, slots=True)
class Stage:
    """How deep one round of the search goes; see :func:`app.identify.hypotheses.propose`."""

    stars: int
    neighbours: int
    noise: float  # allowed error of a position, in thousandths of the frame's larger side
    slack: float
    use: int
    focal: tuple[float, ...] = (0.0,)  # supposed focal lengths in units of the larger side; 0: none
    k1: float = 0.0


STAGES = (
    Stage(10, 5, 0.9, 0.003, 30),
    Stage(18, 6, 0.9, 0.003, 40),
    Stage(30, 6, 1.0, 0.004, 50),
    Stage(16, 6, 1.5, 0.004, 40, focal=(1.45, 0.95, 0.65)),
    Stage(44, 7, 1.5, 0.006, 60),
    Stage(24, 6, 1.5, 0.006, 50, focal=(2.2, 1.2, 0.75, 0.5)),
)


class Patterns:
    """Lost in space by quads; see the module's text.

    ``volumes`` are tried in order at every stage.
    """

    def __init__(self, volumes: tuple[Volume, ...], stages: tuple[Stage, ...] = STAGES) -> None:
        self.volumes = volumes
        self.stages = stages

    def identify(
        self, detections: Detections, hint: Hint | None = None, year: float = 2016.0
    ) -> Task[Identification | NoSolution]:
        """Name the stars of one frame; see :class:`app.identify.Identifier`."""
        search = Search(detections, hint)
        if len(search.xy) < 5:
            return NoSolution(
                Reason.TOO_FEW_STARS,
                "Expose longer or point at a richer part of the sky.",
                f"{len(search.xy)} stars",
                len(detections),
            )
        for k, stage in enumerate(self.stages):
            for volume in self.volumes:
                yield Progress("identify", k / len(self.stages), f"{stage.stars} brightest stars")
                for verdict in search.round(volume, stage):
                    return self._answer(volume, search, verdict, detections)
        return NoSolution(
            Reason.NO_PATTERN_AGREED,
            "Check that the frame shows stars in focus.",
            f"{search.tried} pointings from {len(search.seen)} star patterns",
            len(detections),
        )

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
        self.seen: set[tuple[int, float]] = set()
        self.done: dict[tuple[int, float, float], Ints] = {}
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

    def alarm(self, verdict: Verdict) -> float:
        """The verdict's false-alarm bound after counting all pointings tried."""
        return min(0.0, verdict.log10_tail + float(np.log10(max(1, self.tried))))

    def round(self, volume: Volume, stage: Stage) -> Iterator[Verdict]:
        """Accepted verdicts of one stage in one volume, best first."""
        noise = stage.noise * self.side / 1000.0
        for focal in stage.focal:
            quads = self._new_quads(volume, stage, focal, noise)
            if len(quads) == 0:
                continue
            f = focal * self.side if focal else None
            if f is not None and not (self.scale[0] / 1.25 <= f <= self.scale[1] * 1.25):
                continue
            view = View(self.xy, self.half, self.scale, f, stage.k1)
            found = propose(volume, view, quads, noise, stage.slack, (0.35, 3.0))
            if self.centre is not None:
                dot = found.matrix[:, 2] @ self.centre[0]
                wide = np.arctan(np.hypot(*self.half) / found.focal)
                found = found.take(dot > np.cos(np.minimum(self.centre[1] + wide, np.pi)))
            self.tried += len(found)
            yield from self._check(volume, view, stage, found)

    def _new_quads(self, volume: Volume, stage: Stage, focal: float, noise: float) -> Ints:
        quads = image_quads(self.xy[: stage.stars], stage.neighbours, 12.0 * noise)
        marks = quad_marks(quads)
        key = (id(volume), focal, stage.k1)
        old = self.done.get(key)
        if old is not None:
            new = ~np.isin(marks, old)
            quads, marks = quads[new], marks[new]
            marks = np.concatenate([old, marks])
        self.done[key] = marks
        return quads

    def _check(
        self, volume: Volume, view: View, stage: Stage, found: Hypotheses
    ) -> Iterator[Verdict]:
        if len(found) == 0:
            return
        field = np.arctan(self.side / 2 / found.focal)
        votes = agreement(found, 0.015 + 0.03 * field)
        order = np.argsort(-votes, kind="stable")[: MAX_CANDIDATES]
        reach = 0.010 * self.side
        for h in order:
            start = Pointing(
                found.matrix[h], float(found.focal[h]), bool(found.mirrored[h]), view.k1
            )
            verdict = verify(
                volume, int(found.level[h]), view, start, found.detections[h], reach, stage.use
            )
            if verdict is not None and self.alarm(verdict) < ACCEPT_LOG10:
                yield verdict
