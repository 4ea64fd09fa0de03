"""What must not change: moving, mirroring and turning the frame moves, mirrors, turns the stars."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kochab.core.frame import Frame

from .fields import detect, field

FRAME, XY, FLUX = field(n=25, seed=8, size=(320, 260), apart=40)


@pytest.fixture(scope="module")
def plain():
    return detect(FRAME)


def _same_places(found, expected, atol):
    assert len(found) == len(expected)
    away = np.hypot(*(found[:, None] - expected[None]).transpose(2, 0, 1)).min(axis=1)
    assert away.max() < atol


@settings(max_examples=15)
@given(dx=st.integers(0, 15), dy=st.integers(0, 15))
def test_cutting_edges_off_moves_the_stars(dx, dy):
    whole = detect(FRAME)
    cut = detect(FRAME.pixels[dy:, dx:].copy())
    inside = (whole.xy > [dx + 8, dy + 8]).all(axis=1) & (whole.snr > 8)
    away = np.hypot(*(cut.xy[:, None] + [dx, dy] - whole.xy[inside]).transpose(2, 0, 1))
    assert away.min(axis=0).max() < 0.06


@pytest.mark.parametrize("turn", ["left-right", "up-down", "transpose"])
def test_mirrors_and_turns(plain, turn):
    height, width = FRAME.pixels.shape
    pixels, xy = {
        "left-right": (FRAME.pixels[:, ::-1], plain.xy * [-1, 1] + [width - 1, 0]),
        "up-down": (FRAME.pixels[::-1], plain.xy * [1, -1] + [0, height - 1]),
        "transpose": (FRAME.pixels.T, plain.xy[:, ::-1]),
    }[turn]
    _same_places(detect(pixels.copy()).xy, xy, 0.05)


@settings(max_examples=15)
@given(scale=st.floats(0.01, 100.0), offset=st.floats(-1e4, 1e4))
def test_units_do_not_matter(scale, offset):
    plain = detect(FRAME.pixels.astype(np.float64))
    other = detect(FRAME.pixels.astype(np.float64) * scale + offset)
    bright = plain.snr > 8
    away = np.hypot(*(other.xy[:, None] - plain.xy[bright]).transpose(2, 0, 1)).min(axis=0)
    assert away.max() < 0.05


@settings(max_examples=25)
@given(
    shape=st.tuples(st.integers(1, 90), st.integers(1, 90)),
    dtype=st.sampled_from([np.uint8, np.uint16, np.int16, np.float32, np.float64, np.bool_]),
    seed=st.integers(0, 1000),
    kind=st.sampled_from(["flat", "noise", "steps", "wild"]),
)
def test_any_pixels_get_an_answer(shape, dtype, seed, kind):
    rng = np.random.default_rng(seed)
    pixels = {
        "flat": np.full(shape, 3.0),
        "noise": rng.normal(100, 10, shape),
        "steps": np.where(rng.random(shape) > 0.9, 200.0, 10.0),
        "wild": rng.choice([0.0, 1.0, 120.0], shape),
    }[kind].astype(dtype)
    if kind == "wild" and pixels.dtype.kind == "f":
        pixels.flat[:: max(1, pixels.size // 5)] = rng.choice([np.nan, np.inf, -np.inf, 1e38])
    found = detect(Frame(np.ascontiguousarray(pixels)))
    height, width = shape
    assert (found.xy > -0.5).all()
    assert (found.xy < [width - 0.5, height - 0.5]).all()
    for name in ("flux", "snr", "fwhm_px", "elongation", "angle_rad"):
        assert np.isfinite(getattr(found, name)).all()
    assert (found.elongation >= 1.0).all()
