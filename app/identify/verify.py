"""Whether a supposed pointing holds for the other stars of the frame."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.attitude.wahba import small_rotation
from app.identify.chance import log10_false_alarm
from app.identify.hypotheses import View
from app.identify.index import Volume

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FEWEST = 6  # four stars propose, at least two more must agree
LOG10_2 = 0.30103  # two ways of judging, the better counts
RADII = 8  # agreement is judged at so many radii, each sqrt 2 apart, the best counts


@dataclass(slots=True, eq=False)
class Pointing:
    """A pointing while it is being improved: ``matrix`` ICRS to camera, focal length in px, k1."""

    matrix: Floats
    focal: float
    mirrored: bool
    k1: float = 0.0

    def project(self, sky: Floats) -> tuple[Floats, Floats]:
        """Pixels (N, 2) from the frame's middle, and tangent-plane points (N, 2)."""
        c = sky @ self.matrix.T
        uv = c[:, :2] / np.maximum(c[:, 2:], 1e-3)
        r2 = (uv * uv).sum(axis=1, keepdims=True)
        # beyond the turning point of a barrel lens the polynomial folds back: keep it monotonic
        bend = np.maximum(1.0 + self.k1 * r2, 0.6)
        xy = self.focal * uv * bend
        xy[c[:, 2] <= 0.05] = 1e9
        if self.mirrored:
            xy[:, 0] = -xy[:, 0]
        return xy, uv


@dataclass(frozen=True, slots=True, eq=False)
class Verdict:
    """What verification found: matched detections and stars (M,), and how likely chance is."""

    pointing: Pointing
    detections: Ints
    stars: Ints
    log10_tail: float
    rms_px: float
    level: int


def pair(seen: Floats, expected: Floats, radius: float) -> tuple[Ints, Ints, Floats]:
    """Mutual nearest pairs within ``radius``: indices into both lists and the distances squared."""
    if len(seen) == 0 or len(expected) == 0:
        none = np.zeros(0, dtype=np.int64)
        return none, none, np.zeros(0)
    dx = seen[:, 0, None] - expected[None, :, 0]
    dy = seen[:, 1, None] - expected[None, :, 1]
    d2 = dx * dx + dy * dy
    j = d2.argmin(axis=1)
    i = np.arange(len(seen))
    best = d2[i, j]
    good = (best < radius * radius) & (d2.argmin(axis=0)[j] == i)
    return i[good], j[good], best[good]


def refit(pointing: Pointing, seen: Floats, xy: Floats, uv: Floats, bend: bool) -> Pointing:
    """One Gauss-Newton step on rotation, focal length and, when asked, radial distortion.

    ``seen`` (N, 2) px; ``xy`` and ``uv`` (N, 2) are what the pointing makes of the same stars.
    """
    u, v = uv[:, 0], uv[:, 1]
    off = ((seen - xy) / pointing.focal).T.copy()
    if pointing.mirrored:
        off[0] = -off[0]
    one = np.empty((5 if bend else 4, 2, len(u)))  # derivatives of u and of v
    uu, uv_, vv = u * u, u * v, v * v
    one[0, 0], one[0, 1] = -uv_, -1.0 - vv
    one[1, 0], one[1, 1] = 1.0 + uu, uv_
    one[2, 0], one[2, 1] = -v, u
    one[3, 0], one[3, 1] = u, v
    if bend:
        np.multiply(one[3], uu + vv, out=one[4])
    flat = one.reshape(len(one), -1)
    normal = flat @ flat.T
    normal.flat[:: len(one) + 1] *= 1.0 + 1e-9
    try:
        step = np.linalg.solve(normal, flat @ off.ravel()).tolist()
    except np.linalg.LinAlgError:
        return pointing
    turn = small_rotation(np.array([_within(s, 0.2) for s in step[:3]]))
    k1 = _within(pointing.k1 + step[4], 0.6) if bend else pointing.k1
    focal = pointing.focal * math.exp(_within(step[3], 0.2))
    return Pointing(turn @ pointing.matrix, focal, pointing.mirrored, k1)


def _within(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)


def verify(
    volume: Volume,
    level: int,
    view: View,
    start: Pointing,
    proposers: Ints,
    proposing_stars: Ints,
    reach_px: float,
    use: int,
    enough: float,
) -> Verdict | None:
    """Check one pointing against the brightest ``use`` detections; None when hopeless.

    ``proposers`` (4,) are the detections that suggested it and ``proposing_stars`` (4,) the stars
    they would be: they are matched and refitted like the
    others but do not count as evidence. ``reach_px`` is the first, widest radius;
    evidence below ``enough`` (log10) needs no second way of judging.
    """
    seen = view.xy[:use]
    corner = float(np.hypot(*view.half)) + reach_px
    radius = float(np.arctan(corner * 1.05 / start.focal))
    number = volume.near(level, start.matrix[2], min(radius, 1.4))
    sky = volume.stars[number].astype(np.float64)
    near = (np.abs(start.project(sky)[0]) < view.half + 3 * reach_px).all(axis=1)
    sky, number = sky[near], number[near]
    pointing = improve(start, seen, sky, reach_px, 5)
    if pointing is None:
        return None
    evidence = np.ones(len(seen), dtype=bool)
    evidence[proposers[proposers < len(seen)]] = False
    tail, radius, (i, j, d2) = _tail(view, pointing, seen, sky, evidence, reach_px, free=4)
    agree = d2 < radius * radius
    i, j, d2 = i[agree], j[agree], d2[agree]
    if len(i) < FEWEST:
        return None
    if tail > enough:
        four = start
        for _ in range(2):
            at = four.project(volume.stars[proposing_stars].astype(np.float64))
            four = refit(four, view.xy[proposers], *at, bend=False)
        tail = min(tail, _tail(view, four, seen, sky, evidence, reach_px, free=0)[0])
    rms = float(np.sqrt(d2.mean()))
    return Verdict(pointing, i, number[j], min(0.0, tail + LOG10_2), rms, level)


def improve(
    pointing: Pointing, seen: Floats, sky: Floats, radius: float, steps: int
) -> Pointing | None:
    """Pair and refit ``steps`` times, the radius shrinking with the residuals; None: it failed."""
    last = 0
    for step in range(steps):
        xy, uv = pointing.project(sky)
        i, j, d2 = pair(seen, xy, radius)
        if len(i) < (5 if step else FEWEST):
            return None
        pointing = refit(pointing, seen[i], xy[j], uv[j], bend=len(i) >= 10)
        if step:
            middle = float(np.partition(d2, len(d2) // 2)[len(d2) // 2])
            closer = max(0.5 * radius, min(radius, 3.0 * middle**0.5))
            if closer > 0.95 * radius and len(i) == last:
                break  # nothing would change any more
            radius = closer
        last = len(i)
    return pointing


def _tail(
    view: View, pointing: Pointing, seen: Floats, sky: Floats, evidence: NDArray[np.bool_],
    reach_px: float, free: int,
) -> tuple[float, float, tuple[Ints, Ints, Floats]]:  # fmt: skip
    """The least likely agreement over all radii, log10 for one candidate, and its radius in px.

    And the pairs within the widest radius, as :func:`pair` gives them.
    ``free`` is how many numbers of the pointing were fitted to the evidence itself: none when only
    the proposers were used.
    """
    xy, _ = pointing.project(sky)
    inside = int((np.abs(xy) < view.half).all(axis=1).sum())
    pairs = pair(seen, xy, reach_px)
    d2 = pairs[2][evidence[pairs[0]]]
    area = float(4.0 * view.half[0] * view.half[1])
    radii = reach_px / np.sqrt(2.0) ** np.arange(RADII)
    matched = np.searchsorted(np.sort(d2), radii**2)
    best, radius, last = 0.0, 0.0, -1
    for m, r in zip(matched[::-1].tolist(), radii[::-1].tolist(), strict=True):
        if m == last or m == 0:
            continue  # the same agreement within a smaller radius is the less likely one
        last = m
        value = log10_false_alarm(
            m, int(evidence.sum()), inside, r, area,
            reach_px=reach_px, radii=RADII, candidates=1, free=free,
        )  # fmt: skip
        if value < best:
            best, radius = value, r
    return best, radius, pairs
