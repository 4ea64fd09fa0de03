"""The thesis "Attitude from stellar images": Vega, Deneb and Sadr, in floating and fixed point.

The centroids are the printed ones, so that everything after them can be compared number by number. The scans
themselves are not published: centroids in fixed point are measured on frames drawn with stars at the printed places.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from kochab.attitude import ESTIMATORS
from kochab.core.arrays import Floats
from kochab.core.camera import Camera
from kochab.core.frame import Detections, Frame
from kochab.core.progress import run
from kochab.core.solution import Identification, NoSolution, Solution
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

# What the thesis "Attitude from stellar images" prints of its three frames, tables 4.1 to 4.21.

FIELD_DEG = (9.0130, 6.9049)


@dataclass(frozen=True, slots=True, eq=False)
class Printed:
    """One frame: ``centroids`` px from its centre, y up, brightest first, and what came of them.

    ``fixed_deg`` are the separations in fixed point (1-2, 1-3, ..., 2-3, ...); ``paper`` has the
    numbers that belong to a row of `TABLES` each.
    """

    name: str
    size: tuple[int, int]
    centroids: Floats
    stars: tuple[int, ...]
    centre_deg: tuple[float, float] | None
    paper: dict[str, float]
    separations_deg: Floats
    fixed_deg: Floats


def _numbers(text: str) -> Floats:
    return np.array(text.split(), dtype=np.float64)


VEGA = Printed(
    name="Vega",
    size=(427, 319),
    centroids=_numbers(
        "16.13144 74.39691 -162.81865 95.40933 -73.08759 69.96350 -15.73050 143.07092 79.27619 -113.87619"
    ).reshape(-1, 2),
    stars=(7001, 7139, 7056, 7051, 6872),
    centre_deg=(278.45703, 37.24007),
    paper={"pairs": 5503, "triads": 26, "groups": 8, "largest": 12, "centroids": 0.00004, "fixed": 0.00317}
    | {"residual": 0.02129, "seconds": 0.232, "seconds in fixed": 0.197},
    separations_deg=_numbers("3.8045 1.8857 1.6315 4.2873 1.9725 3.2715 6.8250 1.9924 5.1148 5.9112"),
    fixed_deg=_numbers("3.8027 1.8848 1.6309 4.2861 1.9717 3.2715 6.8281 1.9912 5.1152 5.9102"),
)
DENEB = Printed(
    name="Deneb",
    size=(424, 320),
    centroids=_numbers("""
        -76.22261 56.43993 67.43734 -126.10052 101.86992 -94.63821 -57.83884 124.35950 112.81633 29.45918
        121.36667 42.18889 -144.14078 135.27670 -109.93023 145.53488 -0.88889 -81.14444
    """).reshape(-1, 2),
    stars=(7924, 7735, 7751, 7977, 7844, 7851, 8001, 8003, 7798),
    centre_deg=(307.90724, 46.43192),
    paper={"pairs": 21283, "triads": 96, "groups": 36, "largest": 23, "centroids": 0.00006, "fixed": 0.0028}
    | {"residual": 0.02184, "seconds": 0.644, "seconds in fixed": 0.622},
    separations_deg=_numbers("""
        4.9825 4.9943 1.5168 4.0603 4.2114 2.2311 2.0516 3.3728 0.9983 6.0231 3.4923 3.8077 7.2091 6.9657
        1.7465 5.8163 2.6878 2.9814 7.2035 6.8609 2.2037 4.1650 4.2013 1.8496 1.1979 4.5963 0.3294 5.9189
        5.3552 3.3962 5.9896 5.3976 3.7190 0.7602 5.5732 5.4115
    """),
    fixed_deg=_numbers("""
        4.9814 4.9941 1.5156 4.0586 4.2099 2.2295 2.0508 3.3721 0.9971 6.0234 3.4912 3.8066 7.2119 6.9678
        1.7461 5.8174 2.6865 2.9805 7.2060 6.8633 2.2021 4.1641 4.2002 1.8486 1.1963 4.5947 0.3271 5.9189
        5.3555 3.3955 5.9902 5.3974 3.7188 0.7588 5.5732 5.4111
    """),
)
SADR = Printed(
    name="Sadr",
    size=(469, 360),
    centroids=_numbers("-24.02893 58.39256 -64.56410 -55.32051 -80.65517 -124.93103").reshape(-1, 2),
    stars=(7796, 7763, 7736),
    centre_deg=None,
    paper={"pairs": 1086, "triads": 2, "groups": 2, "largest": 1, "centroids": 0.00004, "fixed": 0.0015},
    separations_deg=_numbers("2.3159 3.6805 1.3705"),
    fixed_deg=_numbers("2.3145 3.6797 1.3691"),
)

TABLES = Published("""
stars | 4.2 | stars to V 6.00, declination 30 to 90 | | 1266 | 26 | | {modern}
separations | 4.2 | separations up to 12 deg | | 33851 | 1400 | | {modern}; made in {spent:.2f} s and kept
angles | 4.2.5 | enclosed angles in the table | | 1175901 | 75000 | | three a triad; {modern};
  entries are made when asked for, the thesis' took 5 MB
off | {steps} | {n}: largest difference from the printed separations | deg | 0 | 6e-5 | |
  the centroids are printed to 5 decimals
pairs | {steps} | {n}: catalogue pairs within 0.15 deg | | | | | {modern}
triads | {steps} | {n}: triads that pass both tests | | | | | {modern}
groups | {steps} | {n}: groups | | | | | most are chance; {modern}
largest | {steps} | {n}: triads in the largest group | | | | | {modern}
right | 4.4, 4.9, 4.12 | {n}: stars named right | | | | more |
wrong | 4.4, 4.9, 4.12 | {n}: stars named wrong | | 0 | | less |
right in fixed | 4.2.4.3 | {n}: stars named right in fixed point | | | | more |
seconds | 4.20, 4.21 | {n}: time, floating point | s | | | less |
  the thesis on a 266 MHz Pentium II; the default knows the scale to a tenth only
seconds in fixed | 4.20, 4.21 | {n}: time, fixed point | s | | | less |
centre | 4.5, 4.10 | {n}: {axis} of the centre | deg | | 0.02 | |
  plate constants; the thesis' error is 0.02, nobody knows the truth
residual | 4.5, 4.10 | {n}: largest error of a star | deg | | 5e-4 | |
  six plate constants follow the scan's stretched pixels; the default's camera has square ones
centroids | 4.14-4.16 | {n}: centroids, fixed against floating | px | | 2e-5 | less |
  on a drawn frame: the scan is not published
fixed | 4.17-4.19 | {n}: separations, fixed against floating | deg | | 5e-4 | less |
same | 4.17-4.19 | {n}: printed fixed separations met to the last bit | | | | |
  reading: the field in 6.10 deg over the pixels is the scale, truncated at each step; the others met fewer
""")
STEP_TABLES = {"Vega": "4.1, 4.2", "Deneb": "4.6, 4.7", "Sadr": "4.11, 4.12"}
THESIS = {"dec_deg": (30.0, 90.0), "field_deg": FIELD_DEG, "planar": True}
TOLERANCES = (0.15, 5.0, 1.0)  # deg: separations, rotation angle, enclosed angle
MAXIMUM_DEG = 12.0
REPEATS = 5
MODERN = "a list of today has other stars near V 6.0"


@dataclass(frozen=True, slots=True)
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
    xy = np.array([(w - 1) / 2.0, (h - 1) / 2.0]) + printed.centroids * [1.0, -1.0]
    return Detections.from_list(xy, w, h)


def _pairs() -> Pairs:
    return catalogue_pairs(MAXIMUM_DEG, mag_limit=6.0, year=2000.0).within_declinations(30.0, 90.0)


def _catalogue_rows() -> list[dict[str, Any]]:
    """Section 4.2 and 4.2.5: what the catalogue gives, and the size of the tables."""
    pairs, spent = timed(_pairs)
    stars = len(np.unique(np.concatenate([pairs.first, pairs.second])))
    ones = np.ones(len(pairs), dtype=np.int64)
    up = csr_matrix((ones, (pairs.first, pairs.second)), shape=(pairs.stars, pairs.stars))
    triads = int((up @ up).multiply(up).sum())  # of stars whose three separations are in the table
    return [
        TABLES.row("stars", stars, modern=MODERN),
        TABLES.row("separations", len(pairs), modern=MODERN, spent=spent),
        TABLES.row("angles", 3 * triads, modern=MODERN),
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
    words: dict[str, Any] = {"n": printed.name, "steps": STEP_TABLES[printed.name], "modern": MODERN}
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
