"""Three detections against catalogue stars that are as far apart, before any other test."""

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.core.camera import Camera
from app.core.detections import Detections
from app.core.progress import Progress, Task
from app.identify.pairs import Pairs

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Numbers = NDArray[Any]
"""Angles in the numbers of some arithmetic: radians as floats, or fixed-point integers."""
SLACK_RAD = 2e-5  # the first look at a third side is a little generous
TOGETHER = 1_000_000  # catalogue triads that are looked at in one go


class TooManyTriadsError(Exception):
    """More catalogue triads than may be looked at for one frame."""


@dataclass(slots=True)
class Allowance:
    """How many catalogue triads may still be looked at for one frame."""

    left: int

    def take(self, count: int) -> None:
        """Look at so many.

        Raises
        ------
        TooManyTriadsError
            There are not so many left.

        """
        if count > self.left:
            raise TooManyTriadsError
        self.left -= count


@dataclass(frozen=True, slots=True)
class Unit:
    """How angles are counted: ``per_rad`` to the radian, and cut off to integers when ``whole``."""

    per_rad: float = 1.0
    whole: bool = False

    def of(self, radians: Floats) -> Numbers:
        """Radians in this unit."""
        scaled = radians * self.per_rad
        return np.trunc(scaled).astype(np.int64) if self.whole else scaled

    def radians(self, numbers: Numbers) -> Floats:
        """Back again, to the last bit."""
        return np.asarray(numbers / self.per_rad, dtype=np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """The n detections of one parity.

    ``body`` (n, 3) unit vectors in camera axes; ``plane`` (n, 2) px from the centre, y up, x
    reversed when mirrored; ``size_px`` (2,) of the frame, ``size_rad`` (2,) on the sky, pixels
    times the scale; ``flat`` whether separations follow the latter, by equation 2.4, instead of
    the directions.
    """

    body: Floats
    plane: Floats
    size_px: Ints
    size_rad: Floats
    flat: bool

    @classmethod
    def of(
        cls, detections: Detections, focal_px: float, mirrored: bool,
        field_deg: tuple[float, float] | None,
    ) -> "Sight":  # fmt: skip
        """All ``detections``; ``field_deg`` is the frame's size when it is given."""
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
            gap = np.linalg.norm(self.body[:, None] - self.body[None], axis=2)
            return np.asarray(2.0 * np.arcsin(np.minimum(gap / 2.0, 1.0)))
        step = (self.plane[:, None] - self.plane[None]) * self.size_rad / self.size_px
        return np.asarray(np.arccos(np.clip(np.cos(step).prod(axis=2), -1.0, 1.0)))


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Triads: ``detection`` and ``star`` (K, 3), mean ``rotation`` (K,) radians, when known."""

    detection: Ints
    star: Ints
    rotation: Floats


def separated(
    pairs: Pairs, separation: Numbers, tolerance_rad: float, unit: Unit, allowance: Allowance
) -> Task[tuple[Ints, Ints, int]]:
    """Detections (T, 3) and stars (T, 3) of all triads whose three separations agree.

    ``separation`` (n, n) is in ``unit``. The third result counts the catalogue pairs looked at.

    Raises
    ------
    TooManyTriadsError
        It would take more triads than ``allowance`` has left.

    """
    n = len(separation)
    tolerance = unit.of(np.array(tolerance_rad))
    lists, looked = _lists(pairs, separation, tolerance, unit.of(pairs.angle))
    rough = pairs.vectors.astype(np.float32)  # half the memory to gather from
    seen, stars = [np.zeros((0, 3), dtype=np.int64)], [np.zeros((0, 3), dtype=np.int64)]
    for k, corners in enumerate(combinations(range(n), 3)):
        yield Progress("identify", 0.8 * k / (n * (n - 1) * (n - 2) / 6), "triads")
        turns = (corners, corners[1:] + corners[:1], corners[2:] + corners[:2])
        v, a, b = min(turns, key=lambda t: len(lists[t[:2]].one) * len(lists[t[0], t[2]].one))
        side = separation[a, b]
        allowance.take(_joined(lists[v, a], lists[v, b]))
        found = _third_sides(pairs, rough, lists[v, a], lists[v, b], side, tolerance, unit)
        stars.append(found)
        seen.append(np.repeat(np.array([[v, a, b]]), len(found), axis=0))
    detection, star = np.concatenate(seen), np.concatenate(stars)
    order = np.argsort(detection, axis=1)
    rows = np.arange(len(order))[:, None]
    return detection[rows, order], star[rows, order], looked


@dataclass(frozen=True, slots=True, eq=False)
class _List:
    """Pairs of stars for two detections, both ways round: ``first`` (N + 1,) entry of each star."""

    one: Ints
    other: Ints
    first: Ints


def _joined(one: _List, other: _List) -> int:
    """How many triads two lists with the same first star make."""
    return int((other.first[one.one + 1] - other.first[one.one]).sum())


def _lists(
    pairs: Pairs, separation: Numbers, tolerance: Numbers, angle: Numbers
) -> tuple[dict[tuple[int, int], _List], int]:
    """For each two detections the pairs, both ways round: one star, other, first of a star."""
    lists, looked = {}, 0
    for i, j in combinations(range(len(separation)), 2):
        start = np.searchsorted(angle, separation[i, j] - tolerance, "left")
        stop = np.searchsorted(angle, separation[i, j] + tolerance, "right")
        a, b = pairs.first[start:stop], pairs.second[start:stop]
        looked += len(a)
        one, other = np.concatenate([a, b]).astype(np.int64), np.concatenate([b, a])
        order = np.argsort(one, kind="stable")
        first = np.concatenate([[0], np.cumsum(np.bincount(one, minlength=pairs.stars))])
        lists[i, j] = lists[j, i] = _List(one[order], other[order].astype(np.int64), first)
    return lists, looked


def _third_sides(
    pairs: Pairs, rough: NDArray[np.float32], one: _List, other: _List, side: Numbers,
    tolerance: Numbers, unit: Unit,
) -> Ints:  # fmt: skip
    """Stars (K, 3) of two lists with the same first star whose ends are ``side`` apart."""
    start, middle, first = one.one, one.other, other.first
    slack = SLACK_RAD + 2.0 * unit.whole / unit.per_rad
    low = np.cos(np.maximum(unit.radians(side - tolerance) - slack, 0.0)) + 2e-7
    high = np.cos(np.minimum(unit.radians(side + tolerance) + slack, np.pi)) - 2e-7
    count = first[start + 1] - first[start]
    cuts = np.searchsorted(np.cumsum(count), np.arange(TOGETHER, int(count.sum()), TOGETHER))
    found = []
    for part in np.split(np.arange(len(start)), cuts):
        which, at = pairs.spread(first[start[part]], first[start[part] + 1])
        which = part[which]
        ends = middle[which], other.other[at]
        cosine = np.einsum("ij,ij->i", rough[ends[0]], rough[ends[1]])
        near = (cosine <= low) & (cosine >= high)
        triad = np.stack([start[which[near]], ends[0][near], ends[1][near]], axis=1)
        gap = np.linalg.norm(pairs.vectors[triad[:, 1]] - pairs.vectors[triad[:, 2]], axis=1)
        far = unit.of(2.0 * np.arcsin(np.minimum(gap / 2.0, 1.0)))
        found.append(triad[np.abs(far - side) <= tolerance])
    return np.concatenate(found)
