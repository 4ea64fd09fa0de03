"""The small tables beside the stars: deep-sky objects and the figures of the constellations."""

import sqlite3
from pathlib import Path

import numpy as np

from app.core.errors import CatalogueError
from app.sky.objects import COLUMNS


def write_objects(database: Path, path: Path) -> int:
    """Export OpenNGC's objects as text and return how many; duplicates and gaps are left out."""
    query = (
        "select name, type, ra, dec, coalesce(vmag, bmag), majax, messier, commonnames"
        " from objects where ra is not null and type not in ('Dup', 'NonEx') order by name"
    )
    try:
        connection = sqlite3.connect(f"file:{database}?mode=ro", uri=True)
        try:
            rows = connection.execute(query).fetchall()
        finally:
            connection.close()
    except sqlite3.Error as error:
        raise CatalogueError(f"{database.name} cannot be read: {error}.") from error
    lines = [COLUMNS]
    for name, kind, ra, dec, mag, size, messier, common in rows:
        place = f"{np.degrees(ra):.5f}\t{np.degrees(dec):.5f}"
        number = f"{_number(mag)}\t{_number(size)}"
        messier = f"M{int(messier)}" if messier else ""
        lines.append(f"{_short(name)}\t{kind}\t{place}\t{number}\t{messier}\t{common or ''}")
    path.write_text("\n".join(lines) + "\n", "utf-8", newline="\n")
    return len(rows)


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}".rstrip("0").rstrip(".")


def _short(name: str) -> str:
    """``NGC0224`` as ``NGC 224``; other names as they are."""
    for prefix in ("NGC", "IC"):
        rest = name.removeprefix(prefix)
        if rest != name and rest[:4].isdecimal():
            return f"{prefix} {int(rest[:4])}{rest[4:]}"
    return name


def write_lines(figures: Path, path: Path) -> int:
    """Write the constellations' figures as chains of HIP numbers; returns how many segments.

    The source counts segments and gives two stars for each; following ones that touch are
    written as one chain.
    """
    out = ["constellation\thip"]
    segments = 0
    for line in figures.read_text("utf-8").splitlines():
        cells = line.split()
        if len(cells) < 4 or line.startswith("#"):
            continue
        stars = [int(c) for c in cells[2:]]
        chain: list[int] = []
        for a, b in zip(stars[::2], stars[1::2], strict=True):
            segments += 1
            if chain and chain[-1] == a:
                chain.append(b)
                continue
            if chain:
                out.append(f"{cells[0]}\t{' '.join(map(str, chain))}")
            chain = [a, b]
        out.append(f"{cells[0]}\t{' '.join(map(str, chain))}")
    path.write_text("\n".join(out) + "\n", "utf-8", newline="\n")
    return segments
