"""What a window shows: round stars of known place, light and width on a known background."""

import numpy as np
import pytest

from kochab.core.frame import Frame
from kochab.detection.windows import look

H, W, LEVEL, NOISE, SIGMA = 240, 320, 400.0, 6.0, 1.3
IMAGE = np.eye(2) * SIGMA**2


def sky(places, peaks, seed=5, sigma=(SIGMA, SIGMA), noise=NOISE):
    """Gaussian stars on noise; ``peaks`` in the units of the frame."""
    y, x = np.mgrid[:H, :W]
    pixels = np.random.default_rng(seed).normal(LEVEL, noise, (H, W))
    for (cx, cy), peak in zip(places, peaks, strict=True):
        pixels += peak * np.exp(-0.5 * (((x - cx) / sigma[0]) ** 2 + ((y - cy) / sigma[1]) ** 2))
    return pixels


def frame(pixels, saturation=65535.0):
    return Frame(np.clip(pixels, 0, 65535).astype(np.float32), saturation=saturation)


GRID = np.array([(x + 0.3, y - 0.2) for y in range(30, 220, 40) for x in range(30, 300, 40)])


def test_stars_are_found_where_they_are_with_an_error_that_is_their_scatter() -> None:
    seen = look(frame(sky(GRID, [300.0] * len(GRID))), GRID + 2.0, 9, IMAGE)
    assert seen.found.all()
    off = (seen.xy - GRID) / seen.sigma_px[:, None]
    assert 0.5 < np.sqrt(np.mean(off**2)) < 1.5
    np.testing.assert_allclose(seen.sigma_px, np.hypot(0.03, 1.2 * SIGMA / seen.snr))


def test_the_signal_to_noise_is_that_of_a_matched_filter() -> None:
    """A Gaussian's light over the noise in its own shape: peak over noise, times its width and root pi."""
    for peak in (100.0, 400.0):
        seen = look(frame(sky(GRID, [peak] * len(GRID))), GRID, 9, IMAGE)
        expected = peak / NOISE * SIGMA * np.sqrt(np.pi)
        assert 0.8 < np.median(seen.snr) / expected < 1.05
    twice = look(frame(sky(GRID, [400.0] * len(GRID), noise=2.0 * NOISE)), GRID, 9, IMAGE)
    assert np.median(twice.snr) == pytest.approx(0.5 * np.median(seen.snr), rel=0.1)


def test_faint_stars_are_found_from_five_sigmas_on() -> None:
    peaks = np.linspace(4.0, 30.0, len(GRID))
    seen = look(frame(sky(GRID, peaks)), GRID, 6, IMAGE)
    assert not seen.found[seen.snr <= 5.0].any()
    near = np.hypot(*(seen.xy - GRID).T) < 1.0
    assert seen.found[near & (seen.snr > 6.5)].mean() > 0.9
    assert seen.found[-8:].all()


def test_a_star_is_found_only_within_its_window() -> None:
    star = GRID[:1]
    pixels = frame(sky(star, [500.0]))
    for away, inside in ((7.0, True), (9.5, False)):
        for direction in ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)):
            seen = look(pixels, star + away * np.array(direction), 8, IMAGE)
            assert bool(seen.found[0]) is inside


def test_one_star_is_one_find_however_many_windows_hold_it() -> None:
    places = np.array([[100.0, 100.0], [103.0, 101.0], [98.0, 97.0], [200.0, 150.0]])
    pixels = frame(sky(np.array([[100.4, 99.8], [200.0, 150.0]]), [500.0, 500.0]))
    assert look(pixels, places, 9, IMAGE).found.tolist() == [True, False, False, True]


@pytest.mark.parametrize(("peak", "clipped"), [(0.97, False), (1.2, True)])
def test_a_clipped_star_is_less_sure(peak, clipped) -> None:
    """From 98 % of the full scale on: four tenths of a pixel, however bright."""
    pixels = sky(GRID[:6], [peak * 10000.0 - LEVEL] * 6)
    seen = look(frame(np.minimum(pixels, 10000.0), saturation=10000.0 if clipped else 11000.0), GRID[:6], 9, IMAGE)
    assert seen.found.all()
    assert (seen.sigma_px >= 0.4).all() == clipped
    assert (seen.sigma_px < 0.1).all() != clipped


def test_hot_pixels_are_no_stars_unless_stars_are_that_sharp() -> None:
    pixels = sky(np.zeros((0, 2)), [])
    for x, y in GRID[:10].round().astype(int):
        pixels[y, x] += 400.0
    assert not look(frame(pixels), GRID[:10], 9, IMAGE).found.any()
    sharp = look(frame(pixels), GRID[:10], 9, np.eye(2) * 0.27, sharp=True)
    assert sharp.found.all()


@pytest.mark.parametrize("sigma", [(1.3, 1.3), (1.6, 1.2)])
def test_the_moments_of_the_usual_star_are_measured(sigma) -> None:
    """Its own variance, with a twelfth of a pixel for the pixels' size."""
    seen = look(frame(sky(GRID, [600.0] * len(GRID), sigma=sigma)), GRID, 9, IMAGE)
    xx, yy, xy = seen.moments
    assert (xx, yy) == (pytest.approx(sigma[0] ** 2, rel=0.15), pytest.approx(sigma[1] ** 2, rel=0.15))
    assert xy == pytest.approx(0.0, abs=0.1)
    few = look(frame(sky(GRID[:2], [600.0] * 2)), GRID[:2], 9, IMAGE)
    assert np.isnan(few.moments).all()


def test_a_smeared_image_is_measured_and_an_expected_one_is_kept() -> None:
    """Stars drawn out to twice their variance are another image; a sixth wider they are not."""
    for wide, changed in ((2.6, True), (1.5, False)):
        pixels = frame(sky(GRID, [600.0] * len(GRID), sigma=(wide, SIGMA)))
        plain, adapted = (look(pixels, GRID, 12, IMAGE, adapt=adapt) for adapt in (False, True))
        assert np.allclose(plain.snr, adapted.snr) is not changed
        assert np.hypot(*(adapted.xy - GRID).T)[adapted.found].max() < 0.5


def test_a_gradient_under_the_stars_is_each_windows_own_background() -> None:
    slope = 2.0 * np.arange(W)[None, :]
    flat = look(frame(sky(GRID, [300.0] * len(GRID))), GRID, 9, IMAGE)
    tilted = look(frame(sky(GRID, [300.0] * len(GRID)) + slope), GRID, 9, IMAGE)
    assert tilted.found.mean() > 0.9
    assert np.median(tilted.snr) < np.median(flat.snr)  # the slope counts as noise
    assert np.hypot(*(tilted.xy - GRID).T)[tilted.found].max() < 0.6


def test_a_window_that_leaves_the_frame_has_the_background_of_what_is_in_it() -> None:
    places = np.array([[5.3, 4.8], [160.2, 120.1], [3.0, 200.0], [W - 4.6, H - 5.2]])
    seen = look(frame(sky(places, [300.0] * 4)), places, 16, IMAGE)
    assert seen.found.all()
    np.testing.assert_allclose(seen.snr, seen.snr[1], rtol=0.25)
    np.testing.assert_allclose(seen.xy, places, atol=0.15)


@pytest.mark.parametrize("brightest", [-3, 0, 3])
def test_the_middle_of_a_trail_is_found_wherever_along_it_its_brightest_pixel_is(brightest) -> None:
    """Fifteen pixels long: three pixels from the middle are less than one and a half of its RMS."""
    places, pixels = GRID[::3], sky([], [])
    y, x = np.mgrid[:H, :W]
    for cx, cy in places:
        pixels += 300.0 * np.exp(-0.5 * ((y - cy) / SIGMA) ** 2) * (np.abs(x - cx) <= 7)
        pixels[round(cy), round(cx) + brightest] += 120.0
    seen = look(frame(pixels), places, 15, np.diag([15.0**2 / 12.0, SIGMA**2]))
    assert seen.found.all()
    np.testing.assert_allclose(seen.xy, places, atol=0.6)
