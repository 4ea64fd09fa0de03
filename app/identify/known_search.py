"""The default method's quick road where the camera is known: triangles of the brightest detections.

With the scale known to a few parts in a hundred, two stars propose a pointing and every other
detection bears witness. So few are needed that three can be enough, when their places are good. The
false-alarm bound counts every pair of catalogue stars that any two proposers could have been.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.identify.chance import log10_by_distance
from app.identify.hypotheses import Hypotheses, directions, triad
from app.identify.known_table import PairTable
from app.identify.known_triangles import Guesses, Sight, guess, triangles, turned
from app.identify.support import support
from app.identify.verify import Pointing, Verdict, pair, refit

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

BRIGHTEST = 8
"""Detections whose triangles are asked about."""
WITNESSES = 40
FIRST, LOOSE = 1.2e-3, 6e-3
"""Errors of a side that are allowed, over the frame's larger side: at first, and if need be."""
SMALLEST = 0.02
"""Triangles with a smaller side, and witnesses as near to another, over the frame's larger side."""
CLOSER = 8
"""So many guesses get the closer look."""
ACCEPT_LOG10 = -5.0
LEAST = 1e-5
"""Agreement closer than this, over the larger side, is worth no more."""


@dataclass(frozen=True, slots=True, eq=False)
class Trials:
    """Which sides proposed, and how many pointings that made: ``per`` (2, n, n), see `add`."""

    per: Floats
    asked: NDArray[np.bool_]

    @classmethod
    def of(cls, sight: Sight, stars: int) -> "Trials":
        """For N ``stars`` about evenly spread: N^2 / 2 pairs, two ways round, two parities."""
        pairs = 2.0 * stars * stars * np.sin(sight.angle)
        return cls(
            np.stack([pairs * np.abs(sight.growth), pairs / sight.focal]),
            np.zeros(sight.angle.shape, dtype=bool),
        )

    def add(self, corners: Ints) -> None:
        """Count the longest sides of triangles (T, 3), the last two corners."""
        self.asked[corners[:, 1], corners[:, 2]] = True
        self.asked[corners[:, 2], corners[:, 1]] = True

    def count(self) -> tuple[float, float]:
        """How many pointings there were whose proposers agree within r px, as ``a + b r``."""
        a, b = self.per[:, self.asked].sum(axis=1).tolist()
        return 0.5 * a, 0.5 * b


class KnownSearch:
    """One frame's triangles in one table.

    ``xy`` (N, 2) px from the frame's middle, brightest first; ``half`` (2,) half its width and
    height; ``scale`` the focal lengths allowed, px.
    """

    def __init__(
        self, table: PairTable, xy: Floats, half: Floats, scale: tuple[float, float]
    ) -> None:
        self.table, self.half = table, half
        self.xy = xy[:WITNESSES]
        self.side = 2.0 * float(half.max())
        self.single = self._single()
        self.alone = np.flatnonzero(self.single)
        self.sight = Sight.of(self.xy[self.alone[:BRIGHTEST]], scale)
        self.trials = Trials.of(self.sight, len(table.rows))
        self.density = self._density()
        self.least = 0.0

    @property
    def complete(self) -> bool:
        """Whether all detections form triangles, so that no other way would find more."""
        return len(self.alone) <= BRIGHTEST

    @property
    def tried(self) -> int:
        """Pointings until now."""
        a, b = self.trials.count()
        return int(a + b * FIRST * self.side)

    def verdicts(self) -> Iterator[Verdict]:
        """Every answer that chance cannot explain, in the order found."""
        corners = self._corners()
        for error_px in self._errors():
            for batch in corners:
                if len(batch) == 0:
                    continue
                self.trials.add(batch)
                found = guess(self.table, self.sight, batch, error_px / self.sight.focal)
                if len(found):
                    yield from self._checked(found, error_px)

    def _single(self) -> NDArray[np.bool_]:
        """Detections (N,) that have no brighter one close by: the others would say it again."""
        x, y = self.xy.T
        dx, dy = x[:, None] - x, y[:, None] - y
        close = dx * dx + dy * dy < (SMALLEST * self.side) ** 2
        return np.asarray(np.tril(close, -1).sum(axis=1) == 0)

    def _density(self) -> float:
        """The table's stars a square px."""
        per_sr = len(self.table.rows) / (4.0 * np.pi)
        return float(per_sr / self.sight.focal**2)

    def _corners(self) -> list[Ints]:
        """The triangles to ask about, those of the four brightest first, then with one more."""
        corners = triangles(len(self.sight.xy))
        corners = turned(corners, self.sight.angle)
        side = self.sight.angle[corners[:, [0, 0, 1]], corners[:, [1, 2, 2]]]
        smallest = SMALLEST * self.side / self.sight.focal
        good = (side[:, 0] > smallest) & (side[:, 1] < self.table.reach_rad)
        last = np.array([4, 10, 20, 35, 56])
        return [c[g] for c, g in zip(np.split(corners, last), np.split(good, last), strict=True)]

    def _errors(self) -> list[float]:
        """Errors of a side, px, to allow in turn: none at which nobody would be believed."""
        most = self._believable_px()
        first, loose = min(FIRST * self.side, most), min(LOOSE * self.side, most)
        return [first] if loose < 1.5 * first or not self.complete else [first, loose]

    def _believable_px(self) -> float:
        """The largest error at which the agreement of all would still be an answer."""
        n = len(self.alone)
        radii = np.geomspace(1e-5, LOOSE, 12) * self.side
        others = self.trials.per[:, *np.triu_indices(len(self.sight.xy), 1)].sum(axis=1)
        chance = np.minimum(self.density * np.pi * radii**2, 1.0)
        value = (n - 2) * np.log10(chance) + np.log10((n - 2) * (others[0] + others[1] * radii))
        fine = radii[value < ACCEPT_LOG10]
        return 2.0 * float(fine[-1]) if len(fine) else 0.0

    def _checked(self, found: Guesses, error_px: float) -> Iterator[Verdict]:
        hypotheses = self._pointings(found)
        order = range(len(found))
        reach = 2.5 * error_px
        if len(found) > 2:
            votes = support(self.table.volume, self.xy, hypotheses, reach)
            order = np.argsort(-votes, kind="stable")[:CLOSER].tolist()
        for h in order:
            verdict = self._check(hypotheses, h, reach)
            if verdict is not None:
                yield verdict

    def _pointings(self, found: Guesses) -> Hypotheses:
        """The pointings at which the longest sides, to the last two corners, lie where seen."""
        b, c = found.detections[:, 1], found.detections[:, 2]
        sky = self.table.vectors[found.stars[:, 1:]]
        gap = sky[:, 0] - sky[:, 1]
        angle = 2.0 * np.arcsin(np.sqrt((gap * gap).sum(axis=1)) / 2.0)
        growth = np.minimum(self.sight.growth[b, c], -1e-12)
        share = np.clip((angle - self.sight.angle[b, c]) / growth, -1.0, 1.0)
        focal = self.sight.focal * (1.0 + self.sight.room * share)
        p = self.sight.xy[found.detections[:, 1:]]
        p[found.mirrored, :, 0] *= -1.0
        seen = directions(np.broadcast_to(focal[:, None], p.shape[:2]), p)
        matrix = triad(seen[:, 0], seen[:, 1]) @ triad(sky[:, 0], sky[:, 1]).transpose(0, 2, 1)
        level = np.full(len(found), self.table.level)
        detections = self.alone[found.detections]
        return Hypotheses(matrix, focal, found.mirrored, level, detections, found.stars)

    def _check(self, found: Hypotheses, h: int, reach: float) -> Verdict | None:
        start = Pointing(found.matrix[h], float(found.focal[h]), bool(found.mirrored[h]))
        corner = float(np.hypot(*self.half)) + reach
        number = self.table.near(start.matrix[2], float(np.cos(np.arctan(corner / start.focal))))
        sky = self.table.vectors[number]
        xy, uv = start.project(sky)
        i, j, d2 = pair(self.xy, xy, reach)
        proposer = (i == found.detections[h, 1]) | (i == found.detections[h, 2])
        off = d2[proposer]
        if len(off) < 2:
            return None
        floor = max(float(off.max()), (LEAST * self.side) ** 2)
        squares = np.maximum(np.sort(d2[self.single[i] & ~proposer]), floor)
        alarm, agree = log10_by_distance(
            squares, len(self.alone) - 2, self.density, self.trials.count()
        )
        self.least = min(self.least, alarm)
        if alarm > ACCEPT_LOG10:
            return None
        kept = d2 <= squares[agree - 1]
        i, j = i[kept], j[kept]
        better = refit(start, self.xy[i], xy[j], uv[j], bend=len(i) >= 10)
        return Verdict(better, i, number[j], alarm, float(np.sqrt(d2[kept].mean())), self.table.level)
