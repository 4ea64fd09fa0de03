"""ASTAP's star databases, read in place: D05 to D80, V05 and V50, G05, G17, G18, H17, H18 and W08.

A folder of files ``<name>_RRCC.290`` or ``.1476``, one for each of 290 or 1,476 areas of the sky: RR is the ring of
declination counted from the south pole and CC the cell counted from RA 0. A text header of 110 bytes ends in the record
size; then come records, brightest first. A record holds RA in 3 bytes and the lower two bytes of Dec, and, of 6 bytes,
a colour; a record whose RA is all ones opens a section of one magnitude and one upper byte of Dec. W08 is one file
``w08_0101.001``: how many stars, then magnitude times ten, RA and Dec of each, radians, as floats of 4 bytes.
"""

import math
import mmap
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Floats
from kochab.core.errors import CatalogueError
from kochab.core.values import frozen
from kochab.sky.user_catalogues.star_cone import Cone, Reach, StarCone, Version, version

HEADER = 110
MARK = 0xFFFFFF
FULL_RA, FULL_DEC = 2**24 - 1, 2**23 - 1
PAD_RAD = 1e-6
"""Places are rounded to 0.08 arcsec: a star may lie as far outside its area."""


@frozen
class Tiling:
    """How the sky is cut: ``bounds_deg`` (R + 1,) of the rings, south to north, and how many cells each has."""

    suffix: str
    bounds_deg: tuple[float, ...]
    cells: tuple[int, ...]

    def areas(self, ra: float, dec: float, radius: float) -> list[tuple[int, int]]:
        """Ring and cell, from 1, of every area that a cone touches; radians."""
        south, north = math.degrees(dec - radius - PAD_RAD), math.degrees(dec + radius + PAD_RAD)
        half = _half_width(dec, radius + PAD_RAD)
        out = []
        for ring, count in enumerate(self.cells):
            if self.bounds_deg[ring] > north or self.bounds_deg[ring + 1] < south:
                continue
            first = math.floor((ra - half) / math.tau * count)
            last = math.floor((ra + half) / math.tau * count)
            touched = {cell % count for cell in range(first, min(last, first + count - 1) + 1)}
            out += [(ring + 1, cell + 1) for cell in sorted(touched)]
        return out

    def area_deg2(self, ring: int) -> float:
        """The area of a cell of a ring, counted from 1, square degrees."""
        low, high = (math.sin(math.radians(bound)) for bound in self.bounds_deg[ring - 1 : ring + 1])
        return math.degrees(math.degrees(math.tau * (high - low))) / self.cells[ring - 1]


def _half_width(dec: float, radius: float) -> float:
    """How far a cone reaches in RA either way of its axis, radians."""
    if abs(dec) + radius >= math.pi / 2 - 1e-6:
        return math.pi
    return math.asin(min(1.0, math.sin(radius) / math.cos(dec))) + PAD_RAD / math.cos(dec)


_NORTH_290 = [math.degrees(math.asin(1.0 - (2 * k - 1) ** 2 / 289.0)) for k in range(9, 0, -1)]
_CELLS_290 = (1, 4, 8, 12, 16, 20, 24, 28, 32)
_HEIGHT_1476 = 90.0 / 17.5
_CELLS_1476 = (1, 3, 9, 15, 21, 27, 33, 38, 43, 48, 52, 56, 60, 63, 65, 67, 68, 69)
TILINGS = {
    # areas of one size about the poles: ring k from a pole ends where a cap of (2k - 1)^2 of 289 parts does
    ".290": Tiling(
        ".290",
        (-90.0, *(-b for b in reversed(_NORTH_290[1:])), 0.0, *_NORTH_290[1:], 90.0),
        _CELLS_290 + _CELLS_290[::-1],
    ),
    ".1476": Tiling(
        ".1476", (-90.0, *(_HEIGHT_1476 * k for k in range(-17, 18)), 90.0), _CELLS_1476 + _CELLS_1476[::-1]
    ),
}
SUFFIXES = (*TILINGS, ".001")


def decode(data: bytes | mmap.mmap, name: str) -> NDArray[np.float64]:
    """RA, Dec (deg), magnitude and BP-RP (4, N) of the file ``name``."""
    size = data[HEADER - 1] if len(data) >= HEADER else 0  # a space stands for 11
    if size not in (5, 6) or (len(data) - HEADER) % size:
        raise CatalogueError(
            "{name} is not an ASTAP star file with records of 5 or 6 bytes, or is cut short.", name=name
        )
    rows = np.frombuffer(data, np.uint8, offset=HEADER).reshape(-1, size)
    low, middle, high = (rows[:, k].astype(np.int32) for k in range(3))
    ra = low | middle << 8 | high << 16
    mark = np.flatnonzero(ra == MARK)
    if len(rows) and (len(mark) == 0 or mark[0]):
        raise CatalogueError("{name} does not begin with a section, so it is damaged.", name=name)
    # of each section the upper byte of Dec and the magnitude, for as many stars as it has
    count = np.diff(mark, append=len(rows)) - 1
    upper = np.repeat(rows[mark, 3].astype(np.int32) - 128, count)
    mag = np.repeat((rows[mark, 4].astype(np.int32) - 16) / 10.0, count)
    star = np.ones(len(rows), dtype=bool)
    star[mark] = False
    rows = rows[star]
    # the upper byte is signed, so the shift keeps the sign of the declination
    dec = upper << 16 | rows[:, 4].astype(np.int32) << 8 | rows[:, 3]
    colour = rows[:, 5].view(np.int8) / 10.0 if size == 6 else np.full(len(rows), np.nan)
    return np.stack([ra[star] * (360.0 / FULL_RA), dec * (90.0 / FULL_DEC), mag, colour])


class AstapDatabase:
    """One database of a folder, as D50; nothing is read before a cone asks for it."""

    kind = "ASTAP"

    def __init__(self, folder: Path, name: str) -> None:
        self.path, self.name = folder, name.upper()
        self._files = _files(folder).get(name.lower(), {})
        if not self._files:
            raise CatalogueError("{path} has no ASTAP database {name}.", path=folder, name=self.name)

    @cached_property
    def _tiling(self) -> Tiling | None:
        """How it is cut; None when it is one file."""
        return TILINGS.get(next(iter(self._files.values())).suffix.lower())

    def cone(self, cone: Cone) -> StarCone:
        """The stars of a cone; its stars do not move."""
        if self._tiling is None:
            parts = [_whole_sky(self._files[1, 1])]
        else:
            areas = self._tiling.areas(cone.ra_rad % math.tau, cone.dec_rad, cone.radius_rad)
            parts = [_area(self._files[area]) for area in areas if area in self._files]
        ra, dec, mag = (np.concatenate(column) for column in zip(*parts, strict=True)) if parts else np.zeros((3, 0))
        return StarCone(ra, dec, mag).inside(cone)

    def reach(self) -> Reach:
        """How deep it goes, from a few areas spread over the sky."""
        if self._tiling is None:
            ra, _, mag = _whole_sky(self._files[1, 1])
            return Reach(float(mag.max(initial=-2.0)), len(ra) / _SKY_DEG2, 1.0)
        there = sorted(self._files)
        some = there[:: max(1, len(there) // 24)]
        found = [(_area(self._files[area])[2], self._tiling.area_deg2(area[0])) for area in some]
        faintest = max((float(mag.max(initial=-2.0)) for mag, _ in found), default=-2.0)
        # areas without a star are none that it is of
        density = float(np.median([len(mag) / deg2 for mag, deg2 in found if len(mag)] or [0.0]))
        return Reach(faintest, density, len(there) / sum(self._tiling.cells))


_SKY_DEG2 = 129_600.0 / math.pi


def databases(folder: Path) -> list[str]:
    """Names of the ASTAP databases in a folder, as ``D50``."""
    return sorted(name.upper() for name in _files(folder))


def _files(folder: Path) -> dict[str, dict[tuple[int, int], Path]]:
    """Of each database the files by ring and cell, counted from 1."""
    out: dict[str, dict[tuple[int, int], Path]] = {}
    try:
        paths = sorted(folder.iterdir())
    except OSError as error:
        raise CatalogueError("{path} cannot be read: {why}.", path=folder, why=error.strerror or error) from None
    for path in paths:
        name, _, area = path.stem.partition("_")
        if path.suffix.lower() in SUFFIXES and len(area) == 4 and area.isdigit():
            out.setdefault(name.lower(), {})[int(area[:2]), int(area[2:])] = path
    return out


def _area(path: Path) -> tuple[Floats, Floats, Floats]:
    """RA and Dec, radians, and magnitudes (N,) of the stars of one file."""
    return _read_area(path, version(path))


@lru_cache(maxsize=24)
def _read_area(path: Path, _: Version) -> tuple[Floats, Floats, Floats]:
    ra, dec, mag, _ = decode(_mapped(path), path.name)
    return np.radians(ra), np.radians(dec), mag


def _whole_sky(path: Path) -> tuple[Floats, Floats, Floats]:
    data = _mapped(path)
    if len(data) != 4 + 12 * int.from_bytes(data[:4], "little"):
        raise CatalogueError("{name} is not an ASTAP star file, or is cut short.", name=path.name)
    mag, ra, dec = np.frombuffer(data, "<f4", offset=4).reshape(-1, 3).T.astype(np.float64)
    return ra, dec, mag / 10.0


def _mapped(path: Path) -> mmap.mmap:
    """A file in the memory; CatalogueError, one sentence, when it cannot be read."""
    try:
        with path.open("rb") as file:
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except (OSError, ValueError) as error:  # an empty file cannot be mapped
        why = getattr(error, "strerror", None) or "it is empty"
        raise CatalogueError("{name} cannot be read: {why}.", name=path.name, why=why) from None
