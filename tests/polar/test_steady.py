"""Quiet frames are averaged, a turned bolt starts anew, and what frames share is not averaged away."""

import numpy as np

from kochab.polar.live import LivePhase, Steady
from tests.polar.mounts import Mount
from tests.polar.test_live import adjusted, start


def readings(d_alt, d_az, count, live, mount, rng, begin=60.0):
    return [live.update_local(adjusted(mount, d_alt, d_az, 90, 0.0, begin + 3.0 * k, rng)) for k in range(count)]


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
