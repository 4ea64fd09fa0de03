import json
import struct
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kochab.core.errors import CatalogueError
from kochab.sky import open_catalogue
from kochab.sky.catalogue_file import Container, StarList, write_container, write_deep


def few(n=500):
    rng = np.random.default_rng(n)
    v = rng.normal(size=(n, 3))
    return StarList.of(v / np.linalg.norm(v, axis=1, keepdims=True), rng.uniform(2, 12, n))


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "deep.kcat"
    write_deep(path, few())
    return path


def test_columns_come_back_as_written(tmp_path):
    columns = {"a": np.arange(7, dtype="u1"), "b": np.linspace(0, 1, 3), "c": np.zeros(0, "i2")}
    write_container(tmp_path / "x", {"kind": "test", "rows": 3}, columns)
    box = Container(tmp_path / "x")
    assert box.facts == {"kind": "test", "rows": 3}
    for name, column in columns.items():
        assert np.array_equal(box.column(name), column)
        assert not box.column(name).flags.writeable
    with pytest.raises(CatalogueError, match="lacks the column z"):
        box.column("z")


def test_the_same_stars_give_the_same_bytes(tmp_path):
    stars = few()
    write_deep(tmp_path / "a", stars)
    write_deep(tmp_path / "b", stars)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_a_missing_file_is_said(tmp_path):
    with pytest.raises(CatalogueError, match=r"missing\.$"):
        open_catalogue(tmp_path / "none.kcat")


def test_a_folder_is_said(tmp_path):
    with pytest.raises(CatalogueError, match="cannot be opened"):
        open_catalogue(tmp_path)


@given(cut=st.integers(0, 2000))
def test_a_file_cut_short_is_said(tmp_path_factory, cut):
    path = tmp_path_factory.mktemp("cut") / "deep.kcat"
    write_deep(path, few(40))
    whole = path.read_bytes()
    path.write_bytes(whole[: min(cut, len(whole) - 1)])
    with pytest.raises(CatalogueError, match=r"\.$"):
        open_catalogue(path)


@given(at=st.integers(0, 200), change=st.integers(1, 255))
def test_a_damaged_header_is_said(tmp_path_factory, at, change):
    path = tmp_path_factory.mktemp("bad") / "deep.kcat"
    write_deep(path, few(40))
    data = bytearray(path.read_bytes())
    data[at] ^= change
    path.write_bytes(bytes(data))
    with pytest.raises(CatalogueError, match=r"\.$"):
        open_catalogue(path)


def test_an_index_that_does_not_fit_is_said(file):
    box = Container(file)
    columns = {k: box.column(k).copy() for k in box._sections}
    columns["zones"][-1] -= 1
    write_container(file.with_name("other"), box.facts, columns)
    with pytest.raises(CatalogueError, match="does not fit"):
        open_catalogue(file.with_name("other"))


@pytest.mark.parametrize(("name", "value"), [("link_bright", 2**31), ("link_deep", 0), ("link_deep", 2**31)])
def test_links_that_lead_nowhere_are_said(monkeypatch, name, value):
    catalogue = open_catalogue()
    row, whole = catalogue.find("Vega"), catalogue.container.column
    damaged = np.full_like(whole(name), value)
    monkeypatch.setattr(catalogue.container, "column", lambda asked: damaged if asked == name else whole(asked))
    with pytest.raises(CatalogueError, match="damaged"):
        catalogue.label(row)
    if value:
        with pytest.raises(CatalogueError, match="damaged"):
            catalogue.find("Vega")


def test_a_header_of_another_kind_is_said(tmp_path):
    text = json.dumps({"sections": {"ra": [0, "<u4", 1]}}).encode()
    head = b"KOCHAB1\n" + struct.pack("<II", len(text), zlib.crc32(text)) + text
    path = tmp_path / "deep.kcat"
    path.write_bytes(head + b"\0" * (-len(head) % 64) + b"\0" * 4)
    with pytest.raises(CatalogueError, match="lacks the column"):
        open_catalogue(path)


def test_a_full_disk_leaves_the_old_catalogue(file, monkeypatch):
    before = file.read_bytes()

    def full(self, target):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(type(file), "replace", full)
    with pytest.raises(CatalogueError, match=r"cannot be written: No space left on device\.$"):
        write_deep(file, few(10))
    assert file.read_bytes() == before
    assert [p.name for p in file.parent.iterdir()] == [file.name]
