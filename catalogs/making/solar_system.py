"""Make the Solar System's files of ``catalogs/``: an excerpt of JPL's DE421, asteroids and comets."""

import csv
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.errors import CatalogueError
from kochab.core.progress import Task
from kochab.sky.catalogue_file import write_container
from kochab.sky.elements import Row, bodies_of, sbdb_json, sbdb_row
from kochab.sky.ephemeris import Ephemeris, Series
from kochab.sky.orbits import carried
from kochab.sky.small_bodies import LEAST_K1, SmallBodies

AU_KM = 149597870.69962819  # DE421's
FIRST_JD, LAST_JD = 2414912.5, 2470720.5  # 1899-09-15 to 2052-07-02: 109 times 512 days
EXCERPT = {  # days of an interval, coefficients, au of the last digit: within a milliarcsecond from the Earth
    "sun": (64, 9, 1e-10),
    "mercury": (16, 13, 5e-10),
    "venus": (64, 11, 5e-10),
    "earth_moon": (64, 10, 5e-10),
    "mars": (64, 9, 1e-9),
    "jupiter": (128, 6, 4e-9),
    "saturn": (256, 7, 6e-9),
    "uranus": (512, 7, 1e-8),
    "neptune": (512, 7, 2e-8),
    "pluto": (512, 7, 4e-8),
    "moon": (8, 13, 2e-12),
}
SPK = {"mercury": 1, "venus": 2, "earth_moon": 3, "mars": 4, "jupiter": 5, "saturn": 6, "uranus": 7, "neptune": 8}
SPK |= {"pluto": 9, "sun": 10}


def read_spk(path: Path) -> Ephemeris:
    """The whole of a JPL ephemeris in SPK form, Chebyshev positions (type 2).

    NAIF's documents "DAF Required Reading" and "SPK Required Reading".
    """
    raw = path.read_bytes()
    if raw[:7] != b"DAF/SPK" or raw[88:96] != b"LTL-IEEE":
        raise CatalogueError("{path} is no ephemeris in SPK form.", path=path)
    words = np.frombuffer(raw, "<f8", len(raw) // 8)
    first = int(np.frombuffer(raw, "<i4", 1, 76)[0])
    found = {}
    for k in range(int(words[(first - 1) * 128 + 2])):
        at = (first - 1) * 1024 + 24 + 40 * k
        target, centre, _, kind, begin, end = np.frombuffer(raw, "<i4", 6, at + 16).tolist()
        if kind != 2:
            continue
        start_s, length_s, size, count = words[end - 4 : end]
        records = words[begin - 1 : end - 4].reshape(int(count), int(size))
        coefficients = records[:, 2:].reshape(int(count), 3, -1) / AU_KM
        found[target, centre] = Series(2451545.0 + start_s / 86400.0, length_s / 86400.0, coefficients)
    if not {(301, 3), (399, 3), *((number, 0) for number in SPK.values())} <= found.keys():
        raise CatalogueError("{path} lacks the Sun, the Moon or a planet.", path=path)
    moon, earth = found[301, 3], found[399, 3]
    series = {name: found[number, 0] for name, number in SPK.items()}
    from_earth = Series(moon.start_jd, moon.days, moon.coefficients - earth.coefficients)
    return Ephemeris({**series, "moon": from_earth})


def fitted(series: Series, days: int, terms: int) -> Floats:
    """Coefficients (N, 3, terms) of the same motion in intervals of other length."""
    order = np.arange(48)
    nodes = np.cos(np.pi * (order + 0.5) / len(order))
    starts = np.arange(FIRST_JD, LAST_JD, days)
    jd = starts[:, None] + (nodes + 1.0) / 2.0 * days
    places = series.at(jd.ravel()).reshape(len(starts), len(order), 3)
    # discrete orthogonality of Chebyshev polynomials at their own nodes gives the coefficients as sums
    weights = np.cos(np.pi * order[:terms, None] * (order + 0.5) / len(order)) * (2.0 / len(order))
    weights[0] /= 2.0
    return np.asarray(np.einsum("kj,nja->nak", weights, places), dtype=np.float64)


def write_ephemeris(source: Path, path: Path) -> None:
    """Write the excerpt of the ephemeris ``source`` (SPK)."""
    whole, columns = read_spk(source), {}
    for body, (days, terms, unit) in EXCERPT.items():
        digits = np.rint(fitted(whole.series[body], days, terms) / unit)
        columns[body] = digits.astype("<i4").ravel()
    write_container(path, {"kind": "ephemeris", "start_jd": FIRST_JD, "series": EXCERPT}, columns)


EPOCH_JD, NEAR_YEARS = 2461406.5, 45.0
"""2027-01-01, to which the asteroids are carried."""
LOST_JD = 2457000.5
"""Asteroids whose elements are older have not been seen again."""
COMETS_TO_V = 16.0
MORE = Path(__file__).with_name("more_elements.tsv")
"""Near-Earth asteroids, and comets that JPL's tables of November 2022 lack or have by a return long ago."""
OUTBURSTS = {"29P/Schwassmann-Wachmann 1": 4.0}
"""The total magnitude M1 (Minor Planet Center), where JPL's is that of the nucleus."""


def write_small_bodies(asteroids: Path, comets: Path, source: Path, path: Path) -> Task[dict[str, int]]:
    """Write the asteroids, carried to one date, and the comets at their own; returns how many of each.

    The first two are answers of JPL's Small-Body Database as KStars keeps them, ``source`` is the ephemeris. Comets
    without a magnitude, lost or never brighter than V 16 are left out.
    """
    rocks = [row for row in _rows(asteroids) if row["epoch"] > LOST_JD and row["name"] != "134340 Pluto"]
    rocks.sort(key=lambda row: float(row["epoch"]))
    more = list(_more())
    known = {row["name"] for row in more}
    ices = [row for row in _rows(comets) if row["epoch"] > FIRST_JD and "D/" not in row["name"]]
    ices = [{**row, "mag": OUTBURSTS.get(row["name"], row["mag"])} for row in ices if row["name"] not in known]
    ices = [row for row in ices if _peak(row) < COMETS_TO_V]
    rocks += [row for row in more if row["slope"] > -LEAST_K1]
    ices += [row for row in more if row["slope"] <= -LEAST_K1]
    whole = read_spk(source)
    table = bodies_of([*rocks, *ices])
    for some in (table.epoch_jd == np.median(table.epoch_jd), table.epoch_jd != np.median(table.epoch_jd)):
        some &= ~table.comet
        table.state[some] = yield from carried(table.state[some], table.epoch_jd[some], EPOCH_JD, whole, 1e-10)
        table.epoch_jd[some] = EPOCH_JD
    yield from bring_near(table, whole)
    table.write(path)
    return {"asteroids": len(rocks), "comets": len(ices)}


def bring_near(table: SmallBodies, ephemeris: Ephemeris) -> Task[None]:
    """Carry the comets of the last decades to the asteroids' date too, as a night of today would do each time."""
    near = np.flatnonzero(table.comet & (EPOCH_JD - table.epoch_jd < NEAR_YEARS * 365.25))
    recent = np.full_like(table.state, np.nan)
    recent[near] = yield from carried(table.state[near], table.epoch_jd[near], EPOCH_JD, ephemeris, 1e-10)
    table.recent, table.recent_jd = recent, EPOCH_JD


def _rows(path: Path) -> Iterator[Row]:
    """The entries that have elements and a magnitude."""
    for given in sbdb_json(path, path.read_text(encoding="utf-8")):
        with suppress(ValueError, TypeError, KeyError):
            yield sbdb_row(given)


def _more() -> Iterator[Row]:
    """The rows of ``more_elements.tsv``."""
    lines = MORE.read_text(encoding="utf-8").splitlines()
    for cells in csv.DictReader(lines, delimiter="\t"):
        yield {key: value if key == "name" else float(value) for key, value in cells.items()}


def _peak(row: Row) -> float:
    """The magnitude that a comet may reach at its perihelion."""
    q = float(row["q"])
    return float(row["mag"] + 10.0 * np.log10(q) + 5.0 * np.log10(max(abs(q - 1.0), 0.3)))
