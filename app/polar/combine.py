"""One axis from one sweep or more, the droop of the tube with it: linear least squares.

Unknown are the axis (two numbers) and the droop f; sweep k says ``axis + lever_k f`` with its own
covariance, and what was known of f before is one more equation. What comes out of the sweeps'
noise and what comes out of the doubt about f are told apart, for only the first is seen.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.polar.bending import UNKNOWN, Droop, lever, rest_covariance
from app.polar.error import PolarError
from app.polar.rotations import ARCSEC, tangents

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """What one sweep alone says, droop left in it; ``rho_rad`` from axis to boresight."""

    error: PolarError
    rho_rad: float


@dataclass(frozen=True, slots=True, eq=False)
class Combined:
    """The axis of all looks, the droop as known now, and how well they agree.

    ``freedom`` is 2 K - 2 of K looks, less the share of the droop that they tell themselves.
    """

    error: PolarError
    droop: Droop
    chi2: float
    freedom: float

    @property
    def chance(self) -> float:
        """Probability of so large a chi-square by noise alone; 1 for a single look."""
        if self.freedom <= 0:
            return 1.0
        from scipy.special import chdtrc  # scipy.stats takes two seconds to load

        return float(chdtrc(self.freedom, self.chi2))


def combined(looks: Sequence[Look], before: Droop = UNKNOWN) -> Combined:
    """The axis that several sweeps of it share; looks that disagree widen its covariance.

    Parameters
    ----------
    looks
        One or more, of an axis that nobody moved between them.
    before
        What was known of the droop.

    """
    base, pole = looks[0].error.axis, looks[0].error.pole
    upward, clockwise = tangents(base)
    rows = np.stack([_row(lever(base, look.rho_rad)) for look in looks])
    weights = np.stack([np.linalg.inv(look.error.covariance) for look in looks])
    seen = np.stack([np.stack([upward, clockwise]) @ (k.error.axis - base) for k in looks])
    value, doubt = before.arcsec * ARCSEC, before.sigma_arcsec * ARCSEC
    normal = np.einsum("kji,kjl,klm->im", rows, weights, rows)
    normal[2, 2] += doubt**-2
    inverse = np.linalg.inv(normal)
    gains = np.stack([inverse @ r.T @ w for r, w in zip(rows, weights, strict=True)])
    found = np.einsum("kij,kj->i", gains, seen) + inverse[:, 2] * value / doubt**2
    gaps = seen - rows @ found
    chi2 = float(np.einsum("ki,kij,kj->", gaps, weights, gaps))
    learned = 1.0 - float(inverse[2, 2]) / doubt**2  # of the droop, from the looks themselves
    freedom = 2 * len(looks) - 2 - learned if len(looks) > 1 else 0.0
    noise = sum(g[:2] @ k.error.covariance @ g[:2].T for g, k in zip(gains, looks, strict=True))
    axis = base + found[0] * upward + found[1] * clockwise
    axis /= np.linalg.norm(axis)
    unseen = inverse[:2, :2] - noise + rest_covariance(axis)
    widen = max(1.0, chi2 / freedom) if freedom else 1.0
    error = PolarError(axis, pole, np.asarray(noise) * widen, unseen)
    droop = Droop(float(found[2]) / ARCSEC, float(np.sqrt(inverse[2, 2])) / ARCSEC)
    return Combined(error, droop, chi2, freedom)


def _row(altitude_lever: float) -> Floats:
    """What a look sees (2, 3) of the axis along altitude and azimuth, and of the droop."""
    return np.array([[1.0, 0.0, altitude_lever], [0.0, 1.0, 0.0]])
