"""The default method's quick road where the camera is known: triangles of the brightest detections.

With the scale known to a few parts in a hundred, two stars propose a pointing and every other
detection bears witness. So few are needed that three can be enough, when their places are good. The
false-alarm bound counts every pair of catalogue stars that any two proposers could have been.
"""

import math
from collections.abc import Iterator
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from app.identify.chance import ACCEPT_LOG10, log10_by_distance
from app.identify.hypotheses import Hypotheses, pointings
from app.identify.known_pointing import triple, two_stars
from app.identify.known_table import PairTable
from app.identify.known_triangles import Corners, Sight, guess, triangles, turned
from app.identify.support import support
from app.identify.verify import Pointing, Verdict

Floats = NDArray[np.float64]
Guess = tuple[Corners, bool]
"""Three stars and the parity."""

FEW = 5
"""With so few detections chance has room."""
POOR, BRIGHTEST = 8, 6
"""Of so many detections all triangles are asked about, else only those of the brightest."""
WITNESSES = 20
FIRST, ERROR = 1e-3, 2e-3
"""Errors of a side that are allowed, over the frame's larger side: at first, and of any."""
GLANCE = 4
"""So many triangles are asked about with the small error, which is quick and mostly enough."""
REACH = 2.5
"""How far a witness may be off, in errors of a side."""
SMALLEST = 0.02
"""Triangles with a smaller side are not asked about; witnesses as near to another do not count."""
LEAST = 1e-5
"""Agreement closer than this, over the larger side, is worth no more."""
FLAT = 3.0
"""A triangle no higher than so many errors tells nothing of the parity."""
CROWD, CLOSER = 4, 8
"""More guesses of a triangle than this get a quick look, and so many of them the closer one."""


class KnownSearch:
    """One frame's triangles in one table.

    ``xy`` (N, 2) px from the frame's middle, brightest first; ``half`` (2,) half its width and
    height; ``sight`` the separations of its `asked` detections; ``ways`` how many searches like
    this one the frame gets.
    """

    def __init__(
        self, table: PairTable, xy: Floats, half: Floats, sight: Sight, ways: int = 1
    ) -> None:
        self.table, self.xy, self.sight, self.ways = table, xy[:WITNESSES], sight, ways
        self.places: list[tuple[float, float]] = self.xy.tolist()
        self.points = np.ascontiguousarray(self.xy).view(np.complex128)  # (N, 1), x + iy
        width, height = half.tolist()
        self.side: float = 2.0 * max(width, height)
        self.corner = math.hypot(width, height)
        self.density: float = len(table.rows) / (4.0 * math.pi) / sight.focal**2
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
            yield from self._asked(islice(self._corners(), GLANCE), first)
        yield from self._asked(self._corners(), most)

    def _asked(self, corners: Iterator[Corners], error_px: float) -> Iterator[Verdict]:
        for triangle in corners:
            self.triangles += 1
            self._count(triangle)
            stars = guess(self.table, self.sight, triangle, error_px / self.sight.focal)
            if stars:
                yield from self._checked(triangle, stars, error_px)

    def _corners(self) -> Iterator[Corners]:
        """The triangles to ask about, those of the brightest first."""
        angle = self.sight.angle
        smallest, reach = SMALLEST * self.side / self.sight.focal, self.table.reach_rad
        for corners in triangles(len(angle)):
            a, b, c = turned(corners, angle)
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
        one, more = (self.ways * others * sum(part) for part in per)
        radius = most
        for _ in range(3):  # more pointings agree within a wider radius: it settles at once
            share = (10.0**ACCEPT_LOG10 / (one + more * radius)) ** (1.0 / others)
            radius = math.sqrt(share / (self.density * math.pi))
        return min(max(2.0 * radius, LEAST * self.side), most)

    def _pointings(self, b: int, c: int) -> tuple[float, float]:
        """How many pointings two proposers make that agree within r px, as ``a + b r``.

        N stars spread about evenly make N^2 / 2 pairs, which count two ways round and as two
        parities.
        """
        pairs = 2.0 * len(self.table.rows) ** 2 * math.sin(self.sight.angle[b][c])
        return pairs * self.sight.growth[b][c], pairs / self.sight.focal

    def _count(self, triangle: Corners) -> None:
        """Count the pointings that the longest side proposes, once."""
        _, b, c = triangle
        ends = (b, c) if b < c else (c, b)
        if ends not in self.proposed:
            self.proposed.add(ends)
            (a0, b0), (a1, b1) = self.trials, self._pointings(b, c)
            self.trials = (a0 + self.ways * a1, b0 + self.ways * b1)

    def _checked(
        self, triangle: Corners, stars: list[Corners], error_px: float
    ) -> Iterator[Verdict]:
        guesses = self._with_parity(triangle, stars, error_px)
        if len(guesses) > CROWD:
            guesses = self._likeliest(triangle, guesses, error_px)
        for numbers, mirrored in guesses:
            verdict = self._check(triangle, numbers, mirrored, REACH * error_px)
            if verdict is not None:
                yield verdict

    def _with_parity(self, triangle: Corners, stars: list[Corners], error_px: float) -> list[Guess]:
        """The stars with the parity that the triangle's sense means; both where it is flat."""
        (ax, ay), (bx, by), (cx, cy) = (self.places[k] for k in triangle)
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        flat = abs(area) < FLAT * error_px * math.hypot(cx - bx, cy - by)
        out = []
        for numbers in stars:
            sense = triple(*self.table.vectors.take(numbers, axis=0).tolist())
            mirrored = (area > 0.0) != (sense > 0.0)
            out.append((numbers, mirrored))
            if flat:
                out.append((numbers, not mirrored))
        return out

    def _likeliest(self, triangle: Corners, guesses: list[Guess], error_px: float) -> list[Guess]:
        """Those of many guesses for which most of the other detections have a star nearby."""
        a, b, c = triangle
        stars = np.array([g[0] for g in guesses])
        mirrored = np.array([g[1] for g in guesses])
        sky = self.table.vectors[stars[:, 1:]]
        gap = sky[:, 0] - sky[:, 1]
        angle = 2.0 * np.arcsin(np.sqrt((gap * gap).sum(axis=1)) / 2.0)
        off = (self.sight.angle[b][c] - angle) / max(self.sight.growth[b][c], 1e-12)
        focal = self.sight.focal * (1.0 + self.sight.room * np.clip(off, -1.0, 1.0))
        detections = np.tile(np.array([b, c, a]), (len(guesses), 1))
        matrix = pointings(self.xy, detections, sky, focal, mirrored)
        level = np.full(len(guesses), self.table.level)
        found = Hypotheses(matrix, focal, mirrored, level, detections, stars)
        votes = support(self.table.volume, self.xy, found, REACH * error_px)
        needed = self._needed(error_px) - 1  # the third corner has agreed already
        best = np.argsort(-votes, kind="stable")[:CLOSER]
        return [guesses[k] for k in best if votes[k] >= needed]

    def _needed(self, radius: float) -> int:
        """The fewest witnesses within ``radius`` px that would be believed."""
        others = len(self.xy) - 2
        for m in range(1, others):
            alarm, _ = log10_by_distance([radius] * m, others, self.density, self.trials)
            if alarm < ACCEPT_LOG10:
                return m
        return others

    def _check(
        self, triangle: Corners, stars: Corners, mirrored: bool, reach: float
    ) -> Verdict | None:
        """What the other detections say of the pointing that the longest side proposes."""
        _, b, c = triangle
        p, q = self.table.vectors.take(stars[1:], axis=0).tolist()
        off = self.sight.angle[b][c] - 2.0 * math.asin(math.dist(p, q) / 2.0)
        off = min(max(off / max(self.sight.growth[b][c], 1e-12), -1.0), 1.0)
        focal, sign = self.sight.focal * (1.0 + self.sight.room * off), -1.0 if mirrored else 1.0
        (bx, by), (cx, cy) = self.places[b], self.places[c]
        across, down, ahead = two_stars((sign * bx, by, focal), (sign * cx, cy, focal), p, q)
        wide = (self.corner + reach) / focal
        number = self.table.near(ahead, 1.0 / math.sqrt(1.0 + wide * wide))
        sky = self.table.vectors.take(number, axis=0).T
        plane = [complex(sign * x, y) for x, y in zip(across, down, strict=True)]
        seen, depth = np.array([plane, [z / focal for z in ahead]]) @ sky
        gap = np.abs(self.points - seen / depth)
        closest = gap.min(axis=1)
        alarm, radius = self._alarm(closest.tolist(), b, c, reach)
        self.least = min(self.least, alarm)
        if alarm > ACCEPT_LOG10:
            return None
        i = (closest <= radius).nonzero()[0]
        rms = math.sqrt(float(closest[i] @ closest[i]) / len(i))
        start = Pointing(np.array([across, down, ahead]), focal, mirrored)
        return Verdict(start, i, number[gap.argmin(axis=1)[i]], alarm, rms, self.table.level)

    def _alarm(self, gap: list[float], b: int, c: int, reach: float) -> tuple[float, float]:
        """The bound, log10, and the radius that it counts; ``gap`` in px."""
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
        alarm, agree = log10_by_distance(radii, len(gap) - 2, self.density, self.trials)
        return alarm, radii[agree - 1] if agree else 0.0
