"""The tables of the 1992 paper: Initial Estimate, Predictional Estimate, database and averages.

Liebe, "Pattern recognition of star constellations for spacecraft applications", IEEE Aerosp.
Electron. Syst. Mag. 7(6), 34: figures 2 and 18, tables 2, 3 and 4. The default method solves the very same pictures.

Readings. The paper gives the worst error of a star's place, 3 arcmin, but not how errors lie within it: with three
sigma of a normal law there, and the accuracy of an estimate taken as the RMS of its two coordinates, averaged over
the pictures, its 14.6 arcsec come out. Rows tell what the other readings give: the RMS over all pictures, and
errors spread evenly over the circle. A star "outside the limits" is off by one to two times the worst error here;
the paper does not say. In table 3 both know scale and lens, and that no star is off by more than 3 arcmin.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any, Literal

import numpy as np
from scipy.spatial import cKDTree

from kochab.core.arrays import Bools, Floats
from kochab.core.attitude import ARCSEC, Attitude, cross_product, small_rotation, unit
from kochab.core.camera import Camera
from kochab.core.frame import Detections
from kochab.core.progress import run
from kochab.core.solution import Identification, NoSolution, Solution
from kochab.core.values import frozen
from kochab.identification.predictional_estimate import Estimate, predictional_estimate
from kochab.lab.bench import Row, column, timed
from kochab.lab.bench.papers import Published, options_with_scale, share_error
from kochab.lab.estimators import average
from kochab.lab.methods.neighbours import Neighbours
from kochab.simulate.random_fields import RandomField, random_attitude
from kochab.sky import open_catalogue
from kochab.solver import SolveOptions
from kochab.solver.pipeline import solve_detections

# -- Pictures as the camera of the paper takes them, right or with one of its errors ------------
# An opening angle of 30 deg, the 1,107 brightest stars, brightnesses uncertain by 25 %, places by 3 arcmin at worst.
# What the paper leaves open is an argument here: how errors are distributed up to the worst, how far out a star
# "outside the tolerance" is.

ErrorLaw = Literal["normal", "disc"]

TABLES = Published.of("constellations_1992")
HALF_DEG = 15.0
BRIGHTEST = 1107
SPREAD = 0.25
WORST_ARCMIN = 3.0
PIXELS = 576
BLEND_DEG = 0.1  # twice 3 arcmin: two such stars leave one image of 3 arcmin pixels


@frozen
class CameraError:
    """One row of the paper's tables 2 and 3, with the paper's own figures for it."""

    name: str
    paper_percent: float
    paper_arcsec: float
    false: int = 0
    outside: int = 0
    missing: int = 0


SITUATIONS = tuple(CameraError(**printed) for printed in TABLES.printed["situations"])


@frozen(eq=False)
class _CatalogueSky:
    vectors: Floats
    mag: Floats
    faintest: float


@lru_cache(maxsize=1)
def sky() -> _CatalogueSky:
    """Stars a camera with this limit may show, without the fainter ones of blended pairs."""
    catalogue, pole = open_catalogue(), np.array([0.0, 0.0, 1.0])
    faintest = float(catalogue.mag(catalogue.brightest(pole, np.pi, BRIGHTEST))[-1])
    rows = catalogue.cone(pole, np.pi, faintest - 2.5 * float(np.log10(1.0 - SPREAD)))
    vectors = catalogue.vectors(rows)
    close = cKDTree(vectors).query_pairs(2.0 * np.sin(np.radians(BLEND_DEG) / 2.0))
    alone = np.setdiff1d(np.arange(len(rows)), [max(pair) for pair in close])
    return _CatalogueSky(vectors[alone], catalogue.mag(rows[alone]), faintest)


def camera() -> Camera:
    """The paper's camera: 576 pixels across its 30 deg circle, 3.1 arcmin each."""
    return Camera.centred(PIXELS, PIXELS, float(PIXELS / 2.0 / np.tan(np.radians(HALF_DEG))))


def picture(
    rng: np.random.Generator, situation: CameraError, law: ErrorLaw = "normal", attitude: Attitude | None = None
) -> RandomField:
    """One picture.

    A star outside the limits is off by one to two times the worst error.

    Parameters
    ----------
    rng : np.random.Generator
        Draws it.
    situation : CameraError
        How many stars are missing, and how many are outside the limits.
    law : ErrorLaw
        "normal" has the worst error at three sigma a coordinate, "disc" spreads it evenly over a circle.
    attitude : Attitude or None
        Where the camera points; None: a random direction.
    """
    lens, bright = camera(), sky()
    attitude = attitude or random_attitude(rng)
    body = bright.vectors @ attitude.matrix.T
    seen_mag = bright.mag - 2.5 * np.log10(1.0 + rng.uniform(-SPREAD, SPREAD, len(bright.mag)))
    inside = np.flatnonzero((body[:, 2] > np.cos(np.radians(HALF_DEG))) & (seen_mag <= bright.faintest))
    inside = rng.permutation(inside)[situation.missing :]
    worst = np.radians(WORST_ARCMIN / 60.0)
    if law == "disc":
        off = _disc(rng, len(inside)) * worst
    else:
        off = rng.normal(0.0, worst / 3.0, (len(inside), 2))
        off *= np.minimum(1.0, worst / np.maximum(np.hypot(*off.T), 1e-12))[:, None]
    for k in range(min(situation.outside, len(inside))):
        turn, far = rng.uniform(0, 2 * np.pi), worst * rng.uniform(1.0, 2.0)
        off[k] = far * np.array([np.cos(turn), np.sin(turn)])
    # moved across themselves by small angles
    east = unit(cross_product([0.0, 1.0, 0.0], body[inside]))
    xy = lens.project(body[inside] + off[:, :1] * east + off[:, 1:] * cross_product(body[inside], east))
    false = _disc(rng, situation.false) * PIXELS / 2.0 + (PIXELS - 1) / 2.0
    xy = np.concatenate([xy, false])
    mag = np.concatenate([seen_mag[inside], rng.choice(bright.mag, len(false))])
    detections = Detections.from_list(xy, PIXELS, PIXELS, 10.0 ** (-0.4 * mag))
    return RandomField(detections, lens, attitude, len(inside))


def repeated(rng: np.random.Generator, count: int) -> Iterator[RandomField]:
    """Pictures of one field, each with errors of its own."""
    attitude = random_attitude(rng)
    for _ in range(count):
        yield picture(rng, SITUATIONS[0], attitude=attitude)


def _disc(rng: np.random.Generator, count: int) -> Floats:
    """Points (N, 2) spread evenly over the unit circle."""
    turn, radius = rng.uniform(0, 2 * np.pi, count), np.sqrt(rng.uniform(0, 1, count))
    return np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)


# -- The two estimates and the default on them ----------------------------------------------------

PAPER_RUNS = 500
RIGHT_DEG = 0.5
COARSE_DEG = 0.1  # the mean error of the attitude a Predictional Estimate begins with (table 4)


def judged(one: RandomField, work: Callable[[RandomField], Floats | None]) -> Row:
    """What ``work``, which finds the camera's axis (3,) in ICRS, makes of a picture.

    ``off`` is the RMS of the axis' two coordinates, arcsec, NaN for no answer.
    """
    axis, seconds = timed(lambda: work(one))
    off = np.full(2, np.nan) if axis is None else _off_arcsec(one, axis)
    right = bool(np.hypot(*off) < 3600.0 * RIGHT_DEG)
    row = {"right": right, "wrong": axis is not None and not right, "stars": one.stars, "ms": 1e3 * seconds}
    return row | {"off": float(np.sqrt(np.mean(np.square(off))))}


def share(answers: Sequence[Row], kind: str) -> float:
    """Per cent of the pictures answered right, or answered wrong."""
    return 100.0 * float(column(answers, kind).mean())


def accuracy(answers: Sequence[Row], both: Sequence[Row] | None = None, power: float = 1.0) -> float:
    """The mean error of the answers that ``both`` gave right; ``power`` 2 gives the RMS over them."""
    used = column(answers, "off")[_right(answers, both or answers)]
    return float(np.mean(used**power) ** (1.0 / power)) if len(used) else float("nan")


def ahead(answers: Sequence[Row], others: Sequence[Row]) -> tuple[float, float]:
    """Mean of the errors minus the others', picture by picture, and that mean's own error."""
    gap = (column(answers, "off") - column(others, "off"))[_right(answers, others)]
    if len(gap) < 2:
        return float("nan"), float("nan")
    return float(gap.mean()), float(gap.std(ddof=1) / np.sqrt(len(gap)))


def _right(one: Sequence[Row], other: Sequence[Row]) -> Bools:
    return np.asarray((column(one, "right") * column(other, "right")) > 0.0)


def _off_arcsec(one: RandomField, axis: Floats) -> Floats:
    """How far (2,) an axis is off along the camera's x and y, arcsec."""
    x, y, z = one.attitude.matrix @ axis
    return np.array([x, y]) / max(float(z), 1e-3) / ARCSEC


def rows(quick: bool, seed: int) -> list[dict[str, Any]]:
    """Every row: the paper's figure, ours, and the default method's on the same pictures."""
    count = 50 if quick else PAPER_RUNS
    out = _database_rows()
    cases: dict[CameraError, _Case] = {}
    for number, situation in enumerate(SITUATIONS):
        rng = np.random.default_rng([seed, 1992, number])
        cases[situation] = case = _answers(situation, count, rng)
        ours, theirs, paper = share(case["first"], "right"), share(case["default"], "right"), situation.paper_percent
        error = share_error(paper, count, PAPER_RUNS)
        out.append(TABLES.row("right", ours, theirs, situation=situation.name, paper=paper, error=error))
    out += _wrong_and_time_rows(list(cases.values()))
    out += [_accuracy_row(situation, case, count) for situation, case in cases.items()]
    plain = cases[SITUATIONS[0]]
    out.append(TABLES.row("pooled", *(accuracy(plain[name], power=2.0) for name in ("second", "knowing"))))
    rng = np.random.default_rng([seed, 1992, 99])
    even = [judged(picture(rng, SITUATIONS[0], "disc"), lambda one: predicted_axis(one, rng)) for _ in range(count)]
    out.append(TABLES.row("disc", accuracy(even)))
    return out + _average_rows(seed, 10 if quick else 100)


_Case = dict[str, list[Row]]
"""What the ``first`` (Initial) and ``second`` (Predictional) Estimate and the ``default`` make of one situation.

``knowing`` is the default that knows its camera as the Predictional Estimate does.
"""


def _answers(situation: CameraError, count: int, rng: np.random.Generator) -> _Case:
    methods: dict[str, Callable[[RandomField], Floats | None]] = {
        "first": initial_axis,
        "second": lambda one: predicted_axis(one, rng),
        "default": default_axis,
        "knowing": knowing_axis,
    }
    case: _Case = {name: [] for name in methods}
    for _ in range(count):
        one = picture(rng, situation)
        for name, method in methods.items():
            case[name].append(judged(one, method))
    return case


def initial_axis(one: RandomField) -> Floats | None:
    """The axis by the Initial Estimate."""
    found = run(Neighbours(circle=True).identify(one.detections, _scale_known().hint))
    return found.attitude.boresight if isinstance(found, Identification) else None


def predicted_axis(one: RandomField, rng: np.random.Generator) -> Floats | None:
    """The axis by the Predictional Estimate, from a prediction as coarse as the paper's."""
    coarse = small_rotation(rng.normal(0.0, np.radians(COARSE_DEG) / 1.25, 3))
    found = _estimated(one, coarse @ one.attitude.matrix, _near(one), 8.0, _worst_px(one))
    return None if found is None else found.attitude.boresight


def _estimated(one: RandomField, predicted: Floats, near: Floats, reach_px: float, worst_px: float) -> Estimate | None:
    """The Predictional Estimate from an attitude (3, 3), when no star is off by more than ``worst_px``."""
    seen = one.camera, predicted, one.detections.xy
    return predictional_estimate(*seen, near, reach_px, closest_px=worst_px, worst_px=worst_px)


def _worst_px(one: RandomField) -> float:
    return float(np.radians(WORST_ARCMIN / 60.0)) * one.camera.focal_px


def default_axis(one: RandomField) -> Floats | None:
    """The axis as the default method solves the same list of stars."""
    return _solved_axis(one, _scale_known())


def knowing_axis(one: RandomField) -> Floats | None:
    """The same by the default with what the Predictional Estimate knows of its camera.

    That is its scale, that it does not distort, and how far off a star may be at worst.
    """
    known = replace(options_with_scale(camera().scale_arcsec_px), distortion=False, worst_px=_worst_px(one))
    return _solved_axis(one, known)


def _solved_axis(one: RandomField, options: SolveOptions) -> Floats | None:
    found: Solution | NoSolution = run(solve_detections(one.detections, options))
    return found.centre_vector if isinstance(found, Solution) else None


def _near(one: RandomField) -> Floats:
    """The expected constellation: unit vectors (N, 3) of the stars in and around the picture."""
    vectors = sky().vectors
    near = vectors @ one.attitude.boresight > np.cos(np.radians(HALF_DEG + 1.0))
    return np.asarray(vectors[near])


def _scale_known() -> SolveOptions:
    return options_with_scale(camera().scale_arcsec_px, 0.05)


def _database_rows() -> list[dict[str, Any]]:
    table, doubled = Neighbours().table(), Neighbours(angle_errors=2.0).table()
    merged = Neighbours(double_deg=0.0, exchange=0.0).table()
    note = (
        f"{len(table.rows)} stars (paper 1539); angle's error as in figure 11: {len(doubled)};"
        f" without doubles and exchange: {len(merged)}; {12e-6 * len(table):.1f} MB"  # 12 bytes an entry
    )
    return [TABLES.row("entries", len(table), note=note), TABLES.row("per star", len(table) / len(table.rows))]


def _wrong_and_time_rows(cases: Sequence[_Case]) -> list[dict[str, Any]]:
    def mean(name: str, of: Callable[[list[Row]], float]) -> float:
        return float(np.mean([of(case[name]) for case in cases]))

    wrong = [mean(name, lambda answers: share(answers, "wrong")) for name in ("first", "default")]
    first_ms, second_ms, default_ms = (
        mean(n, lambda answers: column(answers, "ms").mean()) for n in ("first", "second", "default")
    )
    axis_deg = [mean(name, accuracy) / 3600.0 for name in ("first", "default")]
    return [
        TABLES.row("stars", float(column(cases[0]["first"], "stars").mean())),
        TABLES.row("wrong", *wrong, better="less" if max(wrong) > 0 else ""),
        TABLES.row("first time", first_ms, default_ms),
        TABLES.row("first axis", *axis_deg),
        TABLES.row("second time", second_ms),
    ]


def _accuracy_row(situation: CameraError, case: _Case, count: int) -> dict[str, Any]:
    second, knowing, paper = case["second"], case["knowing"], situation.paper_arcsec
    return TABLES.row(
        "axis",
        accuracy(second, knowing),
        accuracy(knowing, second),
        situation=situation.name,
        second=share(second, "right"),
        knowing=share(knowing, "right"),
        paper=paper,
        paired=ahead(knowing, second),
        error=2.0 * paper / np.sqrt(2.0 * min(count, PAPER_RUNS)),
    )


def _average_rows(seed: int, trials: int) -> list[dict[str, Any]]:
    """Averages of N estimates of one field; what is left against sigma over the root of N."""
    out = []
    for frames, paper in ((60, 2.0), (225, 1.0)):
        left, promised = averaged(seed, frames, trials)
        error = 2.0 * paper / np.sqrt(4.0 * trials)
        out.append(TABLES.row("averages", left, frames=frames, promised=promised, paper=paper, error=error))
    return out


def averaged(seed: int, frames: int, trials: int) -> tuple[float, float]:
    """Accuracy of averages of ``frames`` estimates, arcsec, and the sigma they promise."""
    rng = np.random.default_rng([seed, 1992, frames])
    left, promised = [], []
    for _ in range(trials):
        pictures = list(repeated(rng, frames))
        near, first = _near(pictures[0]), pictures[0]
        found = [_estimated(one, one.attitude.matrix, near, 2.0, 1.0) for one in pictures]
        mean = average(estimate.attitude for estimate in found if estimate is not None)
        left.append(_off_arcsec(first, mean.boresight))
        promised.append(mean.sigma_arcsec[:2])
    each = np.sqrt(np.mean(np.square(left), axis=1))
    return float(each.mean()), float(np.sqrt(np.mean(np.square(promised))))
