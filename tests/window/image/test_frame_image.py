import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kochab.core.frame import Frame
from kochab.core.progress import run
from kochab.frames.stretch import SKY_LEVEL
from kochab.window.image.frame_image import ScreenStretch, automatic, prepare
from tests.window.fakes import brightness


@given(st.floats(0, 0.9), st.floats(0.0001, 0.9999))
def test_a_stretch_never_reverses_brightness(black, mid):
    table = ScreenStretch(black, mid).table(4096, 0, 4095).astype(int)
    assert (np.diff(table) >= 0).all()
    assert (table[0], table[-1]) == (0, 255)


def test_automatic_puts_the_sky_at_a_dark_grey():
    sky = np.random.default_rng(0).normal(1200, 30, (300, 300))
    sky[100, 100] = 60_000
    stretch, low, high = automatic(sky.astype(np.uint16))
    shown = stretch.table(65536, low, high)[sky.astype(np.uint16)]
    assert np.median(shown) == pytest.approx(255 * SKY_LEVEL, abs=6)
    assert (shown > 2).mean() > 0.98
    assert shown[100, 100] > 200


def test_a_grey_sky_of_three_different_levels_is_shown_grey():
    rng = np.random.default_rng(3)
    colour = np.stack([rng.normal(m, 5, (64, 64)) for m in (300, 200, 120)], -1).astype(np.uint16)
    picture = run(prepare(Frame(colour.mean(axis=2).astype(np.uint16), colour=colour)))
    tables = [brightness(picture, picture.auto, shift) for shift in picture.sky_shift]
    shown = [np.median(t[colour[..., c]]) for c, t in enumerate(tables)]
    assert np.ptp(shown) < 12


@pytest.mark.parametrize(("path", "own"), [("nebula.jpg", True), ("", False)])
def test_a_finished_picture_keeps_its_own_colours(path, own):
    """Eight bits a colour from a file have been processed; a camera's are as they come."""
    rng = np.random.default_rng(3)
    colour = np.stack([rng.normal(m, 5, (64, 64)) for m in (60, 30, 40)], -1).astype(np.uint8)
    luminance = colour @ np.array([1, 2, 1], np.uint16)  # as a JPEG is read
    picture = run(prepare(Frame(luminance, colour=colour, path=path)))
    assert (picture.sky_shift == (0.0, 0.0, 0.0)) == own


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.int16, np.int32, np.float32, np.float64])
def test_every_kind_of_pixel_becomes_a_picture(dtype):
    pixels = np.random.default_rng(1).normal(100, 5, (301, 403)).astype(dtype)
    picture = run(prepare(Frame(pixels)))
    assert picture.mono[0].shape == (301, 403)
    assert picture.mono[0].dtype in (np.uint8, np.uint16)
    shown = brightness(picture, picture.auto)[picture.mono[0]]
    assert 20 < np.median(shown) < 110


def test_order_of_brightness_survives_scaling_from_floats():
    pixels = np.linspace(-3.0, 9.0, 40_000, dtype=np.float32).reshape(200, 200)
    stored = run(prepare(Frame(pixels))).mono[0].ravel().astype(int)
    assert (np.diff(stored) >= 0).all()
    assert stored[-1] > stored[0]


def test_values_that_are_not_numbers_are_black():
    pixels = np.full((50, 60), 10.0, dtype=np.float32)
    pixels += np.random.default_rng(0).normal(0, 1, pixels.shape)
    pixels[10, 10], pixels[20, 20] = np.nan, np.inf
    assert run(prepare(Frame(pixels))).mono[0][10, 10] == 0


@pytest.mark.parametrize("value", [0.0, 7.0, np.nan])
def test_a_flat_frame_is_shown(value):
    picture = run(prepare(Frame(np.full((40, 40), value, dtype=np.float32))))
    assert np.isfinite(brightness(picture, picture.auto)).all()


def test_the_pyramid_averages_four_pixels():
    pixels = np.arange(1600 * 1200, dtype=np.uint32).reshape(1200, 1600).astype(np.uint16)
    picture = run(prepare(Frame(pixels)))
    mean = pixels[:2, 2:4].astype(int).sum() // 4
    assert picture.mono[1][0, 1] == mean
    assert max(picture.mono[-1].shape) <= 800
    assert picture.mono[1].shape == (600, 800)


def test_a_mosaic_is_shown_in_its_colours():
    mosaic = np.zeros((8, 8), dtype=np.uint16)
    mosaic[0::2, 0::2], mosaic[0::2, 1::2] = 900, 500
    mosaic[1::2, 0::2], mosaic[1::2, 1::2] = 500, 100
    picture = run(prepare(Frame(mosaic, bayer="RGGB")))
    assert picture.colour[0].shape == (8, 8, 3)
    assert picture.colour[0][3, 5].tolist() == [900, 500, 100]


def test_level_for_never_draws_fewer_pixels_than_the_screen_has():
    picture = run(prepare(Frame(np.zeros((3000, 4000), dtype=np.uint16))))
    for scale in (2.0, 1.0, 0.6, 0.5, 0.3, 0.25, 0.13):
        assert 2 ** picture.level_for(scale) * scale <= max(1.0, scale)


@pytest.mark.parametrize(("dtype", "full"), [(np.uint8, 255), (np.uint16, 65535), (np.uint16, 16383)])
def test_a_flat_image_is_as_bright_as_it_is(dtype, full):
    """A frame that was wholly overexposed was shown black, beside a card that called it too bright."""
    for share, seen in ((1.0, 255), (0.5, 127), (0.0, 0)):
        picture = run(prepare(Frame(np.full((64, 64), round(share * full), dtype), saturation=float(full))))
        shown = brightness(picture, picture.auto)[picture.mono[0]]
        assert np.ptp(shown) == 0
        assert int(shown[0, 0]) == pytest.approx(seen, abs=1)
