"""Numbers as astronomers write them."""

import math
import re
from enum import StrEnum

SUPERSCRIPTS = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


class AngleStyle(StrEnum):
    """How right ascension and declination are written."""

    SEXAGESIMAL = "hms"  # 05h 35m 17.30s, -05° 23′ 28.0″
    DEGREES = "dms"  # both in degrees, minutes, seconds
    DECIMAL = "decimal"


def ra_text(ra_deg: float, style: AngleStyle) -> str:
    """Right ascension, degrees in, text out."""
    if not math.isfinite(ra_deg):
        return "–"
    if style is AngleStyle.DECIMAL:
        return f"{ra_deg % 360.0:.5f}°"
    if style is AngleStyle.DEGREES:
        d, m, s = _split(ra_deg % 360.0, 1, 360)
        return f"{d:03d}° {m:02d}′ {s:04.1f}″"
    h, m, s = _split(ra_deg % 360.0 / 15.0, 2, 24)
    return f"{h:02d}h {m:02d}m {s:05.2f}s"


def dec_text(dec_deg: float, style: AngleStyle) -> str:
    """Declination, degrees in, text out, always with a sign."""
    if not math.isfinite(dec_deg):
        return "–"
    if style is AngleStyle.DECIMAL:
        return f"{_signed(f'{dec_deg:+.5f}')}°"
    d, m, s = _split(abs(dec_deg), 1, None)
    return f"{'−' if dec_deg < 0 else '+'}{d:02d}° {m:02d}′ {s:04.1f}″"


def radec_text(ra_deg: float, dec_deg: float, style: AngleStyle) -> str:
    """Both, on one line."""
    return f"{ra_text(ra_deg, style)}  {dec_text(dec_deg, style)}"


def altaz_text(altitude_deg: float, azimuth_deg: float) -> str:
    """Altitude and azimuth, on one line."""
    return f"alt {_signed(f'{altitude_deg:+.2f}')}°  az {azimuth_deg % 360.0:.2f}°"


def radec_plain(ra_deg: float, dec_deg: float, style: AngleStyle) -> str:
    """Both in ASCII, for the clipboard: planetariums and mounts read this."""
    if style is AngleStyle.DECIMAL:
        return f"{ra_deg:.6f} {dec_deg:+.6f}"
    text = radec_text(ra_deg, dec_deg, style)
    for mark in "hm°′":
        text = text.replace(f"{mark} ", ":")
    return text.replace("s", "").replace("″", "").replace("−", "-").replace("  ", " ")


def angle_text(value_deg: float) -> str:
    """A size on the sky in the unit that suits it."""
    size = abs(value_deg)
    if size >= 1.0:
        return f"{value_deg:.2f}°"
    if size >= 1.0 / 60.0:
        return f"{value_deg * 60.0:.1f}′"
    return f"{value_deg * 3600.0:.1f}″"


def arcsec_text(value: float) -> str:
    """Arcseconds with about three figures."""
    if not math.isfinite(value):
        return "–"
    return f"{value:.3f}″" if value < 1 else f"{value:.2f}″" if value < 10 else f"{value:.1f}″"


def false_alarm_text(log10: float) -> str:
    """The false-alarm probability as odds a person can weigh."""
    if not math.isfinite(log10):
        return "not known" if math.isnan(log10) else "none to speak of"
    if log10 >= -1:
        return "more than 1 in 10"
    power = math.floor(-log10)
    if power <= 6:
        return f"1 in {10**power:,}"
    return f"1 in 10{str(power).translate(SUPERSCRIPTS)}"


def unbroken(text: str) -> str:
    """The same, with every number on one line with its unit."""
    return re.sub(r"(?<=\d) (?=(?:ms|s|px)\b|%|σ)", "\u00a0", text)


def short_name(name: str, most: int = 44) -> str:
    """A file's name with its middle left out where it is long: both ends tell files apart."""
    if len(name) <= most:
        return name
    return f"{name[: most * 3 // 5]}…{name[-(most - most * 3 // 5 - 1) :]}"


def breakable(text: str, most: int = 44) -> str:
    """The same, with places where a line may end in words that no line could hold."""
    return re.sub(rf"\S{{{most}}}(?=\S)", lambda found: f"{found[0]}\u200b", text)


def milliseconds_text(value: float) -> str:
    """A duration with three figures at most."""
    if value >= 10_000:
        return f"{value / 1000:.0f} s"
    if value >= 1000:
        return f"{value / 1000:.1f} s"
    return f"{value:.0f} ms" if value >= 10 else f"{value:.1f} ms"


def _signed(text: str) -> str:
    return text.replace("-", "−")


def _split(value: float, places: int, wrap: int | None) -> tuple[int, int, float]:
    """Whole, minutes and seconds, rounded before splitting so that 60.0 never shows."""
    unit = 10**places
    ticks = round(value * 3600 * unit)
    seconds = ticks % (60 * unit) / unit
    minutes = ticks // (60 * unit)
    whole = minutes // 60
    if wrap is not None:
        whole %= wrap
    return whole, minutes % 60, seconds
