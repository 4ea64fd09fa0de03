"""The three ways to an axis: exact without noise, invariant where they must be, honest with it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kochab.core.attitude import angle_between
from kochab.polar.axis_fit import axis_of_two, fit_axis
from tests.polar.mounts import ARCSEC, Mount
from tests.polar.plane import axis_of_plane

LATITUDES = [-85.0, -60.0, -33.0, -1.0, 0.0, 20.0, 51.5, 70.0, 85.0]


@pytest.mark.parametrize("latitude", LATITUDES)
@pytest.mark.parametrize("turns", [(0, 30), (0, -45), (0, 20, 60), (0, 90, 170), (0, 179)])
def test_without_noise_every_fit_is_exact(latitude, turns):
    mount = Mount(latitude, 1800.0, -2400.0)
    fit = fit_axis(mount.see(turns), mount.pole)
    assert angle_between(fit.axis, mount.axis) < 1e-4 * ARCSEC
    assert np.degrees(fit.turns_rad) == pytest.approx(np.array(turns), abs=1e-6)
    assert fit.chi2 < 1e-6


def test_the_closed_form_agrees_with_scipy():
    mount = Mount(47.0, 600.0, 900.0)
    first, second = mount.attitude(0.0), mount.attitude(35.0)
    axis, turn = axis_of_two(first, second)
    assert angle_between(axis, mount.axis) < 1e-6 * ARCSEC
    assert np.degrees(turn) == pytest.approx(35.0)
    want = Rotation.from_matrix(second @ first.T).as_rotvec()
    assert axis * turn == pytest.approx(want, abs=1e-12)


def test_nothing_turned_has_no_axis():
    same = Mount().attitude(0.0)
    axis, turn = axis_of_two(same, same)
    assert turn == 0.0
    assert np.isnan(axis).all()
    with pytest.raises(ValueError, match="all the same"):
        fit_axis(Mount().see([0, 0]), Mount().pole)
    with pytest.raises(ValueError, match="two attitudes"):
        fit_axis(Mount().see([0]), Mount().pole)


def test_the_plane_needs_no_roll():
    mount = Mount(-35.0, 900.0, 700.0)
    boresights = np.stack([mount.attitude(t)[:, 2] for t in (0, 25, 60)])
    axis = axis_of_plane(boresights)
    assert abs(axis @ mount.axis) == pytest.approx(1.0, abs=1e-12)


angles = st.floats(-180.0, 180.0)


@settings(max_examples=40)
@given(roll=angles, latitude=st.sampled_from(LATITUDES), seed=st.integers(0, 99))
def test_the_cameras_roll_does_not_matter(roll, latitude, seed):
    """The same noise seen by a camera turned in its holder gives the same axis."""
    rng = np.random.default_rng(seed)
    mount = Mount(latitude, 300.0, -500.0, sigma=2.0, sigma_roll=20.0)
    seen = mount.see([0, 25, 60], rng)
    turn = Rotation.from_euler("z", roll, degrees=True).as_matrix()
    rolled = [type(a)(a.matrix @ turn, turn.T @ a.covariance @ turn, a.time_utc) for a in seen]
    one, other = fit_axis(seen, mount.pole), fit_axis(rolled, mount.pole)
    assert angle_between(one.axis, other.axis) < 0.01 * ARCSEC
    assert one.chi2 == pytest.approx(other.chi2, rel=1e-3)
    assert one.covariance == pytest.approx(other.covariance, rel=1e-3, abs=1e-14)


@settings(max_examples=40)
@given(vector=st.tuples(angles, angles, angles), seed=st.integers(0, 99))
def test_turning_the_ground_turns_the_axis_with_it(vector, seed):
    rng = np.random.default_rng(seed)
    ground = Rotation.from_rotvec(np.radians(vector)).as_matrix()
    mount = Mount(40.0, 300.0, -500.0)
    seen = mount.see([0, 25, 60], rng)
    moved = [type(a)(ground @ a.matrix, a.covariance, a.time_utc) for a in seen]
    one, other = fit_axis(seen, mount.pole), fit_axis(moved, ground @ mount.pole)
    assert angle_between(ground @ one.axis, other.axis) < 0.01 * ARCSEC
    assert one.chi2 == pytest.approx(other.chi2, rel=1e-3)


@settings(max_examples=40)
@given(order=st.permutations(range(4)), seed=st.integers(0, 99))
def test_the_order_of_the_frames_does_not_matter(order, seed):
    mount = Mount(40.0, 300.0, -500.0)
    seen = mount.see([0, 10, 30, 60], np.random.default_rng(seed))
    one = fit_axis(seen, mount.pole)
    other = fit_axis([seen[i] for i in order], mount.pole)
    assert angle_between(one.axis, other.axis) < 0.01 * ARCSEC
    assert one.turn_rad == pytest.approx(other.turn_rad, abs=1e-7)


@pytest.mark.parametrize(("turns", "rho"), [((0, 30), 60), ((0, 30, 60), 60), ((0, 10, 20, 40, 60), 15), ((0, 90), 90)])
def test_the_covariance_is_that_of_many_runs(turns, rho):
    """Coverage of the ellipses and the level of chi-square, at a fixed seed."""
    rng = np.random.default_rng(5)
    mount = Mount(48.0, 1200.0, -900.0, rho_deg=rho)
    inside68 = inside95 = 0
    chi2, in_camera = [], []
    seen_true = mount.attitude(turns[0]).T @ mount.axis
    basis = np.linalg.svd(seen_true[None])[2][1:]
    runs = 400
    for _ in range(runs):
        fit = fit_axis(mount.see(turns, rng), mount.pole)
        gap = mount.axis - fit.axis
        east = np.cross(fit.axis, [0, 0, 1.0])
        east /= np.linalg.norm(east)
        up = np.cross(east, fit.axis)
        v = np.array([gap @ up, gap @ east])
        d2 = v @ np.linalg.solve(fit.covariance, v)
        inside68 += d2 < 2.2957
        inside95 += d2 < 5.9915
        chi2.append(fit.chi2)
        off = basis @ (fit.reference.T @ fit.axis - seen_true)
        in_camera.append(off @ np.linalg.solve(basis @ fit.camera_covariance @ basis.T, off))
    assert np.mean(in_camera) == pytest.approx(2.0, abs=0.3)
    assert 0.62 < inside68 / runs < 0.74
    assert 0.92 < inside95 / runs < 0.98
    assert np.mean(chi2) == pytest.approx(2 * len(turns) - 4, abs=0.35)


def test_a_turn_of_more_than_half_a_circle_is_measured_the_right_way_round():
    mount = Mount(40.0, 300.0, -500.0)
    fit = fit_axis(mount.see([0, 100, 200]), mount.pole)
    assert np.degrees(fit.turn_rad) == pytest.approx(200.0, abs=1e-6)
