"""What crosses the simulated camera's field: light and place."""

from dataclasses import replace

import numpy as np
import pytest

from kochab.core.attitude import unit
from kochab.detection.auto import AutoDetector
from kochab.simulate.camera import CameraConfig
from kochab.simulate.rig import PracticeRig, RigConfig
from kochab.simulate.visitors import crossing, fixed_visitor, steady
from kochab.workflows.night.sharpness import sharpness

DARK = CameraConfig(width=640, height=480, fov_deg=1.2, faintest=6.0, hot_per_mp=0.0, rays_per_minute=0.0)


def rig(**camera):
    return PracticeRig(RigConfig(seed=3, start_deg=(-20.0, 30.0), camera=replace(DARK, **camera)))


def light_of(frame, level):
    return float((frame.pixels.astype(float) - level).sum())


def test_a_new_star_stands_where_it_is_and_a_crossing_leaves_its_light_along_its_way():
    one = rig()
    attitude = one.truth().attitude.matrix
    level = float(np.median(one.frame(10.0).pixels))
    there = unit(attitude[2] + np.radians(0.2) * attitude[0] - np.radians(0.1) * attitude[1])
    one.camera.visitors = (fixed_visitor("star", there, steady(8.0)),)
    found = AutoDetector().detect(one.frame(10.0))
    middle = np.array([319.5, 239.5]) + np.array([0.2, -0.1]) / 1.2 * 640
    assert np.hypot(*(found.xy[0] - middle)) < 1.0
    high = np.arcsin(one.truth().enu_to_camera[2][2])
    air = 10 ** (-0.4 * 0.2 / np.sin(high))  # as of the stars
    assert found.flux[0] == pytest.approx(2e7 * 10 * 10 ** (-0.4 * 8.0) * air, rel=0.03)
    begin = one.clock.now_unix()
    ends = unit(attitude[2] - np.radians(0.3) * attitude[0]), unit(attitude[2] + np.radians(0.3) * attitude[0])
    one.camera.visitors = (crossing("meteor", ends, (begin + 2.0, begin + 4.0), steady(5.0)),)
    frame = one.frame(10.0)
    bright = np.argwhere(frame.pixels > level + 150)
    assert np.ptp(bright[:, 1]) == pytest.approx(0.6 / 1.2 * 640, abs=12)
    assert np.ptp(bright[:, 0]) < 12
    near, far = frame.pixels[200:280].astype(float), frame.pixels[300:].astype(float)
    assert near.sum() - far.mean() * near.size == pytest.approx(2e7 * 2.0 * 10 ** (-0.4 * 5.0) * air, rel=0.05)
    one.camera.visitors = (crossing("later", ends, (begin + 200.0, begin + 210.0), steady(2.0)),)
    assert one.frame(10.0).pixels.max() < level + 150


def test_a_tilted_sensor_has_wider_stars_where_it_is_out_of_focus():
    frame = rig(width=1280, height=960, fov_deg=2.4, faintest=12.0, tilt_px=(0.8, -0.4), fwhm_px=3.2).frame(20.0)
    field = sharpness(AutoDetector().detect(frame)).field
    assert field.softest in ("right", "upper right")
    assert field.tilt.value == pytest.approx(2 * np.hypot(0.8, 0.4), abs=4 * field.tilt.sigma)
