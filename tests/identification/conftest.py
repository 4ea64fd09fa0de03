import numpy as np
import pytest

from kochab.core.progress import run
from kochab.identification.index import open_volume
from kochab.identification.index_build import build_volume


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
