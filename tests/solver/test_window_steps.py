"""The steps within a window: its peak, the stamp about it, its noise, and which finds are clipped."""

import numpy as np
import pytest

from kochab.core.frame import Frame
from kochab.detection import windows
from kochab.detection.windows import look
from kochab.solver import track_windows
from kochab.solver.track_windows import match

from .test_track_look import GRID, IMAGE, SIGMA, sky
from .test_window_limits import CAMERA, field, seen_at


def frame(pixels):
    return Frame(pixels.astype(np.float32), saturation=65535.0)


@pytest.fixture
def cuts(monkeypatch):
    """Where stamps are cut, and how far they reach."""
    made, cut = [], windows.cut
    monkeypatch.setattr(
        windows,
        "cut",
        lambda pixels, how, xy, level, half: made.append((xy, half)) or cut(pixels, how, xy, level, half),
    )
    return made


@pytest.mark.parametrize("half", [6, 9])
def test_the_stamp_lies_about_the_star_wherever_in_its_window(cuts, half) -> None:
    for away in ((4.0, -3.0), (-4.0, 3.0), (0.0, 0.0)):
        look(frame(sky(GRID, [2000.0] * len(GRID), noise=1.0)), GRID + away, half, IMAGE)
        np.testing.assert_array_equal(cuts[-1][0], GRID.round())


def test_smoothing_is_that_of_the_binomial_coefficients() -> None:
    delta = np.zeros((1, 5, 5), np.float32)
    delta[0, 2, 2] = 16.0
    np.testing.assert_array_equal(windows._smoothed(delta)[0], np.outer([1, 2, 1], [1, 2, 1]))


@pytest.mark.parametrize(("wide", "reach"), [(0.6, 4), (1.3, 5), (1.59, 5), (1.61, 6), (3.1, 9), (5.9, 16), (6.9, 16)])
def test_a_stamp_reaches_two_and_a_half_widths_and_a_pixel_from_four_to_sixteen(cuts, wide, reach) -> None:
    look(frame(sky([], [])), GRID, 9, np.diag([wide**2, 1.0]))
    assert [half for _, half in cuts] == [9, reach]


def test_a_pixel_in_the_corner_of_the_frame_is_a_peak_though_most_of_its_neighbours_are_missing(cuts) -> None:
    h, w = sky([], []).shape
    for x, y in ((0, 0), (w - 1, 0), (0, h - 1), (w - 1, h - 1), (0, 50), (50, h - 1)):
        pixels = sky([], [], noise=1.0)
        pixels[y, x] += 500.0
        look(frame(pixels), np.array([[x, y]], float), 8, IMAGE)
        np.testing.assert_array_equal(cuts[-1][0], [[x, y]])


def test_a_peak_beside_the_border_counts_as_much_more_as_its_neighbours_are_missing(cuts) -> None:
    """A quarter of them at a side, a third at a corner: the noise of their mean is that much larger, by its root."""
    for brighter, border in ((1.1, True), (1.2, False)):
        pixels = sky([], [], noise=0.1)
        pixels[50, 0] += 500.0
        pixels[50, 8] += brighter * 500.0
        look(frame(pixels), np.array([[4.0, 50.0]]), 6, IMAGE)
        np.testing.assert_array_equal(cuts[-1][0], [[0 if border else 8, 50]])


def test_a_find_that_has_no_shape_does_not_tell_the_image() -> None:
    """Four bright ones are enough, but not when one of them is a hot pixel."""
    for hot, changed in ((False, True), (True, False)):
        pixels = sky(GRID[:4], [3000.0 * (not hot), 3000.0, 3000.0, 3000.0], sigma=(2.6, 2.6))
        x, y = GRID[0].round().astype(int)
        pixels[y, x] += 9000.0 * hot
        plain, adapted = (look(frame(pixels), GRID[:4], 12, IMAGE, adapt=adapt) for adapt in (False, True))
        assert np.allclose(plain.snr, adapted.snr) is not changed


def test_a_window_without_noise_has_a_third_of_a_unit() -> None:
    """So that the rounding of a quiet frame makes no stars."""
    seen = look(frame(sky(GRID, [40.0] * len(GRID), noise=0.0)), GRID, 9, IMAGE)
    assert np.median(seen.snr) == pytest.approx(40.0 / 0.3 * SIGMA * np.sqrt(np.pi), rel=0.02)


def test_the_noise_of_a_window_is_its_lower_quartile_s_below_the_median() -> None:
    """Of normal noise 0.6745 sigmas; what is bright in the window does not matter."""
    scale = []
    for noise in (2.0, 20.0):
        pixels = sky(GRID, [5000.0] * len(GRID), noise=noise)
        scale.append(noise * look(frame(pixels), GRID, 16, IMAGE).snr)
    assert np.median(scale[0]) == pytest.approx(5000.0 * SIGMA * np.sqrt(np.pi), rel=0.06)
    assert np.median(scale[1]) == pytest.approx(np.median(scale[0]), rel=0.03)


def test_an_empty_window_is_no_less_sure_than_one_sigma() -> None:
    seen = look(frame(sky([], [])), GRID, 4, IMAGE)
    assert (seen.snr < 2.0).any()
    np.testing.assert_allclose(seen.sigma_px, np.hypot(0.03, 1.2 * SIGMA / np.maximum(seen.snr, 1.0)))


def test_light_of_ten_times_the_noise_is_allowed_for_where_the_background_was_taken_away() -> None:
    """Then the weights of a bright star's pixels are the same for any level below, and others above."""
    places, pixels = GRID[:6], sky(GRID[:6], [3000.0] * 6, sigma=(1.9, 1.9)) - 400.0
    x, y = np.round(places + np.array([2.0, 1.0])).astype(int).T
    pixels[y, x] += 900.0  # not as a star is, so that the weights matter
    low, middle, high = (look(frame(pixels + level), places, 9, IMAGE).xy for level in (0.0, 40.0, 90.0))
    np.testing.assert_allclose(low, middle, atol=1e-4)
    assert np.abs(high - low).max() > 1e-3


@pytest.mark.parametrize(("peak", "changed"), [(52.0, False), (95.0, True)])
def test_stars_whose_smoothed_peak_is_ten_times_the_noise_tell_the_image(peak, changed) -> None:
    pixels = frame(sky(GRID, [peak] * len(GRID), sigma=(2.6, 2.6)))
    plain, adapted = (look(pixels, GRID, 12, IMAGE, adapt=adapt) for adapt in (False, True))
    assert np.allclose(plain.snr, adapted.snr) is not changed


@pytest.mark.parametrize("brightest", [-6, 6])
def test_the_middle_of_a_smear_nobody_expected_is_found_wherever_its_brightest_pixel_is(brightest) -> None:
    places, pixels = GRID[::3], sky([], [])
    y, x = np.mgrid[: pixels.shape[0], : pixels.shape[1]]
    for cx, cy in places:
        pixels += 300.0 * np.exp(-0.5 * ((y - cy) / SIGMA) ** 2) * (np.abs(x - cx) <= 8)
        pixels[round(cy), round(cx) + brightest] += 150.0
    seen = look(frame(pixels), places, 15, IMAGE, adapt=True)
    assert seen.found.all()
    np.testing.assert_allclose(seen.xy, places, atol=0.6)


# -- Which finds agree -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("off_sigma", "agrees"), [(3.5, True), (3.9, False)])
@pytest.mark.parametrize("unrest", [0.0, 2.0])
def test_a_find_beyond_three_and_seven_tenths_of_its_sigma_is_left_out(off_sigma, agrees, unrest) -> None:
    """Where the others are off by twice their sigmas in the median, of 2.1 times as much."""
    places, vectors = field(60)
    seen = seen_at(places.copy())
    angle = np.linspace(0.0, 40.0 * np.pi, 60, endpoint=False)
    seen.xy[:] += 0.1 * unrest * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    seen.xy[7] = places[7] + [0.1 * off_sigma * max(1.0, 1.05 * unrest), 0.0]
    answer = match(CAMERA, np.eye(3), vectors, places, seen, 16)
    assert (7 in answer.estimate.seen) is agrees
    assert len(answer.estimate.seen) == 59 + agrees


@pytest.mark.parametrize(
    ("apart_px", "roll_px", "together"), [(1.9, 0.0, True), (2.1, 0.0, False), (3.9, 2.0, True), (4.1, 2.0, False)]
)
def test_finds_agree_at_first_when_their_shifts_are_two_pixels_apart(monkeypatch, apart_px, roll_px, together) -> None:
    """And as much more as an error of roll may do."""
    begun, differential = [], track_windows.differential
    monkeypatch.setattr(
        track_windows,
        "differential",
        lambda camera, matrix, xy, *told, **how: (
            begun.append(len(xy)) or differential(camera, matrix, xy, *told, **how)
        ),
    )
    places, vectors = field(12)
    xy = places + np.where(np.arange(12)[:, None] < 4, [apart_px, 0.0], [0.0, 0.0])
    match(CAMERA, np.eye(3), vectors, places, seen_at(xy), 16, roll_px)
    assert begun[0] == (12 if together else 8)
