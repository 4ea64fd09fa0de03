"""Hints from EXIF: focal length and sensor to scale, clock to UTC, satellite fix to site."""

import math
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from fractions import Fraction
from pathlib import Path
from typing import Any

from app.core.hint import Hint, Site
from app.frames.believable import (
    aware_utc,
    exposure_or_none,
    number_or_none,
    scale_range,
    site_or_none,
)

_UNIT_MM = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}
_FULL_FRAME_DIAGONAL_MM = 43.2666
_SPREAD_FROM_35MM = 0.2


@dataclass(slots=True)
class Exif:
    """The three tag directories of EXIF: number -> value."""

    main: dict[int, Any] = field(default_factory=dict)
    photo: dict[int, Any] = field(default_factory=dict)
    gps: dict[int, Any] = field(default_factory=dict)


def exif_from_bytes(source: bytes | Path | None) -> Exif:
    """Tags of a block that begins like a TIFF (or ``Exif``), or of a TIFF-like file."""
    from PIL import Image

    block = Image.Exif()
    if not source:
        return Exif()
    try:
        if isinstance(source, bytes):
            block.load(source)
            return exif_of(block)
        with source.open("rb") as file:
            block.load_from_fp(file)
            return exif_of(block)
    except Exception:  # a damaged block is no hint, and no reason to refuse the picture
        return Exif()


def exif_of(block: Any) -> Exif:
    """Tags of a `PIL.Image.Exif`."""
    try:
        return Exif(dict(block), dict(block.get_ifd(0x8769)), dict(block.get_ifd(0x8825)))
    except Exception:  # the same
        return Exif()


def hint_from_exif(
    exif: Exif, size: tuple[int, int]
) -> tuple[Hint, dict[str, Any], tuple[str, ...]]:
    """What a camera wrote beside its picture of ``size`` (width, height) px.

    Returns
    -------
    hint, header, warnings
        The header holds the few tags people know by name, as text or numbers.

    """
    both = {**exif.main, **exif.photo}
    scale, source = _scale(both, size)
    exposure = exposure_or_none(_ratio(both.get(33434)))
    time, doubts = _time(both, exif.gps, exposure)
    camera = " ".join(dict.fromkeys(f"{_text(both.get(271))} {_text(both.get(272))}".split()))
    lens = _text(both.get(42036))
    hint = Hint(
        scale_arcsec_px=scale,
        time_utc=time,
        exposure_s=exposure,
        site=_site(exif.gps),
        camera=", ".join(part for part in (camera, lens) if part),
        source=source or ("EXIF" if time else ""),
    )
    names = {271: "Make", 272: "Model", 42036: "LensModel", 36867: "DateTimeOriginal"}
    numbers = {37386: "FocalLength", 33434: "ExposureTime", 34855: "ISO", 33437: "FNumber"}
    header: dict[str, Any] = {n: _text(both[t]) for t, n in names.items() if _text(both.get(t))}
    header |= {n: v for t, n in numbers.items() if (v := _ratio(both.get(t))) is not None}
    return hint, header, doubts


def _scale(tags: dict[int, Any], size: tuple[int, int]) -> tuple[tuple[float, float] | None, str]:
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


def _time(
    tags: dict[int, Any], gps: dict[int, Any], exposure_s: float | None
) -> tuple[datetime | None, tuple[str, ...]]:
    half = timedelta(seconds=(exposure_s or 0.0) / 2.0)
    text = _text(tags.get(36867)) or _text(tags.get(36868))
    if not text and tags.get(271):  # without a camera, tag 306 is when some program saved it
        text = _text(tags.get(306))
    date, _, clock = text.partition(" ")
    zone = _text(tags.get(36881)) or _text(tags.get(36880))
    iso = f"{date.replace(':', '-')}T{clock}"
    if text and zone and (known := aware_utc(iso + zone)):
        return known + half, ()
    satellite = _satellite_time(gps)
    if satellite:
        return satellite + half, ()
    if text and (guess := aware_utc(iso)):
        return guess + half, ("The picture does not say its time zone: its clock is taken as UTC.",)
    return None, ()


def _satellite_time(gps: dict[int, Any]) -> datetime | None:
    parts = gps.get(7)
    if not isinstance(parts, tuple | list) or len(parts) != 3:
        return None
    numbers = [_ratio(p) for p in parts]
    day = aware_utc(_text(gps.get(29)).replace(":", "-"))
    if day is None or any(n is None or not 0 <= n < 61 for n in numbers):
        return None
    hours, minutes, seconds = (float(n or 0.0) for n in numbers)
    return day.astimezone(UTC) + timedelta(hours=hours, minutes=minutes, seconds=seconds)


def _site(gps: dict[int, Any]) -> Site | None:
    latitude, longitude = _dms(gps.get(2)), _dms(gps.get(4))
    if latitude is None or longitude is None:
        return None
    if _text(gps.get(1)).upper().startswith("S"):
        latitude = -latitude
    if _text(gps.get(3)).upper().startswith("W"):
        longitude = -longitude
    height = _ratio(gps.get(6)) or 0.0
    below = gps.get(5) in (1, b"\x01")
    return site_or_none(latitude, longitude, -height if below else height)


def _dms(value: Any) -> float | None:
    if not isinstance(value, tuple | list) or len(value) != 3:
        return None
    parts = [_ratio(p) for p in value]
    if any(p is None for p in parts):
        return None
    degrees, minutes, seconds = (float(p or 0.0) for p in parts)
    return degrees + minutes / 60.0 + seconds / 3600.0


def _ratio(value: Any) -> float | None:
    if isinstance(value, tuple | list) and len(value) == 1:
        value = value[0]
    if isinstance(value, Fraction):
        return float(value)
    return number_or_none(value)


def _text(value: Any) -> str:
    if isinstance(value, bytes):
        value = value.decode("latin-1")
    return value.strip(" \x00") if isinstance(value, str) else ""
