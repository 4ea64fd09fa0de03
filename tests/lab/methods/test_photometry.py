import numpy as np
import pytest

from kochab.lab.methods.photometry import colour_term, sensor_magnitude, temperature_k, vignetted

WAVE = np.arange(350.0, 1050.0, 5.0)


def bell(middle, width):
    return np.exp(-0.5 * ((WAVE - middle) / width) ** 2)


def test_the_sun_is_as_hot_as_it_is():
    assert temperature_k(0.65) == pytest.approx(5780, rel=0.02)


def test_a_visual_sensor_needs_no_correction():
    visual = ((WAVE >= 480) & (WAVE <= 650)).astype(float)
    assert colour_term(WAVE, visual) == pytest.approx(0.0, abs=1e-9)


def test_red_sensors_see_red_stars_brighter_and_blue_ones_fainter():
    red, blue = colour_term(WAVE, bell(800, 80)), colour_term(WAVE, bell(430, 30))
    assert -1.2 < red < -0.4
    assert 0.3 < blue < 1.2
    assert colour_term(WAVE, 7.0 * bell(800, 80)) == pytest.approx(red)


def test_the_blue_filter_term_is_that_of_b_minus_v():
    # A sensor with the response of Johnson B sees V + 1 (B-V), near enough for black bodies.
    assert colour_term(WAVE, bell(440, 40)) == pytest.approx(0.75, abs=0.25)


def test_unknown_colours_count_as_typical():
    got = sensor_magnitude([5.0, 5.0, 5.0], [0.0, 1.0, np.nan], -0.3)
    assert got == pytest.approx([5.0, 4.7, 4.79])


@pytest.mark.parametrize("response", [np.zeros_like(WAVE), np.ones(3)])
def test_a_response_that_is_none_is_refused(response):
    with pytest.raises(ValueError, match="wavelengths"):
        colour_term(WAVE, response)


def test_the_rim_is_dimmer():
    got = vignetted([4.0, 4.0], np.radians([0.0, 15.0]))
    assert got[0] == 4.0
    assert got[1] == pytest.approx(4.0 + 0.151, abs=0.001)
