"""A foreign catalogue and the shipped one together, as one that can be opened."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from app.core.attitude import unit_vectors
from app.core.errors import CatalogueError
from app.core.progress import Progress, Task
from app.sky import layout
from app.sky.catalogue import Catalogue, open_catalogue
from app.sky.importing.stars import ForeignStars
from app.sky.making.build import sha256, write_deep
from app.sky.making.epochs import ARCSEC, moved
from app.sky.making.merge import Stars

SAME = 3.0  # arcsec within which both mean one star, the foreign epoch applied
COMPLETE = 9.0  # to this V the shipped list has every star, and foreign ones have the odd ghost
UNKNOWN_EPOCH = 2016.0
MOST = 40_000_000  # stars; more would need several GB of memory to sort


def combine(
    foreign: ForeignStars, folder: Path, epoch: float | None = None, mag_limit: float | None = None
) -> Task[dict[str, Any]]:
    """Write the shipped stars and the foreign ones that it lacks into ``folder``; the manifest.

    The shipped star wins, as it has names, motion and the bright end; foreign stars of V 9 and
    brighter are left out altogether. ``epoch`` is used when the foreign files state none.
    """
    at = foreign.epoch or epoch or UNKNOWN_EPOCH
    keep = np.isfinite(foreign.mag) & (foreign.mag > COMPLETE)
    if mag_limit is not None:
        keep &= foreign.mag <= mag_limit
    if keep.sum() > MOST:
        raise CatalogueError(
            f"{int(keep.sum()):,} stars are too many to import; keep the brighter with --mag-limit."
        )
    shipped = open_catalogue()
    rows = np.arange(len(shipped))
    place = unit_vectors(foreign.ra_deg[keep], foreign.dec_deg[keep])
    yield Progress("Looking for stars that are there already", 0.65)
    new = _absent(shipped, place, at)
    pm = np.nan_to_num(foreign.pm_mas[keep][new])
    yield Progress("Joining the catalogues", 0.75)
    flag = np.where(np.isfinite(foreign.pm_mas[keep][new, 0]), layout.MOVING, 0)
    old = Stars(
        shipped.vectors(rows), shipped.motions(rows), shipped.mag(rows), shipped.bv(rows),
        np.zeros(len(rows), np.int64), shipped.flags(rows),
    )  # fmt: skip
    added = Stars(
        moved(place[new], pm, layout.EPOCH - at), pm, foreign.mag[keep][new],
        foreign.bv[keep][new], np.zeros(int(new.sum()), np.int64), flag.astype(np.uint8),
    )  # fmt: skip
    column = shipped.container.column
    link = np.stack([column("link_deep"), column("link_bright")], axis=1).astype(np.int64)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CatalogueError(f"{folder} cannot be made: {error.strerror or error}.") from None
    yield Progress("Writing the catalogue", 0.85)
    write_deep(folder / "deep.kcat", Stars.joined(old, added), link)
    return _manifest(folder, foreign, at, int(keep.sum()), len(added))


def _absent(shipped: Catalogue, place: "np.ndarray[Any, Any]", year: float) -> Any:
    """Which of ``place`` (N, 3) no shipped star stands at, in ``year``."""
    from scipy.spatial import cKDTree

    tree = cKDTree(shipped.vectors(np.arange(len(shipped)), year))
    distance, _ = tree.query(place, distance_upper_bound=SAME * ARCSEC)
    return ~np.isfinite(distance)


def _manifest(
    folder: Path, foreign: ForeignStars, epoch: float, read: int, added: int
) -> dict[str, Any]:
    deep = folder / "deep.kcat"
    manifest: dict[str, Any] = {
        "counts": {"stars read": read, "stars added to the shipped ones": added},
        "files": {"deep.kcat": {"bytes": deep.stat().st_size, "sha256": sha256(deep)}},
        "imported_from": foreign.source,
        "imported_epoch": epoch,
    }
    text = json.dumps(manifest, indent=1, sort_keys=True) + "\n"
    (folder / "manifest.json").write_text(text, "utf-8", newline="\n")
    return manifest
