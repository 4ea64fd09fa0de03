"""Search: names and coordinates to places, and where a place outside the frame lies."""

from datetime import UTC, datetime

import pytest

from kochab.core.attitude import radec_deg
from kochab.sky.elements import kept_elements
from kochab.sky.finder import NotFound
from kochab.window.frame.search import away, sought
from tests.patterns import REPOSITORY
from tests.window.fakes import fake_solution


@pytest.mark.parametrize(
    ("text", "ra", "dec"),
    [
        ("theta1 Ori", 83.818, -5.39),
        ("C 9", 344.475, 62.518),
        ("Sh2-155", 344.475, 62.518),
        ("05h35m -5 23", 83.75, -5.3833),
        ("83.75 -5.3833", 83.75, -5.3833),
        ("83.75, 5.5", 83.75, 5.5),
        ("5 35 0 5 30 0", 83.75, 5.5),
    ],
)
def test_names_and_coordinates(text, ra, dec):
    assert radec_deg(sought(text).vector) == pytest.approx((ra, dec), abs=0.2)


def test_what_is_unknown_is_told():
    assert "Nothing in the catalogue is called Planet of the apes" in sought("Planet of the apes").sentence
    assert sought("Horsehed").sentence.startswith("Nothing is called Horsehed. Did you mean Horsehead")


@pytest.mark.parametrize(
    ("move", "way"), [((0, 20), "20° north"), ((30, 0), "30° east"), ((0, -4), "4.0° south"), ((-20, 0), "20° west")]
)
def test_where_a_place_outside_lies(move, way):
    solution = fake_solution(600, 400)
    ra, dec = radec_deg(solution.centre_vector)
    vector = sought(f"{(ra + move[0]) % 360:.6f} {dec + move[1]:+.6f}").vector
    assert away(solution, vector) == way


def test_dropped_elements_are_kept_and_their_bodies_looked_for(qtbot, opened, tmp_path, monkeypatch):
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path / "config"))
    asked = []

    def marks(frame, solution, site=None, more=()):
        asked.extend(more)
        return ()
        yield

    monkeypatch.setattr("kochab.sky.frame_bodies.body_marks", marks)
    window, commands = opened
    before = commands.session.known.path
    commands.files.open_all([REPOSITORY / "tests" / "sky" / "iridium-2025-01-05.tle"])
    qtbot.waitUntil(lambda: asked != [])
    assert [len(table.names) for table in asked] == [30]
    assert window.status.currentMessage() == "Objects from iridium-2025-01-05.tle now appear in dated images."
    (tmp_path / "iridium-2025-01-05.tle").write_text("nothing")
    commands.files.open_all([tmp_path / "iridium-2025-01-05.tle"])
    qtbot.waitUntil(lambda: window.status.currentMessage().startswith("Can't read iridium-2025-01-05.tle: "))
    assert [len(table.names) for table in kept_elements()] == [30]  # what was good stays
    assert commands.session.known.path == before


def test_a_body_is_found_wherever_it_is_when_the_frame_was_taken():
    """Jupiter at its opposition: PyEphem has 2h 32m 30s, +13d 29m 46s."""
    then = datetime(2023, 11, 3, 22, tzinfo=UTC)
    assert radec_deg(sought("jupiter", then).vector) == pytest.approx((38.125, 13.496), abs=0.01)
    assert sought("4 Vesta", then).vector == pytest.approx(sought("vesta", then).vector)
    assert sought("Halley", then).vector == pytest.approx(sought("1P/Halley", then).vector)
    assert isinstance(sought("Planet of the apes", then), NotFound)
    assert isinstance(sought("Jupiter"), NotFound)  # as no time is known
