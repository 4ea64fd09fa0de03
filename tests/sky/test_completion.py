"""What a text may become: names from the first letter, by prefix and by alias, the best known first."""

import numpy as np
import pytest

from kochab.core.attitude import unit_vectors
from kochab.sky.completion import completion
from kochab.sky.finder import finder, spelled


def names(text, most=8, **around):
    index = completion()
    return [index.found(one).name for one in index.beginning(text, most, **around)]


@pytest.mark.parametrize(
    ("text", "first"),
    [
        ("v", "Vega"),
        ("a", "Sirius"),
        ("b", "Betelgeuse"),
        ("veg", "Vega"),
        ("m4", "M 4"),
        ("Messier 4", "M 4"),
        ("ngc 70", "NGC 70"),
        ("NGC-700", "NGC 700"),
        ("horo", "Horologium"),
        ("horsehead neb", "B 33 (Horsehead Nebula)"),
        ("pleia", "M 45 (Pleiades)"),
        ("great orion", "M 42 (Orion Nebula)"),
        ("orion neb", "M 42 (Great Orion Nebula)"),
        ("alpha ly", "Vega"),
        ("α Lyr", "Vega"),
        ("61 cyg", "61 Cyg B"),
        ("sh2-155", "C 9 (Cave Nebula)"),
    ],
)
def test_the_best_known_that_begins_so_is_listed(text, first):
    assert first.partition(" (")[0] in [name.partition(" (")[0] for name in names(text)]


@pytest.mark.parametrize("text", ["m 4", "m 42", "ngc 70", "vega", "orion"])
def test_a_whole_name_goes_before_those_that_it_begins(text):
    assert finder().still(text).name.partition(" (")[0] == names(text)[0].partition(" (")[0]


@pytest.mark.parametrize(
    ("text", "written"), [("paw", "Cats Paw"), ("xyz", "Vela XYZ"), ("head neb", "Fish Head Nebula")]
)
def test_a_name_is_found_by_its_later_words_of_three_letters_and_more(text, written):
    assert written in [one.written for one in completion().beginning(text, 20)]


def test_every_listed_name_begins_so():
    index = completion()
    for letter in "abcdefghijklmnopqrstuvwxyzθα":
        listed = index.beginning(letter, 12)
        assert len(listed) == 12
        assert len({one.entry for one in listed}) == 12, "each once"
        for one in listed:
            words = [one.written, *one.written.split(), index.found(one).name]
            greek = {"t": "θτ", "a": "α", "b": "β", "g": "γ", "d": "δ", "e": "εη", "z": "ζ", "i": "ι", "k": "κ"}
            greek |= {
                "l": "λ",
                "m": "μ",
                "n": "ν",
                "x": "ξ",
                "o": "οω",
                "p": "πφψ",
                "r": "ρ",
                "s": "σ",
                "u": "υ",
                "c": "χ",
            }
            begins = (letter, *greek.get(letter, ""))
            catalogue = not one.written  # a number: found as any of its designations
            assert catalogue or any(word.casefold().startswith(begins) for word in words), (letter, words)


def test_around_a_place_only_what_stands_there():
    belt = unit_vectors(84.05, -1.2)
    reach = np.radians(3.0)
    near = names("a", 20, centre=belt, radius_rad=reach)
    assert {"Alnilam", "Alnitak"} <= set(near)
    for one in completion().beginning("n", 20, belt, reach):
        assert completion().found(one).vector @ belt > np.cos(reach) - 1e-5


def test_nothing_begins_with_nothing():
    assert names("") == names("   ") == names("zzzzzz") == []


@pytest.mark.parametrize("text", ["neb", "cl", "gal", "s", "a", "alph"])
def test_the_best_known_come_first_and_a_name_that_begins_with_another_word_two_magnitudes_later(text):
    ranks = []
    for one in completion().beginning(text, 5000):
        inside = one.entry.table != "star" and one.written and not spelled(one.written).startswith(text)
        ranks.append(one.entry.rank + (2.0 if inside else 0.0))
    assert len(ranks) > 50
    assert ranks == sorted(ranks)


def test_a_star_with_a_name_of_its_own_is_as_well_known_as_one_four_magnitudes_brighter():
    named, unnamed = (completion().beginning(text, 1)[0].entry.rank for text in ("vega", "γ Hya"))
    assert named == pytest.approx(0.03 - 4.0, abs=0.02)
    assert unnamed == pytest.approx(2.99, abs=0.03)


def test_each_stands_where_the_finder_has_it():
    index, tables = completion(), set()
    for letter in "abcdefghijklmnopqrstuvwxyz":
        for one in index.beginning(letter, 100):
            tables.add(one.entry.table)
            assert one.vector == pytest.approx(index.found(one).vector, abs=1e-5)
    assert tables == {"star", "object", "nickname", "constellation"}
