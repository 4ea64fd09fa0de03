"""``kochab bench reach``: frames that fail as a whole, whole skies, and what the search through windows must refuse.

Hard pictures with their truth lie in the folder that ``KOCHAB_FRAMES_REACH`` names, or beside the checkout; without
them their goals are not measured. Debian's ``solve-field``, where it is installed, gets the stars that Kochab detects,
unless the bench is quick.
Whole skies are star lists of four projections; captions and roofs hide fields of 24 degrees, others are stretched;
:mod:`kochab.lab.bench.narrow_fields` are solved with what is shipped, with what is made, and told where they are.
Of each picture that is found it is also counted how many bright stars that shine have their names, and how far the
centre lies from what the picture's middle alone says, in their sigmas.
"""

import json
import shutil
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from kochab.core.arrays import Array, Floats
from kochab.core.attitude import apart_deg, radec_deg
from kochab.core.frame import Detections, Frame
from kochab.core.progress import run as drive
from kochab.core.solution import NoSolution, Solution
from kochab.frames import read_frame
from kochab.lab.bench import ALL_ROWS, BenchResult, Goal, Only, Report, summary
from kochab.lab.bench.narrow_fields import MADE, SHIPPED, TOLD, narrow_fields
from kochab.lab.bench.peers import Place, astrometry_net, frames_folder, hostile_lists
from kochab.simulate.random_fields import FieldPlan, random_field
from kochab.simulate.whole_skies import RADII, whole_sky
from kochab.sky import open_catalogue
from kochab.solver import UNKNOWN_YEAR
from kochab.solver.aspect import resized
from kochab.solver.pipeline import examine_frame, solve_detections

SEED = 20261127
FIELDS_DEG = (90.0, 120.0, 150.0, 180.0, 200.0)
SKIES, QUICK_SKIES = 10, 1  # of each projection and width
SPOILT, QUICK_SPOILT = 60, 6
LISTS, QUICK_LISTS = 400, 12
QUICK_PICTURES = 3
WHOLE_SKY_DEG = 100.0
"""So wide a picture counts as a whole sky."""
SKY_WITHIN_DEG = 0.3
SPOILT_FIELD_DEG = 24.0
STRETCH = 0.15
"""Fields are made at most so much wider or narrower, evenly in their logarithm."""
BRIGHT_V = 3.0
WITHIN_95 = 2.448
"""Sigmas of one coordinate that hold 95 % of normal errors in two."""
BRIGHTEST = 90
REFUSED = "lists without truth"


def run(quick: bool, report: Report, only: Only = ALL_ROWS) -> BenchResult:
    """Solve what hides its stars, refuse what has none; print shares and processor times, each row once it is there."""
    pictures: list[dict[str, Any]] = []
    rows = {}
    for name, kept in _groups(quick, report, only, pictures):
        if kept:
            rows[name] = line = row(name, kept)
            found, seconds = (
                sum(k["found"] for k in kept),
                f"{line['median_cpu_s']:.2f} s, 99 % {line['cpu_s_99']:.2f} s",
            )
            report(f"{name}: {found} of {line['n']}, {line['wrong']} wrong, median {seconds}")
    return BenchResult("reach", list(rows.values()), goals(rows, pictures))


def _groups(
    quick: bool, report: Report, only: Only, pictures: list[dict[str, Any]]
) -> Iterator[tuple[str, list[dict[str, Any]]]]:
    """Each row's name and fact sheets, one after the other; ``pictures`` takes those of the hard ones."""
    hard, wide = "hard pictures", "whole-sky pictures"
    if only(hard) or only(wide):
        pictures += hard_pictures(QUICK_PICTURES if quick else None, report)
    spoilt, lists = (QUICK_SPOILT, QUICK_LISTS) if quick else (SPOILT, LISTS)
    lazily: dict[str, Callable[[], Iterable[dict[str, Any]]]] = {
        hard: lambda: pictures,
        wide: lambda: (p for p in pictures if p["wide"]),
        "rendered whole skies": lambda: rendered_skies(QUICK_SKIES if quick else SKIES, report),
        "captions and roofs": lambda: spoilt_fields(spoilt, np.random.default_rng(SEED)),
        "stretched fields": lambda: stretched_fields(spoilt, np.random.default_rng(SEED + 1)),
        REFUSED: lambda: (sheet(case.detections, None, 0.0) for case in hostile_lists(lists)),
    }
    yield from ((name, list(sheets())) for name, sheets in lazily.items() if only(name))
    yield from narrow_fields(quick, report, only)


def goals(rows: dict[str, dict[str, Any]], pictures: Sequence[dict[str, Any]]) -> list[Goal]:
    """Found of each kind, none wrong, bright stars named, sigmas right, and what a refusal costs."""
    shining = sum(p["shining"] for p in pictures)
    sigmas = np.array([p["sigmas"] for p in pictures if p["sigmas"] is not None])
    found = {name: float(r["found_percent"]) for name, r in rows.items()}
    refused = rows.get(REFUSED, {})
    return [
        Goal.at_least("hard pictures found, % (22 of 24)", found.get("hard pictures"), 91.6),
        Goal.at_least("whole-sky pictures found, % (14 of 15)", found.get("whole-sky pictures"), 93.3),
        Goal.at_least("rendered whole skies found, %", found.get("rendered whole skies"), 99.0),
        Goal.at_least("captions and roofs found, % (11 of 12)", found.get("captions and roofs"), 91.6),
        Goal.at_least("stretched fields found, %", found.get("stretched fields"), 90.0),
        Goal.at_least(
            "stars of V < 3 with light that are named, %",
            100.0 * sum(p["named"] for p in pictures) / shining if shining else None,
            97.0,
        ),
        Goal.at_least(
            "centres within the 95 % radius of their middles', %",
            100.0 * float(np.mean(sigmas < WITHIN_95)) if len(sigmas) else None,
            95.0,
        ),
        *(
            Goal.at_least(f"{name}, found, %", found.get(name), 99.0)
            for name in (f"0.5 deg, {TOLD}", f"0.8 deg, {MADE}", f"1.4 deg, {SHIPPED}")
        ),
        Goal.at_most("wrong answers", sum(r["wrong"] for name, r in rows.items() if name != "whole-sky pictures"), 0),
        Goal.at_most("a refusal, median, processor s", refused.get("median_cpu_s"), 0.5),
        Goal.at_most("a refusal, 99 %, processor s", refused.get("cpu_s_99"), 1.5),
    ]


def row(name: str, kept: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """One line of the table; astrometry.net's column where it was asked."""
    line = {"what": name} | summary(
        kept,
        n=("found", len),
        found_percent=("found", lambda f: 100.0 * np.mean(f)),
        wrong=("wrong", np.sum),
        median_cpu_s=("cpu_s", np.median),
        cpu_s_99=("cpu_s", lambda s: np.quantile(s, 0.99)),
    )
    rivals = [sheet["astrometry_net"] for sheet in kept if "astrometry_net" in sheet]
    return line | ({"astrometry_net_percent": 100.0 * float(np.mean(rivals))} if rivals else {})


# -- The cases ---------------------------------------------------------------------------------


def hard_pictures(most: int | None, report: Report) -> Iterator[dict[str, Any]]:
    """One fact sheet a picture of a known place; none when the pictures are not there.

    Of ``most`` pictures, None for all, astrometry.net is asked none: it may take a minute for one.
    """
    folder = frames_folder("KOCHAB_FRAMES_REACH", "frames-reach")
    if not (folder / "truth.json").exists():
        report("the hard pictures (KOCHAB_FRAMES_REACH) are not here: their goals are not measured")
        return
    truths = {n: t for n, t in json.loads((folder / "truth.json").read_text("utf-8")).items() if "ra_deg" in t}
    for name, truth in sorted(truths.items())[:most]:
        place = truth["ra_deg"], truth["dec_deg"]
        started = time.process_time()
        frame = read_frame(folder / name)
        seen = drive(examine_frame(frame))
        kept = judged(seen.result, place, truth["tol_deg"], truth.get("pixel"))
        kept |= {"cpu_s": time.process_time() - started, "wide": is_wide(truth)}
        kept |= {"shining": 0, "named": 0, "sigmas": None}
        if isinstance(seen.result, Solution) and kept["found"]:
            kept["shining"], kept["named"] = bright_stars(frame, seen.result)
            kept["sigmas"] = sigmas_of_the_middle(seen.detections, seen.result)
        report(f"{name}: {'found' if kept['found'] else 'WRONG' if kept['wrong'] else 'no solution'}")
        # Its lens is a plane and its place the middle's: near enough where the truth is the middle's too.
        if most is None and "pixel" not in truth and shutil.which("solve-field"):
            kept["astrometry_net"] = near(astrometry_net(seen.detections), place, max(truth["tol_deg"], 1.0))
        yield kept


def is_wide(truth: dict[str, Any]) -> bool:
    """Whether a picture is called a whole sky, or is as wide as one."""
    return "sky" in truth.get("what", "") or truth.get("fov_deg", 0.0) >= WHOLE_SKY_DEG


def rendered_skies(count: int, report: Report) -> Iterator[dict[str, Any]]:
    """One fact sheet a list of each projection and width; an orthographic lens sees less than 180 deg."""
    for projection in RADII:
        kept = []
        for field_deg in FIELDS_DEG:
            for number in range(0 if projection == "orthographic" and field_deg >= 180.0 else count):
                rng = np.random.default_rng([SEED, number, int(field_deg)])
                detections, middle = whole_sky(projection, field_deg, rng)
                kept.append(sheet(detections, radec_deg(middle), SKY_WITHIN_DEG))
        report(f"{projection}: {sum(k['found'] for k in kept)} of {len(kept)}")
        yield from kept


def spoilt_fields(count: int, rng: np.random.Generator) -> Iterator[dict[str, Any]]:
    """One fact sheet a field behind four lines of letters, and behind a roof with lit windows, in turn."""
    catalogue = open_catalogue()
    for number in range(count):
        field = random_field(catalogue, rng, FieldPlan(SPOILT_FIELD_DEG, missing=0.0, spurious=0.0))
        hidden = captions(field.detections, rng) if number % 2 == 0 else roof(field.detections, rng)
        yield sheet(hidden, field.attitude.ra_dec_deg, 0.01 * SPOILT_FIELD_DEG)


def stretched_fields(count: int, rng: np.random.Generator) -> Iterator[dict[str, Any]]:
    """One fact sheet a field whose picture was made wider or narrower."""
    catalogue = open_catalogue()
    for _ in range(count):
        field = random_field(catalogue, rng, FieldPlan(SPOILT_FIELD_DEG, missing=0.1, spurious=0.1))
        share = float(np.exp(np.log1p(STRETCH) * rng.uniform(-1.0, 1.0)))
        yield sheet(resized(field.detections, share), field.attitude.ra_dec_deg, 0.01 * SPOILT_FIELD_DEG)


def captions(stars: Detections, rng: np.random.Generator) -> Detections:
    """The brightest stars and, brighter than all, four lines of forty letters at the foot of the frame."""
    rows = stars.height * np.array([0.88, 0.91, 0.94, 0.97])
    letters = [np.stack([rng.uniform(0.03, 0.6, 40) * stars.width, np.full(40, y)], axis=1) for y in rows]
    return _before(stars, np.ones(len(stars), dtype=bool), np.concatenate(letters), rng)


def roof(stars: Detections, rng: np.random.Generator) -> Detections:
    """The brightest stars above a roof that hides two fifths, with sixty lit windows brighter than all."""
    eaves = 0.6 * stars.height
    windows = rng.uniform([0.0, eaves], [stars.width, stars.height], (60, 2))
    return _before(stars, stars.xy[:, 1] < eaves, windows, rng)


def _before(stars: Detections, kept: Any, lights: Any, rng: np.random.Generator) -> Detections:
    kept = np.flatnonzero(kept & (np.arange(len(stars)) < BRIGHTEST))
    flux = np.concatenate([stars.flux[kept], 10.0 * stars.flux.max() * rng.uniform(1.0, 2.0, len(lights))])
    return Detections.from_list(np.concatenate([stars.xy[kept], lights]), stars.width, stars.height, flux)


# -- Judging -----------------------------------------------------------------------------------


def sheet(detections: Detections, truth: Place | None, within_deg: float) -> dict[str, Any]:
    """Whether a list is found, blind, and what that cost; ``truth`` None where there is none."""
    started = time.process_time()
    answer = drive(solve_detections(detections))
    return judged(answer, truth, within_deg) | {"cpu_s": time.process_time() - started}


def judged(
    answer: Solution | NoSolution, truth: Place | None, within_deg: float, pixel: Sequence[float] | None = None
) -> dict[str, Any]:
    """Found rightly, or answered wrongly.

    Parameters
    ----------
    answer : Solution or NoSolution
        What came.
    truth : tuple of float or None
        RA and Dec, degrees; None where there is none.
    within_deg : float
        So near the truth an answer is right.
    pixel : sequence of float or None
        The place (x, y) in the frame that the truth is of; None for its middle.
    """
    place = None
    if isinstance(answer, Solution):
        place = answer.ra_dec_deg if pixel is None else radec_deg(answer.sky_at(np.array([pixel], dtype=float))[0])
    found = near(place, truth, within_deg)
    return {"found": found, "wrong": place is not None and not found}


def bright_stars(frame: Frame, solution: Solution) -> tuple[int, int]:
    """Stars of V < 3 where light stands five sigma above the ring around their place, and how many of them are named.

    One beside a brighter star is part of its image. The ring, 12 to 28 px, is the bench's own: no detector has part.
    """
    catalogue, known = open_catalogue(), {star.id for star in solution.named}
    rows = catalogue.brightest(solution.centre_vector, min(solution.radius_rad, np.pi / 2), 400, UNKNOWN_YEAR)
    rows = rows[np.asarray(catalogue.mag(rows)) < BRIGHT_V]
    places = solution.pixels_of(catalogue.vectors(rows, UNKNOWN_YEAR))
    shining = named = 0
    for k, label in enumerate(catalogue.labels(rows)):
        alone = np.hypot(*(places[:k] - places[k]).T).min(initial=np.inf) > 5.0
        if alone and shines(frame.pixels, places[k]):
            shining, named = shining + 1, named + (label[0] in known)
    return shining, named


def shines(pixels: Array, place: Floats) -> bool:
    """Whether there is light within 6 px of a place (2,) px that the ring around it does not have."""
    reach = 30
    size = np.array(pixels.shape[::-1])
    if not (np.isfinite(place).all() and (place > reach).all() and (place < size - reach - 1).all()):
        return False
    x, y = np.rint(place).astype(int)
    square = pixels[y - reach : y + reach + 1, x - reach : x + reach + 1].astype(np.float64)
    means = np.mean([np.roll(square, (i, j), (0, 1)) for i in (-1, 0, 1) for j in (-1, 0, 1)], axis=0)
    away = np.hypot(*np.mgrid[-reach : reach + 1, -reach : reach + 1])
    ring = means[(away > 12) & (away < 28)]
    return bool(means[away < 6].max() > np.median(ring) + 5.0 * max(float(ring.std()), 0.002 * float(pixels.max())))


def sigmas_of_the_middle(detections: Detections, solution: Solution) -> float | None:
    """Offset of the centre from that of the middle half alone, in combined sigmas; None where that has no fit."""
    size = np.array([detections.width, detections.height])
    off = detections.xy - (size - 1.0) / 2.0
    part = detections.take(np.flatnonzero((np.abs(off) < size / 4.0).all(axis=1)))
    width, height = (size // 2).tolist()
    xy = part.xy - (size - 1.0) / 2.0 + (np.array([width, height]) - 1.0) / 2.0
    answer = drive(solve_detections(replace(part, width=width, height=height, xy=xy)))
    if not isinstance(answer, Solution):
        return None
    apart_arcsec = np.degrees((solution.centre_attitude.matrix @ answer.centre_vector)[:2]) * 3600.0
    sigma = np.hypot(solution.attitude.sigma_arcsec[:2], answer.attitude.sigma_arcsec[:2])
    return float(np.hypot(*(apart_arcsec / sigma)))


def near(place: Place | None, truth: Place | None, within_deg: float) -> bool:
    """Whether there is a place, and a truth so near to it."""
    return place is not None and truth is not None and apart_deg(place, truth) < within_deg
