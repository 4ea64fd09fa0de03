"""How stars are stored: units of the columns, tiers of magnitude, zones of declination."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

TURN = 2.0**32  # RA and Dec are stored in 1/2**32 of a turn, 0.3 mas
EPOCH = 2000.0
TIER_EDGES_MMAG = (6000, 7500, 9000, 10000, 11000)  # V; a tier below each and one beyond
ZONES = 360  # of half a degree, from the south pole
BV_UNKNOWN = 255
BV_STEP = 0.02
BV_LOWEST = -0.6

# Flags of a deep row.
HIPPARCOS = 1  # it has a row in the bright list
MERGED = 2  # the photocentre of components closer than 1.5"
MOVING = 4  # its proper motion is known
V_FROM_VT = 8  # no colour was known, so V is VT - 0.10
REDATED = 16  # its source gave the position at 1991.65, taken to J2000 here


def zone_of(dec_rad: Floats) -> NDArray[np.int64]:
    """The declination zone (0 to 359, south to north) of declinations (N,) in radians."""
    return np.clip((np.degrees(dec_rad) + 90.0) * 2.0, 0, ZONES - 1).astype(np.int64)


def zone_index(tier: NDArray[np.int64], zone: NDArray[np.int64]) -> NDArray[np.uint32]:
    """Where each (tier, zone) begins among rows sorted so: (tiers * 360 + 1,)."""
    cells = (len(TIER_EDGES_MMAG) + 1) * ZONES
    counts = np.bincount(tier * ZONES + zone, minlength=cells)
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.uint32)


def deep_columns(
    ra_rad: Floats, dec_rad: Floats, pm_mas: Floats, mag: Floats, bv: Floats, flag: NDArray[Any]
) -> tuple[dict[str, NDArray[Any]], NDArray[np.int64]]:
    """Columns of a deep list and the order that sorts the given stars (N,) into it.

    ``pm_mas`` (N, 2) is pmRA*, pmDE in mas/yr; ``bv`` NaN where unknown.
    """
    ra = np.rint(ra_rad / (2 * np.pi) * TURN).astype(np.int64) % 2**32
    dec = np.rint(dec_rad / (2 * np.pi) * TURN).astype(np.int64)
    mmag = np.rint(mag * 1e3).astype(np.int64)
    tier = np.searchsorted(TIER_EDGES_MMAG, mmag, side="right")
    zone = zone_of(np.asarray(dec * (2 * np.pi / TURN), dtype=np.float64))
    order = np.lexsort((dec, ra, zone, tier))
    step = np.rint((np.nan_to_num(bv, nan=0.0) - BV_LOWEST) / BV_STEP)
    colour = np.where(np.isnan(bv), BV_UNKNOWN, np.clip(step, 0, BV_UNKNOWN - 1))
    pm = np.clip(np.rint(pm_mas), -32767, 32767)
    columns = {
        "zones": zone_index(tier, zone),
        "ra": ra[order].astype("<u4"),
        "dec": dec[order].astype("<i4"),
        "pm_ra": pm[order, 0].astype("<i2"),
        "pm_dec": pm[order, 1].astype("<i2"),
        "mag": mmag[order].astype("<i2"),
        "bv": colour[order].astype("u1"),
        "flag": np.asarray(flag)[order].astype("u1"),
    }
    return columns, order
