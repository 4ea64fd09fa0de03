"""Frame -> detections; one detector a file, chosen by name."""

from importlib import import_module
from typing import Any, Protocol

from app.core.detections import Detections
from app.core.errors import UsageError
from app.core.frame import Frame

DETECTORS: dict[str, str] = {
    "auto": "app.detect.auto:AutoDetector",
    "clusters": "app.detect.clusters:ClusterDetector",
    "gaussian": "app.detect.gaussian:GaussianDetector",
    "peaks": "app.detect.maxima:MaximaDetector",
    "contours": "app.detect.contours:ContourDetector",
    "thesis": "app.detect.thesis:ThesisDetector",
}


class Detector(Protocol):
    """Anything that finds stars."""

    def detect(self, frame: Frame) -> Detections:
        """Stars of ``frame``, brightest first; an empty list is an answer, not an error."""
        ...


def make_detector(name: str = "auto", **options: Any) -> Detector:
    """A detector by its name in ``DETECTORS``, with its options; UsageError when unknown."""
    if name not in DETECTORS:
        raise UsageError(f"There is no detector called {name}; there are {', '.join(DETECTORS)}.")
    module, kind = DETECTORS[name].split(":")
    detector: Detector = getattr(import_module(module), kind)(**options)
    return detector
