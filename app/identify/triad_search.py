"""Triads of catalogue stars for every three detections: separations, then the two angle tests."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import roll_at
from app.core.camera import Camera
from app.core.detections import Detections
from app.core.progress import Progress, Task
from app.identify.pairs import Pairs

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
UP = np.array([0.0, -1.0, 0.0])  # the camera's up, the pole of bearings in the frame
POLE = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, slots=True)
class Tests:
    """Tolerances, radians, of separations, rotation angles and enclosed angles."""

    separation: float
    rotation: float
    enclosed: float


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """The n brightest detections of one parity.

    ``body`` (n, 3) unit vectors in camera axes; ``plane`` (n, 2) px from the centre, y up, x
    reversed when mirrored; ``separation`` (n, n) radians.
    """

    body: Floats
    plane: Floats
    separation: Floats

    @classmethod
    def of(
        cls, detections: Detections, stars: int, focal_px: float, mirrored: bool,
        field_deg: tuple[float, float] | None,
    ) -> "Sight":  # fmt: skip
        """The brightest ``stars``; separations by equation 2.4 when the field's size is given."""
        xy = detections.xy[:stars]
        size = np.array([detections.width, detections.height])
        sign = -1.0 if mirrored else 1.0
        plane = (xy - (size - 1) / 2.0) * np.array([sign, -1.0])
        camera = Camera.centred(detections.width, detections.height, focal_px, mirrored)
        body = camera.unproject(xy)
        if field_deg is None:
            gap = np.linalg.norm(body[:, None] - body[None], axis=2)
            return cls(body, plane, 2.0 * np.arcsin(np.minimum(gap / 2.0, 1.0)))
        step = (plane[:, None] - plane[None]) * np.radians(field_deg) / size
        return cls(body, plane, np.arccos(np.clip(np.cos(step).prod(axis=2), -1.0, 1.0)))


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Triads that passed: ``detection`` and ``star`` (K, 3), mean ``rotation`` (K,) radians."""

    detection: Ints
    star: Ints
    rotation: Floats


def find_triads(
    sight: Sight, pairs: Pairs, tests: Tests, planar: bool, begun: float
) -> Task[tuple[Found, int]]:
    """All triads that pass both tests, and how many pairs of catalogue stars were looked at."""
    n = len(sight.body)
    lists: dict[tuple[int, int], tuple[Ints, Ints, Ints]] = {}
    looked = 0
    for i, j in combinations(range(n), 2):
        angle = sight.separation[i, j]
        start, stop = pairs.between(angle - tests.separation, angle + tests.separation)
        a, b = pairs.first[int(start) : int(stop)], pairs.second[int(start) : int(stop)]
        looked += len(a)
        one, other = np.concatenate([a, b]).astype(np.int64), np.concatenate([b, a])
        order = np.argsort(one, kind="stable")
        first = np.searchsorted(one[order], np.arange(pairs.stars + 1))
        lists[i, j] = one[order], other[order].astype(np.int64), first
    detection, star, rotation = [], [], []
    for k, (i, j, m) in enumerate(combinations(range(n), 3)):
        if k % 10 == 0:
            yield Progress("identify", begun + 0.5 * k / (n * (n - 1) * (n - 2) / 6), "triads")
        one, two, _ = lists[i, j]
        _, reached, first = lists[i, m]
        which, at = pairs.spread(first[one], first[one + 1])
        tri = np.stack([one[which], two[which], reached[at]], axis=1)
        v = pairs.vectors
        gap = np.linalg.norm(v[tri[:, 1]] - v[tri[:, 2]], axis=1)
        far = 2.0 * np.arcsin(np.minimum(gap / 2.0, 1.0))
        tri = tri[np.abs(far - sight.separation[j, m]) <= tests.separation]
        seen = np.array([i, j, m])
        turn = _rotations(sight, seen, v[tri], planar)
        passed = np.abs(_wrapped(turn[:, 0] - turn[:, 1])) <= tests.rotation
        passed &= _enclosed_agree(sight, seen, v[tri], tests.enclosed)
        mean = turn[:, 1] + _wrapped(turn[:, 0] - turn[:, 1]) / 2.0
        if not planar and passed.any():
            mean[passed] = [_roll(sight.body[seen], v[t]) for t in tri[passed]]
        detection.append(np.repeat(seen[None], int(passed.sum()), axis=0))
        star.append(tri[passed])
        rotation.append(mean[passed])
    return Found(np.concatenate(detection), np.concatenate(star), np.concatenate(rotation)), looked


def _rotations(sight: Sight, seen: Ints, sky: Floats, planar: bool) -> Floats:
    """Angles (K, 2), counterclockwise, from image to sky of the first star's two vectors."""
    out = []
    for end in (1, 2):
        if planar:
            dx, dy = sight.plane[seen[end]] - sight.plane[seen[0]]
            ra = np.arctan2(sky[..., 1], sky[..., 0])
            dec = np.arcsin(np.clip(sky[..., 2], -1.0, 1.0))
            east = _wrapped(ra[:, end] - ra[:, 0])
            out.append(np.arctan2(dec[:, end] - dec[:, 0], -east) - np.arctan2(dy, dx))
        else:
            body = sight.body[seen]
            image = _bearing(body[0], body[end], UP)
            out.append(_bearing(sky[:, 0], sky[:, end], POLE) - image)
    return np.stack(out, axis=1)


def _bearing(start: Floats, end: Floats, pole: Floats) -> Floats:
    """Position angle of ``end`` at ``start`` (..., 3), radians, from the pole by the left."""
    left = np.cross(pole, start)
    up = np.cross(start, left)
    return np.asarray(np.arctan2((end * left).sum(-1), (end * up).sum(-1)))


def _roll(body: Floats, sky: Floats) -> float:
    """Rotation at the frame's centre, radians, of one triad (3, 3) seen and (3, 3) real."""
    u, _, vt = np.linalg.svd(body.T @ sky)
    matrix = (u * np.array([1.0, 1.0, np.linalg.det(u) * np.linalg.det(vt)])) @ vt
    return float(np.radians(roll_at(matrix, matrix[2])))


def _enclosed_agree(sight: Sight, seen: Ints, sky: Floats, tolerance: float) -> Bools:
    """Whether all three inner angles (equations 2.5 to 2.7) agree, (K,)."""
    ends = ((1, 2), (2, 0), (0, 1))
    sides = np.stack([np.linalg.norm(sky[:, a] - sky[:, b], axis=1) for a, b in ends], axis=1)
    real = _inner(2.0 * np.arcsin(np.minimum(sides / 2.0, 1.0)))
    image = _inner(np.array([[sight.separation[seen[a], seen[b]] for a, b in ends]]))
    return np.asarray((np.abs(real - image) <= tolerance).all(axis=1))


def _inner(sides: Floats) -> Floats:
    """Inner angles (K, 3) of spherical triangles with sides (K, 3) opposite to them."""
    a, b, c = sides, np.roll(sides, -1, axis=1), np.roll(sides, -2, axis=1)
    below = np.maximum(np.sin(b) * np.sin(c), 1e-15)
    return np.asarray(np.arccos(np.clip((np.cos(a) - np.cos(b) * np.cos(c)) / below, -1.0, 1.0)))


def _wrapped(angle: Floats) -> Floats:
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)
