"""Axes of mounts that give way while they are measured: how often the ellipse that is shown holds the true one.

Attitudes are made up, 1 arcsec across the field and 4 in roll; 2 to 8 frames over 30 to 90 deg of turn, in half of
the runs in even steps of angle and time, as a motor makes them: then the frames can't tell what creeps from an axis
that stands elsewhere. Only one thing gives way in a run, by as much as the row says, and in any direction. The axis
is the one at the last frame, when the bolts are turned.
"""

from collections.abc import Callable, Sequence
from datetime import UTC, datetime, timedelta

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import ARCSEC, cross_product, small_rotation, small_rotations, unit
from kochab.core.frame import Site
from kochab.core.values import frozen
from kochab.lab.bench import ALL_ROWS, Goal, Only, Report, Row, column, reported, summary
from kochab.polar.error import CHI2_95
from kochab.polar.measure import Measurement, MeasureSettings, measure_local
from kochab.polar.sighting import LocalAttitude

SEED = 161_000
FULL, QUICK = 400, 10
NOISE = np.array([1.0, 1.0, 4.0]) * ARCSEC
UP = np.array([0.0, 0.0, 1.0])
BEGUN = datetime(2026, 3, 14, 20, 0, tzinfo=UTC)
LEAST_INSIDE = 0.93


@frozen(eq=False)
class Turn:
    """A camera that turns about an axis (3,): ``matrices`` (N, 3, 3) take it to E, N, U after ``turns_rad`` (N,).

    ``share`` (N,) is the time, 0 at the first frame and 1 at the last.
    """

    latitude_deg: float
    axis: Floats
    turns_rad: Floats
    share: Floats
    matrices: Floats


def turn(rng: np.random.Generator) -> Turn:
    """One with everything drawn by chance, its frames 15 deg high or more."""
    while True:
        latitude, frames = float(rng.uniform(-60.0, 70.0)), int(rng.integers(2, 9))
        tilt = np.radians(latitude)
        pole = np.array([0.0, np.cos(tilt), np.sin(tilt)]) * np.copysign(1.0, tilt)
        # Evenly in the logarithm from 1 arcmin to 5 deg.
        off = np.exp(rng.uniform(np.log(1.0), np.log(300.0))) / 60.0
        axis = small_rotation(np.radians(off) * unit(cross_product(pole, rng.normal(size=3)))) @ pole
        steps = np.linspace(0.0, 1.0, frames)
        share, spread = steps, steps
        if rng.integers(2):
            between = np.sort(rng.uniform(0.0, 1.0, (2, frames - 2)))
            share, spread = (np.concatenate([[0.0], each, [1.0]]) for each in between)
        turns = np.radians(rng.uniform(30.0, 90.0)) * spread * rng.choice([-1.0, 1.0])
        boresight, sideways = unit(rng.normal(size=3)), rng.normal(size=3)
        across = unit(cross_product(boresight, sideways))
        first = np.stack([across, cross_product(boresight, across), boresight], axis=1)
        matrices = small_rotations(turns[:, None] * axis) @ first
        if matrices[:, 2, 2].min() > np.sin(np.radians(15.0)):
            return Turn(latitude, axis, turns, share, matrices)


# -- What gives way: each returns attitudes (N, 3, 3), and the axis at the last frame ----------------

Fault = Callable[[Turn, np.random.Generator], tuple[Floats, Floats]]


def nothing(t: Turn, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """A mount without faults."""
    return t.matrices, t.axis


def droop(t: Turn, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """The tube sinks by 120 arcsec between zenith and horizon."""
    sinks = cross_product(UP, t.matrices[:, :, 2]) * 120.0 * ARCSEC
    return small_rotations(sinks) @ t.matrices, t.axis


def sinking(t: Turn, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """The tripod tilts by 60 arcsec towards any side."""
    tilt = small_towards(np.append(unit(rng.normal(size=2)), 0.0) * 60.0, t.share)
    return tilt @ t.matrices, tilt[-1] @ t.axis


def creep(t: Turn, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """The camera turns by 90 arcsec in its holder, about any axis."""
    return t.matrices @ small_towards(unit(rng.normal(size=3)) * 90.0, t.share), t.axis


def wobble(t: Turn, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """The axis runs around a cone of 40 arcsec, one to four times a turn."""
    phase = rng.uniform(1.0, 4.0) * t.turns_rad + rng.uniform(0.0, 2.0 * np.pi)
    across = unit(cross_product(t.axis, UP))
    tilts = np.cos(phase)[:, None] * across + np.sin(phase)[:, None] * cross_product(t.axis, across)
    return small_rotations(tilts * 40.0 * ARCSEC) @ t.matrices, t.axis


def dec_play(t: Turn, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Declination falls by 60 arcsec once, between any two frames."""
    across = unit(cross_product(UP, t.matrices[0].T @ t.axis) * [1.0, 1.0, 0.0])
    fall_arcsec = float(rng.choice([-60.0, 60.0]))
    falls = np.where(np.arange(len(t.share)) >= rng.integers(1, len(t.share)), fall_arcsec, 0.0)
    return t.matrices @ small_towards(across, falls), t.axis


def periodic(t: Turn, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """The worm turns RA by up to 60 arcsec more or less."""
    ahead = small_towards(t.axis, 60.0 * np.sin(rng.uniform(0.0, 2.0 * np.pi, len(t.share))))
    return ahead @ t.matrices, t.axis


def small_towards(vector_arcsec: Floats, shares: Floats) -> Floats:
    """Rotations (N, 3, 3) by shares (N,) of a vector (3,), arcsec."""
    return small_rotations(shares[:, None] * vector_arcsec * ARCSEC)


FAULTS: dict[str, Fault] = {
    "nothing": nothing,
    "droop 120": droop,
    "sinking 60": sinking,
    "creep 90": creep,
    "wobble 40": wobble,
    "Dec play 60": dec_play,
    "periodic error 60": periodic,
}


# -- Scores ------------------------------------------------------------------------------------------


def measure_moved(fault: str, seed: int) -> Row:
    """One sweep: how far off the axis is, and whether the ellipse holds it."""
    rng = np.random.default_rng([SEED, seed])
    drawn = turn(rng)
    matrices, axis = FAULTS[fault](drawn, rng)
    seen = [
        LocalAttitude(
            matrix @ small_rotation(rng.normal(0.0, NOISE)),
            np.diag(NOISE**2),
            BEGUN + timedelta(seconds=120.0 * float(share)),
            f"frame {number}",
        )
        for number, (matrix, share) in enumerate(zip(matrices, drawn.share, strict=True), 1)
    ]
    found = measure_local(seen, MeasureSettings(Site(drawn.latitude_deg, 0.0)))
    assert isinstance(found, Measurement)
    whole = found.error.with_systematics
    return {
        "frames": len(seen),
        "off_arcsec": float(np.linalg.norm(found.error.axis - axis)) / ARCSEC,
        "uncertainty_arcsec": whole.uncertainty_arcsec,
        "noise_95": found.error.distance2(axis) <= CHI2_95,
        "in_95": whole.distance2(axis) <= CHI2_95,
        "spoilt": found.spoilt,
    }


def moved_rows(quick: bool, report: Report, only: Only = ALL_ROWS) -> tuple[list[Row], list[Goal]]:
    """A row a fault, and whether the ellipse holds the axis."""
    count, faults = QUICK if quick else FULL, [fault for fault in FAULTS if only(f"gives way: {fault}")]
    if not faults:
        return [], []
    report(f"{count} sweeps each of mounts that give way in {len(faults)} ways ...")
    rows = [reported(_row(fault, [measure_moved(fault, seed) for seed in range(count)]), report) for fault in faults]
    return rows, [Goal.at_least(f"{row['kind']}: inside the 95 % ellipse", row["in_95"], LEAST_INSIDE) for row in rows]


def _row(fault: str, own: Sequence[Row]) -> Row:
    row = {"kind": f"gives way: {fault}"} | summary(own, runs=("off_arcsec", len))
    row |= summary(own, median_arcsec=("off_arcsec", np.median), worst_arcsec=("off_arcsec", np.max))
    row |= summary(own, predicted_arcsec=("uncertainty_arcsec", np.median), in_noise_95=("noise_95", np.mean))
    return row | {"in_95": float(column(own, "in_95").mean()), "spoilt": float(column(own, "spoilt").sum())}
