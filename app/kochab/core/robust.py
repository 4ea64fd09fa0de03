"""Median and scatter of values that have a few outliers."""

import numpy as np

from kochab.core.arrays import Array, Floats

PER_MAD = 1.4826
"""Sigma of a normal distribution over its median absolute deviation: 1 / Phi^-1(3/4)."""


def median(values: Array) -> float:
    """The median of values of any shape, NaN where there are none; none of them may be NaN.

    Seven times as quick as NumPy's for a few numbers.
    """
    flat = np.ravel(values)
    half = len(flat) // 2
    if not len(flat):
        return float("nan")
    # a whole sort is the quicker one of few numbers only
    ordered = np.sort(flat) if len(flat) < 200 else np.partition(flat, (len(flat) - 1 - half, half))
    return (float(ordered[half]) + float(ordered[~half])) / 2.0


def mad_sigma(values: Array, centre: float | None = None) -> float:
    """Robust standard deviation of values of any shape, from their median distance from ``centre``.

    Of normal values, as many wrong ones as not quite a half change it little (Hampel, 1974, JASA 69, 383). ``centre``
    is their median when None; the result has the values' unit, is 0 where half of them are alike, and NaN for none.
    """
    about: Floats = np.asarray(values, dtype=np.float64)
    return PER_MAD * median(np.abs(about - (median(about) if centre is None else centre)))
