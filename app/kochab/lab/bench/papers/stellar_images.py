"""The thesis "Attitude from stellar images": Vega, Deneb and Sadr, in floating and fixed point.

The centroids are the printed ones, so that everything after them can be compared number by number. The scans
themselves are not published: centroids in fixed point are measured on frames drawn with stars at the printed places.
"""

from typing import Any

import numpy as np

from kochab.attitude import ESTIMATORS
from kochab.core.arrays import Floats
from kochab.core.camera import Camera
from kochab.core.frame import Detections, Frame
from kochab.core.progress import run
from kochab.core.solution import Identification, NoSolution, Solution
from kochab.core.values import frozen
from kochab.detection import DETECTORS
from kochab.identification import IDENTIFIERS
from kochab.lab.bench import timed
from kochab.lab.bench.papers import Published, fastest, solve_timed
from kochab.lab.estimators import standard_coordinates
from kochab.lab.methods import triad_tests, triads_fixed_point
from kochab.lab.methods.pairs import Pairs, catalogue_pairs
from kochab.lab.methods.triad_tests import AngleUnit, Tests, TriadBudget, TriadDetections, triads_by_separation
from kochab.lab.methods.triads import group_by_rotation
from kochab.sky import open_catalogue
from kochab.solver import SolveOptions

TABLES = Published.of("stellar_images")
FIELD_DEG = tuple(TABLES.printed["field_deg"])


@frozen
class Printed:
    """One frame of the thesis and what came of it, as ``resources/papers`` explains."""

    name: str
    steps: str
    size: tuple[int, int]
    centroids: list[list[float]]
    stars: list[int]
    paper: dict[str, float]
    separations_deg: list[float]
    fixed_deg: list[float]
    centre_deg: tuple[float, float] | None = None


VEGA, DENEB, SADR = (Printed(**frame) for frame in TABLES.printed["frames"])
THESIS = {"dec_deg": (30.0, 90.0), "field_deg": FIELD_DEG, "planar": True}
TOLERANCES = (0.15, 5.0, 1.0)  # deg: separations, rotation angle, enclosed angle
MAXIMUM_DEG = 12.0
REPEATS = 5


@frozen
class NamedImage:
    """How many stars of the frame got their printed names and other ones, and the answer."""

    right: int
    wrong: int
    answer: Solution | Identification | NoSolution
    seconds: float


def rows(quick: bool, seed: int) -> list[dict[str, Any]]:
    """All rows; ``quick`` repeats the timed ones once only."""
    out = _catalogue_rows()
    for printed in (VEGA, DENEB, SADR):
        out += _steps(printed)
        out += _answers(printed, 1 if quick else REPEATS)
        out += _fixed(printed, seed)
    return out


def list_of(printed: Printed) -> Detections:
    """The printed centroids as detections, in their order."""
    w, h = printed.size
    xy = np.array([(w - 1) / 2.0, (h - 1) / 2.0]) + np.array(printed.centroids) * [1.0, -1.0]
    return Detections.from_list(xy, w, h)


def _pairs() -> Pairs:
    return catalogue_pairs(MAXIMUM_DEG, mag_limit=6.0, year=2000.0).within_declinations(30.0, 90.0)


def _catalogue_rows() -> list[dict[str, Any]]:
    """Section 4.2 and 4.2.5: what the catalogue gives, and the size of the tables."""
    pairs, spent = timed(_pairs)
    stars = len(np.unique(np.concatenate([pairs.first, pairs.second])))
    up = np.zeros((pairs.stars, pairs.stars), dtype=bool)
    up[pairs.first, pairs.second] = True
    # of stars whose three separations are in the table: fainter partners that both stars of a pair have
    triads = sum(int((up[a] & up[b]).sum()) for a, b in zip(pairs.first, pairs.second, strict=True))
    return [
        TABLES.row("stars", stars),
        TABLES.row("separations", len(pairs), spent=spent),
        TABLES.row("angles", 3 * triads),
    ]


def _steps(printed: Printed) -> list[dict[str, Any]]:
    """Tables 4.1 and 4.2, 4.6 and 4.7, 4.11 and 4.12: from separations to groups."""
    tests = Tests(*np.radians(TOLERANCES))
    pairs = _pairs()
    sight = TriadDetections.of(list_of(printed), 2700.0, False, FIELD_DEG)
    upper = np.triu_indices(len(sight.body), 1)
    seps = np.degrees(sight.separation[upper])
    off = float(np.abs(seps - printed.separations_deg).max())
    seen, stars, looked = run(
        triads_by_separation(pairs, sight.separation, tests.separation, AngleUnit(), TriadBudget(10**9))
    )
    found = triad_tests.passing_triads(sight, seen, stars, pairs, tests, planar=True)
    groups = group_by_rotation(found, np.radians(5.0))
    words: dict[str, Any] = {"n": printed.name, "steps": printed.steps}
    paper = printed.paper
    counts = {"triads": len(found.star), "groups": len(groups), "largest": len(groups[0]) if groups else 0}
    return [
        TABLES.row("off", off, **words),
        TABLES.row("pairs", looked, paper=paper["pairs"], error=0.06 * paper["pairs"], **words),
        # the errors of counts are Poisson's
        *(TABLES.row(k, n, paper=paper[k], error=2.0 * paper[k] ** 0.5, **words) for k, n in counts.items()),
    ]


def _answers(printed: Printed, repeats: int) -> list[dict[str, Any]]:
    """Tables 4.4, 4.5, 4.9, 4.10, 4.12, 4.20 and 4.21: names, centre, seconds."""
    detections = list_of(printed)
    thesis = _named(printed, detections, repeats, "float")
    fixed = _named(printed, detections, repeats, "fixed")
    default = _by_default(printed, detections, repeats)
    n, best = printed.name, len(printed.stars) if printed.centre_deg else 0
    note = "" if best else "three stars have no answer at vote number 2"
    out = [
        TABLES.row("right", thesis.right, default.right, n=n, note=note, paper=best, best=best),
        TABLES.row("wrong", thesis.wrong, default.wrong, n=n, best=0),
        TABLES.row("right in fixed", fixed.right, default.right, n=n, paper=best, best=best),
    ]
    if printed.centre_deg is None:
        return out
    out += _centres(printed, thesis, default)
    for key, named in (("seconds", thesis), ("seconds in fixed", fixed)):
        out.append(TABLES.row(key, named.seconds, default.seconds, n=n, paper=printed.paper[key]))
    return out


def _named(printed: Printed, detections: Detections, repeats: int, arithmetic: str) -> NamedImage:
    method, got = IDENTIFIERS.make("triads", arithmetic=arithmetic, **THESIS), {}
    answer = run(method.identify(detections, None, 2000.0))  # tables and imports are not timed
    seconds = fastest(lambda: run(method.identify(detections, None, 2000.0)), repeats)
    if isinstance(answer, Identification):
        got = dict(zip(answer.matches.detection.tolist(), answer.matches.star.tolist(), strict=True))
    return NamedImage(*_counted(printed, got), answer, seconds)


def _by_default(printed: Printed, detections: Detections, repeats: int) -> NamedImage:
    options, got = SolveOptions(fov_deg=FIELD_DEG[0]), {}
    answer, _ = solve_timed(detections, options)
    seconds = min(solve_timed(detections, options)[1] for _ in range(repeats))
    if isinstance(answer, Solution):
        for star in answer.stars:
            off = np.hypot(detections.xy[:, 0] - star.x, detections.xy[:, 1] - star.y)
            found = open_catalogue().find(star.id)
            got[int(off.argmin())] = -1 if found is None else int(found)
    return NamedImage(*_counted(printed, got), answer, seconds)


def _counted(printed: Printed, got: dict[int, int]) -> tuple[int, int]:
    """Right and wrong names; of a double star, any member is right."""
    catalogue = open_catalogue()
    right = 0
    for k, star in got.items():
        true = catalogue.find(f"HR {printed.stars[k]}")
        two = catalogue.vectors(np.array([true, star]), 2000.0) if star >= 0 else np.eye(3)[:2]
        right += bool(two[0] @ two[1] > np.cos(np.radians(0.18)))
    return right, len(got) - right


def _centres(printed: Printed, thesis: NamedImage, default: NamedImage) -> list[dict[str, Any]]:
    """Where the centre lies, and how far the stars are from their places."""
    assert printed.centre_deg is not None
    assert isinstance(thesis.answer, Identification)
    matches = thesis.answer.matches
    camera = Camera.centred(*printed.size, thesis.answer.camera.focal_px)
    plate = ESTIMATORS.make("plate_constants").estimate(matches.xy, matches.vectors, camera)
    theirs: tuple[float | None, float | None] = (None, None)
    left = None
    if isinstance(found := default.answer, Solution):
        theirs = found.ra_dec_deg
        left = max(star.residual_px for star in found.stars) * found.camera.scale_arcsec_px / 3600.0
    axes = zip(("right ascension", "declination"), plate.ra_dec_deg, theirs, printed.centre_deg, strict=True)
    out = [TABLES.row("centre", ours, its, n=printed.name, axis=axis, paper=paper) for axis, ours, its, paper in axes]
    residual = _plate_residual(matches.xy, matches.vectors, plate.boresight)
    return [*out, TABLES.row("residual", residual, left, n=printed.name, paper=printed.paper["residual"])]


def _plate_residual(xy: Floats, vectors: Floats, centre: Floats) -> float:
    """The largest difference in right ascension or declination, deg, as the tables have it."""
    standard = standard_coordinates(vectors, centre)
    design = np.column_stack([xy, np.ones(len(xy))])
    fitted = design @ np.linalg.lstsq(design, standard, rcond=None)[0]
    off = np.degrees(np.abs(fitted - standard))
    off[:, 0] /= np.sqrt(1.0 - vectors[:, 2] ** 2)
    return float(off.max())


def _fixed(printed: Printed, seed: int) -> list[dict[str, Any]]:
    """Tables 4.14 to 4.19: fixed against floating point."""
    sight = TriadDetections.of(list_of(printed), 2700.0, False, FIELD_DEG)
    upper = np.triu_indices(len(sight.body), 1)
    fixed = triads_fixed_point.ANGLE.floats(triads_fixed_point.separations(sight))[upper]
    off = float(np.abs(fixed - np.degrees(sight.separation[upper])).max())
    same = int((np.abs(fixed - printed.fixed_deg) < 6e-5).sum())
    pairs = len(printed.fixed_deg)
    frame = drawn(printed, seed)
    floating = DETECTORS.make("clusters", threshold=51.0).detect(frame)
    whole = DETECTORS.make("clusters", threshold=51.0, arithmetic="fixed").detect(frame)
    apart = float(np.abs(floating.xy - whole.xy).max()) if len(floating) == len(whole) else float("nan")
    return [
        TABLES.row("centroids", apart, n=printed.name, paper=printed.paper["centroids"]),
        TABLES.row("fixed", off, n=printed.name, paper=printed.paper["fixed"]),
        TABLES.row("same", same, n=printed.name, paper=pairs, error=max(1.0, 0.3 * pairs)),
    ]


def drawn(printed: Printed, seed: int) -> Frame:
    """An 8-bit frame with round stars at the printed places, on black, of falling size."""
    w, h = printed.size
    y, x = np.mgrid[:h, :w]
    light = np.random.default_rng(seed).uniform(0.0, 20.0, (h, w))
    for k, (at_x, at_y) in enumerate(list_of(printed).xy.tolist()):
        spread = 2.0 * (3.2 - 0.15 * k) ** 2
        light += 400.0 * np.exp(-((x - at_x) ** 2 + (y - at_y) ** 2) / spread)
    return Frame(np.minimum(light, 255.0).astype(np.uint8))
