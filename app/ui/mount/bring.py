"""Bring this star here: two places in a solved frame become a slew from one to the other."""

from datetime import datetime

import numpy as np

from app.core.attitude import radec_deg
from app.core.mount import Epoch, Pointing
from app.core.progress import Progress, Task
from app.core.solution import Solution
from app.mounts.epoch import to_mount_epoch
from app.mounts.guard import Guard
from app.mounts.sky_frame import wrapped
from app.workflows.goto_target import Wait, answered, settled
from app.workflows.sync_mount import shifted

Pixel = tuple[float, float]


def axis_angles_deg(
    solution: Solution, star: Pixel, here: Pixel, time_utc: datetime
) -> tuple[float, float]:
    """How far the mount must turn, right ascension and declination of date, degrees.

    The telescope must point away from where it does by as much as the star is away from the sky
    that is seen at ``here`` now.
    """
    places = [radec_deg(v) for v in solution.sky_at(np.array([star, here], dtype=np.float64))]
    (ra, dec), (ra_here, dec_here) = (
        to_mount_epoch(*place, Epoch.DATE, time_utc) for place in places
    )
    return wrapped(ra - ra_here), dec - dec_here


def bring_star(
    mount: Guard, solution: Solution, star: Pixel, here: Pixel, wait: Wait
) -> Task[Pointing]:
    """Slew, within the guard, by what brings pixel ``star`` of a frame to pixel ``here``."""
    yield Progress("goto", None, "the star")
    ra, dec = axis_angles_deg(solution, star, here, mount.clock())
    said = answered(mount.position)
    there = shifted((said.ra_deg, said.dec_deg), ra, dec)
    yield from mount.slew(*there)
    return (yield from settled(mount, wait))
