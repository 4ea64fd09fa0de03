"""Which rows may lie in a cone: arcs of right ascension in every declination zone it touches."""

import numpy as np
from numpy.typing import NDArray

from app.sky.layout import TURN, ZONES

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]
ZONE_RAD = np.radians(0.5)


def candidates(
    ra: NDArray[np.uint32], zones: NDArray[np.uint32], centre: Floats, radius: float, tiers: range
) -> Rows:
    """Rows of ``tiers`` near the cone, a superset of those in it, ascending.

    ``ra`` (N,) in 1/2**32 turns, ascending within each (tier, zone); ``zones`` the first row of
    each; ``centre`` (3,) unit vector; ``radius`` in radians.
    """
    dec0 = float(np.arctan2(centre[2], np.hypot(centre[0], centre[1])))
    ra0 = float(np.arctan2(centre[1], centre[0]))
    edge = 1e-9  # stored positions are rounded to 1.5e-9 rad
    radius = min(radius + edge, np.pi)
    first = int(np.clip((dec0 - radius + np.pi / 2) / ZONE_RAD, 0, ZONES - 1))
    last = int(np.clip((dec0 + radius + np.pi / 2) / ZONE_RAD, 0, ZONES - 1))
    zone = np.arange(first, last + 1)
    half = _half_widths(zone, dec0, radius)
    cell = (np.asarray(tiers)[:, None] * ZONES + zone).ravel()
    start, stop = zones[cell].astype(np.int64), zones[cell + 1].astype(np.int64)
    low, high, split = _arcs(ra0, np.tile(half, len(tiers)))
    a = _bisect(ra, start, stop, low, right=False)
    b = _bisect(ra, start, stop, high, right=True)
    # An arc across RA 0 is two pieces: the start of the zone up to high, and low to its end.
    begin = np.stack([np.where(split, start, a), a], axis=1)
    end = np.stack([b, np.where(split, stop, a)], axis=1)
    return _spans(begin.ravel(), end.ravel())


def _half_widths(zone: NDArray[np.int64], dec0: float, radius: float) -> Floats:
    """Half the RA extent of the cone within each zone, radians; pi when it holds the pole.

    On a circle of declination d the cone spans cos(h) = (cos r - sin d sin d0) / (cos d cos d0);
    h is largest where sin d = sin d0 / cos r, and falls to both sides of it.
    """
    south = zone * ZONE_RAD - np.pi / 2
    if abs(dec0) + radius >= np.pi / 2 - 1e-9:
        widest = np.copysign(np.pi / 2, dec0) if radius < np.pi / 2 else 0.0
    else:
        widest = np.arcsin(np.sin(dec0) / np.cos(radius))
    dec = np.clip(widest, south, south + ZONE_RAD)
    scale = np.cos(dec) * np.cos(dec0)
    top = np.cos(radius) - np.sin(dec) * np.sin(dec0)
    cosine = np.where(scale > 1e-12, top / np.maximum(scale, 1e-12), -1.0)
    half = np.arccos(np.clip(cosine, -1.0, 1.0))
    if radius >= np.pi / 2:  # rare, and a superset is all that is asked for
        half = np.full(len(zone), np.pi)
    # Beyond the edge of the cone the formula has no solution: those slivers are kept whole-ish.
    return np.where(half >= np.pi, np.pi, half + 1e-9 + 1e-9 / np.maximum(np.cos(dec), 1e-9))


def _arcs(
    ra0: float, half: Floats
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Bounds in stored units, both inclusive, and whether the arc crosses RA 0."""
    whole = half >= np.pi
    unit = TURN / (2 * np.pi)
    low = np.floor((ra0 - half) * unit).astype(np.int64) % 2**32
    high = np.ceil((ra0 + half) * unit).astype(np.int64) % 2**32
    low, high = np.where(whole, 0, low), np.where(whole, 2**32 - 1, high)
    return low, high, low > high


def _bisect(
    ra: NDArray[np.uint32],
    start: NDArray[np.int64],
    stop: NDArray[np.int64],
    value: NDArray[np.int64],
    right: bool,
) -> NDArray[np.int64]:
    """``searchsorted`` in many slices at once: first row >= (or, right, >) its value."""
    low, high = start.copy(), stop.copy()
    last = len(ra) - 1
    for _ in range(int(np.max(stop - start, initial=0)).bit_length()):
        middle = (low + high) >> 1
        here = ra[np.minimum(middle, last)]
        below = (here <= value) if right else (here < value)
        open_ = low < high
        low = np.where(open_ & below, middle + 1, low)
        high = np.where(open_ & ~below, middle, high)
    return low


def _spans(begin: NDArray[np.int64], end: NDArray[np.int64]) -> Rows:
    """All integers of the half-open spans, one after another."""
    length = np.maximum(end - begin, 0)
    offset = np.cumsum(length) - length
    return np.repeat(begin - offset, length) + np.arange(int(length.sum()))
