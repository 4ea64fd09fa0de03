"""Centroids in 10.22 fixed point against floating point, as in Tables 4.14 to 4.16."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kochab.core.frame import Frame
from kochab.detection import DETECTORS
from kochab.lab.detectors.regions import LIGHT, FixedMean, FloatMean
from kochab.lab.fixed_point import FixedPointOverflowError

PLACES = [(229.1, 84.6), (50.2, 63.6), (139.9, 89.0), (197.3, 15.9), (292.3, 272.9)]


def video_frame() -> Frame:
    """A black frame of the thesis' size with five stars of 8 bits."""
    y, x = np.mgrid[:319, :427]
    light = np.zeros(x.shape)
    for k, (at_x, at_y) in enumerate(PLACES):
        spread = (3.0 - 0.3 * k) ** 2
        light += 400.0 * np.exp(-((x - at_x) ** 2 + (y - at_y) ** 2) / 2.0 / spread)
    return Frame(np.minimum(light, 255.0).astype(np.uint8))


def test_centroids_agree_to_the_thesis_figure() -> None:
    frame = video_frame()
    floating = DETECTORS.make("clusters", threshold=51.0).detect(frame)
    fixed = DETECTORS.make("clusters", threshold=51.0, arithmetic="fixed").detect(frame)
    assert len(floating) == len(fixed) == len(PLACES)
    off = np.abs(floating.xy - fixed.xy)
    assert 0.0 < off.max() <= 0.00006
    np.testing.assert_allclose(floating.xy, PLACES, atol=0.05)


def test_a_frame_too_wide_for_the_format_is_refused() -> None:
    pixels = np.zeros((32, 1200), dtype=np.uint8)
    pixels[10:16, 1180:1186] = 200
    with pytest.raises(FixedPointOverflowError, match=r"10\.22"):
        DETECTORS.make("clusters", threshold=51.0, arithmetic="fixed").detect(Frame(pixels))


@given(st.lists(st.tuples(st.floats(-255, 255), st.floats(-255, 255), st.integers(1, 65535)), min_size=1, max_size=60))
def test_running_centres_agree_to_one_bit_a_pixel(pixels) -> None:
    fixed, floating = FixedMean(*pixels[0]), FloatMean(*pixels[0])
    for pixel in pixels[1:]:
        fixed.add(*pixel)
        floating.add(*pixel)
    off = np.abs(np.subtract(fixed.place, floating.place))
    assert off.max() <= (2 * len(pixels) + 1) * 2.0**-22


def test_light_that_overflows_is_noticed() -> None:
    mean = FixedMean(0.0, 0.0, 2.0**30)
    with pytest.raises(FixedPointOverflowError):
        mean.add(1.0, 1.0, 2.0**30)
    assert mean.light <= LIGHT.high
