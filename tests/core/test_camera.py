"""The camera: a direction becomes a pixel and the same direction again."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kochab.core.attitude import attitude_from
from kochab.core.camera import Camera, FisheyeCamera
from kochab.core.solution import Solution

small = st.floats(-0.01, 0.01)


@st.composite
def cameras(draw, distorted=True):
    """From 1 to 70 degrees wide, off-centre, either parity, distortion up to a few percent."""
    width, height = draw(st.integers(64, 9000)), draw(st.integers(64, 9000))
    fov = np.radians(draw(st.floats(1.0, 70.0)))
    focal = max(width, height) / (2 * np.tan(fov / 2))
    corner2 = (width**2 + height**2) / (4 * focal**2)  # the corner's u^2 + v^2
    k1, k2 = draw(st.floats(-0.06, 0.06)) / corner2, draw(st.floats(-0.01, 0.01)) / corner2**2
    p1, p2 = draw(small) / corner2**0.5, draw(small) / corner2**0.5
    terms = (k1, k2, p1, p2) if distorted else (0.0, 0.0, 0.0, 0.0)
    cx, cy = (width - 1) * draw(st.floats(0.45, 0.55)), (height - 1) * draw(st.floats(0.45, 0.55))
    return Camera(width, height, focal, cx, cy, *terms, mirrored=draw(st.booleans()))


def grid(camera):
    x, y = np.meshgrid(np.linspace(-0.5, camera.width - 0.5, 9), np.linspace(-0.5, camera.height - 0.5, 7))
    return np.column_stack([x.ravel(), y.ravel()])


@given(cameras())
def test_pixels_come_back(camera):
    pixels = grid(camera)
    vectors = camera.unproject(pixels)
    assert np.allclose(np.linalg.norm(vectors, axis=1), 1.0, atol=1e-12)
    assert np.abs(camera.project(vectors) - pixels).max() < 1e-5


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_fisheye_lens_sees_what_stands_behind_it(mirrored):
    """100 deg to the right of the axis and 30 deg below it, from the definition; both ways."""
    lens = FisheyeCamera(2000, 2000, 500.0, 1010.0, 990.0, mirrored=mirrored)
    side, down = np.radians(100.0), np.radians(30.0)
    sky = np.array([[np.sin(side), 0.0, np.cos(side)], [0.0, np.sin(down), np.cos(down)], [0.0, 0.0, 1.0]])
    sign = -1.0 if mirrored else 1.0
    pixels = np.array([[1010.0 + sign * 500.0 * side, 990.0], [1010.0, 990.0 + 500.0 * down], [1010.0, 990.0]])
    assert np.allclose(lens.project(sky), pixels, rtol=0.0, atol=1e-9)
    assert np.allclose(lens.unproject(pixels), sky, rtol=0.0, atol=1e-12)
    assert lens.fov_deg == pytest.approx((np.degrees(4.0), np.degrees(4.0)))
    assert lens.sides_px(lens.focal_px, np.array(lens.fov_deg)) == pytest.approx([2000.0, 2000.0])


@pytest.mark.parametrize("kind", [Camera, FisheyeCamera])
@pytest.mark.parametrize("aspect", [0.5, 1.0, 1.6])
def test_the_field_of_a_resized_image_is_the_angle_between_its_edges(kind, aspect):
    """Twice as many pixels along x to the same angle show half the field, whatever the lens."""
    camera = replace(kind.centred(900, 600, 700.0), aspect=aspect)
    x, y = camera.cx, camera.cy
    edges = camera.unproject(np.array([[-0.5, y], [899.5, y], [x, -0.5], [x, 599.5]]))
    width, height = (np.degrees(np.arccos(edges[k] @ edges[k + 1])) for k in (0, 2))
    assert camera.fov_deg == pytest.approx((width, height))
    along_x, along_y = (camera.unproject(np.array([[x + dx, y + dy]]))[0] for dx, dy in ((0.1, 0.0), (0.0, 0.1)))
    scales = np.degrees([along_x[0] / 0.1, along_y[1] / 0.1]) * 3600.0
    assert camera.scale_arcsec_px == pytest.approx(np.sqrt(scales[0] * scales[1]), rel=1e-6)


def test_nothing_is_drawn_beside_the_circle_of_a_fisheye_lens():
    """Corners of a square frame about the lens's circle lie 127 deg off the axis, where it sees nothing."""
    solution = Solution(
        FisheyeCamera.centred(1000, 1000, 1000 / np.pi), attitude_from(0.0, 0.0, 0.0), (), 0.2, -30.0, ""
    )
    angles = np.radians([0.0, 60.0, 89.0, 100.0, 127.0])
    sky = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(5)])
    assert np.isfinite(solution.pixels_of(sky)[:, 0]).tolist() == [True, True, True, False, False]


def test_a_bent_fisheye_s_pixels_come_back():
    lens = FisheyeCamera(1600, 1600, 480.0, 803.0, 795.0, -0.03, 0.004, 1e-3, -2e-3)
    pixels = grid(lens)
    assert np.abs(lens.project(lens.unproject(pixels)) - pixels).max() < 1e-6


@pytest.mark.parametrize("k1", [-0.12, 0.15])
def test_strong_distortion_is_undone_to_the_corner(k1):
    corner2 = (3000**2 + 2000**2) / 9000**2
    camera = Camera(6000, 4000, 9000.0, 3000.0, 2000.0, k1 / corner2, p1=0.02)
    pixels = grid(camera)
    assert np.abs(camera.project(camera.unproject(pixels)) - pixels).max() < 1e-6


@given(cameras(distorted=False))
def test_without_distortion_it_is_a_tangent_plane(camera):
    """Straight from the definition, with an angle measured off the axis."""
    assert not camera.distorted
    angle = np.radians(0.3)
    right, down = [np.sin(angle), 0, np.cos(angle)], [0, np.sin(angle), np.cos(angle)]
    reach = camera.focal_px * np.tan(angle)
    sign = -1 if camera.mirrored else 1
    expected = [[camera.cx + sign * reach, camera.cy], [camera.cx, camera.cy + reach]]
    assert np.allclose(camera.project(np.array([right, down])), expected, rtol=0, atol=1e-7)


@given(cameras())
def test_mirroring_flips_x_about_the_principal_point(camera):
    from dataclasses import replace

    vectors = camera.unproject(grid(camera))
    here, there = camera.project(vectors), replace(camera, mirrored=not camera.mirrored)
    flipped = there.project(vectors)
    assert np.allclose(flipped[:, 0] + here[:, 0], 2 * camera.cx, atol=1e-6)
    assert np.allclose(flipped[:, 1], here[:, 1], atol=1e-6)


@pytest.mark.parametrize("term", ["k1", "k2", "p1", "p2"])
def test_each_distortion_term_follows_brown_and_conrady(term):
    u, v, amount, focal = 0.3, -0.2, 0.01, 1000.0
    r2 = u * u + v * v
    shift = {
        "k1": (u * r2, v * r2),
        "k2": (u * r2**2, v * r2**2),
        "p1": (2 * u * v, r2 + 2 * v * v),
        "p2": (r2 + 2 * u * u, 2 * u * v),
    }[term]
    camera = Camera(1000, 800, focal, 500.0, 400.0, **{term: amount})
    found = camera.project(np.array([[u, v, 1.0]]))[0]
    expected = np.array([500, 400]) + focal * (np.array([u, v]) + amount * np.array(shift))
    assert np.allclose(found, expected, atol=1e-9)


def test_behind_the_camera_there_is_no_pixel():
    camera = Camera.centred(100, 100, 100.0)
    found = camera.project(np.array([[0, 0, -1.0], [1, 0, 0], [0, 0, 1]]))
    assert np.isnan(found[:2]).all()
    assert np.allclose(found[2], [49.5, 49.5])


def test_field_and_scale():
    camera = Camera.centred(2000, 1000, 1000.0)
    assert camera.fov_deg == pytest.approx((90.0, np.degrees(2 * np.arctan(0.5))))
    assert camera.scale_arcsec_px == pytest.approx(206.264806)
    assert camera.unproject(np.empty((0, 2))).shape == (0, 3)


@pytest.mark.parametrize("k2", [5e-324, 2e-316, -2e-316, 1e-200])
def test_a_distortion_smaller_than_numbers_can_hold_bounds_no_field(k2):
    plain, bent = (Camera(64, 64, 3666.8, 31.5, 31.5, k2=k) for k in (0.0, k2))
    assert bent.reach_rad == plain.reach_rad


@given(cameras(), st.floats(-180, 180), st.floats(-85, 85))
def test_no_direction_far_outside_the_field_lands_in_the_frame(camera, ra, dec):
    """Places up to 72 deg and more from the axis, whatever the distortion does out there."""
    solution = Solution(camera, attitude_from(ra, dec, 20.0), (), 0.2, -30.0, "")
    steps = np.random.default_rng(4).normal(size=(4000, 3))
    sky = steps / np.linalg.norm(steps, axis=1, keepdims=True)
    seen = sky @ solution.attitude.matrix.T
    xy = solution.pixels_of(sky)
    inside = (xy > -0.5).all(axis=1) & (xy < (camera.width - 0.5, camera.height - 0.5)).all(axis=1)
    assert np.abs(camera.unproject(xy[inside]) - seen[inside]).max(initial=0.0) < 1e-9
    pixels = grid(camera)
    assert np.abs(solution.pixels_of(solution.sky_at(pixels)) - pixels).max() < 1e-5  # all of the frame is known


def test_a_fold_inside_the_margin_ends_the_field():
    """The polynomial of a barrel turns at r = sqrt(1 / (3 * 0.2)), 52 deg; 64 deg would come back into the frame."""
    camera = Camera(1000, 1000, 900.0, 499.5, 499.5, k1=-0.2)
    solution = Solution(camera, attitude_from(0.0, 0.0, 0.0), (), 0.2, -30.0, "")
    angles = np.radians([20.0, 51.0, 54.0, 64.0, 72.0, 100.0])
    sky = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(6)])
    assert np.isfinite(solution.pixels_of(sky)[:, 0]).tolist() == [True, True, False, False, False, False]
    inside = np.abs(camera.project(sky @ solution.attitude.matrix.T)[3:5, 0] - 499.5) < 500.0
    assert inside.any()  # the polynomial alone would have it in the frame


@pytest.mark.parametrize("kind", [Camera, FisheyeCamera])
@pytest.mark.parametrize("shift_px", [0.0, 40.0])
def test_the_radius_of_a_field_reaches_the_outer_corner_of_its_farthest_pixel(kind, shift_px):
    """From the middle of the frame, which need not be the principal point."""
    camera = replace(kind.centred(900, 600, 700.0), cx=449.5 + shift_px)
    solution = Solution(camera, attitude_from(10.0, 20.0, 30.0), (), 0.2, -30.0, "")
    middle, *corners = camera.unproject(np.array([[449.5, 299.5], [-0.5, -0.5], [899.5, -0.5], [-0.5, 599.5]]))
    assert solution.radius_rad == pytest.approx(max(np.arccos(middle @ corner) for corner in corners), rel=1e-9)
