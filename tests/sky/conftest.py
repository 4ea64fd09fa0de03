import numpy as np
import pytest

from kochab.sky import Catalogue, open_catalogue
from kochab.sky.catalogue_file import StarList, write_deep


@pytest.fixture(scope="session")
def catalogue():
    """The shipped catalogue."""
    return open_catalogue()


@pytest.fixture(scope="session")
def small(tmp_path_factory):
    """20,000 random stars in all tiers, some fast, some heaped at the poles and about RA 0."""
    rng = np.random.default_rng(7)
    vector = rng.normal(size=(20_000, 3))
    vector[:600, :2] *= 0.02
    vector[600:1200] = [1.0, 0.0, 0.0] + 0.03 * rng.normal(size=(600, 3))
    vector /= np.linalg.norm(vector, axis=1, keepdims=True)
    n = len(vector)
    stars = StarList.of(
        vector,
        rng.uniform(-1.0, 13.0, n),
        pm=rng.normal(size=(n, 2)) * 3000.0,
        bv=np.where(rng.random(n) < 0.3, np.nan, rng.uniform(-0.3, 2.0, n)),
    )
    path = tmp_path_factory.mktemp("small") / "deep.kcat"
    write_deep(path, stars)
    return Catalogue(path)
