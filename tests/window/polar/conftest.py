"""Windows with their Polar alignment view."""

import pytest

from kochab.server.phone_page import PhonePage
from kochab.window.application import build
from kochab.window.frame.session import WorkflowEngine
from kochab.workflows.session.wiring import Wiring
from tests.window.fakes import assert_no_threads_left


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
        made.append((window, commands))
        return commands, commands.views.docks["polar"].view

    yield make
    for window, commands in made:
        window.close()
        commands.appearance.use_theme("dark", "normal")
        assert commands.session.jobs.join(60.0)
    assert_no_threads_left("kochab-", "polar-")
