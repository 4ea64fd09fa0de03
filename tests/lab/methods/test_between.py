import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from kochab.lab.methods.pairs import between


@given(
    st.lists(st.integers(0, 50), max_size=40),
    st.lists(st.tuples(st.integers(-5, 55), st.integers(-5, 55)), min_size=1, max_size=8),
)
def test_ranges_are_those_of_comparing(values, ranges):
    sorted_values = np.sort(np.array(values, dtype=float))
    low, high = np.array(ranges, dtype=float).T
    start, stop = between(sorted_values, low, high)
    for a, b, lo, hi in zip(start, stop, low, high, strict=True):
        inside = sorted_values[(sorted_values >= lo) & (sorted_values <= hi)]
        assert sorted_values[a:b].tolist() == inside.tolist()
