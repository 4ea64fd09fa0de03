"""Where a star of the live frame belongs, against a mount that is turned by its bolts with scipy's rotations."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kochab.polar.error import PolarError
from kochab.polar.star_target import belongs_at, to_pole


def enu(altitude_deg, azimuth_deg):
    altitude, azimuth = np.radians((altitude_deg, azimuth_deg))
    return np.array([np.sin(azimuth) * np.cos(altitude), np.cos(azimuth) * np.cos(altitude), np.sin(altitude)])


@pytest.mark.parametrize(("pole", "axis"), [((47.0, 0.0), (47.6, 0.9)), ((35.0, 180.0), (34.2, 178.7))])
def test_a_star_is_seen_where_it_belongs_once_both_bolts_have_brought_the_axis_to_the_pole(pole, axis):
    """A mount is turned: first about the level line across its azimuth, then about the vertical."""
    camera = Rotation.from_euler("ZXZ", [20.0, 65.0, 33.0], degrees=True)
    level = Rotation.from_rotvec([np.cos(np.radians(axis[1])), -np.sin(np.radians(axis[1])), 0.0])
    lift = Rotation.from_rotvec(level.as_rotvec() * np.radians(pole[0] - axis[0]))
    swing = Rotation.from_euler("z", -(pole[1] - axis[1]), degrees=True)
    assert (swing * lift).apply(enu(*axis)) == pytest.approx(enu(*pole), abs=1e-12), "by hand"
    error = PolarError(enu(*axis), enu(*pole), np.eye(2) * 1e-12)
    assert to_pole(error) @ enu(*axis) == pytest.approx(enu(*pole), abs=1e-12)
    sky = np.array([[0.01, -0.02, 1.0], [0.03, 0.01, 1.0]])
    sky /= np.linalg.norm(sky, axis=1)[:, None]
    star = camera.apply(sky)  # E, N, U: it stays
    after = (swing * lift * camera).inv().apply(star)
    assert belongs_at(sky, camera.as_matrix(), error) == pytest.approx(after, abs=1e-12)


def test_with_the_axis_at_its_pole_every_star_belongs_where_it_is():
    error = PolarError(enu(47.0, 0.0), enu(47.0, 0.0), np.eye(2) * 1e-12)
    ray = np.array([[0.0, 0.0, 1.0]])
    assert belongs_at(ray, np.eye(3), error) == pytest.approx(ray, abs=1e-15)
