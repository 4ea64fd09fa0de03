"""The stars of astrometry.net's index files, found through the files' own k-d trees.

A FITS file of tables of raw bytes. The tree is a heap of cuts, a number of four bytes each whose low two bits name the
axis, over leaves of neighbouring rows of the star table; stars are three unsigned numbers that span the range given
beside them (https://github.com/dstndstn/astrometry.net, libkd). What a series says beside the places stands in a last
table, row by row.
"""

from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Floats, Ints
from kochab.core.errors import CatalogueError
from kochab.core.values import frozen
from kochab.sky.user_catalogues.fits_tables import FitsTables, map_tables, primary_header
from kochab.sky.user_catalogues.star_cone import Cone, Reach, StarCone, Version, version

MAGNITUDES = ("MAG_VT", "MAG", "PHOT_G_MEAN_MAG", "G_MAG", "MAG_G", "I_MAG", "J_MAG")
"""Columns of magnitudes in the order they are wanted."""
EPOCHS = {"MAG_VT": 2000.0, "PHOT_G_MEAN_MAG": 2015.5, "G_MAG": 2015.5, "MAG_G": 2015.5}
VT_TO_V, G_TO_V = -0.10, 0.2
SUFFIXES = (".fits", ".fit", ".index")
SKY_DEG2 = 129_600.0 / np.pi
UNIT = 1e-3
"""How far from one the length of a stored vector may be."""
_LOW_BITS = np.uint32(3)


@frozen(eq=False)
class StarTree:
    """One index file: ``stars`` (N, 3) unsigned, ``low`` (3,) and ``scale`` of their range, its tree and magnitudes.

    ``cuts`` (L - 1,) and ``last`` (L,), the last row of each leaf, are None where the file has no such tree.
    ``mag`` (N,) is None in series without magnitudes, which have ``sweep`` (N,) instead: 1 for the brightest star of
    each small cell, 2 for the next.
    """

    name: str
    stars: NDArray[np.uint32]
    low: Floats
    scale: float
    cuts: NDArray[np.uint32] | None
    last: NDArray[np.uint32] | None
    mag: NDArray[np.floating] | None
    mag_name: str
    sweep: NDArray[np.uint8] | None

    def rows(self, centre: Floats, radius_rad: float) -> Ints:
        """Rows of the leaves that a cone touches; ``centre`` (3,) ICRS."""
        if self.cuts is None or self.last is None:
            return np.arange(len(self.stars))
        place = (centre - self.low) * self.scale
        reach = 2.0 * np.sin(min(radius_rad, np.pi) / 2.0) * self.scale + 8.0
        node = np.zeros(1, dtype=np.int64)
        leaves = len(self.last)
        while node[0] < leaves - 1:  # all of one depth: the whole row is inside, or all are leaves
            packed = self.cuts[node]
            cut, axis = (packed & ~_LOW_BITS).astype(np.float64), packed & _LOW_BITS
            if axis.max(initial=0) > 2:
                raise _damaged(self.name)
            here = place[axis]
            left, right = node[here - reach <= cut] * 2 + 1, node[here + reach >= cut] * 2 + 2
            node = np.sort(np.concatenate([left, right]))
            if not len(node):
                return np.zeros(0, dtype=np.int64)
        leaf = node - (leaves - 1)
        end = self.last[leaf].astype(np.int64) + 1
        begin = np.where(leaf > 0, self.last[np.maximum(leaf - 1, 0)].astype(np.int64) + 1, 0)
        if (end < begin).any() or end.max() > len(self.stars):
            raise _damaged(self.name)
        return np.concatenate([np.arange(a, b) for a, b in zip(begin.tolist(), end.tolist(), strict=True)])

    def vectors(self, rows: Ints) -> Floats:
        """ICRS unit vectors (K, 3) of rows (K,)."""
        found = self.stars[rows] / self.scale + self.low
        length = np.linalg.norm(found, axis=1, keepdims=True)
        if not (np.abs(length - 1.0) < UNIT).all():
            raise CatalogueError("{name} holds stars that are not directions.", name=self.name)
        return np.asarray(found / length)

    def magnitudes(self, rows: Ints) -> Floats:
        """V or nearly (K,) of rows (K,); of series without magnitudes a guess from their order of brightness."""
        if self.mag is not None:
            return self.mag[rows].astype(np.float64) + (VT_TO_V if self.mag_name == "MAG_VT" else G_TO_V)
        assert self.sweep is not None
        # about 2.5 times as many stars a magnitude: the order is what counts
        share = np.maximum(self.sweep[rows].astype(np.float64), 1.0) * len(self.stars) / max(int(self.sweep.max()), 1)
        return np.asarray(np.log(share / SKY_DEG2) / np.log(2.5) + 9.5)


def _damaged(name: str) -> CatalogueError:
    return CatalogueError("{name} is damaged: its star tree does not fit its stars.", name=name)


def open_tree(path: Path) -> StarTree:
    """The star tree of an index file, mapped; CatalogueError when it has none that can be used."""
    return _open_tree(path, version(path))


@lru_cache(maxsize=64)
def _open_tree(path: Path, _: Version) -> StarTree:
    try:
        return _tree(path, map_tables(path))
    except (KeyError, ValueError, TypeError) as error:
        raise _no_index(path, error) from error


def _no_index(path: Path, error: Exception) -> CatalogueError:
    why = " ".join(str(error).split())[:200]
    return CatalogueError("{name} is not an index file with a star table ({why}).", name=path.name, why=why)


def _order(file: FitsTables) -> str:
    """The byte order of the raw tables, which is that of the computer that wrote them."""
    return ">" if file.primary.get("ENDIAN", "04:").startswith("01:") else "<"


def _places(path: Path, file: FitsTables) -> tuple[NDArray[np.uint32], Floats, float]:
    """The stars (N, 3) as they are stored, and the beginning (3,) and scale of their range."""
    data, span = file.named("kdtree_data_stars"), file.named("kdtree_range_stars")
    if data is None or span is None:
        raise ValueError("no kdtree_data_stars")
    stars, reach = data.raw(f"{_order(file)}u4", 3), span.raw(f"{_order(file)}f8")
    if len(stars) == 0 or len(reach) != 7 or not reach[6] > 0.0:
        raise CatalogueError("{name} holds stars that are not directions.", name=path.name)
    return stars, reach[:3], float(reach[6])


def _tree(path: Path, file: FitsTables) -> StarTree:
    order = _order(file)
    stars, low, scale = _places(path, file)
    cuts, last = file.named("kdtree_split_stars"), file.named("kdtree_lr_stars")
    split = leaf = None
    if cuts is not None and last is not None:
        split, leaf = cuts.raw(f"{order}u4"), last.raw(f"{order}u4")
        if len(split) != len(leaf) - 1 or len(leaf) & (len(leaf) - 1) or int(leaf[-1]) != len(stars) - 1:
            raise _damaged(path.name)
    mags = {n.upper(): t.column(n) for t in file.tables for n in t.names if len(t.data) == len(stars)}
    name = next((n for n in MAGNITUDES if n in mags and mags[n].dtype.kind == "f" and mags[n].ndim == 1), "")
    sweep = mags.get("SWEEP")
    if not name and (sweep is None or sweep.dtype.kind not in "ui"):
        raise CatalogueError("{name} holds no magnitudes (the LIGHT series do not).", name=path.name)
    return StarTree(path.name, stars, low, scale, split, leaf, mags.get(name), name, sweep)


def read_index(path: Path) -> tuple[Floats, dict[str, NDArray[Any]]]:
    """Unit vectors (N, 3) of all stars of an index file, and the numbers (N,) that it has of each."""
    file = map_tables(path)
    try:
        tree = StarTree(path.name, *_places(path, file), None, None, None, "", None)
    except ValueError as error:
        raise _no_index(path, error) from error
    columns = {n: t.column(n) for t in file.tables for n in t.names if len(t.data) == len(tree.stars)}
    numbers = {n: np.array(c) for n, c in columns.items() if c.ndim == 1 and c.dtype.kind in "iuf"}
    return tree.vectors(np.arange(len(tree.stars))), numbers


class IndexFiles:
    """The index files of one series in a folder, those of the smallest scale: they have the most stars."""

    kind = "astrometry.net"

    def __init__(self, folder: Path, name: str) -> None:
        self.path, self.name = folder, name
        every = [f for f in index_files(folder) if f.series == name]
        if not every:
            raise CatalogueError("{path} has no index files of the {name} series.", path=folder, name=name)
        smallest = min(f.scale for f in every)
        self._files = [f for f in every if f.scale == smallest]

    @cached_property
    def _trees(self) -> list[StarTree]:
        return [open_tree(f.path) for f in self._files]

    def cone(self, cone: Cone) -> StarCone:
        """The stars of a cone; its stars do not move."""
        parts = []
        for tree in self._trees:
            rows = tree.rows(cone.axis, cone.radius_rad)
            if len(rows):
                parts.append(np.column_stack([tree.vectors(rows), tree.magnitudes(rows)]))
        # neighbouring files of a series repeat the stars along their borders
        x, y, z, mag = (np.unique(np.concatenate(parts), axis=0) if parts else np.zeros((0, 4))).T
        found = StarCone(np.arctan2(y, x) % (2 * np.pi), np.arctan2(z, np.hypot(x, y)), mag)
        return found.inside(cone)

    def reach(self) -> Reach:
        """How deep it goes; ``HEALPIX`` in a file's header says which part of the sky it is."""
        stars, faintest, share = 0, -2.0, 0.0
        for file, tree in zip(self._files, self._trees, strict=True):
            some = np.arange(0, len(tree.stars), max(1, len(tree.stars) // 2000))
            stars, share = stars + len(tree.stars), share + file.sky_share
            faintest = max(faintest, float(tree.magnitudes(some).max()))
        return Reach(faintest, stars / (SKY_DEG2 * share), min(share, 1.0))


@frozen
class IndexFile:
    """What the header of an index file says: its series as ``4100``, its scale as a number, its part of the sky."""

    path: Path
    series: str
    scale: int
    sky_share: float


def index_files(folder: Path) -> list[IndexFile]:
    """The index files in a folder; others, and damaged ones, are passed over."""
    try:
        paths = sorted(p for p in folder.iterdir() if p.suffix.lower() in SUFFIXES)
    except OSError:
        return []
    return [found for path in paths if (found := index_file(path)) is not None]


def index_file(path: Path) -> IndexFile | None:
    """What the header of the file at ``path`` says, None when it is no index file."""
    try:
        header = primary_header(path)
        number, side = int(header["INDEXID"]), int(header.get("HPNSIDE", "0"))
        whole = int(header.get("HEALPIX", "-1")) < 0 or side <= 0
    except (CatalogueError, KeyError, ValueError):
        return None
    return IndexFile(path, str(number // 100 * 100), number % 100, 1.0 if whole else 1.0 / (12 * side * side))
