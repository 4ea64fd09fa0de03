"""What moved between the frames, when they do not share one axis: the pattern of residuals.

Frames of one sweep may only differ by turns about one axis. When chi-square says that they do not,
one more thing is supposed to have moved between two frames - the declination axis, or the camera
in its holder - and the axis is fitted again with that movement as another unknown. The supposition
that leaves the least is named when it explains what was unexplained.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.polar.axis_fit import AxisFit, fit_axis
from app.polar.rotations import ARCSEC, about
from app.polar.sighting import LocalAttitude

Floats = NDArray[np.float64]

UNLIKELY = 1e-3
"""Chi-squares less probable than this are not noise."""

LEAST_ARCSEC = 30.0  # less is bending or wind, and no axis that was left unlocked


@dataclass(frozen=True, slots=True, eq=False)
class Movement:
    """``what`` moved by ``angle_arcsec`` between the frames labelled ``before`` and ``after``."""

    what: str
    before: str
    after: str
    angle_arcsec: float
    sigma_arcsec: float
    fit: AxisFit


def find_movement(
    attitudes: Sequence[LocalAttitude], fit: AxisFit, towards: Floats
) -> Movement | None:
    """The movement that best explains a poor fit of three or more frames; None when none does."""
    if len(attitudes) < 3 or fit.chance > UNLIKELY:
        return None
    suppositions = [
        _suppose(attitudes, fit, towards, what, after)
        for after in range(len(attitudes) - 1)
        for what in ("declination", "camera")
    ]
    best = min(suppositions, key=lambda m: m.fit.chi2)
    explained = best.fit.chi2 < 0.2 * fit.chi2 or best.fit.chance > UNLIKELY
    clear = abs(best.angle_arcsec) > max(3.0 * best.sigma_arcsec, LEAST_ARCSEC)
    return best if explained and clear else None


def _suppose(
    attitudes: Sequence[LocalAttitude], fit: AxisFit, towards: Floats, what: str, after: int
) -> Movement:
    """The fit with the later frames turned back about one axis of the camera by the best angle.

    Chi-square is nearly a parabola in the angle: Newton's steps from three values of it.
    """
    angle, step, curvature = 0.0, 30.0 * ARCSEC, 1.0
    tried = fit
    for _ in range(6):
        low, here, high = (
            _turned_back(attitudes, tried, towards, what, after, angle + d)
            for d in (-step, 0.0, step)
        )
        slope = (high.chi2 - low.chi2) / (2.0 * step)
        curvature = (high.chi2 + low.chi2 - 2.0 * here.chi2) / step**2
        tried = here
        if curvature <= 0:
            break
        change = -slope / curvature
        angle += float(np.clip(change, -0.2, 0.2))
        if abs(change) < 0.1 * ARCSEC:
            break
    sigma = np.sqrt(2.0 / curvature) if curvature > 0 else np.inf
    final = _turned_back(attitudes, tried, towards, what, after, angle)
    names = [a.label or f"frame {k + 1}" for k, a in enumerate(attitudes)]
    return Movement(
        what, names[after], names[after + 1], angle / ARCSEC, float(sigma) / ARCSEC, final
    )


def _turned_back(
    attitudes: Sequence[LocalAttitude], fit: AxisFit, towards: Floats,
    what: str, after: int, angle: float,
) -> AxisFit:  # fmt: skip
    axis = _moving_axis(fit, what)
    undo = about(axis, -angle)
    return fit_axis(
        [
            replace(a, matrix=a.matrix @ undo) if k > after else a
            for k, a in enumerate(attitudes)
        ],
        towards,
    )  # fmt: skip


def _moving_axis(fit: AxisFit, what: str) -> Floats:
    """The axis (3,), in camera axes, of a movement in declination or of the camera alone."""
    boresight = np.array([0.0, 0.0, 1.0])
    if what == "camera":
        return boresight
    across = np.cross(boresight, fit.axis_in_camera)
    length = float(np.linalg.norm(across))
    return across / length if length > 1e-6 else np.array([1.0, 0.0, 0.0])
