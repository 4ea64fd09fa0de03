"""The finished list against one that came by another way: 42,212 Hipparcos stars at 2024.0."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.sky.catalogue import Catalogue
from app.sky.container import Container
from app.sky.making.epochs import ARCSEC, LIST_EPOCH, POLE_SIN
from app.sky.making.sources import Listed

WRONG = 2.0  # arcsec: beyond this a position is of no use for matching


def compare(deep: Path, listed: Listed) -> dict[str, float]:
    """Distances in arcsec between both lists at 2024.0; of a multiple star, the nearest part.

    Stars within 5 deg of a pole are left out: there the independent list lacks proper motion.
    """
    catalogue = Catalogue(deep)
    bright = Container(deep.with_name("bright.kcat"))
    rows, linked = (catalogue.container.column(k) for k in ("link_deep", "link_bright"))
    hip = bright.column("hip")[linked].astype(np.int64)
    single = (bright.column("component")[linked] == 0) & (np.bincount(hip)[hip] == 1)
    order = np.argsort(listed.hip)
    at = np.minimum(np.searchsorted(listed.hip[order], hip), len(order) - 1)
    place, found = listed.vector[order][at], listed.hip[order][at] == hip
    gap = np.linalg.norm(catalogue.vectors(rows, LIST_EPOCH) - place, axis=1) / ARCSEC
    use = found & (np.abs(place[:, 2]) < POLE_SIN)
    use[use] = _first(hip[use], gap[use])
    result: dict[str, float] = {
        "listed": len(order),
        "found": len(np.unique(hip[found])),
    }
    for name, mask in (("", use & single), (" of multiple stars", use & ~single)):
        cut = np.percentile(gap[mask], [50, 90, 99, 99.9]) if mask.any() else [np.nan] * 4
        result["compared" + name] = int(mask.sum())
        for label, value in zip(("median", "90 %", "99 %", "99.9 %"), cut, strict=True):
            result[f"{label} arcsec{name}"] = round(float(value), 4)
        result[f"farther than 2 arcsec{name}"] = int((gap[mask] > WRONG).sum())
        result[f"largest arcsec{name}"] = round(float(gap[mask].max(initial=0.0)), 2)
    return result


def _first(key: NDArray[np.int64], value: NDArray[np.float64]) -> NDArray[np.bool_]:
    """For each key its smallest value: a mask (N,)."""
    order = np.lexsort((value, key))
    mask = np.zeros(len(key), dtype=np.bool_)
    mask[order[np.diff(key[order], prepend=-1) > 0]] = True
    return mask
