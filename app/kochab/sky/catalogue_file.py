r"""The catalogue's file: columns, their units, tiers of magnitude and zones of declination.

::

    8 bytes   b"KOCHAB1\n"
    8 bytes   length and CRC-32 of the header, both u4 little endian
    ...       the header: JSON with ``sections`` {name: [offset, dtype, count]} and facts
    ...       the columns, each starting at a multiple of 64 bytes, little endian

Offsets count from the first column. Nothing in it depends on when or where it was written.
"""

import json
import mmap
import struct
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Array, Bytes, Floats, Ints, Table
from kochab.core.errors import CatalogueError
from kochab.core.values import frozen
from kochab.parsing.text_input import parse_json, read_json

MAGIC = b"KOCHAB1\n"
ALIGN = 64


class Container:
    """A catalogue file, opened but not read: ``facts`` and columns by name."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            with open(path, "rb") as file:
                self._map = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        except FileNotFoundError:
            raise CatalogueError("The star catalogue {path} is missing.", path=path) from None
        except (OSError, ValueError) as error:
            raise CatalogueError(
                "The star catalogue {path} cannot be opened: {error}.", path=path, error=error
            ) from None
        damaged = CatalogueError("{path} is not a Kochab star catalogue, or is damaged.", path=path)
        text = self._header()
        if text is None:
            raise damaged
        self._start = _aligned(16 + len(text))
        self._columns: dict[str, Array] = {}
        try:
            self.facts: dict[str, Any] = parse_json(text)
            self._sections = {str(name): _section(*facts) for name, facts in self.facts.pop("sections").items()}
        except (ValueError, TypeError, KeyError, AttributeError):
            raise damaged from None
        ends = [o + t.itemsize * n for o, t, n in self._sections.values()]
        # columns carry no checksum here; the exact length shows a file that was cut. manifest.json has SHA-256
        if len(self._map) != self._start + max(ends, default=0):
            raise CatalogueError("The star catalogue {path} is cut short or has been altered.", path=path)

    def _header(self) -> bytes | None:
        """The JSON, None when it is not as it was written."""
        if len(self._map) < 16 or self._map[:8] != MAGIC:
            return None
        length, crc = struct.unpack("<II", self._map[8:16])
        text = self._map[16 : 16 + length]
        return text if len(text) == length and zlib.crc32(text) == crc else None

    def column(self, name: str) -> Array:
        """The column ``name``, read-only, read from disk only where it is touched."""
        found = self._columns.get(name)  # asked for thousands of times by who names stars
        if found is None:
            if name not in self:
                raise CatalogueError("{path} lacks the column {name}.", path=self.path, name=name)
            offset, dtype, count = self._sections[name]
            found = self._columns[name] = np.frombuffer(self._map, dtype, count, self._start + offset)
        return found

    def __contains__(self, name: str) -> bool:
        return name in self._sections


def _section(offset: int, dtype: str, count: int) -> tuple[int, np.dtype[Any], int]:
    """A column's place; ValueError when it can be none."""
    kind = np.dtype(dtype)
    if not (isinstance(offset, int) and isinstance(count, int) and min(offset, count) >= 0 and kind.kind in "iufS"):
        raise ValueError("no column")
    return offset, kind, count


def write_container(path: Path, facts: Mapping[str, Any], columns: Mapping[str, Array]) -> None:
    """Write ``columns`` and ``facts``; the same input gives the same bytes."""
    sections: dict[str, list[Any]] = {}
    offset = 0
    for name, column in columns.items():
        dtype = column.dtype.newbyteorder("<")
        sections[name] = [offset, dtype.str, len(column)]
        offset = _aligned(offset + dtype.itemsize * len(column))
    # sorted keys: the same input must give the same bytes, for the SHA-256 in the manifest
    text = json.dumps({**facts, "sections": sections}, sort_keys=True).encode("ascii")
    head = MAGIC + struct.pack("<II", len(text), zlib.crc32(text)) + text
    write_whole(path, _aligned_parts(head, columns.values()))


def _aligned_parts(head: bytes, columns: Iterable[Array]) -> Iterator[bytes]:
    at = len(head)
    yield head
    for column in columns:
        # -at % ALIGN is the padding up to the next multiple
        part = b"\0" * (-at % ALIGN) + np.ascontiguousarray(column, column.dtype.newbyteorder("<")).tobytes()
        at += len(part)
        yield part


def write_whole(path: Path, parts: Iterable[bytes]) -> None:
    """Write a file that appears whole or not at all; CatalogueError when it cannot be written."""
    temporary = path.with_name(path.name + ".part")
    try:
        with open(temporary, "wb") as file:
            file.writelines(parts)
        temporary.replace(path)
    except OSError as error:
        why = error.strerror or error
        raise CatalogueError("The star catalogue {path} cannot be written: {why}.", path=path, why=why) from None
    finally:
        with suppress(OSError):  # it has its name by now, unless something failed
            temporary.unlink()


def _aligned(offset: int) -> int:
    return -(-offset // ALIGN) * ALIGN


# -- How stars are stored: units of the columns, tiers of magnitude, zones of declination ------

TURN = 2.0**32  # RA and Dec are stored in 1/2**32 of a turn, 0.3 mas
EPOCH = 2000.0
TIER_EDGES_MMAG = (6000, 7500, 9000, 10000, 11000)  # V; a tier below each and one beyond
ZONES = 360  # of half a degree, from the south pole
BV_UNKNOWN = 255
BV_STEP = 0.02
BV_LOWEST = -0.6

# Flags of a deep row.
HIPPARCOS = 1  # it has a row in the bright list
MERGED = 2  # the photocentre of components closer than 1.5"
MOVING = 4  # its proper motion is known
V_FROM_VT = 8  # no colour was known, so V is VT - 0.10
REDATED = 16  # its source gave the position at 1991.65, taken to J2000 here


def zone_of(dec_rad: Floats) -> Ints:
    """The declination zone (0 to 359, south to north) of declinations (N,) in radians."""
    return np.clip((np.degrees(dec_rad) + 90.0) * 2.0, 0, ZONES - 1).astype(np.int64)


def zone_index(tier: Ints, zone: Ints) -> NDArray[np.uint32]:
    """Where each (tier, zone) begins among rows sorted so: (tiers * 360 + 1,)."""
    cells = (len(TIER_EDGES_MMAG) + 1) * ZONES
    counts = np.bincount(tier * ZONES + zone, minlength=cells)
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.uint32)


@frozen(eq=False)
class StarList(Table):
    """Stars (N,) at J2000, before they are stored.

    ``vector`` (N, 3) ICRS; ``mag`` V; ``pm`` (N, 2) pmRA*, pmDE in mas/yr; ``bv`` mag, NaN when
    unknown; ``hip`` and ``component`` 0 when none; ``parallax`` mas; ``flag`` the bits above.
    """

    vector: Floats
    mag: Floats
    pm: Floats
    bv: Floats
    hip: Ints
    component: Bytes
    parallax: Floats
    flag: Bytes

    @classmethod
    def of(cls, vector: Floats, mag: Floats, **known: Array) -> "StarList":
        """Stars of which nothing but place, V and ``known`` columns is known."""
        n = len(mag)
        number, byte = np.zeros(n, np.int64), np.zeros(n, np.uint8)
        unknown = {"pm": np.zeros((n, 2)), "bv": np.full(n, np.nan), "parallax": np.zeros(n)}
        columns: dict[str, Array] = {**unknown, "hip": number, "component": byte, "flag": byte, **known}
        return cls(vector, mag, **columns)


def write_deep(path: Path, stars: StarList, link: Ints | None = None) -> None:
    """Write a deep list; ``link`` (L, 2) pairs (row of ``stars``, row of the bright list)."""
    x, y, z = stars.vector.T
    ra = np.rint(np.arctan2(y, x) / (2 * np.pi) * TURN).astype(np.int64) % 2**32
    dec = np.rint(np.arctan2(z, np.hypot(x, y)) / (2 * np.pi) * TURN).astype(np.int64)
    mmag = np.rint(stars.mag * 1e3).astype(np.int64)
    # tiers and zones from the rounded numbers that are stored, so that a reader finds them again
    tier = np.searchsorted(TIER_EDGES_MMAG, mmag, side="right")
    zone = zone_of(np.asarray(dec * (2 * np.pi / TURN), dtype=np.float64))
    order = np.lexsort((dec, ra, zone, tier))
    step = np.rint((np.nan_to_num(stars.bv, nan=0.0) - BV_LOWEST) / BV_STEP)
    colour = np.where(np.isnan(stars.bv), BV_UNKNOWN, np.clip(step, 0, BV_UNKNOWN - 1))
    # int16 of mas/yr reaches 32.8 arcsec/yr; Barnard's star moves by 10.4
    pm = np.clip(np.rint(stars.pm), -32767, 32767)
    # the inverse of order: links name rows as they were given, the file has them sorted
    place = np.empty(len(order), dtype=np.int64)  # of each star in the file
    place[order] = np.arange(len(order))
    link = np.zeros((0, 2), dtype=np.int64) if link is None else link
    deep = place[link[:, 0]]
    # stable: of several bright rows of one deep row the brightest stays first
    rank = np.argsort(deep, kind="stable")
    columns = {
        "zones": zone_index(tier, zone),
        "ra": ra[order].astype("<u4"),
        "dec": dec[order].astype("<i4"),
        "pm_ra": pm[order, 0].astype("<i2"),
        "pm_dec": pm[order, 1].astype("<i2"),
        "mag": mmag[order].astype("<i2"),
        "bv": colour[order].astype("u1"),
        "flag": stars.flag[order],
        "link_deep": deep[rank].astype("<u4"),
        "link_bright": link[rank, 1].astype("<u4"),
    }
    facts = {
        "kind": "deep",
        "epoch": EPOCH,
        "rows": len(stars),
        "tiers_mmag": TIER_EDGES_MMAG,
        "max_pm_arcsec": round(float(np.hypot(*pm.T).max(initial=0.0)) * 1e-3 + 1e-3, 3),
    }
    write_container(path, facts, columns)


# -- The manifest beside the files: what was built, so that damage shows -----------------------


def sha256(path: Path) -> str:
    """The SHA-256 of a file, as hex."""
    import hashlib  # loads OpenSSL: 2 ms of a cold solve, which verifies nothing

    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


BY_HAND = "nicknames.tsv"


def write_manifest(folder: Path, facts: Mapping[str, Any]) -> dict[str, Any]:
    """Write ``manifest.json``: ``facts``, and sizes and SHA-256 of the files that a command makes."""
    paths = sorted([*folder.glob("*.kcat"), *(path for path in folder.glob("*.tsv") if path.name != BY_HAND)])
    files = {path.name: {"bytes": path.stat().st_size, "sha256": sha256(path)} for path in paths}
    manifest = {**facts, "files": files}
    text = json.dumps(manifest, indent=1, sort_keys=True, ensure_ascii=False) + "\n"
    write_whole(folder / "manifest.json", [text.encode("utf-8")])
    return manifest


def read_manifest(folder: Path) -> dict[str, Any]:
    """The manifest beside a catalogue; CatalogueError when it is missing or damaged."""
    path = folder / "manifest.json"
    if not path.exists():
        raise CatalogueError("{path} is missing, so nothing can be checked.", path=path)
    try:
        manifest = read_json(path)
        manifest["files"].items()
    except (ValueError, KeyError, TypeError, AttributeError):
        raise CatalogueError("{path} is damaged.", path=path) from None
    return dict(manifest)
