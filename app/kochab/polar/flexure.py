"""Flexure of the tube: how it shifts a measured axis, and what two sweeps show of it.

A tube that droops by ``f cos(altitude)`` - the term TF of a pointing model (Wallace's TPOINT) - turns the camera by
``-f b x u``, with b the boresight and u straight up. While b goes round the axis a at the angle rho, the part of it
that is not constant in the camera lies along a, where a turn hides it; the constant part in E, N, U is ``-f cos(rho)
a x u``. So the sweep fits as well as ever, and finds the axis too low by ``f cos(rho) cos(altitude of the axis)``.
Two sweeps with different rho tell f.

What else gives way - focuser, saddle, mirror - is taken as a small turn of the camera linear in
gravity's pull on it. Half of its changing part shifts the axis, in any direction, and is not seen
at all; the other half swings twice as fast as the axis turns, ``exp(2 i t)``, and over less than
half a turn passes for a shift of the same size, ``exp(2 i t) ~ 2 exp(i t) - 1``.
"""

from collections.abc import Sequence

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import ARCSEC
from kochab.core.values import frozen
from kochab.polar.axis_fit import chance_of
from kochab.polar.error import PolarError
from kochab.polar.rotations import tangents

TUBE_ARCSEC, WORSE = 30.0, 5.0 / 3.0
"""One sigma of the droop before anything is known: a 9 inch Schmidt-Cassegrain's guide scope was seen to sag by 32
arcsec in 85 minutes (astronomy.mdodd.com/flexure.html). The ellipse is so many times wider: some tubes sag by 120."""

CREEPS = 0.6  # of all sweeps, as the priors of :mod:`kochab.polar.axis_fit` have it
REST_ARCSEC = 10.0  # one sigma of each element of what else gives way


@frozen
class Droop:
    """How much the tube sinks between zenith and horizon, and one sigma of it."""

    arcsec: float = 0.0
    sigma_arcsec: float = TUBE_ARCSEC


UNKNOWN = Droop()


def lever(axis: Floats, rho_rad: float) -> float:
    """By how much a droop of 1 shifts the altitude of the axis found.

    ``axis`` (3,) in E, N, U is the elevated end; ``rho_rad`` lies between it and the boresight.
    """
    return -float(np.hypot(axis[0], axis[1]) * np.cos(rho_rad))


def rest_covariance(axis: Floats) -> Floats:
    """Covariance (2, 2), rad^2, along (altitude, azimuth on the sky) of flexure that no sweep can show."""
    level = float(np.hypot(axis[0], axis[1]))
    return np.eye(2) * (REST_ARCSEC * ARCSEC * level) ** 2


# -- One axis from one sweep or more, the droop of the tube with it: linear least squares ------
# Unknown are the axis (two numbers) and the droop f; sweep k says ``axis + lever_k f`` with its
# own covariance, and what was known of f before is one more equation. The sweeps' noise and the
# doubt about f are kept apart, for the residuals show only the first.


@frozen(eq=False)
class SweepResult:
    """The error one sweep gives, droop left in it; ``rho_rad`` from axis to boresight."""

    error: PolarError
    rho_rad: float


@frozen(eq=False)
class CombinedSweeps:
    """The axis of all sweeps, the droop as known now, and how well they agree.

    ``freedom`` is 2 K - 2 of K sweeps, less the share of the droop that they give themselves.
    """

    error: PolarError
    droop: Droop
    chi2: float
    freedom: float

    @property
    def chance(self) -> float:
        """Probability of so large a chi-square by noise alone; 1 for a single sweep."""
        return chance_of(self.chi2, self.freedom)


def combine_sweeps(sweeps: Sequence[SweepResult], before: Droop = UNKNOWN) -> CombinedSweeps:
    """The axis that one sweep or more share, and that nobody moved between them; disagreement widens its covariance.

    ``before`` is what was known of the droop.
    """
    base, pole = sweeps[0].error.axis, sweeps[0].error.pole
    upward, clockwise = tangents(base)
    rows = np.stack([_row(lever(base, s.rho_rad)) for s in sweeps])
    weights = np.stack([np.linalg.inv(s.error.covariance) for s in sweeps])
    seen = np.stack([np.stack([upward, clockwise]) @ (s.error.axis - base) for s in sweeps])
    value, doubt = before.arcsec * ARCSEC, before.sigma_arcsec * ARCSEC
    normal = np.einsum("kji,kjl,klm->im", rows, weights, rows)
    normal[2, 2] += doubt**-2  # what was known of the droop counts as one more measurement
    inverse = np.linalg.inv(normal)
    gains = np.stack([inverse @ r.T @ w for r, w in zip(rows, weights, strict=True)])
    found = np.einsum("kij,kj->i", gains, seen) + inverse[:, 2] * value / doubt**2
    gaps = seen - rows @ found
    chi2 = float(np.einsum("ki,kij,kj->", gaps, weights, gaps))
    learned = 1.0 - float(inverse[2, 2]) / doubt**2  # of the droop, from the sweeps themselves
    freedom = 2 * len(sweeps) - 2 - learned if len(sweeps) > 1 else 0.0
    noise = sum(g[:2] @ s.error.covariance @ g[:2].T for g, s in zip(gains, sweeps, strict=True))
    axis = base + found[0] * upward + found[1] * clockwise
    axis /= np.linalg.norm(axis)
    flexure = (inverse[:2, :2] - noise) * WORSE**2 + rest_covariance(axis)
    widen = max(1.0, chi2 / freedom) if freedom else 1.0
    creep = sum(g[:2] @ s.error.creep @ g[:2].T for g, s in zip(gains, sweeps, strict=True))
    creep = np.asarray(creep) * _creeping(sweeps, rows, seen, before)
    error = PolarError(axis, pole, np.asarray(noise) * widen, flexure, creep)
    droop = Droop(float(found[2]) / ARCSEC, float(np.sqrt(inverse[2, 2])) / ARCSEC)
    return CombinedSweeps(error, droop, chi2, freedom)


def _creeping(sweeps: Sequence[SweepResult], rows: Floats, seen: Floats, before: Droop) -> float:
    """How probable creep is by how far the sweeps are apart (K, 2), against a single one, which can't tell: 1."""
    # The likelihood with axis and droop integrated out; the flat prior of the axis is the same in both and cancels.
    evidence, known = [], np.array([0.0, 0.0, (before.sigma_arcsec * ARCSEC) ** -2])
    for share in (0.0, 1.0 / CREEPS):  # nothing crept, or all sweeps did
        weights = np.stack([np.linalg.inv(s.error.covariance + s.error.creep * share) for s in sweeps])
        normal = np.einsum("kji,kjl,klm->im", rows, weights, rows) + np.diag(known)
        aim = np.einsum("kji,kjl,kl->i", rows, weights, seen) + known * before.arcsec * ARCSEC
        chi2 = np.einsum("ki,kij,kj->", seen, weights, seen) - aim @ np.linalg.solve(normal, aim)
        evidence.append(-0.5 * (chi2 + np.linalg.slogdet(normal)[1] - np.linalg.slogdet(weights)[1].sum()))
    odds = CREEPS * np.exp(min(evidence[1] - evidence[0], 50.0))
    return float(odds / (odds + 1.0 - CREEPS)) / CREEPS


def _row(altitude_lever: float) -> Floats:
    """What a sweep sees (2, 3) of the axis along altitude and azimuth, and of the droop."""
    return np.array([[1.0, 0.0, altitude_lever], [0.0, 1.0, 0.0]])
