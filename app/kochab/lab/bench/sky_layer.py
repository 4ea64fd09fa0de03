"""The sky layer over random frames: names that overlap, marks out of place, its cost; names beside a second source."""

from pathlib import Path
from time import process_time

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import attitude_from, unit_vectors
from kochab.core.camera import Camera
from kochab.core.solution import Solution
from kochab.lab.bench import Goal, Row
from kochab.sky.layer import View, faintest_of, in_frame, labels
from kochab.sky.objects_build import plain, read_names, read_stellarium
from kochab.sky.sky_tables import sky_tables

SIZE, SCREEN = (1500, 1000), (0.0, 0.0, 1200.0, 800.0)
FRAMES, QUICK_FRAMES = 1000, 60
LENSES = 10  # one frame in so many is a whole-sky lens
PLACE_PX = 0.01
NAME_ARCMIN = 5.0  # or a third of the object


def layer_rows(quick: bool, packages: Path) -> tuple[list[Row], list[Goal]]:
    """Rows and goals of random frames of 0.1 to 60 degrees and whole-sky lenses; names, where the packages are."""
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
    checked, wrong = names_elsewhere(packages)
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


def names_elsewhere(packages: Path) -> tuple[int, int]:
    """How many shown names Stellarium has too, and how many of these it has elsewhere; zeros without its package."""
    found = sorted(packages.rglob("nebulae/default/catalog.dat"))
    if not found:
        return 0, 0
    given, bearers = read_names(found[0].with_name("names.dat")), dict[str, list[tuple[Floats, str]]]()
    for one in read_stellarium(found[0]):
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
