"""A place of the sky as people and programs write it: ``5h35m17s -5d23m``, ``83.82, -5.39``, ``J053517.3-052328``."""

import re

from kochab.core.errors import UsageError
from kochab.parsing.angles import parse_dec_deg, parse_ra_deg

_LABELS = re.compile(r"\b(?:ra|dec|de|decl|j2000|icrs|alpha|delta)\b[=:\s]*|[αδ]\s*[=:]\s*", re.IGNORECASE)
_PACKED = re.compile(r"j?(\d{4,8}(?:\.\d+)?)([+-])(\d{4,8}(?:\.\d+)?)", re.IGNORECASE)
_LETTER_SIGN = re.compile(r"(?<![a-z])([ns])\s*(?=\d)", re.IGNORECASE)


def parse_place(text: str) -> tuple[float, float] | None:
    """RA and Dec in degrees; None when it is no position, or not a possible one.

    Bare numbers are degrees, three numbers are hours, minutes and seconds, as :func:`parse_ra_deg` has it. Packed ones
    are HHMMSS and DDMMSS with decimals, after a point or without.
    """
    clean = " ".join(text.replace("−", "-").replace("–", "-").split())
    packed = _PACKED.fullmatch(clean)
    if packed is not None:
        return _unpacked(*packed.groups())
    clean = _LABELS.sub(" ", clean).strip(" ,;")
    clean = _LETTER_SIGN.sub(lambda found: " " + "+-"[found[1].lower() == "s"], clean)
    if not re.match(r"[+-]?[\d.]", clean) or re.search(r"[a-z]{2}", clean, re.IGNORECASE):
        return None
    for ra, dec in _halves(clean):
        try:
            return parse_ra_deg(ra), parse_dec_deg(dec)
        except UsageError:
            continue
    return None


def _unpacked(ra: str, sign: str, dec: str) -> tuple[float, float] | None:
    hours, degrees = _sexagesimal(ra), _sexagesimal(dec)
    if hours is None or degrees is None or hours >= 24.0 or degrees > 90.0:
        return None
    return hours * 15.0, -degrees if sign == "-" else degrees


def _sexagesimal(digits: str) -> float | None:
    """``053517.3``, ``05351730`` and ``0535``: two digits each, and the rest is a decimal fraction of the last."""
    whole, _, fraction = digits.partition(".")
    first, second = int(whole[:2]), int(whole[2:4])
    third = float(f"{whole[4:6] or 0}.{whole[6:]}{fraction}" if len(whole) > 4 else f"0.{fraction}0") * (
        1.0 if len(whole) > 4 else 60.0
    )
    return first + second / 60.0 + third / 3600.0 if second < 60 and third < 60.0 and len(whole) != 5 else None


def _halves(text: str) -> list[tuple[str, str]]:
    """The ways to part it: at the one comma or semicolon, before a sign, in the middle of an even count of words."""
    found = []
    if (decimal := re.fullmatch(r"(\d+,\d+)\s+([+-]?\d+,\d+)", text)) is not None:  # as "83,822 -5,391": degrees
        found.append((decimal[1].replace(",", "."), decimal[2].replace(",", ".")))
    parts = re.split(r"\s*[,;]\s*", text)
    if len(parts) == 2:
        found.append((parts[0], parts[1]))
    sign = re.search(r"(?<=[\dhmsd°'\"′″,;\s])\s*(?=[+-]\s*\d)", text[1:])
    if sign is not None:  # with commas left in: they may be decimal ones
        dec = text[sign.end() + 1 :].replace("- ", "-").replace("+ ", "+")
        found.append((text[: sign.start() + 1].strip(" ,;"), dec))
    words = " ".join(parts).split()
    if len(words) % 2 == 0:
        found.append((" ".join(words[: len(words) // 2]), " ".join(words[len(words) // 2 :])))
    return found
