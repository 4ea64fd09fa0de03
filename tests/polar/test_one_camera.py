"""Frames of one camera, low in the sky: fitted together they share its centre and distortion, and know of refraction.

The sky is the bench's own, with a ray traced through the air; each frame is then fitted alone, as the solver does.
"""

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from kochab.attitude.fit import refine
from kochab.core.attitude import ARCSEC, Attitude, angle_between, radec_deg, small_rotation, unit
from kochab.core.camera import Camera
from kochab.core.frame import Site
from kochab.core.solution import Matches, NamedStar, Solution
from kochab.lab.bench.polar_frames import Night, Overhead
from kochab.polar.live import LivePhase
from kochab.polar.measure import MeasureSettings, measure
from kochab.polar.rotations import direction
from kochab.polar.sighting import Sighting, seen_by, to_local, with_one_camera
from kochab.sky.horizon import Refraction

SITE, AIR = Site(40.0, 11.5, 500.0), Refraction(960.0, 5.0)
AXIS = direction(np.radians(40.4), np.radians(-0.3))
LENS = Camera(1600, 1200, 6078.0, 805.0, 591.0, k1=-0.7)
"""Of 15 deg, its optical axis 10 px off the centre."""

SETTINGS = MeasureSettings(SITE, refraction=AIR)
FIRST = direction(np.radians(28.0), np.radians(110.0))  # a turn about AXIS takes it down to 17 deg


def matrices(turns_deg, bolts=None):
    across = unit(np.cross(FIRST, [0.3, 0.1, 1.0]))
    start = np.stack([across, np.cross(FIRST, across), FIRST])
    turned = np.stack([start @ small_rotation(AXIS * np.radians(t)).T for t in turns_deg])
    return turned if bolts is None else turned @ bolts.T


def sightings(enu_to_camera, noise_px=0.0, begun=1.75e9, stars=200):
    """Each frame fitted alone to its own stars, somewhere in the field."""
    rng = np.random.default_rng(7)
    times = begun + 20.0 * np.arange(len(enu_to_camera))
    night = Night(SITE, AIR, AXIS, LENS, enu_to_camera, times)
    found = []
    for matrix, unix_s in zip(enu_to_camera, times, strict=True):
        above = Overhead(night, float(unix_s))
        middle = above.towards(matrix[2])
        sky = unit(middle + rng.normal(scale=0.08, size=(6 * stars, 3)))
        xy = LENS.project(above.seen(sky) @ matrix.T)
        inside = np.flatnonzero(((xy > 0) & (xy < [LENS.width - 1, LENS.height - 1])).all(axis=1))[:stars]
        xy, sky = xy[inside] + rng.normal(scale=max(noise_px, 1e-4), size=(len(inside), 2)), sky[inside]
        number = np.arange(len(sky))
        to_icrs = np.linalg.lstsq(sky, LENS.unproject(xy), rcond=None)[0].T
        u, _, vt = np.linalg.svd(to_icrs)
        fit = refine(Matches(number, number, xy, sky), LENS, Attitude(u @ vt))
        named = (NamedStar(*at, "", "", 8.0, *radec_deg(v), 0.0) for at, v in zip(xy, sky, strict=True))
        alone = Solution(fit.camera, fit.attitude, tuple(named), fit.rms_px, -30.0, "")
        found.append(Sighting.of(alone, datetime.fromtimestamp(float(unix_s), UTC)))
    return found


def off_arcsec(error, axis=AXIS):
    return angle_between(error.axis, axis) / ARCSEC


def alone(found):
    return [replace(s, matches=None) for s in found]


def test_low_frames_give_the_axis_surely_when_they_share_a_camera():
    found = sightings(matrices([0.0, -20.0, -35.0]), noise_px=0.1)
    shared, single = measure(found, SETTINGS), measure(alone(found), SETTINGS)
    assert shared.camera is not None
    assert off_arcsec(shared.error) < 5.0
    assert shared.error.uncertainty_arcsec < 10.0
    assert single.error.uncertainty_arcsec > 2.0 * shared.error.uncertainty_arcsec


def test_without_noise_only_the_formula_of_the_air_is_left():
    found = sightings(matrices([0.0, -20.0, -35.0]))
    assert off_arcsec(measure(found, SETTINGS).error) < 0.5
    assert off_arcsec(measure(alone(found), SETTINGS).error) > 1.0


def test_the_live_error_is_seen_with_the_camera_of_the_measurement():
    """A bolt has been turned by 10 arcmin, and the camera looks lower than any frame of the measurement."""
    bolts = small_rotation(np.array([0.0, 0.0, np.radians(-1.0 / 6.0)]))
    found = sightings(matrices([0.0, -15.0, -30.0]))
    now = sightings(matrices([-36.0], bolts), begun=1.75e9 + 200.0)
    measured = measure(found, SETTINGS)
    shared, single = (LivePhase(measured).update(to_local(last, SITE, AIR)) for last in (now[0], alone(now)[0]))
    assert off_arcsec(shared.error, bolts @ AXIS) < 1.0
    assert np.trace(single.frame_covariance) > 4.0 * np.trace(shared.frame_covariance)


@pytest.mark.parametrize("other", [{"width": 800}, {"focal_px": 6300.0}, {"mirrored": True}])
def test_frames_of_two_cameras_share_none(other):
    found = sightings(matrices([0.0, -20.0]))
    odd = replace(found[1], camera=replace(found[1].camera, **other))
    local = [to_local(s, SITE, AIR) for s in (found[0], odd)]
    frames, camera = with_one_camera(local)
    assert camera is None
    assert frames == local
    assert seen_by(found[0].camera, local[1]) is local[1]


def test_too_few_stars_share_no_camera():
    found = sightings(matrices([0.0, -20.0]))
    few = [replace(s, matches=s.matches.take(slice(0, 5))) for s in found]
    assert measure(few, SETTINGS).camera is None
    assert measure(found, SETTINGS).camera is not None
