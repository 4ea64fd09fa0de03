"""A tiny sky written in the formats of the packages the catalogue is made of."""

import gzip
import json
import sqlite3
import struct

import numpy as np
from astropy.io import fits

from catalogs.making.sources import MAGIC, triangles
from kochab.core.attitude import unit_vectors


def star_file(path, level, kind, stars):
    """Write a Stellarium file; ``stars`` dicts: ra, dec, pm, v, bv, hip, component, plx."""
    corners = triangles(level)
    centre = corners.sum(axis=1)
    centre /= np.linalg.norm(centre, axis=1, keepdims=True)
    east = np.cross([0.0, 0.0, 1.0], centre)
    east /= np.linalg.norm(east, axis=1, keepdims=True)
    north = np.cross(centre, east)
    flat = corners / np.einsum("zck,zk->zc", corners, centre)[..., None]
    full = 2**31 - 1 if kind == 0 else 2**19 - 1
    reach = [np.abs(np.einsum("zck,zk->zc", flat, axis)).max() for axis in (east, north)]
    scale = max(reach) / full
    low, span, steps = (-2000, 12800, 256) if kind == 0 else (9000, 1500, 30)
    zones = [[] for _ in centre]
    for star in stars:
        v = unit_vectors(star["ra"], star["dec"])
        zone = int(np.argmax(centre @ v))
        x, y = (v @ east[zone]) / (v @ centre[zone]), (v @ north[zone]) / (v @ centre[zone])
        step = int(np.floor((star["v"] * 1000 - low) / span * steps + 1e-9))
        pm = [round(p * 10) for p in star.get("pm", (0, 0))]
        bv = round((star.get("bv", 0.7) + 0.5) / 4 * 127)
        place = round(x / scale), round(y / scale)
        if kind == 0:
            ident = star.get("hip", 0) | star.get("component", 0) << 24
            plx = round(star.get("plx", 0) * 100)
            record = struct.pack("<IiiBBHiii", ident, *place, bv, step, 0, *pm, plx)
        else:
            bits, at = 0, 0
            fields = zip((*place, *pm, bv, step), (20, 20, 14, 14, 7, 5), strict=True)
            for value, width in fields:
                bits |= (value & (1 << width) - 1) << at
                at += width
            record = bits.to_bytes(10, "little")
        zones[zone].append(record)
    head = struct.pack("<I7i", MAGIC, kind, 0, 8, level, low, span, steps)
    counts = np.array([len(z) for z in zones], "<u4").tobytes()
    path.write_bytes(head + counts + b"".join(b"".join(z) for z in zones))


def index_file(path, stars):
    """Write the star tables of an astrometry.net index; ``stars`` (ra, dec, vt) rows."""
    ra, dec, vt = np.array(stars, dtype=float).T
    u = np.rint((unit_vectors(ra, dec) + 1.0) * (2**31 - 1)).astype("<u4")
    span = np.array([-1, -1, -1, 1, 1, 1, 2**31 - 1], "<f8")

    def table(name, rows):
        raw = np.ascontiguousarray(rows).view("u1").reshape(len(rows), -1)
        return fits.BinTableHDU.from_columns([fits.Column(name, f"{raw.shape[1]}B", array=raw)])

    tags = fits.BinTableHDU.from_columns([fits.Column("MAG_VT", "1E", array=vt)])
    hdus = [table("kdtree_range_stars", span[:, None]), table("kdtree_data_stars", u), tags]
    fits.HDUList([fits.PrimaryHDU(), *hdus]).writeto(path)


def ephemeris_file(path):
    """Write an SPK in which every body rests: body n at 0.01 n au along x, the Moon 0.0026 au from the Earth along y."""
    au, half = 149597870.69962819, 15_000 * 86400.0
    targets = [(n, 0, (0.01 * n * au, 0.0, 0.0)) for n in range(1, 11)]
    targets += [(301, 3, (0.0, 0.00257 * au, 0.0)), (399, 3, (0.0, -0.00003 * au, 0.0))]
    words, summaries = np.zeros(384), b""
    for target, centre, place in targets:
        begin = len(words) + 1
        series = [c for x in place for c in (x, 0.0)]
        words = np.concatenate([words, [0.0, half, *series], [-half, 4 * half, 8, 1]])
        summaries += struct.pack("<2d6i", -half, 3 * half, target, centre, 1, 2, begin, len(words))
    words = np.concatenate([words, np.zeros(-len(words) % 128)])
    raw = bytearray(words.astype("<f8").tobytes())
    raw[:8], raw[8:16], raw[76:80], raw[88:96] = (
        b"DAF/SPK ",
        struct.pack("<2i", 2, 6),
        struct.pack("<i", 2),
        b"LTL-IEEE",
    )
    raw[1024 : 1048 + len(summaries)] = struct.pack("<3d", 0, 0, len(targets)) + summaries
    path.write_bytes(raw)


FIELDS = ("full_name", "epoch_mjd", "e", "a", "q", "i", "om", "w", "ma", "tp", "H", "G", "K1", "M1")
CERES = (
    "     1 Ceres (A801 AA)",
    "59800",
    ".0786",
    "2.7666",
    "2.5491",
    "10.59",
    "80.27",
    "73.53",
    "334.3",
    None,
    "3.33",
    "0.12",
    None,
    None,
)
COMET = (
    "  67P/Churyumov-Gerasimenko",
    59505,
    ".6497",
    None,
    "1.2106",
    "3.87",
    "36.3",
    "22.1",
    None,
    "2459520.56",
    None,
    None,
    "11.9",
    "13.1",
)


def small_body_file(path, *rows):
    """Write an answer of JPL's Small-Body Database."""
    path.write_text(json.dumps({"fields": FIELDS, "data": rows}))


def write_packages(folder, bright, faint, tycho, listed):
    """A whole set of sources; ``bright`` and ``faint`` are Stellarium stars, ``listed`` dicts."""
    home = folder / "stars" / "default"
    western = folder / "skycultures" / "western"
    home.mkdir(parents=True)
    western.mkdir(parents=True)
    star_file(home / "stars_0_0v0_8.cat", 0, 0, bright)
    star_file(home / "stars_3_1v0_4.cat", 3, 1, faint)
    rows = {s["hip"]: s.get("pm", (0, 0)) for s in bright if s.get("hip")}
    pm = "".join(f"{h}\t{a}\t{d}\n" for h, (a, d) in reversed(rows.items()))
    (home / "hip_pm.dat").write_text("# HIP\tpmRA\tpmDE\n" + pm)
    (home / "cross-id.dat").write_text("# HIP\t\tSAO\tHD\tHR\n91262\t\t67174\t172167\t7001\n7\t\t\t5\n")
    (home / "name.fab").write_text("91262|α_Lyr\n91262|3_Lyr\n7|61_Cyg_A\n")
    (home / "gcvs_hip_part.dat").write_text(
        "7\tR And\tM\t5.8\t0\t15.2\t\tV\t53820.\t409.2\t38\tS3\n8\tX Cyg\tEA\t6\t1\t0.5\t\tHp\t\t2.5\t\tA\n"
        "9\tY Lyr\tRCB\t8.3\t2\t16.5\t\tV\t\t\t\tR\n4\tCut\tM\n91262\tZ Lyr\tCST\t9.4\t0\t\t\tV\t\t\t\tK\n"
    )
    (western / "star_names.fab").write_text('# x\n 91262|_("Vega") 1,2\n91262|_("Harp star") 3\n')
    (western / "constellationship.fab").write_text("Lyr 2  91262 7 7 8\nCyg 1  8 91262\n")
    ephemeris_file(folder / "de421.bsp")
    small_body_file(folder / "asteroids.dat", CERES, (None,) * len(FIELDS))
    small_body_file(folder / "comets.dat", COMET, ("3D/Biela", *COMET[1:]), (*COMET[:-1], None))
    index_file(folder / "index-tycho2-07.littleendian.fits", tycho)
    ra, dec = np.radians([(s["ra"], s["dec"]) for s in listed]).T
    table = np.stack([ra, dec, ra, ra, ra, [s["v"] for s in listed]], axis=1).astype("f4")
    hip = np.array([s["hip"] for s in listed], "u4")
    np.savez(folder / "default_database.npz", star_table=table, star_catalog_IDs=hip)
    with sqlite3.connect(folder / "ongc.db") as database:
        columns = "name, type, ra, dec, vmag, bmag, majax, minax, pa, messier, commonnames"
        database.execute(f"create table objects ({columns})")
        m31 = ("NGC0224", "G", 0.18648479, 0.7202808, 3.44, 4.29, 177.83, 69.66, 35, "031", "Andromeda Galaxy")
        gone = ("NGC0001A", "Dup", 0.1, 0.1, None, None, None, None, None, None, None)
        flame = ("NGC2024", "Neb", 1.49099, -0.0324, None, None, None, None, None, "", "")
        ic434 = ("IC0434", "HII", 1.48796, -0.04283, None, 11.0, 90.0, 30.0, None, "", "Flame Nebula")
        database.executemany(f"insert into objects values ({','.join('?' * 11)})", [m31, gone, flame, ic434])
    database.close()
    dso_file(
        folder,
        [
            {"ra": 1.49102, "dec": -0.03215, "kind": 16, "size": 2.0, "numbers": {0: 2024, 5: 277}},
            {"ra": 1.48702, "dec": -0.04363, "kind": 17, "size": 1.0, "numbers": {1: 434}},
            {"ra": 0.18648, "dec": 0.72028, "kind": 0, "size": 3.0, "numbers": {0: 224, 2: 31}},
            {"ra": 6.00953, "dec": 1.09041, "kind": 17, "size": 0.8, "numbers": {5: 155}},
            {"ra": 6.0, "dec": 1.0, "kind": 0, "size": 0.1, "numbers": {12: 5}},
        ],
    )


def dso_file(folder, objects):
    """Write Stellarium's objects as a Qt data stream, with their names, an outline and a boundary."""
    home = folder / "nebulae" / "default"
    home.mkdir(parents=True)

    def text(word):
        return struct.pack(">I", 2 * len(word)) + word.encode("utf-16-be") if word else b"\xff\xff\xff\xff"

    data = text("3.16") + text("standard")
    for number, one in enumerate(objects):
        data += struct.pack(">I4dI", number, one["ra"], one["dec"], 99.0, 99.0, one["kind"]) + text("Sb")
        data += struct.pack(">2di6d", one["size"], 0.0, 0, *[0.0] * 6)
        data += struct.pack(">14I", *[one["numbers"].get(k, 0) for k in range(14)])
        data += text("") + struct.pack(">2I", 0, 0) + text("") * 7 + struct.pack(">5I", *[0] * 5)
    (home / "catalog.dat").write_bytes(gzip.compress(data, mtime=0))
    (home / "names.dat").write_text(
        "# names\n"
        'NGC  2024            _("Flame Nebula") # WK, TSS\n'
        'NGC  2024            _("Lips") # ONE\n'
        'M    31              _("Andromeda Nebula") # ONE\n'
        'SH2  155             _("Cave Nebula") # PSA, PAS, CC\n'
    )
    (home / "outlines.dat").write_text("# x\n5.6 -1.5 start  NGC 2024\n5.8 -2.0 end\n")
    (folder / "constellation_boundaries.dat").write_text("2 2.0 -1.0 3.0 2.0 2 AQL CMA\n")
