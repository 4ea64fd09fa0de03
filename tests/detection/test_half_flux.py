"""Half-flux diameters of stars that are made here; ASTAP's own program judges them in `tests/cli/faces`."""

import numpy as np
import pytest

from kochab.detection import half_flux
from kochab.detection.half_flux import NO_STARS, half_flux_stars, levels, median_hfd_px

SKY, NOISE = 1000.0, 10.0


def frame(peaks, sigma=1.8, side=700):
    """Gaussian stars on a grid of 40 px, on a noisy sky, and their places (N, 2), brightest first."""
    pixels = np.random.default_rng(2).normal(SKY, NOISE, (side, side))
    places = [(x + 0.3, y - 0.2) for y in range(40, side - 40, 40) for x in range(40, side - 40, 40)][: len(peaks)]
    y, x = np.mgrid[-15:16, -15:16]
    for (cx, cy), peak in zip(places, peaks, strict=True):
        near = slice(round(cy) - 15, round(cy) + 16), slice(round(cx) - 15, round(cx) + 16)
        away = (x + round(cx) - cx) ** 2 + (y + round(cy) - cy) ** 2
        pixels[near] += peak * np.exp(-0.5 * away / sigma**2)
    return np.clip(pixels, 0.0, 65535.0), np.array(places)


@pytest.mark.parametrize("sigma", [1.5, 2.0, 2.5])
def test_a_gaussian_star_has_two_and_a_half_sigmas(sigma) -> None:
    """Twice its mean distance, sqrt(2 pi) sigma, and its place and light."""
    pixels, places = frame([8000.0] * 30, sigma)
    stars = half_flux_stars(pixels, 10.0)
    assert len(stars) == 30
    assert median_hfd_px(stars) == pytest.approx(np.sqrt(2.0 * np.pi) * sigma, rel=0.04)
    found = np.array([(star.x, star.y) for star in stars])
    assert np.linalg.norm(found[:, None] - places, axis=2).min(axis=1).max() < 0.1
    assert np.median([star.flux for star in stars]) == pytest.approx(2.0 * np.pi * sigma**2 * 8000.0, rel=0.03)


@pytest.mark.parametrize(("enough", "found"), [(25, 30), (65, 70), (500, 110)])
def test_fainter_stars_are_looked_for_only_while_there_are_not_enough(monkeypatch, enough, found) -> None:
    """Thrice: from a thousandth of the pixels, from a quarter of that or 30 times the noise, from seven times."""
    monkeypatch.setattr(half_flux, "ENOUGH_STARS", enough)
    pixels, _ = frame([2600.0] * 30 + [32.0 * NOISE] * 40 + [16.0 * NOISE] * 40)
    sky, noise, bright = levels(pixels)
    assert (sky, noise) == (pytest.approx(SKY, abs=3.0), pytest.approx(NOISE, rel=0.1))
    assert 700.0 < bright < 1290.0  # a quarter of it is above the faint stars, and below those in the middle
    assert len(half_flux_stars(pixels, 5.0)) == found


def test_without_a_star_the_median_is_the_number_that_programs_know() -> None:
    assert half_flux_stars(frame([])[0], 10.0) == []
    assert median_hfd_px([]) == NO_STARS == 99.0
