"""Angles and sites as people type them."""

import re

from kochab.core.errors import UsageError
from kochab.core.frame import Site
from kochab.text.angle_text import short_name
from kochab.text.translation import tr


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
