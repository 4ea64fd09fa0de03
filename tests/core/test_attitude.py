"""Attitude in all its forms, against scipy's rotations and astropy's world coordinates."""

import numpy as np
import pytest
from astropy.wcs import WCS
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kochab.core.attitude import (
    Attitude,
    apart_deg,
    attitude_from,
    cross_product,
    east_north,
    radec_deg,
    unit,
    unit_vectors,
)
from kochab.core.camera import Camera
from kochab.core.solution import Solution

ra = st.floats(0, 360, exclude_max=True)
dec = st.floats(-89.9, 89.9)
roll = st.floats(-180, 180, exclude_min=True)


def angle_between_deg(a, b):
    return abs((a - b + 180.0) % 360.0 - 180.0)


@given(ra, dec, roll)
@example(0.0, 0.0, 180.0)
def test_ra_dec_roll_come_back(ra, dec, roll):
    attitude = attitude_from(ra, dec, roll)
    assert np.allclose(attitude.matrix @ attitude.matrix.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(attitude.matrix) == pytest.approx(1.0)
    found_ra, found_dec, found_roll = attitude.euler_deg
    assert 0 <= found_ra < 360
    assert -180 < found_roll <= 180
    assert angle_between_deg(found_ra, ra) < 1e-9
    assert found_dec == pytest.approx(dec, abs=1e-9)
    assert angle_between_deg(found_roll, roll) < 1e-9


@given(st.floats(-1e-12, 1e-12), dec)
@example(-1e-20, 0.0)
def test_right_ascension_stays_below_a_full_turn(ra, dec):
    found, _ = radec_deg(unit_vectors(ra, dec))
    assert 0 <= found < 360


@pytest.mark.parametrize("apart", [0.0, 1e-9, 0.2 / 3600.0, 30.0, 179.999999, 180.0])
def test_places_are_as_far_apart_as_they_were_put(apart):
    start = 80.0, -20.0
    assert apart_deg(start, (80.0, -20.0 + apart)) == pytest.approx(apart, abs=1e-13)
    assert apart_deg((0.0, 0.0), (-apart, 0.0)) == pytest.approx(apart, abs=1e-13)


@given(st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 0.1))
@example([0.0, 1.0, 0.0, 0.0])
@example([1e-9, 0.0, -0.6, 0.8])
@example([1.0, 0.0, 0.0, 1e-12])
def test_quaternion_is_scipys(components):
    """At half a turn, too, where a formula by the trace alone loses half the digits."""
    rotation = Rotation.from_quat([*components[1:], components[0]])
    ours = np.array(Attitude(rotation.as_matrix()).quaternion)
    theirs = np.roll(rotation.as_quat(), 1)  # scipy before 1.14 has the scalar last alone
    assert ours[0] >= 0
    assert min(np.abs(ours - theirs).max(), np.abs(ours + theirs).max()) < 1e-14


@given(ra, dec, roll)
def test_quaternion_turns_icrs_to_the_camera_by_hamiltons_product(ra, dec, roll):
    attitude = attitude_from(ra, dec, roll)
    w, *xyz = attitude.quaternion
    assert w >= 0
    q = np.array(xyz)
    assert w * w + q @ q == pytest.approx(1.0)
    for v in np.eye(3):
        turned = (w * w - q @ q) * v + 2 * (q @ v) * q + 2 * w * np.cross(q, v)
        assert np.allclose(turned, attitude.matrix @ v, atol=1e-12)


@given(ra, dec, roll)
def test_euler_angles_are_turns_about_z_y_x(ra, dec, roll):
    axes = Rotation.from_euler("ZYX", [ra, -dec, -roll], degrees=True).as_matrix().T
    boresight, left, up = axes
    found = attitude_from(ra, dec, roll).matrix
    assert np.allclose(found, [-left, -up, boresight], atol=1e-12)


def tangent_plane(ra, dec, position_angle, scale_deg, mirrored, width, height):
    """A FITS header's WCS whose up (towards row 0) has the position angle, and east as told."""
    p = np.radians(position_angle)
    right = p + (np.pi / 2 if mirrored else -np.pi / 2)
    wcs = WCS(naxis=2)
    wcs.wcs.ctype = ["RA---TAN", "DEC--TAN"]
    wcs.wcs.crval = [ra, dec]
    wcs.wcs.crpix = [(width + 1) / 2, (height + 1) / 2]
    wcs.wcs.cd = scale_deg * np.array([[np.sin(right), -np.sin(p)], [np.cos(right), -np.cos(p)]])
    return wcs


@given(ra, dec, roll, st.booleans())
@example(83.8, -5.4, 0.0, False)
@example(83.8, -5.4, 0.0, True)
def test_every_pixel_agrees_with_astropy(ra, dec, roll, mirrored):
    width, height, scale_deg = 600, 400, 0.05
    wcs = tangent_plane(ra, dec, roll, scale_deg, mirrored, width, height)
    camera = Camera.centred(width, height, 1 / np.radians(scale_deg), mirrored)
    solution = Solution(camera, attitude_from(ra, dec, roll), (), 0.0, -20.0, "test")
    pixels = np.array([[0, 0], [599, 0], [0, 399], [599, 399], [299.5, 199.5], [40, 330.0]])
    expected = unit_vectors(*wcs.wcs_pix2world(pixels, 0).T)
    assert np.allclose(solution.sky_at(pixels), expected, atol=1e-10)
    assert np.allclose(solution.pixels_of(expected), pixels, atol=1e-6)
    assert angle_between_deg(solution.roll_deg, roll) < 1e-9


@given(ra, st.floats(-70, 70), roll, st.booleans())
def test_roll_is_measured_at_the_frames_middle(ra, dec, roll, mirrored):
    """With the principal point far off the middle, by a small step up on the sky itself."""
    camera = Camera(600, 400, 1200.0, 150.0, 320.0, mirrored=mirrored)
    solution = Solution(camera, attitude_from(ra, dec, roll), (), 0.0, -20.0, "test")
    middle = np.array([299.5, 199.5])
    here, above = (radec_deg(v) for v in solution.sky_at(np.array([middle, middle - [0, 0.002]])))
    east = (above[0] - here[0] + 180) % 360 - 180
    angle = np.degrees(np.arctan2(east * np.cos(np.radians(here[1])), above[1] - here[1]))
    assert solution.ra_dec_deg == pytest.approx(here)
    assert angle_between_deg(angle, solution.roll_deg) < 0.01


def test_sigma_names_the_axis_that_moves_the_boresight():
    arcsec = np.radians(1 / 3600)
    attitude = Attitude(np.eye(3), np.diag([1.0, 4.0, 100.0]) * arcsec**2)
    assert attitude.sigma_arcsec == pytest.approx((2.0, 1.0, 10.0))
    assert np.isnan(Attitude(np.eye(3)).sigma_arcsec).all()


@pytest.mark.parametrize("dec", [-90.0, -30.0, 0.0, 80.0, 90.0])
def test_east_and_north_stand_on_a_direction_and_on_each_other(dec) -> None:
    direction = unit_vectors(200.0, dec)
    east, north = east_north(direction)
    np.testing.assert_allclose(np.cross(east, north), direction, atol=1e-12)
    assert abs(east[2]) < 1e-12
    nearer = unit(direction + 1e-3 * north)
    assert abs(dec) == 90.0 or nearer[2] > direction[2]
    assert np.linalg.norm(nearer) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("a", "b"), [((3,), (3,)), ((7, 3), (3,)), ((3,), (7, 3)), ((5, 1, 3), (4, 3)), ((0, 3), (3,))]
)
def test_cross_products_are_those_of_numpy_to_the_last_bit(a, b):
    rng = np.random.default_rng(4)
    a, b = rng.normal(size=a), rng.normal(size=b)
    assert np.array_equal(cross_product(a, b), np.cross(a, b))
    assert cross_product(a.astype(np.float32), b.astype(np.float32)).dtype == np.float32
