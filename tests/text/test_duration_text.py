import pytest

from kochab.text.duration_text import duration_text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.0, "0 s"),
        (59.4, "59 s"),
        (59.6, "1 min"),
        (3569.0, "59 min"),
        (3571.0, "1 h 0 min"),
        (7800.0, "2 h 10 min"),
        (172_800.0, "2.0 days"),
        (450_000.0, "5.2 days"),
    ],
)
def test_a_duration_is_told_in_the_largest_unit_that_suits(seconds, text):
    assert duration_text(seconds) == text
