"""Angles, coordinates, odds, durations and names as text."""

import math
import re
from enum import StrEnum

from kochab.text.translation import in_english, number, tr

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
        return f"{number(ra_deg % 360.0, '.5f')}°"
    if style is AngleStyle.DEGREES:
        d, m, s = _split(ra_deg % 360.0, 1, 360)
        return f"{d:03d}° {m:02d}′ {number(s, '04.1f')}″"
    h, m, s = _split(ra_deg % 360.0 / 15.0, 2, 24)
    return f"{h:02d}h {m:02d}m {number(s, '05.2f')}s"


def dec_text(dec_deg: float, style: AngleStyle) -> str:
    """Declination, degrees in, text out, always with a sign."""
    if not math.isfinite(dec_deg):
        return "–"
    if style is AngleStyle.DECIMAL:
        return f"{_signed(number(dec_deg, '+.5f'))}°"
    d, m, s = _split(abs(dec_deg), 1, None)
    return f"{'−' if dec_deg < 0 else '+'}{d:02d}° {m:02d}′ {number(s, '04.1f')}″"


def radec_text(ra_deg: float, dec_deg: float, style: AngleStyle) -> str:
    """Both, on one line."""
    return f"{ra_text(ra_deg, style)}  {dec_text(dec_deg, style)}"


def altaz_text(altitude_deg: float, azimuth_deg: float, begins: bool = False) -> str:
    """Altitude and azimuth, on one line; with capitals where each ``begins`` a fact of its own."""
    altitude, azimuth = _signed(number(altitude_deg, "+.2f")), azimuth_deg % 360.0
    if begins:
        return tr("Alt {altitude}°  Az {azimuth:.2f}°", altitude=altitude, azimuth=azimuth)
    return tr("alt {altitude}°  az {azimuth:.2f}°", altitude=altitude, azimuth=azimuth)


@in_english()
def radec_plain(ra_deg: float, dec_deg: float, style: AngleStyle) -> str:
    """Both in ASCII, for the clipboard: planetariums and mounts read this."""
    if style is AngleStyle.DECIMAL:
        return f"{ra_deg:.6f} {dec_deg:+.6f}"
    text = radec_text(ra_deg, dec_deg, style)
    # "12h 34m 56s" becomes "12:34:56"; the unit of the last number is dropped below.
    for mark in "hm°′":
        text = text.replace(f"{mark} ", ":")
    return text.replace("s", "").replace("″", "").replace("−", "-").replace("  ", " ")


def angle_text(value_deg: float) -> str:
    """A size on the sky in the unit that suits it."""
    size = abs(value_deg)
    if size >= 1.0:
        return f"{number(value_deg, '.2f')}°"
    if size >= 1.0 / 60.0:
        return f"{number(value_deg * 60.0, '.1f')}′"
    return f"{number(value_deg * 3600.0, '.1f')}″"


def round_angle_text(arcsec: float) -> str:
    """A round size, as of a ring on a chart: ``30″``, ``5′`` or ``2°``."""
    if arcsec < 60.0:
        return f"{arcsec:.0f}″"
    return f"{arcsec / 60.0:.0f}′" if arcsec < 3600.0 else f"{arcsec / 3600.0:.0f}°"


def arcsec_text(value: float) -> str:
    """Arcseconds with about three figures."""
    if not math.isfinite(value):
        return "–"
    return number(value, ".3f" if value < 1 else ".2f" if value < 10 else ".1f") + "″"


def false_alarm_text(log10: float) -> str:
    """The false-alarm probability as odds a person can weigh."""
    if not math.isfinite(log10):
        return tr("not known") if math.isnan(log10) else tr("none to speak of")
    if log10 >= -1:
        return tr("more than 1 in 10")
    power = math.floor(-log10)  # rounded down: never better odds than the solve has
    if power <= 6:
        return tr("1 in {odds}", odds=number(10**power, ","))
    return tr("1 in {odds}", odds=f"10{str(power).translate(SUPERSCRIPTS)}")


def unbroken(text: str) -> str:
    """The same, with every number on one line with its unit."""
    return re.sub(r"(?<=\d) (?=(?:ms|s|px)\b|%|σ)", "\u00a0", text)


def short_name(name: str, most: int = 44) -> str:
    """A name, or what a person typed, with its middle left out where it is long: both ends tell files apart."""
    if len(name) <= most:
        return name
    return f"{name[: most * 3 // 5]}…{name[-(most - most * 3 // 5 - 1) :]}"


def breakable(text: str, most: int = 44) -> str:
    """The same, with places where a line may end in words that no line could hold."""
    return re.sub(rf"\S{{{most}}}(?=\S)", lambda found: f"{found[0]}\u200b", text)


def milliseconds_text(value: float) -> str:
    """A duration with three figures at most."""
    if value >= 10_000:
        return tr("{seconds:.0f} s", seconds=value / 1000)
    if value >= 1000:
        return tr("{seconds:.1f} s", seconds=value / 1000)
    return tr("{ms} ms", ms=number(value, ".0f" if value >= 10 else ".1f"))


def age_text(age_s: float) -> str:
    """An age in seconds in its natural unit: 0.4 s, 75 s, 12 min, 3.2 h, 12 d."""
    if age_s < 10.0:
        return tr("{seconds:.1f} s", seconds=max(age_s, 0.0))
    if age_s < 100.0:
        return tr("{seconds:.0f} s", seconds=age_s)
    if age_s < 3600.0:
        return tr("{minutes:.0f} min", minutes=age_s / 60.0)
    if age_s < 172_800.0:
        return tr("{hours:.1f} h", hours=age_s / 3600.0)
    return tr("{days:.0f} d", days=age_s / 86_400.0)


def _signed(text: str) -> str:
    return text.replace("-", "−")


def _split(value: float, places: int, wrap: int | None) -> tuple[int, int, float]:
    """Whole, minutes and seconds, rounded before splitting so that 60.0 never shows."""
    unit = 10**places
    # Whole ticks of the last digit shown: 59.996 s carries into the minutes before it is split.
    ticks = round(value * 3600 * unit)
    seconds = ticks % (60 * unit) / unit
    minutes = ticks // (60 * unit)
    whole = minutes // 60
    if wrap is not None:
        whole %= wrap
    return whole, minutes % 60, seconds
