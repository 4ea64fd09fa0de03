"""The Laboratory's estimators of the attitude: the same named stars, beside the fit of them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kochab.attitude import ESTIMATORS
from kochab.core.attitude import Attitude, attitude_from, small_rotation
from kochab.core.errors import UsageError
from kochab.core.progress import run
from kochab.core.solution import NoSolution, Reason
from kochab.lab.laboratory.comparison import FIT, REGISTRIES, Choice, ComparedPart, FieldTruth, scale_hint
from kochab.lab.laboratory.scene import (
    REFUSED,
    REPEATS,
    NamedStars,
    between,
    comparison,
    name_stars,
    simulated_scene,
    try_attitude,
)
from kochab.simulate.random_fields import FieldPlan, random_field
from kochab.sky import open_catalogue

ARCSEC = np.radians(1.0 / 3600.0)
WISH = FieldPlan(20.0, 2048, 0.2, 0.1, 0.1, brightest=30)


def simulated_field(wish, seeds):
    return random_field(open_catalogue(), np.random.default_rng(seeds), wish)


@pytest.fixture(scope="module")
def field():
    return simulated_field(WISH, (6,))


@pytest.fixture(scope="module")
def truth(field):
    return FieldTruth.of(field, WISH)


@pytest.fixture(scope="module")
def named(field, truth):
    found = run(name_stars(field.detections, scale_hint(truth), 2016.0, 20.0))
    assert isinstance(found, NamedStars)
    return found


def test_the_fit_comes_first_and_every_estimator_is_there():
    assert list(REGISTRIES[ComparedPart.ATTITUDE]) == [FIT, *ESTIMATORS]


@pytest.mark.parametrize("name", REGISTRIES[ComparedPart.ATTITUDE])
def test_every_estimator_agrees_with_the_fit_within_its_own_errors(named, truth, name):
    trial = run(try_attitude(named, Choice(name), truth))
    assert trial.right
    assert trial.wrong == 0
    assert trial.matches == len(named.found.matches) >= 20
    assert 0 < trial.seconds < 1
    assert 0.1 < trial.rms_px < 1.0
    sigma = np.hypot(*trial.sigma_arcsec[:2])
    assert 0 < sigma < 60
    if name == FIT:
        assert trial.from_fit_arcsec is None
    else:
        assert 0 < trial.from_fit_arcsec[0] < 5 * sigma
        assert trial.from_fit_arcsec[1] < 5 * trial.sigma_arcsec[2]
    assert trial.off_arcsec < 5 * sigma


def test_many_stars_are_nearer_to_the_fit_than_two(named, truth):
    away = {name: run(try_attitude(named, Choice(name), truth)).from_fit_arcsec[0] for name in ("quest", "triad")}
    assert away["quest"] < 0.5 * away["triad"]


def test_options_reach_the_estimator_and_a_refusal_is_no_answer(named, truth):
    choice = Choice("triad", {"least_angle_deg": 89.0})
    trial = run(try_attitude(named, choice, truth))
    assert not trial.answered
    assert trial.reason == REFUSED
    assert "too near for a roll" in trial.advice
    plain = run(try_attitude(named, Choice("quest", {"sigma_px": 50.0}), truth))
    assert plain.sigma_arcsec[0] > 100
    with pytest.raises(UsageError, match="no option sigma"):
        run(try_attitude(named, Choice(FIT, {"sigma_px": 1.0}), truth))


def test_stars_that_nobody_could_name_have_no_attitude_and_the_reason_is_told(truth):
    refusal = NoSolution(Reason.NO_PATTERN_AGREED, "More stars.", tried="everything")
    trial = run(try_attitude(refusal, Choice("quest"), truth))
    assert (trial.answered, trial.right) == (False, False)
    assert (trial.reason, trial.advice) == (Reason.NO_PATTERN_AGREED, "everything")
    assert run(try_attitude(None, Choice(FIT), None)).reason == "timed out"
    points = simulated_field(FieldPlan(20.0, 2048, 0.3, 0.1, 0.1, brightest=3), (1,)).detections
    assert isinstance(run(name_stars(points, None, 2016.0, 20.0)), NoSolution)


def test_an_estimate_is_timed_over_several_and_can_be_stopped_between(named):
    task = try_attitude(named, Choice("quest"), None)
    assert sum(1 for _ in task) == REPEATS
    stopped = try_attitude(named, Choice("quest"), None)
    next(stopped)
    stopped.close()


def test_all_of_them_from_one_identification(truth):
    heard = []
    task = comparison(
        simulated_scene(ComparedPart.METHOD, WISH, (6,)),
        ComparedPart.ATTITUDE,
        [Choice(name) for name in REGISTRIES[ComparedPart.ATTITUDE]],
        True,
        True,
        20.0,
        heard.append,
    )
    trials = run(task)
    assert heard == trials
    assert len({t.matches for t in trials}) == 1
    assert all(t.right for t in trials)


@given(
    st.floats(-1.0, 1.0),
    st.floats(-1.0, 1.0),
    st.floats(-1.0, 1.0),
    st.floats(0.0, 360.0),
    st.floats(-90.0, 90.0),
    st.floats(-180.0, 180.0),
)
def test_how_far_two_attitudes_are_apart(x, y, roll, ra, dec, position):
    one = attitude_from(ra, dec, position)
    turned = Attitude(small_rotation(1000.0 * ARCSEC * np.array([x, y, roll])) @ one.matrix)
    on_the_sky, in_roll = between(turned, one)
    assert on_the_sky == pytest.approx(1000.0 * np.hypot(x, y), abs=0.01)
    assert in_roll == pytest.approx(1000.0 * abs(roll), abs=0.01)
    assert between(one, turned) == pytest.approx((on_the_sky, in_roll), abs=1e-3)


def test_opposite_attitudes_are_not_taken_for_near_ones():
    one = attitude_from(10.0, 20.0, 30.0)
    away = between(attitude_from(190.0, -20.0, 30.0), one)
    assert np.hypot(*away) == pytest.approx(180 * 3600, rel=1e-6)


def test_no_more_time_is_no_name(field):
    assert run(name_stars(field.detections, None, 2016.0, limit_s=-1.0)) is None
