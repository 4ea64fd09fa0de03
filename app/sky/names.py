"""What stars are called: the bright list, and finding a star by any of its names."""

import re
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import radec_deg
from app.core.errors import CatalogueError, UsageError
from app.sky.constellations import GENITIVES, GREEK, spelled
from app.sky.container import Container

Floats = NDArray[np.float64]


class Names:
    """Every Hipparcos star by row: numbers, names, parallax; and the way back from a name."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @cached_property
    def bright(self) -> Container:
        """Columns of the bright list, sorted by HIP number and brightness."""
        return Container(self.folder / "bright.kcat")

    @cached_property
    def table(self) -> dict[int, tuple[str, str, str]]:
        """HIP number -> (star name, designation like ``"α Lyr"``, other names split by ";")."""
        path = self.folder / "names.tsv"
        try:
            lines = path.read_text(encoding="utf-8").splitlines()[1:]
            rows = (line.split("\t") for line in lines)
            return {int(hip): (name, given, also) for hip, name, given, also in rows}
        except (OSError, ValueError):
            raise CatalogueError(f"The table of star names {path} is missing or damaged.") from None

    def label(self, row: int) -> tuple[str, str]:
        """("HIP n", name) of a row of the bright list; the name may fall back to HD n or "".

        Fainter components of an entry carry their letter: "HIP n B".
        """
        numbers = self.bright.column("hip")
        if row >= len(numbers):
            raise CatalogueError(f"The catalogue in {self.folder} is damaged: a star has no name.")
        hip = int(numbers[row])
        if row and int(numbers[row - 1]) == hip:
            letter = COMPONENTS[int(self.bright.column("component")[row]) % len(COMPONENTS)]
            return f"HIP {hip} {letter}".rstrip(), self._name(hip, row)
        return f"HIP {hip}", self._name(hip, row)

    def _name(self, hip: int, row: int) -> str:
        name, designation, _ = self.table.get(hip, ("", "", ""))
        if name or designation:
            return name or spelled(designation)
        hd = int(self.bright.column("hd")[row])
        return f"HD {hd}" if hd else ""

    def details(self, row: int) -> dict[str, Any]:
        """What the bright list knows of a row: numbers, V, B-V, motion, parallax, names."""
        value = {k: int(self.bright.column(k)[row]) for k in ("hip", "hd", "hr", "sao")}
        name, designation, also = self.table.get(value["hip"], ("", "", ""))
        bv = int(self.bright.column("bv")[row])
        return {
            **{k: v or None for k, v in value.items()},
            "name": name,
            "designation": designation,
            "also": [n for n in also.split(";") if n],
            "v": int(self.bright.column("mag")[row]) / 1e3,
            "bv": None if bv == np.iinfo(np.int16).min else bv / 1e3,
            "pm_ra_mas": int(self.bright.column("pm_ra")[row]) / 1e2,
            "pm_dec_mas": int(self.bright.column("pm_dec")[row]) / 1e2,
            "parallax_mas": int(self.bright.column("parallax")[row]) / 1e2,
        }

    def find(self, name: str) -> int | Floats:
        """The bright row of a star called ``name``, or the vector (3,) of a deep-sky object."""
        words = name.replace("_", " ").split()
        key = " ".join(words).casefold()
        number = self._numbered(key)
        if number is not None:
            return number
        hip = self._by_name.get(_plain(key))
        if hip is not None:
            return int(np.searchsorted(self.bright.column("hip"), hip))
        place = self._objects.get(key.replace(" ", ""))
        if place is not None:
            return place
        raise UsageError(f"No star or object in the catalogue is called {name.strip()!r}.")

    def _numbered(self, key: str) -> int | None:
        for prefix in ("hip", "hd", "hr", "sao"):
            rest = key[len(prefix) :].strip()
            if key.startswith(prefix) and rest.isdecimal():
                at = np.flatnonzero(self.bright.column(prefix) == int(rest))
                if int(rest) == 0 or not len(at):
                    raise UsageError(f"The catalogue has no {prefix.upper()} {rest}.")
                return int(at[0])
        return None

    @cached_property
    def _by_name(self) -> dict[str, int]:
        """Plain spelling -> HIP: proper names win over designations, and those over shortened."""
        proper: dict[str, int] = {}
        given: dict[str, int] = {}
        short: dict[str, int] = {}
        hips = np.array(sorted(self.table))
        numbers = self.bright.column("hip")
        mag = self.bright.column("mag")[np.searchsorted(numbers, hips)]
        for hip in hips[np.argsort(mag, kind="stable")].tolist():  # the brightest bears the name
            name, designation, also = self.table[hip]
            for word in (name, designation, *also.split(";")):
                key = _plain(word.casefold())
                if (word + " ").split(" ")[1] in GENITIVES:
                    given.setdefault(key, hip)
                    short.setdefault(_shortened(word), hip)
                else:
                    proper.setdefault(key, hip)
        found = {**short, **given, **proper}
        found.pop("", None)
        return found

    @cached_property
    def _objects(self) -> dict[str, Floats]:
        from app.sky.objects import read_objects

        return {
            alias: thing.vector
            for thing in read_objects(self.folder / "objects.tsv")
            for alias in thing.keys
        }


_LETTERS = {name.casefold(): letter for letter, name in GREEK.items()}
_SHORT = {
    spelling: short.casefold()
    for short, genitive in GENITIVES.items()
    for spelling in (genitive.casefold(), genitive.casefold().replace("ö", "o"))
}
COMPONENTS = ("", "A", "B", "C", "D", "E", "F", "G", "H", "K", "N", "P", "R", "S")


def _plain(key: str) -> str:
    """One spelling for each designation: ``alpha-1 lyrae a`` and ``α1 lyr a`` become ``α1lyra``."""
    words = key.replace("-", " ").split(" ")
    words[0] = _LETTERS.get(words[0], words[0])
    for first in range(1, len(words)):
        for last in range(first + 1, len(words) + 1):
            short = _SHORT.get(" ".join(words[first:last]))
            if short is not None:
                words[first:last] = [short]
                return re.sub(r"[ '’]", "", "".join(words))
    return re.sub(r"[ '’]", "", "".join(words))


def _shortened(designation: str) -> str:
    """``γ1 And`` and ``61 Cyg A`` without index and component: ``γand``, ``61cyg``."""
    head, constellation = designation.split(" ")[:2]
    if head[0] in GREEK:
        head = head[0]
    return _plain(f"{head} {constellation}".casefold())


def position_name(vector: Floats) -> str:
    """A name made of a J2000 position: ``J183656.3+384701``, cut off rather than rounded."""
    ra, dec = radec_deg(vector)
    tenths = int(ra * 2400.0) % 864000
    seconds = int(abs(dec) * 3600.0)
    hours, minutes = divmod(tenths // 600, 60)
    sign = "-" if dec < 0 else "+"
    return (
        f"J{hours:02d}{minutes:02d}{tenths % 600 // 10:02d}.{tenths % 10}"
        f"{sign}{seconds // 3600:02d}{seconds // 60 % 60:02d}{seconds % 60:02d}"
    )
