import shutil

import numpy as np
import pytest

from kochab.core.errors import CatalogueError
from kochab.sky.catalogue import shipped_folder
from kochab.sky.names import MAG_SOURCES, read_objects
from kochab.sky.object_index import INDEX, TABLE, ObjectIndex, holding, object_index
from kochab.sky.sky_tables import ranks_of


@pytest.fixture(scope="module")
def objects():
    return read_objects(shipped_folder() / TABLE)


def test_the_index_leads_to_every_row_of_the_table(objects):
    index = object_index()
    rows = np.random.default_rng(5).choice(len(objects), 300, replace=False)
    read = index.read(np.concatenate([[0, len(objects) - 1], rows]))
    assert read.name.tolist() == objects.name[[0, len(objects) - 1, *rows.tolist()]].tolist()
    assert np.abs(index.vector - objects.vector).max() < 1e-8
    assert np.array_equal(index.rank, ranks_of(objects).astype(np.float32))
    assert np.array_equal(np.isnan(index.minor), np.isnan(objects.minor))


def test_those_of_a_field_are_those_that_the_whole_table_has_there(objects):
    centre = objects.vector[objects.messier == "M87"][0]
    near = object_index().within(centre, np.radians(2.0))
    there = (objects.vector @ centre > np.cos(np.radians(2.0))) & np.isfinite(ranks_of(objects))
    assert near.tolist() == np.flatnonzero(there).tolist()
    assert len(near) > 50


def test_what_holds_a_field_is_the_same_by_the_index_and_by_the_table(objects):
    centre = objects.vector[objects.name == "NGC 2451"][0]
    rows = holding(object_index(), centre, np.radians(1.0))
    assert rows.tolist() == holding(objects, centre, np.radians(1.0)).tolist()
    assert "Gum 12" in objects.name[rows].tolist()


def test_every_magnitude_says_whose_it_is(objects):
    known = np.isfinite(objects.mag)
    assert set(objects.source[known].tolist()) == set(MAG_SOURCES)
    assert set(objects.source[~known].tolist()) == {""}


def test_an_index_of_another_table_is_refused(tmp_path):
    for name in (INDEX, TABLE):
        shutil.copy(shipped_folder() / name, tmp_path)
    (tmp_path / TABLE).write_text("name\n")
    with pytest.raises(CatalogueError, match=r"objects\.tsv is missing or damaged"):
        ObjectIndex(tmp_path)
