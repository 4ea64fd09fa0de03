"""What was kept and then damaged costs a default, never the window."""

import json

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


def test_each_view_opens_whatever_was_kept(make_window, engine, settings) -> None:
    """Each kind of damage in one window, in all its views."""
    whole: list[dict[str, str]] = [dict.fromkeys(KEPT, "[" * 100_000), dict.fromkeys(KEPT, "5")]
    whole += [
        {
            name: json.dumps({k: HOSTILE[(turn + at) % len(HOSTILE)] for at, k in enumerate(names.split())})
            for name, names in KEPT.items()
        }
        for turn in range(0, len(HOSTILE), 2)
    ]
    for damaged in whole:
        for name, text in damaged.items():
            settings.keep(name, text)
        window, commands = make_window(engine)
        for name in damaged:
            commands.views.show(name)
            assert commands.views.docks[name].view is not None
        window.close()


def test_numbers_that_no_field_shows_are_left_out(settings) -> None:
    settings.keep("a", '{"a": 1e300, "c": 10000000000, "d": -3.5, "e": "x", "f": [1]}')
    assert settings.table("a") == {"d": -3.5, "e": "x", "f": [1]}
    settings.keep("a", '{"a": NaN, "d": -3.5}')  # no program of ours wrote that
    assert settings.table("a") == {}
