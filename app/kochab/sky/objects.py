"""The shipped table of deep-sky objects: places, sizes, magnitudes and names."""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kochab.core.arrays import Floats, Table
from kochab.core.attitude import unit_vectors
from kochab.core.errors import CatalogueError


@dataclass(frozen=True, slots=True, eq=False)
class SkyObjects(Table):
    """Deep-sky objects: texts (N,), ICRS vectors (N, 3), V or B magnitude, diameters in arcmin, PA in degrees.

    NaN is unknown. ``kind`` is OpenNGC's, with GalCl a cluster of galaxies; ``also`` are other designations and names,
    ``common`` those that are shown, both parted by commas.
    """

    name: np.ndarray[tuple[int], np.dtype[np.str_]]
    kind: np.ndarray[tuple[int], np.dtype[np.str_]]
    vector: Floats
    mag: Floats
    major: Floats
    minor: Floats
    pa_deg: Floats
    messier: np.ndarray[tuple[int], np.dtype[np.str_]]
    common: np.ndarray[tuple[int], np.dtype[np.str_]]
    also: np.ndarray[tuple[int], np.dtype[np.str_]]

    def designation(self, row: int) -> str:
        """How it is called first: M 42, NGC 2024, Sh2-155."""
        messier = str(self.messier[row])
        return messier.replace("M", "M ", 1) if messier else str(self.name[row])

    def names(self, row: int) -> list[str]:
        """Those that are shown, the best known first."""
        texts = (self.designation(row), *self.common[row].split(","), str(self.name[row]))
        return [text for text in dict.fromkeys(texts) if text]


def read_objects(path: Path) -> SkyObjects:
    """The table of objects; `CatalogueError` when it is missing or damaged."""
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = [*csv.reader(file, delimiter="\t", quoting=csv.QUOTE_NONE)]
        head, *rows = rows
        columns = dict(zip(head, zip(*rows, strict=True), strict=True))
        texts = {name: np.array(columns[name]) for name in ("name", "type", "messier", "common", "also")}
        ra, dec, mag, major, minor, pa = (
            np.array([float(value or "nan") for value in columns[name]])
            for name in ("ra_deg", "dec_deg", "mag", "size_arcmin", "minor_arcmin", "pa_deg")
        )
        if not (np.isfinite(ra).all() and np.isfinite(dec).all()):
            raise ValueError
    except (OSError, ValueError, KeyError, TypeError):
        raise CatalogueError("The table of objects {path} is missing or damaged.", path=path) from None
    shape = (unit_vectors(ra, dec), mag, major, minor, pa)
    return SkyObjects(texts["name"], texts["type"], *shape, texts["messier"], texts["common"], texts["also"])
