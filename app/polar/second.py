"""Where a second sweep shows most of how the tube bends: another declination, still well up."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.core.mount import Direction
from app.polar.combine import Look, combined
from app.polar.error import PolarError
from app.polar.measure import Measurement
from app.polar.path import Way, best_way
from app.polar.plan import Optics, weighted_arcsec
from app.polar.poles import northern
from app.polar.rotations import ARCSEC, about
from app.polar.sighting import LocalAttitude

Floats = NDArray[np.float64]

MOVES_DEG = tuple(sign * step for step in range(20, 75, 5) for sign in (1.0, -1.0))
NEAREST_DEG, FURTHEST_DEG = 10.0, 130.0
"""From the elevated pole; nearer, the declination axis is hardly to be told from the other."""

WORTH = 0.9
"""A second sweep that leaves more than this of what was not seen is not worth its time."""

LEAST_ARCSEC = 2.0  # bending that shifts the axis by less need not be known


BACK_COSTS = 1.05  # times surer must be what asks for the first sweep to be turned back


@dataclass(frozen=True, slots=True)
class SecondSweep:
    """Turn the declination axis by ``degrees`` and sweep again along ``way``.

    ``back_deg`` is how far RA has to go back first, against the way of the first sweep.
    ``declination_deg`` is where that is, about; ``foreseen_arcsec`` how surely the axis will then
    be known, bending and noise together, both directions; ``shows`` whether it tells of bending.
    """

    back_deg: float
    direction: Direction
    degrees: float
    declination_deg: float
    way: Way
    foreseen_arcsec: float
    shows: bool

    @property
    def cost_arcsec(self) -> float:
        """What is foreseen, a little more when RA has to be turned back for it."""
        return self.foreseen_arcsec * (BACK_COSTS if self.back_deg else 1.0)


def plan_second(
    measurement: Measurement, optics: Optics, frames: int, turn_deg: float | None = None
) -> SecondSweep | None:
    """The declination where a sweep of ``turn_deg``, None as the last, leaves the least in doubt.

    None when no other declination within reach helps: too low there, or no bending is in the
    axis from here.
    """
    if measurement.error.unseen_total_arcsec < LEAST_ARCSEC:
        return None
    last = measurement.attitudes[-1]
    first = next(a for a in measurement.attitudes if a.sweep == last.sweep)
    starts = ((0.0, last), (measurement.turn_deg, first))
    ways = [
        way
        for back_deg, start in starts
        for way in _ways(measurement, optics, frames, turn_deg, back_deg, start)
        if way.shows
    ]
    return min(ways, key=lambda second: second.cost_arcsec, default=None)


def _ways(
    m: Measurement, optics: Optics, frames: int, turn_deg: float | None, back_deg: float,
    start: LocalAttitude,
) -> Iterator[SecondSweep]:  # fmt: skip
    for move in MOVES_DEG:
        if not NEAREST_DEG <= m.rho_deg + move <= FURTHEST_DEG:
            continue
        begin = away_from_axis(start, m.fit.axis, move)
        path = best_way(begin, m.settings, turn_deg or m.turn_deg)
        if path.good:
            yield _foreseen(m, optics, frames, back_deg, move, path)


def _foreseen(
    m: Measurement, optics: Optics, frames: int, back_deg: float, move: float, path: Way
) -> SecondSweep:
    new = m.rho_deg + move
    sigma = weighted_arcsec(optics, new, path.turn_deg, frames) * ARCSEC
    error = PolarError(m.error.axis, m.error.pole, np.eye(2) * sigma**2 / 2.0)
    agreeing = _without_surprise(m.looks, error)
    both = combined((*agreeing, Look(error, np.radians(new))), m.before)
    north = northern(m.settings.site)
    return SecondSweep(
        back_deg,
        Direction.SOUTH if (move > 0) == north else Direction.NORTH,
        abs(move), (90.0 - new) * (1.0 if north else -1.0), path,
        both.error.whole.uncertainty_arcsec,
        both.error.unseen_total_arcsec < WORTH * m.error.unseen_total_arcsec,
    )  # fmt: skip


def _without_surprise(looks: Sequence[Look], error: PolarError) -> list[Look]:
    """The looks as if they had all found one axis: only their errors count for a plan."""
    return [
        Look(PolarError(error.axis, error.pole, look.error.covariance), look.rho_rad)
        for look in looks
    ]


def away_from_axis(attitude: LocalAttitude, axis: Floats, degrees: float) -> Floats:
    """Where the boresight (3,) comes to when the declination axis turns it so far from the axis."""
    boresight = attitude.boresight
    across = np.cross(axis, boresight)
    across = across / np.linalg.norm(across)
    return np.asarray(about(across, np.radians(degrees)) @ boresight)
