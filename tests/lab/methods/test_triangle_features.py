import numpy as np
import pytest

from kochab.lab.methods.spherical_triangles import area, area_sigma, field, polar_moment, sides


@pytest.fixture(scope="module")
def triangles():
    """Random triangles of a few degrees."""
    rng = np.random.default_rng(3)
    v = np.array([0.3, -0.5, 0.8]) + rng.normal(0, 0.03, (200, 3, 3))
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def test_an_octant_is_an_eighth_of_the_sphere():
    assert area(np.eye(3)) == pytest.approx(np.pi / 2)
    assert sides(np.eye(3)) == pytest.approx([np.pi / 2] * 3)


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def polar_moment_recursive(corners, level):
    """Equation 2.35 over ``4 ** level`` smaller triangles, each of which counts as a point."""
    centre = unit(corners.sum(axis=-2))
    parts = corners[..., None, :, :]
    for _ in range(level):
        middle = unit(parts + np.roll(parts, -1, axis=-2))
        outer = np.stack([parts, middle, np.roll(middle, 1, axis=-2)], axis=-2)
        flat = np.concatenate([outer, middle[..., None, :, :]], axis=-3)
        parts = flat.reshape(*corners.shape[:-2], -1, 3, 3)
    off = np.linalg.norm(unit(parts.sum(axis=-2)) - centre[..., None, :], axis=-1)
    theta = 2.0 * np.arcsin(np.minimum(off / 2.0, 1.0))
    return (theta * theta * area(parts)).sum(axis=-1)


@pytest.mark.parametrize("level", [1, 2, 3, 4])
def test_recursion_falls_short_of_the_closed_form_by_a_part_in_four_to_the_level(triangles, level):
    ratio = polar_moment_recursive(triangles, level) / polar_moment(triangles)
    assert ratio == pytest.approx(1.0 - 4.0**-level, abs=3e-3 * 4.0**-level)


def test_the_sigma_of_the_area_is_the_slope_of_its_sides(triangles):
    side = sides(triangles)
    moved = side[:, None] + 1e-7 * np.eye(3) - np.zeros((1, 3, 3))

    def size(a):
        s = a.sum(axis=-1) / 2
        t = np.tan(s / 2) * np.tan((s[..., None] - a) / 2).prod(axis=-1)
        return 4 * np.arctan(np.sqrt(t))

    slope = (size(moved) - size(side)[:, None]) / 1e-7
    wide = area(triangles) > 1e-4
    expected = np.sqrt(2.0) * np.linalg.norm(slope, axis=1)
    assert area_sigma(triangles, 1.0)[wide] == pytest.approx(expected[wide], rel=1e-2)


def test_the_field_is_the_smallest_circle():
    flat = np.array([[0.0, 0, 1], [0.01, 0, 1], [0.02, 0.001, 1]])  # obtuse: its longest side
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    assert field(flat) == pytest.approx(sides(flat).max())
    even = np.array([[0.02 * np.cos(t), 0.02 * np.sin(t), 1] for t in (0, 2.0944, 4.1888)])
    even /= np.linalg.norm(even, axis=1, keepdims=True)
    assert field(even) == pytest.approx(2 * np.arctan(0.02), rel=1e-4)
