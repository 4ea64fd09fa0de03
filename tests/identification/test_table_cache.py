"""Tables kept on disk: by content, whole or not at all."""

import numpy as np
import pytest

from kochab.identification import table_cache
from kochab.identification.table_cache import cached_table, cached_tables, table_folder
from tests.windows.mapped import let_go


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("KOCHAB_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(table_cache, "WORTH_S", 0.0)
    return table_folder()


class Maker:
    def __init__(self, size: int = 5) -> None:
        self.calls, self.size = 0, size

    def __call__(self):
        self.calls += 1
        return {"a": np.arange(self.size), "b": np.eye(2)}


def test_a_table_is_made_once(cache) -> None:
    make = Maker()
    first, second = cached_table("pairs", {"deg": 8.0}, make), cached_table("pairs", {"deg": 8.0}, make)
    assert make.calls == 1
    np.testing.assert_array_equal(first["a"], second["a"])
    np.testing.assert_array_equal(first["b"], second["b"])
    assert len(cached_tables()) == 1
    assert all(size > 0 for size in cached_tables().values())
    assert not list(cache.glob("*.part"))


def test_other_options_another_name_another_catalogue_are_other_tables(cache, monkeypatch) -> None:
    make = Maker()
    cached_table("pairs", {"deg": 8.0}, make)
    cached_table("pairs", {"deg": 9.0}, make)
    cached_table("triangles", {"deg": 8.0}, make)
    monkeypatch.setattr(table_cache, "catalogue_checksums", lambda: "another")
    cached_table("pairs", {"deg": 8.0}, make)
    assert make.calls == 4
    assert len(cached_tables()) == 4


@pytest.mark.parametrize("damage", [b"", b"short", bytes(64)])
def test_a_damaged_file_is_made_anew(cache, damage) -> None:
    make = Maker()
    cached_table("pairs", {}, make)
    (path,) = cache.iterdir()
    path.write_bytes(damage)
    assert cached_table("pairs", {}, make)["a"].tolist() == [0, 1, 2, 3, 4]
    assert make.calls == 2
    assert cached_table("pairs", {}, make)["a"].tolist() == [0, 1, 2, 3, 4]
    assert make.calls == 2


def test_what_is_made_in_an_instant_is_not_kept(cache, monkeypatch) -> None:
    monkeypatch.setattr(table_cache, "WORTH_S", 60.0)
    cached_table("pairs", {}, Maker())
    assert cached_tables() == {}


def test_a_folder_that_cannot_be_written_is_no_error(tmp_path, monkeypatch) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    monkeypatch.setenv("KOCHAB_CACHE", str(blocked))
    monkeypatch.setattr(table_cache, "WORTH_S", 0.0)
    assert cached_table("pairs", {}, Maker())["a"].size == 5
    assert cached_tables() == {}


def test_the_oldest_tables_go(cache, monkeypatch) -> None:
    monkeypatch.setattr(table_cache, "MOST_BYTES", 20_000)
    for k in range(6):
        cached_table("pairs", {"k": k}, Maker(1000))
        let_go()
    assert 1 <= len(cached_tables()) <= 2
    make = Maker(1000)
    cached_table("pairs", {"k": 5}, make)
    assert make.calls == 0
