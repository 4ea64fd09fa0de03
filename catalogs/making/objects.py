"""Make the tables of deep-sky objects, outlines and boundaries from OpenNGC and Stellarium, names checked by both."""

import re
import sqlite3
from collections import defaultdict
from collections.abc import Container, Sequence
from contextlib import closing
from pathlib import Path

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.errors import CatalogueError
from kochab.lab.bench.stellarium_objects import SkyObject, designation, plain, read_names, read_stellarium
from kochab.sky.catalogue_file import TURN, write_container, write_whole
from kochab.sky.names import GENITIVES, MAG_SOURCES, read_objects
from kochab.sky.sky_tables import ranks_of

BROUGHT = (
    "M",
    "C",
    "B",
    "Sh2",
    "vdB",
    "Abell",
    "Cr",
    "Mel",
    "RCW",
    "Tr",
    "Stock",
    "Ru",
    "Arp",
    "HCG",
    "Ced",
    "SNR G",
    "PK",
    "LBN",
    "LDN",
)
"""Objects of these that OpenNGC lacks are taken from Stellarium, called by the first that they have."""
APART_ARCMIN = 5.0  # a name of both sources may be that far apart, or a third of the object
CITED = 3  # sources that Stellarium gives for a name before it is shown
CORRECTIONS = Path(__file__).with_name("corrections.tsv")
MORE_OBJECTS = Path(__file__).with_name("more_objects.tsv")
OUTLINE_OF = {"NGC 1978": "NGC 1977", "IC 1848": "Sh2-199", "LBN 933": "Sh2-276", "LBN 988": "Sh2-276"}
"""Stellarium's outline of the Running Man bears a number of the Large Magellanic Cloud, the Soul's its cluster's,
those of the two arcs of Barnard's Loop their own."""


def read_openngc(database: Path) -> list[SkyObject]:
    """OpenNGC's objects; duplicates and lost ones are left out."""
    query = (
        "select name, type, ra, dec, vmag, bmag, majax, minax, pa, messier, commonnames"
        " from objects where ra is not null and type not in ('Dup', 'NonEx') order by name"
    )
    try:
        with closing(sqlite3.connect(f"file:{database}?mode=ro", uri=True)) as connection:
            rows = connection.execute(query).fetchall()
    except sqlite3.Error as error:
        raise CatalogueError("{name} cannot be read: {error}.", name=database.name, error=error) from error
    found = []
    for name, kind, ra, dec, visual, blue, major, minor, pa, messier, common in rows:
        one = SkyObject(designation(name), kind, float(np.degrees(ra)), float(np.degrees(dec)))
        one.visual, one.blue, one.major, one.minor, one.pa_deg = visual, blue, major, minor, pa
        one.messier = f"M{int(messier)}" if messier else ""
        one.common = [word.strip().removeprefix("the ") for word in (common or "").split(",") if word.strip()]
        found.append(one)
    return found


def named_by_both(
    objects: list[SkyObject], second: list[SkyObject], names: dict[str, list[tuple[str, int]]]
) -> dict[str, int]:
    """Give every object the names that stand up, the best known first; what was found on the way.

    A name that the second source has elsewhere is struck out here: it has the Flame Nebula at NGC 2024, OpenNGC at
    IC 434, 37 arcmin away.
    """
    bearers: dict[str, list[SkyObject]] = defaultdict(list)
    for one in second:
        for word in one.also:
            for name, _ in names.get(word, ()):
                bearers[plain(name)].append(one)
    counts = {"names of both sources": 0, "names struck out": 0, "names of OpenNGC alone": 0}
    for one in objects:
        own = [one.name, one.messier.replace("M", "M ", 1), *one.also]
        by_name = {name: cited for word in own for name, cited in names.get(word, ())}
        ranks: dict[str, float] = {}
        for name in one.common:
            same = {cited for other, cited in by_name.items() if plain(other) == plain(name)}
            near = [b for b in bearers[plain(name)] if one.away_arcmin(b) < max(APART_ARCMIN, (one.major or 0.0) / 3.0)]
            if same or near:
                counts["names of both sources"] += 1
                ranks[name] = 5 + by_name.get(name, max(same, default=0))
            elif bearers[plain(name)]:
                counts["names struck out"] += 1
            else:
                counts["names of OpenNGC alone"] += 1
                ranks[name] = 4
        shown = {
            name: cited for name, cited in by_name.items() if cited >= CITED and plain(name) not in map(plain, ranks)
        }
        one.common = sorted(ranks | shown, key=lambda name: -(ranks | shown)[name])
        one.also += [name for name in by_name if name not in one.common]
    return counts


def joined(objects: list[SkyObject], second: list[SkyObject], named: Container[str] = frozenset()) -> list[SkyObject]:
    """OpenNGC's objects with Stellarium's numbers, and sizes where they lack one, and what only Stellarium has.

    What bears a name, by one of its designations in ``named``, is taken whatever catalogue it is of.
    """
    # reversed, so that the first object of a name is the one that is kept
    known = {one.name: one for one in reversed(objects)}
    known |= {one.messier.replace("M", "M ", 1): one for one in objects if one.messier}
    brought: dict[str, SkyObject] = {}
    for other in second:
        at = next((known[word] for word in other.also if word in known), None)
        wanted = [word for of in BROUGHT for word in other.also if catalogue_of(word) == of]
        wanted = wanted or ([*other.also] if any(word in named for word in other.also) else [])
        if at is not None:
            at.also += [
                word for word in other.also if word not in (*at.also, at.name, at.messier.replace("M", "M ", 1))
            ]
            if at.kind not in CLUSTERS and of_a_star(other):
                other.visual = other.blue = None
            at.mag, at.band = magnitude((at.visual, other.visual), (at.blue, other.blue))
            at.source = "O" if at.mag in (at.visual, at.blue) else "S"
            larger = at.kind in CLUSTERS and (other.major or 0.0) > (at.major or 0.0)
            if at.major is None or larger:
                at.major, at.minor, at.pa_deg = other.major, other.minor, other.pa_deg
        elif wanted and wanted[0] not in brought:
            other.name, other.also = wanted[0], [word for word in other.also if word != wanted[0]]
            if of_a_star(other, alone=True):
                other.visual = other.blue = None
            brought[other.name] = other
    for one in (*objects, *brought.values()):
        if not one.band:
            one.mag, one.band = magnitude((one.visual,), (one.blue,))
            one.source = "S" if one.name in brought else "O"
        if one.kind == "GCl" and in_the_clouds(one) and one.name not in OLD_IN_THE_CLOUDS:
            one.kind = "OCl"
    return sorted((*objects, *brought.values()), key=lambda one: one.name)


CLUSTERS = ("OCl", "GCl", "Cl+N")
"""OpenNGC has them too small (0.86 of Steinicke's sizes in the median): the larger of two sizes is taken."""
REDDEST, BLUEST, AGREE_MAG = 2.0, -0.6, 1.0
"""Colours B - V that a cluster or a galaxy can have, and how far two sources may differ."""
OLD_IN_THE_CLOUDS = frozenset(
    f"NGC {n}" for n in (121, 1466, 1754, 1786, 1835, 1841, 1898, 1916, 1928, 1939, 2005, 2019, 2210, 2257, 104, 362)
)
"""The true globular clusters among the Magellanic Clouds' (Suntzeff et al. 1992, AJ 104, 1743), and two before them."""
CLOUDS_DEG = ((80.9, -69.8, 9.0), (13.2, -72.8, 5.0))


def in_the_clouds(one: SkyObject) -> bool:
    """Whether it stands in the Large or the Small Magellanic Cloud's part of the sky."""
    return any(one.away_arcmin(SkyObject("", "", ra, dec)) < 60.0 * reach for ra, dec, reach in CLOUDS_DEG)


COMPACT_ARCMIN = 0.5


def of_a_star(other: SkyObject, alone: bool = False) -> bool:
    """Whether what Stellarium has for the magnitude of a nebula is something else.

    Of a reflection nebula it is the star's whose light it reflects (van den Bergh's list), of a planetary nebula that
    is more than a dot its central star's (V 17.1 for Jones 1), of a dark one Lynds' opacity of 1 to 6. What shines and
    is ``alone`` in having no NGC or IC number has that of the star which lights it: V 2.9 for Sh2-9, sigma Scorpii's.
    Messier's and Caldwell's lists print the nebula's own.
    """
    catalogues = {catalogue_of(word) for word in (other.name, *other.also)}
    if catalogues & {"M", "C"}:
        return False
    if other.kind == "PN":
        return (other.major or 0.0) > COMPACT_ARCMIN
    kinds = ("DrkN", "RfN", *(("EmN", "HII", "Neb", "SNR") if alone else ()))
    return other.kind in kinds or "vdB" in catalogues


def magnitude(visual: Sequence[float | None], blue: Sequence[float | None]) -> tuple[float | None, str]:
    """The magnitude to show and its band, from those of one source or two: ``V``, ``B`` or ``?``.

    A V that no colour explains beside B betrays itself; so does one that is the other column's B again. Two that
    differ by more than a magnitude, neither with a B to decide, contradict each other: ``?``.
    """
    known = [mag for mag in visual if mag is not None]
    reference = next((mag for mag in blue if mag is not None), None)
    if reference is not None:
        known = [mag for mag in known if BLUEST <= reference - mag <= REDDEST]
        own = [mag for mag in known if abs(mag - reference) > 0.05]
        if not own:
            return reference, "B"
        return own[0], "V" if max(own) - min(own) <= AGREE_MAG else "?"
    if not known:
        return None, ""
    return known[0], "V" if max(known) - min(known) <= AGREE_MAG else "?"


def corrected(objects: list[SkyObject], path: Path) -> tuple[list[SkyObject], int]:
    """The objects with the rows of ``corrections.tsv``, what both sources have wrong; how many rows found no object."""
    named = {word: one for one in objects for word in one.also} | {one.name: one for one in objects}
    gone, left = set[str](), 0
    for line in path.read_text("utf-8").splitlines()[1:]:
        name, column, value, reason = line.split("\t")
        one = named.get(name)
        if one is None:  # in no source
            left += 1
        elif column == "keep":  # a second source differs: the reason why that is left so
            pass
        elif column == "also":
            one.also.append(value)
        elif column == "apart":
            one.also.remove(value)
        elif column == "mag":
            one.mag, one.band = (float(value.split()[0]), value.split()[1]) if value else (None, "")
            one.source = source_of(reason) if value else ""
        elif column == "size":
            one.major, one.minor = (float(side) for side in (value.split() * 2)[:2])
        elif column == "place":
            one.ra_deg, one.dec_deg = map(float, value.split())
        elif column == "kind":
            one.kind = value
        elif column == "name":
            one.common = [value, *(other for other in one.common if plain(other) != plain(value))]
        elif column == "names":
            one.common = value.split(",") if value else []
        elif column == "merge":
            members = [named[member] for member in value.split(",") if member in named]
            gone |= {member.name for member in members}
            for member in members:
                one.common += [word for word in member.common if word not in one.common]
                one.also += [word for word in (member.name, *member.also) if word not in (*one.also, one.name)]
        elif column == "rename":
            one.name, one.also = value, [word for word in (one.name, *one.also) if word != value]
        elif column == "drop":
            gone.add(one.name)
        else:
            raise CatalogueError("{path} knows no column {column}.", path=path.name, column=column)
    return [one for one in objects if one.name not in gone], left


def source_of(reason: str) -> str:
    """Whose magnitude a row of ``corrections.tsv`` gives, a key of `MAG_SOURCES`: who is named first in the reason."""
    named = {reason.find(name.partition(" ")[0]): key for key, name in MAG_SOURCES.items()}
    named.pop(-1, None)
    if not named:
        raise CatalogueError("{reason} names no source of a magnitude.", reason=reason)
    return named[min(named)]


def added(path: Path) -> list[SkyObject]:
    """The objects of ``more_objects.tsv``, which both sources lack."""
    found = []
    for line in path.read_text("utf-8").splitlines()[1:]:
        name, kind, ra, dec, mag, major, minor, pa, common, also, _ = line.split("\t")
        one = SkyObject(name, kind, float(ra), float(dec))
        one.mag, one.major, one.minor, one.pa_deg = (float(text) if text else None for text in (mag, major, minor, pa))
        one.band, one.source = ("V", "H") if mag else ("", "")
        one.common, one.also = ([word for word in words.split(",") if word] for words in (common, also))
        found.append(one)
    return found


def catalogue_of(word: str) -> str:
    """``Sh2`` of Sh2-155, ``SNR G`` of SNR G263.9-03.0: a designation without its number."""
    return re.split(r"[ -](?=\S*\d)", word)[0]


def write_objects(database: Path, catalogue: Path, names: Path, path: Path) -> dict[str, int]:
    """Write every object as text; counts for the manifest."""
    objects, second = read_openngc(database), read_stellarium(catalogue)
    given = read_names(names)
    pairs = [SkyObject("", "", one.ra_deg, one.dec_deg, also=list(one.also)) for one in second]
    counts = named_by_both(all_of := joined(objects, second, given), pairs, given)
    all_of, counts["corrections of no object"] = corrected([*all_of, *added(MORE_OBJECTS)], CORRECTIONS)
    all_of.sort(key=lambda one: one.name)
    lines = ["name\ttype\tra_deg\tdec_deg\tmag\tsize_arcmin\tmessier\tcommon\tminor_arcmin\tpa_deg\talso\tband\tsource"]
    for one in all_of:
        mag, major, minor, pa = (_number(value) for value in (one.mag, one.major, one.minor, one.pa_deg))
        at, also = f"{one.ra_deg:.5f}\t{one.dec_deg:.5f}", ",".join(dict.fromkeys(one.also))
        texts = (one.name, one.kind, at, mag, major, one.messier, ",".join(one.common), minor, pa, also)
        lines.append("\t".join((*texts, one.band, one.source if mag else "")))
    write_whole(path, ["\n".join([*lines, ""]).encode("utf-8")])
    return {"deep-sky objects": len(all_of), **counts}


def write_object_index(table: Path, path: Path) -> None:
    """Write where each row of the table begins, and its place, size and rank, for ``kochab.sky.object_index``."""
    objects = read_objects(table)
    lengths = np.array([len(line) for line in table.read_bytes().split(b"\n")[:-1]])
    begin = np.concatenate([[0], np.cumsum(lengths + 1)])
    x, y, z = objects.vector.T
    turn = TURN / (2.0 * np.pi)
    columns = {
        "ra": (np.rint(np.arctan2(y, x) * turn).astype(np.int64) % 2**32).astype("<u4"),
        "dec": np.rint(np.arcsin(z) * turn).astype("<i4"),
        "major": objects.major.astype("<f4"),
        "minor": objects.minor.astype("<f4"),
        "rank": ranks_of(objects).astype("<f4"),
        "at": begin[1:].astype("<u4"),
    }
    write_container(path, {"kind": "objects", "rows": len(objects)}, columns)


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}".rstrip("0").rstrip(".")


def write_outlines(source: Path, path: Path) -> int:
    """Write the shapes that Stellarium has of large nebulae as chains of RA, Dec in degrees; how many."""
    lines = ["object\tra_dec_deg"]
    chain: list[str] = []
    for row in source.read_text("utf-8").splitlines():
        if row.startswith("#") or not row.strip():
            continue
        ra, dec, what, *rest = row.split()
        if what == "start":
            name = designation("".join(rest))
            chain = [OUTLINE_OF.get(name, name), ""]
        chain[1] += f"{float(ra) * 15.0:.4f} {float(dec):.4f} "
        if what == "end":
            lines.append("\t".join(chain).rstrip())
    write_whole(path, ["\n".join([*lines, ""]).encode("utf-8")])
    return len(lines) - 1


def write_boundaries(source: Path, path: Path) -> int:
    """Write the IAU's boundaries, J2000, as chains of RA, Dec in degrees between two constellations; how many."""
    short = {name.upper(): name for name in GENITIVES}
    cells, lines = iter(source.read_text("utf-8").split()), ["constellations\tra_dec_deg"]
    for count in cells:
        points: Floats = np.array([float(next(cells)) for _ in range(2 * int(count))]).reshape(-1, 2) * (15.0, 1.0)
        sides = " ".join(short.get(side, side) for side in (next(cells) for _ in range(int(next(cells)))))
        lines.append(f"{sides}\t{' '.join(f'{value:.4f}' for value in points.ravel())}")
    write_whole(path, ["\n".join([*lines, ""]).encode("utf-8")])
    return len(lines) - 1
