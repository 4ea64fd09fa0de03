"""The three ways to an axis: exact without noise, invariant where they must be, honest with it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import null_space
from scipy.spatial.transform import Rotation
from scipy.stats import multivariate_normal

from kochab.core.attitude import angle_between, rotation_vector
from kochab.core.mount import SIDEREAL_RAD_S
from kochab.polar import axis_fit
from kochab.polar.axis_fit import axis_of_two, chance_of, find_movement, fit_axis, merge_frames_of_one_place
from kochab.polar.rotations import alt_az, tangents
from kochab.polar.seen_axis import Cause, fit_with_movement
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


def at_one_place(mount, rng=None, tracked=True, after=None):
    """Four frames, half a minute apart, and the clock of a mount that tracks."""
    clock = -np.sign(mount.latitude_deg) * SIDEREAL_RAD_S
    turns = [np.degrees(clock) * 30.0 * k * tracked for k in range(4)]
    return [replace(one, place=0) for one in mount.see(turns, rng, after, seconds=30.0)], clock


@pytest.mark.parametrize("latitude", [-40.0, 40.0])
@pytest.mark.parametrize("tracked", [True, False])
def test_frames_of_one_place_tell_one_attitude_more_surely(latitude, tracked):
    mount, rng, squares = Mount(latitude), np.random.default_rng(5), []
    for _ in range(300):
        frames, clock = at_one_place(mount, rng, tracked)
        (one,) = merge_frames_of_one_place(frames, mount.pole, clock)
        true = at_one_place(mount, None, tracked)[0][-1]
        off = rotation_vector(true.matrix.T @ one.matrix)
        squares.append(off @ np.linalg.solve(one.covariance, off))
        assert one.time_utc == frames[-1].time_utc
        assert np.trace(one.covariance) < 0.31 * np.trace(frames[-1].covariance)
    assert np.mean(squares) == pytest.approx(3.0 * 0.25 / 0.3, abs=0.4)


def test_frames_that_moved_or_are_of_no_place_stay_as_they_are():
    mount, rng = Mount(), np.random.default_rng(5)
    bumped = Rotation.from_rotvec([120.0 * ARCSEC, 0.0, 0.0]).as_matrix()
    frames, clock = at_one_place(mount, rng, after=(3, bumped))
    assert merge_frames_of_one_place(frames, mount.pole, clock) == frames[-1:]
    apart = mount.see((0, 30, 60), rng)
    assert merge_frames_of_one_place(apart, mount.pole, clock) == apart
    two = [*frames[:2], *(replace(one, place=1) for one in apart)]
    assert len(merge_frames_of_one_place(two, mount.pole, clock)) == 2


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


# -- What moved between the frames ---------------------------------------------------------------


def moved(mount, what, arcsec, after, rng=None, turns=(0, 20, 40, 60)):
    """The frames of a sweep in which one axis of the camera turned before frame ``after``."""
    axis = np.array([0.0, 0.0, 1.0])
    if what == "declination":
        axis = np.cross(axis, mount.attitude(0.0).T @ mount.axis)
        axis /= np.linalg.norm(axis)
    turn = Rotation.from_rotvec(axis * arcsec * ARCSEC).as_matrix()
    return mount.see(turns, rng, after=(after, turn))


@pytest.mark.parametrize("rho", [15.0, 60.0])
def test_the_frames_beside_a_wrong_one_know_the_axis_as_well_as_without_it(rho):
    """Its own two unknowns take up all that it says: on the ground and in the camera, the others fit alone."""
    mount = Mount(48.0, 1200.0, -900.0, rho_deg=rho)
    frames = mount.see([0, 15, 30, 45, 60], np.random.default_rng(3))
    frames[2] = replace(
        frames[2], matrix=Rotation.from_euler("yz", [6.0, 9.0], degrees=True).as_matrix() @ frames[2].matrix
    )
    (found,) = (m for m in fit_with_movement(frames, mount.pole) if m.cause is Cause.FRAME and m.after == 2)
    others = fit_axis(frames[:2] + frames[3:], mount.pole)
    assert angle_between(found.axis, others.axis) < 0.01 * ARCSEC
    assert found.covariance == pytest.approx(others.covariance, rel=2e-3)
    assert found.camera_covariance == pytest.approx(others.camera_covariance, rel=2e-3)


@pytest.mark.parametrize("what", ["declination", "camera"])
@pytest.mark.parametrize("arcsec", [900.0, -900.0, 40000.0])
@pytest.mark.parametrize("after", [1, 3])
def test_without_noise_a_movement_is_found_with_its_sign_and_the_axis_is_right(what, arcsec, after):
    mount = Mount(40.0, 600.0, 400.0)
    seen = moved(mount, what, arcsec, after)
    found = find_movement(seen, fit_axis(seen, mount.pole), mount.pole)
    assert (found.what, found.before, found.after) == (what, f"frame {after}", f"frame {after + 1}")
    assert found.angle_arcsec == pytest.approx(arcsec, abs=1.0)
    assert angle_between(found.fit.axis, mount.axis) < 1.0 * ARCSEC
    assert found.fit.chi2 < 0.1


@pytest.mark.parametrize("what", ["declination", "camera"])
def test_one_sigma_off_a_movement_costs_one_in_chi_square(what):
    mount = Mount(40.0, 600.0, 400.0)
    seen = moved(mount, what, 900.0, 2, np.random.default_rng(11))
    found = find_movement(seen, fit_axis(seen, mount.pole), mount.pole)
    for off in (-found.sigma_arcsec, found.sigma_arcsec):
        back = moved(mount, what, -found.angle_arcsec - off, 0)[0].matrix
        undo = mount.attitude(0.0).T @ back
        other = fit_axis([replace(a, matrix=a.matrix @ undo) if k > 1 else a for k, a in enumerate(seen)], mount.pole)
        assert other.chi2 - found.fit.chi2 == pytest.approx(1.0, rel=0.02)


def test_frames_without_a_name_are_counted_from_one():
    mount = Mount(40.0, 600.0, 400.0)
    seen = [replace(a, label="") for a in moved(mount, "camera", 1800.0, 2)]
    found = find_movement(seen, fit_axis(seen, mount.pole), mount.pole)
    assert (found.before, found.after) == ("frame 2", "frame 3")


def test_flexure_and_noise_are_no_movement():
    """A shift below half an arcminute is wind; two frames show nothing; quiet ones need nothing."""
    mount = Mount(40.0, 600.0, 400.0, sigma=0.2, sigma_roll=0.5)
    for arcsec, named in ((20.0, False), (45.0, True)):
        seen = moved(mount, "declination", arcsec, 2)
        assert (find_movement(seen, fit_axis(seen, mount.pole), mount.pole) is not None) is named
    quiet = mount.see([0, 20, 40, 60], np.random.default_rng(2))
    assert find_movement(quiet, fit_axis(quiet, mount.pole), mount.pole) is None
    two = mount.see([0, 40])
    assert find_movement(two, fit_axis(two, mount.pole), mount.pole) is None


@pytest.mark.parametrize("count", [2, 3, 5])
def test_the_freedom_is_two_a_frame_less_four_and_the_chance_that_of_chi_square(count):
    mount = Mount(40.0, 600.0, 400.0)
    fit = fit_axis(mount.see(np.linspace(0, 60, count), np.random.default_rng(4)), mount.pole)
    assert fit.freedom == 2 * count - 4
    if count == 2:
        assert fit.chance == 1.0
    else:
        from scipy.stats import chi2

        assert fit.chance == pytest.approx(chi2.sf(fit.chi2, fit.freedom))
        assert 0.0 < fit.chance < 1.0


def test_residuals_are_angles_and_weighted_ones_sigmas():
    """A roll that is off by ten of its own sigmas is so in sigmas, and as large as that in angle."""
    mount = Mount(40.0, 600.0, 400.0, rho_deg=40.0)
    seen = mount.see([0, 20, 40, 60, 80])
    turn = Rotation.from_euler("z", 200.0 * ARCSEC).as_matrix()
    seen[2] = replace(seen[2], matrix=seen[2].matrix @ turn)
    fit = fit_axis(seen, mount.pole)
    sigma = np.array([2.0, 2.0, 20.0])
    np.testing.assert_allclose(fit.weighted * sigma, fit.residuals / ARCSEC, rtol=1e-6, atol=1e-6)
    assert abs(fit.weighted[2, 2]) == np.abs(fit.weighted).max()
    assert fit.residuals[2, 2] / ARCSEC == pytest.approx(-200.0, rel=0.35)


def test_turns_on_both_sides_of_the_first_frame_span_their_sum():
    mount = Mount(40.0, 300.0, -500.0)
    fit = fit_axis(mount.see([0, -70, 50]), mount.pole)
    assert np.degrees(fit.turn_rad) == pytest.approx(120.0, abs=1e-6)


@pytest.mark.parametrize("place", [(0.3, -0.5, 0.7), (-0.2, 0.9, -0.1), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)])
def test_the_tangents_of_a_direction_are_across_it_and_point_up_and_clockwise(place):
    axis = np.array(place) / np.linalg.norm(place)
    upward, clockwise = tangents(axis)
    np.testing.assert_allclose(
        np.stack([upward, clockwise, axis]) @ np.stack([upward, clockwise, axis]).T, np.eye(3), atol=1e-12
    )
    if abs(axis[2]) < 1.0:
        alt, az = alt_az(axis)
        higher, further = alt_az(axis + 1e-4 * upward), alt_az(axis + 1e-4 * clockwise)
        assert higher[0] - alt == pytest.approx(1e-4, rel=1e-3)
        assert (further[1] - az) * np.cos(alt) == pytest.approx(1e-4, rel=1e-3)


def test_a_chance_is_that_of_chi_square_and_certain_without_freedom():
    from scipy.stats import chi2

    for freedom in (0.3, 1.0, 4.0):
        assert chance_of(7.0, freedom) == pytest.approx(chi2.sf(7.0, freedom))
    assert chance_of(7.0, 0.0) == chance_of(7.0, -2.0) == 1.0


@pytest.mark.parametrize(("sigmas", "sigma", "named"), [(5.2, 8.0, True), (6.5, 8.0, True), (7.0, 2.0, False)])
def test_a_movement_is_named_from_three_of_its_sigmas_and_half_an_arcminute_on(sigmas, sigma, named):
    mount = Mount(40.0, 600.0, 400.0, sigma=sigma, sigma_roll=2.0 * sigma)
    across = np.cross([0.0, 0.0, 1.0], mount.attitude(0.0).T @ mount.axis)
    across /= np.linalg.norm(across)

    def movement(arcsec):
        moved = Rotation.from_rotvec(across * arcsec * ARCSEC).as_matrix()
        seen = mount.see([0, 20, 40, 60, 80], after=(2, moved))
        fit = fit_axis(seen, mount.pole)
        return find_movement(seen, fit, mount.pole)

    unit = movement(3600.0).sigma_arcsec
    found = movement(sigmas * unit)
    assert (sigmas * unit > 30.0) is named
    assert (found is not None) is named
    if named:
        assert (found.what, found.angle_arcsec) == ("declination", pytest.approx(sigmas * unit, rel=0.02))


@pytest.mark.parametrize("scatter", axis_fit.SCATTERS_ARCSEC)
@pytest.mark.parametrize("wobble", [0.0, 25.0])
def test_how_probable_frames_are_that_scatter_is_what_scipy_says_of_their_residuals(scatter, wobble):
    """Where axis, turns and first place are unknown, what they cannot take up of the residuals is all that counts."""
    mount, rng = Mount(40.0, 300.0, 200.0), np.random.default_rng(4)
    frames = [
        replace(f, matrix=f.matrix @ Rotation.from_rotvec(rng.normal(0.0, wobble * ARCSEC, 3)).as_matrix())
        for f in mount.see([0, 15, 30, 45, 60], rng)
    ]
    fit = fit_axis(frames, mount.pole)
    models = axis_fit._gradual(frames, fit)[-len(axis_fit.SCATTERS_ARCSEC) :]
    found = models[axis_fit.SCATTERS_ARCSEC.index(scatter)]
    across = np.stack(tangents(fit.axis))

    def off(unknown):
        """By how much the measured cameras are turned off a mount's, rotation vectors about their own axes."""
        axis = fit.axis + unknown[:2] @ across
        axis /= np.linalg.norm(axis)
        first = Rotation.from_rotvec(unknown[2:5]).as_matrix() @ fit.reference
        turns = fit.turns_rad + np.append(0.0, unknown[5:])
        made = Rotation.from_rotvec(axis * turns[:, None]).as_matrix() @ first
        return Rotation.from_matrix([f.matrix.T @ m for f, m in zip(frames, made, strict=True)]).as_rotvec().ravel()

    step = 1e-4
    slopes = [(off(step * one) - off(-step * one)) / (2.0 * step) for one in np.eye(len(frames) + 4)]
    left = null_space(np.array(slopes)).T
    density = [
        multivariate_normal(cov=left @ np.diag(np.tile(sigma2, len(frames))) @ left.T).logpdf(left @ off(np.zeros(9)))
        for own in (frames[0].covariance,)
        for sigma2 in (np.diag(own), np.diag(own) + (scatter * ARCSEC) ** 2)
    ]
    still = -0.5 * fit.chi2  # as the evidence of a mount where nothing moved is counted
    expected = density[1] - density[0] + np.log(axis_fit.SCATTERS)
    assert found.evidence - still == pytest.approx(expected, abs=0.02)
