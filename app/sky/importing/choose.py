"""Which reader a path is for, and where imported catalogues are kept."""

from pathlib import Path

from app.core.errors import CatalogueError
from app.core.progress import Task
from app.sky.importing.astap import SUFFIXES, read_astap
from app.sky.importing.gaia import read_gaia
from app.sky.importing.index import read_indexes
from app.sky.importing.stars import ForeignStars

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
