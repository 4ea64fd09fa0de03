"""Catalogues that people already own, read and put beside the shipped one."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from kochab.core.arrays import Bools, Floats
from kochab.core.attitude import ARCSEC, unit_vectors
from kochab.core.errors import CatalogueError
from kochab.core.progress import Progress, Task
from kochab.sky.catalogue import Catalogue, open_catalogue
from kochab.sky.catalogue_file import EPOCH, StarList, write_deep, write_manifest
from kochab.sky.proper_motion import moved
from kochab.sky.user_catalogues.astap_database import TILINGS, decode
from kochab.sky.user_catalogues.gaia_table import ForeignStars, is_table, read_gaia, v_of_gaia
from kochab.sky.user_catalogues.index_files import EPOCHS, G_TO_V, MAGNITUDES, VT_TO_V, read_index

# -- ASTAP's star databases and index files, whole --------------------------------------------


def read_astap(folder: Path) -> Task[ForeignStars]:
    """Every star of an ASTAP database; its epoch is not stated in the files.

    Magnitudes are taken as they stand: V in databases with colour, Gaia's BP, some 0.2 fainter, in those without.
    """
    files = sorted(p for p in folder.iterdir() if p.suffix.lower() in TILINGS)
    parts = []
    for i, path in enumerate(files):
        if i % 20 == 0:
            yield Progress("Reading the catalogue", 0.6 * i / len(files), path.name)
        parts.append(decode(path.read_bytes(), path.name))
    ra, dec, mag, colour = np.concatenate(parts, axis=1)
    _, bv = v_of_gaia(mag, colour)
    return ForeignStars(StarList.of(unit_vectors(ra, dec), mag, bv=bv), None, "ASTAP")


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
    v = table[:, 3] + (VT_TO_V if name == "MAG_VT" else G_TO_V)
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
    """The stars at ``path``: an ASTAP folder, index files or their folder, or a Gaia table."""
    if path.is_dir():
        inside = sorted(p for p in path.iterdir() if p.is_file())
        if any(p.suffix.lower() in TILINGS for p in inside):
            return read_astap(path)
        indexes = [p for p in inside if p.suffix.lower() in FITS]
        if indexes:
            return read_indexes(indexes)
    elif path.is_file():
        if path.suffix.lower() in TILINGS:
            return read_astap(path.parent)
        if is_table(path):
            return read_gaia(path)
        if path.suffix.lower() in FITS:
            return read_indexes([path])
    else:
        raise CatalogueError("{path} does not exist.", path=path)
    raise CatalogueError(
        "{path} is no catalogue that can be imported: ASTAP .290 or .1476 files, astrometry.net "
        "index files, or a Gaia table.",
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
