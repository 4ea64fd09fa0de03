"""The choice between two sources of an object's magnitude, and the shipped table beside facts from elsewhere."""

import math

import pytest

from catalogs.making.objects import CORRECTIONS, magnitude
from kochab.sky.catalogue import shipped_folder
from kochab.sky.finder import finder
from kochab.sky.names import read_objects


@pytest.mark.parametrize(
    ("visual", "blue", "chosen"),
    [
        ((11.11, 8.0), (7.94, 8.04), (8.0, "V")),  # as NGC 253 stands in the two sources; its own V is no colour's
        ((13.11, 19.0), (11.07, 11.0), (11.07, "B")),  # NGC 157: neither V is possible
        ((9.2, 9.2), (14.83, 9.9), (14.83, "B")),  # IC 127
        ((11.18, 13.44), (11.7, 11.36), (11.18, "V")),  # NGC 289: one of the two is
        ((4.98, 6.6), (None, None), (4.98, "?")),  # M 10: nothing decides
        ((9.0, 9.0), (9.0, 9.0), (9.0, "B")),  # the B column again
        ((8.0, None), (None, None), (8.0, "V")),
        ((None, None), (12.3, None), (12.3, "B")),
        ((None, None), (None, None), (None, "")),
    ],
)
def test_a_magnitude_that_betrays_itself_is_not_taken(visual, blue, chosen):
    assert magnitude(visual, blue) == chosen


RC3_AND_HARRIS = {  # V of RC3 and Harris 1996 (2010), from neither of the two sources
    "NGC 253": 7.2,
    "NGC 4945": 8.4,
    "M 10": 6.6,
    "M 14": 7.6,
    "M 19": 6.8,
    "M 71": 8.2,
    "M 31": 3.4,
    "M 33": 5.7,
    "M 81": 6.9,
    "M 104": 8.0,
    "M 13": 5.8,
    "M 22": 5.1,
    "NGC 4372": 7.2,
    "NGC 6544": 7.8,
    "NGC 5139": 3.7,
    "NGC 104": 4.0,
}
SIZES_ARCMIN = {  # Sharpless 1959, Collinder 1931, Steinicke's revised NGC
    "IC 1396": 170,
    "NGC 7822": 100,
    "NGC 6357": 40,
    "Sh2-157": 90,
    "M 7": 75,
    "M 16": 35,
    "NGC 3532": 50,
    "M 41": 38,
    "IC 4665": 70,
    "M 11": 14,
    "M 67": 30,
    "M 57": 1.4,
}


@pytest.mark.parametrize(("name", "v"), RC3_AND_HARRIS.items())
def test_bright_objects_have_the_magnitude_of_a_third_source(name, v):
    found = finder().still(name)
    assert found.band == "V"
    assert found.magnitude == pytest.approx(v, abs=0.5 if name != "NGC 5139" else 1.7)


@pytest.mark.parametrize(("name", "arcmin"), SIZES_ARCMIN.items())
def test_large_objects_have_the_size_of_a_third_source(name, arcmin):
    assert finder().still(name).size_arcmin[0] == pytest.approx(arcmin, rel=0.3)


@pytest.mark.parametrize(
    ("name", "kind"), [("NGC 6334", "HII"), ("IC 1318", "EmN"), ("NGC 1783", "OCl"), ("NGC 1466", "GCl")]
)
def test_kinds_that_the_first_source_has_wrong(name, kind):
    assert finder().still(name).kind == kind


@pytest.mark.parametrize("name", ["NGC 2238", "Sh2-275", "Rosette Nebula"])
def test_one_nebula_is_one_entry(name):
    index = finder()
    assert "Rosette" in index.still(name).name
    assert sum("Rosette Nebula" in common.split(",") for common in index.objects.common.tolist()) == 1


def test_every_correction_corrects_something_and_says_why():
    objects = read_objects(shipped_folder() / "objects.tsv")
    names = {*objects.name.tolist(), *",".join(objects.also.tolist()).split(",")}
    rows = [line.split("\t") for line in CORRECTIONS.read_text("utf-8").splitlines()[1:]]
    for name, column, _, why in rows:
        assert why, name
        assert name in names or column == "drop", name


def test_globular_clusters_stand_where_another_source_has_them():
    """Stellarium's own ESO numbers, beside places from Harris' catalogue in ``nicknames.tsv``."""
    for name, eso in (("Djorgovski 2", "ESO 456-38"), ("E 3", "ESO 37-1")):
        ours, theirs = finder().still(name), finder().still(eso)
        assert math.degrees(math.acos(min(1.0, float(ours.vector @ theirs.vector)))) < 0.05
