"""Solve a frame, or a list of star positions."""

import math
import re
from pathlib import Path
from time import perf_counter

import numpy as np

from kochab.core.errors import UsageError
from kochab.core.frame import Detections, Frame
from kochab.core.progress import Progress, Task
from kochab.core.solution import NoSolution, Solution
from kochab.core.values import frozen
from kochab.parsing.text_input import read_text
from kochab.solver import SolveOptions
from kochab.solver.pipeline import examine_frame, solve_detections
from kochab.text.translation import tr, tr_n


@frozen(eq=False)
class SolvedFrame:
    """A frame, its detections, and its solution or why there is none.

    ``detections`` is empty when the search was over before detection.
    """

    path: str
    frame: Frame
    detections: Detections
    result: Solution | NoSolution


def solve_file(path: str | Path, options: SolveOptions | None = None, number: int | None = None) -> Task[SolvedFrame]:
    """Read the file at ``path`` and solve it; of a video its frame ``number``, counted from 1, None for the first.

    Raises `FrameError` when the file cannot be read as a picture, and `UsageError` when the options name a method or
    detector that does not exist.
    """
    from kochab.frames import reading

    options = options or SolveOptions()
    start = perf_counter()
    yield Progress("read", 0.0, str(path))
    frame = yield from reading(path, options.timeout_s, number)
    return (yield from solve_open_frame(frame, options, read_ms=(perf_counter() - start) * 1e3))


def solve_open_frame(frame: Frame, options: SolveOptions | None = None, read_ms: float = 0.0) -> Task[SolvedFrame]:
    """Solve a frame already in memory; ``read_ms`` is what reading it had cost, for the record."""
    examined = yield from examine_frame(frame, options or SolveOptions(), read_ms=read_ms)
    return SolvedFrame(frame.path, frame, examined.detections, examined.result)


# -- Solve a list of star positions ------------------------------------------------------------


def solve_star_list(
    path: str | Path, width: int, height: int, options: SolveOptions | None = None
) -> Task[Solution | NoSolution]:
    """Read a list of stars and solve it.

    Raises UsageError when the list cannot be used; one sentence says why.

    Parameters
    ----------
    path : str or Path
        Of the list.
    width, height : int
        Size of its frame, px.
    options : SolveOptions or None
        How it is solved; None for the usual.
    """
    start = perf_counter()
    yield Progress("read", 0.0, str(path))
    stars = read_star_list(path, width, height)
    return (yield from solve_detections(stars, options, read_ms=(perf_counter() - start) * 1e3))


def read_star_list(path: str | Path, width: int, height: int) -> Detections:
    """Stars of a text file with ``x,y`` or ``x,y,flux`` a line, px and any unit of flux.

    Commas, semicolons, tabs and spaces part the columns; ``#`` starts a comment. A first line
    that is no number is a header: when it names ``x`` and ``y`` (and ``flux``) those columns are
    taken wherever they are. Without flux the list is brightest first. A star twice counts once.

    Raises UsageError when the file is missing, is no text, has no stars or wrong columns, or a star is outside
    the frame.
    """
    rows = _rows(Path(path))
    columns, rows = _columns(rows, Path(path).name)
    stars = []
    for number, cells in rows:
        stars.append(_star(cells, columns, tr("{path} line {number}", path=path, number=number)))
        _check_inside(stars[-1], width, height, tr("{path} line {number}", path=path, number=number))
    if not stars:
        raise UsageError("{path} has no stars.", path=path)
    return _detections(stars, width, height, str(path))


def _rows(path: Path) -> list[tuple[int, list[str]]]:
    """Line numbers and cells of every line that says something."""
    rows = []
    for number, line in enumerate(read_text(path).splitlines(), 1):
        line = line.split("#", 1)[0].strip()
        if line:
            parts = re.split(r"[,;]", line) if re.search(r"[,;]", line) else line.split()
            rows.append((number, [part.strip().strip("\"'") for part in parts]))
    return rows


def _columns(rows: list[tuple[int, list[str]]], name: str) -> tuple[list[int] | None, list[tuple[int, list[str]]]]:
    """Where x, y and flux stand when a header says so, and the rows without it."""
    if not rows or any(_number(cell) is not None for cell in rows[0][1]):
        return None, rows
    header = [cell.lower() for cell in rows[0][1]]
    if "x" not in header or "y" not in header:
        if len(header) <= 3:
            return None, rows[1:]
        raise UsageError("{name}: its header names no columns x and y.", name=name)
    return [header.index(key) for key in ("x", "y", "flux") if key in header], rows[1:]


def _star(cells: list[str], columns: list[int] | None, where: str) -> list[float]:
    if columns is None:
        if len(cells) not in (2, 3):
            count = tr_n("{n} column", "{n} columns", len(cells))
            raise UsageError("{where} has {count}; a star is x,y or x,y,flux.", where=where, count=count)
        picked = cells
    else:
        if len(cells) <= max(columns):
            raise UsageError("{where} has fewer columns than the header.", where=where)
        picked = [cells[i] for i in columns]
    numbers = [_number(cell) for cell in picked]
    for cell, value in zip(picked, numbers, strict=True):
        if value is None or not math.isfinite(value):
            raise UsageError("{where}: '{cell}' is not a number.", where=where, cell=cell[:40])
    return [value for value in numbers if value is not None]


def _number(cell: str) -> float | None:
    try:
        return float(cell)
    except ValueError:
        return None


def _check_inside(star: list[float], width: int, height: int, where: str) -> None:
    x, y = star[:2]
    if not (-1.0 <= x <= width and -1.0 <= y <= height):
        raise UsageError(
            "{where}: ({x:g}, {y:g}) is outside the {width} x {height} frame, whose first pixel is (0, "
            "0) at the top left.",
            where=where,
            x=x,
            y=y,
            width=width,
            height=height,
        )


def _detections(stars: list[list[float]], width: int, height: int, path: str) -> Detections:
    if len({len(star) for star in stars}) > 1:
        raise UsageError("{path}: some stars have a flux and some have none.", path=path)
    table = np.array(stars, dtype=np.float64)
    # unique sorts by place; the first occurrences restore the order, which is brightness where there is no flux
    _, first = np.unique(table[:, :2], axis=0, return_index=True)
    table = table[np.sort(first)]
    return Detections.from_list(table[:, :2], width, height, table[:, 2] if table.shape[1] == 3 else None)
