"""Catalogues that people already own, read and put beside the shipped one."""

import csv
import gzip
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Bools, Floats
from kochab.core.attitude import unit_vectors
from kochab.core.errors import CatalogueError
from kochab.core.progress import Progress, Task
from kochab.sky import catalogue_file
from kochab.sky.catalogue import Catalogue, open_catalogue
from kochab.sky.catalogue_build import sha256, write_deep
from kochab.sky.catalogue_merge import StarList
from kochab.sky.catalogue_sources import ARCSEC, moved, read_index

# -- What every reader of a foreign catalogue gives --------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class ForeignStars:
    """Stars (N,) at ``epoch``: ICRS degrees, V or nearly, and NaN for what is not known.

    ``pm_mas`` (N, 2) is pmRA*, pmDE in mas/yr. ``epoch`` None when the files do not say.
    """

    ra_deg: Floats
    dec_deg: Floats
    mag: Floats
    bv: Floats
    pm_mas: Floats
    epoch: float | None
    source: str

    def __len__(self) -> int:
        return len(self.mag)

    @classmethod
    def bare(cls, ra_deg: Floats, dec_deg: Floats, mag: Floats, epoch: float | None, source: str) -> "ForeignStars":
        """Stars of which only place and magnitude are known."""
        nan = np.full(len(mag), np.nan)
        return cls(ra_deg, dec_deg, mag, nan, np.stack([nan, nan], axis=1), epoch, source)


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
# Each file is one area of the sky: a text header of 110 bytes whose last byte is the record size
# (a space stands for 11), then records, brightest first. A record holds RA in 3 bytes and the lower
# two bytes of Dec; a record whose RA is all ones opens a section of one magnitude and one upper
# byte of Dec. A sixth byte is the colour.

HEADER = 110
SUFFIXES = (".290", ".1476")
MARK = 0xFFFFFF
FULL_RA = 2**24 - 1
FULL_DEC = 2**23 - 1


def read_astap(folder: Path) -> Task[ForeignStars]:
    """Every star of an ASTAP database; its epoch is not stated in the files.

    Magnitudes are taken as they stand: V in databases with colour, Gaia's BP, some 0.2 fainter, in
    those without.
    """
    files = sorted(p for p in folder.iterdir() if p.suffix in SUFFIXES)
    parts = []
    for i, path in enumerate(files):
        if i % 20 == 0:
            yield Progress("Reading the catalogue", 0.6 * i / len(files), path.name)
        parts.append(decode(path.read_bytes(), path.name))
    ra, dec, mag, colour = np.concatenate(parts, axis=1)
    _, bv = v_of_gaia(mag, colour)
    unknown = np.full((len(mag), 2), np.nan)
    return ForeignStars(ra, dec, mag, bv, unknown, None, "ASTAP")


def decode(data: bytes, name: str) -> NDArray[np.float64]:
    """RA, Dec (deg), magnitude and BP-RP (4, N) of one file."""
    size = data[HEADER - 1] if len(data) >= HEADER else 0  # a space stands for 11
    if size not in (5, 6) or (len(data) - HEADER) % size:
        raise CatalogueError(f"{name} is not an ASTAP star file with records of 5 or 6 bytes, or is cut short.")
    rows = np.frombuffer(data, np.uint8, offset=HEADER).reshape(-1, size).astype(np.int64)
    ra = rows[:, 0] | rows[:, 1] << 8 | rows[:, 2] << 16
    mark = ra == MARK
    if len(rows) and not mark[0]:
        raise CatalogueError(f"{name} does not begin with a section, so it is damaged.")
    section = np.maximum.accumulate(np.where(mark, np.arange(len(rows)), 0))
    star = ~mark
    high, mag = rows[section, 3] - 128, (rows[section, 4] - 16) / 10.0
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


def _blocks(path: Path) -> Iterator[Floats]:
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


# -- astrometry.net index files of any series that carries magnitudes --------------------------

MAGNITUDES = ("MAG_VT", "MAG", "PHOT_G_MEAN_MAG", "G_MAG", "MAG_G", "I_MAG", "J_MAG")
EPOCHS = {"MAG_VT": 2000.0, "PHOT_G_MEAN_MAG": 2015.5, "G_MAG": 2015.5, "MAG_G": 2015.5}


def read_indexes(files: list[Path]) -> Task[ForeignStars]:
    """The stars of one or several index files of one series, each star once."""
    parts, names = [], set()
    for i, path in enumerate(files):
        yield Progress("Reading the catalogue", 0.6 * i / len(files), path.name)
        stars = read_index(path)
        columns = {name.upper(): values for name, values in stars.columns.items()}
        name = next((n for n in MAGNITUDES if n in columns), None)
        if name is None:
            raise CatalogueError(f"{path.name} holds no magnitudes (the LIGHT series do not).")
        names.add(name)
        parts.append(np.column_stack([stars.vector, columns[name].astype(np.float64)]))
    if len(names) != 1:
        raise CatalogueError("The index files are of different series: import one at a time.")
    x, y, z, mag = np.unique(np.concatenate(parts), axis=0).T
    ra = np.degrees(np.arctan2(y, x)) % 360.0
    dec = np.degrees(np.arctan2(z, np.hypot(x, y)))
    name = names.pop()
    v = mag - 0.10 if name == "MAG_VT" else mag + 0.2
    return ForeignStars.bare(ra, dec, v, EPOCHS.get(name), f"index files, {name}")


# -- Which reader a path is for, and where imported catalogues are kept ------------------------

FITS = (".fits", ".fit", ".index")


def user_folder(name: str) -> Path:
    """Where the imported catalogue ``name`` is kept."""
    from platformdirs import user_data_path

    if not name or Path(name).name != name:
        raise CatalogueError(f"{name!r} cannot be the name of a catalogue.")
    return user_data_path("kochab") / "catalogs" / name


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
        raise CatalogueError(f"{path} does not exist.")
    raise CatalogueError(
        f"{path} is no catalogue that can be imported: ASTAP .290 or .1476 files, astrometry.net "
        "index files, or a Gaia CSV."
    )


# -- A foreign catalogue and the shipped one together, as one that can be opened ---------------

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
        raise CatalogueError(f"{int(keep.sum()):,} stars are too many to import; keep the brighter with --mag-limit.")
    shipped = open_catalogue()
    rows = np.arange(len(shipped))
    place = unit_vectors(foreign.ra_deg[keep], foreign.dec_deg[keep])
    yield Progress("Looking for stars that are there already", 0.65)
    new = _absent(shipped, place, at)
    pm = np.nan_to_num(foreign.pm_mas[keep][new])
    yield Progress("Joining the catalogues", 0.75)
    flag = np.where(np.isfinite(foreign.pm_mas[keep][new, 0]), catalogue_file.MOVING, 0)
    old = StarList(
        shipped.vectors(rows),
        shipped.motions(rows),
        shipped.mag(rows),
        shipped.bv(rows),
        np.zeros(len(rows), np.int64),
        shipped.flags(rows),
    )
    added = StarList(
        moved(place[new], pm, catalogue_file.EPOCH - at),
        pm,
        foreign.mag[keep][new],
        foreign.bv[keep][new],
        np.zeros(int(new.sum()), np.int64),
        flag.astype(np.uint8),
    )
    column = shipped.container.column
    link = np.stack([column("link_deep"), column("link_bright")], axis=1).astype(np.int64)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CatalogueError(f"{folder} cannot be made: {error.strerror or error}.") from None
    yield Progress("Writing the catalogue", 0.85)
    write_deep(folder / "deep.kcat", StarList.joined(old, added), link)
    return _manifest(folder, foreign, at, int(keep.sum()), len(added))


def _absent(shipped: Catalogue, place: Floats, year: float) -> Bools:
    """Which of ``place`` (N, 3) no shipped star stands at, in ``year``."""
    from scipy.spatial import cKDTree

    tree = cKDTree(shipped.vectors(np.arange(len(shipped)), year))
    distance, _ = tree.query(place, distance_upper_bound=SAME * ARCSEC)
    return np.asarray(~np.isfinite(distance))


def _manifest(folder: Path, foreign: ForeignStars, epoch: float, read: int, added: int) -> dict[str, Any]:
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
