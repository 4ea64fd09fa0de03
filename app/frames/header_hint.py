"""Hints from FITS keywords; the long list of names that capture programs use."""

import math
import re
from collections.abc import Mapping
from datetime import datetime, timedelta
from typing import Any

from app.core.hint import Hint, Site
from app.frames.believable import (
    aware_utc,
    exposure_or_none,
    number_or_none,
    scale_range,
    sexagesimal,
    site_or_none,
    utc_of_mjd,
)

Keywords = Mapping[str, Any]

_SCALE_NAMES = ("SCALE", "PIXSCALE", "PIXSCAL1", "SECPIX", "SECPIX1", "IM_SCALE", "IMGSCALE")
_POINTING = (
    ("RA", "DEC"), ("OBJCTRA", "OBJCTDEC"), ("TELRA", "TELDEC"), ("RA-MNT", "DEC-MNT"),
    ("TELESRA", "TELESDEC"), ("RA_OBJ", "DEC_OBJ"), ("RA_TARG", "DEC_TARG"),
)  # fmt: skip
_LATITUDES = ("SITELAT", "LAT-OBS", "OBSGEO-B", "OBSLAT", "LATITUDE", "OBS-LAT", "LAT", "GEOLAT")
_LONGITUDES = (
    "SITELONG", "LONG-OBS", "OBSGEO-L", "OBSLONG", "LONGITUD", "OBS-LONG", "LONG", "GEOLON",
)  # fmt: skip
_HEIGHTS = ("SITEELEV", "ALT-OBS", "ELEV-OBS", "OBSGEO-H", "OBSALT", "ALTITUDE", "ELEVATIO")
_CAMERAS = ("INSTRUME", "CAMERA", "CAM-NAME", "DETECTOR")
_CLOCKS = ("TIME-OBS", "UT", "UTC", "UT-OBS", "UTSTART", "TIME-BEG", "UT_START")

_POINTING_RADIUS_DEG = 10.0
_WCS_RADIUS_DEG = 2.0


def hint_from_keywords(
    values: Keywords, comments: Mapping[str, str], shape: tuple[int, ...]
) -> tuple[Hint, tuple[str, ...]]:
    """What a header believes, and sentences about what was not believable.

    Parameters
    ----------
    values, comments
        Keyword -> value, keyword -> comment.
    shape
        (height, width) px of the frame.

    Returns
    -------
    hint, warnings
        A wrong or senseless keyword only leaves its part of the hint empty.

    """
    height, width = shape[:2]
    scale, scale_from = _scale(values, comments)
    field_deg = scale[1] * math.hypot(height, width) / 3600.0 if scale else 0.0
    centre, centre_from = _centre(values, comments, scale, field_deg, (height, width))
    exposure = exposure_or_none(
        _first_number(values, ("EXPTIME", "EXPOSURE", "EXP_TIME", "ITIME", "ELAPTIME"))
    )
    time = _time(values, exposure)
    doubts: tuple[str, ...] = ()
    if values.get("DATE-OBS") and time is None:
        doubts = ("The header's DATE-OBS is not a date that can be read.",)
    hint = Hint(
        scale_arcsec_px=scale,
        centre_deg=centre,
        time_utc=time,
        exposure_s=exposure,
        site=_site(values),
        camera=_text(values, _CAMERAS),
        source=", ".join(dict.fromkeys(s for s in (scale_from, centre_from) if s)),
    )
    return hint, doubts


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
            told = "binn" in comments.get(name, "").lower() and name == "XPIXSZ"
            high = low if told else arcsec * binning
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
        ra, dec = _number(values, "CRVAL1"), _number(values, "CRVAL2")
        x = _number_or(values, "CRPIX1", shape[1] / 2.0) - shape[1] / 2.0
        y = _number_or(values, "CRPIX2", shape[0] / 2.0) - shape[0] / 2.0
        radius = _WCS_RADIUS_DEG + field_deg + scale[1] * math.hypot(x, y) / 3600.0
        if _on_sky(ra, dec) and radius < 180.0:
            return (_turn(ra), _sure(dec), radius), "WCS in the header"
    for ra_name, dec_name in _POINTING:
        ra = _right_ascension(values.get(ra_name), ra_name, comments.get(ra_name, ""))
        dec = _degrees(values.get(dec_name))
        # All zero is what a program writes that was never told.
        if _on_sky(ra, dec) and (ra, dec) != (0.0, 0.0):
            radius = min(_POINTING_RADIUS_DEG + field_deg, 180.0)
            return (_turn(ra), _sure(dec), radius), f"{ra_name} and {dec_name}"
    return None, ""


def _right_ascension(value: Any, name: str, comment: str) -> float | None:
    hours = sexagesimal(value)
    if hours is not None:
        return hours * 15.0 if 0.0 <= hours < 24.0 else None
    number = number_or_none(value)
    if number is None:
        return None
    in_hours = (name == "OBJCTRA" and number < 24.0) or re.search(r"\bhours?\b", comment.lower())
    return number * 15.0 if in_hours else number


def _on_sky(ra_deg: float | None, dec_deg: float | None) -> bool:
    if ra_deg is None or dec_deg is None:
        return False
    return -360.0 <= ra_deg <= 360.0 and abs(dec_deg) <= 90.0


def _turn(ra_deg: float | None) -> float:
    """Into [0, 360); the remainder alone may round up to 360."""
    turned = _sure(ra_deg) % 360.0
    return turned if turned < 360.0 else 0.0


def _sure(value: float | None) -> float:
    return 0.0 if value is None else value


def _time(values: Keywords, exposure_s: float | None) -> datetime | None:
    for name in ("DATE-AVG", "DATE-MID"):
        if middle := aware_utc(str(values.get(name) or "")):
            return middle
    if middle := utc_of_mjd(_first_number(values, ("MJD-AVG", "MJD-MID"))):
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
            text = f"{text}T{clock.zfill(8)}" if clock else text
        if start := aware_utc(text):
            return start
    if start := utc_of_mjd(_number(values, "MJD-OBS")):
        return start
    julian = _number(values, "JD")
    return utc_of_mjd(julian - 2_400_000.5) if julian else None


def _site(values: Keywords) -> Site | None:
    latitude = next((d for n in _LATITUDES if (d := _degrees(values.get(n))) is not None), None)
    longitude = next((d for n in _LONGITUDES if (d := _degrees(values.get(n))) is not None), None)
    return site_or_none(latitude, longitude, _first_number(values, _HEIGHTS))


def _degrees(value: Any) -> float | None:
    """Degrees from a number or sexagesimal text, with an N, S, E or W at either end."""
    sign = 1.0
    if isinstance(value, str):
        text = value.strip().upper()
        match = re.fullmatch(r"([NSEW]?)\s*([^NSEW]*?)\s*([NSEW]?)", text)
        if match and not (match[3] == "S" and re.search(r"[HDM]", match[2])):
            sign = -1.0 if {match[1], match[3]} & {"S", "W"} else 1.0
            value = match[2]
        value = value.lower()
    number = sexagesimal(value)
    number = number_or_none(value) if number is None else number
    return None if number is None else sign * number


def _number(values: Keywords, name: str) -> float | None:
    return number_or_none(values.get(name))


def _number_or(values: Keywords, name: str, default: float) -> float:
    number = _number(values, name)
    return default if number is None else number


def _first_number(values: Keywords, names: tuple[str, ...]) -> float | None:
    return next((n for name in names if (n := _number(values, name)) is not None), None)


def _text(values: Keywords, names: tuple[str, ...]) -> str:
    return next((str(values[n]).strip() for n in names if str(values.get(n) or "").strip()), "")
