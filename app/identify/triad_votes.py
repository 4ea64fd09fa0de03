"""From triads to names: groups of like rotation, votes, merged multiples, the last check.

The thesis "Attitude from stellar images", section 2.3.4.3 and its tables 4.2 to 4.4.
"""

import cmath
from bisect import bisect_left, insort

import numpy as np
from numpy.typing import NDArray

from app.identify.pairs import Pairs
from app.identify.triad_search import Found
from app.identify.triad_tests import wrapped

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def grouped(triads: Found, tolerance: float) -> list[Ints]:
    """Triads whose rotation is within ``tolerance`` (rad) of their group's mean; largest first.

    One after the other, as in the thesis; each joins the group with the nearest mean.
    """
    groups: list[list[int]] = []
    total: list[complex] = []
    means: list[tuple[float, int]] = []  # the groups' mean rotations, ascending
    for number, turn in enumerate(wrapped(triads.rotation).tolist()):
        place = bisect_left(means, (turn, -1))
        beside = {(place - 1) % len(means), place % len(means)} if means else set()
        gap, at = min(((abs(_turned(turn - means[k][0])), k) for k in beside), default=(np.inf, -1))
        if gap <= tolerance:
            _, group = means.pop(at)
            groups[group].append(number)
        else:
            group = len(groups)
            groups.append([number])
            total.append(0j)
        total[group] += cmath.rect(1.0, turn)
        insort(means, (cmath.phase(total[group]), group))
    return [np.array(g) for g in sorted(groups, key=len, reverse=True)]


def _turned(angle: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def named(
    triads: Found, group: Ints, detections: int, pairs: Pairs, vote_number: int, merge_rad: float
) -> tuple[Ints, Floats]:
    """The star of ``pairs`` (n,) each detection is taken for, -1 for none, and its extent (n,).

    Possibilities that the camera would see as one star are merged under the brightest's name and
    their votes summed; the extent, radians, is how far the others are from it. A name needs
    ``vote_number`` votes and more than any other.
    """
    out, extent = np.full(detections, -1, dtype=np.int64), np.zeros(detections)
    seen, star = triads.detection[group].ravel(), triads.star[group].ravel()
    for k in np.unique(seen):
        stars, votes = np.unique(star[seen == k], return_counts=True)  # brightest first
        place = pairs.vectors[stars]
        gap = np.linalg.norm(place[:, None] - place[None], axis=2)
        close = gap <= merge_rad
        summed: list[int] = []
        reach: list[float] = []
        free = np.ones(len(stars), dtype=bool)
        for lead in range(len(stars)):
            mine = close[lead] & free if free[lead] else np.zeros(len(stars), dtype=bool)
            summed.append(int(votes[mine].sum()))
            reach.append(float(gap[lead][mine].max(initial=0.0)))
            free &= ~mine
        top = max(summed)
        if top >= vote_number and summed.count(top) == 1:
            out[k], extent[k] = stars[summed.index(top)], reach[summed.index(top)]
    return out, extent


def agreeing(
    stars: Ints, extent: Floats, separation: Floats, pairs: Pairs, tolerance: float
) -> Ints:
    """The same names without those whose separations disagree with the image's, worst first.

    A merged star's image may lie anywhere within its ``extent``, so that is allowed for.
    """
    out = stars.copy()
    while True:
        kept = np.flatnonzero(out >= 0)
        place = pairs.vectors[out[kept]]
        gap = np.linalg.norm(place[:, None] - place[None], axis=2)
        real = 2.0 * np.arcsin(np.minimum(gap / 2.0, 1.0))
        room = tolerance + extent[kept][:, None] + extent[kept][None]
        off = np.abs(real - separation[np.ix_(kept, kept)]) > room
        off |= (gap == 0.0) & ~np.eye(len(kept), dtype=bool)
        wrong = off.sum(axis=1)
        if not len(kept) or wrong.max() == 0:
            return out
        out[kept[wrong.argmax()]] = -1
