"""What is written is read again as it was."""

from datetime import UTC, datetime

import numpy as np
import pytest
from astropy.io import fits

from kochab.core.frame import Frame, Hint, Site
from kochab.frames import read_frame
from kochab.frames.fits_write import write_fits


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.int16, np.int32, np.uint32, np.float32])
def test_pixels_of_every_type(tmp_path, dtype) -> None:
    pixels = (np.random.default_rng(1).random((30, 40)) * 100).astype(dtype)
    path = tmp_path / "a.fits"
    write_fits(Frame(pixels), path)
    back = read_frame(path)
    assert back.pixels.dtype == dtype
    assert np.array_equal(back.pixels, pixels)
    assert [p.name for p in tmp_path.iterdir()] == ["a.fits"]


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_colour_gives_the_same_luminance(tmp_path, dtype) -> None:
    import tifffile

    rgb = np.random.default_rng(1).integers(0, 250, (30, 40, 3)).astype(dtype)
    tifffile.imwrite(tmp_path / "a.tif", rgb)
    first = read_frame(tmp_path / "a.tif")
    write_fits(first, tmp_path / "a.fits")
    again = read_frame(tmp_path / "a.fits")
    assert np.array_equal(again.pixels, first.pixels)
    assert np.array_equal(again.colour, rgb)


@pytest.mark.parametrize("pattern", ["RGGB", "BGGR", "GRBG", "GBRG"])
@pytest.mark.parametrize("height", [30, 31])
def test_the_mosaic_and_what_is_known_of_the_frame(tmp_path, pattern, height) -> None:
    hint = Hint(
        (10.0, 11.0),
        (83.5, -5.25, 3.0),
        datetime(2026, 3, 1, 22, 0, 1, 250000, UTC),
        2.5,
        Site(45.5, -70.25, 120.0),
        "A camera",
    )
    header = {"GAIN": 120, "FOCALLEN": 200.0, "XPIXSZ": 3.76, "ROWORDER": "BOTTOM-UP", "NAXIS1": 9}
    frame = Frame(np.ones((height, 40), np.uint16), None, pattern, 4095.0, "", hint, (), header)
    write_fits(frame, tmp_path / "a.fits")
    back = read_frame(tmp_path / "a.fits")
    assert (back.bayer, back.saturation) == (pattern, 4095.0)
    assert back.warnings == ()
    assert back.hint.time_utc == hint.time_utc
    assert (back.hint.exposure_s, back.hint.site, back.hint.camera) == (2.5, hint.site, "A camera")
    low, high = back.hint.scale_arcsec_px
    assert low < 10.49 < high
    assert back.hint.centre_deg[:2] == (83.5, -5.25)
    assert (back.header["GAIN"], back.header["FOCALLEN"]) == (120, 200.0)
    with fits.open(tmp_path / "a.fits") as hdus:
        hdus.verify("exception")


def test_what_cannot_be_written_leaves_nothing_behind(tmp_path) -> None:
    (tmp_path / "a.fits").mkdir()
    with pytest.raises(OSError, match=r"a\.fits"):
        write_fits(Frame(np.ones((4, 4), np.uint8)), tmp_path / "a.fits")
    assert [p.name for p in tmp_path.iterdir()] == ["a.fits"]
