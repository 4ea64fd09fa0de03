"""The default method where the scale is known: triangles of the brightest detections.

With the scale known to a few parts in a hundred, two stars propose a pointing and every other
detection is evidence. So few are needed that three can be enough, when their places are good. The
false-alarm bound counts every pair of catalogue stars that any two proposers could have been.
"""

import math
from collections.abc import Iterator
from functools import lru_cache
from itertools import islice

import numpy as np

from kochab.core.arrays import Floats, Ints32
from kochab.core.values import frozen
from kochab.identification.pair_table import PairTable
from kochab.identification.quads import Hypotheses, pointings
from kochab.identification.verification import (
    ACCEPT_LOG10,
    CandidatePointing,
    Verdict,
    log10_by_distance,
    support,
    with_crowding,
)

# Triangles of detections among the catalogue's, when the scale is known: side, side, side. The
# shortest side finds the pairs of stars that it may be, each with the scale that this would mean;
# the rings about one end have the stars that are as far away as the third corner; the last side
# decides. No table of triangles is needed, and nothing is compared that a side has not chosen.

Corners = tuple[int, int, int]

PART = 0.2
"""Where the scale moves a side by less than this share of the error, it is left out of account."""


@frozen(eq=False)
class DetectionAngles:
    """The brightest n detections through a camera known to a share of its focal length.

    ``focal`` is the middle of the focal lengths allowed, px, and ``room`` how far they go, as a share. ``angle``
    (n, n) are the separations at the middle, rad, and ``growth`` (n, n) what is taken off them at the end of the
    range, where the focal length is (1 + room) times the middle's. Both are lists: they are asked for one by one.
    """

    focal: float
    room: float
    angle: list[list[float]]
    growth: list[list[float]]

    @classmethod
    def of(cls, xy: Floats, scale: tuple[float, float]) -> "DetectionAngles":
        """Of detections (n, 2) px from the middle; ``scale`` the focal lengths allowed, px."""
        focal = (scale[0] * scale[1]) ** 0.5
        dot = xy @ xy.T
        both = np.array([focal * focal, scale[1] * scale[1]])[:, None, None] + dot
        length = np.sqrt(both.diagonal(axis1=1, axis2=2))
        # a star with itself may come to a hair above one
        angle = np.arccos(np.minimum(both / (length[:, :, None] * length[:, None]), 1.0))
        return cls(focal, scale[1] / focal - 1.0, angle[0].tolist(), (angle[0] - angle[1]).tolist())


@lru_cache(maxsize=16)
def triangles(n: int) -> tuple[Corners, ...]:
    """All corners of triangles of n detections, those of the brightest first."""
    return tuple((i, j, k) for k in range(2, n) for j in range(1, k) for i in range(j))


def shortest_side_first(corners: Corners, angle: list[list[float]]) -> Corners:
    """The same triangle: first the corner of its two shorter sides, of which the shortest first."""
    # three exchanges sort the sides, and the corners opposite with them
    i, j, k = corners
    a, b, c = angle[j][k], angle[i][k], angle[i][j]  # opposite the corners
    if a < b:
        i, j, a, b = j, i, b, a
    if b < c:
        j, k, b, c = k, j, c, b
        if a < b:
            i, j = j, i
    return i, j, k


def matching_triangles(table: PairTable, angles: DetectionAngles, corners: Corners, error_rad: float) -> list[Corners]:
    """Every triangle of stars with the sides of one of detections.

    Parameters
    ----------
    table : PairTable
        The pairs of stars by their separation.
    angles : DetectionAngles
        Separations of the detections, and how they grow with the scale.
    corners : Corners
        Numbers of three detections as `shortest_side_first` gave them.
    error_rad : float
        Allowed in each side, radians, at the scale that the longest side means.
    """
    a, b, c = corners
    base, room = angles.angle[a][b], angles.growth[a][b]
    here, wide = angles.angle[a][c], angles.growth[a][c]
    pairs = table.between(base - room - error_rad, base + room + error_rad)
    one = table.one[pairs]
    if len(one) == 0:
        return []
    fixed = angles.growth[b][c] < PART * error_rad
    if fixed:
        entry, end = table.rings(one, here - error_rad, here + error_rad)
        row, found = table.neighbours(entry, end, here, error_rad)
    else:
        # the shortest side tells the scale, but no better than its own error
        off = (table.angle[pairs] - base) / room
        np.minimum(np.maximum(off, -1.0, out=off), 1.0, out=off)
        error = error_rad + min(error_rad * wide / room, 2.0 * wide)
        # where the scale moves the third star by less than a ring, all pairs can share the rings of one search
        if table.in_one_ring(here, wide):
            entry, end = table.rings(one, here - wide - error_rad, here + wide + error_rad)
        else:
            entry, end = table.rings_each(one, here - error, here + error, wide * off)
        row, found = table.neighbours(entry, end, (here + wide * off)[:, None], error)
    if len(row) == 0:
        return []
    first, second, third = one.take(row), table.other[pairs].take(row), table.neighbour.take(found)
    far = _separations(table, second, third)
    if fixed:
        off_rad = np.abs(far - angles.angle[b][c])
    else:
        sides = np.empty((3, len(row)))
        sides[0], sides[1], sides[2] = table.angle[pairs].take(row), table.apart.take(found), far
        off_rad = _misfit(angles, corners, sides)
    fits = (off_rad < error_rad).nonzero()[0]
    if len(fits) == 0:
        return []
    if len(fits) > 1:
        fits = fits.take(off_rad.take(fits).argsort())  # the likeliest first
    stars = first.take(fits), second.take(fits), third.take(fits)
    return list(zip(*(column.tolist() for column in stars), strict=True))


def _separations(table: PairTable, one: Ints32, other: Ints32) -> Floats:
    """Angles (K,) between stars, rad."""
    v = table.vectors
    cosine = (v.take(one, axis=0) * v.take(other, axis=0)).sum(axis=1)
    return np.asarray(np.arccos(np.minimum(cosine, 1.0)))


def _misfit(angles: DetectionAngles, corners: Corners, sides: Floats) -> Floats:
    """The largest error (K,) of sides (3, K), rad, where the last and longest gives the scale."""
    a, b, c = corners
    pairs = ((a, b), (a, c), (b, c))
    growth = np.array([[angles.growth[i][j]] for i, j in pairs])
    sides -= np.array([[angles.angle[i][j]] for i, j in pairs])
    off = sides[2] / growth[2]
    np.minimum(np.maximum(off, -1.0, out=off), 1.0, out=off)
    sides -= growth * off
    return np.asarray(np.abs(sides).max(axis=0))


# The attitude that puts two stars where they are seen, in plain numbers: ten times as quick.

Vector = tuple[float, float, float]


def attitude_of_two(p: Vector, q: Vector, star_p: list[float], star_q: list[float]) -> tuple[Vector, Vector, Vector]:
    """Rotation, three rows, ICRS to camera, for two directions and the stars that they are.

    What the separations differ by is shared: the middles agree, and the planes.

    Parameters
    ----------
    p, q : Vector
        Where the two are seen, camera axes, of any length.
    star_p, star_q : list[float]
        The stars' ICRS unit vectors.
    """
    (m, n, o), (k, l, r) = _axes(_unit(*p), _unit(*q)), _axes(star_p, star_q)  # noqa: E741
    x, y, z = [
        (a * k[0] + b * l[0] + c * r[0], a * k[1] + b * l[1] + c * r[1], a * k[2] + b * l[2] + c * r[2])
        for a, b, c in zip(m, n, o, strict=True)
    ]
    return x, y, z


def triple_product(p: list[float], q: list[float], r: list[float]) -> float:
    """The triple product of three vectors: its sign tells their sense, seen from within."""
    return p[0] * (q[1] * r[2] - q[2] * r[1]) + p[1] * (q[2] * r[0] - q[0] * r[2]) + p[2] * (q[0] * r[1] - q[1] * r[0])


def _axes(a: Vector | list[float], b: Vector | list[float]) -> tuple[Vector, Vector, Vector]:
    """Right-handed axes from the middle of two unit vectors and the plane they lie in."""
    m = _unit(a[0] + b[0], a[1] + b[1], a[2] + b[2])
    n = _unit(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    across = (m[1] * n[2] - m[2] * n[1], m[2] * n[0] - m[0] * n[2], m[0] * n[1] - m[1] * n[0])
    return m, n, across


def _unit(x: float, y: float, z: float) -> Vector:
    length = math.sqrt(x * x + y * y + z * z) or 1.0
    return x / length, y / length, z / length


Candidate = tuple[Corners, bool]
"""Three stars and the parity."""

FEW = 5
"""With so few detections chance has room."""
BRIGHTEST = 6
"""Of many detections only the triangles of so many are tried."""
MOST_EVIDENCE = 20
FIRST, ERROR = 1e-3, 2e-3
"""Errors of a side that are allowed, over the frame's larger side: at first, and of any."""
QUICK_TRIANGLES = 4
"""So many triangles are asked about with the small error, which is quick and mostly enough."""
REACH = 2.5
"""How far evidence may be off, in errors of a side."""
SMALLEST = 0.02
"""Triangles with a smaller side are not asked about; detections as near to another are no evidence."""
LEAST = 1e-5
"""Agreement closer than this, over the larger side, is worth no more."""
FLAT = 3.0
"""A triangle no higher than so many errors tells nothing of the parity."""
CROWD, CLOSER = 4, 8
"""More candidates of a triangle than this get a quick look, and so many of them the closer one."""


class KnownSearch:
    """One frame's triangles in one table.

    ``xy`` (N, 2) px from the frame's middle, brightest first; ``half`` (2,) half its width and height; ``angles``
    the separations of its `asked` detections; ``n_searches`` how many searches like this one the frame gets.
    """

    def __init__(
        self, table: PairTable, xy: Floats, half: Floats, angles: DetectionAngles, n_searches: int = 1
    ) -> None:
        self.table, self.xy, self.angles, self.n_searches = table, xy[:MOST_EVIDENCE], angles, n_searches
        self.places: list[tuple[float, float]] = self.xy.tolist()
        # as complex numbers all distances to N stars are one subtraction and one absolute value
        self.points = np.ascontiguousarray(self.xy).view(np.complex128)  # (N, 1), x + iy
        self.half = half
        width, height = half.tolist()
        self.side: float = 2.0 * max(width, height)
        self.corner = math.hypot(width, height)
        # in the frame's middle; farther out a pixel holds less sky, so that this is the most
        self.density: float = len(table.rows) / table.area_sr / angles.focal**2
        self.proposed: set[tuple[int, int]] = set()
        self.trials = (0.0, 0.0)
        self.triangles = 0
        self.least = 0.0

    @property
    def tried(self) -> int:
        """Pointings until now."""
        return int(self.trials[0] + self.trials[1] * ERROR * self.side)

    def verdicts(self) -> Iterator[Verdict]:
        """Every answer that chance cannot explain, in the order found.

        Its pointing is the proposers' own, good to a pixel or two.
        """
        most, first = self._error_px(), FIRST * self.side
        if most > first and len(self.xy) > FEW:
            yield from self._search(islice(self._corners(), QUICK_TRIANGLES), first)
        yield from self._search(self._corners(), most)

    def _search(self, corners: Iterator[Corners], error_px: float) -> Iterator[Verdict]:
        for triangle in corners:
            self.triangles += 1
            self._count(triangle)
            stars = matching_triangles(self.table, self.angles, triangle, error_px / self.angles.focal)
            if stars:
                yield from self._verified(triangle, stars, error_px)

    def _corners(self) -> Iterator[Corners]:
        """The triangles to ask about, those of the brightest first."""
        angle = self.angles.angle
        smallest, reach = SMALLEST * self.side / self.angles.focal, self.table.reach_rad
        for corners in triangles(len(angle)):
            a, b, c = shortest_side_first(corners, angle)
            if angle[a][b] > smallest and angle[a][c] < reach:
                yield a, b, c

    def _error_px(self) -> float:
        """The error of a side to allow, px: none at which nobody would be believed."""
        others, most = len(self.xy) - 2, ERROR * self.side
        if others > FEW - 2:
            return most
        ends = {(b, c) if b < c else (c, b) for _, b, c in self._corners()}
        if not ends:
            return most
        per = zip(*(self._pointings(b, c) for b, c in ends), strict=True)
        one, more = (self.n_searches * others * sum(part) for part in per)
        radius = most
        for _ in range(3):  # more pointings agree within a wider radius: it settles at once
            # how near all the others must be to be believed, if all agree
            share = (10.0**ACCEPT_LOG10 / (one + more * radius)) ** (1.0 / others)
            radius = math.sqrt(share / (self.density * math.pi))
        return min(max(2.0 * radius, LEAST * self.side), most)

    def _pointings(self, b: int, c: int) -> tuple[float, float]:
        """How many pointings two proposers make that agree within r px, as ``a + b r``.

        N stars spread about evenly over the area A make N^2 pi sin(angle) / A pairs per rad, which count two ways round
        and as two parities.
        """
        # they may be off by growth and r / f either way
        pairs = 8.0 * math.pi * len(self.table.rows) ** 2 / self.table.area_sr * math.sin(self.angles.angle[b][c])
        return pairs * abs(self.angles.growth[b][c]), pairs / self.angles.focal

    def _count(self, triangle: Corners) -> None:
        """Count the pointings that the longest side proposes, once."""
        _, b, c = triangle
        ends = (b, c) if b < c else (c, b)
        if ends not in self.proposed:
            self.proposed.add(ends)
            (a0, b0), (a1, b1) = self.trials, self._pointings(b, c)
            self.trials = (a0 + self.n_searches * a1, b0 + self.n_searches * b1)

    def _verified(self, triangle: Corners, stars: list[Corners], error_px: float) -> Iterator[Verdict]:
        candidates = self._with_parity(triangle, stars, error_px)
        if len(candidates) > CROWD:
            candidates = self._likeliest(triangle, candidates, error_px)
        for numbers, mirrored in candidates:
            verdict = self._verify(triangle, numbers, mirrored, REACH * error_px)
            if verdict is not None:
                yield verdict

    def _with_parity(self, triangle: Corners, stars: list[Corners], error_px: float) -> list[Candidate]:
        """The stars with the parity that the triangle's sense means; both where it is flat."""
        (ax, ay), (bx, by), (cx, cy) = (self.places[k] for k in triangle)
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        flat = abs(area) < FLAT * error_px * math.hypot(cx - bx, cy - by)
        out = []
        for numbers in stars:
            sense = triple_product(*self.table.vectors.take(numbers, axis=0).tolist())
            mirrored = (area > 0.0) != (sense > 0.0)
            out.append((numbers, mirrored))
            if flat:
                out.append((numbers, not mirrored))
        return out

    def _likeliest(self, triangle: Corners, candidates: list[Candidate], error_px: float) -> list[Candidate]:
        """Those of many candidates for which most of the other detections have a star nearby."""
        a, b, c = triangle
        stars = np.array([g[0] for g in candidates])
        mirrored = np.array([g[1] for g in candidates])
        sky = self.table.vectors[stars[:, 1:]]
        gap = sky[:, 0] - sky[:, 1]
        angle = 2.0 * np.arcsin(np.sqrt((gap * gap).sum(axis=1)) / 2.0)
        off = (self.angles.angle[b][c] - angle) / max(self.angles.growth[b][c], 1e-12)
        focal = self.angles.focal * (1.0 + self.angles.room * np.clip(off, -1.0, 1.0))
        detections = np.tile(np.array([b, c, a]), (len(candidates), 1))
        matrix = pointings(self.xy, detections, sky, focal, mirrored)
        level = np.full(len(candidates), self.table.level)
        found = Hypotheses(matrix, focal, mirrored, level, detections, stars)
        votes = support(self.table.volume, self.xy, found, REACH * error_px)
        needed = self._needed(error_px) - 1  # the third corner has agreed already
        best = np.argsort(-votes, kind="stable")[:CLOSER]
        return [candidates[k] for k in best if votes[k] >= needed]

    def _needed(self, radius: float) -> int:
        """The fewest detections within ``radius`` px that would be believed."""
        others = len(self.xy) - 2
        for m in range(1, others):
            alarm, _ = log10_by_distance([radius] * m, others, self.density, self.trials)
            if alarm < ACCEPT_LOG10:
                return m
        return others

    def _verify(self, triangle: Corners, stars: Corners, mirrored: bool, reach: float) -> Verdict | None:
        """What the other detections say of the pointing that the longest side proposes."""
        _, b, c = triangle
        p, q = self.table.vectors.take(stars[1:], axis=0).tolist()
        # how much longer the lens must be for the pair to be as far apart as its stars, from -1 to 1 of the range
        off = self.angles.angle[b][c] - 2.0 * math.asin(math.dist(p, q) / 2.0)
        off = min(max(off / max(self.angles.growth[b][c], 1e-12), -1.0), 1.0)
        focal, sign = self.angles.focal * (1.0 + self.angles.room * off), -1.0 if mirrored else 1.0
        (bx, by), (cx, cy) = self.places[b], self.places[c]
        across, down, ahead = attitude_of_two((sign * bx, by, focal), (sign * cx, cy, focal), p, q)
        wide = (self.corner + reach) / focal
        # the cosine of the frame's corner
        number = self.table.near(ahead, 1.0 / math.sqrt(1.0 + wide * wide))
        sky = self.table.vectors.take(number, axis=0).T
        plane = [complex(sign * x, y) for x, y in zip(across, down, strict=True)]
        seen, depth = np.array([plane, [z / focal for z in ahead]]) @ sky
        places = seen / depth
        gap = np.abs(self.points - places)
        closest = gap.min(axis=1)
        gaps = closest.tolist()
        alarm, radius = with_crowding(
            lambda crowd: self._alarm(gaps, b, c, reach, crowd),
            self.xy[[k for k in range(len(self.xy)) if k != b and k != c]],
            places.view(np.float64).reshape(-1, 2),
            self.half,
            self.density,
        )
        self.least = min(self.least, alarm)
        if alarm > ACCEPT_LOG10:
            return None
        i = (closest <= radius).nonzero()[0]
        rms = math.sqrt(float(closest[i] @ closest[i]) / len(i))
        start = CandidatePointing(np.array([across, down, ahead]), focal, mirrored)
        return Verdict(start, i, number[gap.argmin(axis=1)[i]], alarm, rms)

    def _alarm(self, gap: list[float], b: int, c: int, reach: float, crowd: float = 1.0) -> tuple[float, float]:
        """The bound, log10, and the radius that it counts; ``gap`` in px.

        ``crowd`` is how much denser the stars are where the evidence stands.
        """
        # counted are the pointings whose proposers agree within r, so r is never less than what these are off by
        floor = max(gap[b], gap[c], LEAST * self.side)
        smallest = (SMALLEST * self.side) ** 2
        taken, radii = [self.places[b], self.places[c]], []
        for d, k in sorted(zip(gap, range(len(gap)), strict=True)):
            if d > reach:
                break
            x, y = self.places[k]
            for u, v in taken:
                if (x - u) * (x - u) + (y - v) * (y - v) < smallest:
                    break
            else:
                taken.append((x, y))
                radii.append(max(d, floor))
        alarm, agree = log10_by_distance(radii, len(gap) - 2, crowd * self.density, self.trials)
        return alarm, radii[agree - 1] if agree else 0.0
