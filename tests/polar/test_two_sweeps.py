"""Two sweeps against the normal equations written out, and the second sweep that is worth its time."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.stats import multivariate_normal

from kochab.core.mount import Direction
from kochab.polar import plan
from kochab.polar.error import PolarError
from kochab.polar.flexure import CREEPS, CombinedSweeps, Droop, SweepResult, combine_sweeps, lever, rest_covariance
from kochab.polar.measure import MeasureSettings, measure_local
from kochab.polar.plan import Optics, SweepPath, away_from_axis, plan_second, weighted_arcsec
from kochab.polar.pole import Pole
from kochab.polar.rotations import tangents
from kochab.sky.horizon import Refraction
from tests.polar.mounts import ARCSEC, Mount

MOUNT = Mount(40.0)
UP, CLOCKWISE = tangents(MOUNT.axis)


def sweep(up_arcsec, aside_arcsec, rho_deg, covariance_arcsec2):
    axis = MOUNT.axis + (up_arcsec * UP + aside_arcsec * CLOCKWISE) * ARCSEC
    error = PolarError(axis / np.linalg.norm(axis), MOUNT.pole, np.array(covariance_arcsec2) * ARCSEC**2)
    return SweepResult(error, np.radians(rho_deg))


FIRST = sweep(0.0, 0.0, 20.0, [[9.0, 2.0], [2.0, 4.0]])
SECOND = sweep(-12.0, 7.0, 80.0, [[4.0, -1.0], [-1.0, 16.0]])


def by_hand(sweeps, before):
    """Axis and droop, arcsec, with their whole covariance, its share of noise, and chi-square."""
    levers = [-np.cos(np.radians(40.0)) * np.cos(s.rho_rad) for s in sweeps]
    design = np.concatenate([[[1.0, 0.0, k], [0.0, 1.0, 0.0]] for k in levers] + [[[0.0, 0.0, 1.0]]])
    seen = [[UP @ (s.error.axis - MOUNT.axis), CLOCKWISE @ (s.error.axis - MOUNT.axis)] for s in sweeps]
    values = np.append(np.ravel(seen) / ARCSEC, before.arcsec)
    noise = np.zeros((len(values), len(values)))
    for k, s in enumerate(sweeps):
        noise[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = s.error.covariance / ARCSEC**2
    whole = noise.copy()
    whole[-1, -1] = before.sigma_arcsec**2
    weight = np.linalg.inv(whole)
    inverse = np.linalg.inv(design.T @ weight @ design)
    gain = inverse @ design.T @ weight
    found = gain @ values
    gaps = (values - design @ found)[:-1]
    chi2 = gaps @ np.linalg.inv(noise[:-1, :-1]) @ gaps
    return found, inverse, gain @ noise @ gain.T, chi2


@pytest.mark.parametrize("before", [Droop(), Droop(20.0, 5.0), Droop(-40.0, 100.0)])
def test_two_sweeps_are_one_weighted_least_squares_with_the_droop_as_a_third_unknown(before):
    """Noise of the frames and doubt about the droop are kept apart; what no sweep shows comes on top."""
    found, inverse, noise, chi2 = by_hand([FIRST, SECOND], before)
    both = combine_sweeps([FIRST, SECOND], before)
    axis = MOUNT.axis + (found[0] * UP + found[1] * CLOCKWISE) * ARCSEC
    np.testing.assert_allclose(both.error.axis, axis / np.linalg.norm(axis), atol=1e-9)
    assert (both.droop.arcsec, both.droop.sigma_arcsec) == pytest.approx((found[2], np.sqrt(inverse[2, 2])), rel=1e-5)
    assert both.chi2 == pytest.approx(chi2, rel=1e-4)
    assert both.freedom == pytest.approx(4.0 - 2.0 - (1.0 - inverse[2, 2] / before.sigma_arcsec**2), rel=1e-6)
    widen = max(1.0, chi2 / both.freedom)
    np.testing.assert_allclose(both.error.covariance / ARCSEC**2, widen * noise[:2, :2], rtol=1e-4)
    rest = (10.0 * np.cos(np.radians(40.0))) ** 2 * np.eye(2)
    doubt = (inverse[:2, :2] - noise[:2, :2]) * (5.0 / 3.0) ** 2  # 50 arcsec where 30 are usual
    np.testing.assert_allclose(both.error.flexure / ARCSEC**2, doubt + rest, rtol=1e-3, atol=1e-3)


def test_one_sweep_keeps_its_axis_less_what_was_known_of_the_droop():
    one = combine_sweeps([FIRST], Droop(20.0, 5.0))
    shift = lever(MOUNT.axis, np.radians(20.0))
    assert shift == pytest.approx(-np.cos(np.radians(40.0)) * np.cos(np.radians(20.0)))
    assert UP @ (one.error.axis - MOUNT.axis) / ARCSEC == pytest.approx(-20.0 * shift, rel=1e-4)
    assert (one.chi2, one.freedom, one.chance) == (pytest.approx(0.0, abs=1e-12), 0.0, 1.0)
    np.testing.assert_allclose(one.error.covariance, FIRST.error.covariance, rtol=1e-6)
    assert one.error.flexure[0, 0] / ARCSEC**2 == pytest.approx(
        (5.0 * 5.0 / 3.0 * shift) ** 2 + (10.0 * np.cos(np.radians(40.0))) ** 2, rel=1e-3
    )
    np.testing.assert_allclose(rest_covariance(MOUNT.axis), one.error.flexure[1, 1] * np.eye(2), rtol=1e-3)
    assert CombinedSweeps(one.error, one.droop, 2.0, 2.0).chance == pytest.approx(np.exp(-1.0))


def test_sweeps_that_agree_are_not_made_surer_by_it():
    """Chi-square below its freedom leaves the covariance as the frames say."""
    same = replace(SECOND, error=replace(SECOND.error, axis=FIRST.error.axis))
    both = combine_sweeps([FIRST, same])
    _, _, noise, _ = by_hand([FIRST, same], Droop())
    np.testing.assert_allclose(both.error.covariance / ARCSEC**2, noise[:2, :2], rtol=1e-5)


@pytest.mark.parametrize("before", [Droop(), Droop(-15.0, 5.0)])
@pytest.mark.parametrize("second", [SECOND, replace(SECOND, error=replace(SECOND.error, axis=FIRST.error.axis))])
def test_creep_counts_as_far_as_the_sweeps_are_probable_with_it(before, second):
    """SciPy's densities of both sweeps at once, axis and droop integrated out as normal priors; the axis's is wide."""
    crept = np.array([[400.0, 30.0], [30.0, 250.0]])
    sweeps = [replace(s, error=replace(s.error, creep=CREEPS * crept * ARCSEC**2)) for s in (FIRST, second)]
    levers = [-np.cos(np.radians(40.0)) * np.cos(s.rho_rad) for s in sweeps]
    design = np.concatenate([[[1.0, 0.0, k], [0.0, 1.0, 0.0]] for k in levers])
    seen = np.ravel([[UP @ (s.error.axis - MOUNT.axis), CLOCKWISE @ (s.error.axis - MOUNT.axis)] for s in sweeps])
    prior = np.diag([1e4**2, 1e4**2, before.sigma_arcsec**2])
    density = []
    for share in (0.0, 1.0):
        noise = block_diag(*(s.error.covariance / ARCSEC**2 + share * crept for s in sweeps))
        mean = design @ [0.0, 0.0, before.arcsec]
        density.append(multivariate_normal(mean, noise + design @ prior @ design.T).pdf(seen / ARCSEC))
    probable = CREEPS * density[1] / (CREEPS * density[1] + (1.0 - CREEPS) * density[0])
    assert 0.02 < probable < 0.98
    noise = np.linalg.inv(block_diag(*(s.error.covariance / ARCSEC**2 for s in sweeps)))
    inverse = np.linalg.inv(design.T @ noise @ design + np.diag([0.0, 0.0, before.sigma_arcsec**-2]))
    gain = (inverse @ design.T @ noise)[:2]
    whole = gain @ block_diag(crept, crept) @ gain.T
    creep = combine_sweeps(sweeps, before).error.creep / ARCSEC**2
    np.testing.assert_allclose(creep, probable * whole, rtol=2e-3, atol=1e-3)


# -- Where the second sweep goes ------------------------------------------------------------------------


def measured(latitude=40.0, rho=20.0, **how):
    mount = Mount(latitude, 500.0, 300.0, rho_deg=rho, hour_deg=-40.0)
    settings = MeasureSettings(mount.site, Pole.TRUE, Refraction(pressure_hpa=0.0))
    return measure_local(mount.see([0, 15, 30, 45, 60], np.random.default_rng(6), **how), settings)


@pytest.mark.parametrize("degrees", [-30.0, 20.0, 90.0])
@pytest.mark.parametrize("rho", [25.0, 70.0])
def test_a_turn_in_declination_changes_the_distance_from_the_axis_and_nothing_else(degrees, rho):
    mount = Mount(40.0, 500.0, 300.0, rho_deg=rho)
    (seen,) = mount.see([0])
    moved = away_from_axis(seen, mount.axis, degrees)
    assert np.degrees(np.arccos(moved @ mount.axis)) == pytest.approx(abs(rho + degrees))
    normal = np.cross(mount.axis, seen.boresight)
    assert moved @ normal == pytest.approx(0.0, abs=1e-12)
    assert np.linalg.norm(moved) == pytest.approx(1.0)


@pytest.mark.parametrize(("latitude", "rho"), [(40.0, 20.0), (-35.0, 20.0), (40.0, 75.0), (55.0, 40.0)])
def test_what_a_plan_foresees_is_what_the_sweeps_together_would_say(latitude, rho):
    """The axis found again with the errors of frames yet to be taken: the droop is known, the noise averaged."""
    found = measured(latitude, rho)
    plan = plan_second(found, Optics(), 5)
    toward = (plan.direction is Direction.NORTH) == (latitude > 0)
    new = rho + plan.degrees * (-1.0 if toward else 1.0)
    assert plan.declination_deg == pytest.approx(np.sign(latitude) * (90.0 - new), abs=0.1)
    assert plan.degrees % 5.0 == 0.0
    assert 20.0 <= plan.degrees <= 70.0
    assert 10.0 <= new <= 130.0
    sigma = weighted_arcsec(Optics(), new, plan.path.turn_deg, 5) * ARCSEC
    axis = found.error.axis
    pole, creep = found.error.pole, found.error.creep
    first = [SweepResult(PolarError(axis, pole, s.error.covariance, creep=creep), s.rho_rad) for s in found.results]
    second = SweepResult(PolarError(axis, pole, np.eye(2) * sigma**2 / 2.0, creep=creep), np.radians(new))
    both = combine_sweeps([*first, second], found.before).error
    assert plan.foreseen_arcsec == pytest.approx(both.with_systematics.uncertainty_arcsec, rel=1e-3)
    assert plan.shows
    assert both.flexure_total_arcsec < 0.9 * found.error.flexure_total_arcsec
    assert plan.path.good


def test_a_plan_may_have_a_turn_of_its_own():
    found = measured()
    usual, short = plan_second(found, Optics(), 5), plan_second(found, Optics(), 5, 30.0)
    assert usual.path.turn_deg <= found.turn_deg + 1e-9
    assert short.path.turn_deg <= 30.0
    assert short.foreseen_arcsec > usual.foreseen_arcsec


@pytest.mark.parametrize(
    ("lowest", "past", "good"), [(20.1, 0.0, True), (19.9, 0.0, False), (40.0, 4.9, True), (40.0, 5.1, False)]
)
def test_a_path_is_good_from_twenty_degrees_up_and_to_five_past_the_meridian(lowest, past, good):
    assert SweepPath(Direction.EAST, 60.0, lowest, past).good is good


def test_a_camera_solves_to_two_arcseconds_and_its_roll_to_twenty_unless_told():
    np.testing.assert_allclose(np.sqrt(np.diag(Optics().covariance)) / ARCSEC, [2.0, 2.0, 20.0])


@pytest.mark.parametrize(
    ("latitude", "hour", "rho", "turns_back"),
    [(40.0, -40.0, 40.0, False), (40.0, -70.0, 60.0, False), (40.0, 60.0, 40.0, True), (-35.0, 60.0, 40.0, True)],
)
def test_ra_is_turned_back_first_only_where_that_is_worth_a_twentieth(
    latitude, hour, rho, turns_back, monkeypatch
) -> None:
    mount = Mount(latitude, 500.0, 300.0, rho_deg=rho, hour_deg=hour)
    settings = MeasureSettings(mount.site, Pole.TRUE, Refraction(pressure_hpa=0.0))
    found = measure_local(mount.see([0, 15, 30, 45, 60], np.random.default_rng(6)), settings)
    chosen = plan_second(found, Optics(), 5)
    assert chosen.back_deg == (pytest.approx(found.turn_deg) if turns_back else 0.0)
    best = []
    for costs in (1e-9, 1e9):
        monkeypatch.setattr(plan, "BACK_COSTS", costs)
        best.append(plan_second(found, Optics(), 5))
    back, on = best
    assert (back.back_deg > 0.0, on.back_deg) == (True, 0.0)
    assert (1.05 * back.foreseen_arcsec < on.foreseen_arcsec) is turns_back
    assert chosen.foreseen_arcsec == (back if turns_back else on).foreseen_arcsec
