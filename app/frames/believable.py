"""What a header may say and still be believed: every hint passes here, nonsense becomes None."""

import math
import re
from datetime import UTC, datetime, timedelta
from typing import Any

from app.core.hint import Site

SPREAD = 0.15
_SCALE_LIMITS_ARCSEC = (0.02, 1500.0)
_YEARS = (1850, 2150)
_SEXAGESIMAL = re.compile(
    r"\s*([+-]?)\s*(\d{1,3})\s*[:hd°\s]\s*(\d{1,2})\s*(?:[:m'\s]\s*(\d{1,2}(?:\.\d*)?))?\s*[s\"]?\s*$"
)


def number_or_none(value: Any) -> float | None:
    """A finite number, also when written as text; None for anything else."""
    if value is None or isinstance(value, bool):
        return None
    try:
        number = float(value)
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        return None
    return number if math.isfinite(number) else None


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
    match = _SEXAGESIMAL.match(value) if isinstance(value, str) else None
    if not match:
        return None
    minutes, seconds = float(match[3]), float(match[4] or 0.0)
    if minutes >= 60.0 or seconds >= 61.0:
        return None
    size = float(match[2]) + minutes / 60.0 + seconds / 3600.0
    return -size if match[1] == "-" else size


def site_or_none(
    latitude_deg: float | None, longitude_deg: float | None, height_m: float | None = None
) -> Site | None:
    """A place on the Earth; (0, 0) is how programs write that nobody told them."""
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
        text = f"19{old[3]}-{old[2]}-{old[1]}{old[4] or ''}"
    # datetime reads six decimals at most, FITS programs write more
    text = re.sub(r"(\.\d{6})\d+", r"\1", text)
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
