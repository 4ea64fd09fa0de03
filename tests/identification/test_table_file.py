"""The file of a table: what is read is what was written, or nothing."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from kochab.identification.table_cache import packed, unpacked

ARRAYS = {
    "first": np.arange(300, dtype=np.int32),
    "triplets": np.array(7),
    "none": np.zeros(0),
    "pairs": np.ones((40, 3), np.uint8),
    "angle": np.linspace(0.0, 1.0, 99),
}
FILE = packed(ARRAYS)


def test_arrays_come_back_as_they_were():
    found = unpacked(bytearray(FILE))
    assert list(found) == list(ARRAYS)
    for name, array in ARRAYS.items():
        assert found[name].dtype == array.dtype
        np.testing.assert_array_equal(found[name], array)
        assert found[name].flags.writeable


@given(st.sets(st.integers(0, 8 * len(FILE) - 1), min_size=1, max_size=9))
def test_flipped_bits_are_never_read(bits):
    data = bytearray(FILE)
    for bit in bits:
        data[bit // 8] ^= 1 << bit % 8
    assert unpacked(data) is None


@given(st.integers(0, len(FILE) - 1))
def test_a_file_cut_short_is_never_read(length):
    assert unpacked(bytearray(FILE[:length])) is None
