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

from app.core.errors import CatalogueError
from app.identify.zones import cone_rows, ranges

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ARRAYS = ("stars", "rows", "keys", "cells", "codes", "sizes", "quads")
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
    """One opened index; see the module's text. ``mark``: the catalogue's SHA-256."""

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
        start = self.cells[number].astype(np.int64)
        count = self.cells[number + 1].astype(np.int64) - start
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
        return np.asarray(raw @ BYTES24)

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
    """Open a volume, memory mapped; raises CatalogueError when it is absent or damaged."""
    try:
        return _opened(folder)
    except (OSError, ValueError, EOFError, LookupError, TypeError, AttributeError) as error:
        raise CatalogueError(
            f"The patterns in {folder} are missing or damaged and cannot be opened: install Kochab"
            " again."
        ) from error


def _opened(folder: Path) -> Volume:
    facts: dict[str, Any] = json.loads((folder / "index.json").read_text("utf-8"))
    arrays = {n: np.load(folder / f"{n}.npy", mmap_mode="r") for n in ARRAYS}
    if int(arrays["cells"][-1]) != len(arrays["codes"]):
        raise ValueError("cut short")
    plain = {n: a.view(np.ndarray) for n, a in arrays.items()}
    return Volume(
        Grid(int(facts["steps"])),
        np.array(facts["fields_deg"]),
        np.array(facts["offsets"]),
        np.array(facts["zones"]),
        **plain,
        mark=str(facts.get("mark", "")),
    )
