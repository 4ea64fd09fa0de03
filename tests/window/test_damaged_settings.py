"""What was kept and then damaged costs a default, never the window."""

import json

import pytest

from kochab.window.shell.views import VIEWS

HOSTILE = ({}, 10**40, [[]], None, "x", 1e999, {"x": {"y": []}}, [5, {}], True, "9" * 99)


KEPT = {
    "live": "source where lens again exposure gain binning record",
    "laboratory": "width_deg size_px stars noise_px false missing seed fields limit_s source told"
    " compared method detector attitude",
    "polar": "source kind address exposure hand pole goal turn fov second",
}


def test_what_views_keep_is_known_here(make_window, engine, settings) -> None:
    window, commands = make_window(engine)
    commands.views.show("live")
    window.close()
    assert set(settings.table("live")) == set(KEPT["live"].split())
    assert set(KEPT) | {"mount", "last_night"} == set(VIEWS)  # these keep their fields one by one


@pytest.mark.parametrize("name", sorted(KEPT))
def test_a_view_opens_whatever_was_kept(make_window, engine, settings, name) -> None:
    names = KEPT[name].split()
    texts = ["[" * 100_000, "5"]
    for turn in range(0, len(HOSTILE), 2):
        values = {k: HOSTILE[(turn + at) % len(HOSTILE)] for at, k in enumerate(names)}
        texts.append(json.dumps(values))
    for text in texts:
        settings.keep(name, text)
        window, commands = make_window(engine)
        commands.views.show(name)
        assert commands.views.docks[name].view is not None
        window.close()


def test_numbers_that_no_field_shows_are_left_out(settings) -> None:
    settings.keep("a", '{"a": 1e300, "c": 10000000000, "d": -3.5, "e": "x", "f": [1]}')
    assert settings.table("a") == {"d": -3.5, "e": "x", "f": [1]}
    settings.keep("a", '{"a": NaN, "d": -3.5}')  # no program of ours wrote that
    assert settings.table("a") == {}
