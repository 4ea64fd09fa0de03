"""Orbital elements from files: JPL's Small-Body Database (JSON, CSV), the Minor Planet Center's lines, satellites'."""

import csv
import math
from collections.abc import Iterator, Mapping
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kochab.core.errors import CatalogueError
from kochab.folders import config_folder
from kochab.parsing.text_input import TextError, parse_json, read_text
from kochab.sky.catalogue_file import write_whole
from kochab.sky.ephemeris import GM
from kochab.sky.orbits import state_at_perihelion, two_body
from kochab.sky.small_bodies import LEAST_K1, USUAL_K1, SmallBodies

if TYPE_CHECKING:
    from kochab.sky.satellites import Satellites

Row = Mapping[str, Any]
MJD = 2400000.5
USUAL_SLOPE = 0.15
UNSEEN = 99.0  # the magnitude of bodies that have none: lost ones, fragments of comets

NEEDED = "name, epoch, q or a, e, i, node, peri, tp or ma, H or M1"
ALIASES = {  # what the Small-Body Database calls them
    "name": ("full_name", "pdes", "name"),
    "epoch_mjd": ("epoch_mjd", "epoch.mjd"),
    "tp": ("tp", "tp_jd"),
    "node": ("om", "node"),
    "peri": ("w", "peri"),
}


def read_elements(path: Path) -> "SmallBodies | Satellites":
    """The bodies of a file of elements, whichever of the known forms it has: on the ecliptic of J2000, or satellites'.

    CatalogueError with one sentence, the first bad line named, when one of them cannot be read.
    """
    try:
        text = read_text(path)
    except TextError:
        raise CatalogueError("Can't read {name}: not a text file of orbital elements.", name=path.name) from None
    from kochab.sky.satellites import are_satellites, read_satellites

    if are_satellites(text):
        return read_satellites(path.name, text)
    rows: list[Row] = []
    for where, read in _lines(path, text):
        try:
            rows.append(read())
        except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError):
            raise CatalogueError(
                "Can't read {name}: {where} has no usable elements ({needed}).",
                name=path.name,
                where=where,
                needed=NEEDED,
            ) from None
    if not rows:
        raise CatalogueError("Can't read {name}: it has no orbital elements.", name=path.name)
    return bodies_of(rows)


ENDINGS = (".tle", ".2le", ".3le", ".txt", ".dat", ".csv", ".json")
"""What files of elements are called."""


def keep_elements(path: Path) -> None:
    """Keep a file of elements among the user's; CatalogueError, and the file before stays, when it is none."""
    read_elements(path)
    folder = config_folder() / "elements"
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(folder / path.name, [path.read_bytes()])


def kept_elements() -> "list[SmallBodies | Satellites]":
    """The bodies of the files that the user keeps, the newest first; one that can't be read is left out."""
    files = [(path.stat().st_mtime_ns, path) for path in (config_folder() / "elements").glob("*.*")]
    tables = (
        _kept(path, changed_ns) for changed_ns, path in sorted(files, reverse=True) if path.suffix.lower() in ENDINGS
    )
    return [table for table in tables if table is not None]


@lru_cache(maxsize=32)
def _kept(path: Path, changed_ns: int) -> "SmallBodies | Satellites | None":
    try:
        return read_elements(path)
    except CatalogueError:
        return None


def _lines(path: Path, text: str) -> Iterator[tuple[str, Any]]:
    """Where each body stands in a file, and how to read it."""
    if text.lstrip().startswith("{"):
        for k, given in enumerate(sbdb_json(path, text)):
            yield f"entry {k + 1}", lambda given=given: sbdb_row(given, UNSEEN)
        return
    lines = text.splitlines()
    if lines and {"e", "i"} <= {cell.strip() for cell in lines[0].split(",")}:
        for number, given in enumerate(csv.DictReader(lines, skipinitialspace=True), 2):
            yield f"line {number}", lambda given=given: sbdb_row(given, UNSEEN)
        return
    begin = next((k + 1 for k, line in enumerate(lines) if line.startswith("-----")), 0)  # after MPCORB's preface
    for number, line in enumerate(lines[begin:], begin + 1):
        if line.strip():
            # A comet has the year of its perihelion there, an asteroid G with its point, or blanks.
            read = mpc_comet if line[14:18].isdigit() else mpc_asteroid
            yield f"line {number}", partial(read, line)


def sbdb_json(path: Path, text: str) -> list[dict[str, Any]]:
    """The entries of an answer of JPL's Small-Body Database query."""
    try:
        answer = parse_json(text)
        return [dict(zip(answer["fields"], row, strict=True)) for row in answer["data"]]
    except (ValueError, KeyError, TypeError):
        raise CatalogueError("Can't read {name}: no answer of JPL's Small-Body Database.", name=path.name) from None


def sbdb_row(given: Mapping[str, Any], faintest: float | str = "") -> Row:
    """An entry of the Small-Body Database, ``faintest`` where it has no magnitude; ValueError or KeyError."""
    known = {key: next((given[name] for name in names if given.get(name)), None) for key, names in ALIASES.items()}
    cells = {**given, **known}
    e = float(cells["e"])
    q = float(cells["q"]) if cells.get("q") else float(cells["a"]) * (1.0 - e)
    epoch = float(cells["epoch_mjd"]) + MJD if cells["epoch_mjd"] else float(cells["epoch"])
    tp = float(cells["tp"]) if cells["tp"] else perihelion_jd(epoch, float(cells["ma"]), q, e)
    comet = bool(cells.get("M1"))
    slope = comet_slope(cells.get("K1")) if comet else float(cells.get("G") or USUAL_SLOPE)
    angles = {key: float(cells[key]) for key in ("i", "node", "peri")}
    magnitude = float((cells["M1"] if comet else cells["H"]) or faintest)  # no number is a ValueError
    return _row(name=short_name(cells["name"]), epoch=epoch, q=q, e=e, tp=tp, mag=magnitude, slope=slope, **angles)


def mpc_asteroid(line: str) -> Row:
    """A line of MPCORB (minorplanetcenter.net/iau/info/MPOrbitFormat.html)."""
    packed, a = line[20:25], float(line[92:103])
    # packed dates: I, J, K are the centuries 18, 19, 20; month and day 1 to 9, then A to V (31)
    year = 100 * "IJK".index(packed[0]) + 1800 + int(packed[1:3])
    epoch = julian_date(year, int(packed[3], 36), int(packed[4], 36))
    e = float(line[70:79])
    name = line[166:194].strip() or line[:7].strip()
    number, _, rest = name.partition(")")
    angles = {"peri": float(line[37:46]), "node": float(line[48:57]), "i": float(line[59:68])}
    tp = perihelion_jd(epoch, float(line[26:35]), a * (1.0 - e), e)
    magnitude, slope = float(line[8:13].strip() or UNSEEN), float(line[14:19].strip() or USUAL_SLOPE)
    designation = f"{number[1:]}{rest}" if name.startswith("(") else name
    return _row(name=designation, epoch=epoch, q=a * (1.0 - e), e=e, tp=tp, mag=magnitude, slope=slope, **angles)


def mpc_comet(line: str) -> Row:
    """A line of the MPC's comet elements (minorplanetcenter.net/iau/info/CometOrbitFormat.html)."""
    tp = julian_date(int(line[14:18]), int(line[19:21]), float(line[22:29]))
    epoch = julian_date(int(line[81:85]), int(line[85:87]), int(line[87:89])) if line[81:89].strip() else tp
    angles = {"peri": float(line[51:59]), "node": float(line[61:69]), "i": float(line[71:79])}
    q, e, magnitude = float(line[30:39]), float(line[41:49]), float(line[91:95].strip() or UNSEEN)
    slope = comet_slope(2.5 * float(line[96:100].strip() or USUAL_K1 / 2.5))
    return _row(name=line[102:158].strip(), epoch=epoch, q=q, e=e, tp=tp, mag=magnitude, slope=slope, **angles)


def comet_slope(k1: float | str | None) -> float:
    """A comet's K1 as :class:`SmallBodies` has it."""
    return -max(float(k1), LEAST_K1) if k1 else math.nan


def julian_date(year: int, month: int, day: float) -> float:
    """Julian date of a day of the Gregorian calendar; ValueError when there is no such month or day."""
    if not (1 <= month <= 12 and 1 <= day < 32 and 1600 <= year <= 2200):
        raise ValueError
    since = np.datetime64(f"{year:04d}-{month:02d}-01") - np.datetime64("2000-01-01")
    return 2451544.5 + float(since / np.timedelta64(1, "D")) + day - 1.0


def perihelion_jd(epoch_jd: float, mean_anomaly_deg: float, q: float, e: float) -> float:
    """The perihelion next to the epoch of an ellipse, Julian date; ValueError when it is none.

    Parameters
    ----------
    epoch_jd : float
        Epoch of the elements, Julian date.
    mean_anomaly_deg : float
        Mean anomaly then, degrees.
    q : float
        Perihelion distance, au.
    e : float
        Eccentricity, below 1.
    """
    if not 0.0 <= e < 1.0:
        raise ValueError
    motion = math.degrees(math.sqrt(GM["sun"] / (q / (1.0 - e)) ** 3))
    # to -180..180 deg, so that the nearer perihelion is taken
    return epoch_jd - ((mean_anomaly_deg + 180.0) % 360.0 - 180.0) / motion


def short_name(full: str) -> str:
    """``"1 Ceres"`` of ``"     1 Ceres (A801 AA)"``."""
    name = full.strip()
    if name.startswith("("):
        return name.strip("()")
    number, _, rest = name.partition(" ")
    named = number.isdigit() and not rest.startswith("(")
    return name.partition(" (")[0] if named else name


def _row(**row: Any) -> Row:
    """The row, when it is an orbit; ValueError when not."""
    numbers = [row[key] for key in ("epoch", "q", "e", "i", "node", "peri", "tp", "mag")]
    if not (row["name"] and all(map(math.isfinite, numbers)) and 1e-4 < row["q"] < 2000.0 and 0.0 <= row["e"] < 10.0):
        raise ValueError
    return row


def bodies_of(rows: list[Row]) -> SmallBodies:
    """The bodies of rows of elements, with their states at the elements' dates."""
    columns = ("q", "e", "i", "node", "peri", "tp", "epoch", "mag", "slope")
    q, e, i, node, peri, tp, epoch, mag, slope = (
        np.array([row[key] for row in rows], dtype=np.float64) for key in columns
    )
    state = two_body(state_at_perihelion(q, e, i, node, peri), epoch - tp)
    return SmallBodies([row["name"] for row in rows], state, epoch, mag, slope)
