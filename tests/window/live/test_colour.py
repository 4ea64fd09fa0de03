"""A colour camera's live picture: its colours by day, red light alone by night."""

from dataclasses import replace

import numpy as np
import pytest

from kochab.core.frame import Frame
from kochab.core.progress import run
from kochab.frames import split
from kochab.window.image.frame_image import ScreenStretch, prepare
from kochab.window.image.screen_image import BLUE, GREEN, RED, tables
from kochab.window.live.rendering import DisplaySettings, LiveRenderer, channels
from tests.window.fakes import brightness

SKIES = {"R": 900.0, "G": 1400.0, "B": 700.0}
STAR = {"R": 9000.0, "G": 4000.0, "B": 2500.0}  # a red one, 40 px wide


def mosaic(pattern="RGGB", noise=30.0, kind=np.uint16, size=(400, 600)):
    rng = np.random.default_rng(2)
    pixels = np.empty(size)
    for number, letter in enumerate(pattern):
        cell = pixels[number // 2 :: 2, number % 2 :: 2]
        cell[:] = rng.normal(SKIES[letter], noise, cell.shape)
        cell[90:110, 140:160] = STAR[letter]
    return Frame(pixels.astype(kind), bayer=pattern)


def rgb(kind=np.uint8):
    rng = np.random.default_rng(3)
    colour = rng.normal([30.0, 42.0, 24.0], 2.0, (400, 600, 3))
    colour[180:220, 280:320] = (200.0, 90.0, 60.0)
    if kind == np.uint16:
        colour *= 200.0
    pixels, colour, clips = split(colour.astype(kind))
    return Frame(pixels, colour, saturation=clips)


def seen(frame, **look):
    """Red, green and blue (3, H, W) as they are shown."""
    memory = LiveRenderer().picture(frame, DisplaySettings(**look)).memory
    assert (memory >> 24 == 255).all()
    return np.stack([memory >> 16 & 255, memory >> 8 & 255, memory & 255]).astype(int)


@pytest.mark.parametrize("pattern", ["RGGB", "BGGR", "GRBG", "GBRG"])
def test_a_bayer_cell_becomes_one_pixel_of_its_own_colour(pattern):
    frame = mosaic(pattern, noise=0.0)
    found = channels(frame, frame.pixels, 1.0)
    for plane, letter in zip(found, "RGB", strict=True):
        assert plane.shape == (200, 300)
        assert plane[10, 10] == SKIES[letter]
        assert plane[100, 150] == STAR[letter]
    assert channels(frame, frame.pixels, 0.5)[0].shape == (200, 300)
    assert channels(frame, frame.pixels, 0.25)[0].shape == (200, 300)  # 200 px at least


@pytest.mark.parametrize(("made", "kind"), [(mosaic, np.uint16), (mosaic, np.int32), (rgb, np.uint8), (rgb, np.uint16)])
def test_the_sky_is_grey_and_a_red_star_is_red(made, kind):
    shown = seen(made(kind=kind))
    skies = np.median(shown.reshape(3, -1), axis=1)
    assert np.ptp(skies) <= 3
    assert 20 < skies[0] < 90
    middle = shown[:, shown.shape[1] // 2, shown.shape[2] // 2]
    assert middle[0] > middle[1] > middle[2]


@pytest.mark.parametrize("made", [mosaic, rgb])
def test_night_is_red_alone_and_colour_can_be_switched_off(made):
    frame = made()
    red, green, blue = seen(frame, red=True)
    assert red.max() > 100
    assert not green.any()
    assert not blue.any()
    red, green, blue = seen(frame, colour=False)
    assert (red == green).all()
    assert (green == blue).all()


def test_eight_bits_are_as_bright_in_colour_as_in_grey():
    """Their luminance is a sum, four times as high as its parts."""
    frame = rgb()
    coloured, grey = seen(frame)[1], seen(frame, colour=False)[1]
    assert np.median(coloured) == pytest.approx(np.median(grey), abs=8)  # a step of 8 bits
    assert coloured.max() > 200
    opened = run(prepare(frame))
    green = brightness(opened, opened.auto, opened.sky_shift[1])[opened.colour[0][..., 1]]
    assert np.median(green) == pytest.approx(np.median(coloured), abs=8)
    assert np.std(green[:100, :100]) == pytest.approx(np.std(coloured[:100, :100]), rel=0.2)


def test_a_mosaic_looks_as_an_opened_one_does():
    frame, stretch = mosaic(size=(800, 1200)), ScreenStretch(0.02, 0.05)
    opened, made = run(prepare(frame)), LiveRenderer()
    shown = made.picture(frame, DisplaySettings(stretch)).memory
    for number, shift in enumerate(opened.sky_shift):
        there = brightness(opened, stretch, shift)[opened.colour[1][..., number]]
        here = shown >> (16 - 8 * number) & 255
        assert np.median(here) == pytest.approx(np.median(there), abs=8)


def test_a_frame_of_another_kind_is_grey():
    assert channels(Frame(np.zeros((9, 9), np.uint16)), np.zeros((9, 9), np.uint16), 1.0) is None
    odd = replace(mosaic(), bayer="RGB")
    assert channels(odd, odd.pixels, 1.0) is None


def test_tables_are_made_anew_only_when_something_changes():
    parts = ((RED, 0.0), (GREEN, 5.0), (BLUE, -5.0))
    first = tables(np.dtype(np.uint8), ScreenStretch(), (0.0, 255.0), parts)
    assert tables(np.dtype(np.uint8), ScreenStretch(), (0.0, 255.0), parts) is first
    assert tables(np.dtype(np.uint8), ScreenStretch(0.1), (0.0, 255.0), parts) is not first
    assert int(sum(table[100] for table in first)) == 0xFF000000 + (100 << 16) + (95 << 8) + 105
