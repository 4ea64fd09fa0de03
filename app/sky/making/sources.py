"""What the catalogue is made of, as arrays: the package files read and nothing decided yet."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.core.errors import CatalogueError
from app.sky.making.stellarium import ZoneStars, read_stars
from app.sky.making.tycho import read_index

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Listed:
    """The independent list: ``hip`` (M,), ``vector`` (M, 3) at 2024.0, ``mag`` (M,) V."""

    hip: Ints
    vector: Floats
    mag: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Sources:
    """All that is known before merging.

    ``stars`` Stellarium's; ``hip_pm`` {HIP: (pmRA*, pmDE)} mas/yr as arrays ``pm_hip`` (K,) and
    ``pm`` (K, 2); ``tycho`` (T, 3) vectors with ``vt`` (T,); ``cross`` {HIP: (SAO, HD, HR)};
    ``names`` {HIP: (name, designation, other names)}.
    """

    stars: ZoneStars
    pm_hip: Ints
    pm: Floats
    tycho: Floats
    vt: Floats
    listed: Listed
    cross: dict[int, tuple[int, int, int]]
    names: dict[int, tuple[str, str, list[str]]]


def find_file(folder: Path, pattern: str) -> Path:
    """The one file below ``folder`` matching ``pattern``; the first by name if several."""
    found = sorted(folder.rglob(pattern))
    if not found:
        raise CatalogueError(f"The sources in {folder} lack {pattern}.")
    return found[0]


def source_files(folder: Path) -> list[Path]:
    """The files below ``folder`` that the catalogue is made of."""
    names = (
        "index-tycho2-07.littleendian.fits", "hip_pm.dat", "cross-id.dat", "name.fab",
        "gcvs_hip_part.dat", "default_database.npz", "ongc.db", "western/star_names.fab",
        "western/constellationship.fab",
    )  # fmt: skip
    stars = sorted(folder.rglob("stars_[0-3]_*.cat"))
    return stars + [find_file(folder, name) for name in names]


def read_sources(folder: Path) -> Sources:
    """Read every source below ``folder``, wherever the packages put them."""
    parts = [read_stars(p) for p in sorted(folder.rglob("stars_[0-3]_*.cat"))]
    if not parts:
        raise CatalogueError(f"The sources in {folder} lack Stellarium's stars_*.cat.")
    home = find_file(folder, "stars_0_*.cat").parent
    index = read_index(find_file(folder, "index-tycho2-07.littleendian.fits"))
    pm_hip, pm = _motions(home / "hip_pm.dat")
    return Sources(
        ZoneStars.joined(parts),
        pm_hip,
        pm,
        index.vector,
        index.columns["MAG_VT"].astype(np.float64),
        _listed(find_file(folder, "default_database.npz")),
        _cross(home / "cross-id.dat"),
        _names(home, find_file(folder, "western/star_names.fab")),
    )


def _listed(path: Path) -> Listed:
    with np.load(path) as data:
        table = data["star_table"].astype(np.float64)
        hip = data["star_catalog_IDs"].astype(np.int64)
    ra, dec = table[:, 0], table[:, 1]
    place = [np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)]
    return Listed(hip, np.stack(place, axis=1), table[:, 5])


def _lines(path: Path) -> Iterator[str]:
    """Lines of a text table, without comments and blanks."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise CatalogueError(f"{path} cannot be read: {error.strerror}.") from error
    return (line for line in text.splitlines() if line.strip() and not line.startswith("#"))


def _motions(path: Path) -> tuple[Ints, Floats]:
    rows = np.array([line.split()[:3] for line in _lines(path)], dtype=np.float64)
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    return rows[:, 0].astype(np.int64), rows[:, 1:]


def _cross(path: Path) -> dict[int, tuple[int, int, int]]:
    """HIP -> (SAO, HD, HR), 0 where there is none; the first line of a star counts.

    Columns: HIP, component, SAO, HD, HR.
    """
    table: dict[int, tuple[int, int, int]] = {}
    for line in _lines(path):
        cells = [int(re.sub(r"\D.*", "", c) or 0) for c in (line + "\t" * 4).split("\t")[:5]]
        old = table.get(cells[0], (0, 0, 0))
        table[cells[0]] = (old[0] or cells[2], old[1] or cells[3], old[2] or cells[4])
    table.pop(0, None)
    return table


def _names(home: Path, western: Path) -> dict[int, tuple[str, str, list[str]]]:
    """HIP -> (star name, designation, other names): the first name given, Bayer before Flamsteed.

    Names of variable stars come last, as "R And".
    """
    proper: dict[int, list[str]] = {}
    for hip, rest in _named(western):
        found = re.search(r'_\("(.+?)"\)', rest)
        if found:
            proper.setdefault(hip, []).append(found[1].strip())
    given: dict[int, list[str]] = {}
    for hip, rest in _named(home / "name.fab"):
        given.setdefault(hip, []).append(rest.replace("_", " "))
    for line in _lines(home / "gcvs_hip_part.dat"):
        cells = line.split("\t")
        if cells[0].isdecimal() and len(cells) > 1:
            given.setdefault(int(cells[0]), []).append(cells[1].strip())
    table = {}
    for hip in sorted(proper.keys() | given.keys()):
        first, second = proper.get(hip, [""]), given.get(hip, [""])
        also = dict.fromkeys([*first[1:], *second[1:]])
        table[hip] = (first[0], second[0], [n for n in also if n not in (first[0], second[0])])
    return table


def _named(path: Path) -> Iterator[tuple[int, str]]:
    """(HIP, text) of lines such as ``677|α_And``."""
    for line in _lines(path):
        hip, _, rest = line.partition("|")
        if hip.strip().isdecimal() and rest.strip():
            yield int(hip), rest.strip()
