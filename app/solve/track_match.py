"""What was found where stars were expected: an attitude, or no better than chance.

The Predictional Estimate (:mod:`app.identify.predict_match`) over windows instead of detections.
The windows' finds first agree on a common shift, then the rotation is refined.

How likely is it that chance alone agrees as well? A window's find that is not its star may be
anywhere in the window. So with n finds, m of them within r of one rotation of the prediction, the
bound is the binomial tail for p = 1 - exp(-pi r^2 / window's area), times the radii tried, times
the room of the three angles that were fitted to the same finds. Each look at the prediction is a
candidate.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.core.camera import Camera
from app.identify.chance import ACCEPT_LOG10
from app.identify.predict_match import Estimate, agreement, concluded, differential, expected_px
from app.solve.track_windows import Seen

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FEWEST = 4
LEAST_SHARE = 0.5  # of the finds that must agree
ROUNDS = 4
CLIP_SIGMA = 3.7
WORST_PX = 1.2  # RMS of the residuals; a lens that moved or a wrong match is worse


@dataclass(frozen=True, slots=True, eq=False)
class Tracked:
    """An estimate whose ``star`` numbers the windows, with its false-alarm bound."""

    estimate: Estimate
    log10_false_alarm: float


def match(
    camera: Camera, matrix: Floats, vectors: Floats, places: Floats, seen: Seen, half: int,
    roll_px: float = 0.0, looks: int = 1,
) -> Tracked | None:  # fmt: skip
    """The attitude that W windows agree on, or None when chance could explain it.

    ``vectors`` (W, 3) are the expected stars, ``places`` (W, 2) where they were expected with
    ``matrix``, ``roll_px`` what an error of roll may do at the frame's rim, ``looks`` how often the
    frame was looked at so far.
    """
    finds = np.flatnonzero(seen.found)
    if len(finds) < FEWEST:
        return None
    kept = finds[_common_shift((seen.xy - places)[finds], 2.0 + roll_px)]
    for _ in range(ROUNDS):
        if len(kept) < FEWEST:
            return None
        weight = 1.0 / seen.sigma_px[kept]
        matrix, _ = differential(camera, matrix, seen.xy[kept], vectors[kept], weight, steps=1)
        left = seen.xy[finds] - expected_px(camera, matrix, vectors[finds])
        length = np.hypot(*left.T)
        scaled = length / seen.sigma_px[finds]
        core = np.isin(finds, kept)
        clip = CLIP_SIGMA * max(1.0, 1.05 * float(np.median(scaled[core])))
        again = finds[(scaled <= clip) & (length <= max(3.0, 2.0 * WORST_PX))]
        if np.array_equal(again, kept):
            break
        kept = again
    if len(kept) < max(FEWEST, LEAST_SHARE * len(finds)):
        return None
    estimate = concluded(camera, matrix, seen.xy, vectors, kept, kept, seen.sigma_px[kept])
    if estimate.sigma_px > WORST_PX:
        return None
    left = seen.xy[finds] - expected_px(camera, estimate.attitude.matrix, vectors[finds])
    side = 2.0 * half + 1.0
    alarm = agreement(
        np.sum(left**2, axis=1), len(finds), 1, side**2, float(half), candidates=looks, free=3
    )
    return Tracked(estimate, alarm) if alarm <= ACCEPT_LOG10 else None


def _common_shift(shift: Floats, radius_px: float) -> NDArray[np.bool_]:
    """The shifts (N, 2) near the one that most others are near to."""
    near = np.square(shift[:, None] - shift).sum(axis=2) <= radius_px**2
    return np.asarray(near[near.sum(axis=1).argmax()])
