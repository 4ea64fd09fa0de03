"""Gaia's tables as CSV (plain or gzip), as its archive gives them."""

import csv
import gzip
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from app.core.errors import CatalogueError
from app.core.progress import Progress, Task
from app.sky.importing.stars import ForeignStars, v_of_gaia

NEEDED = ("ra", "dec", "phot_g_mean_mag")
COLUMNS = (*NEEDED, "pmra", "pmdec", "bp_rp", "ref_epoch")
DR3_EPOCH = 2016.0
STEP = 50_000


def read_gaia(path: Path) -> Task[ForeignStars]:
    """The stars of a Gaia CSV; rows without place or magnitude are passed over.

    Columns are found by name: ra, dec, phot_g_mean_mag, and when there pmra, pmdec, bp_rp,
    ref_epoch (else 2016.0, that of DR3).
    """
    blocks = []
    try:
        for i, block in enumerate(_blocks(path)):
            yield Progress("Reading the catalogue", None, f"{i * STEP:,} stars")
            blocks.append(block)
    except (OSError, EOFError, UnicodeDecodeError, csv.Error) as error:
        raise CatalogueError(f"{path.name} cannot be read as CSV ({error}).") from error
    if not blocks:
        raise CatalogueError(f"{path.name} holds no stars.")
    ra, dec, g, pm_ra, pm_dec, colour, epoch = np.concatenate(blocks, axis=1)
    good = np.isfinite(ra) & np.isfinite(dec) & np.isfinite(g) & (np.abs(dec) <= 90.0)
    epochs = np.unique(epoch[good & np.isfinite(epoch)])
    if len(epochs) > 1:
        raise CatalogueError(f"{path.name} mixes epochs {epochs[0]:g} and {epochs[-1]:g}.")
    v, bv = v_of_gaia(g, colour)
    pm = np.stack([pm_ra, pm_dec], axis=1)
    at = float(epochs[0]) if len(epochs) else DR3_EPOCH
    return ForeignStars(ra[good] % 360.0, dec[good], v[good], bv[good], pm[good], at, "Gaia CSV")


def _blocks(path: Path) -> Iterator["np.ndarray[tuple[int, ...], np.dtype[np.float64]]"]:
    opener = gzip.open if path.suffix == ".gz" else open
    with opener(path, "rt", encoding="utf-8", newline="") as file:
        rows = csv.reader(line for line in file if not line.startswith("#"))
        head = [name.strip().lower() for name in next(rows, [])]
        lacking = [name for name in NEEDED if name not in head]
        if lacking:
            raise CatalogueError(f"{path.name} lacks the column {lacking[0]}.")
        at = [head.index(name) if name in head else None for name in COLUMNS]
        block: list[list[float]] = []
        for row in rows:
            block.append([_number(row, i) for i in at])
            if len(block) == STEP:
                yield np.array(block).T
                block = []
        if block:
            yield np.array(block).T


def _number(row: list[str], at: int | None) -> float:
    if at is None or at >= len(row):
        return float("nan")
    try:
        return float(row[at])
    except ValueError:  # empty, "null", "--"
        return float("nan")
