"""Catalogues that people already own, read and put beside the shipped one."""

import csv
import gzip
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Bools, Floats
from kochab.core.attitude import ARCSEC, unit_vectors
from kochab.core.errors import CatalogueError
from kochab.core.progress import Progress, Task
from kochab.sky.astrometry_index import read_index
from kochab.sky.catalogue import Catalogue, open_catalogue
from kochab.sky.catalogue_file import EPOCH, MOVING, StarList, write_deep, write_manifest
from kochab.sky.proper_motion import moved

# -- What every reader of a foreign catalogue gives --------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
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


# -- ASTAP's star databases: folders of ``<name>_RRCC.290`` or ``.1476`` files -----------------
# Each file is one area of the sky: a text header of 110 bytes whose last byte is the record size (a space stands for
# 11), then records, brightest first. A record holds RA in 3 bytes and the lower two bytes of Dec; a record whose RA
# is all ones opens a section of one magnitude and one upper byte of Dec. A sixth byte is the colour.

HEADER = 110
SUFFIXES = (".290", ".1476")
MARK = 0xFFFFFF
FULL_RA = 2**24 - 1
FULL_DEC = 2**23 - 1


def read_astap(folder: Path) -> Task[ForeignStars]:
    """Every star of an ASTAP database; its epoch is not stated in the files.

    Magnitudes are taken as they stand: V in databases with colour, Gaia's BP, some 0.2 fainter, in those without.
    """
    files = sorted(p for p in folder.iterdir() if p.suffix in SUFFIXES)
    parts = []
    for i, path in enumerate(files):
        if i % 20 == 0:
            yield Progress("Reading the catalogue", 0.6 * i / len(files), path.name)
        parts.append(decode(path.read_bytes(), path.name))
    ra, dec, mag, colour = np.concatenate(parts, axis=1)
    _, bv = v_of_gaia(mag, colour)
    return ForeignStars(StarList.of(unit_vectors(ra, dec), mag, bv=bv), None, "ASTAP")


def decode(data: bytes, name: str) -> NDArray[np.float64]:
    """RA, Dec (deg), magnitude and BP-RP (4, N) of one file."""
    size = data[HEADER - 1] if len(data) >= HEADER else 0  # a space stands for 11
    if size not in (5, 6) or (len(data) - HEADER) % size:
        raise CatalogueError(
            "{name} is not an ASTAP star file with records of 5 or 6 bytes, or is cut short.", name=name
        )
    rows = np.frombuffer(data, np.uint8, offset=HEADER).reshape(-1, size).astype(np.int64)
    ra = rows[:, 0] | rows[:, 1] << 8 | rows[:, 2] << 16
    mark = ra == MARK
    if len(rows) and not mark[0]:
        raise CatalogueError("{name} does not begin with a section, so it is damaged.", name=name)
    # the row of the latest section header before each star
    section = np.maximum.accumulate(np.where(mark, np.arange(len(rows)), 0))
    star = ~mark
    high, mag = rows[section, 3] - 128, (rows[section, 4] - 16) / 10.0
    # high is signed, so the shift keeps the sign of the declination
    dec = high << 16 | rows[:, 4] << 8 | rows[:, 3]
    colour = np.full(len(rows), np.nan)
    if size == 6:
        colour = rows[:, 5].astype(np.uint8).view(np.int8) / 10.0
    places = [ra * (360.0 / FULL_RA), dec * (90.0 / FULL_DEC), mag, colour]
    return np.stack([p[star] for p in places])


# -- Gaia's tables as CSV (plain or gzip), as its archive gives them ---------------------------

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
    except (OSError, EOFError, zlib.error, UnicodeDecodeError, csv.Error) as error:
        raise CatalogueError("{name} cannot be read as CSV ({error}).", name=path.name, error=error) from error
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
    return ForeignStars(stars, float(epochs[0]) if len(epochs) else DR3_EPOCH, "Gaia CSV")


def _blocks(path: Path) -> Iterator[Floats]:
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


# -- astrometry.net index files of any series that carries magnitudes --------------------------

MAGNITUDES = ("MAG_VT", "MAG", "PHOT_G_MEAN_MAG", "G_MAG", "MAG_G", "I_MAG", "J_MAG")
EPOCHS = {"MAG_VT": 2000.0, "PHOT_G_MEAN_MAG": 2015.5, "G_MAG": 2015.5, "MAG_G": 2015.5}


def read_indexes(files: list[Path]) -> Task[ForeignStars]:
    """The stars of one or several index files of one series, each star once."""
    parts, names = [], set()
    for i, path in enumerate(files):
        yield Progress("Reading the catalogue", 0.6 * i / len(files), path.name)
        vector, tags = read_index(path)
        columns = {name.upper(): values for name, values in tags.items()}
        name = next((n for n in MAGNITUDES if n in columns), None)
        if name is None:
            raise CatalogueError("{name} holds no magnitudes (the LIGHT series do not).", name=path.name)
        names.add(name)
        parts.append(np.column_stack([vector, columns[name].astype(np.float64)]))
    if len(names) != 1:
        raise CatalogueError("The index files are of different series: import one at a time.")
    # neighbouring index files of a series repeat the stars along their borders
    table = np.unique(np.concatenate(parts), axis=0)
    name = names.pop()
    v = table[:, 3] + (-0.10 if name == "MAG_VT" else 0.2)
    return ForeignStars(StarList.of(table[:, :3], v), EPOCHS.get(name), f"index files, {name}")


# -- Which reader a path is for, and where imported catalogues are kept ------------------------

FITS = (".fits", ".fit", ".index")


def user_folder(name: str) -> Path:
    """Where the imported catalogue ``name`` is kept."""
    from platformdirs import user_data_path

    if not name or Path(name).name != name:
        raise CatalogueError("{name!r} cannot be the name of a catalogue.", name=name)
    return user_data_path("kochab", appauthor=False) / "catalogs" / name


def read_foreign(path: Path) -> Task[ForeignStars]:
    """The stars at ``path``: an ASTAP folder, index files or their folder, or a Gaia CSV."""
    if path.is_dir():
        inside = sorted(p for p in path.iterdir() if p.is_file())
        if any(p.suffix in SUFFIXES for p in inside):
            return read_astap(path)
        indexes = [p for p in inside if p.suffix.lower() in FITS]
        if indexes:
            return read_indexes(indexes)
    elif path.is_file():
        if path.suffix in SUFFIXES:
            return read_astap(path.parent)
        if path.suffix.lower() in FITS:
            return read_indexes([path])
        if path.name.lower().endswith((".csv", ".csv.gz", ".ecsv", ".ecsv.gz")):
            return read_gaia(path)
    else:
        raise CatalogueError("{path} does not exist.", path=path)
    raise CatalogueError(
        "{path} is no catalogue that can be imported: ASTAP .290 or .1476 files, astrometry.net "
        "index files, or a Gaia CSV.",
        path=path,
    )


# -- A foreign catalogue and the shipped one together, as one that can be opened ---------------

SAME = 3.0  # arcsec within which both mean one star, the foreign epoch applied
COMPLETE = 9.0  # to this V the shipped list has every star, and foreign ones have the odd ghost
MAG_MOST = 32.0  # V; what is fainter, or not finite, is no magnitude of a star
UNKNOWN_EPOCH = 2016.0
MOST = 40_000_000  # stars; more would need several GB of memory to sort


def combine(
    foreign: ForeignStars, folder: Path, epoch: float | None = None, mag_limit: float | None = None
) -> Task[dict[str, Any]]:
    """Write the shipped stars and the foreign ones that it lacks; the manifest.

    The shipped star wins, as it has names, motion and the bright end; foreign stars of V 9 and brighter are left out
    altogether.

    Parameters
    ----------
    foreign : ForeignStars
        The stars to add.
    folder : Path
        Where the catalogue is written.
    epoch : float or None
        Julian year of the foreign places, used when their files state none.
    mag_limit : float or None
        Faintest V taken; None for all.
    """
    at = foreign.epoch or epoch or UNKNOWN_EPOCH
    mag = foreign.stars.mag
    stars = foreign.stars.take((mag > COMPLETE) & (mag <= (MAG_MOST if mag_limit is None else mag_limit)))
    if len(stars) > MOST:
        raise CatalogueError(
            "{stars:,} stars are too many to import; keep the brighter with --mag-limit.", stars=len(stars)
        )
    shipped = open_catalogue()
    yield Progress("Looking for stars that are there already", 0.65)
    new = stars.take(_absent(shipped, stars.vector, at))
    yield Progress("Joining the catalogues", 0.75)
    rows = np.arange(len(shipped))
    old = StarList.of(
        shipped.vectors(rows),
        shipped.mag(rows),
        pm=shipped.motions(rows),
        bv=shipped.bv(rows),
        flag=shipped.flags(rows),
    )
    new = replace(new, vector=moved(new.vector, new.pm, EPOCH - at))
    link = np.stack([shipped.container.column(f"link_{name}") for name in ("deep", "bright")], axis=1).astype(np.int64)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CatalogueError(
            "{folder} cannot be made: {strerror}.", folder=folder, strerror=error.strerror or error
        ) from None
    yield Progress("Writing the catalogue", 0.85)
    write_deep(folder / "deep.kcat", StarList.joined([old, new]), link)
    facts = {
        "counts": {"stars read": len(stars), "stars added to the shipped ones": len(new)},
        "imported_from": foreign.source,
        "imported_epoch": at,
    }
    return write_manifest(folder, facts)


def _absent(shipped: Catalogue, place: Floats, year: float) -> Bools:
    """Which of ``place`` (N, 3) no shipped star stands at, in ``year``."""
    from scipy.spatial import cKDTree

    # taken to the foreign epoch, as the shipped stars have motions and foreign ones may not
    tree = cKDTree(shipped.vectors(np.arange(len(shipped)), year))
    distance, _ = tree.query(place, distance_upper_bound=SAME * ARCSEC)
    return np.asarray(~np.isfinite(distance))
