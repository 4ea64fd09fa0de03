"""Hints from what a file says of itself: FITS keywords, under their many names, and EXIF tags."""

import math
import re
from collections.abc import Mapping
from dataclasses import field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from kochab.core.arrays import Array
from kochab.core.frame import Frame, Hint, Site
from kochab.core.values import frozen, mutable
from kochab.frames.samples import bayer_pattern, clipping_level, finite, number_or_none, split
from kochab.text.translation import tr, tr_noop

# Every hint passes these limits; what no camera, clock or site can have becomes None.

SPREAD = 0.15
_SCALE_LIMITS_ARCSEC = (0.02, 1500.0)
_YEARS = (1850, 2150)
# Compiled when first used: a command that has no need of it is 3 ms faster.
_SEXAGESIMAL = r"\s*([+-]?)\s*(\d{1,3})\s*[:hd°\s]\s*(\d{1,2})\s*(?:[:m'\s]\s*(\d{1,2}(?:\.\d*)?))?\s*[s\"]?\s*$"


def scale_range(scale_arcsec: float | None, spread: float = SPREAD) -> tuple[float, float] | None:
    """A range about a pixel scale, None when no camera of the sky has it."""
    low, high = _SCALE_LIMITS_ARCSEC
    if scale_arcsec is None or not low <= scale_arcsec <= high:
        return None
    return scale_arcsec * (1.0 - spread), scale_arcsec * (1.0 + spread)


def exposure_or_none(seconds: float | None) -> float | None:
    """An exposure between a microsecond and a day."""
    return seconds if seconds is not None and 1e-6 <= seconds <= 86400.0 else None


def sexagesimal(value: Any) -> float | None:
    """``12 34 56.7``, ``12:34:56.7``, ``-00h12m`` as a number of the first unit; else None."""
    match = re.match(_SEXAGESIMAL, value) if isinstance(value, str) else None
    if not match:
        return None
    minutes, seconds = float(match[3]), float(match[4] or 0.0)
    if minutes >= 60.0 or seconds >= 61.0:  # 61: a leap second
        return None
    size = float(match[2]) + minutes / 60.0 + seconds / 3600.0
    return -size if match[1] == "-" else size


def site_or_none(latitude_deg: float | None, longitude_deg: float | None, height_m: float | None = None) -> Site | None:
    """A place on the Earth; programs write (0, 0) for an unknown one."""
    if latitude_deg is None or longitude_deg is None or not abs(latitude_deg) <= 90.0:
        return None
    if longitude_deg > 180.0:
        longitude_deg -= 360.0
    if not abs(longitude_deg) <= 180.0 or (latitude_deg == 0.0 and longitude_deg == 0.0):
        return None
    if height_m is None or not -500.0 <= height_m <= 9000.0:
        height_m = 0.0
    return Site(latitude_deg, longitude_deg, height_m)


def aware_utc(text: str) -> datetime | None:
    """A date in the ISO manner (or the old FITS ``dd/mm/yy``) as UTC; without a zone it is UTC."""
    text = text.strip()
    old = re.match(r"(\d{2})/(\d{2})/(\d{2})(T.*)?$", text)
    if old:
        # FITS: a year of two digits is of 1900 to 1999.
        text = f"19{old[3]}-{old[2]}-{old[1]}{old[4] or ''}"
    try:
        time = datetime.fromisoformat(text)
    except ValueError:
        return None
    if not _YEARS[0] <= time.year <= _YEARS[1]:
        return None
    return time.replace(tzinfo=UTC) if time.tzinfo is None else time.astimezone(UTC)


def utc_of_mjd(days: float | None) -> datetime | None:
    """A modified Julian date as UTC."""
    if days is None or not -3_300.0 < days < 106_000.0:
        return None
    return datetime(1858, 11, 17, tzinfo=UTC) + timedelta(days=days)


Keywords = Mapping[str, Any]

_SCALE_NAMES = ("SCALE", "PIXSCALE", "PIXSCAL1", "SECPIX", "SECPIX1", "IM_SCALE", "IMGSCALE")
_POINTING = (
    ("RA", "DEC"),
    ("OBJCTRA", "OBJCTDEC"),
    ("TELRA", "TELDEC"),
    ("RA-MNT", "DEC-MNT"),
    ("TELESRA", "TELESDEC"),
    ("RA_OBJ", "DEC_OBJ"),
    ("RA_TARG", "DEC_TARG"),
)
_HORIZONTAL = (
    (("OBJCTRA", "OBJCTDEC"), ("OBJCTALT", "OBJCTAZ")),
    (("RA", "DEC"), ("CENTALT", "CENTAZ")),
    (("RA", "DEC"), ("TELALT", "TELAZ")),
    (("TELRA", "TELDEC"), ("TELALT", "TELAZ")),
)
"""Where a program or its mount looked, and its altitude and azimuth (MaxIm DL, N.I.N.A., observatories)."""
_LATITUDES = ("SITELAT", "LAT-OBS", "OBSGEO-B", "OBSLAT", "LATITUDE", "OBS-LAT", "LAT", "GEOLAT")
_LONGITUDES = ("SITELONG", "LONG-OBS", "OBSGEO-L", "OBSLONG", "LONGITUD", "OBS-LONG", "LONG", "GEOLON")
_HEIGHTS = ("SITEELEV", "ALT-OBS", "ELEV-OBS", "OBSGEO-H", "OBSALT", "ALTITUDE", "ELEVATIO")
_CAMERAS = ("INSTRUME", "CAMERA", "CAM-NAME", "DETECTOR")
_CLOCKS = ("TIME-OBS", "UT", "UTC", "UT-OBS", "UTSTART", "TIME-BEG", "UT_START")

_POINTING_RADIUS_DEG = 10.0
_WCS_RADIUS_DEG = 2.0


def hint_from_keywords(
    values: Keywords, comments: Mapping[str, str], shape: tuple[int, ...]
) -> tuple[Hint, tuple[str, ...]]:
    """Hints in a header, and warnings about keywords that make no sense: they only leave their part empty.

    ``values`` and ``comments`` are by keyword; ``shape`` is (height, width) px of the frame.
    """
    height, width = shape[:2]
    scale, scale_from = _scale(values, comments)
    field_deg = scale[1] * math.hypot(height, width) / 3600.0 if scale else 0.0
    centre, centre_from = _centre(values, comments, scale, field_deg, (height, width))
    exposure = exposure_or_none(_number(values, "EXPTIME", "EXPOSURE", "EXP_TIME", "ITIME", "ELAPTIME"))
    time = _time(values, exposure)
    doubtful = bool(values.get("DATE-OBS")) and time is None
    hint = Hint(
        scale_arcsec_px=scale,
        centre_deg=centre,
        time_utc=time,
        exposure_s=exposure,
        site=_site(values),
        camera=_text(values, _CAMERAS),
        source=", ".join(dict.fromkeys(s for s in (scale_from, centre_from) if s)),
    )
    return hint, (tr("DATE-OBS in the header is not a valid date."),) * doubtful


def _scale(values: Keywords, comments: Mapping[str, str]) -> tuple[tuple[float, float] | None, str]:
    if scale := scale_range(_wcs_scale(values)):
        return scale, "WCS in the header"
    for name in _SCALE_NAMES:
        if scale := scale_range(_number(values, name)):
            return scale, name
    focal_mm = _number(values, "FOCALLEN") or _number(values, "FOCAL")
    if not focal_mm or not 1.0 <= focal_mm <= 100_000.0:
        return None, ""
    for name in ("XPIXSZ", "PIXSIZE1", "PIXSIZE"):
        pitch_um = _number(values, name)
        if pitch_um and 0.3 <= pitch_um <= 200.0:
            arcsec = math.degrees(pitch_um / 1000.0 / focal_mm) * 3600.0
            binning = min(max(_number(values, "XBINNING") or 1.0, 1.0), 16.0)
            low = arcsec * binning if name.startswith("PIXSIZE") else arcsec
            # Programs disagree whether XPIXSZ is before or after binning: allow both.
            stated = "binn" in comments.get(name, "").lower() and name == "XPIXSZ"
            high = low if stated else arcsec * binning
            lower, upper = scale_range(low), scale_range(high)
            if lower and upper:
                return (lower[0], upper[1]), f"FOCALLEN and {name}"
    return None, ""


def _wcs_scale(values: Keywords) -> float | None:
    """Arcseconds a pixel of a celestial WCS, the root of its determinant (FITS paper II)."""
    if not _celestial(values):
        return None
    cd = [_number(values, f"CD{i}_{j}") for i in (1, 2) for j in (1, 2)]
    if any(c is not None for c in cd):
        a, b, c, d = (x or 0.0 for x in cd)
        area = abs(a * d - b * c)
    else:
        dx, dy = _number(values, "CDELT1"), _number(values, "CDELT2")
        if dx is None or dy is None:
            return None
        a, d = (_number_or(values, f"PC{i}_{i}", 1.0) for i in (1, 2))
        b, c = _number_or(values, "PC1_2", 0.0), _number_or(values, "PC2_1", 0.0)
        area = abs(dx * dy * (a * d - b * c))
    return math.sqrt(area) * 3600.0 if math.isfinite(area) else None


def _celestial(values: Keywords) -> bool:
    kinds = {str(values.get(f"CTYPE{i}", ""))[:4].strip("-") for i in (1, 2)}
    return kinds in ({"RA", "DEC"}, {"GLON", "GLAT"}, {"ELON", "ELAT"})


def _centre(
    values: Keywords,
    comments: Mapping[str, str],
    scale: tuple[float, float] | None,
    field_deg: float,
    shape: tuple[int, int],
) -> tuple[tuple[float, float, float] | None, str]:
    if str(values.get("CTYPE1", "")).startswith("RA") and scale:
        ra_dec = _on_sky(_number(values, "CRVAL1"), _number(values, "CRVAL2"))
        x = _number_or(values, "CRPIX1", shape[1] / 2.0) - shape[1] / 2.0
        y = _number_or(values, "CRPIX2", shape[0] / 2.0) - shape[0] / 2.0
        # CRVAL is the place of CRPIX, which may lie far outside a cropped frame.
        radius = _WCS_RADIUS_DEG + field_deg + scale[1] * math.hypot(x, y) / 3600.0
        if ra_dec and radius < 180.0:
            return (*ra_dec, radius), "WCS in the header"
    for ra_name, dec_name in _POINTING:
        ra = _right_ascension(values.get(ra_name), ra_name, comments.get(ra_name, ""))
        ra_dec = _on_sky(ra, _degrees(values.get(dec_name)))
        if ra_dec and ra_dec != (0.0, 0.0):  # programs write zeros for an unknown place
            radius = min(_POINTING_RADIUS_DEG + field_deg, 180.0)
            return (*ra_dec, radius), f"{ra_name} and {dec_name}"
    return None, ""


@frozen
class Aim:
    """A place on the sky, degrees, and where over the horizon a program or a mount had it: altitude, azimuth, degrees.

    It is not where the frame looks, but it tells the sidereal time that they reckoned with, and their latitude.
    """

    ra_dec_deg: tuple[float, float]
    altaz_deg: tuple[float, float]


def aim_from_keywords(values: Keywords) -> Aim | None:
    """What a header says of the horizon; None where it says nothing, or nonsense."""
    for (ra_name, dec_name), (alt_name, az_name) in _HORIZONTAL:
        ra_dec = _on_sky(_right_ascension(values.get(ra_name), ra_name, ""), _degrees(values.get(dec_name)))
        altitude, azimuth = _degrees(values.get(alt_name)), _degrees(values.get(az_name))
        if ra_dec is None or altitude is None or azimuth is None:
            continue
        if abs(altitude) <= 90.0 and 0.0 <= azimuth <= 360.0 and (altitude, azimuth) != (0.0, 0.0):
            return Aim(ra_dec, (altitude, azimuth))
    return None


def zone_from_keywords(values: Keywords) -> float | None:
    """Hours that a header's local time is ahead of UTC (DATE-LOC, or a zone in DATE-OBS); None where it is not said.

    Zero is no local time: programs that only know UTC write it twice.
    """
    own, local = (_iso(values.get(name)) for name in ("DATE-OBS", "DATE-LOC"))
    ahead = own.utcoffset() if own is not None else None
    if own is not None and local is not None:
        ahead = local.replace(tzinfo=None) - (own.astimezone(UTC) if own.tzinfo else own).replace(tzinfo=None)
    quarters = round(ahead.total_seconds() / 900.0) if ahead is not None else 0
    return quarters / 4.0 if 0 < abs(quarters) <= 56 else None


def _iso(value: Any) -> datetime | None:
    try:
        return datetime.fromisoformat(str(value or "").strip())
    except ValueError:
        return None


def _right_ascension(value: Any, name: str, comment: str) -> float | None:
    hours = sexagesimal(value)
    if hours is not None:
        return hours * 15.0 if 0.0 <= hours < 24.0 else None
    number = number_or_none(value)
    if number is None:
        return None
    in_hours = (name == "OBJCTRA" and number < 24.0) or re.search(r"\bhours?\b", comment.lower())
    return number * 15.0 if in_hours else number


def _on_sky(ra_deg: float | None, dec_deg: float | None) -> tuple[float, float] | None:
    """RA in [0, 360) and Dec, or None when they are no place on the sky."""
    if ra_deg is None or dec_deg is None or not (abs(ra_deg) <= 360.0 and abs(dec_deg) <= 90.0):
        return None
    turned = ra_deg % 360.0
    return (turned if turned < 360.0 else 0.0), dec_deg  # the remainder alone may round up to 360


def _time(values: Keywords, exposure_s: float | None) -> datetime | None:
    for name in ("DATE-AVG", "DATE-MID"):
        if middle := aware_utc(str(values.get(name) or "")):
            return middle
    if middle := utc_of_mjd(_number(values, "MJD-AVG", "MJD-MID")):
        return middle
    half = timedelta(seconds=(exposure_s or 0.0) / 2.0)
    start = _start(values)
    return start + half if start else None


def _start(values: Keywords) -> datetime | None:
    for name in ("DATE-OBS", "DATE-BEG", "UT-OBS"):
        text = str(values.get(name) or "").strip().replace(" ", "T", 1)
        if "T" not in text and text:
            clocks = (str(values.get(n) or "").strip() for n in _CLOCKS)
            clock = next((c for c in clocks if re.match(r"\d{1,2}:\d{2}", c)), "")
            text = f"{text}T{'0' * (clock[1] == ':')}{clock}" if clock else text
        if start := aware_utc(text):
            return start
    if start := utc_of_mjd(_number(values, "MJD-OBS")):
        return start
    julian = _number(values, "JD")
    return utc_of_mjd(julian - 2_400_000.5) if julian else None


def _site(values: Keywords) -> Site | None:
    latitude = next((d for n in _LATITUDES if (d := _degrees(values.get(n))) is not None), None)
    longitude = next((d for n in _LONGITUDES if (d := _degrees(values.get(n))) is not None), None)
    return site_or_none(latitude, longitude, _number(values, *_HEIGHTS))


def _degrees(value: Any) -> float | None:
    """Degrees from a number or sexagesimal text, with an N, S, E or W at either end."""
    sign = 1.0
    if isinstance(value, str):
        text = value.strip().upper()
        match = re.fullmatch(r"([NSEW]?)\s*([^NSEW]*?)\s*([NSEW]?)", text)
        # "12D 30M 15S": the S is for seconds, not for south.
        if match and not (match[3] == "S" and re.search(r"[HDM]", match[2])):
            sign = -1.0 if {match[1], match[3]} & {"S", "W"} else 1.0
            value = match[2]
        value = value.lower()
    number = sexagesimal(value)
    number = number_or_none(value) if number is None else number
    return None if number is None else sign * number


def _number(values: Keywords, *names: str) -> float | None:
    """The first of the keywords that is a number."""
    return next((n for name in names if (n := number_or_none(values.get(name))) is not None), None)


def _number_or(values: Keywords, name: str, default: float) -> float:
    number = _number(values, name)
    return default if number is None else number


def _text(values: Keywords, names: tuple[str, ...]) -> str:
    return next((str(values[n]).strip() for n in names if str(values.get(n) or "").strip()), "")


# -- EXIF: focal length and sensor to scale, clock to UTC, satellite fix to site ----------------

NO_ZONE = tr_noop("The image has no time zone; its time is taken as UTC.")
_UNIT_MM = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}
_FULL_FRAME_DIAGONAL_MM = 43.2666
_SPREAD_FROM_35MM = 0.2


@mutable
class Exif:
    """The tags of the image and of its exposure, and those of the satellite fix: number -> value."""

    tags: dict[int, Any] = field(default_factory=dict)
    gps: dict[int, Any] = field(default_factory=dict)


def exif_of(source: Any) -> Exif:
    """Tags of a `PIL.Image.Exif`, of a block of bytes that begins like a TIFF (or ``Exif``), or of a TIFF-like file."""
    from PIL import Image

    block = source if isinstance(source, Image.Exif) else Image.Exif()
    try:
        if isinstance(source, Path):
            with source.open("rb") as file:
                block.load_from_fp(file)
                return exif_of(block)
        if isinstance(source, bytes):
            block.load(source)
        return Exif({**block, **block.get_ifd(0x8769)}, dict(block.get_ifd(0x8825)))
    except Exception:  # a damaged block is no hint, and no reason to refuse the picture
        return Exif()


def hint_from_exif(exif: Exif, size: tuple[int, int]) -> tuple[Hint, dict[str, Any], tuple[str, ...]]:
    """Hint, header and warnings from what a camera wrote beside its picture of ``size`` (width, height) px.

    The header holds the few tags people know by name, as text or numbers.
    """
    tags = exif.tags
    scale, source = _exif_scale(tags, size)
    exposure = exposure_or_none(_ratio(tags.get(33434)))
    time, doubts = _exif_time(tags, exif.gps, exposure)
    # Makers repeat their name in the model: "Canon Canon EOS 6D".
    camera = " ".join(dict.fromkeys(f"{_exif_text(tags.get(271))} {_exif_text(tags.get(272))}".split()))
    lens = _exif_text(tags.get(42036))
    hint = Hint(
        scale_arcsec_px=scale,
        time_utc=time,
        exposure_s=exposure,
        site=_exif_site(exif.gps),
        camera=", ".join(part for part in (camera, lens) if part),
        source=source or ("EXIF" if time else ""),
    )
    names = {271: "Make", 272: "Model", 42036: "LensModel", 36867: "DateTimeOriginal"}
    numbers = {37386: "FocalLength", 33434: "ExposureTime", 34855: "ISO", 33437: "FNumber"}
    header: dict[str, Any] = {n: text for t, n in names.items() if (text := _exif_text(tags.get(t)))}
    header |= {n: v for t, n in numbers.items() if (v := _ratio(tags.get(t))) is not None}
    return hint, header, doubts


def _exif_scale(tags: dict[int, Any], size: tuple[int, int]) -> tuple[tuple[float, float] | None, str]:
    focal_mm = _ratio(tags.get(37386))
    per_unit = _ratio(tags.get(41486))
    unit_mm = _UNIT_MM.get(int(_ratio(tags.get(41488)) or 2), 25.4)
    long_side = max(size)
    if focal_mm and per_unit and focal_mm > 0 and per_unit > 0:
        pitch_mm = unit_mm / per_unit
        original = max(_ratio(tags.get(40962)) or 0.0, _ratio(tags.get(40963)) or 0.0)
        if original > 0:  # the picture may have been made smaller since
            pitch_mm *= original / long_side
        scale = scale_range(math.degrees(pitch_mm / focal_mm) * 3600.0)
        if scale and 0.0005 < pitch_mm < 0.2:
            return scale, "EXIF focal length and sensor resolution"
    equivalent_mm = _ratio(tags.get(41989))
    if equivalent_mm and equivalent_mm > 1.0:
        diagonal_px = math.hypot(*size)
        radians = _FULL_FRAME_DIAGONAL_MM / equivalent_mm / diagonal_px
        scale = scale_range(math.degrees(radians) * 3600.0, _SPREAD_FROM_35MM)
        if scale:
            return scale, "EXIF 35 mm equivalent focal length"
    return None, ""


def _exif_time(
    tags: dict[int, Any], gps: dict[int, Any], exposure_s: float | None
) -> tuple[datetime | None, tuple[str, ...]]:
    half = timedelta(seconds=(exposure_s or 0.0) / 2.0)
    text = _exif_text(tags.get(36867)) or _exif_text(tags.get(36868))
    if not text and tags.get(271):  # without a camera, tag 306 is when some program saved it
        text = _exif_text(tags.get(306))
    date, _, clock = text.partition(" ")
    zone = _exif_text(tags.get(36881)) or _exif_text(tags.get(36880))
    iso = f"{date.replace(':', '-')}T{clock}"
    if text and zone and (known := aware_utc(iso + zone)):
        return known + half, ()
    satellite = _satellite_time(gps)
    if satellite:
        return satellite + half, ()
    if text and (guess := aware_utc(iso)):
        return guess + half, (NO_ZONE,)
    return None, ()


def _satellite_time(gps: dict[int, Any]) -> datetime | None:
    day, hours = aware_utc(_exif_text(gps.get(29)).replace(":", "-")), _dms(gps.get(7))
    return None if day is None or hours is None or not 0.0 <= hours < 25.0 else day + timedelta(hours=hours)


def _exif_site(gps: dict[int, Any]) -> Site | None:
    latitude, longitude = _dms(gps.get(2)), _dms(gps.get(4))
    if latitude is None or longitude is None:
        return None
    if _exif_text(gps.get(1)).upper().startswith("S"):
        latitude = -latitude
    if _exif_text(gps.get(3)).upper().startswith("W"):
        longitude = -longitude
    height = _ratio(gps.get(6)) or 0.0
    # GPSAltitudeRef: 1 is below sea level.
    below = gps.get(5) in (1, b"\x01")
    return site_or_none(latitude, longitude, -height if below else height)


def _dms(value: Any) -> float | None:
    """Degrees or hours, minutes and seconds as a number of the first."""
    parts = [_ratio(part) for part in value] if isinstance(value, tuple | list) else []
    known = [part for part in parts if part is not None]
    return known[0] + known[1] / 60.0 + known[2] / 3600.0 if len(parts) == len(known) == 3 else None


def _ratio(value: Any) -> float | None:
    if isinstance(value, tuple | list) and len(value) == 1:
        value = value[0]
    return number_or_none(value)


def _exif_text(value: Any) -> str:
    if isinstance(value, bytes):
        value = value.decode("latin-1")
    return value.strip(" \x00") if isinstance(value, str) else ""


# -- A frame with what its file says of it -----------------------------------------------------


def frame_with_keywords(
    samples: Array,
    path: Path,
    values: Keywords,
    comments: Mapping[str, str],
    notes: tuple[str, ...],
    saturation: float | None = None,
    pattern: str | None = None,
) -> Frame:
    """The frame of samples beside a FITS header; what is None is taken from the header and the samples' type.

    Parameters
    ----------
    samples : Array
        The image as decoded, (H, W) or (H, W, 3).
    path : Path
        The file it came from.
    values : Keywords
        The header's keywords.
    comments : Mapping[str, str]
        The header's comments by keyword: some give a value's unit.
    notes : tuple[str, ...]
        What the reader has to say already.
    saturation : float or None
        Value from which a pixel is saturated; None: the most its type holds.
    pattern : str or None
        Bayer pattern of a mosaic; None: as the header says.
    """
    pixels, colour, _ = split(samples)
    pixels, gaps = finite(pixels)
    hint, doubts = hint_from_keywords(values, comments, pixels.shape)
    bayer = (pattern or bayer_pattern(values, len(pixels))) if colour is None else None
    level = saturation or clipping_level(pixels.dtype)
    return Frame(pixels, colour, bayer, level, str(path), hint, (*notes, *gaps, *doubts), dict(values))


def frame_with_exif(
    samples: Array, path: Path, exif: Exif, size: tuple[int, int], notes: tuple[str, ...] = ()
) -> Frame:
    """The frame of a decoded image and what its camera wrote beside it.

    Parameters
    ----------
    samples : Array
        The image as decoded, (H, W) or (H, W, 3).
    path : Path
        The file it came from.
    exif : Exif
        What the camera wrote beside it.
    size : tuple[int, int]
        Width and height of the sensor's image, px, which the hint is for.
    notes : tuple[str, ...]
        What the reader has to say already.
    """
    pixels, colour, saturation = split(samples)
    pixels, gaps = finite(pixels)
    hint, header, doubts = hint_from_exif(exif, size)
    return Frame(pixels, colour, None, saturation, str(path), hint, (*notes, *gaps, *doubts), header)
