"""Sorting the quads of a volume by cell on the disk: in memory they would need two gigabytes.

As they are made they go to one file for each 65,536 cells, in the order they came. File by file they
are then sorted by the cell's last two bytes and appended to the volume, and the file is removed:
beside the volume the disk holds what is not yet in it.
"""

import os
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import IO, Self

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Ints
from kochab.core.progress import Progress, Task
from kochab.identification.index import ARRAYS

LOW_BITS = 16  # of so many numpy sorts by counting, which is ten times as fast
RECORD = np.dtype([("cell", "<u2"), ("codes", "<u4"), ("quads", "<u4")])
STORED = ("codes", "quads")


class QuadSort:
    """Takes quads in any order and writes them sorted by cell, those of a cell in the order they came.

    A context: its scratch files, in ``folder``, are removed at its end, but for a build that is cancelled: the next
    one goes on from there, with the ``sizes`` and ``quads`` of then. ``cells`` is how many there are.
    """

    def __init__(self, folder: Path, cells: int, sizes: Sequence[int] = (), quads: int = 0) -> None:
        self.cells = cells
        self.quads = quads
        self._sizes = sizes
        self._paths = [folder / f"quads-{k}.part" for k in range(((cells - 1) >> LOW_BITS) + 1)]
        self._files: list[IO[bytes]] = []

    def __enter__(self) -> Self:
        with ExitStack() as opened:
            mode = "r+b" if self._sizes else "w+b"
            self._files = [opened.enter_context(path.open(mode)) for path in self._paths]
            for file, size in zip(self._files, self._sizes, strict=False):
                file.truncate(size)
                file.seek(size)
            opened.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for file, path in zip(self._files, self._paths, strict=True):
            file.close()
            # a cancelled task ends by GeneratorExit, which is no Exception: its files stay for the next build
            if kind is None or issubclass(kind, Exception):
                path.unlink(missing_ok=True)

    def kept(self) -> list[int]:
        """The sizes of the scratch files, all of which is on the disk."""
        for file in self._files:
            file.flush()
            os.fsync(file.fileno())
        return [file.tell() for file in self._files]

    def add(self, cell: Ints, codes: NDArray[np.uint32], quads: NDArray[np.uint32]) -> None:
        """Take grid cells, codes and quads (Q,), as a volume stores them."""
        high = (cell >> LOW_BITS).astype(np.uint16)
        order = np.argsort(high, kind="stable")
        record = np.empty(len(cell), dtype=RECORD)
        record["cell"] = (cell & ((1 << LOW_BITS) - 1))[order]
        record["codes"], record["quads"] = codes[order], quads[order]
        edges = np.searchsorted(high[order], np.arange(len(self._files) + 1))
        for k in np.flatnonzero(np.diff(edges)).tolist():
            self._files[k].write(record[edges[k] : edges[k + 1]].data)
        self.quads += len(cell)

    def write(self, folder: Path) -> Task[None]:
        """Write ``cells``, ``codes`` and ``quads`` of the volume in ``folder``."""
        start = np.zeros(self.cells + 1, dtype=np.uint32)
        with ExitStack() as opened:
            out = {name: opened.enter_context((folder / f"{name}.npy").open("wb")) for name in STORED}
            for name, file in out.items():
                write_header(file, name, self.quads)
            for k, (scratch, path) in enumerate(zip(self._files, self._paths, strict=True)):
                yield Progress("patterns", 0.85 + 0.15 * (k + 1) / len(self._files), "writing")
                scratch.close()
                record = np.fromfile(path, dtype=RECORD)
                path.unlink()
                low = k << LOW_BITS
                # the last file has fewer cells than the others
                here = np.bincount(record["cell"], minlength=1 << LOW_BITS)[: self.cells - low]
                # counts, one place on: their running sum is where each cell begins
                start[1 + low : 1 + low + len(here)] = here
                order = np.argsort(record["cell"], kind="stable")
                for name in STORED:
                    out[name].write(record[name][order].data)
        np.cumsum(start, out=start)
        np.save(folder / "cells.npy", start)


def write_header(file: IO[bytes], name: str, rows: int) -> None:
    """Begin a ``.npy`` file of so many rows."""
    dtype, row = ARRAYS[name]
    facts = np.lib.format.header_data_from_array_1_0(np.empty((0, *row), dtype=dtype))
    np.lib.format.write_array_header_1_0(file, {**facts, "shape": (rows, *row)})
