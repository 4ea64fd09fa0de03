"""Rendered nights with planted faults, and healthy ones: what ``kochab night`` finds of them, and what it invents.

Each number it tells is compared with what was planted; a row holds how far it is off in its own uncertainties.
"""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from kochab.core.attitude import cross_product, unit, unit_vectors
from kochab.core.progress import run as finish
from kochab.lab.bench import ALL_ROWS, BenchResult, Goal, Only, Report, Row
from kochab.lab.bench.night_long import long_night
from kochab.lab.bench.night_made import (
    ALL,
    ASTEROID,
    ASTEROID_MAG,
    CLOUD_FRAMES,
    CROSSED,
    EXPOSURE_S,
    FWHM_PX,
    NEW_STAR_MAG,
    UNKNOWN_ARCSEC_H,
    UNKNOWN_BODY_MAG,
    WORM_S,
    Faults,
    MadeNight,
    made_night,
)
from kochab.simulate.camera import CameraConfig
from kochab.simulate.night_sky import LocalSky, sun_and_moon, surface_mag
from kochab.solver import SolveOptions
from kochab.workflows.night.crossings import Crossing, CrossingKind
from kochab.workflows.night.frame import NightFrame, measure_frame
from kochab.workflows.night.measure import Measure
from kochab.workflows.night.sky_brightness import DarkLevel
from kochab.workflows.night.strangers import StrangerKind
from kochab.workflows.night.summary import NO_TILT, Night, advice_of, night_of
from kochab.workflows.night.tracking import SIDEREAL_ARCSEC_S

FRAMES = 45
HEALTHY, QUICK_HEALTHY = 12, 2
SEEDS, QUICK_SEEDS = 6, 1
LONG, FRAMES_24_MP, QUICK_FRAMES_24_MP = "24 MP frames", 60, 12
PULL = 4.0
"""Uncertainties within which a planted number has to be found."""
FLYING = {
    "satellite": CrossingKind.SATELLITE,
    "unlisted satellite": CrossingKind.UNLISTED,
    "meteor": CrossingKind.METEOR,
    "aircraft": CrossingKind.AIRCRAFT,
}
ALONE = {
    "tilt": Faults(tilt_px=ALL.tilt_px),
    "periodic error": Faults(periodic_arcsec=ALL.periodic_arcsec, rate_error=ALL.rate_error),
    "cloud": Faults(cloud_mag=ALL.cloud_mag),
    "slipped clutch": Faults(slip_arcmin=ALL.slip_arcmin, dither_px=ALL.dither_px),
}
"""Each fault in a night of its own: nothing else may be found."""


def run(quick: bool, report: Report, only: Only = ALL_ROWS) -> BenchResult:
    """Measure them."""
    nights = [(f"all faults {seed}", seed, ALL) for seed in range(1, 1 + (QUICK_SEEDS if quick else SEEDS))]
    if not quick:
        nights += [(f"{name} alone", 40 + k, faults) for k, (name, faults) in enumerate(ALONE.items())]
    for seed in range(QUICK_HEALTHY if quick else HEALTHY):
        nights.append((f"healthy {seed + 1}", 60 + seed, Faults(dither_px=6.0 * (seed % 2))))
    rows: list[Row] = []
    for name, seed, faults in nights:
        if only(name):
            report(name)
            rows += planted(name, seed, faults)
    goals = _goals(rows) if rows else []
    if only(LONG):
        count = QUICK_FRAMES_24_MP if quick else FRAMES_24_MP
        report(f"{LONG}: {count} frames")
        row = long_night(count, 2)
        rows.append({"night": LONG, **row})
        wall, cpu = (
            row[name] / 60.0 * 300 / count if row["all solved"] else None for name in ("wall, s", "processor, s")
        )
        goals.append(Goal.at_most(f"300 frames of 24 MP on two workers, min (by {count})", wall, 3.0))
        goals.append(Goal.at_most("the same, processor of all processes, min", cpu, 6.0))
    return BenchResult("night", rows, goals)


def _goals(rows: Sequence[Row]) -> list[Goal]:
    asked = [row for row in rows if row["planted"]]
    found = [Goal.at_most("faults invented", sum(row["found"] for row in rows if not row["planted"]), 0.0)]
    pulls = np.abs([row["sigmas off"] for row in asked if row.get("sigmas off") is not None])
    if not len(pulls):  # of healthy nights alone
        return found
    return [
        Goal.at_least("planted faults found, %", 100.0 * float(np.mean([row["found"] for row in asked])), 100.0),
        *found,
        Goal.at_least("planted numbers within 2 sigma, %", 100.0 * float(np.mean(pulls < 2.0)), 90.0),
        Goal.at_most("planted numbers, worst in sigma", float(pulls.max()), PULL),
    ]


def planted(name: str, seed: int, faults: Faults) -> list[Row]:
    """Make a night, measure it, and compare; what was not planted is listed where it is found."""
    with TemporaryDirectory() as folder:
        made = None
        for step in made_night(Path(folder), seed, faults, FRAMES):
            made = step if isinstance(step, MadeNight) else None
        assert made is not None
        frames = [finish(measure_frame(file, SolveOptions(), more=made.elements)) for file in made.files]
        sensor = next(frame.on_sky.sensor for frame in frames if frame.on_sky)
        dark = DarkLevel(sensor, EXPOSURE_S, CameraConfig().sensor.bias)
        night = night_of([*frames, NightFrame("dark", calibration=True, dark=dark)])
        rows: list[Row] = [{"night": name, **row} for row in compared(night, made, faults)]
    clean = faults == Faults(dither_px=faults.dither_px)
    calm = advice_of(night).startswith("Nothing stands out")
    if clean:
        rows.append({"night": name, "fault": "advice", "planted": False, "found": not calm})
    return rows


def compared(night: Night, made: MadeNight, faults: Faults) -> Iterator[dict[str, Any]]:
    """A row a fault that is planted or could be invented."""
    true = 2.0 * math.hypot(*faults.tilt_px)
    yield _row("FWHM, px", FWHM_PX, night.fwhm, night.fwhm is not None)
    tilted = night.shape is not None and night.shape.tilt_chance < NO_TILT
    yield _row("tilt, px", true, night.shape.tilt if night.shape and (tilted or true) else None, tilted)
    clouded = {_frame_of(night, k) for k in night.clouded}
    wanted = set(range(*CLOUD_FRAMES)) if faults.cloud_mag else set()
    lost = [night.cloud[k] for k in night.clouded]
    row = _row("cloud, mag", faults.cloud_mag, _mean([one for one in lost if one]), bool(clouded))
    yield {**row, "found": clouded == wanted if wanted else bool(clouded)}
    knocks = [jump for one in night.tracking for jump in one.knocks]
    # the sky moves in RA by the cosine of Dec of what the axis turns
    slip = 60.0 * faults.slip_arcmin * math.cos(math.radians(night.frames[0].dec_deg))
    row = _row("slipped clutch, arcsec", slip, knocks[0].size if knocks else None, bool(knocks))
    yield {**row, "found": len(knocks) == 1 and knocks[0].axis == "RA" if slip else bool(knocks)}
    yield from _of_the_sky(night, made, clouded | wanted)
    yield from _of_the_worm(night, faults)
    yield from _crossed(night, made, faults)
    yield from _among_the_stars(night, made, faults)


def _of_the_sky(night: Night, made: MadeNight, clouded: set[int]) -> Iterator[dict[str, Any]]:
    """The brightness of the clear sky, frame by frame, in the mean."""
    true, found = [], []
    for k, (frame, one) in enumerate(zip(night.frames, night.brightness, strict=True)):
        if one and frame.time_utc and _frame_of(night, k) not in clouded:
            unix_s = frame.time_utc.timestamp()
            local = LocalSky(made.site, unix_s)
            there = local.to_enu(unit_vectors(frame.ra_deg, frame.dec_deg)[None])
            true.append(float(surface_mag(there, sun_and_moon(local, unix_s))[0]))
            found.append(one)
    yield _row("sky, mag/arcsec2", float(np.mean(true)) if true else 0.0, _mean(found), bool(found))


def _of_the_worm(night: Night, faults: Faults) -> Iterator[dict[str, Any]]:
    """Amplitude and period of the periodic error, and the rate of the axis."""
    held = max(night.tracking, key=lambda one: len(one.frames))
    worm, true = held.periodic, faults.periodic_arcsec
    yield _row("periodic error, arcsec", true, worm.amplitudes[0] if worm else None, worm is not None)
    if true:
        yield _row("its period, s", WORM_S, worm.period_s if worm else None, worm is not None)
    rate = SIDEREAL_ARCSEC_S * (1.0 + faults.rate_error)
    yield _row("tracking rate, arcsec/s", rate, held.rate_arcsec_s, held.rate_arcsec_s is not None)


def _crossed(night: Night, made: MadeNight, faults: Faults) -> Iterator[dict[str, Any]]:
    """Each thing that flew by, in its own frame, and what was seen beside."""
    left = [(_frame_of(night, k), one) for k, one in night.crossings]
    for name, kind in FLYING.items():
        if name not in faults.crossing:
            continue
        mine = [(k, one) for k, one in left if k == CROSSED[name]]
        left = [(k, one) for k, one in left if k != CROSSED[name]]
        right = len(mine) == 1 and mine[0][1].kind is kind
        if right and kind is CrossingKind.SATELLITE:
            right = mine[0][1].name == made.places[name]["name"]
        row = _row(f"{name}, off in arcsec", 0.0, _beside(mine[0][1], made.places[name]) if mine else None, right)
        yield {**row, "planted": True}
    yield {"fault": "another streak", "planted": False, "found": bool(left)}


def _beside(one: Crossing, place: dict[str, Any]) -> Measure | None:
    """How far the middle of a streak lies beside the great circle that was drawn, arcsec."""
    if "ends" not in place:
        return Measure(one.off_arcsec, 0.0)
    pole = cross_product(*place["ends"])
    vectors = np.array([unit_vectors(*end) for end in one.ends_deg])
    off = np.degrees(np.arcsin(unit(vectors.sum(axis=0)) @ (pole / np.linalg.norm(pole)))) * 3600.0
    return Measure(abs(float(off)), one.sigma_arcsec)


def _among_the_stars(night: Night, made: MadeNight, faults: Faults) -> Iterator[dict[str, Any]]:
    """The asteroid, the unknown body and the new star, and what was told beside them."""
    left = list(night.strangers)
    wanted = [(ASTEROID, StrangerKind.BODY, ASTEROID_MAG)] * faults.asteroid
    wanted += [("new star", StrangerKind.NEW_STAR, NEW_STAR_MAG)] * ("new star" in faults.crossing)
    wanted += [("unknown body", StrangerKind.UNKNOWN_BODY, UNKNOWN_BODY_MAG)] * ("unknown body" in faults.crossing)
    for name, kind, mag in wanted:
        mine = [one for one in left if one.kind is kind and (kind is not StrangerKind.BODY or one.name == name)]
        left = [one for one in left if one not in mine]
        yield _row(f"{name}, V", mag, mine[0].mag if mine else None, len(mine) == 1)
        if kind is StrangerKind.UNKNOWN_BODY:
            rate = Measure(math.hypot(*(r.value for r in mine[0].rate_arcsec_h)), mine[0].rate_arcsec_h[0].sigma)
            yield _row(f"{name}, arcsec/h", UNKNOWN_ARCSEC_H, rate if mine else None, len(mine) == 1)
        elif "at" in made.places.get(name, {}) and mine:
            there = unit_vectors(mine[0].sights[0].ra_deg, mine[0].sights[0].dec_deg)
            off = float(np.degrees(np.linalg.norm(there - made.places[name]["at"]))) * 3600.0
            yield {**_row(f"{name}, off in arcsec", 0.0, Measure(off, mine[0].sigma_arcsec), True), "planted": True}
    yield {"fault": "another object", "planted": False, "found": bool(left)}


def _frame_of(night: Night, k: int) -> int:
    return int(Path(night.frames[k].file).stem[-3:])


def _mean(values: list[Measure]) -> Measure | None:
    if not values:
        return None
    return Measure(float(np.mean([one.value for one in values])), float(np.mean([one.sigma for one in values])))


def _row(fault: str, true: float, measure: Measure | None, found: bool) -> dict[str, Any]:
    off = (measure.value - true) / measure.sigma if measure and measure.sigma > 0.0 else None
    value, sigma = (measure.value, measure.sigma) if measure else (None, None)
    return {
        "fault": fault,
        "planted": bool(true),
        "true": true or None,
        "told": value,
        "sigma": sigma,
        "sigmas off": off,
        "found": found,
    }
