"""A number with its uncertainty, and robust medians that have one."""

import math
from dataclasses import dataclass

import numpy as np

from kochab.core.arrays import Bools, Floats

OF_MEDIAN = math.sqrt(math.pi / 2.0)
"""How much wider than a mean's the uncertainty of a median of Gaussian values is."""


@dataclass(frozen=True, slots=True)
class Measure:
    """``value`` and its standard uncertainty ``sigma``, in one unit."""

    value: float
    sigma: float

    @property
    def sigmas(self) -> float:
        """How many uncertainties it lies from zero."""
        return abs(self.value) / self.sigma if self.sigma > 0 else math.inf


def scatter(values: Floats) -> float:
    """Robust standard deviation of values (N,): 1.4826 times the median distance from the median."""
    return float(1.4826 * np.median(np.abs(values - np.median(values)))) if len(values) else math.nan


def median_of(values: Floats) -> Measure | None:
    """The median of values (N,) with its uncertainty; None for fewer than three."""
    if len(values) < 3:
        return None
    return Measure(float(np.median(values)), float(OF_MEDIAN * scatter(values) / math.sqrt(len(values))))


def one_sigma(dof: int) -> float:
    """Factor from a scatter's own estimate to 68 % for few degrees of freedom (Student's t)."""
    from scipy.special import stdtrit

    return float(stdtrit(dof, 0.8413447460685429))


def clipped(residuals: Floats, times: float = 4.0) -> Bools:
    """Which residuals (N,) lie within so many scatters; all where there is no scatter."""
    wide = scatter(residuals)
    return np.abs(residuals) <= times * wide if wide > 0 else np.ones(len(residuals), dtype=np.bool_)
