"""A number with its uncertainty, and robust medians that have one."""

import math

import numpy as np

from kochab.core.arrays import Bools, Floats, Ints
from kochab.core.robust import mad_sigma, median
from kochab.core.values import frozen
from kochab.text.translation import number

OF_MEDIAN = math.sqrt(math.pi / 2.0)
"""How much wider than a mean's the uncertainty of a median of Gaussian values is."""


@frozen
class Measure:
    """``value`` and its standard uncertainty ``sigma``, in one unit."""

    value: float
    sigma: float

    def text(self, sign: str = "") -> str:
        """``1.23 ± 0.04``: two digits of the uncertainty, three decimals at most; ``sign`` is "+" to show it always."""
        digits = 1 - math.floor(math.log10(self.sigma)) if 0.0 < self.sigma < math.inf else 2
        digits = min(max(digits, 0), 3)
        value = number(round(self.value, digits) + 0.0, f"{sign}.{digits}f").replace("-", "−")
        return f"{value} ± {number(max(self.sigma, 0.001), f'.{digits}f')}" if self.sigma > 0.0 else value

    @property
    def sigmas(self) -> float:
        """How many uncertainties it lies from zero."""
        return abs(self.value) / self.sigma if self.sigma > 0 else math.inf

    def tells(self, usual: float) -> bool:
        """Whether it says more than that it is about as large as ``usual``: surer than that, or surely not zero."""
        return self.sigma < usual or self.sigmas > 3.0


def median_of(values: Floats) -> Measure | None:
    """The median of values (N,) with its uncertainty; None for fewer than three."""
    if len(values) < 3:
        return None
    return Measure(median(values), float(OF_MEDIAN * mad_sigma(values) / math.sqrt(len(values))))


def one_sigma(dof: int) -> float:
    """Factor from a scatter's own estimate to 68 % for few degrees of freedom (Student's t)."""
    from scipy.special import stdtrit

    return float(stdtrit(dof, 0.8413447460685429))


def rms_of(rms: float, dof: float) -> Measure:
    """An RMS of so many degrees of freedom, with how much larger it may be by one sigma (chi-squared's quantile)."""
    from scipy.special import chdtri

    return Measure(rms, rms * (math.sqrt(dof / float(chdtri(dof, 0.8413447460685429))) - 1.0))


def clipped(residuals: Floats, times: float = 4.0) -> Bools:
    """Which residuals (N,) lie within so many scatters; all where there is no scatter."""
    wide = mad_sigma(residuals)
    return np.abs(residuals) <= times * wide if wide > 0 else np.ones(len(residuals), dtype=np.bool_)


def slope(hours: Floats, values: Floats, group: Ints | None = None) -> tuple[Measure, Measure] | None:
    """Change an hour, and the RMS left about the line; None where nothing is left over to tell.

    The uncertainties are those of the scatter, wider where neighbours err alike and for few values.

    Parameters
    ----------
    hours, values : Floats
        Each (N,), in order of time.
    group : Ints or None
        Which level (N,) each value belongs to: a line of one slope and a level a group. None: one level.
    """
    of = np.zeros(len(hours), dtype=np.int64) if group is None else group
    rows = np.concatenate([hours[:, None], of[:, None] == np.unique(of)], axis=1)
    dof = len(hours) - rows.shape[1]
    centred = hours - rows[:, 1:] @ (rows[:, 1:].T @ hours / rows[:, 1:].sum(axis=0))
    if dof < 1 or not float(centred @ centred) > 0.0:
        return None
    terms, *_ = np.linalg.lstsq(rows, values, rcond=None)
    left = values - rows @ terms
    rms = math.sqrt(float(left @ left) / dof)
    alike = float(left[1:] @ left[:-1]) / float(left @ left) if rms > 0 and dof > 3 else 0.0
    alike = min(max(alike, 0.0), 0.95)
    wider = math.sqrt((1.0 + alike) / (1.0 - alike)) * one_sigma(dof)
    free = dof * (1.0 - alike**2) / (1.0 + alike**2)
    return Measure(float(terms[0]), wider * rms / math.sqrt(float(centred @ centred))), rms_of(rms, free)
