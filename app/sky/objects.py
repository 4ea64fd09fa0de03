"""Deep-sky objects: the NGC, IC and Messier table, small enough to be text."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import unit_vectors
from app.core.errors import CatalogueError

COLUMNS = "name\ttype\tra_deg\tdec_deg\tmag\tsize_arcmin\tmessier\tcommon"


@dataclass(frozen=True, slots=True)
class DeepSky:
    """One object; ``mag`` (V, else B) and ``size_arcmin`` (longest axis) NaN when unknown."""

    name: str
    kind: str
    ra_deg: float
    dec_deg: float
    mag: float
    size_arcmin: float
    messier: str
    common: str

    @property
    def vector(self) -> NDArray[np.float64]:
        """ICRS unit vector (3,)."""
        return unit_vectors(self.ra_deg, self.dec_deg)

    @property
    def keys(self) -> list[str]:
        """Every spelling it is found by, lower case and without spaces."""
        names = [self.name, self.messier, self.messier.replace("M", "Messier", 1)]
        names += self.common.split(",")
        return [re.sub(r"\s", "", n).casefold() for n in names if n.strip()]


def read_objects(path: Path) -> list[DeepSky]:
    """All objects of the table, in its order."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise CatalogueError(f"The table of objects {path} cannot be read.") from error
    if not lines or lines[0] != COLUMNS:
        raise CatalogueError(f"The table of objects {path} is damaged.")
    return [_parsed(line.split("\t")) for line in lines[1:]]


def _parsed(cells: list[str]) -> DeepSky:
    ra, dec, mag, size = (float(c) if c else float("nan") for c in cells[2:6])
    return DeepSky(cells[0], cells[1], ra, dec, mag, size, cells[6], cells[7])
