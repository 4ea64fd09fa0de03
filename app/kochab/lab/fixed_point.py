"""Fixed-point numbers: integers that stand for fractions, and arithmetic that notices overflow.

The thesis "Attitude from stellar images", section 3.2: an M.N number has M bits before the binary
point, the sign's among them, and N after it. All arrays are int64 that hold values of at most 32
bits; products and dividends are twice as wide on the way, as the thesis asks. Nothing wraps round:
what does not fit raises :class:`FixedPointOverflowError`.
"""

import numpy as np
from numpy.typing import ArrayLike

from kochab.core.arrays import Floats, Ints
from kochab.core.errors import UsageError
from kochab.core.values import frozen


class FixedPointOverflowError(UsageError):
    """A value that has no room in its format."""


@frozen
class Format:
    """``whole`` bits before the point and ``fraction`` after it, at most 32 in all.

    Unsigned formats have at most 31, so that every product fits the wide word.
    """

    whole: int
    fraction: int
    signed: bool = True

    def __post_init__(self) -> None:
        """Refuse formats that the wide word cannot serve."""
        most = 32 if self.signed else 31
        if self.whole < 1 or self.fraction < 0 or self.whole + self.fraction > most:
            raise ValueError(f"There is no fixed-point format {self}.")

    def __str__(self) -> str:
        """M.N, as the thesis writes it."""
        return f"{self.whole}.{self.fraction}{'' if self.signed else ' unsigned'}"

    @property
    def low(self) -> int:
        """The least integer that fits."""
        return -(1 << self.whole + self.fraction - 1) if self.signed else 0

    @property
    def high(self) -> int:
        """The greatest integer that fits."""
        return (1 << self.whole + self.fraction - int(self.signed)) - 1

    @property
    def step(self) -> float:
        """What the last bit is worth."""
        return 2.0**-self.fraction

    def fits(self, values: ArrayLike) -> Ints:
        """``values`` (integers) unchanged, or FixedPointOverflowError."""
        numbers = np.asarray(values, dtype=np.int64)
        if numbers.size:
            # If the extremes fit all do, and the message can name one value.
            self.check(int(numbers.min()))
            self.check(int(numbers.max()))
        return numbers

    def check(self, value: int) -> int:
        """One integer unchanged, or FixedPointOverflowError."""
        if not self.low <= value <= self.high:
            raise FixedPointOverflowError(f"{value * self.step:g} does not fit a {self} fixed-point number.")
        return value

    def of(self, values: ArrayLike) -> Ints:
        """Floats as numbers of this format; what is below the last bit is cut off (section 3.3)."""
        scaled = np.trunc(np.asarray(values, dtype=np.float64) * (1 << self.fraction))
        # Beyond 2^53 a float skips integers, and astype wraps round silently beyond 2^63.
        if not np.isfinite(scaled).all() or (np.abs(scaled) > 2.0**53).any():
            raise FixedPointOverflowError(f"A value does not fit a {self} fixed-point number.")
        return self.fits(scaled.astype(np.int64))

    def floats(self, values: ArrayLike) -> Floats:
        """The numbers as floats."""
        return np.asarray(values, dtype=np.float64) * self.step

    def difference(self, a: ArrayLike, b: ArrayLike) -> Ints:
        """``a - b`` (3.2.2); all three in this format."""
        return self.fits(self.fits(a) - self.fits(b))

    def product(self, a: ArrayLike, of_a: "Format", b: ArrayLike, of_b: "Format") -> Ints:
        """``a b`` (3.2.3) in this format, shifted right, so rounded towards minus infinity.

        Parameters
        ----------
        a, b : ArrayLike
            Whole numbers that stand for the factors.
        of_a, of_b : Format
            Their formats.
        """
        wide = of_a.fits(a) * of_b.fits(b)
        shift = of_a.fraction + of_b.fraction - self.fraction
        if shift < 0:
            raise ValueError(f"The product of {of_a} and {of_b} is coarser than {self}.")
        return self.fits(wide >> shift)

    def quotient(self, a: ArrayLike, of_a: "Format", b: ArrayLike, of_b: "Format") -> Ints:
        """``a / b`` (3.2.4) in this format, cut off towards zero; overflow when ``b`` is zero.

        Parameters
        ----------
        a, b : ArrayLike
            Whole numbers that stand for dividend and divisor.
        of_a, of_b : Format
            Their formats.
        """
        shift = self.fraction + of_b.fraction - of_a.fraction
        if shift < 0 or of_a.whole + of_a.fraction + shift > 63:
            raise ValueError(f"{of_a} cannot be divided by {of_b} into {self}.")
        below = of_b.fits(b)
        if (below == 0).any():
            raise FixedPointOverflowError("A fixed-point number is divided by zero.")
        wide = of_a.fits(a) << shift
        # // alone rounds towards minus infinity; signs apart it cuts off towards zero.
        return self.fits(np.sign(wide) * np.sign(below) * (np.abs(wide) // np.abs(below)))


def square_root(wide: ArrayLike) -> Ints:
    """The integer part of the square roots of integers >= 0, by Newton and Raphson.

    The root of a value with 2N bits of fraction has N of them.
    """
    values = np.asarray(wide, dtype=np.int64)
    if values.size and int(values.min()) < 0:
        raise FixedPointOverflowError("The root of a negative fixed-point number is asked for.")
    bits = np.frexp(values.astype(np.float64))[1]
    root = np.left_shift(np.int64(1), ((bits + 1) // 2).astype(np.int64))  # never below the root
    while True:
        # From above, Newton's steps fall until they reach the integer root, then stay or rise by one.
        better = (root + values // np.maximum(root, 1)) >> 1
        if (better >= root).all():
            return np.asarray(root, dtype=np.int64)
        root = np.minimum(root, better)
