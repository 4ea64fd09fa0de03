import math

import numpy as np
import pytest

from catalogs.making.objects import SkyObject, plain, read_names, read_stellarium
from kochab.core.attitude import unit_vectors
from kochab.core.errors import CatalogueError, UsageError
from kochab.lab.bench.sources import BROUGHT_BY, STELLARIUM_OBJECTS, source_file
from kochab.sky.finder import finder
from kochab.sky.names import GENITIVES, GREEK, WELL_KNOWN, position_name, printed, read_objects

SPELLINGS = {
    91262: [
        "Vega",
        "VEGA",
        "HIP 91262",
        "hip91262",
        "HD 172167",
        "HR 7001",
        "SAO 67174",
        "alpha lyrae",
        "Alpha Lyr",
        "α Lyr",
        "3 Lyr",
    ],
    104214: ["61 Cyg", "61 Cygni A", "61 cyg a"],
    104217: ["61 Cyg B"],
    71683: ["Alpha Centauri", "alpha cen"],
    63125: ["Cor Caroli", "alpha-2 Canum Venaticorum"],
    67927: ["Eta Boötis", "eta bootis", "Muphrid"],
    26221: ["theta1 Ori", "Theta-1 Orionis", "θ¹ Ori", "θ1 Ori C", "41 Ori C"],
    25302: ["Psi-1 Orionis", "psi1 ori", "ψ¹ Ori", "25 Ori"],
    26237: ["Mizan Batil I", "c Ori", "42 Ori"],
    25281: ["Saif al Jabbar", "eta Orionis"],
    107259: ["\N{MICRO SIGN} Cep", "The Garnet Star"],
    65477: ["Alcor", "80 UMa"],
    20390: ["T Tau"],
    87937: ["Barnard's Star", "barnards star", "Barnard’s Star"],
}


@pytest.mark.parametrize(("hip", "name"), [(h, n) for h, names in SPELLINGS.items() for n in names])
def test_a_star_is_found_by_any_of_its_names(catalogue, hip, name):
    assert catalogue.label(catalogue.find(name))[0] == f"HIP {hip}"


@pytest.mark.parametrize(
    ("name", "ra", "dec"),
    [
        ("M31", 10.685, 41.269),
        ("NGC 224", 10.685, 41.269),
        ("messier 13", 250.42, 36.46),
        ("ic434", 85.25, -2.45),
        ("Andromeda Galaxy", 10.685, 41.269),
        ("M 45", 56.87, 24.1),
        ("Flame Nebula", 85.43, -1.86),
        ("Horsehead Nebula", 85.246, -2.458),
        ("C 9", 344.475, 62.518),
        ("sh2-155", 344.475, 62.518),
        ("Abell 426", 49.947, 41.513),
        ("vdB 152", 333.362, 70.255),
        ("B 33", 85.246, -2.458),
        ("C 20", 314.82, 44.53),
        ("Subaru", 56.87, 24.1),
    ],
)
def test_deep_sky_objects_are_found_as_directions(name, ra, dec):
    vector = finder().still(name).vector
    assert np.degrees(np.linalg.norm(vector - unit_vectors(ra, dec))) < 0.06


def test_the_names_of_objects_agree_with_the_second_source(catalogue):
    """Every shown name that Stellarium has is where it is there; Debian's package, or what a build fetched."""
    found = source_file(STELLARIUM_OBJECTS)
    if found is None:
        pytest.skip(f"Stellarium's table of objects is not here: {BROUGHT_BY[STELLARIUM_OBJECTS]} has it")
    names = read_names(found.with_name("names.dat"))
    places = {}
    for one in read_stellarium(found):
        for word in one.also:
            for name, _ in names.get(word, ()):
                places.setdefault(plain(name), []).append((one, word))
    objects = read_objects(catalogue.names.folder / "objects.tsv")
    checked = 0
    for row, common in enumerate(objects.common.tolist()):
        place = [math.degrees(math.atan2(*objects.vector[row, 1::-1])), math.degrees(math.asin(objects.vector[row, 2]))]
        here = SkyObject("", "", *place)
        own = {objects.name[row], objects.designation(row), *objects.also[row].split(",")}
        for name in filter(None, common.split(",")):
            if plain(name) in places:
                near = min(here.away_arcmin(one) for one, _ in places[plain(name)])
                assert near < max(5.0, objects.major[row] / 3.0) or own & {word for _, word in places[plain(name)]}, (
                    name
                )
                checked += 1
    assert checked > 250


@pytest.mark.parametrize(
    "name", ["", "nope", "HIP 0", "HIP 999999", "HD 99999999", "HIP 10000000001", "HD " + 5000 * "9", "M 999"]
)
def test_what_nobody_is_called_is_said_in_a_sentence(catalogue, name):
    with pytest.raises(UsageError, match=r"\.$"):
        catalogue.find(name)


LABELS = {
    "HIP 26221": "θ¹ Ori C",
    "HIP 25302": "ψ¹ Ori",
    "Hatysa": "ι Ori",
    "Saif al Jabbar": "η Ori",
    "Mizan Batil I": "42 Ori",
    "HIP 26727": "Alnitak",
    "Menkar": "Menkar",
    "HIP 95947": "Albireo",
    "HIP 87937": "Barnard's Star",
    "R And": "R And",
}


def test_well_known_names_are_all_in_the_table(catalogue):
    assert {name for name, *_ in catalogue.names.table.values()} >= WELL_KNOWN


def test_labels_say_what_people_say(catalogue):
    assert catalogue.label(catalogue.find("HIP 91262")) == ("HIP 91262", "Vega")
    assert catalogue.label(catalogue.find("HIP 1")) == ("HIP 1", "HD 224700")
    for spelling, shown in LABELS.items():
        assert catalogue.label(catalogue.find(spelling))[1] == shown
    identifier, name = catalogue.label(len(catalogue) - 1)
    assert identifier[0] == "J"
    assert name == ""


def test_every_hipparcos_star_leads_to_a_deep_row_and_back(catalogue):
    deep = catalogue.container.column("link_deep").astype(np.int64)
    bright = catalogue.container.column("link_bright").astype(np.int64)
    assert np.all(np.diff(deep) >= 0)
    assert np.array_equal(np.sort(bright), np.arange(len(catalogue.names.bright.column("hip"))))
    first = np.concatenate([[True], np.diff(deep) > 0])
    flagged = np.flatnonzero(catalogue.flags(np.arange(len(catalogue))) & 1)
    assert np.array_equal(deep[first], flagged)
    some = np.random.default_rng(3).choice(bright, 200).tolist()
    for row in some:
        place = catalogue.vectors([catalogue.deep_row(row)])[0]
        ra = catalogue.names.bright.column("ra")[row] * (360.0 / 2**32)
        dec = catalogue.names.bright.column("dec")[row] * (360.0 / 2**32)
        assert np.degrees(np.linalg.norm(place - unit_vectors(ra, dec))) * 3600 < 3.0


def test_numbers_of_vega(catalogue):
    bright, row = catalogue.names.bright, catalogue.bright_rows(np.array([catalogue.find("Vega")]))[0]
    assert [int(bright.column(name)[row]) for name in ("hip", "hd", "hr", "sao")] == [91262, 172167, 7001, 67174]
    assert bright.column("parallax")[row] / 1e2 == pytest.approx(130.23, abs=0.1)
    assert bright.column("pm_ra")[row] / 1e2 == pytest.approx(200.94, abs=0.01)
    assert bright.column("mag")[row] / 1e3 == pytest.approx(0.03)


@pytest.mark.parametrize(
    "text", ["", "name\tra_deg\n", "name\tra_deg\tdec_deg\nM 1\t83\tx\n", "name\tra_deg\tdec_deg\nM 1\n"]
)
def test_a_damaged_table_of_objects_is_said(tmp_path, text):
    (tmp_path / "objects.tsv").write_text(text)
    with pytest.raises(CatalogueError, match=r"objects\.tsv is missing or damaged"):
        read_objects(tmp_path / "objects.tsv")


def test_fainter_components_carry_their_letter(catalogue):
    hip = catalogue.names.bright.column("hip")
    labels = [catalogue.names.label(row) for row in np.flatnonzero(hip == 60718).tolist()]
    assert labels == [("HIP 60718", "Acrux"), ("HIP 60718 B", "Acrux")]


def test_there_are_88_constellations_and_24_letters():
    assert len(GENITIVES) == 88
    assert GENITIVES["CVn"] == "Canum Venaticorum"
    assert len(GREEK) == 24
    assert printed("γ1 And") == "γ¹ And"
    assert printed("ψ10 Aur") == "ψ¹⁰ Aur"
    assert printed("61 Cyg A") == "61 Cyg A"
    assert printed("ψ Ori", ["ψ2 Ori", "30 Ori"]) == "ψ² Ori"
    assert printed("c Ori", ["42 Ori"]) == "42 Ori"
    assert printed("c2 Aqr", ["88 Aqr"]) == "88 Aqr"
    assert printed("b3 Cyg", ["29 Cyg", "V1644 Cyg"]) == "29 Cyg"
    assert printed("V1644 Cyg", ["29 Cyg"]) == "V1644 Cyg"
    assert printed("O Vel", ["154 Vel"]) == "O Vel"
    assert printed("C Pup", ["59 Pup"]) == "C Pup"
    assert printed("l Pup", ["3 Pup"]) == "3 Pup"
    assert printed("P Cyg", ["34 Cyg"]) == "P Cyg"
    assert printed("51 And", ["υ Per"]) == "51 And"
    assert printed("Cyg X-1") == "Cyg X-1"


@pytest.mark.parametrize(
    ("ra", "dec", "name"),
    [
        (279.234735, 38.783692, "J183656.3+384701"),
        (0.0, -0.001, "J000000.0-000003"),
        (359.99999, 89.9999, "J235959.9+895959"),
    ],
)
def test_positions_make_names(ra, dec, name):
    assert position_name(unit_vectors(ra, dec)) == name


@pytest.mark.parametrize(
    ("designation", "names", "title"),
    [
        ("ESO 56-115", ("Large Magellanic Cloud", "Large Magellanic Cloud"), "Large Magellanic Cloud (ESO 56-115)"),
        ("PGC 2248", ("Cartwheel Galaxy", "Cartwheel Galaxy"), "Cartwheel Galaxy (PGC 2248)"),
        ("NGC 1976", ("M 42", "M 42 Orion Nebula"), "M 42 (Orion Nebula)"),
        ("NGC 1", ("NGC 1", "NGC 1"), "NGC 1"),
    ],
)
def test_what_people_say_comes_first(designation, names, title):
    objects = finder().objects
    row = objects.name.tolist().index(designation)
    assert objects.label(row) == names
    assert objects.title(row) == title
    assert finder().still(title).name == title
    assert objects.names(row)[0] == names[0]
    assert designation in objects.names(row)
