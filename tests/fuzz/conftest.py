"""Profiles that are tried are no profiles of the other tests."""

import pytest


@pytest.fixture(autouse=True)
def config_of_its_own(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path / "config"))
