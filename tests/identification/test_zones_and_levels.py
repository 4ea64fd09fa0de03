from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from kochab.core.attitude import unit_vectors
from kochab.identification.index import LEVEL_FIELDS_DEG, PER_FIELD, cone_rows, ranges, zone_keys
from kochab.identification.index_build import all_levels

SKY = np.random.default_rng(5).normal(size=(5000, 3))
SKY /= np.linalg.norm(SKY, axis=1, keepdims=True)
ZONES = 40
ORDER = np.argsort(zone_keys(SKY, ZONES), kind="stable")
SORTED, KEYS = SKY[ORDER], zone_keys(SKY, ZONES)[ORDER]


@given(st.floats(0, 360), st.floats(-90, 90), st.floats(0.01, 60))
@settings(max_examples=150)
def test_no_star_of_a_cone_is_missed(ra, dec, radius_deg):
    centre = unit_vectors(ra, dec)
    inside = np.nonzero(SORTED @ centre > np.cos(np.radians(radius_deg)))[0]
    rows = cone_rows(KEYS, ZONES, centre, np.radians(radius_deg))
    assert len(np.unique(rows)) == len(rows)
    assert np.isin(inside, rows).all()


def test_a_small_cone_reads_little():
    rows = cone_rows(KEYS, ZONES, unit_vectors(100.0, 20.0), np.radians(5.0))
    assert 0 < len(rows) < 100


def test_ranges_in_a_row():
    np.testing.assert_array_equal(ranges(np.array([5, 9, 2]), np.array([2, 0, 3])), [5, 6, 2, 3, 4])
    assert len(ranges(np.array([1]), np.array([0]))) == 0


def test_levels_nest_and_hold_as_many_stars_a_field_as_asked():
    rng = np.random.default_rng(1)
    v = rng.normal(size=(60000, 3))
    ra, dec = (np.arctan2(v[:, 1], v[:, 0]) % (2 * np.pi), np.arcsin(v[:, 2] / np.linalg.norm(v, axis=1)))
    levels = all_levels(ra, dec)
    for finer, coarser in pairwise(levels):
        assert np.isin(coarser, finer).all()
    for k in (8, 10, 12):
        per_field = len(levels[k]) * LEVEL_FIELDS_DEG[k] ** 2 / 41253
        assert 0.85 * PER_FIELD < per_field < 1.15 * PER_FIELD
    # the brightest stars are in every level
    assert np.isin(np.arange(20), levels[-1]).all()
