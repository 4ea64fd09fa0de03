"""Finding the stars near a direction in a list sorted by declination zone and right ascension."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
RA_STEPS = 1 << 20  # right ascension in units of about 1.2 arcsec; zones above it in the key


def zones_of(field_deg: float) -> int:
    """How many declination zones serve fields of this size best, at most 4095."""
    return int(min(4095, max(8, round(540.0 / field_deg))))


def zone_keys(vectors: NDArray[np.floating], zones: int) -> NDArray[np.uint32]:
    """Sort keys (N,) of unit vectors (N, 3) for ``zones`` (at most 4095) declination zones."""
    v = np.asarray(vectors, dtype=np.float64)
    dec = np.arcsin(np.clip(v[:, 2], -1.0, 1.0))
    zone = np.clip(((dec / np.pi + 0.5) * zones).astype(np.int64), 0, zones - 1)
    ra = np.arctan2(v[:, 1], v[:, 0]) % (2 * np.pi)
    step = np.minimum((ra * (RA_STEPS / (2 * np.pi))).astype(np.int64), RA_STEPS - 1)
    return np.asarray(zone * RA_STEPS + step, dtype=np.uint32)


def cone_rows(keys: NDArray[np.uint32], zones: int, centre: Floats, radius: float) -> Ints:
    """Rows of a sorted key list that may lie within ``radius`` rad of ``centre`` (3,).

    Whole zones cut to a range of right ascension: a superset of the cone, never less.
    """
    dec = float(np.arcsin(np.clip(centre[2], -1.0, 1.0)))
    height = np.pi / zones
    first = max(0, int((dec - radius + np.pi / 2) / height))
    last = min(zones - 1, int((dec + radius + np.pi / 2) / height))
    zone = np.arange(first, last + 1)
    if abs(dec) + radius >= np.pi / 2 - 1e-6:
        low, high = zone * RA_STEPS, (zone + 1) * RA_STEPS
    else:
        half = float(np.arcsin(min(1.0, np.sin(min(radius, np.pi / 2)) / np.cos(dec))))
        ra = float(np.arctan2(centre[1], centre[0]) % (2 * np.pi))
        a = int(np.floor((ra - half) * (RA_STEPS / (2 * np.pi)))) - 1
        b = int(np.ceil((ra + half) * (RA_STEPS / (2 * np.pi)))) + 1
        if b - a >= RA_STEPS:
            low, high = zone * RA_STEPS, (zone + 1) * RA_STEPS
        else:
            starts = [max(a, 0), a + RA_STEPS if a < 0 else 0]
            ends = [min(b, RA_STEPS), RA_STEPS if a < 0 else max(b - RA_STEPS, 0)]
            low = np.concatenate([zone * RA_STEPS + s for s in starts])
            high = np.concatenate([zone * RA_STEPS + e for e in ends])
    i = np.searchsorted(keys, np.minimum(low, 2**32 - 1).astype(np.uint32))
    j = np.searchsorted(keys, np.minimum(high, 2**32 - 1).astype(np.uint32))
    return ranges(i, np.maximum(j - i, 0))


def ranges(start: NDArray[np.integer], count: NDArray[np.integer]) -> Ints:
    """The integers ``start[k] .. start[k] + count[k] - 1`` of every k, in a row."""
    total = int(count.sum())
    if total == 0:
        return np.zeros(0, dtype=np.int64)
    offset = np.cumsum(count) - count
    first = np.repeat(start.astype(np.int64) - offset.astype(np.int64), count)
    return np.asarray(np.arange(total, dtype=np.int64) + first)
