"""Where the camera sees the polar axis, which no turn of RA and no bolt changes: what one sweep leaves to the next.

Bolts move the axis on the ground, so that a sweep after them says nothing of the sweep before. In the camera's own
axes both look for the same place, c = R_0^T a, as long as declination and camera stay as they are: what is known of it
from the sweep before is one more observation of two numbers in the fit of the next. With x the unknowns of that fit,
J its covariance, S = dc/dx and C that of c as known before, one step of a Kalman filter takes them together::

    K = J S^T (S J S^T + C)^-1,    x' = x + K (c_before - c),    J' = J - K S J
"""

from dataclasses import replace

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import east_north
from kochab.core.values import frozen
from kochab.polar.axis_fit import camera_slopes, moved_by
from kochab.polar.measure import Measurement
from kochab.polar.rotations import tangents

SAME2 = 9.0  # squared distance in sigmas, two dimensions; farther apart declination or the camera was moved


@frozen(eq=False)
class CameraAxis:
    """The polar axis in the camera's own axes, unit vector (3,), and its covariance (3, 3), rad^2.

    ``systematics`` (3, 3), rad^2, are flexure and creep, which another sweep need not share.
    """

    axis: Floats
    covariance: Floats
    systematics: Floats


def camera_axis_of(measurement: Measurement) -> CameraAxis:
    """The axis in its last sweep's camera.

    The covariance is that of the fit, and what residuals or sweeps that disagree have widened it by. A measurement that
    is surer than its last fit stays as sure as that: frame and axis share their errors.
    """
    error, fit = measurement.error, measurement.fit
    into_camera = fit.reference.T @ np.stack(tangents(error.axis), axis=1)
    wider, systematics = (
        np.asarray(into_camera @ each @ into_camera.T)
        for each in (_positive(error.covariance - fit.covariance), error.flexure + error.creep)
    )
    return CameraAxis(fit.reference.T @ error.axis, fit.camera_covariance + wider, systematics)


def with_axis_seen_before(again: Measurement, before: CameraAxis | None) -> Measurement:
    """The measurement of one sweep, surer by what was known of the axis in its camera.

    The measurement itself where that is nothing, or where both disagree.
    """
    if before is None or again.spoilt or len(again.results) != 1:
        return again
    fit, error = again.fit, again.error
    seen = fit.reference.T @ error.axis
    across = east_north(seen)
    joint = fit.joint.copy()
    joint[:2, :2] += _positive(error.covariance - joint[:2, :2])
    slopes = across @ camera_slopes(fit)
    spread = slopes @ joint @ slopes.T + across @ before.covariance @ across.T
    systematics = across @ (camera_axis_of(again).systematics + before.systematics) @ across.T
    gap = across @ (before.axis - seen)
    if before.axis @ seen < 0.0 or gap @ np.linalg.solve(spread + systematics, gap) > SAME2:
        return again
    gain = joint @ slopes.T @ np.linalg.inv(spread)
    # Disagreement that systematics allow widens the noise, as it does between sweeps with the bolts left alone.
    joint = (joint - gain @ slopes @ joint) * max(1.0, float(gap @ np.linalg.solve(spread, gap)) / 2.0)
    moved = moved_by(fit, gain @ gap, joint)
    # An axis that is corrected for a droop moves as the one that was fitted.
    axis = error.axis + moved.axis - fit.axis
    error = replace(error, axis=axis / np.linalg.norm(axis), covariance=moved.covariance)
    alone = replace(again.results[0].error, axis=moved.axis, covariance=moved.covariance)
    result = replace(again.results[0], error=alone)
    return replace(again, error=error, fit=moved, results=(result,))


def _positive(matrix: Floats) -> Floats:
    """A symmetric matrix (2, 2) without what is below zero in it."""
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)
