"""Every column of the shipped objects beside a source that it is not made of: HNSKY's table, Harris' globulars.

What such a source contradicts stands in ``catalogs/making/corrections.tsv`` with the reason why it was changed or left.
"""

import csv
import re
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from catalogs.making.objects import CORRECTIONS
from kochab.core.attitude import separation_deg, unit_vectors
from kochab.lab.bench.second_source import bearers_of, contradictions, decided, misplaced_names, pairs, read_hnsky
from kochab.sky.catalogue import shipped_folder
from kochab.sky.finder import finder, numbered, spelled
from kochab.sky.names import read_objects

HERE = Path(__file__).parent
NAMESAKES = {"Crescent Nebula", "Ear Nebula", "Giant Squid Nebula", "Hercules Cluster", "Pipe Nebula"}
NAMESAKES |= {"Soap bubble", "Propeller nebula"}
"""What HNSKY calls so are other objects, which share the name: NGC 6445, Ou 4, M 13, NGC 1267 ..."""


@pytest.fixture(scope="module")
def objects():
    return read_objects(shipped_folder() / "objects.tsv")


@pytest.fixture(scope="module")
def second():
    return read_hnsky(HERE / "deep_sky.hnd")


@pytest.mark.parametrize("column", ["place", "mag", "size", "kind"])
def test_what_the_second_source_contradicts_is_decided_by_a_row(objects, second, column):
    known, compared = decided(CORRECTIONS), 0
    left = []
    for row, other in pairs(objects, second):
        compared += 1
        left += [one for one in contradictions(objects, row, other) if one.column == column]
    assert compared > 2000
    assert [one for one in left if column not in known.get(one.name, ())] == []


def test_names_stand_where_the_second_source_has_them(objects, second):
    told = dict(misplaced_names(second, bearers_of(objects)))
    assert len(told) > 60
    assert {name for name, wrong in told.items() if wrong} <= NAMESAKES


def globulars():
    with (HERE / "harris.tsv").open(encoding="utf-8") as file:
        next(file)
        return list(csv.DictReader(file, delimiter="\t"))


def test_globular_clusters_are_there_with_harris_magnitudes_and_places():
    """Some faint ones moved by arcminutes between Harris' revisions of 1997 and 2010, which the table has."""
    rows, index = globulars(), finder()
    assert len(rows) > 140
    for row in rows:
        name = {"AM 1": "Arp-Madore 1"}.get(row["name"], row["name"])
        found = index.still(name)
        assert found is not None, name
        assert found.kind == "GCl", name
        if row["V"]:
            assert found.magnitude == pytest.approx(float(row["V"]), abs=0.31), name
            assert found.band == "V", name
        if row["ra_deg"]:
            there = unit_vectors(float(row["ra_deg"]), float(row["dec_deg"]))
            assert separation_deg(found.vector, there) * 60.0 < 3.0, name


FACTS = {  # of the first paragraph of what was asked: V, size in arcmin, kind, place in degrees
    "NGC 253": (7.2, None, "G", None),
    "NGC 4945": (8.4, None, "G", None),
    "M 10": (6.6, None, "GCl", None),
    "NGC 2451": (2.8, None, "OCl", None),
    "IC 1396": (None, 170, None, None),
    "NGC 6357": (None, 40, None, None),
    "Sh2-157": (None, 90, "HII", None),
    "NGC 7822": (None, 100, None, None),
    "M 7": (None, 75, "OCl", None),
    "M 16": (None, 35, None, None),
    "Sh2-62": (None, None, "HII", (276.92, -3.83)),
    "Sh2-310": (None, 480, "HII", (108.26, -24.59)),
    "Sh2-104": (None, None, "HII", (304.44, 36.74)),
    "Sh2-126": (None, 160, "HII", (338.36, 38.58)),
    "Sh2-42": (None, None, "HII", (272.57, -16.82)),
    "Sh2-268": (None, 60, "HII", (92.41, 12.99)),
    "Sh2-201": (None, None, "HII", (45.79, 60.48)),
    "Coalsack": (None, 430, "DrkN", (192.5, -62.5)),
    "M 76": (10.1, 3.1, "PN", (25.58, 51.575)),
    "LMC": (None, 646, "G", (80.894, -69.756)),
    "Hyades": (0.5, 330, "OCl", (66.75, 15.87)),
    "B 50": (None, None, "DrkN", (255.75, -34.44)),
    "B 132": (None, None, "DrkN", (286.04, -4.43)),
    "IC 444": (None, 8, "RfN", (94.75, 23.27)),  # about 12 Gem
    "Sh2-249": (None, 80, "HII", (95.24, 23.09)),
    "IC 3829": (None, None, "G", (192.885, -27.783)),
    "IC 4991": (None, None, "G", None),
    "NGC 6334": (None, 40, "HII", None),
    "IC 1318": (None, None, "EmN", (305.56, 40.26)),
    "NGC 1980": (None, 14, None, None),
    "M 15": (6.2, None, "GCl", None),
    "M 4": (5.6, None, "GCl", None),
    "NGC 1783": (None, None, "OCl", None),
    "Palomar 5": (11.75, None, "GCl", (229.02, -0.11)),
    "Terzan 5": (13.85, None, "GCl", (267.02, -24.78)),
    "Gum 12": (None, 2160, None, (125.0, -42.0)),
    "RCW 38": (None, None, "HII", None),
    "Vela Supernova Remnant": (None, 255, "SNR", (128.5, -45.83)),
    "Puppis A": (None, 60, "SNR", None),
}


@pytest.mark.parametrize(("name", "fact"), FACTS.items())
def test_facts_that_were_wrong_once(name, fact):
    mag, arcmin, kind, place = fact
    found = finder().still(name)
    if mag is not None:
        assert found.magnitude == pytest.approx(mag, abs=0.15)
        assert found.band == "V"
    if arcmin is not None:
        assert found.size_arcmin[0] == pytest.approx(arcmin, rel=0.1)
    if kind is not None:
        assert found.kind == kind
    if place is not None:
        assert separation_deg(found.vector, unit_vectors(*place)) < 0.35


PEOPLE_CALL = {
    "Heart Nebula": "Sh2-190",
    "Soul Nebula": "Sh2-199",
    "Rosette Nebula": "NGC 2237",
    "Running Chicken Nebula": "IC 2944",
    "Tadpoles": "IC 410",
    "Wizard Nebula": "NGC 7380",
    "Spider Nebula": "IC 417",
    "Lion Nebula": "Sh2-132",
    "Sadr Region": "IC 1318",
    "Carina Nebula": "NGC 3372",
}


@pytest.mark.parametrize(("name", "number"), PEOPLE_CALL.items())
def test_names_that_people_use_are_drawn_on_the_object_of_that_number(objects, second, name, number):
    bearers = [row for row in range(len(objects)) if name in objects.common[row].split(",")[:1]]
    assert len(bearers) == 1
    other = next(one for one in second if number in one.also)
    reach = max(15.0, (other.major or 0.0) / 3.0) / 60.0
    there = unit_vectors(other.ra_deg, other.dec_deg)
    assert separation_deg(objects.vector[bearers[0]], there) < reach


@pytest.mark.parametrize("name", ["Rosette Nebula", "Eagle Nebula", "Horsehead Nebula", "Heart Nebula", "Soul Nebula"])
def test_a_name_is_drawn_once(objects, name):
    assert Counter(word for common in objects.common.tolist() for word in common.split(","))[name] == 1


def test_a_reflection_nebula_is_not_as_bright_as_its_star(objects):
    """Stellarium has the stars' magnitudes of van den Bergh's list: 0.9 of Antares, 60 of 90 are such within 0.35."""
    of_vdb = np.char.startswith(objects.name, "vdB")
    assert of_vdb.sum() > 80
    assert not np.isfinite(objects.mag[of_vdb]).any()


def test_the_veil_is_named_by_its_parts_and_its_whole(objects):
    first = {str(objects.name[row]): str(objects.common[row]).partition(",")[0] for row in range(len(objects))}
    assert (first["NGC 6960"], first["NGC 6992"], first["Sh2-103"]) == ("Western Veil", "Eastern Veil", "Cygnus Loop")
    assert {finder().still(name).name.partition(" ")[0] for name in ("West Veil Nebula", "East Veil Nebula")} == {"NGC"}


def test_no_two_globular_clusters_stand_at_one_place(objects):
    """Palomar 11 and 12, Terzan 3 and 8 and Ruprecht 106 had second rows under other numbers."""
    vectors = objects.vector[objects.kind == "GCl"]
    gaps = np.linalg.norm(vectors[:, None] - vectors[None], axis=2) + 10.0 * np.eye(len(vectors))
    assert gaps.min() > np.radians(1.0 / 60.0)


@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("Fornax Dwarf Galaxy", "ESO 356-4"),
        ("Sculptor Dwarf Galaxy", "ESO 351-30"),
        ("Circinus Galaxy", "ESO 97-13"),
        ("Draco Dwarf Galaxy", "PGC 60095"),
        ("Holmberg IX", "PGC 28757"),
        ("Cygnus A", "PGC 63932"),
        ("Splinter Galaxy", "NGC 5907"),
        ("Egg Nebula", "PGC 3168299"),
    ],
)
def test_galaxies_that_have_a_name_are_there_by_whatever_number(name, number):
    assert number in re.split(r" \(|\)", finder().still(name).name)
    assert number in re.split(r" \(|\)", finder().still(number.replace("-4", "-004")).name)


def test_no_nebula_has_a_stars_magnitude_or_an_opacity(objects):
    """Kinds of nebula whose only magnitudes are of their stars: Lynds' opacities of 1 to 6 were shown as V."""
    shown = np.isfinite(objects.mag)
    assert not shown[objects.kind == "DrkN"].any()
    large = (objects.kind == "PN") & (objects.major > 5.0) & shown
    assert float(objects.mag[large].max()) < 13.0  # Jones 1 had its central star's 17.1


def test_one_thing_one_place_whether_it_is_called_by_nickname_or_number():
    """A nickname has a place of its own only where the catalogue has no row of that name and kind."""
    index, twice = finder(), {}
    for row in index.nicknames:
        for name in row["names"].split(";") if row["ra_deg"] else ():
            entries = index._keys[0].get(numbered(name) or spelled(name), ())
            kinds = {index.entry(entry).kind for entry in entries if entry.table == "object"}
            if row["kind"] in kinds:
                twice[row["names"].split(";")[0]] = row
    assert set(twice) == {"Barnard's Loop", "Pickering's Triangle", "h and chi Persei"}  # wholes of several parts
