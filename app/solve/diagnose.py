"""The solve doctor: why there is no answer, what was measured, and one thing to do next."""

from collections.abc import Mapping
from dataclasses import dataclass

from app.core.detections import Detections
from app.core.frame import Frame
from app.core.hint import Hint
from app.core.solution import NoSolution, Reason


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """What a diagnosis is made from; ``frame`` is None for a bare list of stars."""

    detections: Detections
    hint: Hint | None = None
    frame: Frame | None = None


def diagnose(
    evidence: Evidence, refusal: NoSolution | None, elapsed_ms: Mapping[str, float]
) -> NoSolution:
    """Why the search ended without an answer."""
    return NoSolution(
        refusal.reason if refusal else Reason.NO_PATTERN_AGREED,
        "Check the frame.",
        detections=len(evidence.detections),
        elapsed_ms=elapsed_ms,
    )


def timed_out(evidence: Evidence, timeout_s: float, elapsed_ms: Mapping[str, float]) -> NoSolution:
    """The search went past its limit."""
    return NoSolution(
        Reason.TIMED_OUT,
        "Give the field of view or the scale as a hint, or a longer time limit.",
        tried=f"searched for {timeout_s:g} s",
        detections=len(evidence.detections),
        elapsed_ms=elapsed_ms,
    )


def cancelled(detections: int = 0, elapsed_ms: Mapping[str, float] | None = None) -> NoSolution:
    """The person stopped the search."""
    return NoSolution(
        Reason.CANCELLED, "Solve again when ready.", "", detections, dict(elapsed_ms or {})
    )
