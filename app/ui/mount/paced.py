"""A nudge at a rate that a person has chosen."""

from time import monotonic, sleep

from app.core.mount import Direction
from app.core.progress import Progress, Task
from app.mounts.guard import Guard
from app.workflows.nudge import Nudged

LOOK_S = 0.2


def paced(guard: Guard, direction: Direction, arcsec: float, rate_deg_s: float) -> Task[Nudged]:
    """One bounded move, refused by the guard when it is too long; cancelling stops the mount."""
    seconds = arcsec / 3600.0 / rate_deg_s
    yield Progress("move", 0.0, str(direction))
    over, stops = False, guard.stops
    try:
        guard.move(direction, rate_deg_s, seconds)
        end = monotonic() + seconds
        while (left := end - monotonic()) > 0.0:
            yield Progress("move", 1.0 - left / seconds, str(direction))
            sleep(min(left, LOOK_S))
            guard.go_on(stops, "move")
        over = True
    finally:
        if not over:
            guard.halt()
    return Nudged(direction, arcsec, f"one move of {seconds:.1f} s", seconds)
