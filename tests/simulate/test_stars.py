"""The renderer keeps light, places and widths, and its noise is that of photons."""

import numpy as np
import pytest

from kochab.simulate.star_images import FWHM_PER_SIGMA, RenderedStar, Sensor, Sky, add_stars, render

NOBODY = (np.empty((0, 2)), np.empty(0))


def _moments(light):
    y, x = np.mgrid[: light.shape[0], : light.shape[1]]
    total = light.sum()
    cx, cy = (x * light).sum() / total, (y * light).sum() / total
    dx, dy = x - cx, y - cy
    second = [(a * light).sum() / total for a in (dx * dx, dy * dy, dx * dy)]
    return total, (cx, cy), second


@pytest.mark.parametrize("place", [(40.0, 30.0), (40.37, 29.81), (40.5, 30.5)])
@pytest.mark.parametrize(
    "image",
    [
        RenderedStar(1.2),
        RenderedStar(3.0),
        RenderedStar(5.0),
        RenderedStar(3.0, trail_px=(9.0, -4.0)),
        RenderedStar(2.5, ring_px=(3.0, 6.0)),
        RenderedStar(2.5, ring_px=(2.9, 5.8)),  # its grid has points on the rims
        RenderedStar(2.0, beta=4.5),
    ],
)
def test_light_and_place_are_kept(image, place):
    light = np.zeros((60, 81), dtype=np.float32)
    add_stars(light, np.array([place]), np.array([1000.0]), image)
    total, centre, _ = _moments(light.astype(float))
    assert total == pytest.approx(1000.0, rel=0.01)
    np.testing.assert_allclose(centre, place, atol=0.02)


def test_second_moments_are_those_of_image_pixel_and_trail():
    light = np.zeros((80, 80), dtype=np.float32)
    image = RenderedStar(3.0, trail_px=(12.0, 5.0))
    add_stars(light, np.array([[40.2, 39.9]]), np.array([1e4]), image)
    _, _, (xx, yy, xy) = _moments(light.astype(float))
    core = (3.0 / FWHM_PER_SIGMA) ** 2 + 1 / 12
    assert xx == pytest.approx(core + 144 / 12, rel=0.01)
    assert yy == pytest.approx(core + 25 / 12, rel=0.01)
    assert xy == pytest.approx(60 / 12, rel=0.01)


def test_stars_beyond_the_edge_shed_light_inside_or_none():
    light = np.zeros((50, 50), dtype=np.float32)
    xy = np.array([[-1.0, 25.0], [49.5, 49.5], [-500.0, 10.0], [1e6, 1e6]])
    add_stars(light, xy, np.full(4, 100.0), RenderedStar(3.0))
    assert 0 < light.sum() < 150


def test_noise_is_that_of_light_and_reading():
    for level in (20.0, 400.0, 5000.0):
        sensor = Sensor(gain_e=1.0, read_noise_e=5.0, bias=200.0)
        pixels = render(500, 400, *NOBODY, sky=Sky(level), sensor=sensor).pixels.astype(float)
        assert pixels.mean() == pytest.approx(200.0 + level, abs=0.5)
        assert pixels.std() == pytest.approx(np.sqrt(level + 25), rel=0.02)


def test_gain_divides_light_and_its_noise():
    pixels = render(400, 300, *NOBODY, sky=Sky(9000.0), sensor=Sensor(3.0, 0.0, 0.0)).pixels
    assert pixels.mean() == pytest.approx(3000.0, rel=0.001)
    assert pixels.std() == pytest.approx(np.sqrt(9000.0) / 3.0, rel=0.02)


def test_gradient_runs_from_edge_to_edge():
    pixels = render(300, 200, *NOBODY, sky=Sky(1000.0, (400.0, -200.0))).pixels.astype(float)
    assert pixels[:, -20:].mean() - pixels[:, :20].mean() == pytest.approx(373.0, abs=5.0)
    assert pixels[-20:].mean() - pixels[:20].mean() == pytest.approx(-180.0, abs=5.0)


def test_pixels_clip_at_saturation_and_the_frame_says_so():
    sensor = Sensor(saturation=4095.0)
    frame = render(60, 60, np.array([[30.0, 30.0]]), np.array([1e6]), sensor=sensor)
    assert frame.pixels.max() == 4095
    assert frame.saturation == 4095.0
    assert frame.pixels.dtype == np.uint16


def test_hot_pixels_and_rays_are_as_many_as_asked():
    quiet = render(1000, 1000, *NOBODY, sky=Sky(400.0)).pixels
    assert (quiet > 800).sum() == 0
    hot = render(1000, 1000, *NOBODY, sky=Sky(400.0, hot_per_mp=50.0)).pixels
    assert 40 <= (hot > 800).sum() <= 50
    rays = render(1000, 1000, *NOBODY, sky=Sky(400.0, rays=20)).pixels
    assert 20 <= (rays > 800).sum() <= 20 * 18


def test_a_mosaic_sees_each_colour_through_its_filter():
    sensor = Sensor(bias=0.0, bayer="GBRG", response={"R": 0.5, "G": 1.0, "B": 0.25})
    frame = render(200, 200, *NOBODY, sky=Sky(4000.0), sensor=sensor)
    means = [frame.pixels[i::2, j::2].mean() for i in (0, 1) for j in (0, 1)]
    np.testing.assert_allclose(means, [4000, 1000, 2000, 4000], rtol=0.01)
    assert frame.bayer == "GBRG"


@pytest.mark.parametrize("size", [(1, 1), (3, 700), (301, 257), (513, 2)])
def test_any_size_is_made_and_the_seed_decides(size):
    xy, flux = np.array([[0.5, 0.5]]), np.array([5000.0])
    one, again, other = (render(*size, xy, flux, sky=Sky(400.0, hot_per_mp=100.0), seed=s) for s in (3, 3, 4))
    assert one.pixels.shape == (size[1], size[0])
    np.testing.assert_array_equal(one.pixels, again.pixels)
    assert one.pixels.size < 4 or (one.pixels != other.pixels).any()
