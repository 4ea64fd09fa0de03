"""Quiet frames are averaged, a turned bolt starts anew, and what frames share is not averaged away."""

import numpy as np
import pytest

from kochab.polar.error import PolarError
from kochab.polar.live import LiveError, LivePhase, Steady
from kochab.polar.rotations import direction
from tests.polar.mounts import ARCSEC, Mount
from tests.polar.test_live import adjusted, start


def readings(d_alt, d_az, count, live, mount, rng, begin=60.0):
    return [live.update(adjusted(mount, d_alt, d_az, 90, 0.0, begin + 3.0 * k, rng)) for k in range(count)]


def test_the_mean_gets_surer_but_never_surer_than_the_measurement():
    rng = np.random.default_rng(4)
    mount = Mount(48.0, 900.0, -900.0)
    live, steady = LivePhase(start(mount, rng)), Steady()
    seen = readings(300.0, -200.0, 30, live, mount, rng)
    quiet = [steady.update(reading) for reading in seen]
    assert [q.frames for q in quiet] == list(range(1, 31))
    assert quiet[-1].noise_arcsec[0] < quiet[0].noise_arcsec[0] / 5.0
    assert quiet[-1].error.uncertainty_arcsec < quiet[0].error.uncertainty_arcsec
    shared = seen[-1].error.covariance - seen[-1].frame_covariance
    assert np.trace(quiet[-1].error.covariance) > np.trace(shared)
    assert not quiet[0].settled
    assert quiet[-1].settled


def test_a_turned_bolt_starts_anew():
    rng = np.random.default_rng(5)
    mount = Mount(48.0, 900.0, -900.0)
    live, steady = LivePhase(start(mount, rng)), Steady()
    for reading in readings(300.0, -200.0, 10, live, mount, rng):
        before = steady.update(reading)
    assert steady.movements == 0
    (moved,) = readings(100.0, -200.0, 1, live, mount, rng, 120.0)
    after = steady.update(moved)
    assert (steady.movements, after.frames, after.settled) == (1, 1, False)
    assert after.error.altitude_arcsec < before.error.altitude_arcsec - 100.0
    steady.forget()
    assert steady.update(moved).frames == 1
    assert steady.movements == 1


POLE = direction(np.radians(48.0), 0.0)


def reading(altitude_arcsec, noise_arcsec, shared_arcsec=0.0, azimuth_on_sky_arcsec=0.0):
    """A live error with so much noise of its own in each direction, and so much of the measurement's."""
    azimuth = azimuth_on_sky_arcsec * ARCSEC / np.cos(np.radians(48.0))
    axis = direction(np.radians(48.0) + altitude_arcsec * ARCSEC, azimuth)
    frame = np.eye(2) * (noise_arcsec * ARCSEC) ** 2
    error = PolarError(axis, POLE, frame + np.eye(2) * (shared_arcsec * ARCSEC) ** 2)
    return LiveError(error, frame, None, 0.0, "", 0.0)


def test_the_noise_falls_with_the_root_of_the_frames_and_the_shared_error_stays():
    steady = Steady()
    for count in range(1, 10):
        quiet = steady.update(reading(900.0, 30.0, 40.0))
        assert quiet.noise_arcsec == pytest.approx((30.0 / count**0.5,) * 2)
        assert quiet.error.sigma_arcsec == pytest.approx((np.hypot(40.0, 30.0 / count**0.5),) * 2)
    assert quiet.error.altitude_arcsec == pytest.approx(900.0)


@pytest.mark.parametrize(
    ("altitude", "noise", "frames"),
    [(60.0, 2.7, 3), (60.0, 5.0, 4), (2500.0, 100.0, 3), (2500.0, 150.0, 5), (60.0, 100.0, 16)],
    ids=["small at once", "small after four", "small beside the error", "after five", "it gets no better"],
)
def test_it_is_settled_when_the_noise_is_small_or_small_beside_the_error_or_gets_no_smaller(altitude, noise, frames):
    """Both directions together below 4 arcsec or a 25th of the error; three frames at least, 16 at most."""
    steady = Steady()
    settled = [steady.update(reading(altitude, noise)).settled for _ in range(20)]
    assert settled == [False] * (frames - 1) + [True] * (21 - frames)


@pytest.mark.parametrize(("sigmas", "moved"), [(3.9, 0), (4.1, 1)])
def test_four_sigmas_are_a_bolt_and_not_noise(sigmas, moved):
    """The gap to a mean of ten has the noise of both, either way and in either direction."""
    spread = 10.0 * np.sqrt(1.0 + 1.0 / 10.0)
    for sign in (1.0, -1.0):
        for altitude, azimuth in ((sign * sigmas * spread, 0.0), (0.0, sign * sigmas * spread)):
            steady = Steady()
            for _ in range(10):
                steady.update(reading(0.0, 10.0, 100.0))
            after = steady.update(reading(altitude, 10.0, 100.0, azimuth))
            assert (steady.movements, after.frames) == (moved, 1 if moved else 11)


def test_what_is_older_than_sixty_frames_is_not_averaged():
    """A tripod that sinks by a tenth of an arcsecond a frame is seen where it was half a minute ago."""
    steady = Steady()
    for k in range(200):
        quiet = steady.update(reading(0.1 * k, 10.0))
    assert quiet.frames == 60
    assert quiet.error.altitude_arcsec == pytest.approx(0.1 * (199 - 29.5), abs=1e-3)
