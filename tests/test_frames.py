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
