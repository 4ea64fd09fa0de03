"""Waiting until a slew has ended, within its time and in spite of a few answers missed."""

from collections.abc import Callable
from time import monotonic
from typing import TYPE_CHECKING

from app.core.attitude import apart_deg
from app.core.errors import NoAnswerError, RefusedError
from app.core.mount import Pointing
from app.core.progress import Progress, Task

if TYPE_CHECKING:
    from app.mounts.guard import Guard

POLL_S = 0.2
MISSES = 3  # positions that may be missed in a row during a slew
FAR_DEG, IDLE = 0.5, 8  # so far away it may be that the slew has not begun yet


def arrival(
    guard: "Guard", target_deg: tuple[float, float], wait: Callable[[float], None], limit_s: float
) -> Task[Pointing]:
    """Yield the distance left until the mount says that it no longer slews."""
    stops = guard.stops
    end = monotonic() + limit_s
    first = left = None
    misses = idle = 0
    while True:
        detail = "" if left is None else f"{left:.1f} deg to go"
        done = None if not first or left is None else min(1.0, max(0.0, 1.0 - left / first))
        yield Progress("slewing", done, detail)
        wait(POLL_S)
        guard.go_on(stops, "slew")
        if monotonic() > end:
            raise NoAnswerError(f"The slew did not end within {limit_s:.0f} s and was stopped.")
        try:
            slewing, here = guard.state().slewing, guard.position()
        except NoAnswerError:
            misses += 1
            if misses >= MISSES:
                raise
            continue
        misses = 0
        before, left = left, apart_deg((here.ra_deg, here.dec_deg), target_deg)
        first = first or left
        unmoved = before is not None and abs(before - left) < 1e-3
        idle = idle + 1 if slewing is False or (slewing is None and unmoved) else 0
        if idle and left < FAR_DEG:
            return here
        if idle >= IDLE:
            raise RefusedError(f"The mount stands {left:.1f} deg from where it was sent.")
