"""FITS of every kind against astropy, and what is wrong said in a sentence."""

import bz2
import gzip
import tracemalloc

import numpy as np
import pytest
from astropy.io import fits
from hypothesis import given
from hypothesis import strategies as st

from kochab.core.errors import FrameError
from kochab.frames import read_frame, shifted
from kochab.frames.fits import parse_value
from kochab.frames.samples import bayer_pattern
from tests.frames.files import sky


def write(path, data, **cards):
    hdu = fits.PrimaryHDU(data)
    hdu.header.update(cards)
    hdu.writeto(path, overwrite=True)
    return path


def header_only(path, **cards):
    """A header with any claims at all, and a little data."""
    lines = [f"{k:8s}= {v!s:>20s}".ljust(80) for k, v in cards.items()] + ["END".ljust(80)]
    path.write_bytes("".join(lines).ljust(2880).encode() + b"\x00" * 5760)
    return path


@pytest.mark.parametrize(
    ("dtype", "wanted"),
    [
        ("u1", "u1"),
        ("i1", "i1"),
        ("i2", "i2"),
        ("u2", "u2"),
        ("i4", "i4"),
        ("u4", "u4"),
        ("i8", "f4"),
        ("f4", "f4"),
        ("f8", "f4"),
    ],
)
def test_all_types_of_pixels(tmp_path, dtype, wanted):
    kind = np.dtype(dtype)
    info = np.iinfo(kind) if kind.kind in "iu" else np.finfo(np.float32)
    data = np.linspace(float(info.min) / 2, float(info.max) / 2, 40 * 50).reshape(40, 50)
    data = data.astype(kind)
    if kind.kind in "iu":
        data[0, 0], data[0, 1] = info.min, info.max
    path = write(tmp_path / "a.fits", data)
    frame = read_frame(path)
    assert frame.pixels.dtype == np.dtype(wanted)
    np.testing.assert_array_equal(frame.pixels, fits.getdata(path).astype(wanted))


def test_long_frames_are_read_whole_across_strips(tmp_path):
    data = np.random.default_rng(5).integers(0, 65536, (900, 1100)).astype(np.uint16)
    np.testing.assert_array_equal(read_frame(write(tmp_path / "a.fits", data)).pixels, data)


def test_scaled_integers_and_blanks(tmp_path):
    stored = np.arange(2000, dtype=np.int16).reshape(40, 50)
    path = write(tmp_path / "a.fits", stored, BLANK=7)
    raw = path.read_bytes()
    end = raw.index(b"END" + b" " * 77)
    cards = [b"BSCALE  =                  0.5".ljust(80), b"BZERO   =                100.0".ljust(80)]
    blob = raw[:end] + b"".join(cards) + b"END".ljust(80)
    path.write_bytes(blob.ljust(2880) + raw[2880:])
    frame = read_frame(path)
    assert frame.pixels.dtype == np.float32
    assert frame.pixels[1, 0] == 50 * 0.5 + 100.0
    assert frame.pixels[0, 7] == pytest.approx(np.median(stored * 0.5 + 100.0), abs=1.0)
    assert "no value" in frame.warnings[0]


def test_row_zero_is_the_top(tmp_path):
    data = sky()
    for order in ("TOP-DOWN", "BOTTOM-UP"):
        frame = read_frame(write(tmp_path / "a.fits", data, ROWORDER=order))
        np.testing.assert_array_equal(frame.pixels, data)


@pytest.mark.parametrize("planes_first", [True, False])
def test_colour_planes(tmp_path, planes_first):
    rgb = np.random.default_rng(3).integers(0, 60000, (40, 50, 3)).astype(np.uint16)
    stored = np.moveaxis(rgb, -1, 0) if planes_first else rgb
    frame = read_frame(write(tmp_path / "a.fits", stored, BAYERPAT="RGGB"))
    np.testing.assert_array_equal(frame.colour, rgb)
    wide = rgb.astype(int)
    np.testing.assert_array_equal(frame.pixels, (wide @ [1, 2, 1] + 2) // 4)
    assert frame.bayer is None


@pytest.mark.parametrize("shape", [(5, 40, 50), (2, 40, 50), (1, 40, 50), (2, 5, 40, 50)])
def test_of_a_cube_the_first_plane(tmp_path, shape):
    data = np.random.default_rng(4).normal(0, 1, shape).astype(np.float32)
    frame = read_frame(write(tmp_path / "a.fits", data))
    np.testing.assert_array_equal(frame.pixels, data.reshape(-1, 40, 50)[0])
    assert any("first" in w for w in frame.warnings) == (shape[0] > 1)


def test_first_image_of_many_parts_with_the_primary_keywords(tmp_path):
    table = fits.BinTableHDU.from_columns([fits.Column("n", "J", array=np.arange(900))])
    primary = fits.PrimaryHDU()
    primary.header["INSTRUME"] = "two chips"
    path = tmp_path / "a.fits"
    fits.HDUList([primary, table, fits.ImageHDU(sky()), fits.ImageHDU(sky() + 1)]).writeto(path)
    frame = read_frame(path)
    np.testing.assert_array_equal(frame.pixels, sky())
    assert frame.hint.camera == "two chips"


@pytest.mark.parametrize("codec", ["RICE_1", "GZIP_1", "HCOMPRESS_1"])
def test_tile_compression(tmp_path, codec):
    path = tmp_path / "a.fits.fz"
    image = fits.CompImageHDU(sky(), compression_type=codec)
    fits.HDUList([fits.PrimaryHDU(), image]).writeto(path)
    np.testing.assert_array_equal(read_frame(path).pixels, sky())


def packed(path, shape=(40, 50), **options):
    """A tile-compressed file, its header to be altered afterwards."""
    image = fits.CompImageHDU(np.zeros(shape, np.int16), compression_type="GZIP_1", **options)
    fits.HDUList([fits.PrimaryHDU(), image]).writeto(path, overwrite=True)
    return path


def altered(path, **cards):
    raw = path.read_bytes()
    for name, value in cards.items():
        start = raw.index(f"{name:8}= ".encode())
        raw = raw[:start] + f"{name:8}= {value:>20}".encode() + raw[start + 30 :]
    path.write_bytes(raw)
    return path


@pytest.mark.parametrize(
    "cards",
    [
        {"TFIELDS": 300_000_000},
        {"TFIELDS": 1000},
        {"TFIELDS": -1},
        {"NAXIS2": 300_000_000},
        {"NAXIS1": 300_000_000},
        {"ZNAXIS": 1000},
        {"ZNAXIS1": 300_000_000},
        {"ZNAXIS2": 100_000},
        {"ZTILE1": 300_000_000},
        {"ZTILE2": 0},
        {"ZTILE2": 41},
        {"ZTILE1": "'wide'"},
    ],
)
def test_absurd_tables_are_refused_before_anything_opens_them(tmp_path, monkeypatch, cards):
    path = altered(packed(tmp_path / "a.fits.fz"), **cards)

    def opened(*_, **__):
        raise AssertionError("astropy was asked")

    monkeypatch.setattr(fits, "open", opened)
    monkeypatch.setattr("kochab.frames.sandbox._inside", True)
    with pytest.raises(FrameError, match=r"^a\.fits\.fz (is|claims|packs) .*\.$") as told:
        read_frame(path)
    assert "decompress" not in str(told.value)


def test_a_table_of_absurd_width_before_the_image_is_refused(tmp_path):
    table = fits.BinTableHDU.from_columns([fits.Column("n", "J", array=np.arange(9))])
    path = tmp_path / "a.fits"
    fits.HDUList([fits.PrimaryHDU(), table, fits.CompImageHDU(sky())]).writeto(path)
    with pytest.raises(FrameError, match="claims a table of 300000000 columns"):
        read_frame(altered(path, TFIELDS=300_000_000))


def test_of_a_packed_cube_only_one_plane_is_unpacked(tmp_path, monkeypatch):
    monkeypatch.setattr("kochab.frames.sandbox._inside", True)  # where its memory is counted
    data = np.random.default_rng(6).integers(0, 60000, (2, 40, 300, 300)).astype(np.uint16)
    image = fits.CompImageHDU(data, compression_type="GZIP_1", tile_shape=(1, 1, 300, 300))
    path = tmp_path / "a.fits.fz"
    fits.HDUList([fits.PrimaryHDU(), image]).writeto(path)
    read_frame(path)  # imports are not counted
    tracemalloc.start()
    try:
        frame = read_frame(path)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    np.testing.assert_array_equal(frame.pixels, data[0, 0])
    assert peak < path.stat().st_size + 6 * frame.pixels.nbytes < data.nbytes + path.stat().st_size
    assert len(frame.warnings) == 2


def test_a_tile_of_many_planes_is_refused(tmp_path):
    path = packed(tmp_path / "a.fits.fz", (70, 500, 500), tile_shape=(70, 500, 500))
    assert path.stat().st_size < 100_000
    with pytest.raises(FrameError, match="packs 17500000 pixels into one tile"):
        read_frame(path)


@pytest.mark.parametrize("shape", [(1, 40, 50), (3, 40, 50), (40, 50, 3), (2, 1, 40, 50)])
def test_packed_cubes_are_read_as_plain_ones(tmp_path, shape):
    data = np.random.default_rng(7).integers(0, 60000, shape).astype(np.uint16)
    fits.HDUList([fits.PrimaryHDU(), fits.CompImageHDU(data)]).writeto(tmp_path / "a.fits.fz")
    plain = read_frame(write(tmp_path / "a.fits", data))
    frame = read_frame(tmp_path / "a.fits.fz")
    np.testing.assert_array_equal(frame.pixels, plain.pixels)
    assert (frame.colour is None) == (plain.colour is None)
    assert frame.warnings == plain.warnings


@pytest.mark.parametrize(("suffix", "pack"), [("gz", gzip.compress), ("bz2", bz2.compress)])
def test_packed_files(suffix, pack, tmp_path):
    plain = write(tmp_path / "a.fits", sky())
    packed = tmp_path / f"b.fit.{suffix}"
    packed.write_bytes(pack(plain.read_bytes()))
    np.testing.assert_array_equal(read_frame(packed).pixels, sky())
    packed.write_bytes(packed.read_bytes()[:-2000])
    with pytest.raises(FrameError, match="unzip"):
        read_frame(packed)
    packed.write_bytes(pack(plain.read_bytes())[:200] + b"no more of it" * 50)
    with pytest.raises(FrameError, match="unzip"):
        read_frame(packed)
    packed.write_bytes(pack(b"a poem"))
    with pytest.raises(FrameError, match="no FITS"):
        read_frame(packed)


def test_a_compressed_image_in_a_bzipped_file(tmp_path):
    fits.HDUList([fits.PrimaryHDU(), fits.CompImageHDU(sky())]).writeto(tmp_path / "a.fits")
    (tmp_path / "a.fits.bz2").write_bytes(bz2.compress((tmp_path / "a.fits").read_bytes()))
    np.testing.assert_array_equal(read_frame(tmp_path / "a.fits.bz2").pixels, read_frame(tmp_path / "a.fits").pixels)


def test_cards_that_break_the_standard_cost_a_warning(tmp_path):
    path = write(tmp_path / "a.fits", sky(), OBJECT="x" * 12, EXPTIME=30.0)
    raw = path.read_bytes()
    for old, new in ((b"'xxxxxxxxxxxx'", b"NGC 1, bright!"), (b"EXPTIME =", b"EXPT ME =")):
        assert old in raw
        raw = raw.replace(old, new)
    path.write_bytes(raw)
    frame = read_frame(path)
    np.testing.assert_array_equal(frame.pixels, sky())
    assert "OBJECT" in frame.warnings[0]


def test_a_real_header_that_breaks_the_standard(shared_frames):
    frame = read_frame(shared_frames / "apt2032.fits")
    assert frame.pixels.shape == (288, 407)
    assert "INSTRUME" in frame.warnings[0]
    assert frame.hint.exposure_s == 30.0
    ra, dec, _ = frame.hint.centre_deg  # "05 29 34" without its quotes still means something
    assert ra == pytest.approx((5 + 29 / 60 + 34 / 3600) * 15)
    assert dec == pytest.approx(-(58 + 54 / 60 + 28 / 3600))


@pytest.mark.parametrize("keep", [100, 2880, 2881, 4000, -3000])
def test_cut_short(tmp_path, keep):
    path = write(tmp_path / "a.fits", sky())
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(FrameError, match="cut short"):
        read_frame(path)


def test_missing_padding_is_no_loss(tmp_path):
    path = write(tmp_path / "a.fits", sky())
    path.write_bytes(path.read_bytes()[: 2880 + sky().nbytes])
    np.testing.assert_array_equal(read_frame(path).pixels, sky())


@pytest.mark.parametrize(
    ("axes", "said"),
    [
        ((10**9, 10**9), "million"),
        ((10**9, 2), "million"),
        ((10**6, 10), "million"),
        ((1, 1), "no image"),
        ((0, 10), "without pixels"),
        ((-5, 10), "negative"),
        ((10,), "no image"),
        ((3, 10**5, 10**5), "million"),
    ],
)
def test_absurd_sizes(tmp_path, axes, said):
    cards = {f"NAXIS{i + 1}": n for i, n in enumerate(axes)}
    path = header_only(tmp_path / "a.fits", SIMPLE="T", BITPIX=16, NAXIS=len(axes), **cards)
    with pytest.raises(FrameError, match=said):
        read_frame(path)


@pytest.mark.parametrize("table", [fits.BinTableHDU, fits.TableHDU])
@pytest.mark.parametrize("name", ["stars.fits", "stars.fits.gz"])
def test_a_table_without_an_image_says_what_to_give(tmp_path, table, name):
    """As astrometry.net leaves them beside a frame: .axy, .corr, .rdls."""
    column = fits.Column("X", "E" if table is fits.BinTableHDU else "F8.2", array=np.arange(5.0))
    fits.HDUList([fits.PrimaryHDU(), table.from_columns([column])]).writeto(tmp_path / name)
    with pytest.raises(FrameError) as told:
        read_frame(tmp_path / name)
    assert str(told.value) == f"{name} holds a table and no image: give the frame that it was made from."


@pytest.mark.parametrize("cards", [{"BITPIX": 7}, {"NAXIS": 5000}, {"NAXIS": "'two'"}, {"BITPIX": "F"}])
def test_senseless_headers(tmp_path, cards):
    good = {"SIMPLE": "T", "BITPIX": 16, "NAXIS": 2, "NAXIS1": 20, "NAXIS2": 20}
    path = header_only(tmp_path / "a.fits", **{**good, **cards})
    with pytest.raises(FrameError, match="damaged"):
        read_frame(path)


def test_nothing_but_undefined_pixels(tmp_path):
    path = write(tmp_path / "a.fits", np.full((20, 30), np.nan, np.float32))
    with pytest.raises(FrameError, match="no pixel with a value"):
        read_frame(path)


def test_some_undefined_pixels_become_background(tmp_path):
    data = sky().astype(np.float32)
    data[3, 4], data[5, 6] = np.nan, np.inf
    frame = read_frame(write(tmp_path / "a.fits", data))
    assert frame.pixels[3, 4] == pytest.approx(1000, abs=20)
    assert frame.pixels[5, 6] == pytest.approx(1000, abs=20)
    assert frame.warnings[0].startswith("2 pixels")


@pytest.mark.parametrize(
    ("cards", "pattern"),
    [
        ({"BAYERPAT": "RGGB"}, "RGGB"),
        ({"BAYERPAT": "rggb ", "XBAYROFF": 1}, "GRBG"),
        ({"COLORTYP": "RGGB", "YBAYROFF": 1.0}, "GBRG"),
        ({"BAYERPAT": "RGGB", "XBAYROFF": 1, "YBAYROFF": 1}, "BGGR"),
        ({"BAYERPAT": "RGGB", "XBAYROFF": "?"}, "RGGB"),
        ({"BAYERPAT": "RGGB", "ROWORDER": "BOTTOM-UP"}, "GBRG"),
        ({"BAYERPAT": "X-Trans"}, None),
        ({"FILTER": "V"}, None),
    ],
)
def test_bayer_patterns(cards, pattern):
    assert bayer_pattern(cards, 48) == pattern


@given(st.sampled_from(["RGGB", "BGGR", "GRBG", "GBRG"]), st.integers(-9, 9), st.integers(-9, 9))
def test_shifting_a_pattern_and_back(pattern, x, y):
    assert shifted(shifted(pattern, x, y), -x, -y) == pattern


@given(
    st.one_of(
        st.booleans(),
        st.integers(-(2**60), 2**60),
        st.floats(-1e30, 1e30),
        st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=30),
    )
)
def test_values_as_astropy_writes_them(value):
    card = str(fits.Card("KEY", value))
    read, _, ok = parse_value(card[10:])
    assert ok
    wanted = value.rstrip() if isinstance(value, str) else value
    assert read == (pytest.approx(wanted, rel=1e-12) if isinstance(value, float) else wanted)


def test_saturation_from_the_header(tmp_path):
    assert read_frame(write(tmp_path / "a.fits", sky(), SATURATE=4095)).saturation == 4095
    assert read_frame(write(tmp_path / "a.fits", sky())).saturation == 65535
    assert read_frame(write(tmp_path / "a.fits", sky(), SATURATE="high")).saturation == 65535


def test_a_packed_image_of_nothing_is_refused(tmp_path):
    path = tmp_path / "a.fits.fz"
    image = fits.CompImageHDU(np.zeros((9000, 9000), np.int16), compression_type="GZIP_1", tile_shape=(900, 9000))
    fits.HDUList([fits.PrimaryHDU(), image]).writeto(path)
    assert path.stat().st_size < 300_000
    with pytest.raises(FrameError, match="no camera's image packs so small"):
        read_frame(path)


def test_of_a_gzipped_file_only_what_is_needed_is_unzipped(tmp_path, monkeypatch):
    path = tmp_path / "a.fits.gz"
    with gzip.open(path, "wb", compresslevel=1) as file:
        file.write(write(tmp_path / "a.fits", np.stack([sky(), sky()])).read_bytes())
        for _ in range(300):
            file.write(bytes(1_000_000))
    monkeypatch.setattr("kochab.frames.sandbox._inside", True)
    tracemalloc.start()
    try:
        frame = read_frame(path)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    np.testing.assert_array_equal(frame.pixels, sky())
    assert peak < 5_000_000
