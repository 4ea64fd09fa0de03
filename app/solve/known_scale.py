"""Few stars through a camera whose scale is known: triads, with tolerances as tight as the hint.

Patterns need six stars or more and some of their neighbours. With the scale known to a part in a
hundred, four stars can be enough: separations tell so much that chance has no room.
"""

from dataclasses import replace

import numpy as np

from app.core.detections import Detections
from app.core.hint import Hint
from app.core.progress import Task
from app.core.solution import Identification
from app.identify.triads import Triads

FEWEST, MOST = 4, 12
LOOSEST = 1.01
"""Scales known less well than that, highest over lowest, are not known."""
ERROR_PX = 2.5
"""Error of a separation: four times that of a centroid of 0.4 px, both ends together."""
DIAGONALS_DEG = (5.0, 20.0)
"""Smaller frames have too few stars that bright, larger ones are never that poor."""
MAG_LIMIT = 6.7


def identify_known_scale(
    detections: Detections, hint: Hint | None, year: float
) -> Task[Identification | None]:
    """The answer of the triads, or None when the case is not one for them or they have none."""
    if hint is None or hint.scale_arcsec_px is None or not FEWEST <= len(detections) <= MOST:
        return None
    low, high = hint.scale_arcsec_px
    pixel_deg = float(np.sqrt(low * high)) / 3600.0
    diagonal_deg = float(np.hypot(detections.width, detections.height)) * pixel_deg
    if high > low * LOOSEST or not DIAGONALS_DEG[0] <= diagonal_deg <= DIAGONALS_DEG[1]:
        return None
    room = ERROR_PX * pixel_deg + diagonal_deg * (high / low - 1.0) / 2.0
    method = Triads(separation_deg=room, mag_limit=MAG_LIMIT, scales=1)
    found = yield from method.identify(detections, hint, year)
    return replace(found, method="few stars") if isinstance(found, Identification) else None
