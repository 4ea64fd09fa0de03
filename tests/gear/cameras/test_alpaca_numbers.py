"""The integers of ASCOM's arrays as a sensor counted them."""

import numpy as np
import pytest

from kochab.gear.cameras.alpaca import sensor_numbers


@pytest.mark.parametrize("most", [255, 4095, 65535])
def test_what_does_not_fit_sixteen_bits_is_clipped_and_never_wrapped(most) -> None:
    rows = np.array([[-5, 0, 255, 4096], [65535, 65536, 70000, 131071]], dtype=np.int32)
    found = sensor_numbers(rows, most)
    assert found.dtype == np.uint16
    assert found.tolist() == [[0, 0, 255, 4096], [65535] * 4]


@pytest.mark.parametrize(
    ("rows", "most", "dtype"),
    [
        (np.array([[7]], dtype=np.uint8), 255, np.uint8),
        (np.array([[70000]], dtype=np.int32), 65536, np.int32),  # a sensor that counts further
        (np.array([[70000]], dtype=np.int32), None, np.int32),  # one that does not tell how far
        (np.array([[0.5]], dtype=np.float64), 65535, np.float32),
    ],
)
def test_what_counts_further_or_in_fractions_stays_as_it_is(rows, most, dtype) -> None:
    found = sensor_numbers(rows, most)
    assert found.dtype == dtype
    assert found.tolist() == rows.tolist()
    assert found.flags.c_contiguous
