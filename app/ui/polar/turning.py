"""Who turns the RA axis: a hand that is asked in words, or a mount at a rate of its own."""

from dataclasses import dataclass
from typing import cast

from app.core.capture import CameraSource
from app.core.errors import RefusedError
from app.core.mount import Ability, Direction, Mount
from app.core.progress import Progress, Task
from app.mounts.guard import Guard
from app.workflows.polar_turners import RATE_DEG_S, HandTurner, MountTurner

SLICE_S = 1.0
SLOWEST_DEG_S = 0.1  # a sweep at less would take a quarter of an hour


@dataclass(frozen=True, slots=True)
class TurnAsked(Progress):
    """A hand is asked to turn an axis by so much: RA east or west, declination north or south."""

    direction: Direction = Direction.WEST
    degrees: float = 0.0


class Asking(HandTurner):
    """Asks in words, and says the same in numbers for whoever plays the hand."""

    def turn(self, direction: Direction, degrees: float) -> Task[None]:
        """Ask for it."""
        yield from _asked(super().turn(direction, degrees), direction, degrees)

    def turn_declination(self, direction: Direction, degrees: float) -> Task[None]:
        """Ask for that, north or south."""
        yield from _asked(super().turn_declination(direction, degrees), direction, degrees)


class Afresh(MountTurner):
    """Drops the frame that was exposed while the mount turned: it is trailed."""

    def __init__(self, mount: Mount, rate_deg_s: float, camera: CameraSource) -> None:
        super().__init__(mount, rate_deg_s)
        self._camera = camera

    def turn(self, direction: Direction, degrees: float) -> Task[None]:
        """Turn, and look away until it is over."""
        yield from super().turn(direction, degrees)
        yield from self._look_away()

    def turn_declination(self, direction: Direction, degrees: float) -> Task[None]:
        """The same with the declination axis."""
        yield from super().turn_declination(direction, degrees)
        yield from self._look_away()

    def _look_away(self) -> Task[None]:
        yield Progress("settle")
        self._camera.next_frame(SLICE_S)


def _asked(task: Task[None], direction: Direction, degrees: float) -> Task[None]:
    for asked in task:
        words = f"{asked.detail} Then press Space, or just wait: the frames show it."
        yield TurnAsked(asked.stage, asked.fraction, words, direction, degrees)


def mount_turner(guard: Guard, camera: CameraSource) -> MountTurner:
    """Turns at the mount's own rate nearest to two degrees a second.

    Raises
    ------
    RefusedError
        The mount cannot be moved at a rate, or by none that is fast enough.

    """
    lacking = guard.lacks.get(Ability.MOVE)
    if lacking is not None:
        raise RefusedError(f"{lacking} Turn the RA axis by hand instead.")
    rates: tuple[float, ...] = getattr(guard.mount, "rates_deg_s", ())
    rate = min(rates, key=lambda r: abs(r - RATE_DEG_S)) if rates else RATE_DEG_S
    if rate < SLOWEST_DEG_S:
        raise RefusedError("The mount has no rate fast enough: turn the RA axis by hand instead.")
    # A guard is a mount, with names that cannot be set.
    return Afresh(cast(Mount, guard), rate, camera)
