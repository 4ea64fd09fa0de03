"""Stellarium's star files: zones of a geodesic grid holding Hipparcos and Tycho-2 stars.

The layout is a documented fact of the format (Stellarium 0.22, type 0 and type 1 files): a header
of eight int32, a count for every triangle of the grid, then packed records. Positions are offsets
along the east and north axes of their triangle's centre, on the plane that touches the sphere
there. Proper motions are stored beside them as if along the same axes, but their values are
(pmRA*, pmDE) at the star: turned from the zone's axes to the star's, Polaris would come out
rotated by some 50 degrees. Only their scale is that of the plane (measured against the table of
Hipparcos motions beside the files: 0.2 % at the median).
"""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.core.errors import CatalogueError

Floats = NDArray[np.float64]
MAGIC = 0x835F040A
SIZES = {0: 28, 1: 10}
FULL = {0: 2**31 - 1, 1: 2**19 - 1}  # the offset that reaches the farthest corner of a triangle


@dataclass(frozen=True, slots=True, eq=False)
class ZoneStars:
    """Stars as stored: all arrays (N,).

    ``vector`` (N, 3) ICRS; ``pm`` (N, 2) pmRA*, pmDE in mas/yr; ``mag`` V, floored to its step;
    ``bv`` mag, NaN when unknown; ``parallax`` mas; ``hip`` and ``component`` 0 when none.
    """

    vector: Floats
    pm: Floats
    mag: Floats
    bv: Floats
    parallax: Floats
    hip: NDArray[np.int64]
    component: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.hip)

    @classmethod
    def joined(cls, parts: "list[ZoneStars]") -> "ZoneStars":
        """All the parts one after another."""
        return cls(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)))


def triangles(level: int) -> Floats:
    """Corners (20 * 4**level, 3, 3) of the geodesic triangles of ``level``, in file order."""
    golden = 0.5 * (1.0 + np.sqrt(5.0))
    b = 1.0 / np.sqrt(1.0 + golden * golden)
    a = b * golden
    corners = np.array(
        [
            [a, -b, 0], [a, b, 0], [-a, b, 0], [-a, -b, 0],
            [0, a, -b], [0, a, b], [0, -a, b], [0, -a, -b],
            [-b, 0, a], [b, 0, a], [b, 0, -a], [-b, 0, -a],
        ]
    )  # fmt: skip
    faces = np.array(
        [
            [1, 0, 10], [0, 1, 9], [0, 9, 6], [9, 8, 6], [0, 7, 10], [6, 7, 0], [7, 6, 3],
            [6, 8, 3], [11, 10, 7], [7, 3, 11], [3, 2, 11], [2, 3, 8], [10, 11, 4], [2, 4, 11],
            [5, 4, 2], [2, 8, 5], [4, 1, 10], [4, 5, 1], [5, 9, 1], [8, 9, 5],
        ]
    )  # fmt: skip
    zone = corners[faces]
    for _ in range(level):
        c0, c1, c2 = zone[:, 0], zone[:, 1], zone[:, 2]
        e0, e1, e2 = (_unit(p) for p in (c1 + c2, c2 + c0, c0 + c1))
        children = [[c0, e2, e1], [e2, c1, e0], [e1, e0, c2], [e0, e1, e2]]
        zone = np.stack([np.stack(c, axis=1) for c in children], axis=1).reshape(-1, 3, 3)
    return np.asarray(zone, dtype=np.float64)


def read_stars(path: Path) -> ZoneStars:
    """Every star of one ``stars_*.cat`` file (types 0 and 1)."""
    data = path.read_bytes()
    head = np.frombuffer(data, "<i4", 8) if len(data) >= 32 else np.zeros(8, "<i4")
    if int(head[0]) & 0xFFFFFFFF != MAGIC or int(head[1]) not in SIZES:
        raise CatalogueError(f"{path.name} is not a Stellarium star file of type 0 or 1.")
    kind, level, low, span, steps = (int(head[i]) for i in (1, 4, 5, 6, 7))
    zones = 20 * 4**level
    counts = np.frombuffer(data, "<u4", zones, 32).astype(np.int64)
    body = np.frombuffer(data, np.uint8, offset=32 + 4 * zones)
    if len(body) != SIZES[kind] * int(counts.sum()):
        raise CatalogueError(f"{path.name} is cut short or damaged.")
    rows = body.reshape(-1, SIZES[kind])
    columns = _type0(rows) if kind == 0 else _type1(rows)
    x, y, pm_ra, pm_dec, bv, step, parallax, hip, component = columns
    vector, plane = _positions(level, kind, np.repeat(np.arange(zones), counts), x, y)
    motion = _on_sphere(_floats(np.stack([pm_ra, pm_dec], axis=1) * 0.1), plane)
    return ZoneStars(
        vector,
        motion,
        _floats((low + step * (span / steps)) * 1e-3),
        _floats(np.where(bv > 0, bv * (4.0 / 127.0) - 0.5, np.nan)),
        _floats(parallax * 0.01),
        hip,
        component,
    )


def _type0(rows: NDArray[np.uint8]) -> tuple[NDArray[np.int64], ...]:
    packed = np.dtype(
        [("id", "<u4"), ("x", "<i4"), ("y", "<i4"), ("bv", "u1"), ("mag", "u1"), ("sp", "<u2"),
         ("dx", "<i4"), ("dy", "<i4"), ("plx", "<i4")]
    )  # fmt: skip
    r = np.ascontiguousarray(rows).view(packed)[:, 0]
    wide = [r[k].astype(np.int64) for k in ("x", "y", "dx", "dy", "bv", "mag", "plx", "id")]
    *most, ident = wide
    return (*most, ident & 0xFFFFFF, ident >> 24)


def _type1(rows: NDArray[np.uint8]) -> tuple[NDArray[np.int64], ...]:
    d = rows.astype(np.int64).T
    x = _signed(d[0] | d[1] << 8 | (d[2] & 0xF) << 16, 20)
    y = _signed(d[2] >> 4 | d[3] << 4 | d[4] << 12, 20)
    dx = _signed(d[5] | (d[6] & 0x3F) << 8, 14)
    dy = _signed(d[6] >> 6 | d[7] << 2 | (d[8] & 0xF) << 10, 14)
    none = np.zeros_like(x)
    return x, y, dx, dy, d[8] >> 4 | (d[9] & 7) << 4, d[9] >> 3, none, none, none


def _signed(value: NDArray[np.int64], bits: int) -> NDArray[np.int64]:
    return value - ((value >> (bits - 1)) << bits)


def _positions(
    level: int, kind: int, zone: NDArray[np.int64], x: NDArray[np.int64], y: NDArray[np.int64]
) -> tuple[Floats, Floats]:
    """Unit vectors (N, 3), and places (N, 2) on the plane that touches each zone's centre."""
    corners = triangles(level)
    centre = _unit(corners.sum(axis=1))
    east = _unit(np.cross([0.0, 0.0, 1.0], centre))
    north = np.cross(centre, east)
    offset = corners - centre[:, None]
    along = np.stack([np.einsum("zck,zk->zc", offset, axis) for axis in (east, north)], axis=-1)
    reach = np.abs(along) / np.sqrt(1.0 - np.sum(along**2, axis=-1, keepdims=True))
    scale = reach.max() / FULL[kind]
    plane = np.stack([x, y], axis=1) * scale
    offset = plane[:, :1] * east[zone] + plane[:, 1:] * north[zone]
    return _unit(centre[zone] + offset), _floats(plane)


def _on_sphere(motion: Floats, plane: Floats) -> Floats:
    """Undo the plane's scale: 1 / cos across the direction to its centre, 1 / cos^2 along it."""
    square = np.sum(plane**2, axis=1, keepdims=True)
    cosine = 1.0 / np.sqrt(1.0 + square)
    outward = plane * (np.sum(motion * plane, axis=1, keepdims=True) / np.maximum(square, 1e-30))
    return _floats((motion - outward) * cosine + outward * cosine**2)


def _floats(values: NDArray[Any]) -> Floats:
    return np.asarray(values, dtype=np.float64)


def _unit(v: Floats) -> Floats:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))
