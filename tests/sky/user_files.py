"""Writers of the star files that users have, byte for byte as their makers lay them out; stars as (ra, dec, mag) in degrees."""

import base64
import gzip
import math

import numpy as np

from kochab.core.attitude import unit_vectors

# Rings of declination south to north and cells in each, as HNSKY's help and ASTAP's documentation print them.
DECS_290 = (
    -90,
    -85.23224404,
    -75.66348756,
    -65.99286637,
    -56.14497387,
    -46.03163067,
    -35.54307745,
    -24.53348115,
    -12.79440589,
    0,
)
DECS_1476 = (-90, -87.42857143, -82.28571429, -77.14285714, -72, -66.85714286, -61.71428571, -56.57142857, -51.42857143, -46.28571429, -41.14285714, -36, -30.85714286, -25.71428571, -20.57142857, -15.42857143, -10.28571429, -5.142857143, 0)  # fmt: skip
CELLS_290 = (1, 4, 8, 12, 16, 20, 24, 28, 32)
CELLS_1476 = (1, 3, 9, 15, 21, 27, 33, 38, 43, 48, 52, 56, 60, 63, 65, 67, 68, 69)
SKIES = {"290": (DECS_290, CELLS_290), "1476": (DECS_1476, CELLS_1476)}


def astap_area(stars, size=5):
    """One area's file: 110 bytes of header, then sections of one magnitude and one upper byte of Dec, brightest first."""
    out = bytearray(b"Made by Kochab's tests from its own stars".ljust(109) + bytes([size]))
    rows = []
    for star in stars:
        ra, dec, mag = star[:3]
        whole = round(dec * (128 * 256 * 256 - 1) / 90.0)
        rows.append((round(mag * 10), whole >> 16, round(ra % 360.0 * (256**3 - 1) / 360.0), whole & 0xFFFF, star[3:]))
    last = None
    for mag, upper, ra, lower, colour in sorted(rows):
        if (mag, upper) != last:
            out += b"\xff\xff\xff" + bytes([upper + 128, mag + 16]) + b"\0" * (size - 5)
            last = mag, upper
        # a star whose RA rounds to all ones would be a header
        out += min(ra, 0xFFFFFE).to_bytes(3, "little") + lower.to_bytes(2, "little")
        if size == 6:
            out += round(10 * colour[0] if colour else 0).to_bytes(1, "little", signed=True)
    return bytes(out)


def write_astap(folder, name, stars, sky="1476", size=5, every_area=True):
    """A database of all its files; ``stars`` (N, 3 or 4): RA, Dec, magnitude, colour."""
    stars = np.asarray(stars, dtype=float)
    south, cells = SKIES[sky]
    decs = np.array([*south, *(-d for d in south[-2::-1])])
    cells = np.array([*cells, *cells[::-1]])
    ring = np.clip(np.searchsorted(decs, stars[:, 1], side="left") - 1, 0, len(cells) - 1)
    cell = np.minimum((stars[:, 0] % 360.0 / 360.0 * cells[ring]).astype(int), cells[ring] - 1)
    area = ring * 100 + cell
    order = np.argsort(area, kind="stable")
    edges = np.searchsorted(area[order], np.arange(3700))
    for r in range(len(cells)):
        for c in range(cells[r]):
            rows = order[edges[r * 100 + c] : edges[r * 100 + c + 1]]
            if every_area or len(rows):
                data = astap_area(stars[rows].tolist(), size)
                (folder / f"{name.lower()}_{r + 1:02d}{c + 1:02d}.{sky}").write_bytes(data)


def write_wide(folder, name, stars):
    """ASTAP's W08: a count and floats."""
    ra, dec, mag = np.asarray(stars, dtype=float)[:, :3].T
    order = np.argsort(mag, kind="stable")
    table = np.column_stack([mag * 10.0, np.radians(ra), np.radians(dec)])[order].astype("<f4")
    (folder / f"{name}_0101.001").write_bytes(len(table).to_bytes(4, "little") + table.tobytes())


# -- FITS, by hand: the reader under test has its own, and astropy reads what this writes ----------


def cards(*pairs):
    """A header of whole blocks."""
    out = ""
    for key, value in pairs:
        text = (
            f"'{value:<8}'"
            if isinstance(value, str)
            else f"{'T' if value else 'F'}".rjust(20)
            if isinstance(value, bool)
            else f"{value}".rjust(20)
        )
        out += f"{key:<8}= {text}".ljust(80)
    out += "END".ljust(80)
    return out.ljust(-(-len(out) // 2880) * 2880).encode()


def table(columns, rows, *more):
    """A binary table of bytes; ``columns`` (name, form)."""
    width = len(rows[0]) if len(rows) else 0
    head = [("XTENSION", "BINTABLE"), ("BITPIX", 8), ("NAXIS", 2), ("NAXIS1", width), ("NAXIS2", len(rows))]
    head += [("PCOUNT", 0), ("GCOUNT", 1), ("TFIELDS", len(columns))]
    for k, (name, form) in enumerate(columns, 1):
        head += [(f"TTYPE{k}", name), (f"TFORM{k}", form)]
    data = b"".join(rows)
    return cards(*head, *more) + data.ljust(-(-len(data) // 2880) * 2880, b"\0")


def raw_table(name, numbers):
    rows = np.ascontiguousarray(numbers).reshape(len(numbers), -1)
    width = rows.dtype.itemsize * rows.shape[1]
    return table([(name, f"{width}A")], [row.tobytes() for row in rows])


def star_tree(xyz, leaf=16):
    """libkd's tree of unsigned stars (N, 3): the order of the rows, the cuts and the last row of each leaf."""
    depth = max(1, math.ceil(math.log2(max(len(xyz) / leaf, 2))))
    cuts, order = np.zeros(2**depth - 1, np.uint32), np.arange(len(xyz))
    last = np.zeros(2**depth, np.uint32)

    def split(node, begin, end):
        if node >= len(cuts):
            last[node - len(cuts)] = end - 1
            return
        here = order[begin:end]
        axis = int(np.argmax(np.ptp(xyz[here].astype(np.int64), axis=0))) if len(here) else 0
        here = here[np.argsort(xyz[here, axis], kind="stable")]
        order[begin:end] = here
        middle = len(here) // 2
        at = int(xyz[here[middle], axis]) if len(here) else 0
        cuts[node] = (at & ~3) | axis
        split(2 * node + 1, begin, begin + middle)
        split(2 * node + 2, begin + middle, end)

    split(0, 0, len(xyz))
    return order, cuts, last


def write_index(path, stars, index_id=5206, healpix=-1, side=0, magnitudes="phot_g_mean_mag", big_endian=False):
    """An astrometry.net index file, but for its quads; without ``magnitudes`` as the LIGHT series are."""
    ra, dec, mag = np.asarray(stars, dtype=float)[:, :3].T
    scale = 2.0**31 - 1
    xyz = np.rint((unit_vectors(ra, dec) + 1.0) * scale).astype(np.uint32)
    order, cuts, last = star_tree(xyz)
    u4, f8 = (">u4", ">f8") if big_endian else ("<u4", "<f8")
    endian = "01:02:03:04" if big_endian else "04:03:02:01"
    span = np.array([-1, -1, -1, 1, 1, 1, scale])
    out = cards(("SIMPLE", True), ("BITPIX", 8), ("NAXIS", 0), ("EXTEND", True), ("ENDIAN", endian), ("AN_FILE", "QUAD"), ("NSTARS", len(ra)), ("INDEXID", index_id), ("HEALPIX", healpix), ("HPNSIDE", side))  # fmt: skip
    out += table([("kdtree_header_stars", "0A")], [])
    out += raw_table("kdtree_lr_stars", last.astype(u4)) + raw_table("kdtree_split_stars", cuts.astype(u4))
    out += raw_table("kdtree_range_stars", span.astype(f8)) + raw_table("kdtree_data_stars", xyz[order].astype(u4))
    sweep = np.minimum(np.argsort(np.argsort(mag)) // max(1, len(mag) // 10) + 1, 255).astype("u1")
    out += table([("sweep", "1B")], [bytes([s]) for s in sweep[order]])
    if magnitudes:
        out += table([(magnitudes, "1E")], [np.array(m, ">f4").tobytes() for m in mag[order]])
    path.write_bytes(out)


GAIA = ("source_id", "ra", "dec", "pmra", "pmdec", "phot_g_mean_mag", "bp_rp", "ref_epoch")


def write_gaia(path, stars):
    """A table as the Gaia archive gives it, of the kind that its name says."""
    ra, dec, mag = np.asarray(stars, dtype=float)[:, :3].T
    rows = [(k, a, d, 0.0, 0.0, m, 0.8, 2016.0) for k, (a, d, m) in enumerate(zip(ra, dec, mag, strict=True))]
    name = path.name.removesuffix(".gz")
    if name.endswith("csv"):
        data = "\n".join([",".join(GAIA), *(",".join(map(str, row)) for row in rows)]).encode()
    elif name.endswith("fits"):
        packed = np.array(rows, np.dtype([(n, ">i8" if n == "source_id" else ">f4" if n in ("phot_g_mean_mag", "bp_rp") else ">f8") for n in GAIA]))  # fmt: skip
        forms = [(n, {"source_id": "1K", "phot_g_mean_mag": "1E", "bp_rp": "1E"}.get(n, "1D")) for n in GAIA]
        data = cards(("SIMPLE", True), ("BITPIX", 8), ("NAXIS", 0)) + table(forms, [row.tobytes() for row in packed])
    else:
        kinds = {"source_id": "long", "phot_g_mean_mag": "float", "bp_rp": "float"}
        fields = "".join(f'<FIELD name="{n}" datatype="{kinds.get(n, "double")}"/>' for n in GAIA)
        # BINARY2: a byte of flags for nulls before each row, then big-endian values
        packed = np.array([(0, *row) for row in rows], np.dtype([("null", "u1"), *((n, {"long": ">i8", "float": ">f4"}.get(kinds.get(n, ""), ">f8")) for n in GAIA)]))  # fmt: skip
        stream = base64.b64encode(packed.tobytes()).decode()
        data = f'<?xml version="1.0"?><VOTABLE version="1.4" xmlns="http://www.ivoa.net/xml/VOTable/v1.3"><RESOURCE type="results"><TABLE>{fields}<DATA><BINARY2><STREAM encoding="base64">{stream}</STREAM></BINARY2></DATA></TABLE></RESOURCE></VOTABLE>'.encode()
    path.write_bytes(gzip.compress(data) if path.name.endswith(".gz") else data)
