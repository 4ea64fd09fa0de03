"""One detector on one picture: what it found, and what a solve makes of that."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import unit_vectors
from app.core.frame import Frame
from app.core.hint import Hint
from app.core.progress import Task
from app.core.solution import Solution
from app.detect import make_detector
from app.solve.options import SolveOptions
from app.solve.pairing import mutual_nearest
from app.solve.solver import Examined, examine_frame
from app.workflows.laboratory import Choice, Trial, Truth, answer_of, none_of, sigma_of
from app.workflows.laboratory_kinds import Kind, allowed
from app.workflows.laboratory_time import timed

Floats = NDArray[np.float64]
REACH_PX = 3.0
"""A detection within this of a star's true place is that star."""


@dataclass(frozen=True, slots=True)
class Found:
    """``stars`` that were detected; of ``there`` true ones, ``true``, off by ``error_px`` (RMS).

    The error is along one axis. All but ``stars`` are None when the true places are not known.
    """

    stars: int
    true: int | None = None
    there: int | None = None
    error_px: float | None = None


def try_detector(
    frame: Frame,
    choice: Choice,
    hint: Hint | None,
    truth: Truth | None,
    places: Floats | None = None,
    limit_s: float = 30.0,
) -> Task[Trial]:
    """Solve ``frame`` with this detector and all else as ever; the time is the detector's.

    As when methods are compared, a ``hint`` that helps is all that is searched.

    ``places`` (N, 2) px are those of all stars in a simulated picture.

    Raises
    ------
    UsageError
        The detector is not known, or one of its options is not allowed.

    """
    options = allowed(Kind.DETECTOR, choice.name, choice.options)
    make_detector(choice.name).detect(Frame(np.eye(64)))  # loading its libraries is not its time
    wish = SolveOptions(
        detector=choice.name, detector_options=options, hint=hint, use_header=False,
        blind_after_hint=False, timeout_s=limit_s,
    )  # fmt: skip
    examined, spent = yield from timed(examine_frame(frame, wish), float("inf"))
    assert examined is not None, "there was no limit"
    return replace(
        _trial(choice.name, examined, truth),
        seconds=spent.get("detect", 0.0),
        found=counted(examined.detections.xy, places),
    )


def counted(xy: Floats, places: Floats | None) -> Found:
    """What ``xy`` (M, 2) px found of the stars at ``places`` (N, 2) px; each counts once."""
    if places is None:
        return Found(len(xy))
    mine, theirs = mutual_nearest(xy, places, REACH_PX)
    error = float(np.sqrt(np.mean((xy[mine] - places[theirs]) ** 2))) if len(mine) else None
    return Found(len(xy), len(mine), len(places), error)


def _trial(name: str, examined: Examined, truth: Truth | None) -> Trial:
    result = examined.result
    if not isinstance(result, Solution):
        return none_of(Kind.DETECTOR, name, result, truth)
    xy = np.array([(star.x, star.y) for star in result.stars])
    sky = np.array([(star.ra_deg, star.dec_deg) for star in result.stars])
    trial = answer_of(
        Kind.DETECTOR, name, result.camera, result.attitude, xy, unit_vectors(*sky.T), truth
    )
    return replace(
        trial,
        sigma_arcsec=sigma_of(result.attitude),
        log10_false_alarm=result.log10_false_alarm,
        rms_px=result.rms_px,
    )
