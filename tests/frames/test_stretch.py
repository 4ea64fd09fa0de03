"""The screen stretch: the sky lands where it should, order is kept, tables equal the formula."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kochab.core.frame import Frame
from kochab.frames.stretch import (
    SKY_LEVEL,
    Stretch,
    apply,
    binned,
    debayer_preview,
    midtones,
    stretch_parameters,
    white_balanced,
)
from tests.frames.files import sky


def test_the_sky_is_shown_at_its_level():
    data = sky(300, 400)
    shown = apply(data, stretch_parameters(data))
    assert np.median(shown) == pytest.approx(255 * SKY_LEVEL, abs=2)
    assert shown.max() == 255
    assert shown[10, 20] > 250


@pytest.mark.parametrize("dtype", ["u1", "u2", "i2", "i4", "u4", "f4", "f8", "i1"])
def test_every_type_is_shown_as_the_curve_says(dtype):
    data = (np.arange(120 * 100).reshape(120, 100) % 251 - (100 if dtype[0] == "i" else 0)).astype(dtype)
    stretch = Stretch(-20.0 if dtype[0] == "i" else 30.0, 120.0, 0.2)
    share = np.clip((data.astype(float) - stretch.black) / (stretch.white - stretch.black), 0, 1)
    wanted = 255 * midtones(share, stretch.mid)
    assert np.abs(apply(data, stretch).astype(float) - wanted).max() <= 1.0


@given(st.floats(0.001, 0.999), st.floats(0.01, 0.99))
def test_midtones(x, m):
    assert midtones(np.array(m), m) == pytest.approx(0.5)
    assert 0 < midtones(np.array(x), m) < 1
    assert midtones(midtones(np.array(x), m), 1 - m) == pytest.approx(x)  # the inverse curve


@pytest.mark.parametrize("value", [0, 7, 65535])
def test_a_flat_frame_is_no_trouble(value):
    data = np.full((50, 60), value, np.uint16)
    shown = apply(data, stretch_parameters(data))
    assert len(np.unique(shown)) == 1


def test_undefined_pixels_are_black():
    data = sky().astype(np.float32)
    data[0, 0] = np.nan
    assert apply(data, stretch_parameters(data))[0, 0] == 0


def test_each_colour_gets_its_own_stretch():
    data = np.stack([sky(200, 200), sky(200, 200, 2) * 2, sky(200, 200, 3) * 3], axis=-1)
    shown = apply(data, white_balanced(data))
    assert shown.shape == data.shape
    np.testing.assert_allclose(np.median(shown, axis=(0, 1)), 255 * SKY_LEVEL, atol=3)


@pytest.mark.parametrize("bayer", ["RGGB", "BGGR", "GRBG", "GBRG"])
@pytest.mark.parametrize("factor", [1, 2, 4, 5])
def test_a_mosaic_as_colour(bayer, factor):
    levels = {"R": 100, "G": 200, "B": 50}
    cell = np.array([levels[c] for c in bayer], np.uint16).reshape(2, 2)
    frame = Frame(np.tile(cell, (21, 31)), bayer=bayer)
    shown = debayer_preview(frame, factor)
    step = max(2, factor // 2 * 2)
    assert shown.shape == (42 // step, 62 // step, 3)
    assert (shown == [100, 200, 50]).all()
    plain = replace(frame, bayer=None)
    assert debayer_preview(plain, factor).shape == (42 // factor, 62 // factor)


@pytest.mark.parametrize("factor", [1, 2, 3, 7])
def test_thinning_keeps_stars(factor):
    data = np.zeros((70, 84), np.uint16)
    data[30:37, 40:47] = 9
    assert binned(data, factor).max() == 9
    assert binned(data, factor).shape == (70 // factor, 84 // factor)
