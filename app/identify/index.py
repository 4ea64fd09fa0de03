"""The pattern index: quads of catalogue stars, found by their shape, in memory-mapped arrays.

A volume is a folder of plain ``.npy`` files that covers several levels of field size:

``stars`` (n, 3) float32 ICRS unit vectors, level after level, each level sorted by zone key ·
``rows`` (n,) uint32 catalogue rows · ``keys`` (n,) uint32 zone keys · ``cells`` (c + 1,) uint32
first quad of each code cell · ``codes`` (Q,) uint32, four bytes: place of the code within its cell
in 1/256 of a cell · ``sizes`` (Q,) uint8 the base's length, see :func:`size_code` · ``quads``
(Q, 12) uint8: four star numbers of 24 bits, in the order A, B, C, D. Parity is not stored: it is
seen from the stars themselves.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.core.errors import DamagedPatternsError
from app.identify.zones import cone_rows, ranges, zones_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ARRAYS: dict[str, tuple[str, tuple[int, ...]]] = {  # as they are stored, and the shape of a row
    "stars": ("<f4", (3,)), "rows": ("<u4", ()), "keys": ("<u4", ()), "cells": ("<u4", ()),
    "codes": ("<u4", ()), "sizes": ("|u1", ()), "quads": ("|u1", (12,)),
}  # fmt: skip
HEADER_BYTES = 128  # of an ``.npy`` file; what it tells is known from the volume's facts
UNIT = 1e-5  # how far from one the square of a stored unit vector may be
MOST_IN_CELL = 1 << 16  # a hundred times what any cell holds
ALL_FOUR = np.uint32(0x01010101)  # four true bytes
CORNERS = (np.arange(16)[:, None] >> np.arange(4) & 1).astype(bool)
BYTES24 = np.array([1, 1 << 8, 1 << 16], dtype=np.int64)
IM_REACH = 0.875  # |Im z| never exceeds sqrt(3)/2 while the base is the longest side
SIZE_MIN_RAD, SIZE_STEPS = 1e-4, 127.0  # base length from 20 arcsec to pi rad in 127 steps
SIZE_LOG = float(np.log(np.pi / SIZE_MIN_RAD))


def size_code(base_rad: Floats) -> NDArray[np.uint8]:
    """Base lengths (rad) in logarithmic steps of 8.5 %, 7 bits."""
    s = np.log(np.maximum(base_rad, SIZE_MIN_RAD) / SIZE_MIN_RAD) / SIZE_LOG * SIZE_STEPS
    return np.clip(np.floor(s), 0, SIZE_STEPS).astype(np.uint8)


@dataclass(frozen=True, slots=True)
class Grid:
    """How code space is cut: ``steps`` cells over [0, 1] of the real parts."""

    steps: int

    @property
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
        return np.asarray((code + np.array([0.0, 0.0, IM_REACH, IM_REACH])) * self.steps)

    def number(self, cell: Ints) -> Ints:
        """Flat cell numbers of integer cells (Q, 4), which are clipped into the grid."""
        return np.asarray(np.clip(cell, 0, np.array(self.shape) - 1) @ self.strides)

    @property
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
        last = np.array(self.shape) - 1
        low = np.clip(np.floor(place - reach).astype(np.int64), 0, last)
        high = np.clip(np.floor(place + reach).astype(np.int64), 0, last)
        bits = CORNERS.T.astype(np.int64)
        differs = high > low
        number = (low @ self.strides)[:, None] + (differs * self.strides) @ bits
        query, corner = np.nonzero((~differs).astype(np.int64) @ bits == 0)
        return query, corner, number[query, corner], low


@dataclass(frozen=True, slots=True, eq=False)
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
    cells: NDArray[np.uint32]
    codes: NDArray[np.uint32]
    sizes: NDArray[np.uint8]
    quads: NDArray[np.uint8]
    mark: str = ""
    folder: Path = Path()

    @property
    def span_deg(self) -> tuple[float, float]:
        """The smallest and the largest field its levels are made for."""
        return float(self.fields_deg[0]), float(self.fields_deg[-1])

    def lookup(self, code: Floats, tolerance: Floats, size: Floats) -> tuple[Ints, Ints]:
        """Quads whose code lies within ``tolerance`` (Q,) of ``code`` (Q, 4) in every number.

        ``size`` (Q, 2) limits the base's length in rad. Returns (query, quad) row pairs.
        """
        place = self.grid.scaled(code)
        reach = np.minimum(tolerance * self.grid.steps, 0.499)[:, None]
        query, corner, number, low = self.grid.around(place, reach)
        start, end = (self.cells[n].astype(np.int64) for n in (number, number + 1))
        count = end - start
        if max(count.max(initial=0) - MOST_IN_CELL, end.max(initial=0) - len(self.codes)) > 0:
            raise DamagedPatternsError(self.folder)
        kept = count > 0
        query, corner, start, count = query[kept], corner[kept], start[kept], count[kept]
        entry = ranges(start, count)
        # compare in 1/256 of a cell, where the stored numbers live: four bytes at a time, and
        # "between low and high" as one unsigned subtraction that wraps below low
        target = np.floor((place - low) * 256.0)
        low8, span8 = _window(target, np.ceil(reach * 256.0), query, CORNERS[corner])
        found = self.codes[entry].view(np.uint8).reshape(-1, 4)
        found -= np.repeat(low8.view(np.uint32).ravel(), count).view(np.uint8).reshape(-1, 4)
        within = found <= np.repeat(span8.view(np.uint32).ravel(), count).view(np.uint8).reshape(
            -1, 4
        )
        good = np.nonzero(within.view(np.uint32).ravel() == ALL_FOUR)[0]
        query, entry = np.repeat(query, count)[good], entry[good]
        length = self.sizes[entry]
        fits = (length >= size_code(size[:, 0])[query]) & (length <= size_code(size[:, 1])[query])
        return query[fits], entry[fits]

    def members(self, quad: Ints) -> Ints:
        """Star numbers (Q, 4) of quads, as A, B, C, D."""
        raw = self.quads[quad].reshape(-1, 4, 3).astype(np.int64)
        members = np.asarray(raw @ BYTES24)
        if members.max(initial=0) >= len(self.stars) or (members[:, 0] == members[:, 1]).any():
            raise DamagedPatternsError(self.folder)
        return members

    def directions(self, star: Ints) -> Floats:
        """ICRS unit vectors (..., 3) of star numbers."""
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
    for shift in (0.0, 256.0):
        low = np.minimum(np.maximum(target - (margin + shift), 0.0), 255.0).astype(np.uint8)
        high = np.minimum(np.maximum(target + (margin - shift), 0.0), 255.0).astype(np.uint8)
        lows.append(low)
        spans.append(high - low)
    return (
        np.where(upper, lows[1][query], lows[0][query]),
        np.where(upper, spans[1][query], spans[0][query]),
    )


def open_volume(folder: Path) -> Volume:
    """Open a volume, memory mapped; raises DamagedPatternsError when it is not all there."""
    try:
        volume = _opened(folder)
        sound = _hangs_together(volume)
    except (OSError, ValueError, LookupError, TypeError, AttributeError, ArithmeticError) as error:
        raise DamagedPatternsError(folder) from error
    if not sound:
        raise DamagedPatternsError(folder)
    return volume


def _opened(folder: Path) -> Volume:
    facts: dict[str, Any] = json.loads((folder / "index.json").read_text("utf-8"))
    grid, offsets = Grid(int(facts["steps"])), np.array(facts["offsets"], dtype=np.int64)
    counts = dict.fromkeys(ARRAYS, int(facts["quads"]))
    counts |= dict.fromkeys(("stars", "rows", "keys"), int(offsets[-1])) | {"cells": grid.cells + 1}
    return Volume(
        grid,
        np.array(facts["fields_deg"], dtype=np.float64),
        offsets,
        np.array(facts["zones"], dtype=np.int64),
        **{name: _mapped(folder / f"{name}.npy", name, counts[name]) for name in ARRAYS},
        mark=str(facts.get("mark", "")),
        folder=folder,
    )


def _mapped(path: Path, name: str, count: int) -> NDArray[Any]:
    """An array of so many rows; ValueError when the file has another size."""
    dtype, row = ARRAYS[name]
    array = np.memmap(path, dtype, "r", HEADER_BYTES, (count, *row))
    if path.stat().st_size != HEADER_BYTES + array.nbytes:
        raise ValueError(f"{path} has another size")
    return array.view(np.ndarray)


def _hangs_together(volume: Volume) -> bool:
    """Whether levels and cells are what a build leaves: they say how all else is read."""
    begin, zones = volume.offsets, [zones_of(field) for field in volume.fields_deg]
    middle = begin[1:-1]  # where the keys begin anew
    return bool(
        len(begin) == len(zones) + 1
        and begin[0] == 0
        and (np.diff(begin) > 0).all()
        and volume.zones.tolist() == zones
        and (volume.keys[middle] < volume.keys[middle - 1]).all()
        and volume.cells[-1] == len(volume.codes)
    )
