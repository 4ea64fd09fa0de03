"""Fixed-point arithmetic: the thesis' own examples, and that no overflow is ever silent."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kochab.lab.fixed_point import FixedPointOverflowError, Format, square_root

F44 = Format(4, 4)


def binary(text: str) -> int:
    """The 4.4 number that the thesis writes as ``0011.1000``."""
    value = int(text.replace(".", ""), 2)
    return value - 256 if value > 127 else value


def test_the_thesis_examples() -> None:
    three, one_half = binary("0011.0000"), binary("0001.1000")
    assert F44.difference(three, one_half) == binary("0001.1000")
    assert F44.product(binary("0011.1000"), F44, 2, Format(4, 0)) == binary("0111.0000")
    assert F44.product(three, F44, one_half, F44) == binary("0100.1000")
    assert F44.quotient(binary("0101.0100"), F44, 9, Format(5, 0)) == binary("0000.1001")
    assert F44.quotient(binary("0101.0010"), F44, binary("0010.0000"), F44) == binary("0010.1001")
    assert F44.of([5.625, 1.98]).tolist() == [90, 31]
    assert (F44.low * F44.step, F44.high * F44.step) == (-8.0, 7.9375)


@pytest.mark.parametrize(
    "overflowing",
    [
        lambda: F44.difference(binary("0100.1100"), binary("1011.0000")),
        lambda: F44.product(binary("0011.0000"), F44, 4, Format(4, 0)),
        lambda: F44.product(binary("1101.0000"), F44, binary("0111.1000"), F44),
        lambda: F44.quotient(binary("0101.0010"), F44, binary("0000.1000"), F44),
        lambda: F44.quotient(1, F44, 0, F44),
        lambda: F44.of(8.0),
        lambda: F44.of(math.nan),
        lambda: Format(4, 4, signed=False).of(-0.5),
        lambda: square_root([-1]),
    ],
)
def test_the_thesis_overflows_are_noticed(overflowing) -> None:
    with pytest.raises(FixedPointOverflowError):
        overflowing()


formats = st.builds(
    lambda signed, whole, fraction: Format(whole, min(fraction, 31 - whole), signed),
    st.booleans(),
    st.integers(1, 20),
    st.integers(0, 22),
)


@st.composite
def numbers(draw):
    form = draw(formats)
    return form, draw(st.integers(form.low, form.high))


def exact_or_overflow(compute, into: Format, truth: Fraction, least: int, most: int) -> None:
    """``compute`` gives truth to one last bit, or raises just when the truth does not fit."""
    try:
        got = int(compute())
    except FixedPointOverflowError:
        assert not into.low + 1 <= truth * 2**into.fraction <= into.high - 1
        return
    off = Fraction(got, 2**into.fraction) - truth
    assert least * Fraction(1, 2**into.fraction) < off < most * Fraction(1, 2**into.fraction)
    assert into.low <= got <= into.high


@given(numbers(), st.data())
def test_differences_are_exact_or_overflow(number, data) -> None:
    form, a = number
    b = data.draw(st.integers(form.low, form.high))
    if form.low <= a - b <= form.high:
        assert int(form.difference(a, b)) == a - b
    else:
        with pytest.raises(FixedPointOverflowError):
            form.difference(a, b)


@given(numbers(), numbers(), formats)
def test_products_are_within_a_bit_or_overflow(one, other, into) -> None:
    (of_a, a), (of_b, b) = one, other
    if into.fraction > of_a.fraction + of_b.fraction:
        with pytest.raises(ValueError, match="coarser"):
            into.product(a, of_a, b, of_b)
        return
    truth = Fraction(a * b, 2 ** (of_a.fraction + of_b.fraction))
    exact_or_overflow(lambda: into.product(a, of_a, b, of_b), into, truth, -1, 1)


@given(numbers(), numbers(), formats)
def test_quotients_are_within_a_bit_or_overflow(one, other, into) -> None:
    (of_a, a), (of_b, b) = one, other
    shift = into.fraction + of_b.fraction - of_a.fraction
    if shift < 0 or of_a.whole + of_a.fraction + shift > 63:
        return
    if b == 0:
        with pytest.raises(FixedPointOverflowError):
            into.quotient(a, of_a, b, of_b)
        return
    truth = Fraction(a, 2**of_a.fraction) / Fraction(b, 2**of_b.fraction)
    exact_or_overflow(lambda: into.quotient(a, of_a, b, of_b), into, truth, -1, 1)


@given(st.lists(st.integers(0, 2**62), min_size=1, max_size=8))
def test_roots_are_whole(values) -> None:
    assert square_root(values).tolist() == [math.isqrt(v) for v in values]
    assert square_root(np.zeros(0)).size == 0
