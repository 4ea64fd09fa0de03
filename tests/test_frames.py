"""Every real photograph: solved blind to within its tolerance, or refused with a reason."""

import json
import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from kochab.core.attitude import unit_vectors
from kochab.core.frame import Hint
from kochab.core.progress import run
from kochab.core.solution import NoSolution, Reason, Solution
from kochab.sky import open_catalogue
from kochab.solver import SolveOptions
from kochab.workflows.solve_frame import SolvedFrame, solve_file

FOLDER = Path(__file__).resolve().parents[2] / "shared" / "frames"
BLIND = SolveOptions(use_header=False, timeout_s=None)

TRUTH = json.loads((FOLDER / "truth.json").read_text())["frames"] if FOLDER.is_dir() else {}
SOLVABLE = sorted(name for name, truth in TRUTH.items() if truth.get("solvable", True))
HOPELESS = sorted(set(TRUTH) - set(SOLVABLE))

pytestmark = [
    pytest.mark.skipif(not TRUTH, reason="the real frames (../shared/frames) are not beside this checkout"),
    pytest.mark.timeout(900),  # the first frame waits for the patterns of small fields
]


@cache
def solved(name: str, options: SolveOptions = BLIND) -> SolvedFrame:
    return run(solve_file(FOLDER / name, options))


def apart_deg(a: np.ndarray, b: np.ndarray) -> float:
    return math.degrees(2 * math.asin(min(1.0, float(np.linalg.norm(a - b)) / 2)))


def check_against_truth(result: Solution, truth: dict) -> None:
    centre = unit_vectors(truth["ra_deg"], truth["dec_deg"])
    assert apart_deg(result.centre_vector, centre) < truth["tol_deg"]
    turn = (result.roll_deg - truth["roll_deg"] + 180) % 360 - 180
    assert abs(turn) < truth["roll_tol_deg"]
    assert result.camera.mirrored is truth["mirrored"]
    assert result.camera.fov_deg[0] == pytest.approx(truth["fov_deg"][0], rel=0.03)
    assert result.log10_false_alarm < -5


@pytest.mark.parametrize("name", SOLVABLE)
def test_solved_blind(name: str) -> None:
    result = solved(name).result
    assert isinstance(result, Solution), f"{result.reason}: {result.advice} ({result.tried})"
    check_against_truth(result, TRUTH[name])


@pytest.mark.parametrize("name", SOLVABLE)
def test_the_answer_knows_its_error(name: str) -> None:
    """One sigma is small beside the field, and the residuals are small beside a star's image."""
    result = solved(name).result
    assert isinstance(result, Solution)
    assert 0 < max(result.attitude.sigma_arcsec[:2]) < 20 * result.camera.scale_arcsec_px
    assert result.rms_px < 4
    assert len(result.stars) >= 6
    assert all(star.residual_px < 15 for star in result.stars)


@pytest.mark.parametrize("name", HOPELESS)
def test_refused_with_a_reason(name: str) -> None:
    result = solved(name).result
    assert isinstance(result, NoSolution), f"{result.ra_dec_deg}, {result.log10_false_alarm}"
    assert result.advice.endswith(".")
    assert "stars_found" in result.measured


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("syn_black.png", Reason.CLOUDED_OR_DARK),
        ("syn_white.png", Reason.CLOUDED_OR_DARK),
        ("real_pf__empty.png", Reason.CLOUDED_OR_DARK),
        ("real_indiall_startrails.jpg", Reason.TRAILED),
        ("syn_randomstars_003_1.png", Reason.TOO_FEW_STARS),
        ("syn_randomstars_120_6.png", Reason.NO_PATTERN_AGREED),
    ],
)
def test_the_reason_is_the_one_a_person_would_give(name: str, reason: Reason) -> None:
    result = solved(name).result
    assert isinstance(result, NoSolution)
    assert result.reason is reason


@pytest.mark.parametrize("name", [n for n in HOPELESS if n.startswith("geo__")])
def test_the_header_tells_that_the_field_is_too_small(name: str) -> None:
    result = solved(name, SolveOptions(timeout_s=None)).result
    assert isinstance(result, NoSolution)
    assert result.reason is Reason.FIELD_TOO_SMALL
    assert result.measured["field_deg"] == pytest.approx(0.23, abs=0.02)


@pytest.mark.parametrize("name", SOLVABLE[::6])
def test_a_wrong_hint_costs_time_and_never_the_answer(name: str) -> None:
    truth = TRUTH[name]
    elsewhere = ((truth["ra_deg"] + 180) % 360, -truth["dec_deg"], 10.0)
    hint = Hint(scale_arcsec_px=(0.2, 0.3), centre_deg=elsewhere)
    result = solved(name, SolveOptions(hint=hint, timeout_s=None)).result
    assert isinstance(result, Solution)
    check_against_truth(result, truth)


def test_every_bright_star_that_shines_is_named() -> None:
    """Of V < 3 at least 97 % of those where there is light: five sigma above the ring around their place."""
    catalogue, seen, named = open_catalogue(), 0, 0
    for name in SOLVABLE:
        answer = solved(name)
        assert isinstance(answer.result, Solution)
        assert answer.frame is not None
        rows = catalogue.brightest(answer.result.centre_vector, answer.result.radius_rad, 200, 2024.0)
        rows = rows[np.asarray(catalogue.mag(rows)) < 3.0]
        places = answer.result.pixels_of(catalogue.vectors(rows, 2024.0))
        known = {star.id for star in answer.result.named}
        for k, label in enumerate(catalogue.labels(rows)):
            beside_brighter = np.hypot(*(places[:k] - places[k]).T).min(initial=np.inf) < 5.0
            if not beside_brighter and shines(answer.frame.pixels, *places[k]):
                seen, named = seen + 1, named + (label[0] in known)
    assert seen > 50
    assert named >= 0.97 * seen


def shines(pixels: np.ndarray, x: float, y: float) -> bool:
    height, width = pixels.shape
    if not (30 < x < width - 30 and 30 < y < height - 30):
        return False
    square = pixels[round(y) - 30 : round(y) + 31, round(x) - 30 : round(x) + 31].astype(float)
    means = sum(np.roll(square, (i, j), (0, 1)) for i in (-1, 0, 1) for j in (-1, 0, 1)) / 9.0
    away = np.hypot(*np.mgrid[-30:31, -30:31])
    ring = means[(away > 12) & (away < 28)]
    return bool(means[away < 6].max() > np.median(ring) + 5.0 * max(ring.std(), 0.002 * float(pixels.max())))
