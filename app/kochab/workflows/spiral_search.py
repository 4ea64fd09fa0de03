"""Search around a place whose target is not in the field: small slews in a square spiral."""

import time
from math import cos, radians

from kochab.core.errors import RefusedError
from kochab.core.mount import Pointing
from kochab.core.progress import Progress, Task
from kochab.gear.mounts.coordinates import to_mount_epoch
from kochab.gear.mounts.guard import Guard
from kochab.workflows.goto_target import Wait, settled

FARTHEST_DEG = 5.0  # of a step from the centre
NEAREST_POLE = 0.02  # cosine of the declination, where east and west mean nothing


def square_spiral(turns: int) -> list[tuple[int, int]]:
    """Steps east and north of the centre, (0, 0) left out, each one step from the one before: rings ever wider."""
    steps, at, length = [], (0, 0), 1
    ways = ((1, 0), (0, 1), (-1, 0), (0, -1))
    for leg in range(4 * turns + 1):
        east, north = ways[leg % 4]
        for _ in range(length - (leg == 4 * turns)):
            at = at[0] + east, at[1] + north
            steps.append(at)
        length += leg % 2  # 1, 1, 2, 2, 3, 3: every second leg is longer
    return steps


def spiral_search(mount: Guard, step_deg: float, turns: int, pause_s: float, wait: Wait = time.sleep) -> Task[Pointing]:
    """Slew to each place of the spiral around where the mount points, and rest there; cancelling stops it.

    Every slew passes the guard, and `RefusedError` ends the search where it refuses one.

    Parameters
    ----------
    mount : Guard
        Behind its guard.
    step_deg : float
        From place to place, degrees.
    turns : int
        Of the spiral.
    pause_s : float
        How long to rest at each place.
    wait : Wait
        Waits so many seconds.
    """
    centre = mount.position_icrs()
    narrow = cos(radians(centre[1]))
    if turns * step_deg > FARTHEST_DEG or narrow < NEAREST_POLE:
        raise RefusedError(
            "A spiral reaches {farthest:g}° at most, and not beside a pole: search a smaller one.",
            farthest=FARTHEST_DEG,
        )
    places = square_spiral(turns)
    for number, (east, north) in enumerate(places):
        yield Progress("searching", number / len(places), f"place {number + 1} of {len(places)}")
        ra, dec = centre[0] + east * step_deg / narrow, min(90.0, max(-90.0, centre[1] + north * step_deg))
        yield from mount.slew(*to_mount_epoch(ra % 360.0, dec, mount.epoch, mount.clock()))
        here = yield from settled(mount, wait, 0.0)
        yield from resting(pause_s, wait)
    return here


def resting(seconds: float, wait: Wait) -> Task[None]:
    """Look here; a cancel point four times a second."""
    for _ in range(round(4.0 * seconds)):
        yield Progress("looking")
        wait(0.25)
