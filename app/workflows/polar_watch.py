"""Waiting for frames that show a mount at rest."""

import numpy as np

from app.core.earth import SIDEREAL_DEG_S
from app.core.errors import KochabError
from app.core.progress import Task
from app.core.solution import NoSolution
from app.polar.measure import Settings
from app.polar.rotations import ARCSEC, rotation_vector
from app.polar.sighting import LocalAttitude, to_local
from app.workflows.polar_sources import SightingSource
from app.workflows.polar_update import PolarControls, PolarUpdate

STILL_ARCSEC = 30.0
SIGMAS = 5.0
MOST_EMPTY = 40
"""Frames without an answer, or waits without a frame, before a measurement is given up."""


class NotMeasuredError(KochabError):
    """A measurement that cannot be brought to its end; one sentence with what to do."""


class Watch:
    """Attitudes of a source's frames, among the things on the ground."""

    def __init__(self, source: SightingSource, settings: Settings, controls: PolarControls) -> None:
        self.settings = settings
        self.controls = controls
        self._source = source

    def next(self, patient: bool = False) -> Task[LocalAttitude]:
        """The next solved frame; ``patient`` waits for ever, as for a hand.

        Raises
        ------
        NotMeasuredError
            Too many frames in a row have no answer, or none come.

        """
        empty = 0
        while True:
            found = yield from self._source.sight()
            if found is not None and not isinstance(found, NoSolution):
                return to_local(found, self.settings.site, self.settings.air)
            empty += 1
            why = "No frames come from the camera"
            if isinstance(found, NoSolution):
                why = f"The frames have no answer ({found.reason}): {found.advice}"
            if empty > MOST_EMPTY and not patient:
                raise NotMeasuredError(f"{why.rstrip('.')}.")
            yield PolarUpdate("measure", None, why, solved=False)

    def still(
        self, before: LocalAttitude | None = None, turn_deg: float = 0.0
    ) -> Task[LocalAttitude]:
        """The first attitude like the one before it, but for tracking.

        With ``turn_deg`` only one that has turned by half of that, at least, since ``before``: so
        a person need not say that a turn was made.
        """
        last: LocalAttitude | None = None
        while True:
            now = yield from self.next(patient=turn_deg > 0.0)
            turned = turned_deg(before, now) if before is not None else 0.0
            enough = turned >= 0.5 * turn_deg or self.controls.take_turned()
            if enough and last is not None and at_rest(last, now):
                return now
            if turn_deg:
                told = f"turned {turned:.0f} of {turn_deg:.0f} deg"
                yield PolarUpdate("turn", min(1.0, turned / turn_deg), told)
            last = now


def turned_deg(first: LocalAttitude, second: LocalAttitude) -> float:
    """The angle of the rotation between two attitudes."""
    return float(np.degrees(np.linalg.norm(rotation_vector(second.matrix @ first.matrix.T))))


def at_rest(first: LocalAttitude, second: LocalAttitude) -> bool:
    """Whether two frames differ by no more than tracking, or standing still, and their errors."""
    seconds = abs((second.time_utc - first.time_utc).total_seconds())
    sigma = np.sqrt(np.trace(first.covariance + second.covariance)) / ARCSEC
    allowed = STILL_ARCSEC + 3600.0 * SIDEREAL_DEG_S * seconds + SIGMAS * float(sigma)
    return turned_deg(first, second) * 3600.0 <= allowed
