"""The combined detector of "Lost in space" for robotic telescopes (thesis, 2018).

Source: sections 6.2.4 and 7.1.5: Gaussian sources first, and local maxima where those are too few.
"""

from dataclasses import dataclass, field
from typing import ClassVar

from app.core.detections import Detections
from app.core.frame import Frame
from app.core.options import integer
from app.detect.gaussian import GaussianDetector
from app.detect.maxima import MaximaDetector


@dataclass(frozen=True, slots=True)
class ThesisDetector:
    """The stars of ``first`` when they are ``fewest`` (1 or more; the thesis' 5) or more.

    Else those of ``second``, which bears blurred and elongated stars better.
    """

    paper: ClassVar[str] = "Lost in space for robotic telescopes, 2018, section 6.2.4"

    fewest: int = integer(5, "stars", 1, 1000, "with fewer Gaussian sources, maxima are taken")
    first: GaussianDetector = field(default_factory=GaussianDetector)
    second: MaximaDetector = field(default_factory=MaximaDetector)

    def detect(self, frame: Frame) -> Detections:
        """Stars of ``frame``, brightest first."""
        found = self.first.detect(frame)
        return found if len(found) >= self.fewest else self.second.detect(frame)
