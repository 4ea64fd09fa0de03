"""A quick look at many supposed pointings at once, before any is verified in full."""

import numpy as np
from numpy.typing import NDArray

from app.identify.hypotheses import Hypotheses, directions
from app.identify.index import Volume
from app.identify.zones import RA_STEPS

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def support(volume: Volume, xy: Floats, found: Hypotheses, reach_px: float) -> Ints:
    """How many of the detections ``xy`` (D, 2), proposers apart, have a star of the level nearby.

    Nearby is a box of half-width ``reach_px``. Stars across RA 0h are missed: it is a quick look.
    """
    h, d = len(found), len(xy)
    p = np.broadcast_to(xy, (h, d, 2)).copy()
    p[found.mirrored, :, 0] *= -1.0
    # transposed product: camera to ICRS
    sky = directions(np.broadcast_to(found.focal[:, None], (h, d)), p) @ found.matrix
    hit = np.zeros((h, d), dtype=bool)
    reach = reach_px / found.focal
    for level in np.unique(found.level):
        rows = np.nonzero(found.level == level)[0]
        hit[rows] = _occupied(volume, int(level), sky[rows], reach[rows, None])
    proposer = (found.detections[:, :, None] == np.arange(d)).any(axis=1)
    return np.asarray((hit & ~proposer).sum(axis=1))


def _occupied(volume: Volume, level: int, sky: Floats, reach: Floats) -> NDArray[np.bool_]:
    """Whether the box around each direction (H, D, 3) holds a star of the level."""
    a, b = int(volume.offsets[level]), int(volume.offsets[level + 1])
    zones = int(volume.zones[level])
    keys = volume.keys[a:b]
    z = np.clip(sky[..., 2], -1.0, 1.0)
    dec = np.arcsin(z)
    ra = np.arctan2(sky[..., 1], sky[..., 0]) % (2 * np.pi) * (RA_STEPS / (2 * np.pi))
    half = reach * (RA_STEPS / (2 * np.pi)) / np.maximum(np.sqrt(1.0 - z * z), 1e-3)
    left = np.maximum(ra - half, 0.0).astype(np.int64)
    right = np.minimum(ra + half, RA_STEPS - 1).astype(np.int64) + 1
    found = np.zeros(z.shape, dtype=bool)
    middle = (dec / np.pi + 0.5) * zones
    reach = reach * (zones / np.pi)
    low = np.maximum(middle - reach, 0.0).astype(np.int64)
    high = np.minimum(middle + reach, zones - 1).astype(np.int64)
    for zone in (low, high):
        i = np.searchsorted(keys, (zone * RA_STEPS + left).astype(np.uint32))
        j = np.searchsorted(keys, (zone * RA_STEPS + right).astype(np.uint32))
        found |= j > i
    return found
