"""Finding what people type: where it must lead is stated by hand or by catalogues nobody here made."""

import json
import math
from datetime import UTC, datetime

import numpy as np
import pytest

from kochab.cli.main import main
from kochab.core.errors import UsageError
from kochab.core.frame import Site
from kochab.core.progress import run
from kochab.sky.finder import NotFound, find, finder
from kochab.workflows.goto_target import named_target

NIGHT = datetime(2026, 11, 24, 22, tzinfo=UTC)
TYPED = [
    ("M-42", 83.82, -5.39),
    ("N1976", 83.82, -5.39),
    ("M042", 83.82, -5.39),
    ("NGC-1976", 83.82, -5.39),
    ("Caldwell 9", 344.2, 62.6),
    ("Sharpless 155", 344.2, 62.6),
    ("Sh 2-155", 344.2, 62.6),
    ("Barnard 33", 85.25, -2.46),
    ("Melotte 25", 66.75, 15.87),
    ("Trumpler 37", 324.7, 57.5),
    ("RCW 38", 134.8, -47.5),
    ("PGC 2557", 10.685, 41.27),
    ("Arp 273", 35.4, 39.37),
    ("PK 205+14.1", 112.26, 13.25),
    ("ESO 97-13", 213.3, -65.34),
    ("Abell 1656", 194.95, 27.98),
    ("Palomar 5", 229.0, -0.1),
    ("Terzan 5", 267.0, -24.8),
    ("alf Ori", 88.79, 7.41),
    ("eps Lyr", 281.08, 39.67),
    ("tet01 Ori", 83.82, -5.39),
    ("th1 Ori", 83.82, -5.39),
    ("zet UMa", 200.98, 54.93),
    ("61 Cygni", 316.7, 38.75),
    ("Horsehead", 85.25, -2.46),
    ("Crab", 83.63, 22.01),
    ("the Whirlpool", 202.47, 47.2),
    ("LMC", 80.9, -69.76),
    ("47 Tucanae", 6.02, -72.08),
    ("Stephans Quintet", 339.0, 33.96),
    ("Coalsack", 193.0, -63.0),
    ("Veil Nebula", 312.7, 30.7),
    ("Barnard's Loop", 83.0, -2.0),
    ("Hercules Cluster", 250.42, 36.46),
    ("h and chi Persei", 35.1, 57.14),
    ("chi Persei", 35.6, 57.15),
    ("TRAPPIST-1", 346.62, -5.04),
    ("Southern Cross", 187.0, -60.0),
    ("UMa", 165.0, 55.0),
    ("NCP", 0.0, 90.0),
]


def away_deg(found, ra_deg, dec_deg):
    from kochab.core.attitude import unit_vectors

    return math.degrees(math.acos(min(1.0, float(found.vector @ unit_vectors(ra_deg, dec_deg)))))


@pytest.mark.parametrize(("text", "ra_deg", "dec_deg"), TYPED)
def test_what_people_type_leads_where_they_mean(text, ra_deg, dec_deg):
    found = run(find(text, NIGHT))
    assert not isinstance(found, NotFound)
    assert away_deg(found, ra_deg, dec_deg) < (4.0 if found.kind == "constellation" else 1.1)


def test_the_list_of_what_people_type(repository):
    """The places in the list are about right only; none may be missed or lead astray."""
    listed = repository.parent / "shared" / "sky-queries.tsv"
    if not listed.exists():
        pytest.skip("the list of what people type is not beside this checkout")
    rows = [line.split("\t") for line in listed.read_text("utf-8").splitlines() if not line.startswith("#")]
    missed = []
    for query, ra, dec in (row for row in rows if row[1]):
        found = run(find(query, NIGHT))
        if isinstance(found, NotFound) or away_deg(found, float(ra), float(dec)) > 1.0:
            missed.append((query, found))
    assert not missed


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("(1) Ceres", "1 Ceres"),
        ("67P", "67P/Churyumov-Gerasimenko"),
        ("1P", "1P/Halley"),
        ("Halley's Comet", "1P/Halley"),
        ("Hale-Bopp", "C/1995 O1 (Hale-Bopp)"),
        ("2060 Chiron", "2060 Chiron"),
        ("the Moon", "Moon"),
        ("Saturn", "Saturn"),
        ("Titania", "Titania, beside Uranus"),
    ],
)
def test_bodies_are_found_by_number_and_nickname(text, name):
    found = run(find(text, NIGHT))
    assert (found.name, found.sure) == (name, True)


def test_a_bare_number_is_taken_for_a_minor_planet_only_with_a_word():
    found = run(find("4", NIGHT))
    assert (found.name, found.sure) == ("4 Vesta", False)


def test_the_zenith_asks_for_a_site_and_a_pole_is_no_star():
    assert "set the site" in run(find("zenith", NIGHT)).sentence
    assert run(find("North Pole", NIGHT)).dec_deg == 90.0


def test_two_things_of_one_name_are_both_told():
    found = run(find("Abell 21", NIGHT))
    assert found.kind == "PN"
    assert found.alternatives == ("Abell 21 (Cluster of galaxies)",)
    with pytest.raises(UsageError, match=r"Abell 21 can be .*\(Planetary nebula\), Abell 21 \(Cluster of galaxies\)"):
        named_target("Abell 21", NIGHT)


@pytest.mark.parametrize(
    ("text", "meant"), [("Horsehed", "Horsehead"), ("Whirlpol", "Whirlpool"), ("Betelgeus", "Betelgeuse")]
)
def test_a_slip_is_answered_by_a_suggestion_and_never_taken(text, meant):
    found = run(find(text, NIGHT))
    assert isinstance(found, NotFound)
    assert any(meant in name for name in found.suggestions)
    with pytest.raises(UsageError, match="Did you mean"):
        named_target(text, NIGHT)


def test_every_nickname_means_something_and_no_two_of_one_name_stand_apart():
    index = finder()
    seen = {}
    for row in index.nicknames:
        assert bool(row["means"]) != bool(row["ra_deg"]), row
        for name in row["names"].split(";"):
            found = index.still(name)
            assert found is not None, name
            assert seen.setdefault(name.casefold(), row["names"]) == row["names"], name


def test_the_zenith_is_overhead():
    from kochab.sky.horizon import altitude_deg

    site = Site(47.4, 8.5, 500.0)
    found = run(find("zenith", NIGHT, site))
    from kochab.sky.apparent import apparent

    assert altitude_deg(apparent(found.vector[None], NIGHT), site, NIGHT) == pytest.approx(90.0, abs=0.01)
    assert isinstance(run(find("zenith", NIGHT)), NotFound)


def test_a_line_a_query(capsys):
    assert main(["find", "M 42", "Horsehed", "5h35m17s -5d23m", "--json", "--time", "2026-11-24"]) == 1
    first, second, third = map(json.loads, capsys.readouterr().out.splitlines())
    assert first["query"] == "M 42"
    assert first["name"].startswith("M 42")
    assert (first["kind"], first["constellation"]) == ("Cl+N", "Orion") or first["kind"] == "HII"
    assert (first["ra_deg"], first["dec_deg"]) == pytest.approx((83.82, -5.39), abs=0.01)
    assert first["size_arcmin"] == [90.0, 60.0]
    assert second["name"] is None
    assert second["suggestions"]
    assert third["kind"] == "position"


def test_a_name_in_several_words_needs_no_quotes(capsys):
    assert main(["find", "Omega", "Centauri"]) == 0
    assert "NGC 5139" in capsys.readouterr().out
    assert main(["find", "M 31", "M 33", "--json"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 2


def test_places_of_stars_move_with_the_years():
    then, now = finder().still("Barnard's Star", 2000.0), finder().still("Barnard's Star", 2026.0)
    assert np.degrees(np.linalg.norm(now.vector - then.vector)) * 3600.0 == pytest.approx(10.39 * 26.0, rel=0.01)


def test_a_star_is_found_where_it_is_at_the_time_asked_for():
    """Barnard's Star goes 10.36 arcsec north a year (SIMBAD)."""
    then, now = run(find("Barnard's Star")), run(find("Barnard's Star", datetime(2026, 1, 1, tzinfo=UTC)))
    assert (now.dec_deg - then.dec_deg) * 3600.0 == pytest.approx(26.0 * 10.362, abs=0.5)


@pytest.mark.parametrize(
    ("text", "meant"), [("andromda", "Andromeda"), ("casiopeia", "Cassiopeia"), ("cignus", "Cygnus")]
)
def test_a_slip_in_a_constellation_is_answered_too(text, meant):
    """The palette offered three dwarf galaxies for Andromda, and no constellation."""
    found = run(find(text, NIGHT))
    assert meant in found.suggestions
    assert finder().still(meant) is not None


@pytest.mark.parametrize("text", ["andromda", "horshed", "lagon", "whirlpol"])
def test_every_suggestion_is_found_as_it_is_written(text):
    suggestions = run(find(text, NIGHT)).suggestions
    assert suggestions
    for written in suggestions:
        assert finder().still(written) is not None, written
    assert finder().still("M 31 (Andromeda Galaxy)").name == finder().still("M 31").name
    assert finder().still("Nothing (Andromeda Galaxy)") is None
