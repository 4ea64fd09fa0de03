"""How far each match of a fit is to be trusted: a mixture of right stars and wrong ones.

Right stars scatter by a normal law a coordinate; wrong ones (blends, mismatches, hot pixels) lie
anywhere within :data:`REACH_SIGMA`. How many are wrong is learnt from the residuals themselves, by
expectation and maximisation (Dempster, Laird and Rubin 1977, J. R. Stat. Soc. B 39, 1).
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

REACH_SIGMA = 6.0
"""Wrong stars that may be taken for right ones are spread so far; those beyond have no say."""
BELIEF = (1.0, 10.0)
"""Before any star is looked at: one wrong to ten right ones, counted as so many stars seen."""
_NODES, _WEIGHTS = np.polynomial.laguerre.laggauss(40)


def trust(scaled: Floats, share: float) -> tuple[Floats, float]:
    """The probability (M,) that each match is right, and the share of wrong ones seen anew.

    Parameters
    ----------
    scaled : (M,)
        Lengths of the residuals, in sigmas of one coordinate.
    share : float
        The share of wrong ones among those within :data:`REACH_SIGMA`, as believed so far.

    """
    right = _right(scaled**2 / 2.0, share)
    near = scaled <= REACH_SIGMA
    wrong = BELIEF[0] + float((1.0 - right[near]).sum())
    return right, wrong / (sum(BELIEF) + float(near.sum()))


def corrections(share: float) -> tuple[float, float]:
    """What the weights do to right stars: of the mean square, and of the fit's covariance.

    The weighted mean square of normal residuals falls short of their variance by the first factor.
    The second is the covariance of the weighted fit over ``variance / sum(weights J^T J)`` (Huber
    1981, Robust Statistics, section 7.6). Both are 1 without weights.
    """
    half = _NODES  # r^2 / 2 sigma^2 of two normal coordinates has an exponential law
    weight = _right(half, share)
    mean = float(_WEIGHTS @ weight)
    square = float(_WEIGHTS @ (weight * half))
    slope = -weight * (1.0 - weight)  # by half
    bread = mean + float(_WEIGHTS @ (slope * half))
    meat = float(_WEIGHTS @ (weight**2 * half))
    return square / mean, meat * mean / bread**2


def _right(half: Floats, share: float) -> Floats:
    normal = (1.0 - share) * np.exp(-half) / 2.0
    return np.asarray(normal / (normal + share / REACH_SIGMA**2))
