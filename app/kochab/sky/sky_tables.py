"""What the sky layer draws, from the shipped tables: objects with outlines, named stars, figures and boundaries."""

from functools import lru_cache
from pathlib import Path

import numpy as np

from kochab.core.arrays import Floats, Table
from kochab.core.attitude import cross_product, unit_vectors
from kochab.core.errors import CatalogueError
from kochab.core.values import frozen
from kochab.sky.landmarks import constellation_names
from kochab.sky.names import SkyObjects, StarNames, read_objects

OBLIQUITY = np.radians(84381.406 / 3600.0)  # of the ecliptic at J2000, IAU 2006
GALACTIC_POLE_DEG = (192.8594813, 27.1282512)  # ICRS of the galactic north pole (Hipparcos, vol. 1, eq. 1.5.10)
HIDDEN = ("*", "**", "Other", "Nova")  # OpenNGC's single stars, and what is no object
SOUGHT = ("LBN", "LDN", "PK", "SNR", "Ced", "HCG")  # named where somebody looks for them, or knows a name
DARK_MAG, CLUSTER_MAG = 14.0, 15.0  # taken for what has no magnitude: Barnard's nebulae, Abell's clusters
MESSIER, NAMED, SPARSE = 4.0, 2.5, 13.0  # magnitudes of fame, and of clusters that only Collinder and Melotte saw
UNSEEN = 2.0  # magnitudes by which a nebula without a magnitude, a name and a number of the NGC is named later
EPOCH, MAS = 2000.0, np.radians(1.0 / 3.6e6)


@frozen(eq=False)
class NamedStars(Table):
    """Hipparcos' stars, brightest first: HIP number, name as charts print it, vector (N, 3) at J2000, V, motion.

    The name is empty where charts print none; ``hd`` is 0 without a number. ``step`` (N, 3) is the proper motion,
    radians a year. ``pair`` (N, 3) is where Hipparcos saw the brightest other component of the entry in 1991: arcsec,
    position angle in degrees and V; NaN where it saw none.
    """

    hip: np.ndarray[tuple[int], np.dtype[np.int64]]
    name: np.ndarray[tuple[int], np.dtype[np.str_]]
    vector: Floats
    mag: Floats
    step: Floats
    pair: Floats
    hd: np.ndarray[tuple[int], np.dtype[np.int64]]

    def called(self, row: int) -> str:
        """The name, else the HD number, else HIP's."""
        return str(self.name[row]) or (f"HD {self.hd[row]}" if self.hd[row] else f"HIP {self.hip[row]}")


@frozen(eq=False)
class Variable:
    """A variable star by the GCVS: type, band, magnitudes at maximum and minimum, period in days; NaN is unknown."""

    kind: str
    band: str
    brightest: float
    faintest: float
    period_d: float


@frozen(eq=False)
class SkyTables:
    """All of it. ``lines`` are chains of vectors by what they are; ``outlines`` by the row of their object.

    ``texts`` are the objects' designations, and these with their common names. ``ranks`` (N,) say how
    soon an object is named, as magnitudes; inf for single stars and what is no object. ``variables`` go by HIP number.
    """

    objects: SkyObjects
    ranks: Floats
    texts: tuple[tuple[str, str], ...]
    stars: NamedStars
    variables: dict[int, Variable]
    lines: dict[str, tuple[Floats, ...]]
    outlines: dict[int, tuple[Floats, ...]]
    constellations: tuple[tuple[str, Floats], ...] = ()


def _named_stars(names: StarNames) -> NamedStars:
    bright = names.bright
    column = bright.column
    hips, rows = np.unique(column("hip").astype(np.int64), return_index=True)  # each one's brightest component
    order = np.argsort(column("mag")[rows], kind="stable")
    hips, rows = hips[order], rows[order]
    ra, dec = (column(name)[rows] * (2.0 * np.pi / 2**32) for name in ("ra", "dec"))
    east = np.stack([-np.sin(ra), np.cos(ra), np.zeros_like(ra)], axis=1)
    vector = unit_vectors(np.degrees(ra), np.degrees(dec))
    motion = [column(name)[rows, None] * (1e-2 * MAS) for name in ("pm_ra", "pm_dec")]
    step = motion[0] * east + motion[1] * cross_product(vector, east)
    named = np.flatnonzero(np.isin(hips, np.fromiter(names.table, dtype=np.int64)))
    given = np.array([names.label(row)[1] for row in rows[named].tolist()])
    labels = np.zeros(len(hips), dtype=given.dtype)
    labels[named] = given
    other = np.minimum(rows + 1, len(column("hip")) - 1)
    # as int32 the difference is the shorter way round, across 0h too
    across, up = ((column(name)[other] - column(name)[rows]).astype(np.int32) for name in ("ra", "dec"))
    offset = np.stack([across * np.cos(dec), up], axis=1) * (1296000.0 / 2**32)
    pa_deg = np.degrees(np.arctan2(*offset.T)) % 360.0
    pair = np.stack([np.hypot(*offset.T), pa_deg, column("mag")[other] * 1e-3], axis=1)
    pair[(other == rows) | (column("hip")[other] != column("hip")[rows])] = np.nan
    return NamedStars(hips, labels, vector, column("mag")[rows] * 1e-3, step, pair, column("hd")[rows].astype(np.int64))


def _chains(path: Path) -> list[tuple[str, Floats]]:
    """(first column, vectors (N, 3)) of every line of RA and Dec in degrees."""
    try:
        lines = (line.split("\t") for line in path.read_text("utf-8").splitlines()[1:])
        places = [(head, np.array(rest.split(), dtype=np.float64).reshape(-1, 2)) for head, rest in lines]
        return [(head, unit_vectors(*place.T)) for head, place in places]
    except (OSError, ValueError):
        raise CatalogueError("The table {path} is missing or damaged.", path=path) from None


def _variables(path: Path) -> dict[int, Variable]:
    try:
        lines = (line.split("\t") for line in path.read_text("utf-8").splitlines()[1:])
        rows = ((int(hip), kind, band, [float(value or "nan") for value in rest]) for hip, kind, band, *rest in lines)
        return {hip: Variable(kind, band, *limits) for hip, kind, band, limits in rows}
    except (OSError, ValueError, TypeError):
        raise CatalogueError("The table {path} is missing or damaged.", path=path) from None


def _figures(path: Path, stars: NamedStars, names: StarNames) -> tuple[Floats, ...]:
    """The constellations' figures as chains of their stars."""
    try:
        rows = [[int(n) for n in line.split("\t")[1].split()] for line in path.read_text("utf-8").splitlines()[1:]]
        numbers = names.bright.column("hip")
        ra, dec = (names.bright.column(name) for name in ("ra", "dec"))
        at = [np.searchsorted(numbers, np.array(row, dtype=numbers.dtype)) for row in rows]
        return tuple(unit_vectors(ra[row] * (360.0 / 2**32), dec[row] * (360.0 / 2**32)) for row in at)
    except (OSError, ValueError, IndexError):
        raise CatalogueError("The list of constellation figures {path} is missing or damaged.", path=path) from None


def _constellations(path: Path, figures: tuple[Floats, ...]) -> tuple[tuple[str, Floats], ...]:
    """The stars (N, 3) of each constellation's figure by its name; ``figures`` are the chains of the file's lines."""
    full, found = constellation_names(), dict[str, list[Floats]]()
    for line, chain in zip(path.read_text("utf-8").splitlines()[1:], figures, strict=True):
        found.setdefault(line.split("\t")[0].split(" ")[0], []).append(chain)
    return tuple((full.get(short, short), np.unique(np.concatenate(chains), axis=0)) for short, chains in found.items())


def _circle(pole: Floats) -> Floats:
    """The great circle (73, 3) about a pole."""
    first = cross_product(pole, [0.0, 0.0, 1.0])
    first /= np.linalg.norm(first)
    angle = np.linspace(0.0, 2.0 * np.pi, 73)[:, None]
    return np.asarray(np.cos(angle) * first + np.sin(angle) * cross_product(pole, first))


def ranks_of(objects: SkyObjects) -> Floats:
    """Magnitudes that count how well known an object is; nebulae and what has none go by their size."""
    kind, size = objects.kind, np.nan_to_num(objects.major)
    dark, clusters = kind == "DrkN", kind == "GalCl"
    guess = np.where(dark, DARK_MAG, np.where(clusters, CLUSTER_MAG, 13.0)) - 2.0 * np.log10(np.maximum(size, 1.0))
    mag = np.where(objects.band == "?", np.nan, objects.mag)  # what two sources contradict ranks nothing
    by_size = ~np.isfinite(mag) | np.isin(kind, ["HII", "Neb", "EmN", "RfN"])
    rank = np.where(by_size, np.fmin(mag, guess), mag)
    rank = np.where(clusters, np.maximum(rank, CLUSTER_MAG), rank)
    rank = rank - MESSIER * (objects.messier != "") - NAMED * (objects.common != "")
    catalogue = np.char.partition(objects.name, " ")[:, 0]
    rank += SPARSE * (np.isin(catalogue, ["Cr", "Mel"]) & (objects.messier == ""))
    unseen = np.isin(kind, ["Neb", "EmN", "RfN", "PN"]) & ~np.isfinite(mag) & (catalogue != "NGC")
    rank += UNSEEN * (unseen & (objects.common == ""))
    rank += SPARSE * (np.isin(catalogue, SOUGHT) & (objects.common == ""))
    return np.where(np.isin(kind, HIDDEN), np.inf, rank)


@lru_cache(maxsize=2)
def sky_tables(folder: Path | None = None) -> SkyTables:
    """Read the tables of ``folder``, by default the shipped ones: a quarter of a second, once."""
    from kochab.sky.catalogue import shipped_folder

    folder = folder or shipped_folder()
    names = StarNames(folder)
    objects, stars = read_objects(folder / "objects.tsv"), _named_stars(names)
    # an outline may bear another number of its object, such as IC 2118 of the Witch Head
    row_of = {word: row for row, words in enumerate(objects.also.tolist()) if words for word in words.split(",")}
    # reversed, so that the first row of a name is the one that is kept
    row_of |= {name: row for row, name in reversed([*enumerate(objects.name.tolist())])}
    row_of |= {name.replace("M", "M ", 1): row for row, name in enumerate(objects.messier.tolist()) if name}
    outlines: dict[int, tuple[Floats, ...]] = {}
    for name, shape in _chains(folder / "outlines.tsv"):
        if name in row_of:
            closed = np.vstack([shape, shape[:1]])  # many end a side short of where they began
            outlines[row_of[name]] = (*outlines.get(row_of[name], ()), closed)
    pole = np.array([0.0, -np.sin(OBLIQUITY), np.cos(OBLIQUITY)])
    figures = _figures(folder / "lines.tsv", stars, names)
    lines = {
        "figures": figures,
        "boundaries": tuple(shape for _, shape in _chains(folder / "boundaries.tsv")),
        "ecliptic": (_circle(pole),),
        "galactic": (_circle(unit_vectors(*GALACTIC_POLE_DEG)),),
    }
    names_of = tuple(map(objects.label, range(len(objects))))
    variables, called = _variables(folder / "variables.tsv"), _constellations(folder / "lines.tsv", figures)
    return SkyTables(objects, ranks_of(objects), names_of, stars, variables, lines, outlines, called)
