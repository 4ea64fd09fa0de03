"""Angles, sites and sizes as people type them."""

import re

import pytest

from kochab.core.errors import UsageError
from kochab.core.frame import Site
from kochab.parsing.angles import parse_dec_deg, parse_positive, parse_ra_deg, parse_site, site_text


@pytest.mark.parametrize(
    ("text", "deg"),
    [
        ("83.82", 83.82),
        ("5h35m17.3s", 83.822083),
        ("5:35:17.3", 83.822083),
        ("5 35 17,3", 83.822083),
        ("83d49m", 83.81667),
        ("24h", 0.0),
        ("0", 0.0),
    ],
)
def test_right_ascension_as_typed(text, deg):
    assert parse_ra_deg(text) == pytest.approx(deg, abs=1e-4)


@pytest.mark.parametrize(
    ("text", "deg"), [("-5.39", -5.39), ("−5 23 28", -5.391111), ("+41d16m9s", 41.269167), ("-0 30", -0.5)]
)
def test_declination_as_typed(text, deg):
    assert parse_dec_deg(text) == pytest.approx(deg, abs=1e-5)


@pytest.mark.parametrize("text", ["", "north", "-5", "25h", "361", "5:61:00", "1 2 3 4", "5h35x"])
def test_what_is_no_right_ascension_is_one_sentence(text):
    with pytest.raises(UsageError) as error:
        parse_ra_deg(text)
    assert re.fullmatch(r"[^\n]+\.", str(error.value))


@pytest.mark.parametrize("text", ["", "91", "-90.1", "5h", "north"])
def test_what_is_no_declination_is_refused(text):
    with pytest.raises(UsageError):
        parse_dec_deg(text)


@pytest.mark.parametrize("text", ["0", "-1", "x", "nan", "inf", "181"])
def test_what_is_no_size_is_refused(text):
    with pytest.raises(UsageError):
        parse_positive(text, "The radius", 180.0)


def test_a_decimal_comma_is_understood():
    assert parse_positive("1,5°", "The field", 180.0) == 1.5


@pytest.mark.parametrize(
    ("text", "site"),
    [
        ("48.14, 11.58", Site(48.14, 11.58)),
        ("-33.9 18.4 1200", Site(-33.9, 18.4, 1200.0)),
        ("−33.9; 341.6", Site(-33.9, -18.4)),
    ],
)
def test_a_site_as_typed(text, site):
    found = parse_site(text)
    assert (found.latitude_deg, found.longitude_deg, found.height_m) == pytest.approx(
        (site.latitude_deg, site.longitude_deg, site.height_m)
    )
    assert parse_site(site_text(found)) == found


@pytest.mark.parametrize("text", ["", "48", "91, 0", "x, y", "1,2,3,4", "10, 400", "nan, 1", "5, 5, inf"])
def test_what_is_no_site_is_one_sentence(text):
    with pytest.raises(UsageError) as told:
        parse_site(text)
    assert str(told.value).count("\n") == 0


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("48.14, 11.58", (48.14, 11.58, 0)),
        ("48.14,11.58,520", (48.14, 11.58, 520)),
        ("48.14 11.58 520", (48.14, 11.58, 520)),
        ("48, 11, 520", (48, 11, 520)),
        ("48, 11,520", (48, 11, 520)),
        ("48,14 11,58", (48.14, 11.58, 0)),
        ("48,14; 11,58", (48.14, 11.58, 0)),
        ("48,14; 11", (48.14, 11, 0)),
        ("48,14, 11,58, 520", (48.14, 11.58, 520)),
        ("−33,9 −18,4 1798", (-33.9, -18.4, 1798)),
    ],
)
def test_a_site_with_points_or_commas(text, place):
    site = parse_site(text)
    assert (site.latitude_deg, site.longitude_deg, site.height_m) == place


@pytest.mark.parametrize("text", ["48,14,11,58", "48", "north", "1;2;3;4", ";"])
def test_what_is_no_site_is_said(text):
    with pytest.raises(UsageError, match="give latitude, longitude"):
        parse_site(text)


@pytest.mark.parametrize(
    ("typed", "longitude"), [("0, 180", -180.0), ("0, -180", -180.0), ("0, 190.25", -169.75), ("0, -360", 0.0)]
)
def test_a_longitude_counted_once_around_is_east_or_west(typed, longitude):
    assert parse_site(typed).longitude_deg == longitude


@pytest.mark.parametrize("typed", ["90, 360, 9000", "-90, -360, -500"])
def test_a_site_is_from_pole_to_pole_and_from_the_dead_sea_to_above_everest(typed):
    assert abs(parse_site(typed).latitude_deg) == 90.0


@pytest.mark.parametrize("typed", ["90.1, 0", "-90.1, 0", "0, 360.1", "0, -360.1", "0, 0, 9001", "0, 0, -501"])
def test_what_is_not_on_the_earth_is_said(typed):
    with pytest.raises(UsageError, match="is not on the Earth"):
        parse_site(typed)
