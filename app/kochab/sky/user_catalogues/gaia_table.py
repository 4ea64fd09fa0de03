"""Gaia tables as its archive gives them: CSV, FITS or VOTable, plain or gzip.

Text cannot be searched where it lies, so places, motions and magnitudes are sorted once into a file of 16 bytes a star
in the user's cache, which is mapped from then on.
"""

import csv
import gzip
import hashlib
import warnings
import zlib
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import unit_vectors
from kochab.core.errors import CatalogueError
from kochab.core.progress import Progress, Task
from kochab.core.values import frozen
from kochab.folders import cache_folder
from kochab.sky.catalogue import Catalogue
from kochab.sky.catalogue_file import EPOCH, MOVING, StarList, write_deep
from kochab.sky.proper_motion import moved
from kochab.sky.user_catalogues.fits_tables import map_tables
from kochab.sky.user_catalogues.star_cone import Cone, Reach, StarCone


@frozen(eq=False)
class ForeignStars:
    """Stars at ``epoch``, V or nearly; ``epoch`` None when the files do not say."""

    stars: StarList
    epoch: float | None
    source: str


def v_of_gaia(g: Floats, bp_rp: Floats) -> tuple[Floats, Floats]:
    """V and B-V of Gaia's G and BP-RP; where the colour is unknown V = G + 0.2 and B-V is NaN.

    Polynomials of the Gaia EDR3 documentation, table 5.7, for -0.5 < BP-RP < 4 (the colour is
    held to where they were fitted); 0.2 is the mean of V - G over stars of the field.
    """
    x = np.clip(bp_rp, -0.5, 4.0)
    v = g + 0.02704 - 0.01424 * x + 0.2156 * x**2 - 0.01426 * x**3
    b = g - 0.01448 + 0.6874 * x + 0.3604 * x**2 - 0.06718 * x**3 + 0.006061 * x**4
    return np.where(np.isnan(x), g + 0.2, v), np.where(np.isnan(x), np.nan, b - v)


NEEDED = ("ra", "dec", "phot_g_mean_mag")
COLUMNS = (*NEEDED, "pmra", "pmdec", "bp_rp", "ref_epoch")
DR3_EPOCH = 2016.0
STEP = 50_000
CSV, FITS, VOTABLE = (".csv", ".ecsv"), (".fits", ".fit"), (".vot", ".votable", ".xml")
LARGEST_BYTES = 8_000_000_000


def _kind(path: Path) -> str:
    """The last part of its name, without ``.gz``."""
    name = path.name.lower().removesuffix(".gz")
    return Path(name).suffix


def is_table(path: Path) -> bool:
    """Whether ``path`` is named as a table of stars: a FITS file only when it has the columns."""
    kind = _kind(path)
    if kind not in FITS:
        return kind in CSV + VOTABLE
    try:
        return path.suffix.lower() != ".gz" and map_tables(path).named("phot_g_mean_mag") is not None
    except CatalogueError:
        return False


def read_gaia(path: Path) -> Task[ForeignStars]:
    """The stars of a Gaia table; rows without place or magnitude are passed over.

    Columns are found by name: ra, dec, phot_g_mean_mag, and when there pmra, pmdec, bp_rp,
    ref_epoch (else 2016.0, that of DR3).
    """
    blocks = []
    try:
        for i, block in enumerate(_blocks(path)):
            yield Progress("Reading the catalogue", None, f"{i * STEP:,} stars")
            blocks.append(block)
    except (OSError, EOFError, zlib.error, UnicodeDecodeError, csv.Error) as error:
        raise CatalogueError("{name} cannot be read as a table ({error}).", name=path.name, error=error) from error
    if not blocks:
        raise CatalogueError("{name} holds no stars.", name=path.name)
    table = np.concatenate(blocks, axis=1)
    ra, dec, g, pm_ra, pm_dec, colour, epoch = table[:, np.isfinite(table[:3]).all(axis=0) & (np.abs(table[1]) <= 90.0)]
    epochs = np.unique(epoch[np.isfinite(epoch)])
    if len(epochs) > 1:
        raise CatalogueError(
            "{name} mixes epochs {epochs:g} and {epochs2:g}.", name=path.name, epochs=epochs[0], epochs2=epochs[-1]
        )
    v, bv = v_of_gaia(g, colour)
    pm = np.nan_to_num(np.stack([pm_ra, pm_dec], axis=1))
    flag = np.where(np.isfinite(pm_ra), MOVING, 0).astype(np.uint8)
    stars = StarList.of(unit_vectors(ra % 360.0, dec), v, bv=bv, pm=pm, flag=flag)
    return ForeignStars(stars, float(epochs[0]) if len(epochs) else DR3_EPOCH, "Gaia table")


def _blocks(path: Path) -> Iterator[Floats]:
    """The columns (7, N) of a table, some rows at a time."""
    kind = _kind(path)
    if kind in FITS:
        yield from _fits_blocks(path)
    elif kind in VOTABLE:
        yield _votable(path)
    else:
        yield from _csv_blocks(path)


def _csv_blocks(path: Path) -> Iterator[Floats]:
    opener = gzip.open if path.suffix == ".gz" else open
    with opener(path, "rt", encoding="utf-8-sig", newline="") as file:
        rows = csv.reader(line for line in file if not line.startswith("#"))
        head = [name.strip().lower() for name in next(rows, [])]
        lacking = [name for name in NEEDED if name not in head]
        if lacking:
            raise CatalogueError("{name} lacks the column {lacking}.", name=path.name, lacking=lacking[0])
        at = [head.index(name) if name in head else None for name in COLUMNS]
        numbers = ([_number(row, i) for i in at] for row in rows)
        while block := [*islice(numbers, STEP)]:
            yield np.array(block).T


def _number(row: list[str], at: int | None) -> float:
    if at is None or at >= len(row):
        return float("nan")
    try:
        return float(row[at])
    except ValueError:  # empty, "null", "--"
        return float("nan")


def _fits_blocks(path: Path) -> Iterator[Floats]:
    table = map_tables(path).named(NEEDED[0])
    if table is None:
        raise CatalogueError("{name} lacks the column {lacking}.", name=path.name, lacking=NEEDED[0])
    at = _places(table.names, path)
    for begin in range(0, len(table.data), STEP):
        rows = table.data[begin : begin + STEP]
        yield np.stack([_plain(rows[i]) if i else np.full(len(rows), np.nan) for i in at])


def _votable(path: Path) -> Floats:
    from astropy.io.votable import parse_single_table

    try:
        with warnings.catch_warnings(action="ignore"):
            table = parse_single_table(str(path)).array
    except Exception as error:  # a damaged one fails in astropy in a dozen ways
        why = " ".join(str(error).split())[:200]
        raise CatalogueError("{name} cannot be read as a table ({error}).", name=path.name, error=why) from error
    at = _places(table.dtype.names or (), path)
    return np.stack([_plain(np.ma.filled(table[i], np.nan)) if i else np.full(len(table), np.nan) for i in at])


def _places(names: tuple[str, ...], path: Path) -> list[str | None]:
    """What the table calls each of ``COLUMNS``, None where it lacks one."""
    known = {name.strip().lower(): name for name in names}
    lacking = [name for name in NEEDED if name not in known]
    if lacking:
        raise CatalogueError("{name} lacks the column {lacking}.", name=path.name, lacking=lacking[0])
    return [known.get(name) for name in COLUMNS]


def _plain(column: np.ndarray[tuple[int], np.dtype[np.floating]]) -> Floats:
    return np.asarray(column, dtype=np.float64)


# -- One table as a catalogue to search -----------------------------------------------------------


class GaiaTable:
    """A table that was sorted before; see :func:`sort_table`."""

    kind = "Gaia"

    def __init__(self, path: Path) -> None:
        self.path, self.name = path, path.name
        if not path.is_file():
            raise CatalogueError("{path} does not exist.", path=path)
        sorted_file = _sorted_file(path)
        if not sorted_file.exists():
            raise CatalogueError(
                "{name} is new or has changed: run kochab catalog use {path}.", name=self.name, path=path
            )
        self._stars = Catalogue(sorted_file)

    def cone(self, cone: Cone) -> StarCone:
        """The stars of a cone."""
        rows = self._stars.cone(cone.axis, cone.radius_rad, cone.mag_limit, cone.year)
        x, y, z = self._stars.vectors(rows, cone.year).T
        return StarCone(np.arctan2(y, x) % (2 * np.pi), np.arctan2(z, np.hypot(x, y)), self._stars.mag(rows))

    def reach(self) -> Reach:
        """How deep it goes; its share of the sky is that of the squares of a degree that it has stars in."""
        rows = np.arange(0, len(self._stars), max(1, len(self._stars) // 200_000))
        x, y, z = self._stars.vectors(rows).T
        zone = np.floor(np.degrees(np.arcsin(np.clip(z, -1.0, 1.0))))
        cells = np.maximum(1.0, np.round(360.0 * np.cos(np.radians(zone + 0.5))))
        cell = np.floor((np.arctan2(y, x) % (2 * np.pi)) / (2 * np.pi) * cells)
        _, count = np.unique(np.stack([zone, cell]), axis=1, return_counts=True)
        share = len(count) / float(
            np.maximum(1.0, np.round(360.0 * np.cos(np.radians(np.arange(-90, 90) + 0.5)))).sum()
        )
        density = float(np.median(count)) * len(self._stars) / max(len(rows), 1)
        return Reach(float(self._stars.mag(rows).max(initial=-2.0)), density, share)


def sort_table(path: Path) -> Task[GaiaTable]:
    """The table at ``path``, sorted first if that has not been done since it last changed."""
    where = _sorted_file(path)
    if not where.exists():
        foreign = yield from read_gaia(path)
        stars = foreign.stars
        yield Progress("Sorting the catalogue", 0.7)
        at = EPOCH if foreign.epoch is None else foreign.epoch
        where.parent.mkdir(parents=True, exist_ok=True)
        write_deep(where, replace(stars, vector=moved(stars.vector, stars.pm, EPOCH - at)))
    return GaiaTable(path)


def _sorted_file(path: Path) -> Path:
    try:
        facts = path.stat()
    except OSError as error:
        raise CatalogueError("{path} cannot be read: {why}.", path=path, why=error.strerror or error) from None
    mark = f"{path.resolve()} {facts.st_size} {facts.st_mtime_ns}"
    return cache_folder() / f"gaia-{hashlib.sha256(mark.encode()).hexdigest()[:16]}.kcat"
