"""Positions as people, charts and programs write them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kochab.core.attitude import unit_vectors
from kochab.parsing.places import parse_place
from kochab.sky.names import position_name

M42 = (83.822, -5.391)


@pytest.mark.parametrize(
    "text",
    [
        "+05:35:17 -05:23:28",
        "05 35 17 -05 23 28",
        "5 35.3 -5 23.5",
        "05h35m17s S05d23m28s",
        "5h35m17s-5d23m28s",
        "5.588h -5.391d",
        "83d49m19s -5d23m28s",
        "83.822,-5.391",
        "83,822 -5,391",
        "5,35,17 -5,23,28",
        "83.822; −5.391",
        "RA=83.822 DEC=-5.391",
        "RA 5h35m17s Dec -5 23 28",
        "α=83.822 δ=-5.391",
        "05h 35m 17.3s, −05° 23′ 28″",
        "J053517.3-052328",
        "05351730-0523280",
    ],
)
def test_one_place_in_every_spelling(text):
    assert parse_place(text) == pytest.approx(M42, abs=0.01)


def test_two_numbers_with_decimal_commas_are_degrees_without_a_sign_too():
    assert parse_place("10,5 40,5") == pytest.approx((10.5, 40.5))
    assert parse_place("10,5 +40,5") == pytest.approx((10.5, 40.5))
    assert parse_place("10 5 40 5") == pytest.approx((151.25, 40.0 + 5.0 / 60.0))


@pytest.mark.parametrize(
    "text",
    [
        "",
        "M 42",
        "47 Tuc",
        "61 Cygni",
        "3C 273",
        "HD 39801",
        "433",
        "2060 Chiron",
        "12P",
        "NGC 253",
        "1 2 3",
        "nan nan",
    ],
)
def test_what_is_no_position(text):
    assert parse_place(text) is None


@pytest.mark.parametrize(
    "text", ["400 -5", "83.8 -95", "J256100-052328", "J05351-05232", "5h35m -5h23m", "5 75 0 -5 0 0", "1e3 5"]
)
def test_what_is_no_possible_position(text):
    assert parse_place(text) is None


@given(st.floats(0, 359.99), st.floats(-89.9, 89.9))
def test_the_name_that_the_program_gives_a_place_leads_back_to_it(ra, dec):
    found = parse_place(position_name(unit_vectors(ra, dec)))
    assert found is not None
    assert found[1] == pytest.approx(dec, abs=1.01 / 3600.0)
    assert abs((found[0] - ra + 180.0) % 360.0 - 180.0) < 1.6 / 3600.0


@given(st.text(max_size=40))
def test_any_text_is_a_position_or_none(text):
    found = parse_place(text)
    assert found is None or (0.0 <= found[0] <= 360.0 and -90.0 <= found[1] <= 90.0)
