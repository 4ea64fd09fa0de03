"""The default method's quick road where the camera is known: triangles of the brightest detections.

With the scale known to a few parts in a hundred, two stars propose a pointing and every other
detection bears witness. So few are needed that three can be enough, when their places are good. The
false-alarm bound counts every pair of catalogue stars that any two proposers could have been.
"""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from app.identify.chance import log10_by_distance
from app.identify.hypotheses import Hypotheses, pointings
from app.identify.known_pointing import two_stars
from app.identify.known_table import PairTable
from app.identify.known_triangles import Corners, Sight, guess, triangles, turned
from app.identify.support import support
from app.identify.verify import Pointing, Verdict, refit

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ACCEPT_LOG10 = -5.0
POOR, FEW = 8, 6
"""Of so many detections all triangles are asked about; of so few with larger errors too."""
BRIGHTEST = 6
"""Detections whose triangles are asked about where there are more."""
WITNESSES = 20
FIRST, LOOSE = 1.2e-3, 4e-3
"""Errors of a side that are allowed, over the frame's larger side: at first, and if need be."""
SMALLEST = 0.02
"""Triangles with a smaller side are not asked about; witnesses as near to another do not count."""
LEAST = 1e-5
"""Agreement closer than this, over the larger side, is worth no more."""
FLAT = 3.0
"""A triangle no higher than so many errors tells nothing of the parity."""
CLOSER = 8
"""So many guesses of a triangle get the closer look."""


class KnownSearch:
    """One frame's triangles in one table.

    ``xy`` (N, 2) px from the frame's middle, brightest first; ``half`` (2,) half its width and
    height; ``scale`` the focal lengths allowed, px; ``ways`` how many searches like this one the
    frame gets.
    """

    def __init__(
        self, table: PairTable, xy: Floats, half: Floats, scale: tuple[float, float], ways: int = 1
    ) -> None:
        self.table, self.xy = table, xy[:WITNESSES]
        self.complete = len(xy) <= FEW
        self.asked = xy[: POOR if len(xy) <= POOR else BRIGHTEST]
        self.places: list[list[float]] = self.asked.tolist()
        self.side = 2.0 * float(half.max())
        self.corner = math.hypot(*half.tolist())
        self.sight = Sight.of(self.asked, scale)
        self.density = len(table.rows) / (4.0 * math.pi) / self.sight.focal**2
        self.ways = ways
        self.corners = self._corners()
        self.believable_px = self._believable_px()
        self.proposed: set[tuple[int, int]] = set()
        self.trials = (0.0, 0.0)
        self.least = 0.0

    @property
    def tried(self) -> int:
        """Pointings until now."""
        return int(self.trials[0] + self.trials[1] * FIRST * self.side)

    def verdicts(self) -> Iterator[Verdict]:
        """Every answer that chance cannot explain, in the order found."""
        for error_px in self._errors():
            for triangle in self.corners:
                self._count(triangle)
                stars = guess(self.table, self.sight, triangle, error_px / self.sight.focal)
                if len(stars):
                    yield from self._checked(triangle, stars, error_px)

    def _corners(self) -> list[Corners]:
        """The triangles to ask about, those of the brightest first."""
        angle = self.sight.angle
        smallest, reach = SMALLEST * self.side / self.sight.focal, self.table.reach_rad
        every = [turned(t, angle) for t in triangles(len(angle))]
        return [t for t in every if angle[t[0]][t[1]] > smallest and angle[t[0]][t[2]] < reach]

    @property
    def doubtful(self) -> bool:
        """Whether the frame's stars are so few that their places must be good to be believed."""
        return self.believable_px < LOOSE * self.side

    def _errors(self) -> Iterator[float]:
        """Errors of a side, px, to allow in turn: none at which nobody would be believed."""
        most = self.believable_px
        first, loose = min(FIRST * self.side, most), min(LOOSE * self.side, most)
        if first > 0.0:
            yield first
        if loose > 1.5 * first and self.complete:
            yield loose

    def _believable_px(self) -> float:
        """The largest error at which the agreement of all would still be an answer."""
        others = len(self.xy) - 2
        if others > POOR - 2:
            return math.inf
        if not self.corners:
            return 0.0
        per = [self._pointings(b, c) for b, c in {tuple(sorted(t[1:])) for t in self.corners}]
        a, b = (sum(column) for column in zip(*per, strict=True))
        radius = LOOSE * self.side
        while radius > LEAST * self.side:
            chance = min(self.density * math.pi * radius * radius, 1.0)
            tried = self.ways * others * (a + b * radius)
            if others * math.log10(chance) + math.log10(tried) < ACCEPT_LOG10:
                return 2.0 * radius
            radius /= 1.5
        return 0.0

    def _pointings(self, b: int, c: int) -> tuple[float, float]:
        """How many pointings two proposers make that agree within r px, as ``a + b r``.

        N stars spread about evenly make N^2 / 2 pairs, which count two ways round and as two
        parities.
        """
        pairs = 2.0 * len(self.table.rows) ** 2 * math.sin(self.sight.angle[b][c])
        return pairs * self.sight.growth[b][c], pairs / self.sight.focal

    def _count(self, triangle: Corners) -> None:
        """Count the pointings that the longest side proposes, once."""
        b, c = sorted(triangle[1:])
        if (b, c) not in self.proposed:
            self.proposed.add((b, c))
            (a0, b0), (a1, b1) = self.trials, self._pointings(b, c)
            self.trials = (a0 + self.ways * a1, b0 + self.ways * b1)

    def _checked(self, triangle: Corners, stars: Ints, error_px: float) -> Iterator[Verdict]:
        guesses = self._with_parity(triangle, stars, error_px)
        if len(guesses) > 3:
            guesses = self._likeliest(triangle, guesses, error_px)
        for numbers, mirrored in guesses:
            verdict = self._check(triangle, numbers, mirrored, 2.5 * error_px)
            if verdict is not None:
                yield verdict

    def _with_parity(
        self, triangle: Corners, stars: Ints, error_px: float
    ) -> list[tuple[Ints, bool]]:
        """The stars with the parity that the triangle's sense means; both where it is flat."""
        (ax, ay), (bx, by), (cx, cy) = (self.places[k] for k in triangle)
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        flat = abs(area) < FLAT * error_px * math.hypot(cx - bx, cy - by)
        out = []
        for numbers, v in zip(stars, self.table.vectors[stars].tolist(), strict=True):
            mirrored = (area > 0.0) != (_volume(*v) > 0.0)
            out.append((numbers, mirrored))
            if flat:
                out.append((numbers, not mirrored))
        return out

    def _focal(self, b: int, c: int, angle: float) -> float:
        """The focal length at which detections b and c are ``angle`` apart, within the range."""
        off = (self.sight.angle[b][c] - angle) / max(self.sight.growth[b][c], 1e-12)
        return self.sight.focal * (1.0 + self.sight.room * min(max(off, -1.0), 1.0))

    def _likeliest(
        self, triangle: Corners, guesses: list[tuple[Ints, bool]], error_px: float
    ) -> list[tuple[Ints, bool]]:
        """Those of many guesses for which most of the other detections have a star nearby."""
        stars = np.array([g[0] for g in guesses])
        mirrored = np.array([g[1] for g in guesses])
        count, (_, b, c) = len(guesses), triangle
        sky = self.table.vectors[stars[:, 1:]]
        gap = sky[:, 0] - sky[:, 1]
        angle = 2.0 * np.arcsin(np.sqrt((gap * gap).sum(axis=1)) / 2.0)
        off = (self.sight.angle[b][c] - angle) / max(self.sight.growth[b][c], 1e-12)
        focal = self.sight.focal * (1.0 + self.sight.room * np.clip(off, -1.0, 1.0))
        detections = np.tile(np.array([b, c, triangle[0]]), (count, 1))
        matrix = pointings(self.xy, detections, sky, focal, mirrored)
        level = np.full(count, self.table.level)
        found = Hypotheses(matrix, focal, mirrored, level, detections, stars)
        votes = support(self.table.volume, self.xy, found, 2.5 * error_px)
        needed = self._needed(error_px) - 1  # the third corner has agreed already
        best = np.argsort(-votes, kind="stable")[:CLOSER]
        return [guesses[k] for k in best if votes[k] >= needed]

    def _needed(self, radius: float) -> int:
        """The fewest witnesses within ``radius`` px that would be believed."""
        for m in range(1, len(self.xy) - 2):
            squares = [radius * radius] * m
            if log10_by_distance(squares, len(self.xy) - 2, self.density, self.trials)[0] < ACCEPT_LOG10:
                return m
        return len(self.xy) - 2

    def _check(
        self, triangle: Corners, stars: Ints, mirrored: bool, reach: float
    ) -> Verdict | None:
        """What the other detections say of the pointing that the longest side proposes."""
        _, b, c = triangle
        p, q = self.table.vectors[stars[1:]].tolist()
        angle = 2.0 * math.asin(math.dist(p, q) / 2.0)
        focal = self._focal(b, c, angle)
        start = Pointing(
            two_stars(self.places[b], self.places[c], focal, mirrored, p, q), focal, mirrored
        )
        wide = (self.corner + reach) / focal
        number = self.table.near(start.matrix[2], 1.0 / math.sqrt(1.0 + wide * wide))
        xy, uv = start.project(self.table.vectors.take(number, axis=0))
        dx, dy = self.xy[:, :1] - xy[:, 0], self.xy[:, 1:] - xy[:, 1]
        d2 = dx * dx + dy * dy
        nearest = d2.argmin(axis=1)
        gap = d2[STEPS[: len(d2)], nearest]
        alarm, radius2 = self._alarm(gap.tolist(), b, c, reach)
        self.least = min(self.least, alarm)
        if alarm > ACCEPT_LOG10:
            return None
        i = (gap <= radius2).nonzero()[0]
        j = nearest[i]
        better = refit(start, self.xy[i], xy[j], uv[j], bend=len(i) >= 10)
        rms = math.sqrt(float(gap[i].mean()))
        return Verdict(better, i, number[j], alarm, rms, self.table.level)

    def _alarm(self, gap: list[float], b: int, c: int, reach: float) -> tuple[float, float]:
        """The bound, log10, and the squared radius that it counts; ``gap`` in px^2."""
        floor = max(gap[b], gap[c], (LEAST * self.side) ** 2)
        near = sorted((d, k) for k, d in enumerate(gap) if d < reach * reach and k not in (b, c))
        taken, squares = [b, c], []
        smallest = (SMALLEST * self.side) ** 2
        places = self.xy.tolist()
        for d, k in near:
            x, y = places[k]
            if all((x - places[t][0]) ** 2 + (y - places[t][1]) ** 2 > smallest for t in taken):
                taken.append(k)
                squares.append(max(d, floor))
        alarm, agree = log10_by_distance(squares, len(gap) - 2, self.density, self.trials)
        return alarm, squares[agree - 1] if agree else 0.0


STEPS = np.arange(WITNESSES)


def _volume(p: list[float], q: list[float], r: list[float]) -> float:
    """The triple product of three vectors: its sign tells their sense, seen from within."""
    return (
        p[0] * (q[1] * r[2] - q[2] * r[1])
        + p[1] * (q[2] * r[0] - q[0] * r[2])
        + p[2] * (q[0] * r[1] - q[1] * r[0])
    )
