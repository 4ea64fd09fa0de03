"""Commands in this process, whose error stream a slow machine leaves alone."""

import pytest


@pytest.fixture(autouse=True)
def no_progress(monkeypatch):
    """Progress is told of after a time, which a busy machine may take."""
    monkeypatch.setattr("kochab.cli.output.SOON_S", 600.0)
