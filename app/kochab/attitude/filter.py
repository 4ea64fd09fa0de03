"""The attitude over many frames, and how fast it changes: an error-state Kalman filter.

The state is the attitude as a rotation matrix and the camera's angular velocity about its own
axes. What the filter carries as numbers is the error of both, six of them: a small rotation about
the camera axes and a change of the velocity. After every star fit the error is estimated, put into
the state by multiplication, and is zero again, so that no attitude is ever too far from itself for
small angles (the multiplicative filter: Lefferts, Markley and Shuster 1982, J. Guid. Control 5,
417; Markley 2003, J. Guid. Control Dyn. 26, 311). There is no gyro: the stars are the gyro. The
velocity is a random walk, driven by white angular acceleration.

Between frames ``M(t + dt) = exp(-[w] dt) M(t)``, with the covariance of the error by::

    A = exp(-[w] dt),  Phi = [[A, -dt], [0, 1]],  Q = q [[dt^3 / 3, -dt^2 / 2], [-dt^2 / 2, dt]]

``q`` grows with the squared innovations when they are larger than the filter believes, and comes
back by itself: a mount that begins to slew is followed, one that tracks is averaged over seconds.
"""

from dataclasses import replace

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import ARCSEC, Attitude, rotation_vector, small_rotation
from kochab.core.values import frozen

MOST_AGILE = 1e10  # of q: the velocity changes by 56 deg/s in a second, more than any mount's


# -- The prior of how a camera moves -----------------------------------------------------------

RATE_SIGMA_RAD_S = 120.0 * ARCSEC
"""How fast it may turn about each axis when nothing is known yet."""
WANDER_RAD_S = 2.0 * ARCSEC
"""How much the velocity changes in one second: the root of ``q``."""
MANOEUVRE_RAD_S = 3600.0 * ARCSEC
"""How much it may have changed when a frame contradicts the prediction."""
GATE = 21.1
"""Squared innovation over its covariance, three degrees of freedom, from which a frame is held to contradict:
it happens once in ten thousand frames by chance."""


@frozen(eq=False)
class FilterState:
    """The filter at one moment.

    ``matrix`` (3, 3) ICRS to camera; ``rates_rad_s`` (3,) the camera's angular velocity about its
    own axes against the stars; ``covariance`` (6, 6) of (rotation, velocity), rad and rad/s;
    ``time_s`` on any clock; ``agility`` the factor on ``q``; ``chi2`` the last innovation;
    ``step_s`` how far the last prediction went.
    """

    matrix: Floats
    rates_rad_s: Floats
    covariance: Floats
    time_s: float
    agility: float = 1.0
    chi2: float = 0.0
    contradicted: bool = False
    step_s: float = 0.0

    @property
    def attitude(self) -> Attitude:
        """The attitude with the covariance of its small rotation."""
        return Attitude(self.matrix, self.covariance[:3, :3])

    @property
    def rates_deg_s(self) -> tuple[float, float, float]:
        """The velocity about x, y, z, degrees a second."""
        x, y, z = np.degrees(self.rates_rad_s)
        return float(x), float(y), float(z)

    @property
    def rates_sigma_deg_s(self) -> tuple[float, float, float]:
        """One-sigma errors of the velocity."""
        x, y, z = np.degrees(np.sqrt(np.diag(self.covariance)[3:]))
        return float(x), float(y), float(z)


def begin(attitude: Attitude, time_s: float) -> FilterState:
    """The first state, from an attitude with covariance; the velocity is not known yet."""
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = _covariance(attitude)
    covariance[3:, 3:] = np.eye(3) * RATE_SIGMA_RAD_S**2
    return FilterState(np.asarray(attitude.matrix), np.zeros(3), covariance, time_s)


def predicted(state: FilterState, time_s: float) -> FilterState:
    """The state carried on to ``time_s``; an earlier time leaves it where it is."""
    dt = max(0.0, time_s - state.time_s)
    turn = small_rotation(-state.rates_rad_s * dt)
    phi = np.eye(6)
    phi[:3, :3] = turn
    phi[:3, 3:] = -dt * np.eye(3)
    q = WANDER_RAD_S**2 * state.agility
    noise = np.zeros((6, 6))
    noise[:3, :3] = q * dt**3 / 3.0 * np.eye(3)
    noise[:3, 3:] = noise[3:, :3] = -q * dt**2 / 2.0 * np.eye(3)
    noise[3:, 3:] = q * dt * np.eye(3)
    covariance = phi @ state.covariance @ phi.T + noise
    return replace(state, matrix=turn @ state.matrix, covariance=covariance, time_s=time_s, step_s=dt)


def updated(state: FilterState, measured: Attitude) -> FilterState:
    """The state, predicted to the frame's time, after the attitude ``measured`` in it.

    A measurement beyond the gate is a manoeuvre: the velocity is forgotten before the measurement
    is taken in, and ``contradicted`` is set.
    """
    innovation = rotation_vector(measured.matrix @ state.matrix.T)
    noise = _covariance(measured)
    chi2 = float(innovation @ np.linalg.solve(state.covariance[:3, :3] + noise, innovation))
    covariance, contradicted = state.covariance, chi2 > GATE
    if contradicted:
        covariance = covariance + _manoeuvre(state.step_s, innovation)
    gain = np.linalg.solve(covariance[:3, :3] + noise, covariance[:3]).T
    step = gain @ innovation
    keep = np.eye(6)
    keep[:, :3] -= gain
    after = keep @ covariance @ keep.T + gain @ noise @ gain.T  # Joseph's form stays positive
    surprise = min(chi2 / 3.0, 10.0) - 1.3  # chi2 / 3 is 1 on average: the factor then falls by 9 % a frame
    agility = float(np.clip(state.agility * np.exp(0.3 * surprise), 1.0, MOST_AGILE))
    return FilterState(
        small_rotation(step[:3]) @ state.matrix,
        state.rates_rad_s + step[3:],
        0.5 * (after + after.T),  # rounding would make it asymmetric over thousands of frames
        state.time_s,
        agility,
        chi2,
        contradicted,
        state.step_s,
    )


def _covariance(attitude: Attitude) -> Floats:
    if attitude.covariance is None:
        raise ValueError("The filter needs the covariance of every attitude.")
    return np.asarray(attitude.covariance)


def _manoeuvre(dt: float, innovation: Floats) -> Floats:
    """The (6, 6) that an unknown change of velocity adds when it came ``dt`` before the frame."""
    dt = max(dt, 1e-3)  # two frames of one time stamp would divide by zero
    # Wide enough for the jump that was seen, or a slew at several deg/s would contradict frame after frame.
    jump = max(MANOEUVRE_RAD_S, 3.0 * float(np.linalg.norm(innovation)) / dt)
    return np.asarray(jump**2 * np.kron([[dt * dt, -dt], [-dt, 1.0]], np.eye(3)))
