"""Catalogue triads that fit three detections: separations, rotation, enclosed angle."""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Array, Floats, Ints
from kochab.core.attitude import cross_product
from kochab.core.camera import Camera
from kochab.core.frame import Detections
from kochab.core.progress import Progress, Task
from kochab.core.values import frozen, mutable
from kochab.lab.methods.pairs import Pairs, angles_between, spread

SLACK_RAD = 2e-5  # the first look at a third side is a little generous
TOGETHER = 1_000_000  # catalogue triads that are looked at in one go


class TooManyTriadsError(Exception):
    """More catalogue triads than may be looked at for one frame."""


@mutable
class TriadBudget:
    """How many catalogue triads may still be looked at for one frame, and what came of the others.

    ``tried`` counts the pairs of catalogue stars looked at, ``named`` the most stars that got names.
    """

    left: int
    tried: int = 0
    named: int = 0

    def take(self, count: int) -> None:
        """Look at so many; TooManyTriadsError when there are not so many left."""
        if count > self.left:
            raise TooManyTriadsError
        self.left -= count


@frozen
class AngleUnit:
    """How angles are counted: ``per_rad`` to the radian, and cut off to integers when ``whole``."""

    per_rad: float = 1.0
    whole: bool = False

    def of(self, radians: Floats) -> Array:
        """Radians in this unit."""
        scaled = radians * self.per_rad
        return np.trunc(scaled).astype(np.int64) if self.whole else scaled

    def radians(self, numbers: Array) -> Floats:
        """Back again, to the last bit."""
        return np.asarray(numbers / self.per_rad, dtype=np.float64)


@frozen(eq=False)
class TriadDetections:
    """The n detections of one parity.

    ``body`` (n, 3) unit vectors in camera axes; ``plane`` (n, 2) px from the centre, y up, x reversed when
    mirrored; ``size_px`` (2,) of the frame, ``size_rad`` (2,) on the sky, pixels times the scale; ``flat`` whether
    separations follow the latter, by equation 2.4, instead of the directions.
    """

    body: Floats
    plane: Floats
    size_px: Ints
    size_rad: Floats
    flat: bool

    @classmethod
    def of(
        cls, detections: Detections, focal_px: float, mirrored: bool, field_deg: tuple[float, float] | None
    ) -> "TriadDetections":
        """All detections of a frame.

        Parameters
        ----------
        detections : Detections
            Of the frame.
        focal_px : float
            Focal length.
        mirrored : bool
            Whether the frame is mirrored.
        field_deg : tuple[float, float] or None
            The frame's size, degrees; None: by the focal length.
        """
        xy = detections.xy
        size = np.array([detections.width, detections.height])
        sign = -1.0 if mirrored else 1.0
        plane = (xy - (size - 1) / 2.0) * np.array([sign, -1.0])
        camera = Camera.centred(detections.width, detections.height, focal_px, mirrored)
        across = size / focal_px if field_deg is None else np.radians(field_deg)
        return cls(camera.unproject(xy), plane, size, across, field_deg is not None)

    @property
    def separation(self) -> Floats:
        """All separations (n, n), radians."""
        if not self.flat:
            return angles_between(self.body[:, None], self.body)
        step = (self.plane[:, None] - self.plane[None]) * self.size_rad / self.size_px
        return np.asarray(np.arccos(np.clip(np.cos(step).prod(axis=2), -1.0, 1.0)))


@frozen(eq=False)
class FoundTriads:
    """Triads: ``detection`` and ``star`` (K, 3), mean ``rotation`` (K,) radians, when known."""

    detection: Ints
    star: Ints
    rotation: Floats


def triads_by_separation(
    pairs: Pairs, separation: Array, tolerance_rad: float, unit: AngleUnit, allowance: TriadBudget
) -> Task[tuple[Ints, Ints, int]]:
    """Detections and stars (T, 3) of all triads whose three separations agree; and how many pairs were looked at.

    TooManyTriadsError when it would take more triads than are allowed.

    Parameters
    ----------
    pairs : Pairs
        Of the catalogue.
    separation : Array
        Of the detections (n, n), in ``unit``.
    tolerance_rad : float
        How far they may differ.
    unit : AngleUnit
        How angles are stored.
    allowance : TriadBudget
        How many triads may still be made.
    """
    n = len(separation)
    tolerance = unit.of(np.array(tolerance_rad))
    lists, looked = _lists(pairs, separation, tolerance, unit.of(pairs.angle))
    # Single precision costs 1e-7 in the cosine, which the 2e-7 of _third_sides covers.
    rough = pairs.vectors.astype(np.float32)  # half the memory to gather from
    seen, stars = [np.zeros((0, 3), dtype=np.int64)], [np.zeros((0, 3), dtype=np.int64)]
    for k, corners in enumerate(combinations(range(n), 3)):
        yield Progress("identify", 0.8 * k / (n * (n - 1) * (n - 2) / 6), "triads")
        turns = (corners, corners[1:] + corners[:1], corners[2:] + corners[:2])
        # Of the three ways to join two lists at a corner the one with the smallest product of lengths is cheapest.
        v, a, b = min(turns, key=lambda t: len(lists[t[:2]].one) * len(lists[t[0], t[2]].one))
        side = separation[a, b]
        one, other = lists[v, a], lists[v, b]
        allowance.take(int((other.first[one.one + 1] - other.first[one.one]).sum()))
        found = _third_sides(pairs, rough, one, other, side, tolerance, unit)
        stars.append(found)
        seen.append(np.repeat(np.array([[v, a, b]]), len(found), axis=0))
    detection, star = np.concatenate(seen), np.concatenate(stars)
    # The corner at which lists were joined came first; ascending detections make rows of all triads alike.
    order = np.argsort(detection, axis=1)
    rows = np.arange(len(order))[:, None]
    return detection[rows, order], star[rows, order], looked


@frozen(eq=False)
class _PairList:
    """Pairs of stars for two detections, both ways round: ``first`` (N + 1,) entry of each star."""

    one: Ints
    other: Ints
    first: Ints


def _lists(
    pairs: Pairs, separation: Array, tolerance: Array, angle: Array
) -> tuple[dict[tuple[int, int], _PairList], int]:
    """For each two detections the pairs, both ways round: one star, other, first of a star."""
    lists, looked = {}, 0
    for i, j in combinations(range(len(separation)), 2):
        start = np.searchsorted(angle, separation[i, j] - tolerance, "left")
        stop = np.searchsorted(angle, separation[i, j] + tolerance, "right")
        a, b = pairs.first[start:stop], pairs.second[start:stop]
        looked += len(a)
        one, other = np.concatenate([a, b]).astype(np.int64), np.concatenate([b, a])
        order = np.argsort(one, kind="stable")
        # The pairs that begin with star k are rows first[k] to first[k + 1].
        first = np.concatenate([[0], np.cumsum(np.bincount(one, minlength=pairs.stars))])
        lists[i, j] = lists[j, i] = _PairList(one[order], other[order].astype(np.int64), first)
    return lists, looked


def _third_sides(
    pairs: Pairs,
    rough: NDArray[np.float32],
    one: _PairList,
    other: _PairList,
    side: Array,
    tolerance: Array,
    unit: AngleUnit,
) -> Ints:
    """Stars (K, 3) of two lists with the same first star whose ends are ``side`` apart."""
    start, middle, first = one.one, one.other, other.first
    slack = SLACK_RAD + 2.0 * unit.whole / unit.per_rad
    # low and high are cosines, so low bounds the smallest angle from above.
    low = np.cos(np.maximum(unit.radians(side - tolerance) - slack, 0.0)) + 2e-7
    high = np.cos(np.minimum(unit.radians(side + tolerance) + slack, np.pi)) - 2e-7
    count = first[start + 1] - first[start]
    # Cut so that each part expands to about TOGETHER triads.
    cuts = np.searchsorted(np.cumsum(count), np.arange(TOGETHER, int(count.sum()), TOGETHER))
    found = []
    for part in np.split(np.arange(len(start)), cuts):
        which, at = spread(first[start[part]], first[start[part] + 1])
        which = part[which]
        ends = middle[which], other.other[at]
        cosine = np.einsum("ij,ij->i", rough[ends[0]], rough[ends[1]])
        near = (cosine <= low) & (cosine >= high)
        triad = np.stack([start[which[near]], ends[0][near], ends[1][near]], axis=1)
        far = unit.of(angles_between(pairs.vectors[triad[:, 1]], pairs.vectors[triad[:, 2]]))
        found.append(triad[np.abs(far - side) <= tolerance])
    return np.concatenate(found)


# -- The rotation-angle and the enclosed-angle test, in floating point, many at once -------------
# The thesis "Attitude from stellar images", sections 2.3.4.1 and 2.3.4.2.

UP = np.array([0.0, -1.0, 0.0])  # the camera's up, the pole of bearings in the frame
POLE = np.array([0.0, 0.0, 1.0])
ENDS = ((1, 2), (2, 0), (0, 1))  # the corners a side joins, opposite to corners 0, 1, 2


@frozen
class Tests:
    """Tolerances, radians, of separations, rotation angles and enclosed angles."""

    separation: float
    rotation: float
    enclosed: float


def passing_triads(
    sight: TriadDetections, seen: Ints, stars: Ints, pairs: Pairs, tests: Tests, planar: bool
) -> FoundTriads:
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
    planar : bool
        Whether rotations are taken on the flat image, as the thesis does.
    """
    turn = rotations(sight, seen, pairs.vectors[stars], planar)
    off = wrapped(turn[:, 0] - turn[:, 1])
    kept = np.abs(off) <= tests.rotation
    mean = (turn[:, 1] + off / 2.0)[kept]
    seen, stars = seen[kept], stars[kept]
    enclosed = inner(chord_sides(pairs.vectors[stars])) - inner(image_sides(sight.separation, seen))
    kept = np.asarray((np.abs(enclosed) <= tests.enclosed).all(axis=1))
    seen, stars, mean = seen[kept], stars[kept], mean[kept]
    if not planar and len(seen):
        # Bearings turn with the place in the frame near a pole; the rotation at the centre does not.
        mean = rolls(sight.body[seen], pairs.vectors[stars])
    return FoundTriads(seen, stars, mean)


def rotations(sight: TriadDetections, seen: Ints, sky: Floats, planar: bool) -> Floats:
    """Angles (T, 2), counterclockwise, from image to sky of the first star's two vectors.

    Parameters
    ----------
    sight : TriadDetections
        The detections.
    seen : Ints
        Detections of each triad (T, 3).
    sky : Floats
        Directions of its stars (T, 3, 3).
    planar : bool
        Whether rotations are taken on the flat image.
    """
    out = []
    for end in (1, 2):
        if planar:
            step = sight.plane[seen[:, end]] - sight.plane[seen[:, 0]]
            ra = np.arctan2(sky[..., 1], sky[..., 0])
            dec = np.arcsin(np.clip(sky[..., 2], -1.0, 1.0))
            east = wrapped(ra[:, end] - ra[:, 0])
            # -east: the frame's x grows to the west where its y is north and it is not mirrored.
            real = np.arctan2(dec[:, end] - dec[:, 0], -east)
            out.append(real - np.arctan2(step[:, 1], step[:, 0]))
        else:
            body = sight.body[seen]
            image = _bearing(body[:, 0], body[:, end], UP)
            out.append(_bearing(sky[:, 0], sky[:, end], POLE) - image)
    return np.stack(out, axis=1)


def _bearing(start: Floats, end: Floats, pole: Floats) -> Floats:
    """Position angle of ``end`` at ``start`` (..., 3), radians, from the pole by the left."""
    left = cross_product(pole, start)
    up = cross_product(start, left)
    return np.asarray(np.arctan2((end * left).sum(-1), (end * up).sum(-1)))


def rolls(body: Floats, sky: Floats) -> Floats:
    """Rotation at the frame's centre (T,), radians, of triads (T, 3, 3) seen and real."""
    # Kabsch: the rotation nearest to body^T sky; the sign of the last axis keeps it from being a reflection.
    u, _, vt = np.linalg.svd(np.swapaxes(body, 1, 2) @ sky)
    proper = np.linalg.det(u) * np.linalg.det(vt)
    u[:, :, 2] *= proper[:, None]
    matrix = u @ vt
    z, up = matrix[:, 2], -matrix[:, 1]
    east = np.stack([-z[:, 1], z[:, 0], np.zeros(len(z))], axis=1)
    return np.asarray(np.arctan2((up * east).sum(-1), (up * cross_product(z, east)).sum(-1)))


def image_sides(separation: Array, seen: Ints) -> Array:
    """Sides (T, 3), in the unit of ``separation`` (n, n), opposite to the corners of triads (T, 3)."""
    return np.stack([separation[seen[:, a], seen[:, b]] for a, b in ENDS], axis=1)


def chord_sides(sky: Floats) -> Floats:
    """Sides (T, 3), radians, opposite to the corners of triangles (T, 3, 3)."""
    return np.stack([angles_between(sky[:, a], sky[:, b]) for a, b in ENDS], axis=1)


def inner(sides: Floats) -> Floats:
    """Inner angles (T, 3) of spherical triangles with sides (T, 3) opposite to them."""
    a, b, c = sides, np.roll(sides, -1, axis=1), np.roll(sides, -2, axis=1)
    # 1e-15 keeps two stars in one place from dividing by zero.
    below = np.maximum(np.sin(b) * np.sin(c), 1e-15)
    return np.asarray(np.arccos(np.clip((np.cos(a) - np.cos(b) * np.cos(c)) / below, -1.0, 1.0)))


def wrapped(angle: Array, half: float = np.pi) -> Array:
    """Angles in [-half, half), half a turn being ``half``."""
    return np.asarray((angle + half) % (2 * half) - half)
