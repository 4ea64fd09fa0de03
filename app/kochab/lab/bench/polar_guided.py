"""Axes by drift from guide logs: how often the ellipse holds the true one, and whether the size is right.

The logs are ours, in PHD2's words: a star turned about the pole, a camera turned about the axis, and a guider that
answers what it measures, as PHD2's resist-switch does. Nothing of ``kochab.polar`` computes what is true. Every log
has 0.02 to 0.3 px of seeing, a worm in RA, an axis 1 to 60 arcmin off, and one more of: dithers, Dec reversed, a
calibration 30 % wrong, a second place, clouds, a guiding assistant, or pulses that gears swallow.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import ARCSEC, cross_product, small_rotation, unit
from kochab.core.frame import Site
from kochab.core.mount import SIDEREAL_RAD_S
from kochab.core.values import frozen, mutable
from kochab.lab.bench import ALL_ROWS, Goal, Only, Report, Row, column, reported, summary
from kochab.polar.drift import measure_drift
from kochab.polar.error import CHI2_95
from kochab.polar.measure import MeasureSettings, NoAxis
from kochab.polar.pole import Pole
from kochab.sky.horizon import Refraction
from kochab.workflows.polar.guide_logs import guide_log

SEED = 290_000
FULL, QUICK = 25, 3  # of each kind
UP = np.array([0.0, 0.0, 1.0])
LEAST_INSIDE, RATIO = 0.95, (0.95, 1.05)
COLUMNS = (
    "Frame,Time,mount,dx,dy,RARawDistance,DECRawDistance,RAGuideDistance,DECGuideDistance,"
    "RADuration,RADirection,DECDuration,DECDirection,XStep,YStep,StarMass,SNR,ErrorCode"
)


@frozen
class Evening:
    """What is drawn for one log; ``calibration`` is how many times farther than stated a pulse moves Dec."""

    latitude_deg: float
    altitude_off_arcsec: float
    azimuth_off_arcsec: float
    hour_deg: float
    declination_deg: float
    seeing_px: float
    minutes: float
    scale_arcsec_px: float
    step_s: float
    aggression: float
    calibration: float
    north: int = 1
    dithered: bool = False
    clouded: bool = False
    assistant: bool = False
    backlash_arcsec: float = 0.0

    @property
    def axis(self) -> Floats:
        """In E, N, U."""
        return self._direction(self.altitude_off_arcsec * ARCSEC, self.azimuth_off_arcsec * ARCSEC)

    @property
    def pole(self) -> Floats:
        """In E, N, U, without air."""
        return self._direction(0.0, 0.0)

    def _direction(self, higher: float, clockwise: float) -> Floats:
        altitude = abs(np.radians(self.latitude_deg)) + higher
        azimuth = (0.0 if self.latitude_deg > 0.0 else np.pi) + clockwise
        level = np.cos(altitude)
        return np.array([level * np.sin(azimuth), level * np.cos(azimuth), np.sin(altitude)])

    @property
    def star(self) -> Floats:
        """The star when the log begins, in E, N, U."""
        latitude, hour, declination = np.radians([self.latitude_deg, self.hour_deg, self.declination_deg])
        # towards the meridian on the equator, the west, and the north pole
        south, north = (
            np.array([0.0, -np.sin(latitude), np.cos(latitude)]),
            np.array([0.0, np.cos(latitude), np.sin(latitude)]),
        )
        west = np.array([-1.0, 0.0, 0.0])
        level = np.cos(declination)
        return np.asarray(level * (np.cos(hour) * south + np.sin(hour) * west) + np.sin(declination) * north)


def drawn(kind: str, rng: np.random.Generator) -> Evening:
    """An evening of one kind, its star 20 deg high or more all the time, its drift that of 30 arcsec or more."""
    while True:
        latitude = float(rng.choice([1.0, -1.0]) * rng.uniform(25.0, 60.0))
        off = float(np.exp(rng.uniform(np.log(60.0), np.log(3600.0))))
        way = rng.uniform(0.0, 2.0 * np.pi)
        plain = Evening(
            latitude,
            off * float(np.sin(way)),
            off * float(np.cos(way) / np.cos(np.radians(latitude))),
            float(rng.uniform(-75.0, 75.0)),
            float(rng.uniform(-40.0, 70.0)) * float(np.sign(latitude)),
            float(np.exp(rng.uniform(np.log(0.02), np.log(0.3)))),
            float(rng.uniform(12.0, 60.0)),
            float(rng.uniform(1.0, 6.5)),
            float(rng.uniform(1.5, 4.0)),
            float(rng.uniform(0.6, 1.0)),
            float(rng.normal(1.0, 0.05)),
        )
        lowest = min(plain.star[2], later(plain, plain.minutes * 60.0)[2])
        if lowest > np.sin(np.radians(20.0)) and abs(drift_shows(plain) @ _offset_arcsec(plain.axis, plain)) > 30.0:
            return KINDS[kind](plain, rng)


KINDS: dict[str, Callable[[Evening, np.random.Generator], Evening]] = {
    "plain": lambda e, rng: e,
    "dithers": lambda e, rng: replace(e, dithered=True),
    "Dec reversed": lambda e, rng: replace(e, north=-1),
    "calibration 30 % wrong": lambda e, rng: replace(e, calibration=float(rng.choice([0.7, 1.3]))),
    "two places": lambda e, rng: replace(e, minutes=min(e.minutes, 30.0)),
    "clouds": lambda e, rng: replace(e, clouded=True),
    "assistant": lambda e, rng: replace(e, assistant=True),
    "backlash": lambda e, rng: replace(e, dithered=bool(rng.integers(2)), backlash_arcsec=float(rng.uniform(2, 15))),
}


def later(evening: Evening, seconds: float) -> Floats:
    """The star so much later, in E, N, U: the sky turns it about the pole."""
    return np.asarray(small_rotation(evening.pole * _west(evening) * SIDEREAL_RAD_S * seconds) @ evening.star)


def _west(evening: Evening) -> float:
    """The sense of a turn about the elevated pole that goes with the sky."""
    return -1.0 if evening.latitude_deg > 0.0 else 1.0


def off_arcsec(evening: Evening, seconds: float) -> tuple[float, float]:
    """How far west of the camera's middle and how far south the star is, after so long without a pulse, arcsec."""
    turned = small_rotation(evening.axis * _west(evening) * SIDEREAL_RAD_S * seconds) @ _first_camera(evening)
    east, up, ahead = turned.T @ later(evening, seconds)
    return float(-east / ahead / ARCSEC), float(-up / ahead / ARCSEC)


@lru_cache(maxsize=1)
def _first_camera(evening: Evening) -> Floats:
    """East, north and straight ahead of the camera when the log begins, as columns (3, 3) in E, N, U."""
    first = evening.star
    north = unit(evening.axis * -_west(evening) - first * (evening.axis @ first) * -_west(evening))
    return np.stack([cross_product(north, first), north, first], axis=1)


@mutable
class Gear:
    """Dec behind its backlash: where the motor stands and the axis, arcsec to the north."""

    play: float
    motor: float = 0.0
    axis: float = 0.0

    def push(self, arcsec: float) -> None:
        """Move the motor; the axis follows where it touches."""
        self.motor += arcsec
        self.axis = float(np.clip(self.axis, self.motor - self.play, self.motor))


def log_of(evening: Evening, rng: np.random.Generator) -> str:
    """One run of guiding, as PHD2 writes it."""
    rate_px_s = 7.5 / evening.scale_arcsec_px
    lines = [_head(evening, rate_px_s)]
    gear, lock, west_pushed, asked = Gear(evening.backlash_arcsec), np.zeros(2), 0.0, 0
    worm = float(rng.uniform(3.0, 15.0)), float(rng.uniform(240.0, 600.0)), float(rng.uniform(0.0, 6.0))
    count = int(evening.minutes * 60.0 / evening.step_s)
    clouds = rng.integers(count // 4, 3 * count // 4) if evening.clouded else -1000
    away = range(count // 2, count // 2 + int(240.0 / evening.step_s)) if evening.assistant else range(0)
    for k in range(1, count + 1):
        at = k * evening.step_s
        if evening.assistant and k in (away.start, away.stop):
            lines.append(f"INFO: Guiding parameter change, MountGuidingEnabled = {str(k == away.stop).lower()}")
        if evening.dithered and k % 80 == 0:
            by = rng.uniform(-4.0, 4.0, 2)
            lock += by
            lines.append(f"INFO: DITHER by {by[0]:.3f}, {by[1]:.3f}, new lock pos = {lock[0]:.3f}, {lock[1]:.3f}")
        if clouds <= k < clouds + 25 and rng.random() < 0.8:
            lines.append(f'{k},{at:.3f},"DROP",,,,,,,,,,,,,11,1.20,2,"Star lost - low SNR"')
            continue
        west, south = off_arcsec(evening, at)
        wobble = worm[0] * np.sin(2.0 * np.pi * at / worm[1] + worm[2])
        noise = rng.normal(0.0, evening.seeing_px * (4.0 if clouds <= k < clouds + 25 else 1.0), 2)
        ra = (west + wobble - west_pushed) / evening.scale_arcsec_px + noise[0] - lock[0]
        north_of_star = south + gear.axis
        dec = evening.north * north_of_star / evening.scale_arcsec_px + noise[1] - lock[1]
        pulses = [0.0, 0.0]
        if k not in away:
            pulses[0] = 0.7 * ra if abs(ra) > 0.15 else 0.0
            pulses[1], asked = _resist_switch(dec, asked, evening)
        ra_ms, dec_ms = (round(min(abs(p) / rate_px_s * 1000.0, 2500.0)) for p in pulses)
        west_pushed += np.sign(pulses[0]) * ra_ms / 1000.0 * 7.5
        gear.push(-evening.north * np.sign(pulses[1]) * dec_ms / 1000.0 * 7.5 * evening.calibration)
        ways = f"{ra_ms},{'W' if pulses[0] > 0 else 'E'},{dec_ms},{'S' if pulses[1] > 0 else 'N'}"
        lines.append(f'{k},{at:.3f},"Mount",0,0,{ra:.3f},{dec:.3f},0,0,{ways},,,1500,25.0,0')
    return "\n".join([*lines, "Guiding Ends at 2026-03-14 22:00:00", ""])


def _resist_switch(dec: float, asked: int, evening: Evening) -> tuple[float, int]:
    """The correction, px, and the way that Dec was last moved: the other way only after three times the least move."""
    least = 0.12 + evening.seeing_px * 0.5
    way = int(np.sign(dec))
    if abs(dec) < least or (asked and way != asked and abs(dec) < 2.0 * least):
        return 0.0, asked
    return evening.aggression * dec, way


def _head(evening: Evening, rate_px_s: float) -> str:
    sign = "+" if evening.north > 0 else "-"
    return "\n".join(
        [
            "Guiding Begins at 2026-03-14 20:01:00",
            f"Pixel scale = {evening.scale_arcsec_px:.4f} arc-sec/px, Binning = 1, Focal length = 400 mm",
            "Mount = M, connected, guiding enabled, xAngle = 5.0, xRate = 4.000, yAngle = 95.0,"
            f" yRate = {rate_px_s:.4f}, parity = +/{sign}",
            f"RA = 5.00 hr, Dec = {evening.declination_deg:.1f} deg, Hour angle = {evening.hour_deg / 15.0:.2f} hr,"
            " Pier side = East, Rotator pos = N/A",
            COLUMNS,
        ]
    )


# -- Scores ------------------------------------------------------------------------------------------


def measure_guided(kind: str, seed: int, folder: Path) -> Row:
    """One log: by how much the axis is off where the log tells it, and whether the ellipse holds it."""
    rng = np.random.default_rng([SEED, list(KINDS).index(kind), seed])
    evening = drawn(kind, rng)
    runs = [log_of(evening, rng)]
    if kind == "two places":
        other = replace(drawn(kind, rng), calibration=evening.calibration, scale_arcsec_px=evening.scale_arcsec_px)
        other = replace(
            other,
            latitude_deg=evening.latitude_deg,
            altitude_off_arcsec=evening.altitude_off_arcsec,
            azimuth_off_arcsec=evening.azimuth_off_arcsec,
            declination_deg=float(np.copysign(other.declination_deg, evening.latitude_deg)),
        )
        if later(other, 0.0)[2] > 0.3 and later(other, other.minutes * 60.0)[2] > 0.3:
            runs.append(log_of(other, rng))
    path = folder / "PHD2_GuideLog.txt"
    path.write_text("\n".join(["PHD2 version 2.6.13, Log version 2.5. Log enabled at 2026-03-14 20:00:00", *runs]))
    settings = MeasureSettings(Site(evening.latitude_deg, 0.0), Pole.TRUE, Refraction(0.0))
    found = measure_drift(guide_log(path, settings), settings)
    if isinstance(found, NoAxis):
        raise RuntimeError(f"{kind} {seed}: {found.sentence}")
    whole = found.error.with_systematics
    along = drift_shows(evening)
    claimed, is_true = (float(along @ _offset_arcsec(axis, evening)) for axis in (found.error.axis, evening.axis))
    return {
        "off_arcsec": abs(claimed - is_true),
        "uncertainty_arcsec": float(np.sqrt(along @ whole.covariance @ along)) / ARCSEC,
        "ratio": claimed / is_true,
        "in_95": whole.distance2(evening.axis) <= CHI2_95,
        "spoilt": found.spoilt,
        "seeing_px": evening.seeing_px,
    }


def drift_shows(evening: Evening) -> Floats:
    """The direction (altitude, azimuth on the sky), (2,), along which the Dec drift of a log tells the axis."""
    level = replace(evening, altitude_off_arcsec=0.0, azimuth_off_arcsec=0.0)
    higher = replace(level, altitude_off_arcsec=60.0)
    clockwise = replace(level, azimuth_off_arcsec=60.0 / float(np.cos(np.radians(level.latitude_deg))))
    return unit(np.array([off_arcsec(each, evening.minutes * 60.0)[1] for each in (higher, clockwise)]))


def _offset_arcsec(axis: Floats, evening: Evening) -> Floats:
    """(Altitude, azimuth on the sky) of an axis from the pole, arcsec."""
    pole = evening.pole
    clockwise = unit(cross_product(pole, UP))
    return np.array([cross_product(clockwise, pole), clockwise]) @ axis / ARCSEC


def guided_rows(quick: bool, report: Report, only: Only = ALL_ROWS) -> tuple[list[Row], list[Goal]]:
    """A row a kind of log, and whether the ellipse holds the axis of all."""
    count, kinds = QUICK if quick else FULL, [kind for kind in KINDS if only(f"guide log: {kind}")]
    if not kinds:
        return [], []
    report(f"{count} guide logs each of {len(kinds)} kinds ...")
    every: list[Row] = []
    rows: list[Row] = []
    with TemporaryDirectory() as folder:
        for kind in kinds:
            own = [measure_guided(kind, seed, Path(folder)) for seed in range(count)]
            every += own
            rows.append(reported(_row(kind, own), report))
    inside, ratio = float(column(every, "in_95").mean()), float(np.median(column(every, "ratio")))
    return rows, [
        Goal.at_least("guide logs: inside the 95 % ellipse", inside, LEAST_INSIDE),
        Goal.between("guide logs: reported over true, median", ratio, *RATIO),
    ]


def _row(kind: str, own: Sequence[Row]) -> Row:
    row = {"kind": f"guide log: {kind}"} | summary(own, runs=("off_arcsec", len))
    row |= summary(own, median_arcsec=("off_arcsec", np.median), worst_arcsec=("off_arcsec", np.max))
    row |= summary(own, predicted_arcsec=("uncertainty_arcsec", np.median), ratio=("ratio", np.median))
    row |= summary(own, of_10_ratio=("ratio", partial(np.percentile, q=10)))
    return row | {"in_95": float(column(own, "in_95").mean()), "spoilt": float(column(own, "spoilt").sum())}
