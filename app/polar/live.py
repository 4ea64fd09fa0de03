"""The live phase: where the axis is now, from one attitude, while the bolts are turned.

The bolts and the RA axis can only do R_now = Rz(-dAz) R_h(dAlt) Rot(a, theta) R_ref, and since
Rot(a, theta) leaves a alone, the axis is now at R_now c, with c = R_ref^T a the axis as the camera
sees it: no assumption about tracking, levelness or the order of the bolts. theta is what is left
for tracking, periodic error and slipping.

Roll is the weak part of an attitude, and a wrong roll moves R_now c. When theta is known better
from the clock (either the mount tracks or it stands still) it is put in as a measurement of 20
arcsec. Such a prior is badly wrong when something slipped or was turned, so it is asked first: it
is dropped where the attitude alone puts theta more than three sigmas away.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.core.earth import SIDEREAL_RAD_S
from app.polar.error import PolarError
from app.polar.findings import Finding, Kind
from app.polar.live_movement import Moment, declination_moved
from app.polar.measure import Measurement
from app.polar.poles import northern
from app.polar.rotations import (
    ARCSEC,
    about,
    alt_az,
    cross_matrix,
    rotation,
    rotation_vector,
    tangents,
)
from app.polar.sighting import LocalAttitude, Sighting, to_local

Floats = NDArray[np.float64]

PRIOR_SIGMA_RAD = 20.0 * ARCSEC
GATE = 3.0
AMBIGUOUS = 4.0  # one hypothesis must be this many sigmas worse before the other is believed
LARGE_MOVE_DEG = 2.0
SLIPPED_DEG = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class LiveError:
    """The polar error now.

    ``theta_rad`` is how far the RA axis turned since the last measured frame; ``prior`` tells
    which clock's word on it was taken: "tracking", "standing" or "" for none. The error's
    covariance is the sum of ``frame_covariance``, new with each frame, and of the measurement's.
    """

    error: PolarError
    frame_covariance: Floats
    attitude: LocalAttitude
    theta_rad: float
    prior: str
    moved_deg: float
    findings: tuple[Finding, ...] = ()


class LivePhase:
    """Follows the axis after a measurement; one call of :meth:`update` a solved frame."""

    def __init__(self, measurement: Measurement) -> None:
        fit, last = measurement.fit, measurement.last_of_fit
        self._settings = measurement.settings
        self._start = measurement.error
        self._camera_axis = fit.reference.T @ measurement.error.axis
        self._camera_covariance = fit.camera_covariance + _beyond(measurement)
        self._reference = about(fit.axis, float(fit.turns_rad[-1])) @ fit.reference
        self._reference_time = last.time_utc
        self._before = self._moment(last)
        self._clock = ""  # the last one that was believed
        self._declination_rad = 0.0

    def update(self, sighting: Sighting) -> LiveError:
        """The error at a new frame."""
        return self.update_local(to_local(sighting, self._settings.site, self._settings.air))

    def update_local(self, now: LocalAttitude) -> LiveError:
        """The same from an attitude already in E, N, U."""
        matrix, covariance = now.matrix, now.covariance
        theta, slope = self._watch_declination(now)
        sigma2 = float(slope @ covariance @ slope)
        prior, expected = self._clock_says(now, theta, sigma2)
        if prior:
            gain = covariance @ slope / (sigma2 + PRIOR_SIGMA_RAD**2)
            matrix = matrix @ rotation(gain * (expected - theta))
            covariance = covariance - np.outer(gain, slope @ covariance)
            theta, _ = self._theta(matrix)
            self._clock = prior
        axis = matrix @ self._camera_axis
        frame = self._of_frame(matrix, axis, covariance)
        total = frame + self._of_measurement(matrix, axis)
        error = PolarError(axis, self._start.pole, total, self._start.unseen)
        moved = float(np.degrees(np.linalg.norm(axis - self._start.axis)))
        findings = tuple(self._findings(error, moved, theta, now))
        return LiveError(error, frame, now, theta, prior, moved, findings)

    def _moment(self, now: LocalAttitude) -> Moment:
        return Moment(now, *self._theta(now.matrix), now.matrix @ self._camera_axis)

    def _watch_declination(self, now: LocalAttitude) -> tuple[float, Floats]:
        """The turn and its slope at a frame, once it is compared with the frame before."""
        moment, before = self._moment(now), self._before
        elapsed = (now.time_utc - before.attitude.time_utc).total_seconds()
        turns = self._clocks(elapsed)
        known = [turns[self._clock]] if self._clock else list(turns.values())
        self._declination_rad += declination_moved(before, moment, known) or 0.0
        self._before = moment
        return moment.theta_rad, moment.slope

    def _clocks(self, elapsed_s: float) -> dict[str, float]:
        """How far RA turns in a time, radians, when the mount tracks and when it stands."""
        sign = -1.0 if northern(self._settings.site) else 1.0
        return {"tracking": sign * SIDEREAL_RAD_S * elapsed_s, "standing": 0.0}

    def _theta(self, matrix: Floats) -> tuple[float, Floats]:
        """The turn about the axis since the reference, and its slope (3,) over camera rotations.

        A small rotation ``w`` about the camera's own axes changes theta by slope @ w.
        """
        moved = matrix @ self._camera_axis
        alt0, az0 = alt_az(self._start.axis)
        alt1, az1 = alt_az(moved)
        lift = about(np.array([np.cos(az0), -np.sin(az0), 0.0]), alt1 - alt0)
        knobs = about(np.array([0.0, 0.0, 1.0]), az0 - az1) @ lift
        left = rotation_vector(knobs.T @ matrix @ self._reference.T)
        across = np.array([np.cos(az1), -np.sin(az1), 0.0])
        basis = np.stack([np.array([0.0, 0.0, 1.0]), across, moved], axis=1)
        return float(left @ self._start.axis), np.linalg.solve(basis, matrix)[2]

    def _clock_says(self, now: LocalAttitude, theta: float, sigma2: float) -> tuple[str, float]:
        """Which prior holds, and the turn it expects; none when both do or neither."""
        elapsed = (now.time_utc - self._reference_time).total_seconds()
        expected = self._clocks(elapsed)
        scale = np.sqrt(sigma2 + PRIOR_SIGMA_RAD**2)
        off = {name: abs(_wrap(theta - value)) / scale for name, value in expected.items()}
        near, far = sorted(off, key=lambda name: off[name])
        if off[near] > GATE or off[far] < AMBIGUOUS:
            return "", 0.0
        return near, theta + _wrap(expected[near] - theta)

    def _of_frame(self, matrix: Floats, axis: Floats, covariance: Floats) -> Floats:
        """Covariance (2, 2) of the axis, from this frame's attitude alone."""
        lever = np.stack(tangents(axis)) @ matrix @ cross_matrix(self._camera_axis)
        return np.asarray(lever @ covariance @ lever.T)

    def _of_measurement(self, matrix: Floats, axis: Floats) -> Floats:
        """Covariance (2, 2) of the axis, from where in the camera the measurement put it."""
        frame = np.stack(tangents(axis)) @ matrix
        return np.asarray(frame @ self._camera_covariance @ frame.T)

    def _findings(
        self, error: PolarError, moved_deg: float, theta: float, now: LocalAttitude
    ) -> list[Finding]:
        found = []
        if self._declination_rad:
            found.append(
                Finding(
                    Kind.DEC_MOVED,
                    f"The declination axis moved by {_arcmin(self._declination_rad):.1f}', and the"
                    " error shown is wrong by as much: lock it and measure again.",
                )
            )
        elapsed = abs((now.time_utc - self._reference_time).total_seconds())
        if not found and abs(theta) > elapsed * SIDEREAL_RAD_S + np.radians(SLIPPED_DEG):
            found.append(
                Finding(
                    Kind.SLIPPING,
                    f"The RA axis turned by {abs(np.degrees(theta)):.1f} deg by itself: lock its"
                    " clutch; the numbers hold nevertheless.",
                )
            )
        if moved_deg > LARGE_MOVE_DEG:
            found.append(
                Finding(
                    Kind.REMEASURE,
                    f"The axis has moved by {moved_deg:.1f} deg since it was measured: measure"
                    " again before the fine adjustment.",
                )
            )
        if error.below_uncertainty:
            found.append(Finding(Kind.DONE, "Stop: the error is smaller than its uncertainty."))
        return found


def _beyond(measurement: Measurement) -> Floats:
    """Covariance (3, 3) of the axis in the camera, of what the measurement adds to its last fit.

    That is what residuals or sweeps that disagree have widened it by. A measurement that is surer
    than its last fit stays as sure as that: frame and axis share their errors.
    """
    error, fit = measurement.error, measurement.fit
    values, vectors = np.linalg.eigh(error.covariance - fit.covariance)
    more = (vectors * np.maximum(values, 0.0)) @ vectors.T
    into_camera = fit.reference.T @ np.stack(tangents(error.axis), axis=1)
    return np.asarray(into_camera @ more @ into_camera.T)


def _arcmin(angle_rad: float) -> float:
    return abs(angle_rad) / ARCSEC / 60.0


def _wrap(angle: float) -> float:
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)
