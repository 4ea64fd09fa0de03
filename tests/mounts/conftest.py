"""A classic LX200 is silent to a question that every opening asks: tests wait less for it."""

import pytest

from app.mounts.drivers import lx200


@pytest.fixture(autouse=True)
def _impatient(monkeypatch):
    monkeypatch.setattr(lx200, "PRODUCT_S", 0.15)
