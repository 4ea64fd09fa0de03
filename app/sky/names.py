"""What stars are called: the bright list, and finding a star by any of its names."""

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import radec_deg
from app.core.errors import UsageError
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
    def table(self) -> dict[int, tuple[str, str]]:
        """HIP number -> (star name, designation such as ``"α Lyr"``); either may be empty."""
        text = (self.folder / "names.tsv").read_text(encoding="utf-8")
        rows = (line.split("\t") for line in text.splitlines()[1:])
        return {int(hip): (name, designation) for hip, name, designation in rows}

    def label(self, row: int) -> tuple[str, str]:
        """("HIP n", name) of a row of the bright list; the name may fall back to HD n or ""."""
        hip = int(self.bright.column("hip")[row])
        name, designation = self.table.get(hip, ("", ""))
        if not name and designation:
            name = spelled(designation)
        if not name:
            hd = int(self.bright.column("hd")[row])
            name = f"HD {hd}" if hd else ""
        return f"HIP {hip}", name

    def details(self, row: int) -> dict[str, Any]:
        """What the bright list knows of a row: numbers, V, B-V, motion, parallax, names."""
        value = {k: int(self.bright.column(k)[row]) for k in ("hip", "hd", "hr", "sao")}
        name, designation = self.table.get(value["hip"], ("", ""))
        bv = int(self.bright.column("bv")[row])
        return {
            **{k: v or None for k, v in value.items()},
            "name": name,
            "designation": designation,
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
        found: dict[str, int] = {}
        for hip, (_, designation) in self.table.items():
            found.setdefault(_plain(designation.casefold()), hip)
        for hip, (name, _) in self.table.items():
            found[_plain(name.casefold())] = hip
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
    **{g.casefold(): s.casefold() for s, g in GENITIVES.items()},
    **{g.casefold().replace("ö", "o"): s.casefold() for s, g in GENITIVES.items()},
}


def _plain(key: str) -> str:
    """One spelling for each designation: ``alpha-1 lyrae`` and ``α1 lyr`` become ``α1lyr``."""
    for genitive, short in _SHORT.items():
        if key.endswith(" " + genitive):
            key = key[: -len(genitive)] + short
            break
    head, _, rest = key.replace("-", " ").partition(" ")
    if head in _LETTERS:
        key = _LETTERS[head] + " " + rest
    return key.replace(" ", "").replace("-", "").replace("'", "").replace("’", "")


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
