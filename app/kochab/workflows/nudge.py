"""Small motions: a nudge in one direction, and moving a clicked star to a place."""

import time
from contextlib import suppress

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import cross_product
from kochab.core.errors import NoAnswerError, RefusedError
from kochab.core.mount import SIDEREAL_DEG_S, Ability, Direction
from kochab.core.progress import Progress, Task
from kochab.core.solution import Solution
from kochab.core.values import frozen
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.slew_supervisor import FOLLOWED_DEG
from kochab.polar.rotations import about
from kochab.sky.apparent import of_date_matrix
from kochab.text.translation import tr, tr_noop
from kochab.workflows.goto_target import Wait, settled, with_retries
from kochab.workflows.sync_mount import shifted

GUIDE_ARCSEC_S = 0.5 * SIDEREAL_DEG_S * 3600.0  # most mounts' setting
MOST_PULSED_ARCSEC = 90.0
LEAST_ARCSEC = 0.3
SHORTEST_S, LONGEST_S = 0.08, 8.0  # shorter is inaccurate, longer is tedious
AFTER_S, RUNS_OUT = 0.4, 10  # and how often so long until it stands
LONGEST_GOTO_DEG = 10.0
LONGEST_PULSE_MS, LONGEST_MOVE_DEG = 1000, 2.0  # at a time: what has begun ends soon without this program
ENDS = tr_noop("the mount ends each goto of at most 2° itself, even if the computer fails")
RUNS_ON = tr_noop("this move runs on if the computer fails: keep an eye on the mount")


@frozen
class Nudged:
    """What was sent: ``by`` is "guide pulses", "moves", one move, "a goto" or, for too little, "nothing"."""

    direction: Direction
    amount_arcsec: float
    by: str
    seconds: float


def nudge(
    mount: Guard, direction: Direction, amount_arcsec: float, wait: Wait = time.sleep, rate_deg_s: float = 0.0
) -> Task[Nudged]:
    """Turn one axis by an angle, within the guard; returns when the motion is over.

    East and west are angles of the RA axis: on the sky they are smaller by the cosine of the declination. Cancelling
    stops the mount.

    Raises RefusedError when the guard or the mount refuses, or the mount can neither pulse nor move, and
    NotStoppedError when it runs on after its move.

    Parameters
    ----------
    mount : Guard
        Behind its guard.
    direction : Direction
        The way it turns.
    amount_arcsec : float
        How far.
    wait : Wait
        Waits so many seconds.
    rate_deg_s : float
        A rate of the mount that a person has chosen, for one move of any length; 0 takes guide pulses or the
        slowest suitable rate.
    """
    if amount_arcsec < LEAST_ARCSEC:
        return Nudged(direction, amount_arcsec, "nothing", 0.0)
    moving = True
    try:
        pulses = Ability.PULSE not in mount.lacks and amount_arcsec <= MOST_PULSED_ARCSEC
        if not rate_deg_s and pulses and not mount.state().alt_azimuth:  # whose axes are not those of the sky
            nudged = yield from _pulses(mount, direction, amount_arcsec, wait)
        elif not rate_deg_s and (steps := _gotos_instead(mount, direction, amount_arcsec / 3600.0)):
            stops = mount.stops
            for k, there in enumerate(steps):
                yield Progress("goto", k / len(steps), tr(ENDS))
                mount.check_not_stopped(stops, "motion")
                yield from mount.slew(*there)
            nudged = Nudged(direction, amount_arcsec, tr("a goto"), 0.0)
        else:
            nudged = yield from _moves(mount, direction, amount_arcsec, wait, rate_deg_s)
        moving = False
    finally:
        if moving:
            mount.halt()
    return nudged


def _pulses(mount: Guard, direction: Direction, amount_arcsec: float, wait: Wait) -> Task[Nudged]:
    left = round(1000.0 * amount_arcsec / GUIDE_ARCSEC_S)
    total, stops = left, mount.stops
    while left > 0:
        part = min(left, mount.limits.longest_pulse_ms, LONGEST_PULSE_MS)  # a killed program leaves 1 s at most
        yield Progress("guide pulse", 1.0 - left / total, f"{part} ms {direction}")
        mount.check_not_stopped(stops, "motion")
        mount.pulse(direction, max(part, 1))
        yield Progress("guide pulse", 1.0 - left / total, f"{part} ms {direction}")
        wait(part / 1000.0 + AFTER_S)
        left -= part
    return Nudged(direction, amount_arcsec, tr("guide pulses"), total / 1000.0)


def _gotos_instead(mount: Guard, direction: Direction, amount_deg: float) -> list[tuple[float, float]]:
    """The targets of short gotos that the mount ends by itself, in place of a move that it does not; none may be.

    A mount that does not track would begin to by a goto, and one that has followed past the meridian might flip.
    """
    state = mount.state()
    by_axes = mount.ends_alone and not state.alt_azimuth
    if by_axes or Ability.GOTO in mount.lacks or amount_deg > LONGEST_GOTO_DEG or state.tracking is False:
        return []
    here, sign = mount.position(), 1.0 if direction in (Direction.NORTH, Direction.EAST) else -1.0
    turns = sign * np.linspace(0.0, amount_deg, 1 + max(1, int(np.ceil(amount_deg / LONGEST_MOVE_DEG))))[1:]
    ways = ((0.0, turn) if direction.in_dec else (turn, 0.0) for turn in turns.tolist())
    steps = [shifted((here.ra_deg, here.dec_deg), *way) for way in ways]
    mount.clock_and_site.compare(mount.mount)
    plan, preview = mount.policy.goto(here, state, steps[-1])
    ends = plan.hour_angles_deg() or (0.0, 0.0)
    may_flip = not plan.limits.crosses_meridian and any(-amount_deg <= ha < FOLLOWED_DEG for ha in ends)
    return [] if preview.refusals or may_flip else steps


def _moves(mount: Guard, direction: Direction, amount_arcsec: float, wait: Wait, chosen_deg_s: float) -> Task[Nudged]:
    amount_deg = amount_arcsec / 3600.0
    if amount_deg > mount.limits.longest_move_deg:
        raise RefusedError("A nudge of {amount_deg:.1f}° is too large. Use goto instead.", amount_deg=amount_deg)
    rate = chosen_deg_s or move_rate_deg_s(mount, amount_deg)
    left = seconds = amount_deg / rate
    # At a rate that a person chose it is one move, which the guard refuses when it is too long.
    longest_s = seconds if chosen_deg_s else min(mount.limits.longest_move_s, LONGEST_MOVE_DEG / rate)
    if seconds < SHORTEST_S and not chosen_deg_s:
        return Nudged(direction, amount_arcsec, "nothing", 0.0)
    stops, run_on_note = mount.stops, "" if mount.ends_alone else f"; {tr(RUNS_ON)}"
    while left > 1e-3:
        part = min(left, longest_s)
        yield Progress("move", 1.0 - left / seconds, f"{part:.1f} s {direction}{run_on_note}")
        mount.check_not_stopped(stops, "motion")
        mount.move(direction, rate, part)
        end = part
        while end > 0.0:  # a cancel ends it while it moves, and a wrong motion is noticed
            yield Progress("move", 1.0 - left / seconds, f"{direction}{run_on_note}")
            mount.supervisor.pause(wait, min(end, 0.5))
            end -= 0.5
            if end > 1.0:  # towards its end the line is left to the command that ends it
                with suppress(NoAnswerError):  # one lost reply ends no motion
                    mount.position()
            mount.check_not_stopped(stops, "motion")
        left -= part
        wait(AFTER_S)
        for _ in range(RUNS_OUT):
            if left <= 1e-3 or not mount.state().slewing:
                break
            wait(AFTER_S)
    mount.emergency.confirm()  # the bytes that end a move can be lost: it is seen to stand, or stopped
    return Nudged(
        direction,
        amount_arcsec,
        tr("one move of {seconds:.1f} s", seconds=seconds) if chosen_deg_s else tr("moves"),
        seconds,
    )


def move_rate_deg_s(mount: Guard, amount_deg: float) -> float:
    """The slowest of the mount's rates that takes at most some seconds for ``amount_deg``."""
    rates = sorted(mount.rates_deg_s or (SIDEREAL_DEG_S, 0.1, 1.0))
    return next((r for r in rates if amount_deg / r <= LONGEST_S), rates[-1])


# -- Move a star, clicked in a solved frame, to a place in it ----------------------------------

POLE = np.array([0.0, 0.0, 1.0])
SLEW_FROM_DEG = 0.25  # larger turns are a goto by so much: quicker, and watched all the way
STEPS, STEP_RAD = 8, 1e-6
CLOSE_PX = 0.01


@frozen
class Turn:
    """Axis angles in degrees, towards greater right ascension and towards the north."""

    east_deg: float
    north_deg: float


def turn_to_bring(
    matrix_of_date: Floats, solution: Solution, star_px: tuple[float, float], here_px: tuple[float, float]
) -> Turn:
    """How far both axes turn to bring a star to another place of the frame.

    Raises RefusedError when no turn of these axes does it, as beside the pole.

    Parameters
    ----------
    matrix_of_date : Floats
        Rotation (3, 3) from ICRS to the equator that the mount turns about.
    solution : Solution
        Where the frame points.
    star_px, here_px : tuple[float, float]
        Where the star is seen and where it is to come, px.
    """
    of_date_to_camera = solution.attitude.matrix @ matrix_of_date.T  # of date -> camera
    star = matrix_of_date @ solution.sky_at(np.array([star_px], dtype=np.float64))[0]
    here = np.asarray(here_px, dtype=np.float64)

    def miss(turns: Floats) -> Floats:
        return np.asarray(solution.camera.project(np.atleast_2d(_turned(of_date_to_camera, turns) @ star))[0] - here)

    turns = np.zeros(2)
    for _ in range(STEPS):
        off = miss(turns)
        if np.hypot(*off) < CLOSE_PX:
            break
        # Newton's method, its slopes by differences
        slope = np.stack([(miss(turns + STEP_RAD * unit) - off) / STEP_RAD for unit in np.eye(2)], axis=1)
        if not np.isfinite(slope).all() or abs(np.linalg.det(slope)) < 1e-9:
            break
        turns = turns - np.linalg.solve(slope, off)
    if not np.hypot(*miss(turns)) < 1.0 or np.abs(turns).max() > np.pi / 2:
        raise RefusedError("The two axes can't move this star there. Use goto instead.")
    return Turn(*(float(angle) for angle in np.degrees(turns)))


def bring_here(
    mount: Guard,
    solution: Solution,
    star_px: tuple[float, float],
    here_px: tuple[float, float] | None = None,
    wait: Wait = time.sleep,
) -> Task[Turn]:
    """Move what a frame taken just now shows at one place to another.

    Small turns are guide pulses or moves, larger ones a goto beside the reported position. Cancelling stops the mount.

    Parameters
    ----------
    mount : Guard
        Behind its guard.
    solution : Solution
        Of the frame.
    star_px : tuple[float, float]
        Where it is seen, px.
    here_px : tuple[float, float] or None
        Where it is to come, px; None: the frame's centre.
    wait : Wait
        Waits so many seconds.
    """
    camera = solution.camera
    middle = ((camera.width - 1) / 2.0, (camera.height - 1) / 2.0)
    turn = turn_to_bring(of_date_matrix(mount.clock()), solution, star_px, here_px or middle)
    yield Progress("move star", 0.0, f"{turn.east_deg:+.3f}° east, {turn.north_deg:+.3f}° north")
    if max(abs(turn.east_deg), abs(turn.north_deg)) >= SLEW_FROM_DEG:
        here = with_retries(mount.position)
        yield from mount.slew(*shifted((here.ra_deg, here.dec_deg), turn.east_deg, turn.north_deg))
    else:
        for angle, ways in (
            (turn.east_deg, (Direction.EAST, Direction.WEST)),
            (turn.north_deg, (Direction.NORTH, Direction.SOUTH)),
        ):
            yield from nudge(mount, ways[angle < 0.0], abs(angle) * 3600.0, wait)
    yield from settled(mount, wait)
    return turn


def _turned(of_date_to_camera: Floats, turns: Floats) -> Floats:
    """The camera after the telescope turned by (east, north) radians; rotations only."""
    level = cross_product(of_date_to_camera[2], POLE)
    north = about(level / max(float(np.linalg.norm(level)), 1e-12), float(turns[1]))
    return np.asarray(of_date_to_camera @ (about(POLE, float(turns[0])) @ north).T)
