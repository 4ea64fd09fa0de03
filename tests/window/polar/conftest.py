"""Windows with their Polar alignment view."""

import pytest

from kochab.server.phone_page import PhonePage
from kochab.window.application import build
from kochab.window.frame.session import WorkflowEngine
from kochab.workflows.session.wiring import Wiring
from tests.window.fakes import close_windows


@pytest.fixture
def polar(qtbot, settings):
    """Windows with their polar view, and room to make another."""
    made = []

    def make(practice=None):
        window, commands = build(WorkflowEngine(), settings, [], Wiring(practice=practice, phone_page=PhonePage))
        qtbot.addWidget(window)
        window.resize(1360, 860)
        window.show()
        commands.views.show("polar")
        made.append(commands)
        return commands, commands.views.docks["polar"].view

    yield make
    for commands in made:
        commands.appearance.use_theme("dark", "normal")
    close_windows(*made)
