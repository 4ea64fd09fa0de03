import numpy as np
import pytest

from kochab.core.attitude import unit_vectors
from kochab.core.progress import run
from kochab.identification import local_index
from kochab.identification.index import PER_FIELD
from kochab.identification.local_index import local_pairs, local_volume
from kochab.identification.pair_table import DENSE, SPARSE

AXIS_DEG, RADIUS_DEG, COUNT = (0.1, 88.9), 1.0, 20_000
"""Near the pole and 0 h."""
AREA_SR = 2.0 * np.pi * (1.0 - np.cos(np.radians(RADIUS_DEG)))
FIELDS_DEG = (0.1, 0.15, 0.2)


@pytest.fixture(scope="module")
def cone():
    """Random stars of a cone, brightest first."""
    rng = np.random.default_rng(6)
    axis = unit_vectors(*AXIS_DEG)
    near = axis + np.radians(RADIUS_DEG) * rng.uniform(-1, 1, (4 * COUNT, 3))
    near /= np.linalg.norm(near, axis=1, keepdims=True)
    return near[near @ axis > np.cos(np.radians(RADIUS_DEG))][:COUNT]


@pytest.fixture(scope="module")
def volume(cone):
    return run(local_volume(cone, np.arange(len(cone)) + 7, unit_vectors(*AXIS_DEG), FIELDS_DEG))


def test_levels_hold_the_brightest_of_each_field(volume, cone):
    assert volume.fields_deg.tolist() == list(FIELDS_DEG)
    stars = np.diff(volume.offsets)
    fields = AREA_SR / np.radians(FIELDS_DEG) ** 2
    assert (stars > 0.7 * PER_FIELD * fields).all()
    assert (stars < 1.5 * PER_FIELD * fields).all()
    a, b = volume.offsets[:2]
    assert np.abs(volume.stars[a:b] - cone[volume.rows[a:b] - 7]).max() < 1e-7
    assert len(volume.codes) == volume.cells[-1] > stars.sum()


def test_levels_that_are_alike_are_one(cone):
    """Where the catalogue ends every level has all its stars."""
    few = run(local_volume(cone[:50], np.arange(50), unit_vectors(*AXIS_DEG), FIELDS_DEG))
    assert few.fields_deg.tolist() == [FIELDS_DEG[-1]]
    assert few.offsets.tolist() == [0, 50]


def test_three_stars_make_no_volume(cone):
    assert run(local_volume(cone[:3], np.arange(3), unit_vectors(*AXIS_DEG), FIELDS_DEG)) is None


@pytest.mark.parametrize("density", [SPARSE, DENSE])
@pytest.mark.parametrize("field_deg", [0.1, 0.15])
def test_no_table_has_too_many_pairs(volume, field_deg, density):
    table = local_pairs(volume, field_deg, density, AREA_SR)
    assert 0 < len(table.one) / 2 < 330_000
    assert table.area_sr == AREA_SR


def test_where_every_table_has_too_many_there_is_none(volume, monkeypatch):
    monkeypatch.setattr(local_index, "MOST_PAIRS", 1000)
    assert local_pairs(volume, 0.15, DENSE, AREA_SR) is None
