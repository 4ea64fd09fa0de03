"""Stars of one pixel: the second look of a frame on which nothing else is a star."""

import numpy as np
import pytest

from kochab.core.frame import Frame
from kochab.core.progress import run
from kochab.core.solution import NoSolution, Reason, Solution
from kochab.detection import DETECTORS
from kochab.detection.auto import MOST, QUICK, single_pixels
from kochab.detection.background import halving
from kochab.detection.peaks import cut
from kochab.detection.star_fit import fit_stars
from kochab.solver.pipeline import examine_frame, solve_detections

from .fields import orion


def frame_of(at, flux, shape=(1000, 1600)) -> Frame:
    pixels = np.random.default_rng(7).normal(100.0, 3.0, shape)
    x, y = np.rint(np.asarray(at)).astype(int).T
    pixels[y, x] += flux
    return Frame(np.clip(np.rint(pixels), 0, 65535).astype(np.uint16))


def test_a_sky_of_single_pixels_is_solved() -> None:
    field = orion()
    seen = field.detections.take(slice(0, 60))
    frame = frame_of(seen.xy, np.clip(seen.flux / seen.flux[-1] * 200.0, 200.0, 60_000.0))
    assert len(DETECTORS.make("auto").detect(frame)) < 6
    examined = run(examine_frame(frame))
    assert isinstance(examined.result, Solution)
    assert (
        np.degrees(np.arccos(min(1.0, examined.result.attitude.matrix[2] @ field.attitude.matrix[2]))) * 3600.0 < 30.0
    )
    assert len(examined.detections) == 60
    alone = run(solve_detections(examined.detections))  # the list that was tried first may have been lucky, too
    assert examined.result.log10_false_alarm == pytest.approx(alone.log10_false_alarm + np.log10(2.0))


def test_hot_pixels_of_a_dark_stay_a_closed_cover() -> None:
    rng = np.random.default_rng(3)
    at = np.stack([rng.integers(1, 1599, 500), rng.integers(1, 999, 500)], axis=1)
    result = run(examine_frame(frame_of(at, rng.uniform(200, 60_000, 500)))).result
    assert isinstance(result, NoSolution)
    assert result.reason is Reason.CLOUDED_OR_DARK


@pytest.mark.parametrize("shape", [(4, 4), (40, 60), (1000, 1600)])
def test_places_are_the_pixels_brightest_first(shape) -> None:
    at = [] if shape[0] < 8 else [(20, 10), (50, 30)]
    frame = frame_of(np.array(at).reshape(-1, 2), [900.0, 4000.0][: len(at)], shape)
    found = single_pixels(frame, DETECTORS.make("auto"))
    assert found.xy[: len(at)].tolist() == [[50.0, 30.0], [20.0, 10.0]][: len(at)]
    assert len(found) <= MOST


def test_single_pixels_of_twenty_sigmas_are_found_and_none_of_the_noise_is() -> None:
    """Of pixels of twelve times the noise, a quarter: a peak is looked for in the smoothed frame."""
    at = [(x, y) for x in range(40, 440, 40) for y in range(40, 440, 40)]
    for sigmas, least in ((20.0, 95), (12.0, 15)):
        found = single_pixels(frame_of(at, np.full(100, 3.0 * sigmas)), DETECTORS.make("auto"))
        assert least <= len(found) <= 100
        assert set(map(tuple, found.xy.tolist())) <= set(at)


@pytest.mark.parametrize(("fwhm_px", "expected"), [(0.0, 0.57), (1.2, 0.98), (2.0, 1.59)])
def test_a_sharp_star_is_as_significant_as_its_brightest_pixel_and_a_hot_pixel_much_less(fwhm_px, expected) -> None:
    """Seen through the sharp star image that the quick look has."""
    light = np.zeros((21, 21))
    light[10, 10] = 1.0
    if fwhm_px:  # of its light within each pixel, an eleventh of a pixel at a time
        fine = (np.arange(231) - 115.0) / 11.0
        along = np.exp(-4.0 * np.log(2.0) * fine**2 / fwhm_px**2).reshape(21, 11).mean(axis=1)
        light = np.outer(along, along) / along.max() ** 2
    stamps = cut((1000.0 * light).astype(np.float32), halving(None), np.array([[10.0, 10.0]]), np.zeros(1), 2)
    assert fit_stars(stamps, QUICK, 1).snr[0] / 1000.0 == pytest.approx(expected, abs=0.03)
