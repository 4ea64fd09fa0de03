"""Polar errors and bolt turns in words that hold from every side of the mount."""

import math

from app.polar.error import PolarError

FRACTIONS = {
    1: "an eighth of a turn", 2: "a quarter turn", 3: "three eighths of a turn",
    4: "half a turn", 5: "five eighths of a turn", 6: "three quarters of a turn",
    7: "seven eighths of a turn",
}  # fmt: skip
AND = {1: "an eighth", 2: "a quarter", 3: "three eighths", 4: "a half", 5: "five eighths"}
AND |= {6: "three quarters", 7: "seven eighths"}
NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")

FINEST_DEG = 2.0
"""A hand cannot turn a bolt by less."""


def sayable(turns: float) -> float:
    """The amount of turns nearest to zero of ``turns`` that words can say: eighths, or degrees."""
    size = abs(turns)
    steps = 8.0 if size >= 0.125 else 360.0 / (5.0 if size >= 1 / 24 else FINEST_DEG)
    return math.copysign(math.floor(size * steps + 1e-9) / steps, turns)


def turns_in_words(turns: float) -> str:
    """``"a quarter turn"`` for 0.25; the sign is not said."""
    eighths = round(abs(turns) * 8.0)
    if abs(abs(turns) * 8.0 - eighths) > 1e-6 or eighths == 0:
        return f"{abs(turns) * 360.0:.0f} degrees (a full turn has 360)"
    whole, rest = divmod(eighths, 8)
    if not whole:
        return FRACTIONS[rest]
    number = NUMBERS[whole] if whole < len(NUMBERS) else str(whole)
    if rest:
        return f"{number} and {AND[rest]} turns"
    return f"{number} turn" + "s" * (whole > 1)


def rotation_in_words(turns: float) -> str:
    """Which way a bolt turns, looking at its head: positive is clockwise."""
    return "clockwise" if turns > 0 else "anticlockwise"


def angle_in_words(arcsec: float) -> str:
    """``45"``, ``12.5'`` or ``1.25°``, without sign."""
    size = abs(arcsec)
    if size < 99.5:
        return f'{size:.0f}"'
    return f"{size / 60.0:.1f}'" if size < 5400.0 else f"{size / 3600.0:.2f}°"


def total_in_words(error: PolarError) -> str:
    """How far the axis is from the pole, with one sigma of all that may be wrong."""
    sigma = error.whole.sigma_total_arcsec
    return f"{angle_in_words(error.total_arcsec)} ± {angle_in_words(sigma)}"


def split_in_words(error: PolarError) -> str:
    """What the ± of the total is made of; the squares of both add up to its own."""
    noise, unseen = error.sigma_total_arcsec, error.unseen_along_arcsec
    return (
        f"of the ±, {angle_in_words(noise)} is the frames' noise and {angle_in_words(unseen)}"
        " bending that they cannot show"
    )


def altitude_in_words(error: PolarError) -> str:
    """What has to be done in altitude, with one sigma of all that may be wrong."""
    value = error.altitude_arcsec
    told = f"{angle_in_words(value)} ± {angle_in_words(error.whole.sigma_arcsec[0])}"
    return f"the axis is {told} too {'high: lower it' if value > 0 else 'low: raise it'}"


def azimuth_in_words(error: PolarError) -> str:
    """What has to be done in azimuth, with one sigma, seen from above: true from every side."""
    value = error.azimuth_arcsec
    told = f"{angle_in_words(value)} ± {angle_in_words(error.whole.sigma_azimuth_arcsec)}"
    stands, turn = ("clockwise", "anticlockwise") if value > 0 else ("anticlockwise", "clockwise")
    return (
        f"the axis is {told} too far {stands} (towards {towards(error)}):"
        f" turn the mount {turn}, seen from above"
    )


def towards(error: PolarError) -> str:
    """East or west: where the axis stands beside the pole."""
    return "east" if error.axis[0] > error.pole[0] else "west"
