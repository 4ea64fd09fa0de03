"""What the classic methods need before they can begin, and how they say no."""

import numpy as np

from app.core.detections import Detections
from app.core.hint import Hint
from app.core.solution import NoSolution, Reason

WIDEST_DEG = 40.0  # pairs further apart are not tabled: most of the sky's pairs would be


def known_focal(detections: Detections, hint: Hint | None) -> float | None:
    """Focal length, px, at the geometric middle of the hint's range of scale; None without one."""
    if hint is None or hint.scale_arcsec_px is None:
        return None
    low, high = hint.scale_arcsec_px
    return float(1.0 / np.radians(np.sqrt(low * high) / 3600.0))


def table_deg(detections: Detections, focal_px: float) -> float:
    """The largest separation the frame can hold, whole degrees up, at most ``WIDEST_DEG``."""
    diagonal = np.hypot(detections.width, detections.height)
    return float(min(np.ceil(np.degrees(2.0 * np.arctan(diagonal / 2.0 / focal_px))), WIDEST_DEG))


def no_scale(detections: Detections) -> NoSolution:
    """The scale is needed and nobody gave it."""
    return NoSolution(
        Reason.NO_PATTERN_AGREED,
        "Give the field of view: this method compares angles.",
        "nothing: the scale is unknown",
        len(detections),
    )


def too_few(detections: Detections, fewest: int) -> NoSolution:
    """Fewer stars than the method can work with."""
    return NoSolution(
        Reason.TOO_FEW_STARS,
        "Expose longer or point at a richer part of the sky.",
        f"{len(detections)} stars, at least {fewest} are needed",
        len(detections),
    )


def not_agreed(detections: Detections, tried: str) -> NoSolution:
    """The method ran and its names did not hold."""
    return NoSolution(
        Reason.NO_PATTERN_AGREED,
        "Check the field of view, or use the method 'patterns'.",
        tried,
        len(detections),
    )
