"""A small motion in one direction: guide pulses, or moves at the slowest rate that will do."""

import time
from contextlib import suppress
from dataclasses import dataclass

from app.core.earth import SIDEREAL_DEG_S
from app.core.errors import NoAnswerError, RefusedError
from app.core.mount import Ability, Direction
from app.core.progress import Progress, Task
from app.mounts.guard import Guard
from app.workflows.goto_target import Wait

GUIDE_ARCSEC_S = 0.5 * SIDEREAL_DEG_S * 3600.0  # most mounts' setting
MOST_PULSED_ARCSEC = 90.0
LEAST_ARCSEC = 0.3
SHORTEST_S, LONGEST_S = 0.08, 8.0  # less is not accurate, more is not patient
AFTER_S = 0.4


@dataclass(frozen=True, slots=True)
class Nudged:
    """What was sent: ``by`` is "guide pulses", "moves" or, for too little, "nothing"."""

    direction: Direction
    amount_arcsec: float
    by: str
    seconds: float


def nudge(
    mount: Guard, direction: Direction, amount_arcsec: float, wait: Wait = time.sleep
) -> Task[Nudged]:
    """Turn one axis by so much, within the guard; returns when the motion is over.

    East and west are angles of the hour axis: on the sky they are smaller by the cosine of the
    declination. Cancelling stops the mount.

    Raises
    ------
    RefusedError
        The guard or the mount refuses, or the mount can neither pulse nor move.

    """
    if amount_arcsec < LEAST_ARCSEC:
        return Nudged(direction, amount_arcsec, "nothing", 0.0)
    moving = True
    try:
        if Ability.PULSE not in mount.lacks and amount_arcsec <= MOST_PULSED_ARCSEC:
            nudged = yield from _pulses(mount, direction, amount_arcsec, wait)
        else:
            nudged = yield from _moves(mount, direction, amount_arcsec, wait)
        moving = False
    finally:
        if moving:
            mount.halt()
    return nudged


def _pulses(mount: Guard, direction: Direction, amount_arcsec: float, wait: Wait) -> Task[Nudged]:
    left = round(1000.0 * amount_arcsec / GUIDE_ARCSEC_S)
    total, stops = left, mount.stops
    while left > 0:
        mount.go_on(stops, "motion")
        part = min(left, mount.limits.longest_pulse_ms)
        yield Progress("guide pulse", 1.0 - left / total, f"{part} ms {direction}")
        mount.pulse(direction, max(part, 1))
        yield Progress("guide pulse", 1.0 - left / total, f"{part} ms {direction}")
        wait(part / 1000.0 + AFTER_S)
        left -= part
    return Nudged(direction, amount_arcsec, "guide pulses", total / 1000.0)


def _moves(mount: Guard, direction: Direction, amount_arcsec: float, wait: Wait) -> Task[Nudged]:
    amount_deg = amount_arcsec / 3600.0
    longest_deg, longest_s = mount.limits.longest_move_deg, mount.limits.longest_move_s
    if amount_deg > longest_deg:
        raise RefusedError(f"A nudge of {amount_deg:.1f} deg is refused: go there instead.")
    rate = move_rate_deg_s(mount, amount_deg)
    left = seconds = amount_deg / rate
    if seconds < SHORTEST_S:
        return Nudged(direction, amount_arcsec, "nothing", 0.0)
    stops = mount.stops
    while left > 1e-3:
        mount.go_on(stops, "motion")
        part = min(left, longest_s)
        yield Progress("move", 1.0 - left / seconds, f"{part:.1f} s {direction}")
        mount.move(direction, rate, part)
        end = part
        while end > 0.0:  # a cancel is heard while it moves, and a mount that goes astray is seen
            yield Progress("move", 1.0 - left / seconds, f"{direction}")
            wait(min(end, 0.5))
            end -= 0.5
            if end > 1.0:  # towards its end the line is left to the word that ends it
                _look(mount)
            mount.go_on(stops, "motion")
        left -= part
    wait(AFTER_S)
    return Nudged(direction, amount_arcsec, "moves", seconds)


def move_rate_deg_s(mount: Guard, amount_deg: float) -> float:
    """The slowest of the mount's rates that takes at most some seconds for ``amount_deg``."""
    told: tuple[float, ...] = getattr(mount.mount, "rates_deg_s", ())
    rates = sorted(told or (SIDEREAL_DEG_S, 0.1, 1.0))
    return next((r for r in rates if amount_deg / r <= LONGEST_S), rates[-1])


def _look(mount: Guard) -> None:
    """Let the guard see where the mount goes; one answer that is missed ends no motion."""
    with suppress(NoAnswerError):
        mount.position()
