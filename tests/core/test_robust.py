"""The median and the robust scatter, beside NumPy's and astropy's."""

import numpy as np
import pytest
from astropy.stats import mad_std
from hypothesis import given
from hypothesis import strategies as st

from kochab.core.robust import mad_sigma, median


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=40), st.integers(1, 12))
def test_the_median_is_numpys_for_few_values_and_for_many(values, times):
    repeated = np.tile(np.array(values), times)
    assert median(repeated) == np.median(repeated)


def test_the_scatter_is_astropys_about_the_median():
    values = np.random.default_rng(1).normal(7.0, 3.0, (31, 33))
    values[:4] += 1000.0
    assert mad_sigma(values) == pytest.approx(mad_std(values), rel=1e-4)
    assert mad_sigma(values) == pytest.approx(3.0, rel=0.3)  # an eighth is far off


def test_the_scatter_about_a_given_centre_counts_the_distance_from_it():
    assert mad_sigma(np.array([4.0, 5.0, 6.0]), 0.0) == pytest.approx(5.0 * 1.4826)


def test_small_unsigned_numbers_do_not_wrap_around():
    assert mad_sigma(np.array([0, 1, 2, 3, 250], np.uint8)) == pytest.approx(1.4826)
    assert median(np.array([250, 255], np.uint8)) == 252.5


def test_nothing_has_no_median():
    assert np.isnan(median(np.zeros(0)))
    assert np.isnan(mad_sigma(np.zeros(0)))
