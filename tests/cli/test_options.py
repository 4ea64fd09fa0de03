"""Values that several commands read alike."""

import argparse

import pytest

from kochab.cli.options import _near


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("84,-1.5,10", (84.0, -1.5, 10.0)),
        ("-90,90,180", (270.0, 90.0, 180.0)),
        ("-360,0,1", (0.0, 0.0, 1.0)),
        ("720,-90,0.01", (0.0, -90.0, 0.01)),
    ],
)
def test_a_place_to_search_first(text, place) -> None:
    assert _near(text) == place


@pytest.mark.parametrize(
    "text", ["84,-1.5", "84,-1.5,10,2", "-361,0,1", "721,0,1", "0,90.1,1", "0,-90.1,1", "0,0,0", "0,0,181", "x,0,1"]
)
def test_what_is_no_place_on_the_sky_is_refused(text) -> None:
    with pytest.raises(argparse.ArgumentTypeError):
        _near(text)
