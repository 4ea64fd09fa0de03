"""The objects of one field, found by an index of ``objects.tsv`` and read alone: a few ms, the whole takes 90.

``objects.kcat`` has a row for each line of the table: ``ra`` (u4) and ``dec`` (i4) ICRS in 1/2^32 of a turn, ``major``
and ``minor`` (f4) arcmin, NaN where unknown, ``rank`` (f4) by :func:`kochab.sky.sky_tables.ranks_of`, and ``at`` (u4),
the byte where the line begins, with one more for the end.
"""

from functools import cache
from pathlib import Path

import numpy as np

from kochab.core.arrays import Bools, Floats, Ints
from kochab.core.attitude import unit_vectors
from kochab.core.errors import CatalogueError
from kochab.core.solution import Solution
from kochab.sky.catalogue import shipped_folder
from kochab.sky.catalogue_file import TURN, Container
from kochab.sky.names import SkyObjects, objects_of_rows

INDEX, TABLE = "objects.kcat", "objects.tsv"
MOST = 1500  # objects of one frame, the best known


class ObjectIndex:
    """Places, sizes and ranks of all objects, and the way to the rows of some."""

    def __init__(self, folder: Path) -> None:
        self.table = folder / TABLE
        index = Container(folder / INDEX)
        self.vector: Floats = unit_vectors(*(index.column(name) * (360.0 / TURN) for name in ("ra", "dec")))
        """ICRS unit vectors (N, 3)."""
        self.major: Floats = index.column("major").astype(np.float64)
        """Largest diameters (N,), arcmin, NaN where unknown."""
        self.minor: Floats = index.column("minor").astype(np.float64)
        """Smallest diameters (N,), arcmin, NaN where unknown."""
        self.rank: Floats = index.column("rank").astype(np.float64)
        """How well known each is (N,), as a magnitude; inf for what is no object."""
        self._at = index.column("at").astype(np.int64)
        if self.table.stat().st_size != self._at[-1]:
            raise CatalogueError("The table of objects {path} is missing or damaged.", path=self.table)

    def read(self, rows: Ints) -> SkyObjects:
        """The objects of some rows, in their order; `CatalogueError` where the table is damaged."""
        try:
            with self.table.open("rb") as file:
                head, lines = file.readline().decode("utf-8").rstrip("\n"), list[str]()
                for row in rows.tolist():
                    file.seek(begin := int(self._at[row]))
                    lines.append(file.read(int(self._at[row + 1]) - begin - 1).decode("utf-8"))
            return objects_of_rows(head, lines)
        except (OSError, ValueError, KeyError, TypeError):
            raise CatalogueError("The table of objects {path} is missing or damaged.", path=self.table) from None

    def within(self, centre: Floats, reach_rad: float) -> Ints:
        """Rows of the objects, but for what is none, whose middle is within ``reach_rad`` of ``centre`` (3,)."""
        near = self.vector @ centre > np.cos(min(reach_rad, np.pi))
        return np.flatnonzero(near & np.isfinite(self.rank))


def holding(objects: "ObjectIndex | SkyObjects", centre: Floats, radius_rad: float) -> Ints:
    """Rows of the objects that a circle of ``radius_rad`` about ``centre`` (3,) lies in wholly, the smallest first."""
    smaller = np.where(np.isfinite(objects.minor), objects.minor, objects.major)
    # a circle of its smaller diameter, for that of its parts which the table's ellipse has
    wide = np.flatnonzero(smaller >= 119.0 * np.degrees(radius_rad))  # no other can hold it
    gap = np.arccos(np.clip(objects.vector[wide] @ centre, -1.0, 1.0))
    rows = wide[np.radians(smaller[wide] / 120.0) >= gap + radius_rad]
    return np.asarray(rows[np.argsort(objects.major[rows], kind="stable")])


@cache
def object_index() -> ObjectIndex:
    """That of the shipped table; `CatalogueError` where it is missing or belongs to another table."""
    return ObjectIndex(shipped_folder())


def inside(solution: Solution, xy: Floats) -> Bools:
    """Which pixels (N, 2) the frame has."""
    size = np.array([solution.camera.width, solution.camera.height])
    with np.errstate(invalid="ignore"):
        return np.asarray(((xy > -0.5) & (xy < size - 0.5)).all(axis=1))
