"""Bodies of the Solar System against other people's places for them, what a frame's bodies cost, and the sky layer.

Planets and the Moon: skyfield with the whole of DE421 where both are installed, and ERFA, good to an arcminute or two.
Asteroids: Stellarium's elements of other years. Where a source is absent, a row says which package brings it.
The layer: random frames, with names that overlap, marks out of place, its cost; names beside a second source.
"""

from collections.abc import Iterator
from configparser import RawConfigParser
from contextlib import closing, suppress
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import attitude_from, separation_deg, unit, unit_vectors
from kochab.core.camera import Camera
from kochab.core.frame import Site
from kochab.core.progress import run as finish
from kochab.core.solution import Solution
from kochab.lab.bench import BenchResult, Goal, Report, Row, timed
from kochab.lab.bench.checkout import CHECKOUT
from kochab.lab.bench.second_source import (
    COLUMNS,
    bearers_of,
    contradictions,
    decided,
    misplaced_names,
    pairs,
    read_hnsky,
)
from kochab.lab.bench.sources import (
    HNSKY,
    STELLARIUM_ASTEROIDS,
    STELLARIUM_OBJECTS,
    absent,
    skyfield_is_here,
    source_file,
)
from kochab.lab.bench.stellarium_objects import plain, read_names, read_stellarium
from kochab.sky.apparent import JD_UNIX
from kochab.sky.elements import bodies_of, perihelion_jd
from kochab.sky.ephemeris import shipped_ephemeris
from kochab.sky.layer import View, faintest_of, in_frame, labels
from kochab.sky.orbits import carried
from kochab.sky.sky_tables import sky_tables
from kochab.sky.small_bodies import bodies_near, shipped_small_bodies
from kochab.sky.solar_system import major_bodies, observer_at

UTC_BEGAN = 1972
BEGIN, DAYS = datetime(1900, 3, 1, tzinfo=UTC), 55_500
ERFA = ("mercury", "venus", "earth", "mars", "jupiter", "saturn", "uranus", "neptune")
SKYFIELD = {"Sun": 10, "Moon": 301, "Mercury": 199, "Venus": 299, "Mars": 499, "Jupiter": 5, "Saturn": 6, "Uranus": 7}
SKYFIELD |= {"Neptune": 8, "Pluto": 9}

# The layer's random frames.
SIZE, SCREEN = (1500, 1000), (0.0, 0.0, 1200.0, 800.0)
FRAMES, QUICK_FRAMES = 1000, 60
LENSES = 10  # one frame in so many is a whole-sky lens
PLACE_PX = 0.01
NAME_ARCMIN = 5.0  # or a third of the object
UNDECIDED = {"place": 1.0, "mag": 1.0, "size": 3.0, "kind": 1.0, "name": 10.0}
"""Percent of what a second source has too: what is left are faint galaxies, and names that two objects share."""


def run(quick: bool, report: Report) -> BenchResult:
    """Measure them."""
    rng = np.random.default_rng(17)
    times = [BEGIN + timedelta(days=float(day)) for day in rng.uniform(0, DAYS, 20 if quick else 200)]
    places = [Site(*rng.uniform([-70, -180, 0], [75, 180, 2500]).tolist()) for _ in times]
    report("planets")
    rows = [*against_erfa(times)]
    compared = list(against_skyfield(times, places)) if skyfield_is_here() else []
    report("asteroids")
    others = list(against_stellarium(source_file(STELLARIUM_ASTEROIDS)))
    off = np.array([row["arcsec"] for row in others])
    rows += [*compared, *others, *costs()]
    moon = [row["arcsec"] for row in compared if row["body"] == "Moon"]
    planets = [row["arcsec"] for row in compared if row["body"] != "Moon"]
    goals = [
        Goal.at_most("planets and the Sun against skyfield, worst arcsec", max(planets, default=None), 1.0),
        Goal.at_most("the Moon against skyfield, worst arcsec", max(moon, default=None), 1.0),
        Goal.at_most("asteroids of other years, median arcsec", float(np.median(off)) if len(off) else None, 1.0),
        Goal.at_most("asteroids of other years, worst arcsec", float(off.max()) if len(off) else None, 5.0),
        Goal.at_most("bodies of a frame of 2026, processor s", rows[-2]["s"], 0.5),
    ]
    report("the sky layer")
    layer, more = layer_rows(quick, source_file(STELLARIUM_OBJECTS))
    report("a second source of every column")
    columns, checked = second_rows(source_file(HNSKY))
    return BenchResult("sky", [*rows, *layer, *columns, *absent()], goals + more + checked)


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
    """Astrometric places from points on the ground, worst of all times.

    Before 1972, when UTC began, times are UT; skyfield would take them for UTC with the leap seconds of 1972.
    """
    import skyfield_data
    from skyfield.api import load, wgs84
    from skyfield.jpllib import SpiceKernel

    scale, worst = load.timescale(), dict.fromkeys(SKYFIELD, 0.0)
    with closing(SpiceKernel(str(Path(skyfield_data.__file__).with_name("data") / "de421.bsp"))) as kernel:
        for time, place in zip(times, places, strict=True):
            ground = kernel[399] + wgs84.latlon(place.latitude_deg, place.longitude_deg, place.height_m)
            old = time.year < UTC_BEGAN
            when = scale.ut1_jd(JD_UNIX + time.timestamp() / 86400.0) if old else scale.from_datetime(time)
            for body in major_bodies(observer_at(time, place)):
                ra, dec, _ = ground.at(when).observe(kernel[SKYFIELD[body.name]]).radec()
                off = separation_deg(unit_vectors(ra._degrees, dec.degrees), body.vector) * 3600.0
                worst[body.name] = max(worst[body.name], off)
    for name, off in worst.items():
        yield {"body": name, "against": "skyfield, DE421", "n": len(times), "arcsec": off}


def against_stellarium(path: Path | None) -> Iterator[Row]:
    """Asteroids seen from the Earth at the dates of Stellarium's elements in ``path``, carried there from ours."""
    table, ephemeris, file = shipped_small_bodies(), shipped_ephemeris(), RawConfigParser(strict=False)
    file.read_string(path.read_text(encoding="utf-8") if path is not None else "")
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
    """Processor seconds: the planets alone; all bodies to V 14 of a field of ten degrees on the ecliptic.

    Without scipy's loading, 0.4 s once a process.
    """
    import scipy.integrate  # noqa: F401

    place = Site(48.0, 11.0)
    _, seconds = timed(lambda: [major_bodies(observer_at(BEGIN, place)) for _ in range(20)])
    yield {"body": "the Sun, the Moon, planets", "s": seconds / 20}
    for year in (2026, 2016):
        when, centre = datetime(year, 11, 23, 1, tzinfo=UTC), unit_vectors(60.0, 20.0)
        found, seconds = timed(partial(finish, bodies_near(when, place, centre, 0.09, 14.0)))
        yield {"body": f"all of a field in {year}", "n": len(found), "s": seconds}


def second_rows(table: Path | None) -> tuple[list[Row], list[Goal]]:
    """A row a column: the objects beside HNSKY's in ``table``, and what no row of corrections decides.

    Without a checkout all that differs counts.
    """
    corrections = CHECKOUT / "catalogs" / "making" / "corrections.tsv"
    known = decided(corrections) if corrections.exists() else {}
    if table is None:
        return [], [Goal.at_most(f"{column} undecided, %", None, UNDECIDED[column]) for column in COLUMNS]
    objects, second = sky_tables().objects, read_hnsky(table)
    both = list(pairs(objects, second))
    found = [one for row, other in both for one in contradictions(objects, row, other)]
    names = list(misplaced_names(second, bearers_of(objects)))
    rows: list[Row] = []
    goals: list[Goal] = []
    for column in COLUMNS:
        differ = [one.name for one in found if one.column == column]
        differ += [name for name, far in names if far and column == "name"]
        left = [name for name in differ if column not in known.get(name, ())]
        count = len(names) if column == "name" else len(both)
        rows.append({"body": f"{column} beside HNSKY", "n": count, "differ": len(differ), "undecided": len(left)})
        goals.append(Goal.at_most(f"{column} undecided, %", 100.0 * len(left) / max(count, 1), UNDECIDED[column]))
    return rows, goals


def layer_rows(quick: bool, stellarium: Path | None) -> tuple[list[Row], list[Goal]]:
    """Rows and goals of random frames of 0.1 to 60 degrees and whole-sky lenses; names, where Stellarium's are."""
    rng, tables = np.random.default_rng(17), sky_tables()
    over = off = named = 0
    spent: list[tuple[float, float]] = []
    count = QUICK_FRAMES if quick else FRAMES
    for number in range(count):
        solution = _random_frame(rng, lens=number % LENSES == 0)
        begun = process_time()
        sky = in_frame(tables, solution)
        scale = 10.0 ** rng.uniform(-0.2, 0.5)
        view = View(scale, 600.0 - 750.0 * scale, 400.0 - 500.0 * scale, SCREEN)
        projected = process_time()
        shown = labels(sky, view, faintest_of(view, solution), lambda text: (7.0 * len(text), 15.0))
        spent.append((projected - begun, process_time() - projected))
        boxes = np.array([label.box for label in shown]).reshape(-1, 4)
        low, high = boxes[:, :2], boxes[:, :2] + boxes[:, 2:]
        hits = ((low[:, None] < high[None]) & (low[None] < high[:, None])).all(axis=2)
        over += bool(hits.sum() > len(boxes))
        named += len(boxes)
        vectors = [(tables.stars if m.kind == "star" else tables.objects).vector[m.row] for m in sky.marks]
        away = np.abs(_textbook(solution, np.array(vectors).reshape(-1, 3)) - sky.places)
        off += int((~(away < PLACE_PX)).any(axis=1).sum())
    project, place = (1e3 * float(np.median(part)) for part in zip(*spent, strict=True))
    rows: list[Row] = [
        {"body": "frames of the sky layer", "n": count, "overlapping": over, "out of place": off, "names": named},
        {"body": "a frame, processor ms", "project": round(project, 2), "place names": round(place, 2)},
    ]
    goals = [
        Goal.at_most(f"frames of {count:,} with names that overlap", over, 0),
        Goal.at_most("stars and objects out of place", off, 0),
        Goal.at_most("names of the sky in a frame, median processor ms", place, 5.0),
    ]
    checked, wrong = (0, 0) if stellarium is None else names_elsewhere(stellarium)
    rows.append({"body": "names of objects beside Stellarium's", "n": checked, "elsewhere": wrong})
    return rows, [*goals, Goal.at_most("names elsewhere in the second source", wrong if checked else None, 0)]


def _random_frame(rng: np.random.Generator, lens: bool) -> Solution:
    fov = rng.uniform(90.0, 150.0) if lens else 10.0 ** rng.uniform(-1.0, np.log10(60.0))
    focal = SIZE[0] / 2.0 / float(np.tan(np.radians(fov) / 2.0))
    k1 = rng.uniform(-0.08, 0.08) * 4.0 * focal**2 / float(np.sum(np.square(SIZE)))
    middle = ((SIZE[0] - 1) / 2.0, (SIZE[1] - 1) / 2.0)
    camera = Camera(*SIZE, focal, *middle, k1, mirrored=bool(rng.random() < 0.5))
    dec = float(np.degrees(np.arcsin(rng.uniform(-1.0, 1.0))))
    return Solution(camera, attitude_from(rng.uniform(0.0, 360.0), dec, rng.uniform(-180.0, 180.0)), (), 0.0, -30.0, "")


def _textbook(solution: Solution, vectors: Floats) -> Floats:
    """Pixels (N, 2) by spherical trigonometry about the optical axis (Green 1985, chapter 13), and the lens."""
    attitude, camera = solution.attitude, solution.camera
    (ra0, dec0), roll = np.radians(attitude.ra_dec_deg), np.radians(attitude.roll_deg)
    ra, dec = np.arctan2(vectors[:, 1], vectors[:, 0]), np.arcsin(np.clip(vectors[:, 2], -1.0, 1.0))
    depth = np.sin(dec0) * np.sin(dec) + np.cos(dec0) * np.cos(dec) * np.cos(ra - ra0)
    east = np.cos(dec) * np.sin(ra - ra0) / depth
    north = (np.cos(dec0) * np.sin(dec) - np.sin(dec0) * np.cos(dec) * np.cos(ra - ra0)) / depth
    up, left = np.cos(roll) * north + np.sin(roll) * east, np.cos(roll) * east - np.sin(roll) * north
    radial = camera.focal_px * (1.0 + camera.k1 * (east**2 + north**2))
    sign = 1.0 if camera.mirrored else -1.0
    return np.column_stack([camera.cx + sign * left * radial, camera.cy - up * radial])


def names_elsewhere(catalogue: Path) -> tuple[int, int]:
    """How many shown names Stellarium's ``catalogue`` has too, and how many of these it has elsewhere."""
    given, bearers = read_names(catalogue.with_name("names.dat")), dict[str, list[tuple[Floats, str]]]()
    for one in read_stellarium(catalogue):
        for word in one.also:
            for name, _ in given.get(word, ()):
                bearers.setdefault(plain(name), []).append((unit_vectors(one.ra_deg, one.dec_deg), word))
    objects, checked, wrong = sky_tables().objects, 0, 0
    for row in range(len(objects)):
        own = {str(objects.name[row]), objects.designation(row), *str(objects.also[row]).split(",")}
        reach = np.radians(np.fmax(NAME_ARCMIN, objects.major[row] / 3.0) / 60.0)
        for name in filter(None, str(objects.common[row]).split(",")):
            others = bearers.get(plain(name), [])
            near = any(np.linalg.norm(place - objects.vector[row]) < reach or word in own for place, word in others)
            checked, wrong = checked + bool(others), wrong + (bool(others) and not near)
    return checked, wrong
