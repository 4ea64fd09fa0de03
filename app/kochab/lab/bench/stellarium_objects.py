"""Stellarium's table of deep-sky objects and their names, as its package ``stellarium-data`` has them."""

import gzip
import re
import struct
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import field
from pathlib import Path

import numpy as np

from kochab.core.attitude import unit_vectors
from kochab.core.errors import CatalogueError
from kochab.core.values import mutable

NUMBERED = ("NGC", "IC", "M", "C", "B", "Sh2", "vdB", "RCW", "LDN", "LBN", "Cr", "Mel", "PGC", "UGC")
"""Of an object's designations the first fourteen, in the order of Stellarium's records."""
TEXTED = ("PK", "PN G", "SNR G", "Abell", "HCG", "ESO", "vdBH")
"""Those that are texts, such as PK 205+14.1 and HCG 44a."""
KINDS = {5: "OCl", 6: "OCl", 7: "GCl", 8: "*Ass", 9: "*Ass", 10: "Neb", 11: "PN", 12: "DrkN", 13: "RfN", 14: "Neb"}
KINDS |= {0: "G", 1: "G", 2: "G", 3: "G", 4: "G", 15: "EmN", 16: "Cl+N", 17: "HII", 18: "SNR", 23: "DrkN", 33: "GalCl"}
"""Stellarium's kinds of object in OpenNGC's words; GalCl, a cluster of galaxies, is our own."""
DARK, UNKNOWN_MAG = 12, 90.0
SPELT = str.maketrans({"'": "", "-": " ", "’": ""})


@mutable
class SkyObject:
    """One object: degrees ICRS, arcmin, PA east of north; ``also`` are its other designations and names.

    ``visual`` and ``blue`` are what a source says; ``mag`` in ``band`` is what was chosen of them, and ``source`` whose
    it is, a key of ``kochab.sky.names.MAG_SOURCES``.
    """

    name: str
    kind: str
    ra_deg: float
    dec_deg: float
    visual: float | None = None
    blue: float | None = None
    mag: float | None = None
    band: str = ""
    source: str = ""
    major: float | None = None
    minor: float | None = None
    pa_deg: float | None = None
    messier: str = ""
    common: list[str] = field(default_factory=list)
    also: list[str] = field(default_factory=list)

    def away_arcmin(self, other: "SkyObject") -> float:
        """The distance on the sky."""
        places = unit_vectors(np.array([self.ra_deg, other.ra_deg]), np.array([self.dec_deg, other.dec_deg]))
        return float(np.degrees(2.0 * np.arcsin(np.linalg.norm(places[1] - places[0]) / 2.0)) * 60.0)


SPELLED = {"VDB": "vdB", "CR": "Cr", "CL": "Cr", "MEL": "Mel", "ACO": "Abell", "SNRG": "SNR G", "PNG": "PN G"}
SPELLED |= {"ST": "Stock", "CED": "Ced", "RU": "Ru", "TR": "Tr", "ARP": "Arp"}


def designation(text: str) -> str:
    """A designation as people write it: ``NGC0224``, ``B033``, ``SH 2-155`` are NGC 224, B 33, Sh2-155.

    ``ESO 097-013`` is ESO 97-13.
    """
    found = re.fullmatch(r"(sh ?2|[a-z]+)[\s-]*0*(\d.*)", text.strip(), re.IGNORECASE)
    if found is None:
        return text.strip()
    head = SPELLED.get(found[1].upper(), found[1].upper())
    number = re.sub(r"-0+(?=\d)", "-", found[2]) if head == "ESO" else found[2]
    return f"Sh2-{number}" if head.startswith("SH") else f"{head} {number}"


def plain(name: str) -> str:
    """A name without what differs from list to list."""
    words = name.translate(SPELT).lower().split()
    return " ".join(word for word in words if word not in {"the", "great", "nebula", "galaxy", "cluster"}) or name


def read_stellarium(path: Path) -> list[SkyObject]:
    """Stellarium's objects, a Qt data stream; every designation, in the order of its records, is in ``also``."""
    try:
        data = gzip.decompress(path.read_bytes())
        at, found = 0, []

        def text() -> str:
            nonlocal at
            (length,) = struct.unpack_from(">I", data, at)
            # Qt's null string has this length and no bytes
            length = 0 if length == 0xFFFFFFFF else length
            at += 4 + length
            return data[at - length : at].decode("utf-16-be").strip()

        def numbers(form: str) -> tuple[float, ...]:
            nonlocal at
            at += struct.calcsize(form)
            return struct.unpack_from(form, data, at - struct.calcsize(form))

        text(), text()  # version and edition
        while at < len(data):
            _, ra, dec, blue, visual, kind = numbers(">I4dI")
            text()
            major, minor, pa = numbers(">2di")
            numbers(">6d")  # redshift, parallax and distance
            given = _given(NUMBERED, numbers(">14I"))
            given += _given(("Ced",), [text()])
            given += _given(("Arp", "VV"), numbers(">2I"))
            given += _given(TEXTED, [text() for _ in TEXTED])
            given += _given(("DWB", "Tr", "Stock", "Ru", "vdBHa"), numbers(">5I"))
            one = SkyObject("", KINDS.get(int(kind), "Other"), float(np.degrees(ra)), float(np.degrees(dec)))
            if kind != DARK:  # it has a dark nebula's opacity there
                one.visual, one.blue = (mag if mag < UNKNOWN_MAG else None for mag in (visual, blue))
            one.major, one.minor = (60.0 * side or None for side in (major, minor))
            one.pa_deg = pa or None  # 0 stands for unknown
            one.also = [word.replace("Sh2 ", "Sh2-") for word in given]
            found.append(one)
    except (OSError, EOFError, struct.error, UnicodeDecodeError) as error:
        raise CatalogueError(
            "{name} is not Stellarium's table of objects ({error}).", name=path.name, error=error
        ) from error
    return found


def _given(catalogues: Sequence[str], numbers: Sequence[object]) -> list[str]:
    """``NGC 1976``, ``Ced 55d``; nothing for 0 and empty texts."""
    return [f"{name} {int(n) if isinstance(n, float) else n}" for name, n in zip(catalogues, numbers, strict=True) if n]


def read_names(path: Path) -> dict[str, list[tuple[str, int]]]:
    """Designation -> names and how many sources Stellarium cites for each (a well-known one has many)."""
    names: dict[str, list[tuple[str, int]]] = defaultdict(list)
    for line in path.read_text("utf-8").splitlines():
        found = re.match(r'([^#].{4})(.{15}) *_\("(.+?)"\)(?:\s*#\s*(.*))?', line)
        if found is not None:
            cited = [word.strip() for word in (found[4] or "").split(",") if word.strip()]
            names[designation(found[1].strip() + found[2].strip())].append((found[3], len(cited) + 9 * ("WK" in cited)))
    return names
