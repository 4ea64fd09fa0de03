"""One estimator of the attitude on stars that have their names, beside the fit of every solve."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import thread_time
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from app.attitude.fit import Fit, refine
from app.core.attitude import Attitude
from app.core.camera import Camera
from app.core.detections import Detections
from app.core.hint import Hint
from app.core.progress import Progress, Task
from app.core.solution import Identification, Matches, NoSolution
from app.identify import make_identifier
from app.solve.estimate import with_estimate
from app.solve.extend import centroid_sigma, extend
from app.solve.options import SolveOptions
from app.workflows.laboratory import Choice, Trial, Truth, answer_of, none_of, sigma_of
from app.workflows.laboratory_kinds import FIT, Kind, allowed
from app.workflows.laboratory_time import timed

T = TypeVar("T")
REPEATS = 20
"""An estimate takes less than a clock of some systems can tell."""
REFUSED = "not with these stars"


@dataclass(frozen=True, slots=True, eq=False)
class Named:
    """``matches`` whose places are good to ``sigma_px`` (M,), and the fit of them all.

    ``camera`` and ``attitude`` are what that fit starts from.
    """

    matches: Matches
    sigma_px: NDArray[np.float64]
    camera: Camera
    attitude: Attitude
    log10_false_alarm: float
    fit: Fit

    def refit(self) -> Fit:
        """The fit once more."""
        return refine(self.matches, self.camera, self.attitude, self.sigma_px)


def name_stars(
    detections: Detections, hint: Hint | None, year: float, limit_s: float
) -> Task[Named | NoSolution | None]:
    """Name every star by the default method; None when that took longer than ``limit_s``."""
    task = make_identifier().identify(detections, hint, year)
    found, _ = yield from timed(task, limit_s)
    if not isinstance(found, Identification):
        return found
    from app.sky import open_catalogue

    yield Progress("attitude", None, "naming the stars")
    usable = detections.take(slice(0, SolveOptions().max_stars))
    matches, _ = extend(usable, found, open_catalogue(), year)
    sigma = centroid_sigma(usable)[matches.detection]
    fit = refine(matches, found.camera, found.attitude, sigma)
    return Named(matches, sigma, found.camera, found.attitude, found.log10_false_alarm, fit)


def try_attitude(
    named: Named | NoSolution | None, choice: Choice, truth: Truth | None
) -> Task[Trial]:
    """Run one estimator, or the fit, on the named stars.

    Raises
    ------
    UsageError
        The estimator is not known, or one of its options is not allowed.

    """
    options = allowed(Kind.ATTITUDE, choice.name, choice.options)
    if not isinstance(named, Named):
        return none_of(Kind.ATTITUDE, choice.name, named, truth)

    def estimate() -> tuple[Fit, str]:
        if choice.name == FIT:
            return named.refit(), ""
        return with_estimate(named.matches, named.fit, choice.name, named.sigma_px, options)

    (fit, refusal), seconds = yield from _repeated(estimate)
    if refusal:
        none = none_of(Kind.ATTITUDE, choice.name, None, truth)
        return replace(none, seconds=seconds, reason=REFUSED, advice=refusal)
    return replace(_trial(choice.name, named, fit, truth), seconds=seconds)


def _trial(name: str, named: Named, fit: Fit, truth: Truth | None) -> Trial:
    trial = answer_of(
        Kind.ATTITUDE, name, fit.camera, fit.attitude, named.matches.xy, named.matches.vectors,
        truth,
    )  # fmt: skip
    return replace(
        trial,
        sigma_arcsec=sigma_of(fit.attitude),
        log10_false_alarm=named.log10_false_alarm,
        rms_px=fit.rms_px,
        from_fit_arcsec=None if name == FIT else between(fit.attitude, named.fit.attitude),
    )


def between(a: Attitude, b: Attitude) -> tuple[float, float]:
    """How far two attitudes are apart, arcsec: on the sky at the boresight, and in roll."""
    from scipy.spatial.transform import Rotation

    about = Rotation.from_matrix(a.matrix @ b.matrix.T).as_rotvec(degrees=True) * 3600.0
    return float(np.hypot(*about[:2])), float(abs(about[2]))


def _repeated(work: Callable[[], T]) -> Task[tuple[T, float]]:
    """What ``work`` gives, and the mean of its processor times, s, the first left out."""
    made, spent = work(), 0.0
    for _ in range(REPEATS):
        yield Progress("attitude")
        start = thread_time()
        made = work()
        spent += thread_time() - start
    return made, spent / REPEATS
