"""What headers and EXIF say becomes a hint; what makes no sense becomes nothing."""

from datetime import UTC, datetime

import numpy as np
import pytest
from astropy import wcs
from astropy.coordinates import SkyCoord
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from kochab.frames import read_frame
from kochab.frames.hints import (
    Exif,
    aware_utc,
    hint_from_exif,
    hint_from_keywords,
    scale_range,
    sexagesimal,
    site_or_none,
)

SHAPE = (1000, 1500)


def hint(comments=None, **values):
    return hint_from_keywords({k.replace("_", "-"): v for k, v in values.items()}, comments or {}, SHAPE)[0]


def exif_hint(size=(6000, 4000), gps=None, main=None, **photo):
    tags = {int(k[1:]): v for k, v in photo.items()}
    return hint_from_exif(Exif({**(main or {}), **tags}, gps or {}), size)[0]


def holds(span, value):
    return span is not None and span[0] < value < span[1]


@pytest.mark.parametrize(
    ("values", "arcsec"),
    [
        ({"FOCALLEN": 400.0, "XPIXSZ": 3.76}, 1.939),
        ({"FOCALLEN": "400", "XPIXSZ": "3.76"}, 1.939),
        ({"FOCALLEN": 400, "PIXSIZE1": 3.76, "XBINNING": 2}, 3.878),
        ({"SCALE": 2.5}, 2.5),
        ({"PIXSCALE": 2.5, "FOCALLEN": 0, "XPIXSZ": 0}, 2.5),
        ({"SECPIX1": 1.2}, 1.2),
    ],
)
def test_scale(values, arcsec):
    low, high = hint(**values).scale_arcsec_px
    assert low == pytest.approx(0.85 * arcsec, rel=1e-3)
    assert high == pytest.approx(1.15 * arcsec, rel=1e-3)


def test_scale_of_a_binned_frame_allows_both_meanings_of_xpixsz():
    values = {"FOCALLEN": 400.0, "XPIXSZ": 3.76, "XBINNING": 2}
    low, high = hint(**values).scale_arcsec_px
    assert low < 1.939 < 3.878 < high
    told = hint(comments={"XPIXSZ": "Pixel width in microns (after binning)"}, **values)
    assert holds(told.scale_arcsec_px, 1.939)
    assert not holds(told.scale_arcsec_px, 3.878)


WCS = {"CTYPE1": "RA---TAN", "CTYPE2": "DEC--TAN", "CRVAL1": 83.6, "CRVAL2": -5.4}


@pytest.mark.parametrize(
    "linear",
    [
        {"CD1-1": 0.0, "CD1-2": 5e-4, "CD2-1": -5e-4, "CD2-2": 0.0},
        {"CDELT1": -5e-4, "CDELT2": 5e-4, "CROTA2": 30.0},
        {"CDELT1": 1.0, "CDELT2": 1.0, "PC1-1": 4e-4, "PC1-2": 3e-4, "PC2-1": -3e-4, "PC2-2": 4e-4},
    ],
)
def test_scale_and_centre_of_a_wcs(linear):
    linear = {k.replace("-", "_"): v for k, v in linear.items()}
    got, _ = hint_from_keywords({**WCS, **linear, "CRPIX1": 750, "CRPIX2": 500}, {}, SHAPE)
    assert holds(got.scale_arcsec_px, 1.8)
    assert got.centre_deg[:2] == (83.6, -5.4)
    assert 2.0 < got.centre_deg[2] < 4.0


def test_a_reference_point_far_off_the_frame_widens_the_radius():
    values = {**WCS, "CDELT1": -0.01, "CDELT2": 0.01, "CRPIX1": 3750.0, "CRPIX2": 500.0}
    got, _ = hint_from_keywords(values, {}, SHAPE)
    assert got.centre_deg[2] > 30.0


@pytest.mark.parametrize(("crpix1", "crpix2"), [(3750.0, 500.0), (750.0, 3500.0), (2550.0, 2900.0), (-1050.0, 2900.0)])
def test_the_centre_is_within_the_radius_wherever_the_reference_point_is(crpix1, crpix2):
    header = {**WCS, "CDELT1": -0.01, "CDELT2": 0.01, "CRPIX1": crpix1, "CRPIX2": crpix2}
    got, _ = hint_from_keywords(header, {}, SHAPE)
    centre = wcs.WCS(header).pixel_to_world((SHAPE[1] - 1) / 2, (SHAPE[0] - 1) / 2)
    ra, dec, radius = got.centre_deg
    assert centre.separation(SkyCoord(ra, dec, unit="deg")).deg < radius < 60.0


def test_a_linear_axis_is_no_sky():
    assert hint(CTYPE1="WAVE", CDELT1=1e-4, CDELT2=1e-4).scale_arcsec_px is None


@pytest.mark.parametrize(
    ("values", "ra", "dec"),
    [
        ({"RA": 83.5, "DEC": -5.5}, 83.5, -5.5),
        ({"RA": "5 34 00", "DEC": "-05 30 00"}, 83.5, -5.5),
        ({"OBJCTRA": "05:34:00.0", "OBJCTDEC": "-00 30 00"}, 83.5, -0.5),
        ({"RA_MNT": 301.5, "DEC_MNT": 44.4}, 301.5, 44.4),
        ({"RA": "", "DEC": None, "TELRA": "12:00:00", "TELDEC": "+10:00:00"}, 180.0, 10.0),
        ({"RA": 0.0, "DEC": 0.0, "OBJCTRA": "12 00 00", "OBJCTDEC": "+10 00 00"}, 180.0, 10.0),
    ],
)
def test_pointing(values, ra, dec):
    got = hint(**values).centre_deg
    assert got[:2] == pytest.approx((ra, dec))
    assert got[2] >= 10.0


@pytest.mark.parametrize(
    "values", [{"RA": 83.5}, {"RA": "25 00 00", "DEC": "10 00 00"}, {"RA": 83.5, "DEC": 95.0}, {"RA": "x", "DEC": "y"}]
)
def test_senseless_pointing(values):
    assert hint(**values).centre_deg is None


@pytest.mark.parametrize(
    ("values", "wanted"),
    [
        ({"DATE_OBS": "2024-03-05T20:00:00", "EXPTIME": 60.0}, "2024-03-05T20:00:30"),
        ({"DATE_OBS": "2024-03-05T20:00:00.1234567Z"}, "2024-03-05T20:00:00.123456"),
        ({"DATE_OBS": "2024-03-05T20:00:00-0700"}, "2024-03-06T03:00:00"),
        ({"DATE_OBS": "2024-03-05", "TIME_OBS": "20:00:00"}, "2024-03-05T20:00:00"),
        ({"DATE_OBS": "2024-03-05", "TIME_OBS": "20:34"}, "2024-03-05T20:34:00"),
        ({"DATE_OBS": "2024-03-05", "TIME_OBS": "9:05:07.5"}, "2024-03-05T09:05:07.500"),
        ({"DATE_OBS": "05/03/99", "UT": "20:00:00"}, "1999-03-05T20:00:00"),
        ({"DATE_AVG": "2024-03-05T20:00:30", "DATE_OBS": "2024-03-05T20:00:00", "EXPTIME": 9}, "2024-03-05T20:00:30"),
        ({"MJD_OBS": 60374.5, "EXPOSURE": 20}, "2024-03-05T12:00:10"),
        ({"JD": 2460375.0}, "2024-03-05T12:00:00"),
    ],
)
def test_time_is_the_middle_of_the_exposure_in_utc(values, wanted):
    assert hint(**values).time_utc == datetime.fromisoformat(wanted).replace(tzinfo=UTC)


def test_a_date_that_is_none_is_said():
    got, warnings = hint_from_keywords({"DATE-OBS": "yesterday"}, {}, SHAPE)
    assert got.time_utc is None
    assert "DATE-OBS" in warnings[0]


@pytest.mark.parametrize(
    ("values", "place"),
    [
        ({"SITELAT": "+41 43 00", "SITELONG": "-70 38 00"}, (41.7167, -70.6333)),
        ({"LAT_OBS": 19.54, "LONG_OBS": -155.58, "ELEV_OBS": 3400.0}, (19.54, -155.58)),
        ({"SITELAT": "33 S", "SITELONG": "18.5 E"}, (-33.0, 18.5)),
        ({"SITELAT": 10.0, "SITELONG": 289.5}, (10.0, -70.5)),
    ],
)
def test_site(values, place):
    site = hint(**values).site
    assert (site.latitude_deg, site.longitude_deg) == pytest.approx(place, abs=1e-4)
    assert site.height_m == values.get("ELEV_OBS", 0.0)


@pytest.mark.parametrize("values", [{"SITELAT": 95.0, "SITELONG": 0.0}, {"SITELAT": 0, "SITELONG": 0}, {"SITELAT": 5}])
def test_senseless_site(values):
    assert hint(**values).site is None


def test_real_headers_agree_with_their_frames(shared_frames):
    """Every hint a real FITS header gives contains the truth."""
    import json

    truth = json.loads((shared_frames / "truth.json").read_text())["frames"]
    scales = centres = 0
    for name, true in truth.items():
        if ".fit" not in name.lower() or true.get("ra_deg") is None:
            continue
        frame = read_frame(shared_frames / name)
        if frame.hint.scale_arcsec_px:
            scales += 1
            assert holds(frame.hint.scale_arcsec_px, true["fov_deg"][0] * 3600 / frame.width), name
        if frame.hint.centre_deg:
            centres += 1
            ra, dec, radius = frame.hint.centre_deg
            assert np.hypot((ra - true["ra_deg"]) * np.cos(np.radians(dec)), dec - true["dec_deg"]) < radius
    assert scales >= 3
    assert centres >= 4


def test_exif_focal_length_and_sensor_resolution():
    # 35.9 mm over 6000 px behind 50 mm; the resolution tag counts pixels a centimetre
    got = exif_hint(_37386=50.0, _41486=6000 / 3.59, _41488=3, _40962=6000, _40963=4000)
    assert holds(got.scale_arcsec_px, 206265 * 35.9 / 6000 / 50)
    smaller = exif_hint((3000, 2000), _37386=50.0, _41486=6000 / 3.59, _41488=3, _40962=6000, _40963=4000)
    assert holds(smaller.scale_arcsec_px, 206265 * 35.9 / 3000 / 50)


def test_exif_equivalent_focal_length():
    got = exif_hint(_41989=50)
    assert holds(got.scale_arcsec_px, 206265 * 36 / 6000 / 50)


@pytest.mark.parametrize(
    "tags",
    [
        {},
        {"_37386": 0.0, "_41486": 1000.0},
        {"_37386": float("nan"), "_41486": 5.0},
        {"_37386": 50.0, "_41486": 1e-9},
        {"_41989": 0},
        {"_37386": "wide", "_41989": b"\x00"},
    ],
)
def test_exif_without_sense_gives_no_scale(tags):
    assert exif_hint(**tags).scale_arcsec_px is None


def test_exif_clocks():
    local = exif_hint(_36867="2024:03:05 21:00:00", _36881="+01:00", _33434=20.0)
    assert local.time_utc == datetime(2024, 3, 5, 20, 0, 10, tzinfo=UTC)
    gps = {29: "2024:03:05", 7: (20.0, 0.0, 5.0)}
    fix = exif_hint(gps=gps, _36867="2024:03:05 21:00:07")
    assert fix.time_utc == datetime(2024, 3, 5, 20, 0, 5, tzinfo=UTC)
    got, _, warnings = hint_from_exif(Exif({36867: "2024:03:05 21:00:00"}), (60, 40))
    assert got.time_utc == datetime(2024, 3, 5, 21, tzinfo=UTC)
    assert "time zone" in warnings[0]


def test_exif_place():
    gps = {1: "S", 2: (33.0, 30.0, 0.0), 3: "W", 4: (70.0, 0.0, 36.0), 5: b"\x00", 6: 2400.0}
    site = exif_hint(gps=gps).site
    assert (site.latitude_deg, site.longitude_deg, site.height_m) == pytest.approx((-33.5, -70.01, 2400))


def test_exif_reaches_the_hint_through_files(tmp_path):
    exif = Image.Exif()
    exif[271], exif[272] = "Maker", "Camera 7"
    exif.get_ifd(0x8769).update({37386: 24.0, 41989: 36})
    old = Image.__version__ < "11"  # which writes it into no TIFF
    for name in ("a.jpg", "a.png", "a.webp") + (() if old else ("a.tif",)):
        # Pillow writes it into a TIFF only from a directory given whole, and 10.3 into nothing else.
        if old or name == "a.tif":
            exif[0x8769] = {37386: 24.0, 41989: 36}
        Image.new("L", (600, 400), 9).save(tmp_path / name, exif=exif)
        frame = read_frame(tmp_path / name)
        assert frame.hint.camera == "Maker Camera 7", name
        assert frame.hint.scale_arcsec_px is not None, name
        assert frame.header["FocalLength"] == 24.0


@given(
    st.dictionaries(
        st.sampled_from(
            [
                "RA",
                "DEC",
                "OBJCTRA",
                "OBJCTDEC",
                "FOCALLEN",
                "XPIXSZ",
                "XBINNING",
                "SCALE",
                "CTYPE1",
                "CTYPE2",
                "CRVAL1",
                "CRVAL2",
                "CRPIX1",
                "CD1_1",
                "CD2_2",
                "CDELT1",
                "CDELT2",
                "DATE-OBS",
                "DATE-AVG",
                "TIME-OBS",
                "MJD-OBS",
                "JD",
                "EXPTIME",
                "SITELAT",
                "SITELONG",
                "SITEELEV",
                "INSTRUME",
            ]
        ),
        st.one_of(
            st.none(),
            st.booleans(),
            st.integers(),
            st.floats(),
            st.text(max_size=20),
            st.just("RA---TAN"),
            st.just("DEC--TAN"),
        ),
    )
)
def test_no_header_can_break_the_reader(values):
    got, _ = hint_from_keywords(values, {}, SHAPE)
    if got.scale_arcsec_px:
        assert 0 < got.scale_arcsec_px[0] < got.scale_arcsec_px[1] < 30000
    if got.centre_deg:
        assert 0 <= got.centre_deg[0] < 360
        assert abs(got.centre_deg[1]) <= 90
        assert 0 < got.centre_deg[2] <= 180
    assert got.time_utc is None or got.time_utc.tzinfo is not None


_ANY = st.one_of(
    st.none(),
    st.integers(),
    st.floats(),
    st.text(max_size=20),
    st.binary(max_size=9),
    st.tuples(st.floats(), st.floats(), st.floats()),
)


@given(
    st.dictionaries(st.sampled_from([271, 272, 306]), _ANY),
    st.dictionaries(st.sampled_from([33434, 36867, 36881, 37386, 40962, 41486, 41488, 41989, 42036]), _ANY),
    st.dictionaries(st.sampled_from([1, 2, 3, 4, 5, 6, 7, 29]), _ANY),
)
def test_no_exif_can_break_the_reader(main, photo, gps):
    got, _, _ = hint_from_exif(Exif({**main, **photo}, gps), (600, 400))
    assert got.site is None or abs(got.site.latitude_deg) <= 90


@given(st.integers(-89, 89), st.integers(0, 59), st.integers(0, 599))
def test_sexagesimal_there_and_back(degrees, minutes, tenths):
    sign = "-" if degrees < 0 else "+"
    for text in (
        f"{sign}{abs(degrees):02d} {minutes:02d} {tenths / 10:04.1f}",
        f"{sign}{abs(degrees)}:{minutes}:{tenths / 10}",
    ):
        size = abs(degrees) + minutes / 60 + tenths / 36000
        assert sexagesimal(text) == pytest.approx(-size if sign == "-" else size)


def test_what_is_believed():
    assert scale_range(0.0) is None
    assert scale_range(1e6) is None
    assert aware_utc("0001-01-01T00:00:00") is None
    assert aware_utc("2024-02-30") is None
    assert site_or_none(float("nan"), 1.0) is None
