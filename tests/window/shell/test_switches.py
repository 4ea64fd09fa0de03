"""Letters that switch something say what they did: they may have been meant for a field that has lost the focus."""

import pytest
from PySide6.QtCore import Qt

from kochab.window.shell.actions import COMMANDS

LETTERS = [command for command in COMMANDS if command.letter]
UNUSABLE = ("blink", "altaz", "colour")  # on one undated mono frame


def test_most_layers_have_a_letter():
    assert len({command.letter for command in LETTERS}) == len(LETTERS) > 10


def test_each_letter_says_what_it_switched_and_how_to_take_it_back(qtbot, opened):
    window, commands = opened
    view = window.workspace.view
    window.activateWindow()
    for command in LETTERS:
        if command.name in UNUSABLE:
            continue
        view.setFocus()
        action = commands.actions[command.name]
        before = action.isChecked()
        said = []
        for _ in range(2):
            qtbot.keyClick(view, Qt.Key[f"Key_{command.letter}"])
            said.append(window.status.currentMessage())
        assert action.isChecked() is before, "the second takes the first back"
        name = command.text.replace("&", "")
        states = ("off", "on") if before else ("on", "off")
        for state, other, sentence in zip(states, reversed(states), said, strict=True):
            assert sentence == f"{name}: {state}. {command.letter} switches it {other} again."


def test_a_switch_without_effect_says_why_instead(qtbot, opened):
    window, commands = opened
    commands.actions["altaz"].trigger()
    assert window.status.currentMessage() == "No Alt/Az grid: the frame’s time or your site is not known."


def test_what_the_program_switches_is_not_said(opened):
    window, commands = opened
    window.status.clearMessage()
    commands.actions["grid"].setChecked(not commands.actions["grid"].isChecked())
    assert window.status.currentMessage() == ""


@pytest.mark.parametrize("taken", ["setEnabled", "setVisible"])
def test_letters_typed_on_after_their_field_was_taken_away_switch_nothing(qtbot, opened, taken):
    """Six letters beside a field that was greyed changed colour, stretch and three layers for good."""
    window, commands = opened
    window.activateWindow()
    commands.actions["tab_hints"].trigger()
    field = window.workspace.hints.ra
    qtbot.waitUntil(field.isVisible)
    field.setFocus()
    qtbot.keyClicks(field, "05")
    before = {name: action.isChecked() for name, action in commands.actions.items()}
    getattr(window.workspace.tabs, taken)(False)
    there = window.focusWidget() or window
    assert there is not field
    for key in "goldenx":
        qtbot.keyClick(there, key)
    assert {name: action.isChecked() for name, action in commands.actions.items()} == before
    assert "gone" in window.status.currentMessage()
    qtbot.mouseClick(there, Qt.MouseButton.RightButton, pos=there.rect().topLeft())
    qtbot.keyClick(there, "g")
    assert commands.actions["grid"].isChecked() is not before["grid"], "somebody went to the image: a key again"


def test_a_field_that_somebody_left_makes_no_letter_wait(qtbot, opened):
    window, commands = opened
    window.activateWindow()
    commands.actions["tab_hints"].trigger()
    field, view = window.workspace.hints.ra, window.workspace.view
    qtbot.waitUntil(field.isVisible)
    field.setFocus()
    before = commands.actions["grid"].isChecked()
    view.setFocus()
    qtbot.keyClick(view, "g")
    assert commands.actions["grid"].isChecked() is not before


def test_a_frame_that_comes_leaves_the_focus_where_somebody_types(qtbot, opened):
    window, commands = opened
    window.activateWindow()
    commands.actions["tab_hints"].trigger()
    field = window.workspace.hints.ra
    qtbot.waitUntil(field.isVisible)
    field.setFocus()
    window.take_frame()
    assert window.focusWidget() is field
    window.workspace.hints.header.setFocus()
    window.take_frame()
    assert window.focusWidget() is window.workspace.view
