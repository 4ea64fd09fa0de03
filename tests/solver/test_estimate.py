"""A named estimator replaces the fit's attitude and nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from kochab.attitude import ESTIMATORS
from kochab.core.frame import Hint
from kochab.core.progress import run
from kochab.core.solution import Matches
from kochab.identification import IDENTIFIERS
from kochab.sky import open_catalogue
from kochab.solver import SolveOptions
from kochab.solver.matches import centroid_sigma, extend
from kochab.solver.pipeline import solve_detections, with_estimate

from .fields import YEAR, Told, orion, told

OPTIONS = SolveOptions(method="told", timeout_s=None)


@pytest.fixture(scope="module")
def field():
    return orion(k1=-0.3)


@pytest.fixture(scope="module")
def extended(field):
    return extend(field.detections, told(field), open_catalogue(), YEAR)


@pytest.fixture
def identifier(monkeypatch, field):
    class Fresh(Told):
        asked = []  # noqa: RUF012

    Fresh.field = field
    monkeypatch.setitem(globals(), "Fresh", Fresh)
    monkeypatch.setitem(IDENTIFIERS.own, "told", f"{__name__}:Fresh")


def apart_arcsec(a, b) -> float:
    return float(np.linalg.norm(a.centre_vector - b.centre_vector) * 206264.8)


def test_a_solution_keeps_its_camera_and_changes_its_attitude(identifier, field) -> None:
    fitted = run(solve_detections(field.detections, OPTIONS))
    answers = {name: run(solve_detections(field.detections, replace(OPTIONS, attitude=name))) for name in ESTIMATORS}
    for answer in answers.values():
        assert answer.camera == fitted.camera
        assert [s.id for s in answer.stars] == [s.id for s in fitted.stars]
        assert answer.rms_px >= 0.999 * fitted.rms_px
        lengths = [s.residual_px for s in answer.stars]
        assert answer.rms_px == pytest.approx(np.sqrt(np.mean(np.square(lengths))))
    pixel = fitted.camera.scale_arcsec_px
    assert apart_arcsec(answers["quest"], fitted) < 0.03 * pixel
    assert 0.03 * pixel < apart_arcsec(answers["triad"], fitted) < 2.0 * pixel
    assert apart_arcsec(answers["plate_constants"], fitted) < 0.2 * pixel
    assert answers["triad"].attitude.sigma_arcsec[0] > 3 * answers["quest"].attitude.sigma_arcsec[0]


def test_it_follows_the_correction_for_aberration(identifier, field) -> None:
    from datetime import UTC, datetime

    hint = Hint(time_utc=datetime(2024, 1, 1, tzinfo=UTC))
    options = replace(OPTIONS, hint=hint, aberration=True)
    fitted = run(solve_detections(field.detections, options))
    named = run(solve_detections(field.detections, replace(options, attitude="quest")))
    plain = run(solve_detections(field.detections, replace(OPTIONS, hint=hint)))
    assert apart_arcsec(named, fitted) < 1.0 < 5.0 < apart_arcsec(plain, fitted)


def test_the_most_certain_star_goes_first(field, extended) -> None:
    matches, fit = extended
    sigma = centroid_sigma(field.detections)[matches.detection]
    sigma[7] = 0.1 * sigma.min()
    found, doubt = with_estimate(matches, fit, "triad", sigma)
    assert doubt == ""
    assert np.hypot(*found.residuals_px[7]) < 1e-9
    assert np.hypot(*found.residuals_px.T).mean() > 1e-3


def test_stars_an_estimator_cannot_use_leave_the_fit_and_a_sentence(extended) -> None:
    matches, fit = extended
    parts = (matches.detection, matches.star, matches.xy, matches.vectors)
    two = Matches(*(part[:2] for part in parts))
    same, doubt = with_estimate(two, fit, "plate_constants", np.ones(2))
    assert same is fit
    assert "plate_constants: This estimate needs 3 stars" in doubt
