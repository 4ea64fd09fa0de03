"""The pattern index: quads of catalogue stars, found by shape in memory-mapped arrays.

A volume is a folder of plain ``.npy`` files that covers several levels of field size:

``stars`` (n, 3) float32 ICRS unit vectors, level after level, each level sorted by zone key ·
``rows`` (n,) uint32 catalogue rows · ``keys`` (n,) uint32 zone keys · ``cells`` (c + 1,) uint32
first quad of each code cell · ``neighbours`` int16: for each star how many places on or back in its
level its nearest stand, the nearest first · ``codes`` (Q,) uint32, four bytes, each the place of the
code within its cell in 1/64 of a cell and two bits of the base's length, see :func:`size_code` ·
``quads`` (Q,) uint32: a star times the number of :func:`ways`, and which of these: a quad is a star
and three of its nearest. Parity is not stored: it is seen from the stars themselves.
"""

import math
import mmap
import sys
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import combinations, permutations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Floats, Ints
from kochab.core.errors import CatalogueError, DamagedPatternsError
from kochab.core.values import frozen
from kochab.folders import cache_folder
from kochab.parsing.text_input import read_json

RA_STEPS = 1 << 20  # right ascension in units of about 1.2 arcsec; zones above it in the key


def zones_of(field_deg: float) -> int:
    """How many declination zones serve fields of this size best, at most 4095."""
    # a zone is a third of a field high; with 4096 the upper edge of the last one would overflow 32 bits
    return int(min(4095, max(8, round(540.0 / field_deg))))


def zone_keys(vectors: NDArray[np.floating], zones: int) -> NDArray[np.uint32]:
    """Sort keys (N,) of unit vectors (N, 3) for ``zones`` (at most 4095) declination zones."""
    v = np.asarray(vectors, dtype=np.float64)
    dec = np.arcsin(np.clip(v[:, 2], -1.0, 1.0))
    zone = np.clip(((dec / np.pi + 0.5) * zones).astype(np.int64), 0, zones - 1)
    ra = np.arctan2(v[:, 1], v[:, 0]) % (2 * np.pi)
    step = np.minimum((ra * (RA_STEPS / (2 * np.pi))).astype(np.int64), RA_STEPS - 1)
    return np.asarray(zone * RA_STEPS + step, dtype=np.uint32)


def cone_rows(keys: NDArray[np.uint32], zones: int, centre: Floats, radius: float) -> Ints:
    """Rows of a sorted key list that may lie in a cone.

    Whole zones cut to a range of right ascension: a superset of the cone, never less.

    Parameters
    ----------
    keys : NDArray[np.uint32]
        Zone and right ascension of each star (N,), ascending.
    zones : int
        Into how many zones of declination the sphere is cut.
    centre : Floats
        Axis of the cone, ICRS unit vector (3,).
    radius : float
        Its half angle, radians.
    """
    dec = math.asin(min(max(float(centre[2]), -1.0), 1.0))
    height = np.pi / zones
    first = max(0, int((dec - radius + np.pi / 2) / height))
    last = min(zones - 1, int((dec + radius + np.pi / 2) / height))
    # a cone that holds a pole holds every right ascension
    parts = [(0, RA_STEPS)]
    if abs(dec) + radius < np.pi / 2 - 1e-6:
        # where meridians touch the cone: sin(half) = sin(radius) / cos(dec), more than at its centre
        half = math.asin(min(1.0, math.sin(min(radius, np.pi / 2)) / math.cos(dec)))
        ra = math.atan2(centre[1], centre[0]) % (2 * np.pi)
        a = math.floor((ra - half) * (RA_STEPS / (2 * np.pi))) - 1
        b = math.ceil((ra + half) * (RA_STEPS / (2 * np.pi))) + 1
        if b - a < RA_STEPS:
            # across 0 h it is two ranges; elsewhere the second is empty
            across = (a + RA_STEPS, RA_STEPS) if a < 0 else (0, max(b - RA_STEPS, 0))
            parts = [(max(a, 0), min(b, RA_STEPS)), across]
    edges = np.array(parts).T[:, :, None] + np.arange(first, last + 1) * RA_STEPS
    low, high = keys.searchsorted(edges.reshape(2, -1).astype(np.uint32))
    return ranges(low, high - low)


def ranges(start: NDArray[np.integer], count: NDArray[np.integer]) -> Ints:
    """The integers ``start[k] .. start[k] + count[k] - 1`` of every k, in a row."""
    total = int(count.sum())
    if total == 0:
        return np.zeros(0, dtype=np.int64)
    # one count through all ranges, plus for each how far its start is from its place in the row
    offset = np.cumsum(count) - count
    first = np.repeat(start.astype(np.int64) - offset.astype(np.int64), count)
    return np.asarray(np.arange(total, dtype=np.int64) + first)


ARRAYS: dict[str, tuple[str, tuple[int, ...]]] = {  # as they are stored, and the shape of a row
    "stars": ("<f4", (3,)),
    "rows": ("<u4", ()),
    "keys": ("<u4", ()),
    "neighbours": ("<i2", ()),
    "cells": ("<u4", ()),
    "codes": ("<u4", ()),
    "quads": ("<u4", ()),
}
SCATTERED = ("cells", "codes", "quads", "neighbours", "stars")  # arrays that a search reads here and there
AHEAD_BITS = 14  # 16 kB are announced together
HEADER_BYTES = 128  # of an ``.npy`` file; what it tells is known from the volume's facts
UNIT = 1e-5  # how far from one the square of a stored unit vector may be
MOST_NEAREST = 16
MOST_IN_CELL = 1 << 16  # a hundred times what any cell holds
ALL_FOUR = np.uint32(0x01010101)  # four true bytes
# corners of a box in code space: along which of the four axes it is the upper of two cells
CORNERS = (np.arange(16)[:, None] >> np.arange(4) & 1).astype(bool)
AXES = np.array([1, 2, 4, 8])
# by the axes along which a box is in two cells, in binary: which corners step along none of the others
TOUCHED = (np.arange(16)[:, None] | np.arange(16)) == np.arange(16)[:, None]
FINENESS = 4  # of 256 parts of a cell: the two lowest bits of a code's bytes hold the size
PLACE = np.uint32(0xFCFCFCFC)
IM_REACH = 0.875  # |Im z| never exceeds sqrt(3)/2 while the base is the longest side
CORNER = np.array([0.0, 0.0, IM_REACH, IM_REACH])  # what makes a code positive
ORDERS = np.array(list(permutations(range(4))))
SIZE_MIN_RAD, SIZE_STEPS = 1e-4, 127.0  # base length from 20 arcsec to pi rad in 127 steps
SIZE_LOG = float(np.log(np.pi / SIZE_MIN_RAD))


def size_code(base_rad: Floats) -> NDArray[np.uint8]:
    """Base lengths (rad) in logarithmic steps of 8.5 %, 7 bits."""
    s = np.log(np.maximum(base_rad, SIZE_MIN_RAD) / SIZE_MIN_RAD) / SIZE_LOG * SIZE_STEPS
    return np.clip(np.floor(s), 0, SIZE_STEPS).astype(np.uint8)


def pack(inside: NDArray[np.uint8], size: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """Stored codes (Q,) of places within their cells (Q, 4), 1/256 of a cell, and of sizes (Q,)."""
    two_bits = (size[:, None] >> np.array([0, 2, 4, 6], dtype=np.uint8)) & np.uint8(3)
    return np.ascontiguousarray((inside & np.uint8(0xFC)) | two_bits).view(np.uint32).ravel()


def packed_size(code: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Sizes (Q,) that stored codes (Q,) hold."""
    return np.asarray((code & 3) | ((code >> 6) & 12) | ((code >> 12) & 48) | ((code >> 18) & 64), dtype=np.uint32)


@lru_cache
def ways(nearest: int) -> Ints:
    """Which of a star (0) and its nearest (1, 2, ...) are A, B, C and D: the star and any three, in any order (W, 4).

    Those of fewer nearest come first. All orders of the same three are next to each other, see :data:`ORDERS`.
    """
    return np.array([np.array((0, *three))[ORDERS] for three in threes(nearest)]).reshape(-1, 4)


def first_neighbours(offsets: Ints, nearest: Ints) -> Ints:
    """Where in ``neighbours`` those of each level begin, and all end (L + 1,), of levels (L + 1,) with so many (L,)."""
    return np.concatenate([[0], np.cumsum(np.diff(offsets) * nearest)])


def threes(nearest: int) -> list[tuple[int, ...]]:
    """All choices of three of so many, counted from one; those of the first few come first."""
    return sorted(combinations(range(1, nearest + 1), 3), key=lambda three: three[::-1])


@dataclass(frozen=True)
class Grid:
    """How code space is cut: ``steps`` cells over [0, 1] of the real parts."""

    steps: int

    @cached_property
    def shape(self) -> tuple[int, int, int, int]:
        """Cells of Re zc (which stays below 1/2), Re zd, Im zc, Im zd."""
        imag = int(np.ceil(2 * IM_REACH * self.steps))
        return self.steps // 2 + 1, self.steps + 1, imag, imag

    @property
    def cells(self) -> int:
        """Number of cells."""
        return int(np.prod(self.shape))

    def scaled(self, code: Floats) -> Floats:
        """Codes (Q, 4) in units of a cell, from the grid's corner."""
        return np.asarray((code + CORNER) * self.steps)

    def number(self, cell: Ints) -> Ints:
        """Flat cell numbers of integer cells (Q, 4), which are clipped into the grid."""
        return np.asarray(np.clip(cell, 0, self.last) @ self.strides)

    @cached_property
    def last(self) -> Ints:
        """The last cell along each axis (4,)."""
        return np.array(self.shape) - 1

    @cached_property
    def strides(self) -> Ints:
        """What one step along each axis adds to a flat cell number (4,)."""
        s = self.shape
        return np.array([s[1] * s[2] * s[3], s[2] * s[3], s[3], 1])

    def around(self, place: Floats, reach: Floats) -> tuple[Ints, Ints, Ints, Ints]:
        """All cells that boxes of half-width ``reach`` (Q, 1) about ``place`` (Q, 4) touch.

        ``reach`` is below half a cell, so a box touches one or two cells along each axis. Returns
        the query, the corner (a row of ``CORNERS``) and the flat number of each cell touched, and
        the lowest cell (Q, 4) of each query.
        """
        # a conversion to integers cuts towards zero, which below zero is the first cell as well
        low = np.minimum(np.maximum(place - reach, 0.0), self.last).astype(np.int64)
        high = np.minimum(np.maximum(place + reach, 0.0), self.last).astype(np.int64)
        differs = high > low
        # a corner that steps along an axis on which the box stays in one cell would be counted twice
        query, corner = TOUCHED[differs @ AXES].nonzero()
        number = (low @ self.strides)[query] + (CORNERS[corner] @ self.strides)
        return query, corner, number, low


class ReadAhead:
    """Says which parts of a mapped file are wanted next, so that the disk brings them side by side.

    A search reads ten thousand small places of a large file. Left to itself the system fetches
    them one after the other, each with as much around it as its read-ahead says. Every part is
    announced once: what is still in memory costs nothing more.
    """

    def __init__(self, mapped: mmap.mmap, row_bytes: int) -> None:
        self._mapped = mapped
        self._row_bytes = row_bytes
        self._advised = np.zeros((len(mapped) >> AHEAD_BITS) + 1, dtype=bool)
        if sys.platform != "win32":  # its own read-ahead would bring the whole volume
            mapped.madvise(mmap.MADV_RANDOM)

    def tell(self, rows: Ints) -> None:
        """Announce ``rows``."""
        if sys.platform == "win32":
            return
        part = (rows.ravel() * self._row_bytes + HEADER_BYTES) >> AHEAD_BITS
        part = part[~self._advised[part]]
        if len(part) == 0:
            return
        self._advised[part] = True
        new = np.zeros_like(self._advised)
        new[part] = True
        # madvise wants beginnings of pages, which have 4 kB, or 16: a part is 16
        edges = np.diff(new, prepend=False, append=False).nonzero()[0] << AHEAD_BITS
        edges = np.minimum(edges, len(self._mapped)).reshape(-1, 2)
        with suppress(OSError):  # pages of 64 kB need not begin here; it is advice only
            for begin, end in edges.tolist():  # neighbours in one call
                self._mapped.madvise(mmap.MADV_WILLNEED, begin, end - begin)


@frozen(eq=False)
class Volume:
    """One opened index; see the module's text. ``mark``: the catalogue's SHA-256.

    What has been mapped is not read before it is asked for, so damage shows only then: what cannot
    be raises DamagedPatternsError, and what is merely wrong does not pass the verification.
    """

    grid: Grid
    fields_deg: Floats
    offsets: Ints
    zones: Ints
    stars: NDArray[np.float32]
    rows: NDArray[np.uint32]
    keys: NDArray[np.uint32]
    neighbours: NDArray[np.signedinteger]
    cells: NDArray[np.uint32]
    codes: NDArray[np.uint32]
    quads: NDArray[np.uint32]
    nearest: Ints  # of each level's stars so many neighbours are kept
    mark: str = ""
    folder: Path = Path()
    ahead: "dict[str, ReadAhead]" = field(default_factory=dict)

    def tell(self, name: str, rows: Ints) -> None:
        """Let the system fetch ``rows`` of an array, all at a time, should they still lie on the disk."""
        if name in self.ahead:
            self.ahead[name].tell(rows)

    @property
    def span_deg(self) -> tuple[float, float]:
        """The smallest and the largest field its levels are made for."""
        return float(self.fields_deg[0]), float(self.fields_deg[-1])

    def lookup(self, code: Floats, tolerance: Floats, size: Floats) -> tuple[Ints, Ints]:
        """Quads whose code lies within ``tolerance`` (Q,) of ``code`` (Q, 4) in every number.

        ``size`` (Q, 2) limits the base's length in rad. Returns (query, quad) row pairs.
        """
        place = self.grid.scaled(code)
        # a box wider than a cell could touch three cells along an axis
        reach = np.minimum(tolerance * self.grid.steps, 0.499)[:, None]
        query, corner, number, low = self.grid.around(place, reach)
        self.tell("cells", number)
        start, end = (self.cells[n].astype(np.int64) for n in (number, number + 1))
        count = end - start
        # a flipped bit here would have `ranges` fill the memory
        if max(count.max(initial=0) - MOST_IN_CELL, end.max(initial=0) - len(self.codes)) > 0:
            raise DamagedPatternsError(self.folder)
        kept = count > 0
        query, corner, start, count = query[kept], corner[kept], start[kept], count[kept]
        self.tell("codes", start)
        entry = ranges(start, count)
        # compare in 1/256 of a cell, where the stored numbers live: four bytes at a time, and
        # "between low and high" as one unsigned subtraction that wraps below low
        target = np.floor((place - low) * 256.0)
        low8, span8 = _window(target, np.ceil(reach * 256.0), query, CORNERS[corner])
        stored = self.codes[entry]
        found = (stored & PLACE).view(np.uint8).reshape(-1, 4)
        found -= np.repeat(low8.view(np.uint32).ravel(), count).view(np.uint8).reshape(-1, 4)
        within = found <= np.repeat(span8.view(np.uint32).ravel(), count).view(np.uint8).reshape(-1, 4)
        good = np.nonzero(within.view(np.uint32).ravel() == ALL_FOUR)[0]
        query, entry = np.repeat(query, count)[good], entry[good]
        length = packed_size(stored[good])
        fits = (length >= size_code(size[:, 0])[query]) & (length <= size_code(size[:, 1])[query])
        return query[fits], entry[fits]

    def members(self, quad: Ints) -> Ints:
        """Star numbers (Q, 4) of quads, as A, B, C, D."""
        self.tell("quads", quad)
        way = ways(int(self.nearest.max()))
        star, number = (found.astype(np.int64) for found in np.divmod(self.quads[quad], np.uint32(len(way))))
        level = self.level_of(star)
        begin = first_neighbours(self.offsets, self.nearest)
        if level.max(initial=0) >= len(self.nearest):
            raise DamagedPatternsError(self.folder)
        which = way[number]
        at = (begin[level] + (star - self.offsets[level]) * self.nearest[level])[:, None] + np.maximum(which - 1, 0)
        if at.max(initial=0) >= len(self.neighbours):
            raise DamagedPatternsError(self.folder)
        self.tell("neighbours", at)
        members = star[:, None] + np.where(which > 0, self.neighbours[at], 0)
        # A and B are the base, whose length codes are divided by
        wrong = (members < 0) | (members >= len(self.stars))
        if wrong.any() or (members[:, 0] == members[:, 1]).any():
            raise DamagedPatternsError(self.folder)
        return members

    def directions(self, star: Ints) -> Floats:
        """ICRS unit vectors (..., 3) of star numbers."""
        self.tell("stars", star)
        found = self.stars[star].astype(np.float64)
        if not (np.abs(np.einsum("...i,...i", found, found) - 1.0) < UNIT).all():
            raise DamagedPatternsError(self.folder)
        return np.asarray(found)

    def level_of(self, star: Ints) -> Ints:
        """Levels of star numbers."""
        return np.asarray(np.searchsorted(self.offsets, star, side="right") - 1)

    def near(self, level: int, centre: Floats, radius: float) -> Ints:
        """Star numbers of one level within ``radius`` rad of the unit vector ``centre``."""
        a, b = int(self.offsets[level]), int(self.offsets[level + 1])
        number = cone_rows(self.keys[a:b], int(self.zones[level]), centre, radius) + a
        dot = self.stars[number] @ centre.astype(np.float32)
        return np.asarray(number[dot >= np.cos(radius)])


def _window(
    target: Floats, margin: Floats, query: Ints, upper: NDArray[np.bool_]
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Lowest byte and width (N, 4) of what may match, for the lower and the upper cells (N, 4)."""
    lows, spans = [], []
    # seen from the upper of two cells, a place lies one cell, 256 units, lower
    for shift in (0.0, 256.0):
        # what is stored is up to FINENESS lower than it was
        low = np.minimum(np.maximum(target - (margin + shift + (FINENESS - 1)), 0.0), 255.0).astype(np.uint8)
        high = np.minimum(np.maximum(target + (margin - shift), 0.0), 255.0).astype(np.uint8)
        lows.append(low)
        spans.append(high - low)
    return (np.where(upper, lows[1][query], lows[0][query]), np.where(upper, spans[1][query], spans[0][query]))


def open_volume(folder: Path) -> Volume:
    """Open a volume, memory mapped; raises DamagedPatternsError when it is not all there."""
    try:
        volume = _read_volume(folder)
        sound = _is_consistent(volume)
    except (OSError, ValueError, LookupError, TypeError, AttributeError, ArithmeticError) as error:
        raise DamagedPatternsError(folder) from error
    if not sound:
        raise DamagedPatternsError(folder)
    return volume


def _read_volume(folder: Path) -> Volume:
    facts: dict[str, Any] = read_json(folder / "index.json")
    grid, offsets = Grid(int(facts["steps"])), np.array(facts["offsets"], dtype=np.int64)
    counts = dict.fromkeys(ARRAYS, int(facts["quads"]))
    counts |= dict.fromkeys(("stars", "rows", "keys"), int(offsets[-1])) | {"cells": grid.cells + 1}
    nearest = np.array(facts["nearest"], dtype=np.int64)
    counts["neighbours"] = int(first_neighbours(offsets, nearest)[-1])
    mapped = {name: _mapped(folder / f"{name}.npy", name, counts[name]) for name in ARRAYS}
    return Volume(
        grid,
        np.array(facts["fields_deg"], dtype=np.float64),
        offsets,
        np.array(facts["zones"], dtype=np.int64),
        **{name: array for name, (_, array) in mapped.items()},
        nearest=nearest,
        mark=str(facts.get("mark", "")),
        folder=folder,
        ahead={name: ReadAhead(mapped[name][0], mapped[name][1].strides[0]) for name in SCATTERED},
    )


def _mapped(path: Path, name: str, count: int) -> tuple[mmap.mmap, NDArray[Any]]:
    """A mapped file and the array of so many rows in it; ValueError when the file has another size."""
    dtype, row = ARRAYS[name]
    with path.open("rb") as file:
        mapped = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    array = np.frombuffer(mapped, dtype, offset=HEADER_BYTES)
    return mapped, array.reshape(count, *row)


def _is_consistent(volume: Volume) -> bool:
    """Whether levels and cells are what a build leaves: they say how all else is read."""
    if not (volume.fields_deg > 0.0).all():
        return False
    begin, zones = volume.offsets, [zones_of(field) for field in volume.fields_deg]
    middle = begin[1:-1]  # where the keys begin anew
    return bool(
        len(begin) == len(zones) + 1
        and begin[0] == 0
        and (np.diff(begin) > 0).all()
        and volume.zones.tolist() == zones
        and (volume.keys[middle] < volume.keys[middle - 1]).all()
        and volume.cells[-1] == len(volume.codes)
        and volume.nearest.min() >= 3
        and volume.nearest.max() <= MOST_NEAREST
    )


# -- The installation's volumes: three shipped ones and one for small fields, made once ---------
# ``wide``, ``coarse`` and ``small`` lie in ``catalogs/patterns`` and serve fields from about 1.2 degrees up.
# ``fine`` serves smaller ones; it is several times as large, so it is made from the shipped
# catalogue when first needed (:mod:`kochab.identification.index_build`) and kept in the user's cache.

FORMAT = 4
SHIPPED: dict[str, tuple[range, tuple[tuple[int, int], ...], int]] = {
    # name: levels, nearest stars taken at each (rich, poor sky), cells of code space
    "wide": (range(9, 15), ((6, 6),) * 6, 16),
    "coarse": (range(4, 11), ((4, 4), *((5, 5),) * 6), 24),
    "small": (range(2, 4), ((4, 4),) * 2, 28),
}
PER_FIELD = 30  # stars that a level has in a field of its size
LEVEL_FIELDS_DEG = tuple(float(0.5 * 2.0 ** (k / 2.0)) for k in range(1, 16))  # 0.71 ... 90.5


def shipped_volume_folder() -> Path:
    """Where the shipped volumes lie."""
    from kochab.sky import shipped_folder as catalogs

    return catalogs() / "patterns"


def fine_folder() -> Path:
    """Where the volume of small fields lies, or will; see :func:`fine_folders`."""
    return cache_folder() / f"patterns-{FORMAT}-{catalogue_mark()[:12]}"


def fine_folders() -> tuple[Path, Path]:
    """Where it may lie: Windows removes no folder whose files are mapped, and a damaged volume may be."""
    first = fine_folder()
    return first, first.with_name(f"{first.name}-again")


@lru_cache(maxsize=1)
def shipped() -> tuple[Volume, ...]:
    """The shipped volumes, ``wide`` first; raises CatalogueError when one is missing."""
    volumes = tuple(open_volume(shipped_volume_folder() / name) for name in SHIPPED)
    if any(volume.mark != catalogue_mark() for volume in volumes):
        raise CatalogueError("The shipped patterns belong to another catalogue: run kochab catalog build.")
    return tuple(_of_catalogue(volume) for volume in volumes)


def fine() -> Volume | None:
    """The volume of small fields when it has been made and is whole, else None."""
    for folder in fine_folders():
        with suppress(CatalogueError):  # it is made again
            if (folder / "index.json").exists():
                return _opened_fine(folder)
    return None


def drop_fine(folder: Path) -> bool:
    """Whether ``folder`` is that of the volume of small fields, which is then made anew."""
    if folder not in fine_folders():
        return False
    (folder / "index.json").unlink(missing_ok=True)
    _opened_fine.cache_clear()
    return True


@lru_cache(maxsize=2)
def _opened_fine(folder: Path) -> Volume:
    volume = open_volume(folder)
    if not is_shipped(volume):
        raise DamagedPatternsError(folder)
    return _of_catalogue(volume)


def _of_catalogue(volume: Volume) -> Volume:
    """The same; DamagedPatternsError when it names stars that the shipped catalogue lacks."""
    from kochab.sky import open_catalogue

    if int(volume.rows.max()) >= len(open_catalogue()):
        raise DamagedPatternsError(volume.folder)
    return volume


def is_shipped(volume: Volume) -> bool:
    """Whether the rows of ``volume`` are those of the shipped catalogue."""
    return volume.mark == catalogue_mark()


@lru_cache(maxsize=1)
def catalogue_mark() -> str:
    """The catalogue the patterns must belong to: its SHA-256 from the manifest."""
    from kochab.sky import shipped_folder as catalogs

    try:
        manifest = read_json(catalogs() / "manifest.json")
        return str(manifest["files"]["deep.kcat"]["sha256"])
    except (OSError, ValueError, KeyError) as error:
        raise CatalogueError("The catalogue's manifest is missing or damaged.") from error
