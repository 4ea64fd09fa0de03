"""Angles as old hand controllers write them, and as they read them."""

import re

_NUMBERS = re.compile(
    rb"\s*([+-]?)(\d{1,3})(?:[^0-9.+-](\d{1,2})(?:\.(\d)|[^0-9.+-](\d{1,2}(?:\.\d*)?))?)?"
)


def hours(ra_deg: float, precise: bool, decimals: int = 0) -> bytes:
    """``HH:MM:SS`` or, not precise, ``HH:MM.T``."""
    if not precise:
        tenths = round(ra_deg % 360.0 * 40.0) % 14400
        return b"%02d:%02d.%d" % (tenths // 600, tenths // 10 % 60, tenths % 10)
    unit = 10**decimals
    ticks = round(ra_deg % 360.0 * 240.0 * unit) % (86400 * unit)
    return b"%02d:%02d:" % (ticks // unit // 3600, ticks // unit // 60 % 60) + _seconds(
        ticks, decimals
    )


def degrees(
    angle_deg: float, precise: bool, mark: bytes = b"*", width: int = 2, signed: bool = True,
    decimals: int = 0, minute_mark: bytes = b":",
) -> bytes:  # fmt: skip
    """``sDD*MM:SS`` or, not precise, ``sDD*MM``; ``mark`` stands after the degrees."""
    unit = 10**decimals if precise else 1
    ticks = round(abs(angle_deg) * (3600 * unit if precise else 60))
    minutes = ticks // unit // 60 if precise else ticks
    sign = (b"-" if angle_deg < 0 and ticks else b"+") if signed else b""
    text = sign + b"%0*d" % (width, minutes // 60) + mark + b"%02d" % (minutes % 60)
    return text + minute_mark + _seconds(ticks, decimals) if precise else text


def _seconds(ticks: int, decimals: int) -> bytes:
    seconds, part = divmod(ticks, 10**decimals)
    return b"%02d" % (seconds % 60) + (b".%0*d" % (decimals, part) if decimals else b"")


def parse(text: bytes, most: float) -> float | None:
    """``sDD*MM``, ``sDD*MM:SS``, ``HH:MM.T`` ... as a number of the first unit, or None.

    None too where its size is beyond ``most`` or a part is 60 or more.
    """
    found = _NUMBERS.fullmatch(text.rstrip())
    if found is None:
        return None
    sign, whole, minutes, tenths, seconds = found.groups()
    m = float(minutes or 0) + (float(tenths) / 10.0 if tenths else 0.0)
    s = float(seconds or 0)
    value = float(whole) + m / 60.0 + s / 3600.0
    if m >= 60 or s >= 60 or value > most:
        return None
    return -value if sign == b"-" else value
