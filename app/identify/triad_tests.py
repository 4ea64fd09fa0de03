"""The rotation-angle and the enclosed-angle test of triads, in floating point, many at once.

The thesis "Attitude from stellar images", sections 2.3.4.1 and 2.3.4.2.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.identify.pairs import Pairs
from app.identify.triad_search import Found, Sight

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
UP = np.array([0.0, -1.0, 0.0])  # the camera's up, the pole of bearings in the frame
POLE = np.array([0.0, 0.0, 1.0])
ENDS = ((1, 2), (2, 0), (0, 1))  # the corners a side joins, opposite to corners 0, 1, 2


@dataclass(frozen=True, slots=True)
class Tests:
    """Tolerances, radians, of separations, rotation angles and enclosed angles."""

    separation: float
    rotation: float
    enclosed: float


def passed(
    sight: Sight, seen: Ints, stars: Ints, pairs: Pairs, tests: Tests, planar: bool
) -> Found:
    """Those of the triads ``seen`` (T, 3) and ``stars`` (T, 3) that pass both tests."""
    turn = rotations(sight, seen, pairs.vectors[stars], planar)
    off = wrapped(turn[:, 0] - turn[:, 1])
    kept = np.abs(off) <= tests.rotation
    mean = (turn[:, 1] + off / 2.0)[kept]
    seen, stars = seen[kept], stars[kept]
    kept = enclosed_agree(sight, seen, pairs.vectors[stars], tests.enclosed)
    seen, stars, mean = seen[kept], stars[kept], mean[kept]
    if not planar and len(seen):
        mean = rolls(sight.body[seen], pairs.vectors[stars])
    return Found(seen, stars, mean)


def rotations(sight: Sight, seen: Ints, sky: Floats, planar: bool) -> Floats:
    """Angles (T, 2), counterclockwise, from image to sky of the first star's two vectors.

    ``sky`` (T, 3, 3) are the stars' directions.
    """
    out = []
    for end in (1, 2):
        if planar:
            step = sight.plane[seen[:, end]] - sight.plane[seen[:, 0]]
            ra = np.arctan2(sky[..., 1], sky[..., 0])
            dec = np.arcsin(np.clip(sky[..., 2], -1.0, 1.0))
            east = wrapped(ra[:, end] - ra[:, 0])
            real = np.arctan2(dec[:, end] - dec[:, 0], -east)
            out.append(real - np.arctan2(step[:, 1], step[:, 0]))
        else:
            body = sight.body[seen]
            image = _bearing(body[:, 0], body[:, end], UP)
            out.append(_bearing(sky[:, 0], sky[:, end], POLE) - image)
    return np.stack(out, axis=1)


def _bearing(start: Floats, end: Floats, pole: Floats) -> Floats:
    """Position angle of ``end`` at ``start`` (..., 3), radians, from the pole by the left."""
    left = np.cross(pole, start)
    up = np.cross(start, left)
    return np.asarray(np.arctan2((end * left).sum(-1), (end * up).sum(-1)))


def rolls(body: Floats, sky: Floats) -> Floats:
    """Rotation at the frame's centre (T,), radians, of triads (T, 3, 3) seen and real."""
    u, _, vt = np.linalg.svd(np.swapaxes(body, 1, 2) @ sky)
    proper = np.linalg.det(u) * np.linalg.det(vt)
    u[:, :, 2] *= proper[:, None]
    matrix = u @ vt
    z, up = matrix[:, 2], -matrix[:, 1]
    east = np.stack([-z[:, 1], z[:, 0], np.zeros(len(z))], axis=1)
    return np.asarray(np.arctan2((up * east).sum(-1), (up * np.cross(z, east)).sum(-1)))


def enclosed_agree(sight: Sight, seen: Ints, sky: Floats, tolerance: float) -> Bools:
    """Whether all three inner angles (equations 2.5 to 2.7) agree, (T,)."""
    image = sight.separation
    image_sides = np.stack([image[seen[:, a], seen[:, b]] for a, b in ENDS], axis=1)
    off = inner(chord_sides(sky)) - inner(image_sides)
    return np.asarray((np.abs(off) <= tolerance).all(axis=1))


def chord_sides(sky: Floats) -> Floats:
    """Sides (T, 3), radians, opposite to the corners of triangles (T, 3, 3)."""
    sides = np.stack([np.linalg.norm(sky[:, a] - sky[:, b], axis=1) for a, b in ENDS], axis=1)
    return np.asarray(2.0 * np.arcsin(np.minimum(sides / 2.0, 1.0)))


def inner(sides: Floats) -> Floats:
    """Inner angles (T, 3) of spherical triangles with sides (T, 3) opposite to them."""
    a, b, c = sides, np.roll(sides, -1, axis=1), np.roll(sides, -2, axis=1)
    below = np.maximum(np.sin(b) * np.sin(c), 1e-15)
    return np.asarray(np.arccos(np.clip((np.cos(a) - np.cos(b) * np.cos(c)) / below, -1.0, 1.0)))


def wrapped(angle: Floats) -> Floats:
    """Angles in [-pi, pi)."""
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)
