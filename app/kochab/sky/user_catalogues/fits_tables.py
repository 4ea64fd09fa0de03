"""The binary tables of a FITS file as mapped arrays: nothing is read but the headers."""

import mmap
import re
from collections.abc import Iterator
from dataclasses import field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kochab.core.errors import CatalogueError
from kochab.core.values import frozen

BLOCK, CARD = 2880, 80
MOST_CARDS = 36 * 400
MOST_TABLES, MOST_COLUMNS = 200, 999
"""FITS allows 999 columns; index files have 15 tables, of the headers most is history."""
TYPES = {"L": "u1", "B": "u1", "I": ">i2", "J": ">i4", "K": ">i8", "E": ">f4", "D": ">f8", "A": "S"}
_FORM = re.compile(r"(\d*)([A-Z])")

Header = dict[str, str]
"""Values as they are written, without quotes."""


@frozen(eq=False)
class FitsTable:
    """One binary table: its ``header``, and columns as views of the mapped file (rows, or rows x repeat)."""

    header: Header
    data: NDArray[np.void] = field(repr=False)

    @property
    def names(self) -> tuple[str, ...]:
        """The columns' names."""
        return self.data.dtype.names or ()

    def column(self, name: str) -> NDArray[Any]:
        """One column; nothing is copied."""
        return self.data[name]

    def raw(self, dtype: str, width: int = 1) -> NDArray[Any]:
        """The rows of a table of bare bytes, as (N,) or (N, ``width``) numbers of ``dtype``."""
        flat = np.frombuffer(self.data, np.uint8).view(dtype)
        return flat if width == 1 else flat.reshape(-1, width)


@frozen(eq=False)
class FitsTables:
    """The primary header and the binary tables of a file."""

    primary: Header
    tables: tuple[FitsTable, ...]

    def named(self, column: str) -> FitsTable | None:
        """The first table that has the column ``column``, whatever its case."""
        wanted = column.lower()
        return next((t for t in self.tables if wanted in (n.lower() for n in t.names)), None)


def map_tables(path: Path) -> FitsTables:
    """The tables of the file at ``path``; `CatalogueError`, one sentence, when it is no whole FITS file of them."""
    try:
        with path.open("rb") as file:
            mapped = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        found = list(_units(mapped))
    except KeyError as error:
        card = error.args[0]
        raise CatalogueError(
            "{name} is not a FITS file of tables: it lacks {card}.", name=path.name, card=card
        ) from error
    except (OSError, ValueError, TypeError, OverflowError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise CatalogueError("{name} is not a FITS file of tables ({why}).", name=path.name, why=why) from error
    return FitsTables(found[0][0], tuple(FitsTable(h, data) for h, data in found[1:] if data is not None))


def primary_header(path: Path) -> Header:
    """The first header of a file, and nothing else of it; `CatalogueError` when it is no FITS file."""
    try:
        with path.open("rb") as file:
            mapped = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        return _header(mapped, 0, first=True)[0]
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise CatalogueError("{name} is not a FITS file of tables ({why}).", name=path.name, why=why) from error


def _units(mapped: mmap.mmap) -> Iterator[tuple[Header, NDArray[np.void] | None]]:
    """The header of every part of the file, and its table where it is one."""
    at = 0
    for count in range(MOST_TABLES):
        if at >= len(mapped):
            return
        header, at = _header(mapped, at, first=count == 0)
        size = 1 if int(header.get("NAXIS", "0")) else 0
        for axis in range(1, _limited(header.get("NAXIS", "0"), 9) + 1):
            size *= int(header[f"NAXIS{axis}"])
        size = (size + int(header.get("PCOUNT", "0"))) * abs(int(header.get("BITPIX", "8"))) // 8
        if size < 0 or at + size > len(mapped):
            raise ValueError("it is cut short")
        yield header, _table(mapped, at, header) if header.get("XTENSION", "").strip() == "BINTABLE" else None
        at += -(-size // BLOCK) * BLOCK


def _header(mapped: mmap.mmap, at: int, first: bool) -> tuple[Header, int]:
    """A header's values, and where its data begin."""
    if mapped[at : at + 9] != (b"SIMPLE  =" if first else b"XTENSION="):
        raise ValueError("it is not FITS" if first else "it is damaged")
    out: Header = {}
    for n in range(MOST_CARDS):
        card = mapped[at + n * CARD : at + (n + 1) * CARD]
        if len(card) < CARD:
            break
        key = card[:8].rstrip()
        if key == b"END":
            return out, at + -(-(n + 1) * CARD // BLOCK) * BLOCK
        if card[8:10] == b"= ":
            text = card[10:].decode("ascii")
            quoted = re.match(r"\s*'((?:[^']|'')*)'", text)
            out[key.decode("ascii")] = quoted[1].strip() if quoted else text.split("/", 1)[0].strip()
    raise ValueError("its header does not end")


def _table(mapped: mmap.mmap, at: int, header: Header) -> NDArray[np.void]:
    width, rows = int(header["NAXIS1"]), int(header["NAXIS2"])
    names, formats, offsets, offset = [], [], [], 0
    for k in range(1, _limited(header["TFIELDS"], MOST_COLUMNS) + 1):
        form = _FORM.match(header[f"TFORM{k}"])
        if form is None:
            raise ValueError(f"its column {k} has no form")
        repeat, kind = int(form[1] or 1), form[2]
        one = np.dtype(TYPES.get(kind, "V1"))
        size = {"X": (repeat + 7) // 8, "C": 8 * repeat, "M": 16 * repeat, "P": 8 * repeat, "Q": 16 * repeat}.get(
            kind, repeat * max(one.itemsize, 1)
        )
        if kind in TYPES and kind != "A" and repeat == 1:
            form_of: Any = one
        elif kind in TYPES and kind != "A" and repeat:
            form_of = (one, (repeat,))
        else:
            form_of = f"V{size}"
        if size:
            names.append(header.get(f"TTYPE{k}", f"column {k}"))
            formats.append(form_of)
            offsets.append(offset)
        offset += size
    if offset > width or rows < 0 or width < 0:
        raise ValueError("its columns do not fit its rows")
    if not names or not width:
        names, formats, offsets, width, rows = ["nothing"], ["V1"], [0], 1, 0
    row = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": width})
    return np.frombuffer(mapped, row, rows, at)


def _limited(text: str, most: int) -> int:
    """A count of a header; ValueError when FITS does not allow so many."""
    count = int(text)
    if not 0 <= count <= most:
        raise ValueError("it has more axes or columns than FITS allows")
    return count
