"""Which stars belong together at each size of field.

A frame shows the brightest stars of its field, whatever its size. So there is a list of stars for
each size (a level; sizes grow by sqrt 2): a star is in it when fewer than ``PER_FIELD`` brighter
stars lie in a box of that field's area around it.
"""

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

PER_FIELD = 30
LEVEL_FIELDS_DEG = tuple(float(0.5 * 2.0 ** (k / 2.0)) for k in range(1, 16))  # 0.71 ... 90.5


def select(ra: Floats, dec: Floats, candidates: Ints, field_deg: float) -> Ints:
    """The rows of ``candidates`` (brightest first) that are in the level of ``field_deg``.

    ``ra``, ``dec`` (N,) radians of all stars; ``candidates`` are rows of the next finer level, of
    which every level is a subset: a bigger box holds no fewer brighter stars.
    """
    a, d = ra[candidates], dec[candidates]
    step = np.radians(field_deg) / 3.0
    zones = max(3, round(np.pi / step))
    zone = np.clip(((d / np.pi + 0.5) * zones).astype(np.int64), 0, zones - 1)
    middle = (np.arange(zones) + 0.5) / zones * np.pi - np.pi / 2
    columns = np.maximum(3, np.round(2 * np.pi * np.cos(middle) / step)).astype(np.int64)
    first = np.concatenate([[0], np.cumsum(columns)])
    n = len(candidates)
    rank = np.arange(n, dtype=np.int64)
    turn = a / (2 * np.pi)
    cell = first[zone] + np.minimum((turn * columns[zone]).astype(np.int64), columns[zone] - 1)
    order = np.argsort(cell, kind="stable")
    keys = cell[order] * n + rank[order]
    start = np.searchsorted(cell[order], np.arange(first[-1] + 1))
    brighter = np.zeros(n, dtype=np.int64)
    for dz in (-1, 0, 1):
        z = zone + dz
        inside = (z >= 0) & (z < zones)
        zc = np.clip(z, 0, zones - 1)
        column = np.minimum((turn * columns[zc]).astype(np.int64), columns[zc] - 1)
        for dc in (-1, 0, 1):
            other = first[zc] + (column + dc) % columns[zc]
            # walking in cell order keeps the look-ups in the cache
            found = np.empty(n, dtype=np.int64)
            found[order] = np.searchsorted(keys, (other * n + rank)[order])
            brighter += np.where(inside, found - start[other], 0)
    return candidates[brighter < PER_FIELD]


def all_levels(ra: Floats, dec: Floats) -> list[Ints]:
    """Rows (brightest first) of every level of ``LEVEL_FIELDS_DEG``; stars are given so sorted."""
    rows = np.arange(len(ra), dtype=np.int64)
    out = []
    for field in LEVEL_FIELDS_DEG:
        rows = select(ra, dec, rows, field)
        out.append(rows)
    return out
