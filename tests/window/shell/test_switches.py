"""Letters that switch something say what they did: they may have been meant for a field that has lost the focus."""

import pytest
from PySide6.QtCore import Qt

from kochab.window.shell.actions import COMMANDS

LETTERS = [command for command in COMMANDS if command.letter]
UNUSABLE = ("blink", "altaz", "colour")  # on one undated mono frame


def test_most_layers_have_a_letter():
    assert len({command.letter for command in LETTERS}) == len(LETTERS) > 10


@pytest.mark.parametrize("command", [c for c in LETTERS if c.name not in UNUSABLE], ids=lambda c: c.name)
def test_a_letter_says_what_it_switched_and_how_to_take_it_back(qtbot, opened, command):
    window, commands = opened
    action, view = commands.actions[command.name], window.workspace.view
    window.activateWindow()
    view.setFocus()
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
