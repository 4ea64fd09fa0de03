"""What a search has found, in the words of ``core``."""

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import Attitude
from app.core.camera import Camera
from app.core.detections import Detections
from app.core.solution import Identification, Matches
from app.identify.verify import Verdict


def answered(
    verdict: Verdict, detections: Detections, rows: NDArray[np.integer],
    vectors: NDArray[np.floating], log10_false_alarm: float, tried: int,
) -> Identification:  # fmt: skip
    """The default method's answer: a verdict on stars of which ``rows`` and ``vectors`` are all.

    ``rows`` (N,) are the catalogue's, ``vectors`` (N, 3) ICRS unit vectors; ``tried`` pointings
    were looked at.
    """
    p, w, h = verdict.pointing, detections.width, detections.height
    camera = Camera(w, h, p.focal, (w - 1) / 2, (h - 1) / 2, k1=p.k1, mirrored=p.mirrored)
    matches = Matches(
        verdict.detections.astype(np.int64), rows[verdict.stars].astype(np.int64),
        detections.xy[verdict.detections], vectors[verdict.stars].astype(np.float64),
    )  # fmt: skip
    return Identification(matches, camera, Attitude(p.matrix), log10_false_alarm, "patterns", tried)
