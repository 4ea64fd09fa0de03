"""How likely chance alone is to give so good an agreement.

With N catalogue stars on a frame of area A, a detection placed at random falls within r of one of
them with probability p = 1 - exp(-N pi r^2 / A). Of n detections that did not propose the pointing,
m or more agree by chance with the binomial tail P(m; n, p). The answer is then bounded by counting
every way in which the search could have been lucky: the pointings tried, the radii tried, and the
room the refit had (four free numbers, each able to move the stars by ``reach`` in steps of r).
"""

import math

import numpy as np

ACCEPT_LOG10 = -5.0
"""No pointing is believed that chance would give to one frame in so many, or more often."""


def log10_tail(m: int, n: int, p: float) -> float:
    """log10 of P(at least ``m`` of ``n`` successes of probability ``p``)."""
    if m <= 0:
        return 0.0
    if m > n:
        return -math.inf
    if p <= 0.0:
        return -math.inf
    if p >= 1.0:
        return 0.0
    k = np.arange(m, n + 1)
    steps = np.log((n - k[:-1]) / (k[:-1] + 1.0)) if len(k) > 1 else np.zeros(0)
    first = math.lgamma(n + 1) - math.lgamma(m + 1) - math.lgamma(n - m + 1)
    terms = first + np.concatenate([[0.0], np.cumsum(steps)])
    terms = terms + k * math.log(p) + (n - k) * math.log1p(-p)
    top = float(terms.max())
    return min(0.0, (top + math.log(float(np.exp(terms - top).sum()))) / math.log(10.0))


def log10_false_alarm(
    matched: int, detections: int, catalogue: int, radius_px: float, area_px: float,
    *, reach_px: float, radii: int, candidates: int, free: int = 4,
) -> float:  # fmt: skip
    """Bound for one agreement, as above; ``matched`` of ``detections`` exclude the proposers."""
    p = -math.expm1(-catalogue * math.pi * radius_px**2 / area_px)
    room = free * math.log10(max(1.0, reach_px / radius_px))
    tail = log10_tail(matched, detections, p)
    return min(0.0, tail + math.log10(max(1, candidates) * max(1, radii)) + room)


def log10_by_distance(
    distances: list[float], witnesses: int, density: float, tried: tuple[float, float]
) -> tuple[float, int]:
    """Bound for the agreement of few witnesses that no fit was made to, and how many it counts.

    ``distances`` are those (px), ascending, of the witnesses that have a star near, of
    ``witnesses`` in all; ``density`` is in stars a square px. ``tried`` is the number of
    pointings whose proposers agree within r px, as ``a + b r``. That m of n lie within r by chance
    has at most the probability C(n, m) p^m; the distance of the m-th nearest is taken for r, which
    is as likely to be small as this says, so that only the choice of m is to be counted.
    """
    best, agree, ways = 0.0, 0, 1.0
    for m, distance in enumerate(distances, 1):
        ways *= (witnesses - m + 1) / m
        value = math.log10(witnesses * ways * (tried[0] + tried[1] * distance))
        value += m * math.log10(density * math.pi * distance * distance)
        if value < best:
            best, agree = value, m
    return best, agree
