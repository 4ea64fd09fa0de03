"""The parts of the detector against slow and plain versions of themselves."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import convolve

from kochab.detection.background import Halving, Smoother, halving, measure_mesh
from kochab.detection.peaks import PreparedFrame, apart, close_pairs, cut, find_peaks
from kochab.detection.star_fit import adaptive_moments, fit_stars, principal_axes, refit_bright, star_image, unweighted
from kochab.simulate.star_images import RenderedStar, add_stars

BINOMIAL = np.outer([1, 2, 1], [1, 2, 1])


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.int32, np.float64])
@pytest.mark.parametrize("bayer", [None, "RGGB", "GRBG"])
@pytest.mark.parametrize("top", [120, 250])
def test_smoothing_is_the_sum_of_four_under_a_binomial(dtype, bayer, top):
    scale = 257 if dtype == np.uint16 else 1  # 250 * 257 overflows a sum of two in 16 bits
    pixels = (np.random.default_rng(0).integers(0, top, (24, 37)) * scale).astype(dtype)
    whole = pixels[:, :36].astype(float).reshape(12, 2, 18, 2)
    use = {None: np.ones((2, 2)), "RGGB": np.eye(2)[::-1], "GRBG": np.eye(2)}[bayer]
    sums = np.einsum("aibj,ij->ab", whole, use)
    smoother = Smoother(halving(bayer))
    np.testing.assert_allclose(
        smoother(pixels, (2, 2, 2)), convolve(np.pad(sums, 2, mode="edge"), BINOMIAL)[1:-1, 1:-1]
    )
    np.testing.assert_allclose(smoother(pixels, (0, 0, 0)), convolve(sums, BINOMIAL)[1:-1, 1:-1])


def test_gains_of_the_smoothing_are_as_said():
    noise = np.random.default_rng(1).normal(0, 1, (400, 400)).astype(np.float32)
    for how in (Halving(), Halving(0), Halving(1)):
        smoother = Smoother(how)
        assert smoother(noise, (0, 0, 0)).std() == pytest.approx(how.noise_gain, rel=0.03)
        assert smoother(np.ones((8, 8), np.float32), (0, 0, 0)).mean() == pytest.approx(how.gain)


@pytest.mark.parametrize("slope", [0.0, 0.5, 3.0])
@pytest.mark.parametrize("shape", [(300, 500), (1100, 900)])
def test_the_mesh_finds_level_and_noise_on_a_slope(slope, shape):
    rng = np.random.default_rng(2)
    plane = 1000 + slope * np.arange(shape[1]) + 0.5 * slope * np.arange(shape[0])[:, None]
    pixels = rng.normal(plane, 20).astype(np.float32)
    mesh = measure_mesh(pixels, Halving())
    x, y = rng.uniform(0, shape[1] - 1, 200), rng.uniform(0, shape[0] - 1, 200)
    level, noise = mesh.at(x, y)
    truth = 1000 + slope * x + 0.5 * slope * y
    assert np.abs(level - truth).max() < 12
    assert np.median(noise) == pytest.approx(20, rel=0.12)


def test_peaks_are_the_local_maxima_and_none_is_lost_between_strips():
    light = np.full((1000, 300), 100.0, dtype=np.float32)
    light += np.random.default_rng(3).normal(0, 1, light.shape).astype(np.float32)
    y = np.arange(10, 990, 7)
    xy = np.stack([20 + (y * 37) % 260, y], axis=1).astype(float)
    add_stars(light, xy, np.full(len(xy), 800.0), RenderedStar(3.0))
    mesh = measure_mesh(light, Halving())
    found = find_peaks(light, Halving(), mesh, 8.0, 10_000)
    away = np.hypot(*(xy[:, None] - found).transpose(2, 0, 1)).min(axis=1)
    assert away.max() < 2.0
    few = find_peaks(light, Halving(), mesh, 8.0, 5)
    np.testing.assert_array_equal(few, found[:5])


def _stamps(image, offsets, flux=1000.0, half=8, how=None):
    light = np.zeros((60, 60 * len(offsets)), dtype=np.float32)
    xy = np.array([[60 * k + 30 + dx, 30 + dy] for k, (dx, dy) in enumerate(offsets)])
    add_stars(light, xy, np.full(len(xy), flux), image)
    return cut(light, how or Halving(), np.rint(xy - 0.3), np.zeros(len(xy)), half), xy


OFFSETS = [(0.0, 0.0), (0.3, -0.2), (0.5, 0.5), (-0.45, 0.1)]


@pytest.mark.parametrize("how", [Halving(), Halving(1)])
@pytest.mark.parametrize("fwhm", [1.6, 3.0, 5.0])
def test_a_fit_of_the_right_image_is_exact(fwhm, how):
    stamps, xy = _stamps(RenderedStar(fwhm), OFFSETS, half=10, how=how)
    covariance = np.eye(2) * (fwhm / 2.3548) ** 2
    fit = fit_stars(stamps, covariance, 8)
    np.testing.assert_allclose(stamps.x + fit.dx, xy[:, 0], atol=0.01)
    np.testing.assert_allclose(stamps.y + fit.dy, xy[:, 1], atol=0.01)
    np.testing.assert_allclose(fit.flux, 1000, rtol=0.02)
    before = fit.flux.copy()
    refit_bright(stamps, fit, covariance, np.full(len(xy), 10.0))
    np.testing.assert_allclose(stamps.x + fit.dx, xy[:, 0], atol=0.01)
    np.testing.assert_allclose(fit.flux, before, rtol=0.02)


def test_a_turned_image_is_fitted_and_measured():
    stamps, xy = _stamps(RenderedStar(3.0, trail_px=(8.0, 6.0)), OFFSETS, half=14)
    shapes = adaptive_moments(stamps, 1.5, 20)
    assert shapes.good.all()
    major, minor, angle = shapes.axes()
    np.testing.assert_allclose(np.degrees(angle), np.degrees(np.arctan2(6, 8)), atol=0.5)
    np.testing.assert_allclose(minor, np.hypot(3.0 / 2.3548, 12**-0.5), rtol=0.06)
    np.testing.assert_allclose(stamps.x + shapes.dx, xy[:, 0], atol=0.02)
    covariance = np.array([[shapes.xx[0], shapes.xy[0]], [shapes.xy[0], shapes.yy[0]]])
    fit = fit_stars(stamps, covariance, 6)
    np.testing.assert_allclose(stamps.y + fit.dy, xy[:, 1], atol=0.03)
    recovered = principal_axes(*unweighted(fit.moments, covariance).T)
    np.testing.assert_allclose(recovered[2], angle, atol=0.02)
    np.testing.assert_allclose(recovered[0], major, rtol=0.1)


def test_the_star_image_is_not_that_of_a_drawn_line():
    light = np.random.default_rng(4).normal(100, 2, (300, 400)).astype(np.float32)
    rng = np.random.default_rng(5)
    xy = rng.uniform(20, [380, 280], (40, 2))
    add_stars(light, xy, rng.uniform(1500, 3000, 40), RenderedStar(3.0))
    light[100:102, 50:350] += 400
    light[50:250, 200:202] += 400
    mesh = measure_mesh(light, Halving())
    peaks = find_peaks(light, Halving(), mesh, 5.0, 1000)
    covariance, _ = star_image(PreparedFrame(light, Halving(), mesh), peaks, np.inf)
    assert covariance[0, 1] == pytest.approx(0, abs=1e-3)
    assert np.sqrt(covariance[0, 0]) * 2.3548 == pytest.approx(3.0, rel=0.2)


@settings(max_examples=30)
@given(n=st.integers(0, 60), seed=st.integers(0, 999), radius=st.floats(0.5, 30.0))
def test_close_pairs_are_all_the_close_pairs(n, seed, radius):
    xy = np.random.default_rng(seed).uniform(0, 100, (n, 2))
    found = set(zip(*(part.tolist() for part in close_pairs(xy, radius)), strict=True))
    away = np.hypot(*(xy[:, None] - xy).transpose(2, 0, 1)) if n else np.empty((0, 0))
    i, j = np.nonzero(np.triu(away <= radius, 1))
    assert found == set(zip(i.tolist(), j.tolist(), strict=True))


@settings(max_examples=30)
@given(n=st.integers(0, 60), seed=st.integers(0, 999))
def test_what_is_kept_is_apart_and_what_is_not_is_near_a_brighter_one(n, seed):
    rng = np.random.default_rng(seed)
    xy, reach = rng.uniform(0, 60, (n, 2)), rng.uniform(1, 8, n)
    keep = apart(xy, reach)
    for k in range(n):
        kept = np.flatnonzero(keep[:k])
        near = (np.hypot(*(xy[kept] - xy[k]).T) <= reach[kept]).any()
        assert keep[k] == (not near)


def _ellipses(moments):
    """A frame of Gaussians with these second moments (xx, yy, xy), px^2, each alone, and their places."""
    light = np.zeros((60, 60 * len(moments)))
    v, u = np.mgrid[-30:30, -30:30]
    for k, (xx, yy, xy) in enumerate(moments):
        det = xx * yy - xy * xy
        power = (yy * u * u - 2.0 * xy * u * v + xx * v * v) / det
        light[:, 60 * k : 60 * k + 60] = 5000.0 * np.exp(-0.5 * power)
    noisy = light + np.random.default_rng(5).normal(100.0, 2.0, light.shape)
    return noisy.astype(np.float32), np.array([[60.0 * k + 30.0, 30.0] for k in range(len(moments))])


def test_shapes_whose_medians_are_no_shape_make_the_usual_star():
    """Half of them upright, half lying, all leaning one way: medians of 1.5 by 1.5 that lean by 3.9 px^2."""
    light, xy = _ellipses([(1.5, 12.0, -3.9), (12.0, 1.5, -3.9), (2.0, 2.0, 0.0)] * 4)
    how = Halving()
    view = PreparedFrame(light, how, measure_mesh(light, how))
    covariance, _ = star_image(view, xy, np.inf)
    assert np.linalg.eigvalsh(covariance).min() > 0.3
    assert covariance.trace() < 2.0 * 5.0**2


@pytest.mark.parametrize("covariance", [np.diag([1.5, 2.0]), np.array([[4.0, 1.5], [1.5, 3.0]])])
@pytest.mark.parametrize("height", [1e-30, 1.0, 1e14, 3e38])
def test_whatever_light_a_stamp_holds_its_fit_is_a_number(covariance, height):
    light = np.zeros((60, 180), dtype=np.float32)
    light[28:33, 28:33] = height
    light[30, 90] = -height
    light[20:40:2, 140:160] = height
    xy = np.array([[30.0, 30.0], [90.0, 30.0], [150.0, 30.0]])
    stamps = cut(light, Halving(), xy, np.zeros(3), 8)
    fits = fit_stars(stamps, covariance)
    refit_bright(stamps, fits, covariance, np.ones(3))
    shapes = adaptive_moments(stamps, 1.5)
    assert all(np.isfinite(column).all() for column in (fits.dx, fits.dy, fits.flux, fits.snr, fits.moments))
    good = shapes.good
    assert all(np.isfinite(column[good]).all() for column in (shapes.dx, shapes.dy, shapes.xx, shapes.yy, shapes.xy))
    assert (shapes.xx * shapes.yy > shapes.xy**2)[good].all()
