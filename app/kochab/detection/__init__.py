"""Frame -> detections: detectors by name."""

from typing import Protocol

from kochab.core.frame import Detections, Frame
from kochab.core.registry import Registry


class Detector(Protocol):
    """Anything that finds stars."""

    def detect(self, frame: Frame) -> Detections:
        """Stars of ``frame``, brightest first; an empty list is an answer, not an error."""
        ...


DETECTORS: Registry[Detector] = Registry("detector", "kochab.detectors", {"auto": "kochab.detection.auto:AutoDetector"})
