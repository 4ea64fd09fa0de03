"""How far and which way to turn the RA axis, and where a second sweep shows flexure best."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import ARCSEC, cross_product
from kochab.core.mount import Direction
from kochab.core.values import frozen
from kochab.polar.axis_fit import foreseen_covariance
from kochab.polar.error import PolarError
from kochab.polar.flexure import SweepResult, combine_sweeps
from kochab.polar.measure import Measurement, MeasureSettings
from kochab.polar.pole import northern, pole_direction
from kochab.polar.rotations import about, direction
from kochab.polar.sighting import LocalAttitude

STEP_DEG, MOST_DEG = 5.0, 120.0


@frozen
class Optics:
    """What one solve is worth, arcsec: across the field and in roll."""

    sigma_arcsec: float = 2.0
    sigma_roll_arcsec: float = 20.0

    @property
    def covariance(self) -> Floats:
        """Covariance (3, 3), rad^2, of a rotation about the camera's axes."""
        return np.diag(np.square(np.array([self.sigma_arcsec, self.sigma_arcsec, self.sigma_roll_arcsec]) * ARCSEC))


def weighted_arcsec(optics: Optics, rho_deg: float, turn_deg: float, frames: int) -> float:
    """Uncertainty of the axis, both directions, arcseconds, by a weighted fit of evenly turned attitudes.

    Parameters
    ----------
    optics : Optics
        The errors of a frame's attitude.
    rho_deg : float
        Distance of the field from the axis, degrees.
    turn_deg : float
        From the first frame to the last, degrees.
    frames : int
        How many frames.
    """
    turns = np.radians(turn_deg) * np.linspace(0.0, 1.0, frames)
    return _uncertainty_arcsec(optics, rho_deg, turns)


def turn_needed_deg(optics: Optics, rho_deg: float, goal_arcsec: float, frames: int = 3) -> float | None:
    """The smallest turn, in steps of 5 deg, that gets the axis that sure; None: not by 120 deg.

    Parameters
    ----------
    optics : Optics
        The errors of a frame's attitude.
    rho_deg : float
        Distance of the field from the axis, degrees.
    goal_arcsec : float
        Uncertainty wanted.
    frames : int
        How many frames.
    """
    return _least(MOST_DEG, lambda turn: weighted_arcsec(optics, rho_deg, turn, frames) <= goal_arcsec)


def more_turn_deg(optics: Optics, rho_deg: float, turns_rad: Floats, goal_arcsec: float) -> float | None:
    """How much further to turn, with one more frame there; 0 when it is enough, None: hopeless.

    Parameters
    ----------
    optics : Optics
        The errors of a frame's attitude.
    rho_deg : float
        Distance of the field from the axis, degrees.
    turns_rad : Floats
        Turns (N,) at which frames were taken, radians.
    goal_arcsec : float
        Uncertainty wanted.
    """
    if len(turns_rad) >= 2 and _uncertainty_arcsec(optics, rho_deg, turns_rad) <= goal_arcsec:
        return 0.0
    first, last = float(np.min(turns_rad)), float(np.max(turns_rad))
    room = MOST_DEG - np.degrees(last - first)
    return _least(
        room,
        lambda more: _uncertainty_arcsec(optics, rho_deg, np.append(turns_rad, last + np.radians(more))) <= goal_arcsec,
    )


def _least(most_deg: float, enough: Callable[[float], bool]) -> float | None:
    """The smallest turn in steps that is enough, up to the most; None: not even that one.

    Turning further never makes it worse, up to half a turn, so the steps are halved.
    """
    low, high = 0, int(np.ceil((most_deg + 1.0) / STEP_DEG)) - 1  # the last step up to most_deg, to a degree
    if high < 1 or not enough(high * STEP_DEG):
        return None
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if enough(middle * STEP_DEG) else (middle, high)
    return high * STEP_DEG


def _uncertainty_arcsec(optics: Optics, rho_deg: float, turns_rad: Floats) -> float:
    """What the fit itself says of perfect attitudes with these errors."""
    if float(np.ptp(turns_rad)) < 1e-4:  # 20 arcsec: nothing turned, no axis
        return float("inf")
    axis = direction(0.7, 0.0)  # any will do: only the angles between axis, boresight and turns count
    sideways = np.array([1.0, 0.0, 0.0])
    boresight = about(sideways, np.radians(rho_deg)) @ axis
    first = np.stack([sideways, cross_product(boresight, sideways), boresight], axis=1)
    covariance = foreseen_covariance(axis, turns_rad - turns_rad[0], first, optics.covariance)
    return float(np.sqrt(np.trace(covariance))) / ARCSEC


# -- Which way to turn the RA axis: where the boresight goes, before anything moves ------------

LOWEST_DEG = 20.0
PAST_MERIDIAN_DEG = 5.0
STEPS = 13


@frozen
class SweepPath:
    """A turn of the RA axis: how low the boresight comes, how far past the meridian."""

    direction: Direction
    turn_deg: float
    lowest_deg: float
    past_meridian_deg: float

    @property
    def good(self) -> bool:
        """Whether it stays well up and on its side of the meridian."""
        return self.lowest_deg >= LOWEST_DEG and self.past_meridian_deg <= PAST_MERIDIAN_DEG


def sweep_path(boresight: Floats, settings: MeasureSettings, direction: Direction, turn_deg: float) -> SweepPath:
    """Where a turn leads, supposing that the axis is near its pole.

    West is the way the sky goes: about the visible pole clockwise in the north, anticlockwise in the south.

    Parameters
    ----------
    boresight : Floats
        Where the camera points (3,), in east, north, up.
    settings : MeasureSettings
        Site, pole and refraction.
    direction : Direction
        East or west.
    turn_deg : float
        How far, degrees.
    """
    pole = pole_direction(settings.site, settings.pole, settings.refraction)
    sign = -1.0 if northern(settings.site) == (direction is Direction.WEST) else 1.0
    path = np.stack([about(pole, sign * a) @ boresight for a in np.linspace(0, np.radians(turn_deg), STEPS)])
    lowest = float(np.degrees(np.arcsin(path[:, 2].min())))
    side = np.sign(path[0, 0]) or 1.0  # east or west of the meridian; on it, either
    high = np.maximum(np.hypot(path[:, 1], path[:, 2]), 1e-9)
    past = np.degrees(np.arctan2(-side * path[:, 0], high)).max()
    return SweepPath(direction, turn_deg, lowest, max(0.0, float(past)))


def best_path(boresight: Floats, settings: MeasureSettings, turn_deg: float) -> SweepPath:
    """East or west, whichever stays higher without crossing the meridian; the longest good turn.

    When neither is good the one that stays higher is returned; its ``good`` is False.
    """
    # The full turn comes last again: where no shorter one is good its paths are what is chosen from.
    for wanted in (*np.arange(turn_deg, 9.0, -10.0), turn_deg):
        paths = [sweep_path(boresight, settings, d, float(wanted)) for d in (Direction.WEST, Direction.EAST)]
        if good := [path for path in paths if path.good]:
            return max(good, key=lambda path: path.lowest_deg)
    return max(paths, key=lambda path: path.lowest_deg)


# -- Where a second sweep shows flexure best: another declination, still well up ---------------

MOVES_DEG = tuple(sign * step for step in range(20, 75, 5) for sign in (1.0, -1.0))
NEAREST_DEG, FURTHEST_DEG = 10.0, 130.0
"""From the elevated pole; nearer, a turn in declination hardly differs from one in RA."""

WORTH = 0.9  # a second sweep that leaves more than this share of the flexure is not worth its time
LEAST_ARCSEC = 2.0  # flexure that shifts the axis by less need not be known
BACK_COSTS = 1.05  # times better must be a plan that turns RA back first
BACK_DEG, CREEP_ARCSEC = 5.0, 10.0  # nearer to its start than that a sweep is back; creep below that needs no frame


@frozen
class SecondSweep:
    """Turn the declination axis by ``degrees`` and sweep again along ``path``.

    ``back_deg`` is how far RA has to go back first, against the first sweep.
    ``declination_deg`` is where that is, about; ``foreseen_arcsec`` how surely the axis will then
    be known, flexure included, both directions; ``shows`` whether it measures flexure.
    """

    back_deg: float
    direction: Direction
    degrees: float
    declination_deg: float
    path: SweepPath
    foreseen_arcsec: float
    shows: bool


def plan_second(
    measurement: Measurement, optics: Optics, frames: int, turn_deg: float | None = None
) -> SecondSweep | None:
    """The declination where a second sweep leaves the least in doubt.

    None when no other declination within reach helps: too low there, or flexure hardly shifts the axis from here.

    Parameters
    ----------
    measurement : Measurement
        What the sweeps so far gave.
    optics : Optics
        The errors of a frame's attitude.
    frames : int
        How many frames the sweep would have.
    turn_deg : float or None
        How far RA would be turned; None: as in the last sweep.
    """
    if measurement.error.flexure_total_arcsec < LEAST_ARCSEC:
        return None
    last = measurement.attitudes[-1]
    first = next(a for a in measurement.attitudes if a.sweep == last.sweep)
    starts = ((0.0, last), (from_start_deg(measurement), first))
    plans = [
        plan
        for back_deg, start in starts
        for plan in _plans(measurement, optics, frames, turn_deg, back_deg, start)
        if plan.shows
    ]
    return min(plans, key=lambda plan: plan.foreseen_arcsec * (BACK_COSTS if plan.back_deg else 1.0), default=None)


def from_start_deg(measurement: Measurement) -> float:
    """How far RA stands from where its last sweep began."""
    return float(np.degrees(abs(measurement.fit.turns_rad[-1])))


def creep_to_show_arcsec(measurement: Measurement) -> float:
    """Creep that is assumed, and that one more frame, back at the start, would show; 0 where that needs none."""
    error, creep = measurement.error, measurement.error.creep_total_arcsec
    one_way = len(measurement.results) == 1 and from_start_deg(measurement) > BACK_DEG
    return creep if one_way and creep > max(error.uncertainty_arcsec, CREEP_ARCSEC) else 0.0


def _plans(
    m: Measurement, optics: Optics, frames: int, turn_deg: float | None, back_deg: float, start: LocalAttitude
) -> Iterator[SecondSweep]:
    for move in MOVES_DEG:
        if not NEAREST_DEG <= m.rho_deg + move <= FURTHEST_DEG:
            continue
        path = best_path(away_from_axis(start, m.fit.axis, move), m.settings, turn_deg or m.turn_deg)
        if path.good:
            yield _foreseen(m, optics, frames, back_deg, move, path)


def _foreseen(
    m: Measurement, optics: Optics, frames: int, back_deg: float, move: float, path: SweepPath
) -> SecondSweep:
    new = m.rho_deg + move
    sigma = weighted_arcsec(optics, new, path.turn_deg, frames) * ARCSEC
    # weighted_arcsec is of both directions together: half of its square each
    error = PolarError(m.error.axis, m.error.pole, np.eye(2) * sigma**2 / 2.0, creep=m.results[-1].error.creep)
    # As if all sweeps had found one axis: only their errors count for a plan.
    agreeing = (SweepResult(replace(error, covariance=s.error.covariance), s.rho_rad) for s in m.results)
    both = combine_sweeps((*agreeing, SweepResult(error, np.radians(new))), m.before)
    north = northern(m.settings.site)
    towards = Direction.SOUTH if (move > 0) == north else Direction.NORTH
    declination_deg = (90.0 - new) * (1.0 if north else -1.0)
    sigma_arcsec = both.error.with_systematics.uncertainty_arcsec
    shows = both.error.flexure_total_arcsec < WORTH * m.error.flexure_total_arcsec
    return SecondSweep(back_deg, towards, abs(move), declination_deg, path, sigma_arcsec, shows)


def away_from_axis(attitude: LocalAttitude, axis: Floats, degrees: float) -> Floats:
    """Where the boresight (3,) comes to when the declination axis turns it so far from the axis."""
    boresight = attitude.boresight
    across = cross_product(axis, boresight)
    across = across / np.linalg.norm(across)
    return np.asarray(about(across, np.radians(degrees)) @ boresight)
