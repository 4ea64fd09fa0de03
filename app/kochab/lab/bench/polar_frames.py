"""Axes from rendered frames by the whole program: render, detect, identify, fit, axis.

Every run draws a camera, a night, a site (latitude -60 to 70 deg), weather that the program is told of, an axis 1
arcmin to 5 deg off its pole, 2 to 8 frames over 30 to 90 deg of turn, and the altitude of the lowest (15 to 75 deg).
Of the camera the program knows nothing: the lens distorts the corners by up to 3 %, its axis is up to 1 % of the
width off the centre. The air moves each frame as a whole by 0.7 arcsec.

Nothing of ``kochab.polar`` takes part in the rendering. Refraction is that of a ray traced through a standard
atmosphere (Auer and Standish 2000, AJ 119, 2472, equation 3), not the two-term formula that the program uses.
"""

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial

import erfa
import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import ARCSEC, cross_product, small_rotation, unit
from kochab.core.camera import Camera
from kochab.core.frame import Frame, Hint, Site
from kochab.core.progress import run as drive
from kochab.core.solution import Solution
from kochab.core.values import frozen
from kochab.lab.bench import ALL_ROWS, Goal, Only, Report, Row, column, reported, summary, timed
from kochab.polar.error import CHI2_95
from kochab.polar.measure import Measurement, MeasureSettings, PolarFindingKind, measure
from kochab.polar.sighting import Sighting
from kochab.simulate.star_images import FWHM_PER_SIGMA, RenderedStar, Sensor, Sky, render
from kochab.sky import open_catalogue
from kochab.sky.apparent import JD_UNIX, julian_years
from kochab.sky.horizon import Refraction
from kochab.solver import SolveOptions
from kochab.solver.pipeline import solve_frame

SEED = 160_000
FIELDS_DEG = (1.0, 3.0, 8.0, 15.0, 24.0)
NARROW_DEG = 8.0
BANDS = (15.0, 30.0), (30.0, 50.0), (50.0, 76.0)
FULL, QUICK = 40, 2  # runs a field
WIDTH, HEIGHT = 1600, 1200
STARS, FWHM_PX, SKY_E, FAINTEST_PX = 300, 3.0, 300.0, 0.15
CORNER, DECENTRED, SEEING_ARCSEC = 0.03, 0.01, 0.7
ACCUSED = {
    PolarFindingKind.DEC_MOVED,
    PolarFindingKind.CAMERA_TURNED,
    PolarFindingKind.DISAGREE,
    PolarFindingKind.SCATTER_TOO_LARGE,
    PolarFindingKind.SITE_OR_TIME,
}
"""Findings that are false where only RA turned."""


@frozen(eq=False)
class Night:
    """A camera that turns about one axis; ``enu_to_camera`` (N, 3, 3) at each of ``times_unix``."""

    site: Site
    air: Refraction
    axis: Floats
    camera: Camera
    enu_to_camera: Floats
    times_unix: Floats

    @property
    def lowest_deg(self) -> float:
        """Altitude of the lowest frame's optical axis."""
        return float(np.degrees(np.arcsin(self.enu_to_camera[:, 2, 2].min())))


def night(rng: np.random.Generator, field_deg: float) -> Night:
    """One with everything drawn by chance."""
    focal = WIDTH / 2.0 / np.tan(np.radians(field_deg) / 2.0)
    # r^2 of a corner on the tangent plane, so that k1 times it is the share by which the corner is shifted.
    corner2 = (WIDTH**2 + HEIGHT**2) / (2.0 * focal) ** 2
    cx, cy = np.array([WIDTH, HEIGHT]) / 2.0 + rng.uniform(-DECENTRED, DECENTRED, 2) * WIDTH
    k1 = float(rng.uniform(-CORNER, CORNER)) / corner2
    camera = Camera(WIDTH, HEIGHT, float(focal), float(cx), float(cy), k1=k1, mirrored=bool(rng.integers(2)))
    lowest, frames = rng.uniform(15.0, 75.0), int(rng.integers(2, 9))
    while True:
        site = Site(float(rng.uniform(-60.0, 70.0)), float(rng.uniform(-180.0, 180.0)), float(rng.uniform(0.0, 2000.0)))
        pole = np.array([0.0, np.cos(tilt := np.radians(site.latitude_deg)), np.sin(tilt)]) * (1 - 2 * (tilt < 0))
        off = np.exp(rng.uniform(np.log(1.0), np.log(300.0))) / 60.0
        axis = small_rotation(np.radians(off) * unit(cross_product(pole, rng.normal(size=3)))) @ pole
        boresight, turn = unit(rng.normal(size=3)), np.radians(rng.uniform(30.0, 90.0))
        spread = np.concatenate([[0.0], np.sort(rng.uniform(0.0, 1.0, frames - 2)), [1.0]])
        turns = np.stack([small_rotation(axis * angle) for angle in turn * spread])
        if abs(np.degrees(np.arcsin((turns @ boresight)[:, 2].min())) - lowest) < 1.0:
            break
    across = unit(cross_product(boresight, rng.normal(size=3)))
    first = np.stack([across, cross_product(boresight, across), boresight])
    usual_hpa = 1013.25 * float(np.exp(-site.height_m / 8434.0))
    air = Refraction(usual_hpa + float(rng.normal(0.0, 8.0)), float(rng.normal(10.0, 8.0)))
    start = 1.7e9 + float(rng.uniform(0.0, 1e8))
    return Night(
        site, air, axis, camera, first @ np.swapaxes(turns, 1, 2), np.asarray(start + 20.0 * np.arange(frames))
    )


# -- The sky over the site: ERFA without refraction, and a ray through the air -------------------

EARTH_M, LAPSE, TROPOPAUSE_M = 6_378_120.0, 0.0065, 11_000.0  # K a metre
HYDROSTATIC = 0.0341631947  # g M / R of dry air, K a metre


def refraction(zenith_rad: Floats, site: Site, air: Refraction) -> Floats:
    """By how much, radians, the air lifts what is seen at zenith distances (N,).

    Temperature falls by 6.5 K a kilometre up to 11 km, then stays; refractivity by Hohenkerk and Sinclair (1985, NAO
    Technical Note 63), the water at the ground thinning out with a scale height of 2 km.
    """
    height = site.height_m + np.concatenate([np.linspace(0.0, 12_000.0, 1201), np.geomspace(12_010.0, 80_000.0, 800)])
    ground = air.temperature_c + 273.15
    break_m = max(TROPOPAUSE_M, site.height_m)
    kelvin = ground - LAPSE * (np.minimum(height, break_m) - site.height_m)
    pressure = air.pressure_at(site) * (kelvin / ground) ** (HYDROSTATIC / LAPSE)
    pressure = pressure * np.exp(-HYDROSTATIC * np.maximum(height - break_m, 0.0) / kelvin)
    water = air.humidity * 6.11 * np.exp(17.27 * air.temperature_c / (air.temperature_c + 237.3))
    water_up = water * np.exp(-(height - site.height_m) / 2000.0)
    wave2 = air.wavelength_um**2
    dry = (287.6155 + 1.62887 / wave2 + 0.0136 / wave2**2) * 273.15 / 1013.25
    index = 1.0 + 1e-6 * (dry * pressure - 11.2684 * water_up) / kelvin
    radius = EARTH_M + height
    # n r sin z is the same all along a ray in a spherical atmosphere (Snell); the integral of tan z dn / n bends it.
    invariant = index[0] * radius[0] * np.sin(zenith_rad)[:, None]
    rate = invariant / (index * np.sqrt(np.maximum((index * radius) ** 2 - invariant**2, 1.0)))
    return np.asarray(((rate[:, 1:] + rate[:, :-1]) / 2.0) @ -np.diff(index))


class Overhead:
    """Where stars are seen from a site, east, north and up."""

    def __init__(self, night: Night, unix_s: float) -> None:
        day, fraction = JD_UNIX + unix_s // 86400.0, (unix_s % 86400.0) / 86400.0
        place = np.radians([night.site.longitude_deg, night.site.latitude_deg])
        self._context, _ = erfa.apco13(day, fraction, 0.0, *place, night.site.height_m, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5)
        seen = np.radians(np.linspace(0.0, 89.0, 1781))
        self._true = seen + refraction(seen, night.site, night.air)
        self._seen = seen

    def seen(self, icrs: Floats) -> Floats:
        """Directions (N, 3), east, north, up, of ICRS vectors (N, 3); NaN within a degree of the horizon and below."""
        azimuth, zenith, *_ = erfa.atioq(*erfa.atciqz(*erfa.c2s(icrs), self._context), self._context)
        lifted = np.interp(zenith, self._true, self._seen, right=np.nan)
        return np.asarray(erfa.s2c(np.pi / 2.0 - azimuth, np.pi / 2.0 - lifted))

    def towards(self, enu: Floats) -> Floats:
        """ICRS vector (3,) of a direction (3,), refraction left out."""
        cirs = erfa.atoiq("A", np.arctan2(enu[0], enu[1]), np.arccos(enu[2]), self._context)
        return np.asarray(erfa.s2c(*erfa.aticq(*cirs, self._context)))


def picture(night: Night, frame: int, rng: np.random.Generator) -> Frame:
    """What the camera records, its brightest stars so bright that the faintest has 0.15 px of noise."""
    moment = float(night.times_unix[frame])
    above, matrix = Overhead(night, moment), night.enu_to_camera[frame]
    matrix = small_rotation(rng.normal(0.0, SEEING_ARCSEC * ARCSEC, 3) * [1.0, 1.0, 0.0]) @ matrix
    catalogue, camera = open_catalogue(), night.camera
    radius = np.hypot(WIDTH, HEIGHT) / 2.0 / camera.focal_px * 1.1 + np.radians(0.3)
    rows = catalogue.brightest(above.towards(matrix[2]), float(radius), 3 * STARS)
    when = datetime.fromtimestamp(moment, UTC)
    xy = camera.project(above.seen(catalogue.vectors(rows, julian_years(when))) @ matrix.T)
    with np.errstate(invalid="ignore"):
        inside = np.flatnonzero(((xy > 0.0) & (xy < [WIDTH - 1.0, HEIGHT - 1.0])).all(axis=1))[:STARS]
    flux = 10.0 ** (-0.4 * catalogue.mag(rows[inside]))
    spread = FWHM_PX / FWHM_PER_SIGMA
    snr = np.sqrt(2.0) * spread / FAINTEST_PX
    faintest_e = snr * np.sqrt(SKY_E + Sensor().read_noise_e ** 2) * 2.0 * np.sqrt(np.pi) * spread
    flux *= faintest_e / flux.min(initial=np.inf)
    noise = int(rng.integers(2**31))
    made = render(WIDTH, HEIGHT, xy[inside], flux, RenderedStar(FWHM_PX), Sky(SKY_E), Sensor(), noise)
    return replace(made, hint=Hint(time_utc=when))


# -- Scores ------------------------------------------------------------------------------------------


def measured(night: Night, rng: np.random.Generator) -> tuple[Measurement | None, int]:
    """The axis of all frames that have a solution, and how many have none."""
    sightings = []
    for number in range(len(night.times_unix)):
        frame = picture(night, number, rng)
        found = drive(solve_frame(frame, SolveOptions()))
        if isinstance(found, Solution) and frame.hint.time_utc is not None:
            sightings.append(Sighting.of(found, frame.hint.time_utc, f"frame {number + 1}"))
    settings = MeasureSettings(night.site, refraction=night.air)
    axis = measure(sightings, settings) if len(sightings) > 1 else None
    return axis if isinstance(axis, Measurement) else None, len(night.times_unix) - len(sightings)


def measure_frames(field_deg: float, seed: int) -> Row:
    """One alignment: how far off, whether the ellipse of the frames' own noise holds it, whether it was accused."""
    rng = np.random.default_rng([SEED, int(field_deg), seed])
    drawn = night(rng, field_deg)
    (found, unsolved), seconds = timed(lambda: measured(drawn, rng))
    row = {"field_deg": field_deg, "lowest_deg": drawn.lowest_deg, "unsolved": unsolved, "cpu_s": seconds}
    if found is None:
        return row | {"off_arcsec": np.inf, "uncertainty_arcsec": np.inf, "in_95": False, "accused": False}
    row |= {"off_arcsec": float(np.linalg.norm(found.error.axis - drawn.axis)) / ARCSEC}
    row |= {"in_95": found.error.distance2(drawn.axis) <= CHI2_95, "uncertainty_arcsec": found.error.uncertainty_arcsec}
    return row | {"accused": any(finding.kind in ACCUSED for finding in found.findings)}


def frames_rows(quick: bool, report: Report, only: Only = ALL_ROWS) -> tuple[list[Row], list[Goal]]:
    """A row a field and a band of lowest altitudes, and the goals."""
    count = QUICK if quick else FULL
    runs: list[Row] = []
    rows: list[Row] = []
    for field_deg in FIELDS_DEG:
        if not only(kind := f"rendered: {field_deg:g} deg"):
            continue
        report(f"{count} alignments from rendered frames of {field_deg:g} deg ...")
        own = [measure_frames(field_deg, seed) for seed in range(count)]
        runs += own
        rows.append(reported(_row(kind, own), report))
    if len(rows) < len(FIELDS_DEG):  # heights and goals are of all fields
        return rows, []
    bands = {
        f"rendered: lowest {low:g}-{high:g} deg": [r for r in runs if low <= r["lowest_deg"] < high]
        for low, high in BANDS
    }
    return [*rows, *(_row(kind, own) for kind, own in bands.items() if own)], goals(runs)


def _row(kind: str, own: Sequence[Row]) -> Row:
    row = {"kind": kind} | summary(own, runs=("off_arcsec", len), median_arcsec=("off_arcsec", np.median))
    row |= summary(own, of_20_arcsec=("off_arcsec", partial(np.percentile, q=95)), worst_arcsec=("off_arcsec", np.max))
    row |= summary(own, predicted_arcsec=("uncertainty_arcsec", np.median), in_noise_95=("in_95", np.mean))
    return row | summary(own, accused=("accused", np.sum), unsolved=("unsolved", np.sum), cpu_s=("cpu_s", np.median))


def goals(runs: Sequence[Row]) -> list[Goal]:
    """What was asked for of rendered frames."""
    off, fields = column(runs, "off_arcsec"), column(runs, "field_deg")
    near, far = (float(np.median(off[which])) for which in (fields <= NARROW_DEG, fields > NARROW_DEG))
    return [
        Goal.at_most(f"rendered frames up to {NARROW_DEG:g} deg: median arcsec", near, 3.0),
        Goal.at_most(f"rendered frames beyond {NARROW_DEG:g} deg: median arcsec", far, 6.0),
        Goal.at_most("rendered frames: worst arcsec", float(off.max()), 20.0),
        Goal.between("rendered frames: inside the 95 % ellipse", float(column(runs, "in_95").mean()), 0.93, 0.97),
        Goal.at_most("rendered frames: falsely accused", float(column(runs, "accused").sum()), 0.0),
    ]
