"""“Lost in space” for robotic telescopes stage by stage: its fields, its camera, its detectors, its times.

Both methods are timed from the detections' pixels to the stars' names, in a loop of nothing else:
the least time of several counts. With fewer than six stars voting names none (figure 7.12) and the
product's refuses at once: the time its votes take is shown, but is no time to beat.
"""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from kochab.attitude import ESTIMATORS, wahba
from kochab.core.arrays import Floats
from kochab.core.camera import Camera
from kochab.core.frame import Detections, Frame
from kochab.core.progress import run
from kochab.core.solution import Solution
from kochab.detection import DETECTORS
from kochab.lab.bench import timed
from kochab.lab.bench.detectors import KINDS, compare, detect_all, make_frame, stars_of
from kochab.lab.bench.papers import Published, fastest, name_stars, options_with_scale, share_error
from kochab.lab.methods.confirmation import table_deg
from kochab.lab.methods.pairs import Pairs, bright_stars, catalogue_pairs, make_pairs
from kochab.lab.methods.voting import Voting, recognise, verification_votes
from kochab.simulate.random_fields import FieldPlan, RandomField, random_attitude, random_field
from kochab.sky import open_catalogue
from kochab.solver import SolveOptions
from kochab.solver.pipeline import solve_detections

TABLES = Published.of("robotic")

# -- Section 7.1: the four detectors ------------------------------------------------------------
# The thesis' thirty photographs are not published; the frames are those of :mod:`kochab.lab.bench.detectors`, in the
# same shares of plain, elongated and noisy ones. "True stars" are those visible to the eye: a signal-to-noise ratio
# of 100 gives the thesis' shares of perfect frames (with 50 it is 50 % where the thesis has 80, with 30 it is 30 %).
# A detection on a fainter star is not false.

FRAMES = 30
VISIBLE_SNR = 100.0


def detect_rows(quick: bool) -> list[dict[str, Any]]:
    """The four detectors' rows, and the seconds of table 7.3."""
    pictures = frames(1 if quick else None)
    DETECTORS.make("gaussian").detect(Frame(np.eye(64)))  # imports are not timed
    default, default_s = measured("auto", pictures)
    out = []
    for detector in ("gaussian", "peaks", "contours", "thesis"):
        ours, seconds = measured(detector, pictures)
        for one, its, measure in zip(ours, default, TABLES.printed["detectors"], strict=True):
            if (paper := measure["paper"].get(detector)) is not None:
                words = {"error": share_error(paper, len(pictures), FRAMES)} | measure | {"paper": paper}
                out.append(TABLES.row("detector", one, its, detector=detector, frames=len(pictures), **words))
    return [*out, TABLES.row("centroiding", seconds, default_s)]  # the thesis' own is the last


def frames(most: int | None) -> list[tuple[Frame, Floats, Floats]]:
    """Frames with the places (N, 2) px and signal-to-noise ratios (N,) of their stars."""
    out = []
    for one in KINDS:
        # without hot pixels, but for the one frame that is noisy in the thesis too
        kind = one if one.frames == 1 else replace(one, sky=replace(one.sky, hot_per_mp=0.0))
        count = kind.frames if most is None else min(most, kind.frames)
        for seed in range(1, count + 1):
            frame, xy = make_frame(kind, seed)
            out.append((frame, xy, stars_of(seed)[1]))
    return out


def measured(name: str, pictures: list[tuple[Frame, Floats, Floats]]) -> tuple[tuple[float, ...], float]:
    """The six measures of the thesis' detectors and the mean processor seconds a frame."""
    found, seconds = detect_all(DETECTORS.make(name), (frame for frame, _, _ in pictures))
    rates, errors = [], []
    for one, (_, xy, snr) in zip(found, pictures, strict=True):
        (_, predictive), off = compare(one, xy)
        visible = snr >= VISIBLE_SNR
        seen = np.isfinite(off[visible, 0])
        rates.append((float(seen.mean()) if len(seen) else 1.0, predictive))
        errors.append(off[visible & np.isfinite(off[:, 0])])
    tpr, ppv = np.array(rates).T
    ex, ey = np.concatenate(errors).mean(axis=0)
    perfect = 100.0 * float((tpr == 1.0).mean()), 100.0 * float((ppv == 1.0).mean())
    least = float(tpr.min()), float(ppv.min())
    return (*least, float(ex), float(ey), *perfect), seconds


# -- Section 6.1.1: the camera, from star frames alone ------------------------------------------
# The thesis calibrates with a checkerboard and leaves the distortion (equations 8.1 and 8.2) to
# future work, 10.2 "autonomous calibration". Here single star frames through a camera like its own
# are solved by the default method, and the camera that comes with the solution is compared with
# the true one. The errors are root mean squares; one frame is used at a time.

TRUE = Camera(1200, 630, 1322.0, 585.9, 305.2, k1=-0.12, k2=0.05, p1=6e-4, p2=-4e-4)
CAMERA_PAPER = {"focal_px": 4.3278, "cx": 6.5192, "cy": 4.9683}
NAMES = {"focal_px": "focal length", "cx": "principal point in x", "cy": "principal point in y"}  # px
NAMES |= {name: name for name in ("k1", "k2", "p1", "p2")}  # of no unit
CAMERA_STARS, NOISE_PX = 400, 0.2
CAMERA_FRAMES, QUICK = 12, 3


def camera_rows(quick: bool, seed: int) -> list[dict[str, Any]]:
    """The root mean square error of every term of the camera."""
    rng = np.random.default_rng(seed)
    found = [_solved(rng) for _ in range(QUICK if quick else CAMERA_FRAMES)]
    cameras = [camera for camera in found if camera is not None]
    solved = f"{len(cameras)} of {len(found)} frames solved, one at a time; {CAMERA_STARS} stars"
    out = []
    for key, what in NAMES.items():
        off = [getattr(camera, key) - getattr(TRUE, key) for camera in cameras]
        error = float(np.sqrt(np.mean(np.square(off)))) if off else float("nan")
        paper, unit = CAMERA_PAPER.get(key), "" if what == key else "px"
        true = f"true value {getattr(TRUE, key):g}; " if paper is None else ""
        out.append(TABLES.row("camera", error, what=what, true=true, solved=solved, unit=unit, paper=paper))
    worst = float(np.mean([_worst_px(camera) for camera in cameras])) if cameras else None
    return [*out, TABLES.row("corner", worst, solved=solved)]


def _solved(rng: np.random.Generator) -> Camera | None:
    """The camera found in one frame of a random place."""
    catalogue = open_catalogue()
    attitude = random_attitude(rng)
    rows = catalogue.brightest(attitude.boresight, float(np.radians(33.0)), 4 * CAMERA_STARS)
    xy = TRUE.project(catalogue.vectors(rows) @ attitude.matrix.T)
    size = np.array([TRUE.width, TRUE.height])
    inside = ((xy > -0.5) & (xy < size - 0.5)).all(axis=1)
    xy = xy[inside][:CAMERA_STARS]
    xy = xy + rng.normal(0.0, NOISE_PX, xy.shape)
    listed = Detections.from_list(np.clip(xy, 0.0, size - 1.0), TRUE.width, TRUE.height)
    answer = run(solve_detections(listed, SolveOptions(fov_deg=TRUE.fov_deg[0])))
    return answer.camera if isinstance(answer, Solution) else None


def _worst_px(camera: Camera) -> float:
    """The largest disagreement over the frame, after the rotation between the two is taken out."""
    x, y = np.meshgrid(np.linspace(0, TRUE.width - 1, 25), np.linspace(0, TRUE.height - 1, 15))
    grid = np.stack([x.ravel(), y.ravel()], axis=1)
    true, seen = TRUE.unproject(grid), camera.unproject(grid)
    turned = true @ wahba(seen, true).matrix.T
    return float(np.linalg.norm(camera.project(turned) - grid, axis=1).max())


# -- Fields like the photographs; :mod:`kochab.lab.bench.papers.robotic` explains the readings -----

WIDTH_DEG, SCALE = 15.0, 15.8  # arcsec a pixel, the middle one of table 7.1
MARGIN_PX, MAG_LIMIT = 2.464, 5.9
LENS_PX = 3.0  # at the corner
FLAWED = 0.05  # share of stars that are missing, and of false ones
STARS = (4, 5, 6, 8, 10, 15, 20, 30)
LENS_SHARE = 0.01  # the scale is known no better than the lens keeps it


def fields(
    count: int, seed: int, scale: float = SCALE, brightest: int = 15, lens_px: float = LENS_PX, flawed: float = FLAWED
) -> list[RandomField]:
    """Random fields of the plan above; the same ones for a seed, whatever is ``brightest``.

    Parameters
    ----------
    count : int
        How many.
    seed : int
        Draws them.
    scale : float
        Pixel scale, arcsec/px.
    brightest : int
        Stars of a list.
    lens_px : float
        The lens' shift of the corners.
    flawed : float
        The share of stars that are missing, and of false ones.
    """
    rng, catalogue = np.random.default_rng(seed), open_catalogue()
    size, half = round(WIDTH_DEG * 3600.0 / scale), float(np.tan(np.radians(WIDTH_DEG / 2.0)))
    plan = FieldPlan(
        WIDTH_DEG,
        size,
        noise_px=0.32,
        missing=flawed,
        spurious=flawed,
        magnitude_scatter=0.2,
        brightest=max(STARS),
        k1=lens_px / (size / 2.0 / half) / (np.sqrt(2.0) * half) ** 3,
    )
    made = [random_field(catalogue, rng, plan) for _ in range(count)]
    return [replace(f, detections=f.detections.take(slice(0, brightest))) for f in made]


def plain(field: RandomField) -> Camera:
    """The camera as the thesis knows it: no distortion."""
    c = field.camera
    return Camera.centred(c.width, c.height, c.focal_px, c.mirrored)


def pairs_of(field: RandomField) -> Pairs:
    """The thesis' table of pairs as wide as the field."""
    angle = table_deg(field.detections, field.camera.focal_px)
    return catalogue_pairs(angle, mag_limit=MAG_LIMIT)


def options(field: RandomField) -> SolveOptions:
    """The default's, with the scale that voting knows."""
    return options_with_scale(field.camera.scale_arcsec_px, LENS_SHARE)


# -- Times of every stage: table 7.3 and figure 7.18 --------------------------------------------

WHOLE_S = 18.15  # its whole program


def times_rows(count: int, seed: int) -> list[dict[str, Any]]:
    """The times of the thesis, ours, and the default's on the same fields."""
    return [_row(stars, fields(count, seed, brightest=stars)) for stars in STARS] + _stages(fields(count, seed))


def _row(stars: int, made: list[RandomField]) -> dict[str, Any]:
    times = 1e3 * np.array(
        [(fastest(partial(_vote, f)), fastest(partial(name_stars, f.detections, options(f)))) for f in made]
    )
    ours, theirs = np.median(times, axis=0).tolist()
    ahead = times[:, 1] - times[:, 0]
    named = stars >= Voting.fewest
    return TABLES.row(
        "matching",
        ours,
        theirs,
        stars=stars,
        paper=1e3 * WHOLE_S if stars == 15 else None,
        paired=(float(ahead.mean()), float(ahead.std(ddof=1)) / len(made) ** 0.5),
        better="less" if named else "",
        note="the thesis: its whole program" if named else "voting names no star of so few",
    )


def _vote(field: RandomField) -> tuple[Any, ...]:
    body = plain(field).unproject(field.detections.xy)
    return recognise(body, pairs_of(field), MARGIN_PX / field.camera.focal_px)


def _stages(made: list[RandomField]) -> list[dict[str, Any]]:
    """Table 7.3, but for centroiding and for showing the picture."""
    first = made[0]
    camera, angle = plain(first), table_deg(first.detections, first.camera.focal_px)
    stars = bright_stars(None, MAG_LIMIT, 2016.0)
    _, tables = timed(lambda: make_pairs(*stars, float(np.radians(angle))))
    voting = float(np.median([fastest(partial(_vote, field)) for field in made]))
    kept, star, _ = _vote(first)
    xy, vectors = first.detections.xy[kept], pairs_of(first).vectors[star]
    body, valid = camera.unproject(xy), np.ones(len(kept), dtype=np.bool_)
    error, triad = MARGIN_PX / camera.focal_px, ESTIMATORS.make("triad")
    verifying = fastest(lambda: verification_votes(body, vectors, valid, error))
    pointing = fastest(lambda: triad.estimate(xy, vectors, camera))
    solves = [partial(run, solve_detections(field.detections, options(field))) for field in made]
    default = float(np.median([timed(solve)[1] for solve in solves]))
    return [
        TABLES.row("voting", voting),
        TABLES.row("verification", verifying),
        TABLES.row("attitude", pointing),
        TABLES.row("table", tables),
        TABLES.row("all", voting + tables + pointing, default),
    ]
