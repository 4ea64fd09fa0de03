"""What an astronomer calls a field: its constellation, and the most notable deep-sky object in it."""

from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from kochab.core.arrays import Bools, Floats
from kochab.core.attitude import radec_deg, unit_vectors
from kochab.core.solution import Solution
from kochab.core.values import frozen
from kochab.sky.catalogue import shipped_folder
from kochab.text.translation import tr

LEAST_SHARE = 0.04  # of the frame's shorter side: a smaller object does not name a frame
WIDE_DEG, WIDE_SHARE = (10.0, 20.0), 0.1  # between such widths it grows to so much: a wide frame is of a constellation
NAMED_SHARE = 0.2  # in its place for what has a name and no Messier number, which few look for in a wide frame
BARE_DEG, BARE_SHARE = (3.0, 8.0), 0.15  # the same of objects that have a number alone
AREA_MAG = 1.0  # by which an object that fills the frame counts as brighter than one a tenth as long
MARGIN = 0.1  # of the frame's sides, where an object is not what the frame is of
TO_EDGE_MAG = 5.0  # by which an object at the edge must be brighter than one at the centre
MESSIER_MAG, NAMED_MAG = 4.5, 2.0  # by which a name counts as brighter
BRIGHTEST_MAG, UNKNOWN_MAG, FAINTEST_MAG = 2.0, 9.0, 11.0  # the Belt, V 0.6, is no better known than M 42
FAINTEST_AT_1_DEG = 12.5  # that names a frame, and five magnitudes brighter for ten times the field
STAR_MAG, STAR_FIELD_DEG = 4.0, 10.0  # the faintest star that names a frame, and the widest
UNKNOWN_ARCMIN = 1.0
WIDEST_NAMED_DEG = 45.0  # wider frames are of a constellation, not of an object in it
NEBULAE = ("HII", "Neb", "EmN", "RfN", "DrkN", "SNR", "Cl+N")  # a named one counts as this bright, but for loops
NEBULA_MAG = 5.2
LOOP_ARCMIN, LOOP_SHARE = 200.0, 1.25  # a nebula as large names a frame that has it whole, no field within it
WIDEST_NEBULA_ARCMIN = 600.0  # Barnard's Loop and the Gum Nebula name none
MINOR = ("Cr ", "Mel ", "Ru ", "Stock ", "Tr ", "Arp ", "HCG ", "RCW ", "Ced ", "SNR ", "PK ", "LBN ", "LDN ")
"""Catalogues whose numbers name no field."""
STARS = ("*", "**")  # OpenNGC's types of entries that are no objects


@cache
def _boundaries() -> tuple[Floats, list[str], dict[str, str]]:
    """Roman's zones of 1875: hours from and to, least declination (N, 3); whose each is; the constellations' names.

    Roman (1987), PASP 99, 695, as Astropy ships it; a place belongs to the first zone that holds it.
    """
    astropy = find_spec("astropy")  # not imported: that takes half a second
    data = Path(str(astropy and astropy.origin)).parent / "coordinates" / "data"
    zones, names = (
        [line.strip().split(maxsplit=most) for line in (data / name).read_text("utf-8").splitlines() if line[0] != "#"]
        for name, most in (("constellation_data_roman87.dat", 3), ("constellation_names.dat", 1))
    )
    # Three of the IAU's names are misspelt in Astropy.
    called = dict(names) | {"Cha": "Chamaeleon", "Oph": "Ophiuchus", "PsA": "Piscis Austrinus"}
    return np.array([zone[:3] for zone in zones], dtype=np.float64), [zone[3] for zone in zones], called


def constellation_at(vector: Floats) -> str:
    """The constellation, such as ``"Ursa Minor"``, of a place (3,) in ICRS."""
    import erfa

    limits, whose, names = _boundaries()
    ra, dec = radec_deg(erfa.ltp(1875.0) @ vector)
    first, last, least = limits.T
    return names[whose[int(np.argmax((first <= ra / 15.0) & (ra / 15.0 < last) & (least <= dec)))]]


def constellation_names() -> dict[str, str]:
    """The 88 constellations' names by their abbreviations."""
    return _boundaries()[2]


@frozen(eq=False)
class Landmarks:
    """Deep-sky objects worth a name: ICRS vectors (N, 3), V, by how much a name counts, diameters in degrees (N,).

    ``loop`` (N,) says which name a field only where it has them whole: large nebulae, and figures of stars.
    """

    names: list[str]
    vectors: Floats
    mag: Floats
    fame_mag: Floats
    size_deg: Floats
    loop: Bools


@cache
def landmarks() -> Landmarks:
    """Those of the shipped table that have a Messier number or a common name, or are bright, and figures of stars.

    Empty without the tables.
    """
    try:
        rows, figures = (
            (shipped_folder() / name).read_text(encoding="utf-8").splitlines()[1:]
            for name in ("objects.tsv", "nicknames.tsv")
        )
    except OSError:
        rows = figures = []
    names, numbers = list[str](), list[tuple[float, ...]]()
    for row in figures:
        called, _, ra, dec, _, _, size = row.split("\t")
        if size:  # the Belt, the Big Dipper
            names.append(called.partition(";")[0])
            numbers.append((float(ra), float(dec), BRIGHTEST_MAG, NAMED_MAG, float(size) / 60.0, True))
    for row in rows:
        name, kind, ra, dec, mag, size, messier, common = (row.split("\t") + [""] * 7)[:8]
        v = float(mag or UNKNOWN_MAG + FAINTEST_MAG * (not (messier or common)))
        arcmin, nebula = float(size or UNKNOWN_ARCMIN), kind in NEBULAE
        if nebula and common and not messier and arcmin < WIDEST_NEBULA_ARCMIN:
            v = min(v, NEBULA_MAG)
        if kind not in STARS and (messier or common or (v < FAINTEST_MAG and not name.startswith(MINOR))):
            names.append(f"M {messier[1:].lstrip('0')}" if messier else common.partition(",")[0] or name)
            fame = MESSIER_MAG if messier else NAMED_MAG if common else 0.0
            numbers.append((float(ra), float(dec), v, fame, arcmin / 60.0, nebula and arcmin > LOOP_ARCMIN))
    table = np.array(numbers).reshape(-1, 6)
    mag, fame_mag, size_deg, loop = table.T[2:]
    return Landmarks(names, unit_vectors(table[:, 0], table[:, 1]), mag, fame_mag, size_deg, loop > 0.0)


def name_of_field(solution: Solution) -> str:
    """``"M 42 in Orion"``, ``"Sadr in Cygnus"`` beside a bright star, or ``"Cygnus"``, where the frame's centre is."""
    known, camera = landmarks(), solution.camera
    size = np.array([camera.width, camera.height])
    wide, narrow = max(camera.fov_deg), min(camera.fov_deg)
    reach = min(0.6 * np.radians(np.hypot(wide, narrow)), 1.5)  # past it a lens's model may fold back into the frame
    near = np.flatnonzero(known.vectors @ solution.centre_vector > np.cos(reach))
    away = 2.0 * np.abs(solution.pixels_of(known.vectors[near]) / size - 0.5).max(axis=1)  # 0 centre, 1 edge
    # an object that surrounds the centre counts as central wherever its own middle lies
    around = known.vectors[near] @ solution.centre_vector > np.cos(np.radians(known.size_deg[near] / 2))
    whole = away + known.size_deg[near] / narrow <= LOOP_SHARE
    away = np.where(around, 0.0, away)
    messier, called, bare = (
        np.interp(wide, degrees, (LEAST_SHARE, share))
        for degrees, share in ((WIDE_DEG, WIDE_SHARE), (WIDE_DEG, NAMED_SHARE), (BARE_DEG, BARE_SHARE))
    )
    fame = known.fame_mag[near]
    least = np.select([fame >= MESSIER_MAG, fame > 0.0], [messier, called], bare)
    seen = (known.size_deg[near] >= least * narrow) & (away < 1.0 - 2.0 * MARGIN)
    seen &= (wide <= WIDEST_NAMED_DEG) & (whole | ~known.loop[near])
    seen &= known.mag[near] <= FAINTEST_AT_1_DEG - 5.0 * np.log10(wide)
    constellation = constellation_at(solution.centre_vector)
    if seen.any():
        share = np.clip(known.size_deg[near] / narrow, LEAST_SHARE, 1.0)
        score = np.maximum(known.mag[near], BRIGHTEST_MAG) - fame - AREA_MAG * np.log10(share)
        score += TO_EDGE_MAG * away**2
        best = int(np.argmin(np.where(seen, score, np.inf)))
        place = constellation_at(known.vectors[near[best]])
        if place == constellation or away[best] < 0.5:  # towards the edge a neighbour's object names no frame
            return _name_in_constellation(known.names[near[best]], place)
    named = [star for star in solution.named if star.name and star.mag < STAR_MAG and wide < STAR_FIELD_DEG]
    return _name_in_constellation(min(named, key=lambda star: star.mag).name, constellation) if named else constellation


def _name_in_constellation(name: str, constellation: str) -> str:
    return tr("{name} in {constellation}", name=name, constellation=constellation)
