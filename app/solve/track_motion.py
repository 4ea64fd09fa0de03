"""What a frame that was solved blind does to the filter of a stream."""

from dataclasses import replace

import numpy as np

from app.attitude.filter import ARCSEC, Motion, State, begin, predicted, rotation_vector, updated
from app.core.attitude import Attitude
from app.core.camera import Camera
from app.solve.track_camera import turn_between

SAME_MOTION_S = 3.0


def found_again(
    before: State | None, attitude: Attitude, time_s: float, motion: Motion, was_lost: bool
) -> State:
    """The filter after an attitude that no prediction led to.

    A jump says nothing of the velocity, as far as one frame can tell, and no more does a frame long
    after the last: the filter begins anew. What it would have taken is a first guess of the
    velocity, though, if a camera may turn so fast, and no more certain than any.
    """
    if before is None:
        return begin(attitude, time_s, motion)
    ahead = predicted(before, time_s, motion)
    after = updated(ahead, attitude, motion)
    if ahead.step_s <= SAME_MOTION_S and (was_lost or not after.contradicted):
        return after
    anew = begin(attitude, time_s, motion)
    turned = rotation_vector(attitude.matrix @ before.matrix.T)
    rates = -turned / max(ahead.step_s, 1e-3)
    if float(np.linalg.norm(rates)) > motion.rate_sigma_arcsec_s * ARCSEC:
        return anew
    return replace(anew, rates_rad_s=rates)


def seen_by(state: State, before: Camera | None, after: Camera | None) -> State:
    """The same state in the axes of another model of the camera."""
    if before is None or after is None or before == after:
        return state
    turn = turn_between(before, after)
    both = np.kron(np.eye(2), turn)
    return replace(
        state, matrix=turn @ state.matrix, rates_rad_s=turn @ state.rates_rad_s,
        covariance=both @ state.covariance @ both.T,
    )  # fmt: skip
