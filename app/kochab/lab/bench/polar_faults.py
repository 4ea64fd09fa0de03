"""What becomes of sweeps that went wrong: frames under erfa's sky through all of ``kochab polar`` but the pictures.

Each run draws a sweep of :mod:`kochab.lab.bench.polar_sweeps` or light frames of a mount that tracked, lets one thing
go wrong, solves the frames (stars with noise, fitted as the solver does) and asks for the axis as the command does. An
answer is *silent* where it is wrong, outside its 95 % ellipse, and nothing said so: the exit code is 0 and bolts are
told. What the frames can't show (site, clock, two frames alone) counts as said where it is a finding and the exit code
that of doubt, 3: only there, for everything is in doubt that nothing bears out. Healthy sweeps are *accused* where the
exit code is 1. The axis is the one at the last frame.
"""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from kochab.attitude.fit import refine
from kochab.core.arrays import Floats
from kochab.core.attitude import ARCSEC, Attitude, angle_between, radec_deg
from kochab.core.camera import Camera
from kochab.core.frame import Site
from kochab.core.solution import Matches, NamedStar, Solution
from kochab.lab.bench import ALL_ROWS, Goal, Only, Report, Row, reported, timed
from kochab.lab.bench import polar_sweeps as sky
from kochab.lab.bench.polar_sweeps import Random, Sweep
from kochab.polar.drift import Drift
from kochab.polar.error import CHI2_95, Knob
from kochab.polar.measure import MeasureSettings, NoAxis, measure
from kochab.sky.horizon import Refraction
from kochab.workflows.polar.solutions import FilesAxis, FilesRequest, axis_of
from kochab.workflows.polar.sources import SolvedFile, sightings_of

SEED = 290_000
FULL, QUICK = 200, 2
MOST_SILENT, MOST_ACCUSED, IN_DOUBT = 0.05, 0.01, 3
MOST_CPU_S, MANY_FRAMES = 3.0, "evening: Dec moved, 60 frames"


def solved_files(sweep: Sweep, rng: Random) -> list[SolvedFile]:
    """The frames of a sweep, solved from their stars, with what their headers say of the time."""
    rig, files = sweep.rig, []
    camera = Camera.centred(rig.width, rig.height, rig.focal_px)
    for number, shot in enumerate(sweep.exposures):
        xy, icrs = sweep.stars(number, rng)
        u, _, vt = np.linalg.svd(rig.directions(xy).T @ icrs)
        start = Attitude(u @ np.diag((1.0, 1.0, np.linalg.det(u @ vt))) @ vt)
        fit = refine(Matches(count := np.arange(len(xy)), count, xy, icrs), camera, start)
        stars = (
            NamedStar(float(at[0]), float(at[1]), "", "", 8.0, *radec_deg(v), 0.0)
            for at, v in zip(xy, icrs, strict=True)
        )
        solution = Solution(fit.camera, fit.attitude, tuple(stars), fit.rms_px, -30.0, "")
        files.append(SolvedFile(f"frame {number + 1}", solution, shot.stated, None))
    return files


def reported_axis(sweep: Sweep, rng: Random, utc_offset_h: float | None = 0.0) -> FilesAxis:
    """What ``kochab polar`` says of a sweep: its site given, its clock as sure as ``utc_offset_h`` makes it."""
    stated = sweep.stated_place
    site = Site(stated.latitude_deg, stated.longitude_deg, stated.height_m)
    air = Refraction(sweep.place.pressure_hpa, sweep.place.temperature_c, sweep.place.humidity)
    files = solved_files(sweep, rng)
    return axis_of(files, [0] * len(files), [], FilesRequest(site, refraction=air, utc_offset_h=utc_offset_h))


# -- Kinds of evenings: what is drawn, and what goes wrong -------------------------------------------


def _sweep(change: Callable[[Sweep, Random], Sweep], frames: int | None = None) -> Callable[[Random], Sweep]:
    return lambda rng: change(sky.random_sweep(rng, frames), rng)


def _lights(change: Callable[[Sweep, Random], Sweep], guided: bool) -> Callable[[Random], Sweep]:
    def drawn(rng: Random) -> Sweep:
        while True:
            sweep = sky.tracked(sky.random_sweep(rng, 2), rng, rng.uniform(20.0, 90.0), guided)
            if sweep.lowest_deg() > 20.0 and sweep.is_dark():
                break
        return change(sweep, rng)

    return drawn


def _still(sweep: Sweep, rng: Random) -> Sweep:
    return sweep


KINDS: dict[str, Callable[[Random], Sweep]] = {
    "healthy": _sweep(_still),
    "healthy, 3 frames": _sweep(_still, 3),
    "healthy, 2 frames": _sweep(_still, 2),
    "healthy, tracked": _lights(_still, guided=False),
    "healthy, guided": _lights(_still, guided=True),
    "Dec moved": _sweep(sky.with_dec_moved),
    "Dec moved, 2 frames": _sweep(sky.with_dec_moved, 2),
    "Dec moved, 3 frames": _sweep(sky.with_dec_moved, 3),
    "kick": _sweep(sky.with_kick),
    "kick, 2 frames": _sweep(sky.with_kick, 2),
    "kick, 3 frames": _sweep(sky.with_kick, 3),
    "kick, 4 frames": _sweep(sky.with_kick, 4),
    "bolt": _sweep(sky.with_bolt),
    "camera tilted": _sweep(sky.with_camera_tilted),
    "camera turned": _sweep(sky.with_camera_turned),
    "flip": _sweep(sky.with_flip),
    "flip, tracked": _lights(sky.with_flip, guided=False),
    "flip, guided": _lights(partial(sky.with_flip, centred=True), guided=True),
    "camera turned, tracked": _lights(sky.with_camera_turned, guided=False),
    "camera turned, guided": _lights(sky.with_camera_turned, guided=True),
    "kick, tracked": _lights(sky.with_kick, guided=False),
    "kick, guided": _lights(sky.with_kick, guided=True),
    "one time wrong, 2 frames": _sweep(sky.with_one_time_wrong, 2),
    "one time wrong": _sweep(sky.with_one_time_wrong),
    "clock an hour wrong": _sweep(sky.with_clock_wrong),
    "site 1 deg wrong": _sweep(sky.with_site_wrong),
    "latitude sign": _sweep(lambda sweep, rng: sky.with_sign_wrong(sweep, "latitude")),
    "longitude sign": _sweep(lambda sweep, rng: sky.with_sign_wrong(sweep, "longitude")),
}


# -- Scores ------------------------------------------------------------------------------------------


def true_axis(sweep: Sweep, pole: Floats) -> Floats:
    """The true axis (E, N, U) as its bolts have to be turned, about a pole that stands where the said site has it."""
    (axis, there), (up, side) = (_alt_az(v) for v in (sweep.axis, sky.refracted_pole(sweep.place))), _alt_az(pole)
    altitude, azimuth = up + axis[0] - there[0], side + axis[1] - there[1]
    return np.array([np.cos(altitude) * np.sin(azimuth), np.cos(altitude) * np.cos(azimuth), np.sin(altitude)])


def _alt_az(v: Floats) -> tuple[float, float]:
    return float(np.arcsin(v[2])), float(np.arctan2(v[0], v[1]))


def judge(kind: str, seed: int) -> Row:
    """One evening: how far off the axis is, whether its ellipse holds it, and what was said."""
    rng = np.random.default_rng([SEED, list(KINDS).index(kind), seed])
    sweep = KINDS[kind](rng)
    result = reported_axis(sweep, rng).result
    if isinstance(result, NoAxis):
        return {"bolts": False, "code": 1, "inside": True, "off_arcsec": np.nan, "findings": (result.kind.name,)}
    whole, truth = result.error.with_systematics, true_axis(sweep, result.error.pole)
    return {
        "bolts": not result.spoilt and (any(map(result.tells, Knob)) if isinstance(result, Drift) else result.checked),
        "code": IN_DOUBT if result.unsettled else int(result.spoilt),
        "inside": whole.distance2(truth) <= CHI2_95,
        "off_arcsec": angle_between(result.error.axis, truth) / ARCSEC,
        "uncertainty_arcsec": whole.uncertainty_arcsec,
        "findings": tuple(finding.kind.name for finding in result.findings),
    }


ON_TRUST = ("clock an hour wrong", "site 1 deg wrong", "latitude sign", "longitude sign")
"""What the frames themselves can't show: there the exit code of doubt, with a word of site and clock, is all."""


def fault_rows(quick: bool, report: Report, only: Only = ALL_ROWS) -> tuple[list[Row], list[Goal]]:
    """A row a kind of evening; of those that went wrong the share that is silently so, of healthy ones the accused."""
    count, kinds = QUICK if quick else FULL, [kind for kind in KINDS if only(f"evening: {kind}")]
    if kinds:
        report(f"{count} evenings each of {len(kinds)} kinds under erfa's sky ...")
    rows = [reported(_row(kind, [judge(kind, seed) for seed in range(count)]), report) for kind in kinds]
    if not only(MANY_FRAMES):
        return rows, [_goal(row) for row in rows]
    many = reported(_many_frames(1 if quick else 5), report)
    costs = Goal.at_most(f"{many['kind']}: most s of processor", many["cpu_ms"] / 1e3, MOST_CPU_S)
    return [*rows, many], [*(_goal(row) for row in rows), costs]


def _many_frames(count: int) -> Row:
    """What 60 frames cost among which Dec slipped: each gap between two is supposed, with each cause."""
    spent = []
    for seed in range(count):
        rng = np.random.default_rng([SEED, 60, seed])
        sweep = sky.with_dec_moved(sky.random_sweep(rng, 60), rng)
        place = sweep.stated_place
        sightings = sightings_of(files := solved_files(sweep, rng), [0] * len(files))
        settings = MeasureSettings(Site(place.latitude_deg, place.longitude_deg, place.height_m))
        spent.append(timed(partial(measure, sightings, settings))[1])
    return {"kind": MANY_FRAMES, "runs": count, "cpu_ms": 1e3 * max(spent)}


def _row(kind: str, own: Sequence[Row]) -> Row:
    """Scores of one kind; ``low_95`` to ``high_95`` holds what so many evenings tell of the share that is judged."""
    trusted = kind in ON_TRUST
    flagged = [trusted and r["code"] == IN_DOUBT and "ON_TRUST" in r["findings"] for r in own]
    silent = [r["bolts"] and not r["inside"] and not admitted for r, admitted in zip(own, flagged, strict=True)]
    off = [r["off_arcsec"] for r in own if r["bolts"]]
    spoilt = sum(r["code"] == 1 for r in own)
    low, high = _interval(spoilt if kind.startswith("healthy") else sum(silent), len(own))
    return {
        "kind": f"evening: {kind}",
        "runs": len(own),
        "median_arcsec": float(np.median(off)) if off else np.nan,
        "worst_arcsec": max(off, default=np.nan),
        "in_95": float(np.mean([r["inside"] for r in own])),
        "silent": float(np.mean(silent)),
        "low_95": low,
        "high_95": high,
        "spoilt": float(spoilt),
        "in_doubt": float(sum(r["code"] == IN_DOUBT for r in own)),
    }


def _interval(count: int, of: int) -> tuple[float, float]:
    """The exact 95 % interval of a share, ``count`` of ``of`` seen (Clopper and Pearson 1934, Biometrika 26, 404)."""
    from scipy.special import betaincinv  # scipy.stats takes two seconds to load, and is in no installed program

    low = betaincinv(count, of - count + 1, 0.025) if count else 0.0
    high = betaincinv(count + 1, of - count, 0.975) if count < of else 1.0
    return float(low), float(high)


def _goal(row: Row) -> Goal:
    if row["kind"].startswith("evening: healthy"):
        return Goal.at_most(f"{row['kind']}: accused", row["spoilt"] / row["runs"], MOST_ACCUSED)
    return Goal.at_most(f"{row['kind']}: wrong, and nothing said so", row["silent"], MOST_SILENT)
