"""PNG, JPEG, TIFF, HEIF, XISF and raw: samples survive, colour becomes luminance without steps."""

import struct
import subprocess
import sys
import zlib
from contextlib import nullcontext

import numpy as np
import pytest
import tifffile
from PIL import Image
from xisf import XISF

from kochab.core.errors import FrameError
from kochab.frames import read_frame, samples
from kochab.frames.samples import MAX_PIXELS, luminance
from tests.frames.files import colours, dng, heic, sky


def test_eight_bit_colour_is_summed_without_steps(tmp_path):
    rgb = colours()
    Image.fromarray(rgb).save(tmp_path / "a.png")
    frame = read_frame(tmp_path / "a.png")
    np.testing.assert_array_equal(frame.colour, rgb)
    np.testing.assert_array_equal(frame.pixels, rgb.astype(np.uint16) @ np.array([1, 2, 1], np.uint16))
    assert frame.saturation == 1020


def test_grey_saved_as_colour_is_grey(tmp_path):
    grey = colours()[..., 0]
    Image.fromarray(np.stack([grey] * 3, axis=-1)).save(tmp_path / "a.png")
    frame = read_frame(tmp_path / "a.png")
    np.testing.assert_array_equal(frame.pixels, grey)
    assert frame.colour is None


@pytest.mark.parametrize("dtype", [np.uint16, np.uint32, np.float32])
def test_luminance_does_not_overflow(dtype):
    top = np.iinfo(dtype).max if np.dtype(dtype).kind == "u" else 1.0
    full = np.full((70, 5, 3), top, dtype)
    np.testing.assert_array_equal(luminance(full), full[..., 0])


def test_opacity_is_left_out(tmp_path):
    rgb = colours()
    Image.fromarray(np.dstack([rgb, np.full((48, 64), 9, np.uint8)])).save(tmp_path / "a.png")
    np.testing.assert_array_equal(read_frame(tmp_path / "a.png").colour, rgb)


def test_png_of_16_bits_grey_and_colour(tmp_path):
    import imagecodecs

    rgb = colours(np.uint16)
    for data in (sky(), rgb):
        (tmp_path / "a.png").write_bytes(imagecodecs.png_encode(data))
        frame = read_frame(tmp_path / "a.png")
        np.testing.assert_array_equal(frame.pixels if data.ndim == 2 else frame.colour, data)
        assert frame.pixels.dtype == np.uint16


@pytest.mark.parametrize("mode", ["1", "P", "CMYK", "LA"])
def test_other_modes_open(tmp_path, mode):
    suffix = "jpg" if mode == "CMYK" else "png"
    Image.fromarray(colours()).convert(mode).save(tmp_path / f"a.{suffix}")
    assert read_frame(tmp_path / f"a.{suffix}").pixels.shape == (48, 64)


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("suffix", ["jpg", "png"])
def test_exif_orientation_turns_the_picture_upright(tmp_path, orientation, suffix):
    from PIL import ImageOps

    exif = Image.Exif()
    exif[274] = orientation
    steps = (np.arange(64) * 3 + np.arange(48)[:, None]).astype(np.uint8)
    path = tmp_path / f"a.{suffix}"
    Image.fromarray(steps).save(path, exif=exif, **({"quality": 100} if suffix == "jpg" else {}))
    with Image.open(path) as image:
        wanted = np.asarray(ImageOps.exif_transpose(image))
    np.testing.assert_array_equal(read_frame(path).pixels, wanted)


def test_jpeg_is_what_pillow_decodes_and_says_when_it_is_cut(tmp_path):
    path = tmp_path / "a.jpg"
    Image.fromarray(colours()).save(path, progressive=True)
    with Image.open(path) as image:
        np.testing.assert_array_equal(read_frame(path).colour, np.asarray(image))
    path.write_bytes(path.read_bytes()[:-40])
    with pytest.raises(FrameError, match="cut short"):
        read_frame(path)


@pytest.mark.parametrize("name", ["a.png", "a.bmp", "a.tif", "a.xisf"])
def test_cut_short(tmp_path, name):
    path = tmp_path / name
    if name == "a.tif":
        tifffile.imwrite(path, sky(400, 500))
    elif name == "a.xisf":
        XISF.write(str(path), sky(400, 500)[..., None])
    else:
        Image.fromarray(colours(height=400, width=500)).save(path)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(FrameError, match="cut short"):
        read_frame(path)


def test_a_picture_that_unpacks_to_gigabytes_is_refused_before_it_does(tmp_path):
    import struct
    import zlib

    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    size = struct.pack(">IIBBBBB", 90000, 90000, 8, 0, 0, 0, 0)
    bomb = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", size)
    bomb += chunk(b"IDAT", zlib.compress(bytes(10**6))) + chunk(b"IEND", b"")
    (tmp_path / "a.png").write_bytes(bomb)
    assert MAX_PIXELS < 90000 * 90000
    with pytest.raises(FrameError, match="million"):
        read_frame(tmp_path / "a.png")


@pytest.mark.parametrize(
    ("width", "height", "opens"),
    [
        *((2, 2, True), (3, 1, False), (1, 3, False)),
        *((20_000, 15_000, True), (20_000, 15_001, False)),
        *((100_000, 2, True), (2, 100_000, True), (100_001, 2, False), (2, 100_001, False)),
    ],
)
def test_the_largest_and_the_smallest_picture_that_opens(monkeypatch, width, height, opens):
    """From 2 x 2 pixels to 300 million, and no side longer than 100,000."""
    monkeypatch.setattr(samples, "free_bytes", lambda: None)
    with nullcontext() if opens else pytest.raises(FrameError, match=f"{width} x {height} pixels"):
        samples.check_size(width, height)


def test_one_pixel_is_no_picture(tmp_path):
    Image.new("L", (1, 1)).save(tmp_path / "a.png")
    with pytest.raises(FrameError, match="1 x 1"):
        read_frame(tmp_path / "a.png")


@pytest.mark.parametrize("dtype", ["u1", "u2", "u4", "i2", "f4", "f8", "f2", "u8"])
@pytest.mark.parametrize("order", ["<", ">"])
def test_tiff_of_all_types(tmp_path, dtype, order):
    data = (sky() // 300).astype(dtype)
    tifffile.imwrite(tmp_path / "a.tif", data, byteorder=order)
    frame = read_frame(tmp_path / "a.tif")
    np.testing.assert_array_equal(frame.pixels, data)
    assert frame.pixels.dtype.itemsize <= 4


@pytest.mark.parametrize("planar", ["contig", "separate"])
@pytest.mark.parametrize("compression", [None, "zlib", "lzw"])
def test_tiff_in_colour(tmp_path, planar, compression):
    rgb = colours(np.uint16)
    data = rgb if planar == "contig" else np.moveaxis(rgb, -1, 0)
    tifffile.imwrite(tmp_path / "a.tif", data, photometric="rgb", planarconfig=planar, compression=compression)
    np.testing.assert_array_equal(read_frame(tmp_path / "a.tif").colour, rgb)


def test_tiff_where_white_is_zero_and_with_many_pages(tmp_path):
    tifffile.imwrite(tmp_path / "a.tif", sky(), photometric="miniswhite")
    np.testing.assert_array_equal(read_frame(tmp_path / "a.tif").pixels, 65535 - sky())
    tifffile.imwrite(tmp_path / "b.tif", np.stack([sky(), sky() + 1]), photometric="minisblack")
    frame = read_frame(tmp_path / "b.tif")
    np.testing.assert_array_equal(frame.pixels, sky())
    assert "2 pages" in frame.warnings[0]


@pytest.mark.parametrize("codec", [None, "zlib", "lz4", "zstd"])
def test_xisf(tmp_path, codec):
    path = tmp_path / "a.xisf"
    words = {"FOCALLEN": "400", "XPIXSZ": "3.76", "DATE-OBS": "'2025-01-02T03:04:05'"}
    meta = {"FITSKeywords": {k: [{"value": v, "comment": ""}] for k, v in words.items()}}
    XISF.write(str(path), sky()[..., None], codec=codec, shuffle=codec is not None, image_metadata=meta)
    frame = read_frame(path)
    np.testing.assert_array_equal(frame.pixels, sky())
    low, high = frame.hint.scale_arcsec_px
    assert low < 206.265 * 3.76 / 400 < high
    assert frame.hint.time_utc.year == 2025


def test_xisf_floats_clip_at_one(tmp_path):
    rgb = colours(np.float32)
    XISF.write(str(tmp_path / "a.xisf"), rgb)
    frame = read_frame(tmp_path / "a.xisf")
    np.testing.assert_array_equal(frame.colour, rgb)
    assert frame.saturation == 1.0


def test_heif(tmp_path):
    rgb = np.repeat(np.repeat(colours(height=12, width=16), 4, 0), 4, 1)
    exif = Image.Exif()
    exif[271] = "Telephone"
    frame = read_frame(heic(tmp_path / "a.heic", rgb, exif=exif.tobytes()))
    assert np.abs(frame.colour.astype(int) - rgb).mean() < 3.0
    assert frame.hint.camera == "Telephone"


@pytest.mark.parametrize(("codes", "bayer"), [((0, 1, 1, 2), "RGGB"), ((2, 1, 1, 0), "BGGR"), ((1, 0, 2, 1), "GRBG")])
def test_raw_gives_the_mosaic_untouched(tmp_path, codes, bayer):
    mosaic = sky(100, 120) // 16
    frame = read_frame(dng(tmp_path / "a.dng", mosaic, codes))
    np.testing.assert_array_equal(frame.pixels, mosaic)
    assert frame.bayer == bayer
    assert frame.saturation == 4095
    assert frame.header["BLACK"] == 64
    assert frame.hint.camera == "Kochab Test"


def test_raw_with_uneven_black_levels_is_brought_to_the_lowest(tmp_path):
    black = np.array([[64, 80], [80, 96]])
    mosaic = np.tile(black + 500, (50, 60)).astype(np.uint16)
    mosaic[0, 1] = 3  # below its black level: stays at zero, does not wrap
    frame = read_frame(dng(tmp_path / "a.dng", mosaic, black=(64, 80, 80, 96)))
    assert frame.pixels[0, 1] == 0
    assert set(frame.pixels.ravel()) == {0, 564}


def test_raw_under_the_name_of_a_tiff(tmp_path):
    path = dng(tmp_path / "a.dng", sky(100, 120) // 16)
    path = path.rename(tmp_path / "a.tif")
    assert read_frame(path).bayer == "RGGB"


def test_raw_that_is_damaged(tmp_path):
    path = dng(tmp_path / "a.dng", sky(100, 120) // 16)
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(FrameError, match="raw"):
        read_frame(path)


def test_a_picture_too_large_for_memory_is_refused_before_it_is_decoded(tmp_path, monkeypatch):
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", 17_000, 17_000, 16, 2, 0, 0, 0)  # 1.7 MB of zeros, packed
    path = tmp_path / "a.png"
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", b"x"))
    with pytest.raises(FrameError, match=r"17000 x 17000 pixels, 1\.7 GB, packed into"):
        read_frame(path)
    Image.fromarray(np.zeros((500, 400, 3), np.uint8)).save(path)
    assert read_frame(path).pixels.shape == (500, 400)
    monkeypatch.setattr("kochab.frames.samples.free_bytes", lambda: 2 * 500 * 400 * 3 - 1)
    with pytest.raises(FrameError, match="there is room for"):
        read_frame(path)


def test_an_image_packed_as_no_camera_s_is_refused_before_it_is_decoded(tmp_path):
    path = tmp_path / "a.png"
    Image.new("RGB", (9000, 9000)).save(path, compress_level=9)
    assert path.stat().st_size < 300_000
    with pytest.raises(FrameError, match=r"claims 9000 x 9000 pixels, 0.2 GB, packed into 0.24 MB: no camera"):
        read_frame(path)


@pytest.mark.parametrize("damaged", [False, True])
def test_exif_behind_a_png_is_found_without_decoding_it_twice(tmp_path, monkeypatch, damaged):
    exif = Image.Exif()
    exif[274] = 6
    Image.fromarray(colours()).save(path := tmp_path / "a.png")
    block = b"eXIf" + exif.tobytes().removeprefix(b"Exif\0\0")
    chunk = struct.pack(">I", len(block) - 4) + block + struct.pack(">I", zlib.crc32(block) + damaged)
    whole = path.read_bytes()
    path.write_bytes(whole[:-12] + chunk + whole[-12:])
    monkeypatch.setattr("PIL.PngImagePlugin.PngImageFile.load", None)
    assert read_frame(path).pixels.shape == ((48, 64) if damaged else (64, 48))


def test_a_jpeg_of_many_scans_is_decoded_where_it_can_be_stopped(tmp_path, monkeypatch):
    Image.fromarray(colours()).save(path := tmp_path / "a.jpg", progressive=True)
    started = []
    monkeypatch.setattr("kochab.frames.readers.in_sandbox", lambda *_: started.append(1) or iter(()))
    read_frame(path)
    assert not started
    whole = path.read_bytes()
    scan = whole[whole.rindex(b"\xff\xda") : -2]
    path.write_bytes(whole[:-2] + 40 * scan + whole[-2:])
    assert read_frame(path) is None
    assert started


@pytest.mark.parametrize("name", ["orion.png", "big-dipper.jpg"])
def test_only_the_plugins_of_the_formats_that_are_read_are_loaded(repository, name):
    """Pillow loads all of its forty when it misses one, which is a tenth of a command's time."""
    code = (
        "import sys\nfrom kochab.frames import read_frame\n"
        f"read_frame({str(repository / 'resources' / 'samples' / name)!r})\n"
        "print(sorted(name for name in sys.modules if 'Dds' in name or 'Mpeg' in name))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=100)
    assert done.stdout == "[]\n", done.stderr
