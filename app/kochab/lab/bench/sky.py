"""Bodies of the Solar System against other people's places for them, and what a frame's bodies cost.

Planets and the Moon: skyfield with the whole of DE421 where both are installed, and ERFA, good to an arcminute or two.
Asteroids: Stellarium's elements of other years, from the packages that ``kochab catalog build`` keeps.
"""

from collections.abc import Iterator
from configparser import RawConfigParser
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from kochab.core import cache_folder
from kochab.core.arrays import Floats
from kochab.core.attitude import separation_deg, unit, unit_vectors
from kochab.core.frame import Site
from kochab.core.progress import run as finish
from kochab.lab.bench import BenchResult, Goal, Report, Row, timed
from kochab.lab.bench.sky_layer import layer_rows
from kochab.sky.elements import bodies_of, perihelion_jd
from kochab.sky.ephemeris import shipped_ephemeris
from kochab.sky.orbits import carried
from kochab.sky.small_bodies import bodies_near, shipped_small_bodies
from kochab.sky.solar_system import major_bodies, observer_at

BEGIN, DAYS = datetime(1990, 3, 1, tzinfo=UTC), 22_200
ERFA = ("mercury", "venus", "earth", "mars", "jupiter", "saturn", "uranus", "neptune")
SKYFIELD = {"Sun": 10, "Moon": 301, "Mercury": 199, "Venus": 299, "Mars": 499, "Jupiter": 5, "Saturn": 6, "Uranus": 7}
SKYFIELD |= {"Neptune": 8, "Pluto": 9}


def run(quick: bool, report: Report) -> BenchResult:
    """Measure them."""
    rng = np.random.default_rng(17)
    times = [BEGIN + timedelta(days=float(day)) for day in rng.uniform(0, DAYS, 20 if quick else 200)]
    places = [Site(*rng.uniform([-70, -180, 0], [75, 180, 2500]).tolist()) for _ in times]
    report("planets")
    rows = [*against_erfa(times)]
    beside = list(against_skyfield(times, places)) if find_spec("skyfield") and find_spec("skyfield_data") else []
    report("asteroids")
    others = list(against_stellarium(cache_folder() / "catalogue-sources"))
    off = np.array([row["arcsec"] for row in others])
    rows += [*beside, *others, *costs()]
    moon = [row["arcsec"] for row in beside if row["body"] == "Moon"]
    planets = [row["arcsec"] for row in beside if row["body"] != "Moon"]
    goals = [
        Goal.at_most("planets and the Sun against skyfield, worst arcsec", max(planets, default=None), 1.0),
        Goal.at_most("the Moon against skyfield, worst arcsec", max(moon, default=None), 1.0),
        Goal.at_most("asteroids of other years, median arcsec", float(np.median(off)) if len(off) else None, 1.0),
        Goal.at_most("asteroids of other years, worst arcsec", float(off.max()) if len(off) else None, 5.0),
        Goal.at_most("bodies of a frame of 2026, processor s", rows[-2]["s"], 0.5),
    ]
    report("the sky layer")
    layer, more = layer_rows(quick, cache_folder() / "catalogue-sources")
    return BenchResult("sky", [*rows, *layer], goals + more)


def against_erfa(times: list[datetime]) -> Iterator[Row]:
    """Directions from the Sun, and the Moon's from the Earth, worst of all times."""
    import erfa

    ephemeris = shipped_ephemeris()
    jd = np.array([observer_at(time, None).jd_tdb[0] for time in times])
    sun = ephemeris("sun", jd)
    for number, name in enumerate(ERFA, 1):
        yield _row(name, "ERFA plan94", ephemeris(name, jd) - sun, erfa.plan94(jd, 0.0, number)["p"])
    yield _row("moon", "ERFA moon98", ephemeris("moon", jd) - ephemeris("earth", jd), erfa.moon98(jd, 0.0)["p"])


def _row(body: str, truth: str, ours: Floats, theirs: Floats) -> Row:
    gap = np.linalg.norm(unit(ours) - unit(np.asarray(theirs)), axis=1)
    return {"body": body, "against": truth, "n": len(gap), "arcsec": float(np.degrees(gap.max())) * 3600.0}


def against_skyfield(times: list[datetime], places: list[Site]) -> Iterator[Row]:
    """Astrometric places from points on the ground, worst of all times."""
    import skyfield_data
    from skyfield.api import load, wgs84
    from skyfield.jpllib import SpiceKernel

    kernel, scale = SpiceKernel(str(Path(skyfield_data.__file__).with_name("data") / "de421.bsp")), load.timescale()
    worst = dict.fromkeys(SKYFIELD, 0.0)
    for time, place in zip(times, places, strict=True):
        ground = kernel[399] + wgs84.latlon(place.latitude_deg, place.longitude_deg, place.height_m)
        for body in major_bodies(observer_at(time, place)):
            ra, dec, _ = ground.at(scale.from_datetime(time)).observe(kernel[SKYFIELD[body.name]]).radec()
            off = separation_deg(unit_vectors(ra._degrees, dec.degrees), body.vector) * 3600.0
            worst[body.name] = max(worst[body.name], off)
    for name, off in worst.items():
        yield {"body": name, "against": "skyfield, DE421", "n": len(times), "arcsec": off}


def against_stellarium(packages: Path) -> Iterator[Row]:
    """Asteroids seen from the Earth at the dates of Stellarium's elements, carried there from ours."""
    table, ephemeris = shipped_small_bodies(), shipped_ephemeris()
    for path in sorted(packages.rglob("ssystem_minor.ini"))[:1]:
        file = RawConfigParser(strict=False)
        file.read_string(path.read_text(encoding="utf-8"))
        for given in (dict(file[section]) for section in file.sections()):
            name = f"{given.get('minor_planet_number')} {given.get('name')}"
            if name not in table.names:
                continue
            with suppress(KeyError):  # not every one has a date
                there = bodies_of([stellarium_row(given)])
                at, row = float(there.epoch_jd[0]), [table.names.index(name)]
                ours = finish(carried(table.state[row], table.epoch_jd[row], at, ephemeris))
                earth = ephemeris("earth", there.epoch_jd) - ephemeris("sun", there.epoch_jd)
                yield _row(name, f"Stellarium, JD {at:.0f}", ours[:, :3] - earth, there.state[:, :3] - earth)


def stellarium_row(given: dict[str, str]) -> dict[str, Any]:
    """Elements of an asteroid in Stellarium's words."""

    def number(key: str) -> float:
        return float(given[f"orbit_{key}".lower()])

    e, epoch = number("Eccentricity"), number("Epoch")
    q = number("SemiMajorAxis") * (1.0 - e)
    tp = perihelion_jd(epoch, number("MeanAnomaly"), q, e)
    angles = {"i": number("Inclination"), "node": number("AscendingNode"), "peri": number("ArgOfPericenter")}
    return {"name": given["name"], "epoch": epoch, "q": q, "e": e, "tp": tp, "mag": 0.0, "slope": 0.15, **angles}


def costs() -> Iterator[Row]:
    """Processor seconds: the planets alone; all bodies to V 14 of a field of ten degrees on the ecliptic."""
    place = Site(48.0, 11.0)
    _, seconds = timed(lambda: [major_bodies(observer_at(BEGIN, place)) for _ in range(20)])
    yield {"body": "the Sun, the Moon, planets", "s": seconds / 20}
    for year in (2026, 2016):
        when, centre = datetime(year, 11, 23, 1, tzinfo=UTC), unit_vectors(60.0, 20.0)
        found, seconds = timed(partial(finish, bodies_near(when, place, centre, 0.09, 14.0)))
        yield {"body": f"all of a field in {year}", "n": len(found), "s": seconds}
