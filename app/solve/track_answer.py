"""A tracked frame in the words of ``core``: the same ``Solution`` as one solved blind."""

from collections.abc import Mapping

import numpy as np

from app.core.camera import Camera
from app.core.solution import NamedStar, Solution
from app.solve.track_match import Tracked
from app.solve.track_sky import Expected, Neighbourhood
from app.solve.track_windows import Seen


def tracked_solution(
    found: Tracked, camera: Camera, sky: Neighbourhood, stars: Expected, seen: Seen,
    elapsed_ms: Mapping[str, float], warnings: tuple[str, ...] = (),
) -> Solution:  # fmt: skip
    """The solution of a frame from its windows, its stars brightest first."""
    estimate = found.estimate
    window = estimate.star
    number = stars.number[window]
    vectors = sky.vectors[number]
    ra = np.degrees(np.arctan2(vectors[:, 1], vectors[:, 0])) % 360.0
    dec = np.degrees(np.arcsin(np.clip(vectors[:, 2], -1.0, 1.0)))
    residual = np.hypot(*estimate.residuals_px.T)
    columns = zip(
        seen.xy[window].tolist(), number.tolist(), sky.mag[number].tolist(), ra.tolist(),
        dec.tolist(), residual.tolist(), strict=True,
    )  # fmt: skip
    named = tuple(
        NamedStar(x, y, *sky.label(n), mag, a, d, r) for (x, y), n, mag, a, d, r in columns
    )
    rms = float(np.sqrt(np.mean(residual**2)))
    return Solution(
        camera, estimate.attitude, named, rms, found.log10_false_alarm, "predict",
        int(seen.found.sum()), dict(elapsed_ms), warnings,
    )  # fmt: skip
