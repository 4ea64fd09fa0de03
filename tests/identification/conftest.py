import numpy as np
import pytest

from kochab.core.progress import run
from kochab.identification.index import open_volume, shipped
from kochab.identification.index_build import build_volume
from kochab.identification.pair_table import table_for


def of_shipped(field_deg, density):
    """The pairs of the shipped index in 2016."""
    return table_for(shipped(), field_deg, 2016.0, density)


@pytest.fixture(scope="session")
def toy_sky():
    """4,000 random stars, brightest first: a sky of its own for fields of 16 to 45 degrees."""
    v = np.random.default_rng(11).normal(size=(4000, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


@pytest.fixture(scope="session")
def toy_volume(toy_sky, tmp_path_factory):
    folder = tmp_path_factory.mktemp("volume")
    rows = np.arange(len(toy_sky)) + 100
    run(build_volume(folder, toy_sky, rows, range(9, 13), neighbours=[(5, 6)] * 4, steps=16, mark="toy"))
    return open_volume(folder)
