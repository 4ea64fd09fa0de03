"""The card at the end of a practice."""

from types import SimpleNamespace

import pytest
from PySide6.QtWidgets import QLabel

from kochab.window.mount.score_card import ScoreCard


def texts(qtbot, **score):
    card = ScoreCard(SimpleNamespace(elapsed_s=1200.0, points=63, **score))
    qtbot.addWidget(card)
    return [shown.text() for shown in card.findChildren(QLabel)]


def test_what_the_alignment_moved_is_not_blamed(qtbot):
    told = texts(qtbot, axis_arcsec=8.0, pointing_arcsec=20.0, off_arcsec=2898.0)
    assert told[:2] == ["63 of 100", "after 20 min under a simulated sky"]
    rows = ["Polar axis", "8.0″", "excellent", "Pointing", "48.3′", "sync again after aligning"]
    assert told[told.index("Polar axis") :] == rows


@pytest.mark.parametrize(("off", "word"), [(30.0, "excellent"), (200.0, "good"), (3000.0, "not there yet")])
def test_what_nobody_asked_for_is_graded(qtbot, off, word):
    told = texts(qtbot, axis_arcsec=300.0, pointing_arcsec=off, off_arcsec=off)
    assert told[told.index("Pointing") + 2] == word
    assert told[-1] == "Polar alignment (F4) brings it below 30″."


def test_it_is_shown_when_a_practice_ends(qtbot, opened):
    window, commands = opened
    commands.views.show("mount")
    score = SimpleNamespace(elapsed_s=60.0, points=10, axis_arcsec=300.0, pointing_arcsec=1.0, off_arcsec=1.0)
    commands.services.mount.connection.closed.emit("", "", score)
    (card,) = [card for card in window.findChildren(ScoreCard) if card.isVisible()]
    room = commands.views.docks["mount"].view.room
    assert card.parent() is room
    assert room.rect().contains(card.geometry())
    assert not card.isWindow()
    card.close_button.click()
    assert card.isHidden()
    commands.services.mount.connection.closed.emit("", "", score)
    assert [shown.isHidden() for shown in room.findChildren(ScoreCard) if shown is not card] == [False]
