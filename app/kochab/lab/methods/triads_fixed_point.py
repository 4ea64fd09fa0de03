"""The triad tests in fixed point: 32-bit integers and look-up tables instead of functions.

The thesis "Attitude from stellar images", chapter 3 and section 4.2.4. Its formats: places in the
frame 10.22, separations 6.10 degrees, cosines 1.15 unsigned, rotation and inner angles 10.6
degrees. Places count from the frame's centre and frames are at most 512 px wide.

Where the thesis is silent: the frame's size in 6.10 degrees over its pixels is the scale, which
gives 33 of 44 printed separations to the last bit. Inner angles of the image come from equation
3.1 with cosines and sines of 2.30; those of the catalogue are made when they are asked for, the
same integers that a table of all of them holds (1,175,901 triads there, of which a frame needs a
few thousand). Rotations are taken in plane coordinates, as there, which fails far from the equator.
"""

from functools import lru_cache

import numpy as np

from kochab.core.arrays import Ints
from kochab.lab.fixed_point import FixedPointOverflowError, Format, square_root
from kochab.lab.methods.pairs import Pairs
from kochab.lab.methods.triad_tests import (
    AngleUnit,
    FoundTriads,
    Tests,
    TriadDetections,
    chord_sides,
    image_sides,
    inner,
    wrapped,
)

PLACE = Format(10, 22)  # px from the frame's centre
ANGLE = Format(6, 10)  # degrees, separations
COSINE = Format(1, 15, signed=False)
TURN = Format(10, 6)  # degrees, rotations and inner angles
SCALE = Format(2, 30)  # degrees a pixel; also fine cosines and sines
PIXELS = Format(16, 0)
SKY = Format(10, 22)  # right ascension and declination, degrees
CROSSOVER_DEG = 11.65  # section 3.4: Pythagoras below, tables above
DEGREES = AngleUnit(float(np.degrees(1.0)) * 2**ANGLE.fraction, whole=True)
HALF, FULL = (int(TURN.of(turn)) for turn in (180.0, 360.0))


@lru_cache(maxsize=1)
def cosine_table() -> Ints:
    """Cosines (section 3.3.1), indexed by the angle; 2 ** 15 entries."""
    angle = np.radians(ANGLE.floats(np.arange(ANGLE.high + 1)))
    # cos 0 = 1 is the integer 2^15, which 1.15 unsigned has room for.
    return np.minimum(COSINE.of(np.cos(angle)), 1 << COSINE.fraction)


@lru_cache(maxsize=1)
def arc_cosine_table() -> tuple[Ints, int]:
    """Arc cosines that fit ``ANGLE``, and how many were left out before the first (3.3.1)."""
    degrees = np.degrees(np.arccos(np.arange((1 << COSINE.fraction) + 1) * COSINE.step))
    # 6.10 ends just below 32 degrees: smaller cosines have no entry, and by_tables refuses them.
    out = int((degrees > ANGLE.high * ANGLE.step).sum())
    return ANGLE.of(degrees[out:]), out


@lru_cache(maxsize=1)
def turn_table() -> Ints:
    """Arc cosines of the first quadrant in 10.6 degrees (section 3.3.2)."""
    return TURN.of(np.degrees(np.arccos(np.arange((1 << COSINE.fraction) + 1) * COSINE.step)))


@lru_cache(maxsize=1)
def _fine() -> tuple[Ints, Ints]:
    angle = np.radians(ANGLE.floats(np.arange(ANGLE.high + 1)))
    return SCALE.of(np.cos(angle)), SCALE.of(np.sin(angle))


def separations(sight: TriadDetections) -> Ints:
    """Separations (n, n) in 6.10 degrees: Pythagoras, or the tables beyond the crossover."""
    place = PLACE.of(sight.plane)
    step = np.abs(PLACE.difference(place[:, None], place[None]))
    across = ANGLE.of(np.degrees(sight.size_rad))
    scale = SCALE.quotient(across, ANGLE, sight.size_px, PIXELS)
    side = ANGLE.product(step, PLACE, scale, SCALE)
    flat = square_root((side * side).sum(axis=2))
    if (flat > ANGLE.high).any():
        raise FixedPointOverflowError(f"A separation does not fit a {ANGLE} fixed-point number.")
    return np.where(flat <= int(ANGLE.of(CROSSOVER_DEG)), flat, by_tables(side))


def by_tables(side: Ints) -> Ints:
    """Equation 3.2 of angular differences (..., 2) in 6.10 degrees, by look-up."""
    cosine = cosine_table()[ANGLE.fits(side)]
    product = COSINE.product(
        np.minimum(cosine[..., 0], COSINE.high), COSINE, np.minimum(cosine[..., 1], COSINE.high), COSINE
    )
    table, out = arc_cosine_table()
    if product.size and int(product.min()) < out:
        raise FixedPointOverflowError(f"A separation does not fit a {ANGLE} fixed-point number.")
    return table[product - out]


def passing_triads(sight: TriadDetections, seen: Ints, stars: Ints, pairs: Pairs, tests: Tests) -> FoundTriads:
    """Those of the triads that pass both tests.

    Parameters
    ----------
    sight : TriadDetections
        The detections.
    seen : Ints
        Detections of each triad (T, 3).
    stars : Ints
        Stars of each (T, 3).
    pairs : Pairs
        Of the catalogue, with the stars' directions.
    tests : Tests
        Largest rotation and difference of angles, radians.
    """
    place = PLACE.of(sight.plane)
    ra = np.degrees(np.arctan2(pairs.vectors[:, 1], pairs.vectors[:, 0]))
    dec = np.degrees(np.arcsin(np.clip(pairs.vectors[:, 2], -1.0, 1.0)))
    sky = SKY.of(np.stack([ra, dec], axis=1))
    turn = []
    for end in (1, 2):
        ours = PLACE.difference(place[seen[:, end]], place[seen[:, 0]])
        theirs = SKY.difference(sky[stars[:, end]], sky[stars[:, 0]])
        # Across RA 0 h the difference is nearly a full turn; east is to the left, hence the sign.
        theirs[:, 0] = -wrapped(theirs[:, 0], int(SKY.of(180.0)))
        turn.append(TURN.difference(direction(theirs), direction(ours)))
    off = wrapped(turn[0] - turn[1], HALF)
    kept = np.abs(off) <= int(TURN.of(np.degrees(tests.rotation)))
    seen, stars, mean = seen[kept], stars[kept], (turn[1] + (off >> 1))[kept]
    enclosed = TURN.of(np.degrees(inner(chord_sides(pairs.vectors[stars]))))  # entries of the thesis' table
    angles = inner_image(separations(sight), seen) - enclosed
    kept = (np.abs(angles) <= int(TURN.of(np.degrees(tests.enclosed)))).all(axis=1)
    return FoundTriads(seen[kept], stars[kept], np.radians(TURN.floats(mean[kept])))


def direction(step: Ints) -> Ints:
    """Directions (T,) of vectors (T, 2), both in one format: 10.6 degrees from x, [0, 360)."""
    size = np.abs(step)
    bits = np.frexp(size.max(axis=1, keepdims=True).astype(np.float64))[1]
    size = size >> np.maximum(bits - 30, 0)  # the squares' sum must fit the wide word
    length = square_root((size * size).sum(axis=1))
    # A first-quadrant arc cosine and the two signs give the direction; there is no table of arc tangents.
    cosine = (size[:, 0] << COSINE.fraction) // np.maximum(length, 1)
    turn = turn_table()[np.minimum(cosine, 1 << COSINE.fraction)]
    left, down = step[:, 0] < 0, step[:, 1] < 0
    turn = np.where(left, HALF - turn, turn)
    return TURN.fits(np.where(down & (turn > 0), FULL - turn, turn))


def inner_image(separation: Ints, seen: Ints) -> Ints:
    """Inner angles (T, 3), 10.6 degrees, of the image's triads (T, 3), by equation 3.1."""
    side = image_sides(separation, seen)
    cosine, sine = _fine()
    other, third = np.roll(side, -1, axis=1), np.roll(side, -2, axis=1)
    above = cosine[side] - SCALE.product(cosine[other], SCALE, cosine[third], SCALE)
    below = np.maximum(SCALE.product(sine[other], SCALE, sine[third], SCALE), 1)
    ratio = np.clip((np.abs(above) << COSINE.fraction) // below, 0, 1 << COSINE.fraction)
    turn = turn_table()[ratio]
    return TURN.fits(np.where(above < 0, HALF - turn, turn))
