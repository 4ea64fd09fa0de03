"""The sources of the catalogue as arrays, and the epochs of their positions."""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from kochab.core.arrays import Bools, Bytes, Floats, Ints, Table
from kochab.core.attitude import ARCSEC, unit
from kochab.core.errors import CatalogueError
from kochab.core.values import frozen
from kochab.sky.catalogue_file import StarList
from kochab.sky.proper_motion import tangent
from kochab.sky.user_catalogues.index_files import read_index

# -- Stellarium's star files: zones of a geodesic grid holding Hipparcos and Tycho-2 stars -----
# The layout is a documented fact of the format (Stellarium 0.22, type 0 and type 1 files): a header of eight int32, a
# count for every triangle of the grid, then packed records. Positions are offsets along the east and north axes of
# their triangle's centre, on the plane that touches the sphere there. Proper motions are stored beside them as if
# along the same axes, but their values are (pmRA*, pmDE) at the star: turned from the zone's axes to the star's,
# Polaris would come out rotated by some 50 degrees. Only their scale is that of the plane (measured against the table
# of Hipparcos motions beside the files: 0.2 % at the median).

MAGIC = 0x835F040A
SIZES = {0: 28, 1: 10}
FULL = {0: 2**31 - 1, 1: 2**19 - 1}  # the offset that reaches the farthest corner of a triangle
FACES = "10A01909698607A670763683BA773B32B238AB424B54228541A451591895"
"""The corners of the 20 faces of the icosahedron, counted 0 to B, in the order of the files."""


def triangles(level: int) -> Floats:
    """Corners (20 * 4**level, 3, 3) of the geodesic triangles of ``level``, in file order."""
    golden = 0.5 * (1.0 + np.sqrt(5.0))
    b = 1.0 / np.sqrt(1.0 + golden * golden)
    a = b * golden
    corners = np.zeros((12, 3))  # of an icosahedron: three golden rectangles
    corners[:4, :2] = [[a, -b], [a, b], [-a, b], [-a, -b]]
    corners[4:8, 1:] = [[a, -b], [a, b], [-a, b], [-a, -b]]
    corners[8:, ::2] = [[-b, a], [b, a], [b, -a], [-b, -a]]
    faces = np.array([int(corner, 36) for corner in FACES]).reshape(20, 3)
    zone = corners[faces]
    for _ in range(level):
        c0, c1, c2 = zone[:, 0], zone[:, 1], zone[:, 2]
        e0, e1, e2 = (unit(p) for p in (c1 + c2, c2 + c0, c0 + c1))
        children = [[c0, e2, e1], [e2, c1, e0], [e1, e0, c2], [e0, e1, e2]]
        zone = np.stack([np.stack(c, axis=1) for c in children], axis=1).reshape(-1, 3, 3)
    return np.asarray(zone, dtype=np.float64)


def read_stars(path: Path) -> StarList:
    """Every star of one ``stars_*.cat`` file (types 0 and 1); V is floored to its step."""
    data = path.read_bytes()
    head = np.frombuffer(data, "<i4", 8) if len(data) >= 32 else np.zeros(8, "<i4")
    if int(head[0]) & 0xFFFFFFFF != MAGIC or int(head[1]) not in SIZES:
        raise CatalogueError("{name} is not a Stellarium star file of type 0 or 1.", name=path.name)
    kind, level, low, span, steps = (int(head[i]) for i in (1, 4, 5, 6, 7))
    zones = 20 * 4**level
    counts = np.frombuffer(data, "<u4", zones, 32).astype(np.int64)
    body = np.frombuffer(data, np.uint8, offset=32 + 4 * zones)
    if len(body) != SIZES[kind] * int(counts.sum()):
        raise CatalogueError("{name} is cut short or damaged.", name=path.name)
    rows = body.reshape(-1, SIZES[kind])
    x, y, pm_ra, pm_dec, bv, step, parallax, ident = _type0(rows) if kind == 0 else _type1(rows)
    vector, plane = _positions(level, kind, np.repeat(np.arange(zones), counts), x, y)
    return StarList.of(
        vector,
        np.asarray((low + step * (span / steps)) * 1e-3),
        pm=_on_sphere(np.stack([pm_ra, pm_dec], axis=1) * np.float64(0.1), plane),
        bv=np.where(bv > 0, bv * (4.0 / 127.0) - 0.5, np.nan),
        hip=ident & 0xFFFFFF,
        component=(ident >> 24).astype(np.uint8),
        parallax=parallax * 0.01,
    )


def _type0(rows: Bytes) -> tuple[Ints, ...]:
    names = ["id", "x", "y", "bv", "mag", "sp", "dx", "dy", "plx"]
    packed = np.dtype({"names": names, "formats": ["<u4", "<i4", "<i4", "u1", "u1", "<u2", *["<i4"] * 3]})
    r = np.ascontiguousarray(rows).view(packed)[:, 0]
    return tuple(r[k].astype(np.int64) for k in ("x", "y", "dx", "dy", "bv", "mag", "plx", "id"))


def _type1(rows: Bytes) -> tuple[Ints, ...]:
    d = rows.astype(np.int64).T
    x = _signed(d[0] | d[1] << 8 | (d[2] & 0xF) << 16, 20)
    y = _signed(d[2] >> 4 | d[3] << 4 | d[4] << 12, 20)
    dx = _signed(d[5] | (d[6] & 0x3F) << 8, 14)
    dy = _signed(d[6] >> 6 | d[7] << 2 | (d[8] & 0xF) << 10, 14)
    none = np.zeros_like(x)
    return x, y, dx, dy, d[8] >> 4 | (d[9] & 7) << 4, d[9] >> 3, none, none


def _signed(value: Ints, bits: int) -> Ints:
    # two's complement: the top bit counts negative
    return value - ((value >> (bits - 1)) << bits)


def _positions(level: int, kind: int, zone: Ints, x: Ints, y: Ints) -> tuple[Floats, Floats]:
    """Unit vectors (N, 3), and places (N, 2) on the plane that touches each zone's centre."""
    corners = triangles(level)
    centre = unit(corners.sum(axis=1))
    east = unit(np.cross([0.0, 0.0, 1.0], centre))
    north = np.cross(centre, east)
    offset = corners - centre[:, None]
    along = np.stack([np.einsum("zck,zk->zc", offset, axis) for axis in (east, north)], axis=-1)
    # from the sine of the angle to its tangent, the distance on the touching plane
    reach = np.abs(along) / np.sqrt(1.0 - np.sum(along**2, axis=-1, keepdims=True))
    scale = reach.max() / FULL[kind]
    plane = np.stack([x, y], axis=1) * scale
    offset = plane[:, :1] * east[zone] + plane[:, 1:] * north[zone]
    return unit(centre[zone] + offset), plane


def _on_sphere(motion: Floats, plane: Floats) -> Floats:
    """Undo the plane's scale: 1 / cos across the direction to its centre, 1 / cos^2 along it."""
    square = np.sum(plane**2, axis=1, keepdims=True)
    cosine = 1.0 / np.sqrt(1.0 + square)
    outward = plane * (np.sum(motion * plane, axis=1, keepdims=True) / np.maximum(square, 1e-30))
    return np.asarray((motion - outward) * cosine + outward * cosine**2)


@frozen(eq=False)
class Listed(Table):
    """The independent list: ``hip`` (M,) ascending, ``vector`` (M, 3) at 2024.0, ``mag`` (M,) V."""

    hip: Ints
    vector: Floats
    mag: Floats


@frozen(eq=False)
class Sources:
    """All that is known before merging.

    ``files`` by name; ``stars`` Stellarium's; ``pm_hip`` (K,) ascending HIP numbers with their
    motions ``pm`` (K, 2) pmRA*, pmDE in mas/yr; ``tycho`` (T, 3) vectors with ``vt`` (T,);
    ``cross`` {HIP: (SAO, HD, HR)}; ``names`` {HIP: (name, designation, other names)}.
    """

    files: dict[str, Path]
    stars: StarList
    pm_hip: Ints
    pm: Floats
    tycho: Floats
    vt: Floats
    listed: Listed
    cross: dict[int, tuple[int, int, int]]
    names: dict[int, tuple[str, str, list[str]]]


SINGLE_FILES = (
    "index-tycho2-07.littleendian.fits",
    "hip_pm.dat",
    "cross-id.dat",
    "name.fab",
    "gcvs_hip_part.dat",
    "default_database.npz",
    "ongc.db",
    "de421.bsp",
    "asteroids.dat",
    "comets.dat",
    "western/star_names.fab",
    "western/constellationship.fab",
    "nebulae/default/catalog.dat",
    "nebulae/default/names.dat",
    "nebulae/default/outlines.dat",
    "constellation_boundaries.dat",
)


def read_sources(folder: Path) -> Sources:
    """Read every source below ``folder``, wherever the packages put them."""
    paths = sorted(folder.rglob("stars_[0-3]_*.cat"))
    if not paths:
        raise CatalogueError("The sources in {folder} lack Stellarium's stars_*.cat.", folder=folder)
    stars = StarList.joined([read_stars(path) for path in paths])
    for name in SINGLE_FILES:
        found = sorted(folder.rglob(name))
        if not found:
            raise CatalogueError("The sources in {folder} lack {name}.", folder=folder, name=name)
        paths.append(found[0])
    files = {path.name: path for path in paths}
    tycho, columns = read_index(files["index-tycho2-07.littleendian.fits"])
    vt = columns["MAG_VT"].astype(np.float64)
    motions = _motions(files["hip_pm.dat"])
    listed = _listed(files["default_database.npz"])
    return Sources(files, stars, *motions, tycho, vt, listed, _cross(files["cross-id.dat"]), _names(files))


def _listed(path: Path) -> Listed:
    with np.load(path) as data:
        table = data["star_table"].astype(np.float64)
        hip = data["star_catalog_IDs"].astype(np.int64)
    ra, dec = table[:, 0], table[:, 1]
    place = [np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)]
    return Listed(hip, np.stack(place, axis=1), table[:, 5]).take(np.argsort(hip))


def row_of(number: Ints, among: Ints) -> tuple[Ints, Bools]:
    """The row of each ``number`` (N,) ``among`` ascending ones, and whether it is there at all."""
    # a number beyond the last would index past the end
    row = np.minimum(np.searchsorted(among, number), len(among) - 1)
    return row, among[row] == number


def least_of_each(key: Ints, value: Floats) -> Bools:
    """Where each key (N,) has its smallest value: a mask (N,)."""
    order = np.lexsort((value, key))
    mask = np.zeros(len(key), dtype=np.bool_)
    mask[order[np.diff(key[order], prepend=-1) > 0]] = True
    return mask


def _lines(path: Path) -> Iterator[str]:
    """Lines of a text table, without comments and blanks."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise CatalogueError("{path} cannot be read: {strerror}.", path=path, strerror=error.strerror) from error
    return (line for line in text.splitlines() if line.strip() and not line.startswith("#"))


def _motions(path: Path) -> tuple[Ints, Floats]:
    rows = np.array([line.split()[:3] for line in _lines(path)], dtype=np.float64)
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    return rows[:, 0].astype(np.int64), rows[:, 1:]


def _cross(path: Path) -> dict[int, tuple[int, int, int]]:
    """HIP -> (SAO, HD, HR), 0 where there is none; the first line of a star counts.

    Columns: HIP, component, SAO, HD, HR.
    """
    table: dict[int, tuple[int, int, int]] = {}
    for line in _lines(path):
        cells = [int(re.sub(r"\D.*", "", c) or 0) for c in (line + "\t" * 4).split("\t")[:5]]
        # a double star has a line for each component: later ones only fill what the first lacks
        old = table.get(cells[0], (0, 0, 0))
        table[cells[0]] = (old[0] or cells[2], old[1] or cells[3], old[2] or cells[4])
    table.pop(0, None)
    return table


def _names(files: dict[str, Path]) -> dict[int, tuple[str, str, list[str]]]:
    """HIP -> (star name, designation, other names): the first name given, Bayer before Flamsteed.

    Names of variable stars come last, as "R And".
    """
    proper: dict[int, list[str]] = {}
    for hip, rest in _named(files["star_names.fab"]):
        found = re.search(r'_\("(.+?)"\)', rest)
        if found:
            proper.setdefault(hip, []).append(found[1].strip())
    given: dict[int, list[str]] = {}
    for hip, rest in _named(files["name.fab"]):
        given.setdefault(hip, []).append(rest.replace("_", " "))
    for line in _lines(files["gcvs_hip_part.dat"]):
        cells = line.split("\t")
        if cells[0].isdecimal() and len(cells) > 1:
            given.setdefault(int(cells[0]), []).append(cells[1].strip())
    table = {}
    for hip in sorted(proper.keys() | given.keys()):
        first, second = proper.get(hip, [""]), given.get(hip, [""])
        also = dict.fromkeys([*first[1:], *second[1:]])
        table[hip] = (first[0], second[0], [n for n in also if n not in (first[0], second[0])])
    return table


def _named(path: Path) -> Iterator[tuple[int, str]]:
    """(HIP, text) of lines such as ``677|α_And``."""
    for line in _lines(path):
        hip, _, rest = line.partition("|")
        if hip.strip().isdecimal() and rest.strip():
            yield int(hip), rest.strip()


# -- Which stored positions are not at J2000, and taking them there ----------------------------
# Stellarium's list gives most stars at J2000, but Hipparcos stars that Tycho-2 lacks (the very
# bright ones, and close or fast pairs) at 1991.65 or so; Tycho-2's supplement stands at 1991.25. At
# 1 arcsec/yr that is an error of 8 arcsec. The judges are the independent list, whose positions are
# at 2024.0 (but within 5 deg of the poles lack proper motion, so are at 1991.25), and Tycho-2.

EARLY = 1991.65  # the median over the stars found so, with a spread of 0.15 yr
SUPPLEMENT = 1991.25
LIST_EPOCH = 2024.0
# Proxima: not in Tycho-2, in a full cell of the index, and too faint for the independent list.
ALSO_EARLY = (70890,)
# Where the table of motions is 80 mas/yr off: Barnard's and Kapteyn's stars, from Gaia DR3
# (Gaia Collaboration 2023, A&A 674, A1), pmRA*, pmDE in mas/yr.
MOTIONS = {87937: (-801.55, 10362.39), 24186: (6491.22, -5708.61)}
TELLING = 0.15  # arcsec: a smaller shift can neither be told nor does it harm
POLE_SIN = np.sin(np.radians(85.0))  # nearer the poles the independent list has no motion


def offsets(vector: Floats, other: Floats) -> Floats:
    """Where ``other`` (N, 3) lies as seen from ``vector``: (N, 2) arcsec east and north."""
    east, north = tangent(vector)
    gap = other - vector
    along = [np.sum(gap * axis, axis=1) / ARCSEC for axis in (east, north)]
    return np.stack(along, axis=1)


def shift_arcsec(pm_mas: Floats) -> Floats:
    """How far (N,) the motions (N, 2) in mas/yr carry a star from 1991.65 to J2000, arcsec."""
    return np.asarray(np.hypot(*pm_mas.T) * 1e-3 * (2000.0 - EARLY))


def early_by_list(vector: Floats, pm_mas: Floats, listed: Floats) -> Bools:
    """Stars (N,) whose place fits the independent list ``listed`` (N, 3) only if at 1991.65.

    Rows of ``listed`` are NaN for stars it lacks. Where motion over eight years is too small to
    tell, the answer is no, and no harm is done.
    """
    # there the independent list stands at Hipparcos' epoch for want of motion
    near_pole = np.abs(vector[:, 2]) > POLE_SIN
    epoch = np.where(near_pole, SUPPLEMENT, LIST_EPOCH)
    seen = offsets(vector, listed)
    motion = pm_mas * 1e-3
    now = np.hypot(*(seen - motion * (epoch - 2000.0)[:, None]).T)
    then = np.hypot(*(seen - motion * (epoch - EARLY)[:, None]).T)
    shift = shift_arcsec(pm_mas)
    return np.asarray((shift > TELLING) & (then < 0.5 * now) & (then < 0.15 + 0.35 * shift))
