"""The descent to least squares over a chosen set of the camera's and the attitude's parameters."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.attitude.normal import Indices, Normal
from app.attitude.projection import PARAMETERS, moved, project_with_jacobian
from app.core.camera import Camera
from app.core.solution import Matches

Floats = NDArray[np.float64]

FOCAL = PARAMETERS.index("log_focal")
FAR = 2.0
"""When a step makes the sum of squares so many times smaller, the derivatives are made anew."""


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """One point of the descent.

    ``plain`` has the terms of the distortion that stand while they are not fitted. ``weight`` (M,)
    are the matches' by their errors, ``trust`` (M,) how far they count at all and ``share`` how
    many are wrong. ``pull`` is a believed log focal length and how much a step of it weighs, px.
    ``largest`` is the largest sigma of one coordinate that may be, px.
    """

    camera: Camera
    matrix: Floats
    matches: Matches
    weight: Floats
    inliers: NDArray[np.bool_]
    plain: Camera
    trust: Floats
    pull: tuple[float, float] | None = None
    share: float = 0.0
    largest: float = math.inf

    def residuals(self) -> Floats:
        """Recorded minus computed pixels (M, 2) of every match."""
        return self.matches.xy - self.camera.project(self._ahead())

    def slopes(self) -> tuple[Floats, Floats]:
        """Residuals (2, M) px and their derivatives (10, 2, M), of every match."""
        pixels, jacobian = project_with_jacobian(self.camera, self._ahead())
        return self.matches.xy.T - pixels.T, jacobian.T

    def _ahead(self) -> Floats:
        """Directions (M, 3) in camera axes; those behind the camera are far outside, finite."""
        vectors = self.matches.vectors @ self.matrix.T
        np.maximum(vectors[:, 2], 1e-3, out=vectors[:, 2])
        return vectors

    @property
    def counts(self) -> Floats:
        """How much each match counts (M,): outliers do not."""
        return np.asarray(self.weight * np.sqrt(self.trust) * self.inliers)

    def flat(self, residual: Floats, counts: Floats) -> Floats:
        """Residuals (2, M) times ``counts``, (2 M,), and then what the belief is off by."""
        left = (residual * counts).ravel()
        if self.pull is None:
            return left
        believed, weight = self.pull
        return np.append(left, (believed - np.log(self.camera.focal_px)) * weight)

    def normal(self, jacobian: Floats, counts: Floats) -> Normal:
        """The normal equations of derivatives (10, 2, M) times ``counts``, and of the belief."""
        rows = (jacobian * counts).reshape(len(PARAMETERS), -1)
        if self.pull is not None:
            column = np.zeros((len(PARAMETERS), 1))
            column[FOCAL] = self.pull[1]
            rows = np.concatenate([rows, column], axis=1)
        return Normal.of(rows)

    def linear(self) -> tuple[Floats, Normal]:
        """The weighted residuals here and their normal equations."""
        residual, jacobian = self.slopes()
        counts = self.counts
        return self.flat(residual, counts), self.normal(jacobian, counts)

    def weighted(self) -> Floats:
        """The weighted residuals alone."""
        return self.flat(self.residuals().T, self.counts)

    def moved(self, free: Indices, change: Floats) -> "State":
        """The state after a ``change`` of the ``free`` parameters."""
        step = np.zeros(len(PARAMETERS))
        step[free] = change
        camera, matrix = moved(self.camera, self.matrix, step)
        return replace(self, camera=camera, matrix=matrix)

    def descend(self, free: Indices, steps: int = 8) -> "State":
        """The state at the least squares over the ``free`` parameters.

        Levenberg-Marquardt; the derivatives are kept as long as the steps are small.
        """
        state, damping, fresh = self, 0.0, True
        residual, everything = state.linear()
        normal = everything.only(free)
        cost = float(residual @ residual)
        for _ in range(steps):
            tried = state.moved(free, normal.step(residual, damping))
            left = tried.weighted()
            cost_tried = float(left @ left)
            if not cost_tried <= cost * (1.0 + 1e-9):
                if fresh:
                    damping = max(10.0 * damping, 1e-3)
                    continue
                normal, fresh = state.linear()[1].only(free), True
                continue
            gain, far = cost - cost_tried, cost > FAR * cost_tried
            state, residual, cost, damping = tried, left, cost_tried, damping / 10.0
            if gain <= 1e-6 * cost + 1e-18 * len(residual):
                break
            if far:
                normal = state.linear()[1].only(free)
            fresh = far
        return state
