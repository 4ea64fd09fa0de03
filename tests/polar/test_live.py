"""The live phase: exact without noise, tracking or not; honest with it; never fooled by its prior."""

from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kochab.core.mount import SIDEREAL_DEG_S
from kochab.polar.live import LivePhase, Moment, declination_moved
from kochab.polar.measure import MeasureSettings, PolarFindingKind, measure_local
from kochab.polar.pole import Pole
from kochab.polar.rotations import tangents
from kochab.polar.sighting import LocalAttitude
from kochab.sky.horizon import Refraction
from tests.polar.mounts import ARCSEC, WHEN, Mount

VACUUM = Refraction(pressure_hpa=0.0)


def start(mount, rng=None, turns=(0, 30, 60, 90)):
    settings = MeasureSettings(mount.site, Pole.TRUE, VACUUM)
    return measure_local(mount.see(list(turns), rng), settings)


def adjusted(mount, d_alt, d_az, last_turn, theta_deg, seconds, rng=None):
    """The attitude after the bolts brought the axis to (d_alt, d_az): they turn the whole mount."""
    begin = Mount(
        mount.latitude_deg,
        mount.d_alt,
        mount.d_az,
        mount.rho_deg,
        mount.roll_deg,
        mount.hour_deg + theta_deg,
        mount.sigma,
        mount.sigma_roll,
    )
    matrix = begin.attitude(last_turn)
    azimuth = (0.0 if mount.latitude_deg >= 0 else np.pi) + mount.d_az * ARCSEC
    level = np.array([np.cos(azimuth), -np.sin(azimuth), 0.0])
    lift = Rotation.from_rotvec(level * (d_alt - mount.d_alt) * ARCSEC).as_matrix()
    turn = Rotation.from_rotvec([0, 0, -(d_az - mount.d_az) * ARCSEC]).as_matrix()
    matrix = turn @ lift @ matrix
    sigma = np.array([mount.sigma, mount.sigma, mount.sigma_roll]) * ARCSEC
    if rng is not None:
        matrix = matrix @ Rotation.from_rotvec(rng.normal(0.0, sigma)).as_matrix()
    when = WHEN + timedelta(seconds=180.0 + seconds)
    return LocalAttitude(matrix, np.diag(sigma**2), when)


def sky_turn(mount, seconds):
    """How far tracking turns a mount about its elevated axis."""
    return (-1.0 if mount.latitude_deg >= 0 else 1.0) * SIDEREAL_DEG_S * seconds


@pytest.mark.parametrize("latitude", [-60.0, -20.0, 5.0, 48.0, 70.0, 84.0])
@pytest.mark.parametrize("tracking", [True, False])
def test_without_noise_the_bolts_are_followed_exactly(latitude, tracking):
    mount = Mount(latitude, 1800.0, -2700.0)
    live = LivePhase(start(mount))
    for seconds, d_alt, d_az in [(10, 1800.0, -2700.0), (100, 300.0, -2700.0), (400, 5.0, 8.0)]:
        theta = sky_turn(mount, seconds) if tracking else 0.0
        seen = live.update(adjusted(mount, d_alt, d_az, 90, theta, seconds))
        assert seen.error.altitude_arcsec == pytest.approx(d_alt, abs=0.05)
        assert seen.error.azimuth_arcsec == pytest.approx(d_az, abs=0.5)
        assert np.degrees(seen.theta_rad) * 3600 == pytest.approx(theta * 3600, abs=0.5)
    assert seen.prior == ("tracking" if tracking else "standing")


def test_a_free_turn_of_the_axis_is_absorbed_and_told():
    mount = Mount(48.0, 1800.0, -2700.0)
    live = LivePhase(start(mount))
    seen = live.update(adjusted(mount, 600.0, -100.0, 90, 12.0, 60.0))
    assert seen.prior == ""
    assert seen.error.altitude_arcsec == pytest.approx(600.0, abs=0.01)
    assert seen.error.azimuth_arcsec == pytest.approx(-100.0, abs=0.01)
    assert [f.kind for f in seen.findings] == [PolarFindingKind.SLIPPING]


def test_a_large_move_asks_for_a_new_measurement():
    mount = Mount(48.0, 0.0, 4 * 3600.0)
    seen = LivePhase(start(mount)).update(adjusted(mount, 0.0, 600.0, 90, 0.0, 60.0))
    assert PolarFindingKind.REMEASURE in {f.kind for f in seen.findings}
    assert seen.moved_deg == pytest.approx(3.833 * np.cos(np.radians(48.0)), abs=0.01)


def test_stop_is_said_when_the_error_is_below_its_uncertainty():
    mount = Mount(48.0, 900.0, 900.0)
    live = LivePhase(start(mount, np.random.default_rng(1)))
    near = live.update(adjusted(mount, 2.0, 2.0, 90, 0.0, 300.0))
    assert PolarFindingKind.DONE in {f.kind for f in near.findings}
    far = live.update(adjusted(mount, 200.0, 2.0, 90, 0.0, 300.0))
    assert PolarFindingKind.DONE not in {f.kind for f in far.findings}


def scatter(mount, runs, tracked, seed, seconds=300.0):
    rng = np.random.default_rng(seed)
    gaps, inside, free = [], 0, []
    for _ in range(runs):
        live = LivePhase(start(mount, rng))
        theta = sky_turn(mount, seconds) * tracked
        seen = live.update(adjusted(mount, 40.0, -60.0, 90, theta, seconds, rng))
        truth = Mount(mount.latitude_deg, 40.0, -60.0).axis
        inside += seen.error.distance2(truth) < 2.2957
        gaps.append(np.linalg.norm(seen.error.axis - truth) / ARCSEC)
        free.append(seen.prior == "")
    return np.sqrt(np.mean(np.square(gaps))), inside / runs, np.mean(free)


@pytest.mark.parametrize("tracked", [1.0, 0.0])
def test_with_noise_the_ellipse_holds_and_the_prior_helps(tracked):
    """A narrow field's roll of 200 arcsec would spoil the axis by as much without the prior."""
    mount = Mount(48.0, 900.0, -900.0, sigma_roll=200.0, rho_deg=80.0)
    rms, inside, free = scatter(mount, 60, tracked, 7, 600.0)
    assert free < 0.02
    assert 0.7 < inside < 0.95  # 20 arcsec is allowed to the clock, and it is exact here
    # without the prior: the roll alone throws the axis by 200 arcsec x sin(rho)
    assert rms < 80.0


def test_a_clock_that_is_wrong_is_not_believed():
    """Half the sidereal rate - neither tracking nor standing - and a good roll: the prior goes."""
    mount = Mount(48.0, 900.0, -900.0)
    rms, inside, free = scatter(mount, 150, 0.5, 9)
    assert free == 1.0
    assert 0.6 < inside < 0.77
    assert rms < 40.0


@pytest.mark.parametrize(("degrees", "asked"), [(1.95, False), (2.05, True)])
def test_two_degrees_are_a_large_move(degrees, asked):
    mount = Mount(48.0, 0.0, 0.0)
    seen = LivePhase(start(mount)).update(adjusted(mount, degrees * 3600.0, 0.0, 90, 0.0, 60.0))
    assert (PolarFindingKind.REMEASURE in {f.kind for f in seen.findings}) is asked
    assert seen.moved_deg == pytest.approx(degrees, rel=1e-3)


@pytest.mark.parametrize(("degrees", "told"), [(0.45, False), (0.55, True), (-0.55, True)])
def test_ra_has_slipped_half_a_degree_beyond_what_tracking_explains(degrees, told):
    mount = Mount(48.0, 900.0, -900.0)
    seen = LivePhase(start(mount)).update(adjusted(mount, 900.0, -900.0, 90, degrees, 0.0))
    assert (PolarFindingKind.SLIPPING in {f.kind for f in seen.findings}) is told
    assert np.degrees(seen.theta_rad) == pytest.approx(degrees, abs=1e-4)
    beyond = degrees + np.sign(degrees) * SIDEREAL_DEG_S * 240.0
    later = LivePhase(start(mount)).update(adjusted(mount, 900.0, -900.0, 90, beyond, 240.0))
    assert (PolarFindingKind.SLIPPING in {f.kind for f in later.findings}) is told


@pytest.mark.parametrize(("sigmas", "prior"), [(2.8, "standing"), (3.2, ""), (-2.8, "standing"), (-3.2, "")])
def test_a_clock_is_believed_within_three_sigmas(sigmas, prior):
    """Of the attitude's roll and the clock's own 20 arcsec; where both clocks may be right neither is."""
    mount = Mount(48.0, 900.0, -900.0, sigma=0.1, sigma_roll=0.1, rho_deg=60.0)
    off = sigmas * 20.0 / 3600.0
    seen = LivePhase(start(mount)).update(adjusted(mount, 900.0, -900.0, 90, off, 600.0))
    assert seen.prior == prior
    soon = LivePhase(start(mount)).update(adjusted(mount, 900.0, -900.0, 90, 0.0, 1.0))
    assert soon.prior == ""  # 15 arcsec apart


@pytest.mark.parametrize(("arcsec", "prior"), [(70.0, ""), (90.0, "standing")])
def test_the_other_clock_must_be_four_sigmas_worse(arcsec, prior):
    mount = Mount(48.0, 900.0, -900.0, sigma=0.1, sigma_roll=0.1)
    seconds = arcsec / 3600.0 / SIDEREAL_DEG_S
    assert LivePhase(start(mount)).update(adjusted(mount, 900.0, -900.0, 90, 0.0, seconds)).prior == prior


def test_the_error_is_the_frames_own_and_the_measurements():
    """Both in squares: what a new frame adds shrinks with its errors, the measurement's share stays."""
    mount = Mount(48.0, 900.0, -900.0)
    live, frame = LivePhase(start(mount)), adjusted(mount, 900.0, -900.0, 90, 12.0, 60.0)
    seen = live.update(frame)
    sure = live.update(LocalAttitude(frame.matrix, frame.covariance / 1e6, frame.time_utc))
    np.testing.assert_allclose(sure.frame_covariance, seen.frame_covariance / 1e6, rtol=1e-6, atol=1e-25)
    shared = seen.error.covariance - seen.frame_covariance
    np.testing.assert_allclose(sure.error.covariance - sure.frame_covariance, shared, rtol=1e-6, atol=1e-18)
    assert np.linalg.eigvalsh(shared).min() > 0.0


def test_a_clock_that_is_believed_is_one_more_measurement_of_the_turn():
    """Weighted by 20 arcsec against the attitude's own error of it; the turn's slope by differences."""
    mount = Mount(48.0, 900.0, -900.0, sigma=5.0, sigma_roll=60.0)
    first, sigma = start(mount), 20.0 * ARCSEC
    frame = adjusted(mount, 300.0, -500.0, 90, 40.0 / 3600.0, 600.0)
    h = 1e-5

    def by_attitude_alone(turn):
        """Where both clocks say the same neither is believed."""
        matrix = frame.matrix @ Rotation.from_rotvec(turn).as_matrix()
        seen = LivePhase(first).update(replace(frame, matrix=matrix, time_utc=WHEN + timedelta(seconds=181.0)))
        assert seen.prior == ""
        return seen

    alone = by_attitude_alone(np.zeros(3))
    steps = [(by_attitude_alone(h * e), by_attitude_alone(-h * e)) for e in np.eye(3)]
    slope = np.array([(more.theta_rad - less.theta_rad) / (2.0 * h) for more, less in steps])
    moves = np.stack([(more.error.axis - less.error.axis) / (2.0 * h) for more, less in steps], axis=1)
    lever = np.stack(tangents(alone.error.axis)) @ moves
    spread = slope @ frame.covariance @ slope + sigma**2
    gain = frame.covariance @ slope / spread
    seen = LivePhase(first).update(frame)
    assert seen.prior == "standing"
    np.testing.assert_allclose(seen.error.axis, alone.error.axis - moves @ gain * alone.theta_rad, atol=0.01 * ARCSEC)
    left = alone.theta_rad * (1.0 - slope @ gain)
    assert seen.theta_rad == pytest.approx(left, abs=0.01 * ARCSEC)
    surer = frame.covariance - np.outer(gain, slope @ frame.covariance)
    np.testing.assert_allclose(alone.frame_covariance, lever @ frame.covariance @ lever.T, rtol=1e-4)
    np.testing.assert_allclose(seen.frame_covariance, lever @ surer @ lever.T, rtol=3e-3)


# -- A turn about the declination axis, by the least squares of its angle ---------------------------------


def two_moments(angle_arcsec, aside_arcsec, sigma=(2.0, 3.0, 20.0), rho_deg=60.0):
    """A frame and the next, turned about the declination axis and about what is across it; RA has slipped as well."""
    mount = Mount(48.0, 0.0, 0.0, rho_deg=rho_deg)
    before = mount.attitude(0.0)
    across = np.cross(before[:, 2], mount.axis)
    across /= np.linalg.norm(across)
    turn = angle_arcsec * across + aside_arcsec * np.cross(across, mount.axis)
    now = Rotation.from_rotvec(turn * ARCSEC).as_matrix() @ before
    covariance = np.diag(np.square(sigma)) * ARCSEC**2
    slope = np.array([0.0, 0.0, 1.0])
    moments = [
        Moment(LocalAttitude(matrix, covariance, WHEN), theta, slope, matrix @ before.T @ mount.axis)
        for matrix, theta in ((before, 0.0), (now, 1.0))
    ]
    both = sum(m.attitude.matrix @ covariance @ m.attitude.matrix.T for m in moments)
    inverse = np.linalg.inv(both + (20.0 * ARCSEC) ** 2 * np.outer(mount.axis, mount.axis))
    along = across @ inverse @ across
    chi2 = turn @ inverse @ turn - (across @ inverse @ turn) ** 2 / along
    return moments, float(chi2) * ARCSEC**2


@pytest.mark.parametrize("angle", [300.0, -300.0, 5400.0])
@pytest.mark.parametrize(("chi2", "moved"), [(8.5, True), (9.5, False)])
def test_declination_moved_when_a_turn_about_its_axis_leaves_no_more_than_noise(angle, chi2, moved):
    """Chi-square of what the best such turn leaves: 9 at most; the clock counts as 20 arcsec about the polar axis."""
    aside = 1.0
    for _ in range(2):
        aside *= np.sqrt(chi2 / two_moments(angle, aside)[1])
    moments, expected = two_moments(angle, aside)
    assert expected == pytest.approx(chi2, rel=0.02)
    found = declination_moved(*moments, [0.0])
    if moved:
        assert found / ARCSEC == pytest.approx(angle, rel=1e-3)
    else:
        assert found is None


@pytest.mark.parametrize(("angle", "moved"), [(58.0, False), (62.0, True), (-58.0, False), (-62.0, True)])
def test_declination_moves_by_an_arcminute_or_not_at_all(angle, moved):
    moments, _ = two_moments(angle, 0.0, sigma=(0.5, 0.5, 5.0))
    assert (declination_moved(*moments, [0.0]) is not None) is moved


@pytest.mark.parametrize(("rho_deg", "told"), [(2.5, False), (3.5, True), (176.5, True), (177.5, False)])
def test_along_the_polar_axis_declination_cannot_be_told(rho_deg, told):
    """Within 2.9 degrees of it."""
    moments, _ = two_moments(600.0, 0.0, rho_deg=rho_deg)
    assert (declination_moved(*moments, [0.0]) is not None) is told


@pytest.mark.parametrize(("sigmas", "moved"), [(4.4, False), (4.55, True)])
def test_bolts_are_refuted_when_ra_is_off_the_clock_by_the_root_of_twenty_sigmas(sigmas, moved):
    """The sigma combines both frames' rotation errors and the clock error."""
    (before, now), _ = two_moments(600.0, 0.0)
    sigma = np.sqrt(2.0 * 20.0**2 + 20.0**2) * ARCSEC  # their slope is that of the roll
    for sign in (1.0, -1.0):
        off = replace(now, theta_rad=sign * sigmas * sigma)
        assert (declination_moved(before, off, [0.0]) is not None) is moved
    assert declination_moved(before, replace(now, theta_rad=2.0 * np.pi), [0.0]) is None  # a whole turn is none


@pytest.mark.parametrize(("sigmas", "moved"), [(4.4, False), (4.55, True)])
def test_the_polar_axis_has_moved_from_the_root_of_twenty_sigmas_on(sigmas, moved):
    """Of a frame's small rotation: alike to all sides, and for two frames."""
    sigma = 30.0
    moments, _ = two_moments(sigmas * sigma * np.sqrt(2.0), 0.0, sigma=(sigma,) * 3)
    assert (declination_moved(*moments, [0.0]) is not None) is moved
