"""Silence is waited for less than at a telescope: a simulated line has no slow controller behind it.

A classic LX200 is silent to a question that every opening asks, and after each silence the line must
have been quiet for a while before it is trusted again.
"""

import pytest

from kochab.gear.mounts import serial_line
from kochab.gear.mounts.drivers import lx200


@pytest.fixture(autouse=True)
def _soon_quiet(monkeypatch):
    monkeypatch.setattr(lx200, "PRODUCT_S", 0.5)
    monkeypatch.setattr(serial_line, "QUIET_S", 0.1)
