"""astrometry.net index files of any series that carries magnitudes."""

from pathlib import Path

import numpy as np

from app.core.errors import CatalogueError
from app.core.progress import Progress, Task
from app.sky.importing.stars import ForeignStars
from app.sky.making.tycho import read_index

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
