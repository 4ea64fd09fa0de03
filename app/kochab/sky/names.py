"""Names of stars, constellations and deep-sky objects, and finding them by any name."""

import json
import re
import unicodedata
from collections import ChainMap
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

import numpy as np

from kochab.core.arrays import Floats, Table
from kochab.core.attitude import radec_deg, unit_vectors
from kochab.core.errors import CatalogueError
from kochab.core.values import frozen
from kochab.folders import data_folder
from kochab.sky.catalogue_file import Container

_TABLES = json.loads((data_folder("resources") / "star_names.json").read_text(encoding="utf-8"))
GENITIVES: dict[str, str] = _TABLES["genitives"]
"""The 88 constellations: abbreviation and genitive."""
GREEK: dict[str, str] = _TABLES["greek"]
"""Bayer's letters and how they are called."""

NAMED_TO_V = 2.55
"""Brighter stars are called by their proper names, fainter ones only if they are in `WELL_KNOWN`."""

WELL_KNOWN = frozenset(_TABLES["well_known"])
"""Fainter stars whose proper names observers use.

Those of mounts' alignment lists, the Teapot, the Pleiades, and a few famous double, variable and near stars.
"""

LATIN = frozenset("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNO")
_SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


def printed(designation: str, also: Sequence[str] = ()) -> str:
    """A designation as charts print it: ``"θ1 Ori C"`` is θ¹ Ori C.

    Of the other names ``also`` an index of the same Greek letter is taken (``"ψ Ori"`` is ψ² Ori), and a Flamsteed
    number rather than a Latin letter (``"c2 Aqr"`` is 88 Aqr), but not of P Cygni and the variables from R on, nor
    Gould's numbers in Vela and Puppis, where Flamsteed's end at 22.
    """
    head, _, rest = designation.partition(" ")
    for word in also:
        number, _, constellation = word.partition(" ")
        indexed = head in GREEK and number.startswith(head) and number[len(head) :].isdecimal()
        latin = head.rstrip("123456789") in LATIN and number.isdecimal()
        flamsteed = latin and constellation != "Vel" and (constellation != "Pup" or int(number) <= 22)
        if constellation == rest and (indexed or flamsteed):
            designation = word
            break
    if designation[:1] not in GREEK:
        return designation
    head, _, rest = designation.partition(" ")
    return f"{head.translate(_SUPERSCRIPTS)} {rest}"


class StarNames:
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
            raise CatalogueError("The table of star names {path} is missing or damaged.", path=path) from None

    def label(self, row: int) -> tuple[str, str]:
        """("HIP n", name) of a row of the bright list, the name as people say it.

        That is a well-known proper name, else the Bayer letter, Flamsteed number or variable's
        designation, else HD n, else "". Fainter components of an entry carry their letter: "HIP n B".
        """
        numbers = self.bright.column("hip")
        if row >= len(numbers):
            raise CatalogueError("The catalogue in {folder} is damaged: a star has no name.", folder=self.folder)
        hip, letter, first = int(numbers[row]), "", row
        if row and int(numbers[row - 1]) == hip:
            letter = COMPONENTS[int(self.bright.column("component")[row]) % len(COMPONENTS)]
            first = self._row_of(hip)  # the brightest component
        return f"HIP {hip} {letter}".rstrip(), self._name(hip, row, first)

    def _name(self, hip: int, row: int, first: int) -> str:
        name, designation, also = self.table.get(hip, ("", "", ""))
        bright = int(self.bright.column("mag")[first]) < NAMED_TO_V * 1e3
        if name and (bright or name in WELL_KNOWN):
            return name
        if designation:
            return printed(designation, also.split(";"))
        hd = int(self.bright.column("hd")[row])
        return f"HD {hd}" if hd else name

    def _row_of(self, hip: int) -> int:
        """The first row of a HIP number."""
        numbers = self.bright.column("hip")
        return int(numbers.searchsorted(numbers.dtype.type(hip)))  # a number of its own type: nothing is copied

    def row_called(self, name: str) -> int | None:
        """The bright row of a star called ``name``; None when none is.

        Knows HIP, HD, HR and SAO numbers, star names, Bayer and Flamsteed designations.
        """
        # Compatibility forms turn θ¹, and a micro sign in place of μ, into what the table has.
        words = unicodedata.normalize("NFKC", name.replace("_", " ")).split()
        key = " ".join(words).casefold()
        number = self._numbered(key)
        if number is not None:
            return number
        hip = self._by_name.get(" ".join(words), self._by_name.get(_plain(key)))
        return None if hip is None else self._row_of(hip)

    def _numbered(self, key: str) -> int | None:
        for prefix in ("hip", "hd", "hr", "sao"):
            rest = key[len(prefix) :].strip()
            if key.startswith(prefix) and rest.isdecimal():
                number = int(rest) if len(rest) < 10 else 0  # 0 stands for a star without one
                at = np.flatnonzero(self.bright.column(prefix) == number)
                return int(at[0]) if number and len(at) else None
        return None

    @cached_property
    def _by_name(self) -> dict[str, int]:
        """Spelling -> HIP, as in the table (T Tau is not t Tau) and plain.

        A star's first name wins over others' second ones, proper names over designations, and
        those over shortened ones.
        """
        tables: list[dict[str, int]] = [{}, {}, {}, {}, {}]
        exact, first, proper, given, short = tables
        # ascending, as searchsorted and the rows of the bright list are by HIP number
        hips = np.array(sorted(self.table))
        numbers = self.bright.column("hip")
        mag = self.bright.column("mag")[np.searchsorted(numbers, hips)]
        for hip in hips[np.argsort(mag, kind="stable")].tolist():  # the brightest bears the name
            name, designation, also = self.table[hip]
            first.setdefault(_plain(name.casefold()), hip)
            exact.setdefault(designation, hip)
            for word in (name, designation, *also.split(";")):
                key = _plain(word.casefold())
                if (word + " ").split(" ")[1] in GENITIVES:
                    given.setdefault(key, hip)
                    short.setdefault(_plain(" ".join(word.split(" ")[:2]).casefold()), hip)
                    short.setdefault(_shortened(word), hip)
                else:
                    proper.setdefault(key, hip)
        found = dict(ChainMap(*tables))
        found.pop("", None)
        return found


_GREEK_BY_NAME = {name.casefold(): letter for letter, name in GREEK.items()}
_SHORT = {
    spelling: short.casefold()
    for short, genitive in GENITIVES.items()
    for spelling in (genitive.casefold(), genitive.casefold().replace("ö", "o"))
}
COMPONENTS = ("", "A", "B", "C", "D", "E", "F", "G", "H", "K", "N", "P", "R", "S")


def _plain(key: str) -> str:
    """One spelling for each: ``alpha-1 lyrae a``, ``alpha1 lyr a``, ``α1 lyr a`` become ``α1lyra``."""
    words = re.sub(r"^([a-z]+)(\d+) ", r"\1 \2 ", key.replace("-", " ")).split(" ")
    words[0] = _GREEK_BY_NAME.get(words[0], words[0])
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


def position_name(vector: Floats | Sequence[float]) -> str:
    """A name made of a J2000 position: ``J183656.3+384701``, cut off rather than rounded."""
    ra, dec = radec_deg(vector)
    # tenths of a second of time: 24 h are 864,000
    tenths = int(ra * 2400.0) % 864000
    seconds = int(abs(dec) * 3600.0)
    hours, minutes = divmod(tenths // 600, 60)
    sign = "-" if dec < 0 else "+"
    return (
        f"J{hours:02d}{minutes:02d}{tenths % 600 // 10:02d}.{tenths % 10}"
        f"{sign}{seconds // 3600:02d}{seconds // 60 % 60:02d}{seconds % 60:02d}"
    )


# -- The table of deep-sky objects ---------------------------------------------------------------


@frozen(eq=False)
class SkyObjects(Table):
    """Deep-sky objects: texts (N,), ICRS vectors (N, 3), magnitude, diameters in arcmin, PA in degrees.

    ``band`` is that of the magnitude: V, B, or ? where two sources contradict each other by more than a magnitude;
    ``source`` says whose it is, a key of `MAG_SOURCES`. NaN is unknown. ``kind`` is OpenNGC's, with GalCl a cluster of
    galaxies; ``also`` are other designations and names, ``common`` those that are shown, both parted by commas.
    """

    name: np.ndarray[tuple[int], np.dtype[np.str_]]
    kind: np.ndarray[tuple[int], np.dtype[np.str_]]
    vector: Floats
    mag: Floats
    major: Floats
    minor: Floats
    pa_deg: Floats
    messier: np.ndarray[tuple[int], np.dtype[np.str_]]
    common: np.ndarray[tuple[int], np.dtype[np.str_]]
    also: np.ndarray[tuple[int], np.dtype[np.str_]]
    band: np.ndarray[tuple[int], np.dtype[np.str_]]
    source: np.ndarray[tuple[int], np.dtype[np.str_]]

    def designation(self, row: int) -> str:
        """Its number in the catalogue that people use: M 42, NGC 2024, Sh2-155."""
        messier = str(self.messier[row])
        return messier.replace("M", "M ", 1) if messier else str(self.name[row])

    def label(self, row: int) -> tuple[str, str]:
        """What it is called where there is little room, and where there is more: M 42, and M 42 Orion Nebula.

        Nobody says ESO 56-115: what is in no catalogue that people use has its name alone, where it has one.
        """
        number, name = self.designation(row), str(self.common[row]).partition(",")[0]
        if name and number.startswith(UNSAID):
            return name, name
        return number, f"{number} {name}".strip()

    def title(self, row: int) -> str:
        """All it is called in one line: M 42 (Orion Nebula), Large Magellanic Cloud (ESO 56-115)."""
        first, full = self.label(row)
        other = self.designation(row) if first == full else full.removeprefix(first).strip()
        return f"{first} ({other})" if other != first else first

    def names(self, row: int) -> list[str]:
        """Those that are shown, the best known first."""
        texts = (self.label(row)[0], *self.common[row].split(","), self.designation(row), str(self.name[row]))
        return [text for text in dict.fromkeys(texts) if text]


def read_objects(path: Path) -> SkyObjects:
    """The table of objects; `CatalogueError` when it is missing or damaged."""
    try:
        head, *rows = path.read_text(encoding="utf-8").splitlines()
        return objects_of_rows(head, rows)
    except (OSError, ValueError, KeyError, TypeError):
        raise CatalogueError("The table of objects {path} is missing or damaged.", path=path) from None


def objects_of_rows(head: str, rows: Sequence[str]) -> SkyObjects:
    """Objects of some lines of ``objects.tsv``, of which ``head`` is the first; ValueError and KeyError if damaged."""
    names = head.split("\t")
    cells = list(zip(*(row.split("\t") for row in rows), strict=True)) or [()] * len(names)
    columns = dict(zip(names, cells, strict=True))
    texts = {name: np.array(columns[name], dtype=np.str_) for name in TEXTS}
    ra, dec, mag, major, minor, pa = (
        np.array([float(value or "nan") for value in columns[name]], dtype=np.float64)
        for name in ("ra_deg", "dec_deg", "mag", "size_arcmin", "minor_arcmin", "pa_deg")
    )
    if not (np.isfinite(ra).all() and np.isfinite(dec).all()):
        raise ValueError
    name, kind, *rest = texts.values()
    return SkyObjects(name, kind, unit_vectors(ra, dec).reshape(-1, 3), mag, major, minor, pa, *rest)


UNSAID = ("ESO ", "PGC ", "SNR ")
"""Catalogues whose numbers nobody says."""
TEXTS = ("name", "type", "messier", "common", "also", "band", "source")
MAG_SOURCES = {"O": "OpenNGC", "S": "Stellarium", "H": "Harris 1996", "K": "HNSKY"}
"""Whose magnitude an object has; HNSKY's table is Han Kleijn's, after Steinicke."""
