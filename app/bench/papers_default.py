"""The default method, as the published tables are compared with it."""

import time

from app.core.detections import Detections
from app.core.hint import Hint
from app.core.progress import Progress, run
from app.core.solution import NoSolution, Solution
from app.solve.options import SolveOptions
from app.solve.solver import solve_detections

KNOWN = 1e-4
"""The published methods know their camera; so does the default, to this share of its scale."""


def solved(detections: Detections, options: SolveOptions) -> tuple[Solution | NoSolution, float]:
    """The answer, and the processor seconds of naming the stars, without the camera's fit.

    The published methods end with names, so that is what is compared.
    """
    started = time.process_time()
    named: list[float] = []

    def watch(progress: Progress) -> None:
        if progress.stage == "attitude" and not named:
            named.append(time.process_time() - started)

    answer = run(solve_detections(detections, options), watch)
    return answer, named[0] if named else time.process_time() - started


def knowing(scale_arcsec_px: float, share: float = KNOWN) -> SolveOptions:
    """The options of a solve through a camera whose scale is known to ``share`` of itself."""
    low, high = scale_arcsec_px / (1.0 + share), scale_arcsec_px * (1.0 + share)
    return SolveOptions(hint=Hint(scale_arcsec_px=(low, high)))
