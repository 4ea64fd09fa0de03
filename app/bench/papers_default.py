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

ENDS = ("attitude", "diagnose")
"""What comes after the names."""


def solved(detections: Detections, options: SolveOptions) -> tuple[Solution | NoSolution, float]:
    """The answer, and the processor seconds of naming the stars.

    The published methods begin with directions and end with names, so that is what is compared:
    from where the identifier is asked to where its names are given on to the camera's fit, or,
    when there are none, to the doctor. They are timed in a loop of nothing else, with all they
    need at hand, and the fit between two namings would turn that out; so the stars are named once
    before they are named against the clock, which takes as long as it does in such a loop.
    """
    name(detections, options)
    clock: list[float] = []

    def watch(progress: Progress) -> None:
        if progress.stage in ENDS or not clock:
            clock.append(time.process_time())

    answer = run(solve_detections(detections, options), watch)
    return answer, clock[1] - clock[0] if len(clock) > 1 else 0.0


def name(detections: Detections, options: SolveOptions) -> None:
    """Solve as far as the stars' names, or as far as it is clear that there are none."""
    steps = solve_detections(detections, options)
    next((step for step in steps if step.stage in ENDS), None)
    steps.close()


def knowing(scale_arcsec_px: float, share: float = KNOWN) -> SolveOptions:
    """The options of a solve through a camera whose scale is known to ``share`` of itself.

    The published methods have no other way when their camera is not what they believe; nor has the
    default here.
    """
    low, high = scale_arcsec_px / (1.0 + share), scale_arcsec_px * (1.0 + share)
    return SolveOptions(hint=Hint(scale_arcsec_px=(low, high)), blind_after_hint=False)
