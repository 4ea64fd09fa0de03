"""The table of objects beside a second source: places, magnitudes, sizes, kinds and names, column by column.

The source is HNSKY's deep-sky table (Han Kleijn, 2024), made of Steinicke's revised NGC and IC, the Saguaro Astronomy
Club's list and the catalogues of Sharpless, Barnard and van den Bergh; the package ``fchart3`` brings it. It checks
and is not shipped: what it contradicts is decided by a row of ``catalogs/making/corrections.tsv``.
"""

import math
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kochab.core.attitude import radec_deg
from kochab.core.errors import CatalogueError
from kochab.lab.bench.stellarium_objects import SkyObject, designation, plain
from kochab.sky.names import SkyObjects

COLUMNS = ("place", "mag", "size", "kind", "name")
PLACE_ARCMIN = 6.0  # or a third of the object
MAG, SIZE_RATIO = 1.0, 2.0
DARK_MAG = 70.0  # stands for none
FAMILY = {"GX": "galaxy", "OC": "cluster", "GC": "globular", "PN": "planetary", "BN": "nebula", "DN": "dark"}
OURS = {"G": "galaxy", "GPair": "galaxy", "GTrpl": "galaxy", "GGroup": "galaxy", "OCl": "cluster", "*Ass": "cluster"}
OURS |= {"GCl": "globular", "Cl+N": "nebula", "PN": "planetary", "DrkN": "dark"}
OURS |= dict.fromkeys(("HII", "EmN", "RfN", "Neb", "SNR"), "nebula")


class Contradiction(NamedTuple):
    """What an object is called, the column, and both values as texts; the name is the table's first."""

    name: str
    column: str
    ours: str
    theirs: str


def read_hnsky(path: Path) -> list[SkyObject]:
    """HNSKY's objects; ``also`` are their designations, ``common`` their names, ``kind`` the family or ""."""
    found = []
    try:
        for line in path.read_text("utf-8", "replace").splitlines():
            cells = [cell.strip() for cell in line.split(",")] + [""] * 4
            if not re.fullmatch(r"-?\d+", cells[0]):
                continue  # two lines of explanation
            family = re.match(r"(GX|OC|GC|PN|BN|DN)(?![A-Za-z])", cells[4])
            one = SkyObject("", FAMILY[family[1]] if family else "", float(cells[0]) / 2400.0, float(cells[1]) / 3600.0)
            mag, one.major, one.minor = (
                float(cell) / 10.0 if cell else None for cell in (cells[2], cells[6], cells[7])
            )
            one.visual = mag if mag is not None and mag < DARK_MAG else None
            words = cells[3].split("/")
            one.also = [designation(word) for word in words if re.search(r"\d", word)]
            one.common = [word.replace("_", " ") for word in words if not re.search(r"\d", word)]
            found.append(one)
    except (OSError, ValueError, IndexError) as error:
        raise CatalogueError("{name} is not HNSKY's table ({error}).", name=path.name, error=error) from error
    return found


def pairs(objects: SkyObjects, second: Iterable[SkyObject]) -> Iterator[tuple[int, SkyObject]]:
    """Rows of the table and the second source's object that has the same first designation."""
    rows = {objects.designation(row): row for row in range(len(objects))}
    rows |= {str(name): row for row, name in enumerate(objects.name.tolist())}
    for other in second:
        row = next((rows[word] for word in other.also if word in rows), None)
        if row is not None:
            yield row, other


def contradictions(objects: SkyObjects, row: int, other: SkyObject) -> Iterator[Contradiction]:
    """The columns in which the two differ by more than such sources do."""
    name, size = str(objects.name[row]), float(objects.major[row])
    theirs = other.major or math.nan
    here = SkyObject(name, "", *radec_deg(objects.vector[row]))
    away = here.away_arcmin(other)
    if away > max(PLACE_ARCMIN, float(np.nanmax([size, theirs, 0.0])) / 3.0):
        yield Contradiction(name, "place", f"{here.ra_deg:.2f} {here.dec_deg:.2f}", f"{away:.0f}' away")
    mag, numbered = float(objects.mag[row]), name.split(" ")[0] in ("NGC", "IC")
    if numbered and str(objects.band[row]) == "V" and abs(mag - (other.visual or math.nan)) > MAG:
        yield Contradiction(name, "mag", f"{mag:g}", f"{other.visual:g}")
    if numbered and theirs > 0.0 and not 1.0 / SIZE_RATIO <= (ratio := size / theirs) <= SIZE_RATIO and ratio > 0.0:
        yield Contradiction(name, "size", f"{size:g}'", f"{theirs:g}'")
    ours = OURS.get(str(objects.kind[row]), "")
    # an open cluster with a nebula is either, and the Clouds' clusters are called both
    if ours and other.kind and ours != other.kind and {ours, other.kind} - {"cluster", "nebula", "globular"}:
        yield Contradiction(name, "kind", str(objects.kind[row]), other.kind)


def decided(path: Path) -> dict[str, set[str]]:
    """The columns of each object that a row of ``corrections.tsv`` decides, also those that it leaves as they are."""
    found: dict[str, set[str]] = {}
    for line in path.read_text("utf-8").splitlines()[1:]:
        name, column, value, _ = line.split("\t")
        found.setdefault(name, set()).add(value if column == "keep" else column)
    return found


def bearers_of(objects: SkyObjects) -> dict[str, list[SkyObject]]:
    """The objects of the table by their plain names."""
    found: dict[str, list[SkyObject]] = {}
    for row in range(len(objects)):
        ra, dec = radec_deg(objects.vector[row])
        one = SkyObject(str(objects.name[row]), "", ra, dec, major=float(np.nan_to_num(objects.major[row])))
        for name in filter(None, f"{objects.common[row]},{objects.also[row]}".split(",")):
            if not re.search(r"\d", name):
                found.setdefault(plain(name), []).append(one)
    return found


def misplaced_names(second: Iterable[SkyObject], common: dict[str, list[SkyObject]]) -> Iterator[tuple[str, bool]]:
    """Names that the second source has, and whether none of those called so here, by plain names, is near its place."""
    for other in second:
        for name in other.common:
            if bearers := common.get(plain(name)):
                near = (max(30.0, (other.major or 0.0) / 2.0, (one.major or 0.0) / 2.0) for one in bearers)
                yield name, not any(one.away_arcmin(other) < reach for one, reach in zip(bearers, near, strict=True))
