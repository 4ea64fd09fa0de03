"""Angles, sites and coordinates as text: how they are written, and how typed ones are read."""

import math
import re
from enum import StrEnum

from kochab.core import in_english, number, tr
from kochab.core.errors import UsageError
from kochab.core.frame import Site

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


# -- Angles as people type them ----------------------------------------------------------------


def parse_ra_deg(text: str) -> float:
    """Right ascension in degrees from ``83.8``, ``83.8d``, ``5h35m17s`` or ``5:35:17``.

    A bare number is degrees; three numbers, or an ``h``, are hours. UsageError when it is neither or out of range.
    """
    numbers, negative = _numbers(text, tr("“{text}” is not a right ascension."))
    # A bare "83.8" is degrees, while "5 35 17" can only be hours as charts print them.
    hours = "h" in text.lower() or (len(numbers) > 1 and not re.search(r"[d°]", text.lower()))
    value = _sexagesimal(numbers) * (15.0 if hours else 1.0)
    if negative or not 0.0 <= value <= 360.0:
        typed = short_name(text.strip())
        raise UsageError("{text} is not a right ascension; give 0 to 360° or 0h to 24h.", text=typed)
    return value % 360.0


def parse_dec_deg(text: str) -> float:
    """Declination in degrees from ``-5.4``, ``-5 23 28`` or ``-5d23m28s``."""
    numbers, negative = _numbers(text, tr("“{text}” is not a declination."))
    value = _sexagesimal(numbers) * (-1.0 if negative else 1.0)
    if not -90.0 <= value <= 90.0 or "h" in text.lower():
        typed = short_name(text.strip())
        raise UsageError("{text} is not a declination; give −90° to +90°.", text=typed)
    return value


def parse_site(text: str) -> Site:
    """A place on the Earth from ``48.14, 11.58`` or ``48.14, 11.58, 520``: degrees, metres.

    Latitude first, north positive; longitude east positive. UsageError says what is wrong.
    """
    typed, example = short_name(text.strip()), "48.14, 11.58, 520"
    try:
        parts = [float(p) for p in _parts(text.strip().replace("−", "-"))]
    except ValueError:
        parts = []
    if len(parts) not in (2, 3):
        message = tr(
            "“{text}” is not a site; give latitude, longitude and, if you like, height in metres: {example}.",
            text=typed,
            example=example,
        )
        raise UsageError(message)
    latitude, longitude, height = (*parts, 0.0)[:3]
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 360.0 and -500.0 <= height <= 9000.0):
        message = tr(
            "{text} is not on the Earth; give latitude, longitude and, if you like, height in metres: {example}.",
            text=typed,
            example=example,
        )
        raise UsageError(message)
    # Rounded to 1e-9°: the wrap leaves rounding noise in the last digits, which would be shown.
    return Site(latitude, round((longitude + 180.0) % 360.0 - 180.0, 9), height)


def _parts(text: str) -> list[str]:
    """The numbers of a list; where something else separates them, a comma is a decimal one."""
    words = [word for word in re.split(r"[;\s]+", text) if word]
    by_commas = all(word.endswith(",") for word in words[:-1]) and ";" not in text
    parts = [part for part in re.split(r"[,\s]+", text) if part]
    if by_commas and len(parts) <= 3:
        return parts
    return [word.rstrip(",").replace(",", ".") for word in words]


def site_text(site: Site) -> str:
    """The same as it would be typed."""
    height = f", {site.height_m:g}" if site.height_m else ""
    return f"{site.latitude_deg:.6g}, {site.longitude_deg:.6g}{height}"


def parse_positive(text: str, what: str, most: float) -> float:
    """A number above 0 and at most ``most``; a decimal comma is understood."""
    try:
        value = float(text.strip().rstrip("°\"'″′").replace(",", "."))
    except ValueError:
        value = float("nan")
    if not 0.0 < value <= most:
        raise UsageError("{what} must be a number above 0 and at most {most:g}.", what=what, most=most)
    return value


def _numbers(text: str, wrong: str) -> tuple[list[float], bool]:
    clean = text.strip().replace("−", "-").replace(",", ".")
    pattern = r"[+-]?\d+(\.\d+)?([\s:hmsd°'\"′″]+\d+(\.\d+)?){0,2}[\s:hmsd°'\"′″]*"
    if not re.fullmatch(pattern, clean, re.IGNORECASE):
        raise UsageError(wrong.format(text=short_name(text.strip())))
    return [float(n) for n in re.findall(r"\d+(?:\.\d+)?", clean)], clean.startswith("-")


def _sexagesimal(numbers: list[float]) -> float:
    if any(n >= 60.0 for n in numbers[1:]):
        raise UsageError("Minutes and seconds must be below 60.")
    return sum(n / 60.0**i for i, n in enumerate(numbers))
