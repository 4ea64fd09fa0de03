"""What keeps a motor axis from doing what it is told: wear, and what breaks."""

from dataclasses import dataclass
from enum import StrEnum


class AxisFailure(StrEnum):
    """What breaks in an axis, on demand."""

    RUNAWAY = "runaway"  # a slew does not brake: it ends when it is stopped
    SWAPPED = "swapped"  # a slew turns the wrong way round
    JUMP = "jump"  # the encoder loses its count


@dataclass(frozen=True, slots=True)
class AxisWear:
    """What keeps an axis from being where its motor has turned it.

    ``backlash_deg`` is the play of its gear; ``periodic_arcsec`` the amplitude of a sine over
    ``worm_deg`` of axis. ``slip`` is the part of every fast turn by which the clutch gives way,
    always towards greater angles, the heavy side. ``rate_error`` is the part by which slow motion
    is too fast. ``wobble_arcsec`` swings at ``wobble_hz`` after a fast move and dies away within
    ``wobble_s`` (to 1/e).
    """

    backlash_deg: float = 0.0
    periodic_arcsec: float = 0.0
    worm_deg: float = 2.0
    worm_phase_deg: float = 0.0
    slip: float = 0.0
    rate_error: float = 0.0
    wobble_arcsec: float = 0.0
    wobble_hz: float = 2.0
    wobble_s: float = 1.0
