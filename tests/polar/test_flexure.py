"""Tubes that bend: what one sweep cannot see is told in advance, and two sweeps take it out."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kochab.core.mount import Direction
from kochab.polar.error import CHI2_68, CHI2_95, PolarError
from kochab.polar.flexure import REST_ARCSEC, TUBE_ARCSEC, UNKNOWN, Droop, SweepResult, combine_sweeps, lever
from kochab.polar.measure import MeasureSettings, PolarFindingKind, combine_measurements, measure_local
from kochab.polar.plan import Optics, plan_second
from kochab.polar.pole import Pole
from kochab.polar.rotations import tangents
from kochab.polar.sighting import LocalAttitude
from kochab.sky.horizon import Refraction
from tests.polar.mounts import ARCSEC, Mount

VACUUM = Refraction(pressure_hpa=0.0)
TURNS = [0, 15, 30, 45, 60]


def bent(attitudes, droop_arcsec, rest=None):
    """The same cameras, sunk towards the ground by f cos(altitude), and turned by gravity's pull.

    Worked out direction by direction: nothing of the code under test takes part.
    """
    drooped = []
    for a in attitudes:
        forward = a.matrix[:, 2]
        level = np.cross(forward, [0.0, 0.0, 1.0])  # to the right of who looks that way
        droop = Rotation.from_rotvec(-level * droop_arcsec * ARCSEC).as_matrix()
        pull = a.matrix.T @ [0.0, 0.0, -1.0]
        other = np.zeros(3) if rest is None else rest @ pull * ARCSEC
        matrix = droop @ a.matrix @ Rotation.from_rotvec(other).as_matrix()
        drooped.append(LocalAttitude(matrix, a.covariance, a.time_utc, a.label, a.sweep))
    return drooped


def settings(mount):
    return MeasureSettings(mount.site, Pole.TRUE, VACUUM)


@pytest.mark.parametrize("latitude", [-60.0, -35.0, 0.5, 40.0, 70.0])
@pytest.mark.parametrize("rho", [20.0, 70.0, 110.0])
def test_a_droop_fits_one_sweep_perfectly_and_lowers_its_axis(latitude, rho):
    mount = Mount(latitude, 500.0, 300.0, rho_deg=rho)
    found = measure_local(bent(mount.see(TURNS), 60.0), settings(mount))
    up, sideways = tangents(mount.axis)
    low = (found.error.axis - mount.axis) / ARCSEC
    expected = -60.0 * np.cos(np.radians(mount.latitude_deg)) * np.cos(np.radians(rho))
    assert low @ up == pytest.approx(expected, abs=0.5)
    assert low @ sideways == pytest.approx(0.0, abs=0.2)
    assert found.fit.chi2 < 0.01
    # and that much, at one sigma of the droop, is what it says that it cannot see
    tube = found.error.flexure_arcsec[0] ** 2 - found.error.flexure_arcsec[1] ** 2
    assert np.sqrt(tube) == pytest.approx(abs(expected) * 50.0 / 60.0, rel=0.02)


@pytest.mark.parametrize("latitude", [-35.0, 40.0])
@pytest.mark.parametrize("droop", [-20.0, 45.0])
def test_two_sweeps_find_the_droop_and_the_axis_without_it(latitude, droop):
    mount = Mount(latitude, 500.0, 300.0, rho_deg=20.0, sigma=0.1, sigma_roll=0.2)
    other = Mount(latitude, 500.0, 300.0, rho_deg=80.0, sigma=0.1, sigma_roll=0.2)
    frames = bent(mount.see(TURNS) + other.see(TURNS, sweep=1), droop)
    found = measure_local(frames, settings(mount))
    assert found.droop.arcsec == pytest.approx(droop, abs=0.2)
    assert found.droop.sigma_arcsec < 3.0
    assert np.linalg.norm(found.error.axis - mount.axis) / ARCSEC < 0.2
    said = next(f.text for f in found.findings if f.kind is PolarFindingKind.DROOP)
    assert f"{abs(droop):.0f}″ ±" in said
    assert ("sags" if droop > 0 else "rises") in said


def test_what_was_learned_serves_the_next_sweep():
    mount = Mount(40.0, 500.0, 300.0, rho_deg=20.0)
    frames = bent(mount.see(TURNS), 45.0)
    known = measure_local(frames, settings(mount), Droop(45.0, 2.0))
    assert np.linalg.norm(known.error.axis - mount.axis) / ARCSEC < 0.5
    assert known.error.flexure_arcsec[0] < 0.5 * measure_local(frames, settings(mount)).error.flexure_arcsec[0]
    assert PolarFindingKind.FLEXURE_NOT_MEASURED not in {f.kind for f in known.findings}


def test_sweeps_at_one_declination_say_that_they_see_nothing_of_it():
    mount = Mount(40.0, 500.0, 300.0)
    rng = np.random.default_rng(4)
    frames = mount.see(TURNS, rng) + mount.see(TURNS, rng, sweep=1)
    found = measure_local(frames, settings(mount))
    assert found.droop.sigma_arcsec == pytest.approx(UNKNOWN.sigma_arcsec, rel=0.02)
    assert "too close in declination" in " ".join(f.text for f in found.findings)
    one = measure_local(frames[:5], settings(mount))
    assert found.error.uncertainty_arcsec < one.error.uncertainty_arcsec
    assert found.error.flexure_arcsec == pytest.approx(one.error.flexure_arcsec, rel=0.02)


@pytest.mark.parametrize("sweeps", [1, 2])
def test_noise_and_bending_together_are_as_large_as_said(sweeps):
    """Tubes drawn from what is supposed of tubes: the whole ellipse holds as often as it says."""
    rng = np.random.default_rng(12)
    inside68 = inside95 = 0
    runs = 120
    for _ in range(runs):
        mount = Mount(40.0, 500.0, 300.0, rho_deg=25.0, hour_deg=-40.0)
        other = Mount(40.0, 500.0, 300.0, rho_deg=75.0, hour_deg=-40.0)
        rest = rng.normal(0.0, REST_ARCSEC, (3, 3))
        frames = mount.see(TURNS, rng)
        if sweeps == 2:
            frames = frames + other.see(TURNS, rng, sweep=1)
        found = measure_local(bent(frames, rng.normal(0, TUBE_ARCSEC), rest), settings(mount))
        distance2 = replace(found.error, creep=np.zeros((2, 2))).with_systematics.distance2(mount.axis)
        inside68 += distance2 < CHI2_68
        inside95 += distance2 < CHI2_95
    assert 0.6 < inside68 / runs < 0.85
    assert inside95 / runs > 0.9


@pytest.mark.parametrize("rho", [(20.0, 110.0), (20.0, 25.0, 110.0)])
def test_sweeps_that_agree_have_the_chi_square_that_was_promised(rho):
    """One direction is lost to each unknown, and of the droop what the sweeps tell themselves."""
    rng, mount, sigma = np.random.default_rng(7), Mount(40.0), 25.0 * ARCSEC
    upward, clockwise = tangents(mount.axis)
    chi2, freedom = [], []
    for _ in range(400):
        droop = rng.normal(0.0, TUBE_ARCSEC) * ARCSEC
        looks = []
        for degrees in rho:
            up, aside = rng.normal(0.0, sigma, 2)
            up += droop * lever(mount.axis, np.radians(degrees))
            axis = mount.axis + up * upward + aside * clockwise
            error = PolarError(axis / np.linalg.norm(axis), mount.pole, np.eye(2) * sigma**2)
            looks.append(SweepResult(error, np.radians(degrees)))
        both = combine_sweeps(looks)
        chi2.append(both.chi2)
        freedom.append(both.freedom)
    assert np.mean(chi2) == pytest.approx(np.mean(freedom), rel=0.12)


def test_two_measurements_keep_what_neither_could_see():
    mount = Mount(40.0, 500.0, 300.0)
    rng = np.random.default_rng(5)
    first, again = (measure_local(mount.see(TURNS, rng), settings(mount)) for _ in range(2))
    both = combine_measurements(first, again)
    assert len(both.results) == 2
    assert both.error.flexure_total_arcsec == pytest.approx(first.error.flexure_total_arcsec, rel=0.02)


@pytest.mark.parametrize(("latitude", "rho"), [(40.0, 20.0), (-35.0, 20.0)])
def test_the_plan_goes_where_the_droop_shifts_the_axis_differently(latitude, rho):
    mount = Mount(latitude, 500.0, 300.0, rho_deg=rho, hour_deg=-40.0)
    rng = np.random.default_rng(6)
    found = measure_local(mount.see(TURNS, rng), settings(mount))
    plan = plan_second(found, Optics(), 5)
    assert plan.path.good
    assert plan.degrees >= 20.0
    assert plan.foreseen_arcsec < found.error.with_systematics.uncertainty_arcsec
    out = np.sign(rho - 50.0) < 0
    assert (plan.direction is Direction.SOUTH) == (out == (latitude > 0))
    new = rho + plan.degrees * (1 if out else -1)
    assert abs(plan.declination_deg) == pytest.approx(abs(90.0 - new), abs=0.5)
    # and the boresight that it foresees is the one that is measured there
    other = Mount(latitude, 500.0, 300.0, rho_deg=new, hour_deg=-40.0)
    both = measure_local(list(found.attitudes) + other.see(TURNS, rng, sweep=1), settings(mount))
    assert 0.5 < both.error.with_systematics.uncertainty_arcsec / plan.foreseen_arcsec < 2.0


def test_no_plan_where_nothing_is_to_be_won():
    """At a pole of the Earth gravity pulls along the axis: no bending shifts it."""
    mount = Mount(89.9, 0.0, 0.0, rho_deg=40.0, sigma=0.3, sigma_roll=1.0)
    found = measure_local(mount.see(TURNS), settings(mount))
    assert found.error.flexure_total_arcsec < 0.1
    assert plan_second(found, Optics(0.3, 1.0), 5) is None


def test_near_the_equator_of_the_sky_the_tube_hardly_shifts_the_axis():
    mount = Mount(40.0, 500.0, 300.0, rho_deg=85.0, hour_deg=-40.0)
    found = measure_local(mount.see(TURNS), settings(mount))
    assert found.error.flexure_arcsec[0] < 0.5 * TUBE_ARCSEC
    assert plan_second(found, Optics(), 5) is None
