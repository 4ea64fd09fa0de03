"""Every way to a verdict on lists and pictures that are no star field, and on fields that are not one alone.

Shapes (:mod:`kochab.lab.bench.identify_shapes`) hold no field: any solution is wrong. Double exposures,
ghosts and stretched images hold true fields: a solution of any of these is right. True fields told a wrong
scale hold nothing but likenesses of other fields. The number of lists follows ``KOCHAB_BENCH_LISTS``, 100,000 of
them take a night.
"""

import math
import os
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import radec_deg
from kochab.core.camera import Camera
from kochab.core.frame import Detections, Hint
from kochab.core.progress import run as drive
from kochab.core.solution import NoSolution, Solution
from kochab.detection.windows import WindowStars
from kochab.identification.verification import ACCEPT_LOG10
from kochab.lab.bench import Goal, Report, Row, column, summary, timed
from kochab.lab.bench.identify_shapes import SEED, SHAPES, SIZE_PX, log_uniform, shape_list
from kochab.simulate.random_fields import FieldPlan, RandomField, random_attitude, random_direction, random_field
from kochab.simulate.star_images import RenderedStar, Sky, render
from kochab.sky import open_catalogue
from kochab.solver import SolveOptions
from kochab.solver.pipeline import solve_detections, solve_frame
from kochab.solver.track_prediction import Neighbourhood
from kochab.solver.track_windows import match

LISTS, QUICK_LISTS = 10_000, 120
FIELDS_DEG = (0.8, 40.0)
LEVELS = (2, 3, 4)
LEAST_CHANCE = 1e-3
"""A bound that is broken with a smaller probability, were it right, is wrong."""

# -- The ways, each with the share of the lists it gets: the slow ones get few ------------------

Answer = Solution | NoSolution
Way = Callable[[Detections, np.random.Generator], float | Answer]
"""What it says of one list; a number is the claim, log10, of what has no solution's form."""


def _given(factor: float | None, place: bool, method: str) -> Way:
    """The solver told a random scale good to ``factor`` and perhaps a random place."""

    def solve(points: Detections, rng: np.random.Generator) -> Answer:
        field_deg, hint = log_uniform(rng, *FIELDS_DEG), None
        centre = (*radec_deg(random_direction(rng)), 5.0)
        if factor is not None:
            scale = 3600.0 * field_deg / SIZE_PX
            hint = Hint(scale_arcsec_px=(scale / factor, scale * factor), centre_deg=centre if place else None)
        return drive(solve_detections(points, SolveOptions(method=method, hint=hint, blind_after_hint=False)))

    return solve


def _picture(points: Detections, rng: np.random.Generator) -> Answer:
    """The points drawn as stars or as the rings of a lens out of focus, detected and solved blind."""
    star = RenderedStar(3.0, ring_px=(4.0, 8.0)) if rng.random() < 0.3 else RenderedStar(3.0)
    flux = 3000.0 * points.flux / float(np.median(points.flux))
    frame = render(SIZE_PX, SIZE_PX, points.xy, np.minimum(flux, 3e6), star, Sky(), seed=int(rng.integers(2**31)))
    return drive(solve_frame(frame, SolveOptions()))


def _tracking(points: Detections, rng: np.random.Generator) -> float:
    """The claim of a tracker that looks for a random field's stars; 0 without one."""
    half = int(rng.choice([8, 16, 32, 64]))
    focal = SIZE_PX / 2.0 / math.tan(math.radians(log_uniform(rng, *FIELDS_DEG)) / 2.0)
    camera, attitude = Camera.centred(SIZE_PX, SIZE_PX, focal, bool(rng.integers(2))), random_attitude(rng)
    sky = Neighbourhood(open_catalogue(), camera, attitude, 2016.0, 11.0, 8.0)
    expected = sky.expected(camera, attitude.matrix, 40, 4.0)
    if len(expected.number) == 0 or len(points) == 0:
        return 0.0
    near = np.asarray((np.abs(points.xy - expected.xy[:, None]) <= half).all(axis=2))
    found, brightest = np.asarray(near.any(axis=1)), near.argmax(axis=1)  # the list is in order of brightness
    _, first = np.unique(brightest, return_index=True)
    found &= np.isin(np.arange(len(found)), first)  # one star is one witness
    count = len(found)
    seen = WindowStars(points.xy[brightest], np.full(count, 0.2), np.full(count, 50.0), found, np.full(3, np.nan))
    tracked = match(camera, attitude.matrix, sky.vectors[expected.number], expected.xy, seen, half, float(half))
    return 0.0 if tracked is None else tracked.log10_false_alarm


WAYS: Mapping[str, tuple[Way, float]] = {
    "blind": (_given(None, False, "patterns"), 0.2),
    "scale to 10 %": (_given(1.1, False, "patterns"), 1.0),
    "scale to 2 %": (_given(1.02, False, "patterns"), 1.0),
    "scale to 10 %, place to 5 deg": (_given(1.1, True, "patterns"), 1.0),
    "picture": (_picture, 0.1),
    "tracking": (_tracking, 2.0),
    "angles": (_given(1.02, False, "angles"), 0.5),
    "neighbours": (_given(1.02, False, "neighbours"), 0.5),
    "spherical_triangles": (_given(1.02, False, "spherical_triangles"), 0.5),
    "voting": (_given(1.02, False, "voting"), 0.5),
    "triads": (_given(1.02, False, "triads"), 0.04),
    "predict": (_given(1.1, True, "predict"), 0.04),
}

# -- True fields that are not one alone, or not of square pixels ---------------------------------

Truth = tuple[RandomField, Floats, Floats]
"""A field, and the linear map (2, 2) and shift (2,) px about the middle that its stars went through."""
AS_IT_IS = np.eye(2), np.zeros(2)


def double_exposure(rng: np.random.Generator) -> tuple[Detections, list[Truth]]:
    """Two fields of one camera over one another."""
    plan = _plan(rng)
    return _merged([(random_field(open_catalogue(), rng, plan), *AS_IT_IS) for _ in range(2)], rng)


def ghost(rng: np.random.Generator) -> tuple[Detections, list[Truth]]:
    """A field and its own copy: turned, shifted, stretched, perhaps upside down."""
    field, turn = random_field(open_catalogue(), rng, _plan(rng)), rng.normal(0.0, 0.05)
    turned = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    copy = _stretch(rng, 0.1) @ turned * rng.choice([1.0, 1.0, -1.0])
    return _merged([(field, *AS_IT_IS), (field, copy, rng.uniform(-80.0, 80.0, 2))], rng)


def stretched(rng: np.random.Generator) -> tuple[Detections, list[Truth]]:
    """A field drawn out by up to a seventh along any direction."""
    field, shape = random_field(open_catalogue(), rng, _plan(rng)), _stretch(rng, 0.15)
    return _merged([(field, shape, np.zeros(2))], rng)


FIELDS = {"double exposure": double_exposure, "ghost": ghost, "stretched field": stretched}
WRONG_PX = 10.0
"""Of an answer's places, in the median over the frame; the stars of a stretched field move by as much."""


def _plan(rng: np.random.Generator) -> FieldPlan:
    brightest, field_deg = round(log_uniform(rng, 12.0, 150.0)), log_uniform(rng, *FIELDS_DEG)
    missing, spurious = rng.uniform(0.0, 0.4, 2)
    return FieldPlan(field_deg, SIZE_PX, missing=missing, spurious=spurious, brightest=brightest)


def _stretch(rng: np.random.Generator, most: float) -> Floats:
    along, by = rng.uniform(0.0, np.pi), math.exp(rng.uniform(-most, most))
    axes = np.array([[math.cos(along), -math.sin(along)], [math.sin(along), math.cos(along)]])
    return np.asarray(axes @ np.diag([by, 1.0 / by]) @ axes.T)


def _merged(truths: list[Truth], rng: np.random.Generator) -> tuple[Detections, list[Truth]]:
    middle, places, flux = SIZE_PX / 2.0, [], []
    for field, linear, shift in truths:
        stars = field.detections
        places.append((stars.xy - middle) @ linear.T + shift + middle)
        flux.append(stars.flux * 10.0 ** rng.uniform(-1.0, 0.0) / float(np.median(stars.flux)))
    xy, light = np.concatenate(places), np.concatenate(flux)
    inside = ((xy > 0.0) & (xy < SIZE_PX - 1.0)).all(axis=1)
    return Detections.from_list(xy[inside], SIZE_PX, SIZE_PX, light[inside]), truths


def off_px(answer: Solution, truth: Truth) -> float:
    """Median distance over the frame between where an answer and the truth put the sky."""
    field, linear, shift = truth
    steps = np.linspace(0.1, 0.9, 5) * SIZE_PX
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    seen = answer.pixels_of(field.camera.unproject(grid) @ field.attitude.matrix)
    there = (grid - SIZE_PX / 2.0) @ linear.T + shift + SIZE_PX / 2.0
    away = np.nan_to_num(np.hypot(*(seen - there).T), nan=math.inf)
    return float(np.median(away))


# -- Rows and goals ------------------------------------------------------------------------------


def hostile_rows(quick: bool, report: Report) -> list[dict[str, Any]]:
    """A row for every shape and way, and for every kind of field, of so many lists in all."""
    lists = QUICK_LISTS if quick else int(os.environ.get("KOCHAB_BENCH_LISTS", LISTS))
    per = lists / (len(SHAPES) * sum(share for _, share in WAYS.values()) + 3.0 * len(FIELDS))
    rows = []
    for name in SHAPES:
        report(f"{name}: lists without truth ...")
        rows += [_shape_row(name, way, max(1, round(share * per))) for way, (_, share) in WAYS.items()]
    rows.append(
        _claims_row("true fields", "wrong scale told", [likeness_answer(k) for k in range(round(10 * per) + 2)])
    )
    return rows + [_field_row(name, max(2, round(3.0 * per))) for name in FIELDS]


def shape_answer(name: str, way: str, number: int) -> Row:
    """What a way makes of the list of that shape and number, the same every time."""
    seed = SEED + list(SHAPES).index(name)
    rng = np.random.default_rng([seed, list(WAYS).index(way), number])
    return _claimed(partial(WAYS[way][0], shape_list(SHAPES[name], seed, number), rng))


def likeness_answer(number: int) -> Row:
    """The same for a true field of that number told a scale that is off by 1.3 to 4: any solution is wrong."""
    rng = np.random.default_rng([SEED, len(SHAPES), number])
    field, factor = (
        random_field(open_catalogue(), rng, _plan(rng)),
        log_uniform(rng, 1.3, 4.0) ** rng.choice([-1.0, 1.0]),
    )
    scale, good_to = field.camera.scale_arcsec_px * factor, rng.choice([1.01, 1.03, 1.1])
    options = SolveOptions(hint=Hint(scale_arcsec_px=(scale / good_to, scale * good_to)), blind_after_hint=False)
    return _claimed(lambda: drive(solve_detections(field.detections, options)))


def _claimed(solve: Callable[[], float | Answer]) -> Row:
    """A row of what is wrong if it is accepted, with what it claims."""
    answer, seconds = timed(solve)
    if isinstance(answer, float):
        wrong, claim = answer <= ACCEPT_LOG10, answer
    elif isinstance(answer, Solution):
        wrong, claim = True, answer.log10_false_alarm
    else:
        wrong, claim = False, answer.measured.get("log10_false_alarm", 0.0)
    return {"right": math.nan, "wrong": wrong, "ms": 1e3 * seconds, "claim": claim}


def _shape_row(name: str, way: str, count: int) -> dict[str, Any]:
    return _claims_row(name, way, [shape_answer(name, way, number) for number in range(count)])


def _claims_row(name: str, mode: str, answers: Sequence[Row]) -> dict[str, Any]:
    claims = column(answers, "claim")
    below = {f"below_1e-{k}": int((claims < -k).sum()) for k in LEVELS}
    return answers_row(name, mode, answers) | below | {"least_log10": claims.min()}


def _field_row(name: str, count: int) -> dict[str, Any]:
    answers = []
    for number in range(count):
        detections, truths = FIELDS[name](np.random.default_rng([SEED, list(FIELDS).index(name), number]))
        answer, seconds = timed(partial(drive, solve_detections(detections)))
        near, solved = False, isinstance(answer, Solution)
        if isinstance(answer, Solution):
            maps = truths + [(field, *AS_IT_IS) for field, _, _ in truths]
            near = min(off_px(answer, truth) for truth in maps) < WRONG_PX
        answers.append({"right": near, "wrong": solved and not near, "ms": 1e3 * seconds})
    return answers_row(name, "blind", answers)


def answers_row(fields: str, mode: str, answers: Sequence[Row]) -> dict[str, Any]:
    """One line of the table: which share of the answers is right, how many are wrong, and how long they took."""
    counts = summary(answers, n=("ms", len), success=("right", np.mean), wrong=("wrong", np.sum))
    times = summary(answers, median_ms=("ms", np.median), p99_ms=("ms", partial(np.percentile, q=99)))
    return {"fields": fields, "mode": mode} | counts | times


def hostile_goals(rows: Sequence[Row]) -> list[Goal]:
    """No wrong answer, and no level of the claim reached oftener than it promises."""
    shapes = [r for r in rows if "least_log10" in r]
    judged = [r for r in shapes if r["mode"] == "blind" or "scale" in r["mode"]]
    lists = sum(r["n"] for r in judged)
    chances = [chance_of_so_many(sum(r[f"below_1e-{k}"] for r in judged), lists * 10.0**-k) for k in LEVELS]
    wrong = sum(r["wrong"] for r in shapes)
    return [
        Goal.at_most(f"wrong answers, {sum(r['n'] for r in shapes)} lists without truth", wrong, 0),
        Goal.at_most("wrong answers, doubled and stretched fields", sum(r["wrong"] for r in rows) - wrong, 0),
        Goal.at_least("chance of so many claims at 1e-2 to 1e-4, were the bound right", min(chances), LEAST_CHANCE),
        Goal.at_most("largest claim of a refused list, log10", -min(r["least_log10"] for r in shapes), -ACCEPT_LOG10),
    ]


def chance_of_so_many(count: int, promised: float) -> float:
    """The probability of ``count`` or more where ``promised`` are expected."""
    from scipy.special import gammainc

    return float(gammainc(count, promised)) if count else 1.0
