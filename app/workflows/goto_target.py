"""Go to a place a person names, and stand still there when the mount says it is done."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from typing import TypeVar

import numpy as np

from app.core.attitude import apart_deg, radec_deg
from app.core.errors import NoAnswerError, StrayedError, UsageError
from app.core.mount import Pointing
from app.core.progress import Progress, Task
from app.mounts.guard import Guard

T = TypeVar("T")
Wait = Callable[[float], None]

POLL_S = 0.5
STILL_ARCSEC = 20.0  # between two looks; a mount that rounds to 15 may jump by that much
SETTLE_S = 3.0
PATIENCE_S = 60.0
MISSES = 3  # answers that may be missed in a row
RUNS_DEG, LOOKS = 0.25, 6  # a mount that goes on so far from look to look, though not slewing


@dataclass(frozen=True, slots=True)
class Target:
    """A place, ICRS degrees, and what a person calls it."""

    name: str
    ra_deg: float
    dec_deg: float


def named_target(name: str, time_utc: datetime) -> Target:
    """A star (proper name, designation, HIP, HD, HR, SAO), Messier, NGC or IC object by its name.

    Proper motion is applied up to ``time_utc``.

    Raises
    ------
    UsageError
        Nothing in the catalogue is called so.

    """
    from app.sky.apparent import julian_years
    from app.sky.catalogue import open_catalogue

    catalogue = open_catalogue()
    found = catalogue.find(name)
    if isinstance(found, int):
        vector = catalogue.vectors([found], julian_years(time_utc))[0]
    else:
        vector = np.asarray(found)
    return Target(name.strip(), *radec_deg(vector))


def target_at(ra_deg: float, dec_deg: float) -> Target:
    """A place by ICRS degrees; UsageError when there is no such place."""
    if not (-360.0 <= ra_deg <= 360.0 and -90.0 <= dec_deg <= 90.0):
        raise UsageError(f"RA {ra_deg:g}, Dec {dec_deg:g} is no place on the sky.")
    return Target(f"RA {ra_deg % 360.0:.4f} Dec {dec_deg:+.4f}", ra_deg % 360.0, dec_deg)


def goto_target(mount: Guard, target: Target, wait: Wait = time.sleep) -> Task[Pointing]:
    """Slew within the guard and return when the mount stands still; cancelling stops it.

    Raises
    ------
    app.core.errors.RefusedError
        The guard or the mount refuses; one sentence.

    """
    yield Progress("goto", 0.0, target.name)
    yield from mount.slew_icrs(target.ra_deg, target.dec_deg)
    return (yield from settled(mount, wait))


def settled(mount: Guard, wait: Wait = time.sleep, settle_s: float = SETTLE_S) -> Task[Pointing]:
    """Wait until two looks agree and nothing slews, then let the shaking die for ``settle_s``.

    A mount that is stopped in the meantime counts as settled.

    Raises
    ------
    NoAnswerError
        It does not come to rest within a minute, or does not answer.
    StrayedError
        It runs away, saying that it does not slew, and was stopped.

    """
    before, running = None, 0
    for _ in range(round(PATIENCE_S / POLL_S)):
        yield Progress("settling")
        wait(POLL_S)
        slewing = answered(lambda: mount.state().slewing)
        here = answered(mount.position)
        if before is not None and not slewing and _still(before, here):
            yield Progress("settling")
            wait(settle_s)
            return here
        running = running + 1 if before and not slewing and _runs(before, here) else 0
        if running == LOOKS:
            mount.halt()
            raise StrayedError("The mount ran away, saying that it does not slew: it was stopped.")
        before = here
    mount.halt()
    raise NoAnswerError(f"The mount did not come to rest within {PATIENCE_S:g} s and was stopped.")


def answered(ask: Callable[[], T]) -> T:
    """The answer to a question that changes nothing, asked again when one is missed."""
    for _ in range(MISSES - 1):
        try:
            return ask()
        except NoAnswerError:
            continue
    return ask()


def _still(before: Pointing, here: Pointing) -> bool:
    return _moved_deg(before, here) * 3600.0 <= STILL_ARCSEC


def _runs(before: Pointing, here: Pointing) -> bool:
    return _moved_deg(before, here) > RUNS_DEG


def _moved_deg(before: Pointing, here: Pointing) -> float:
    return apart_deg((before.ra_deg, before.dec_deg), (here.ra_deg, here.dec_deg))
