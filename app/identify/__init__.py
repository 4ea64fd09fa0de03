"""Naming the stars of a frame: one method a file behind one interface."""

from importlib import import_module
from typing import Protocol

from app.core.detections import Detections
from app.core.hint import Hint
from app.core.progress import Task
from app.core.solution import Identification, NoSolution


class Identifier(Protocol):
    """Something that names detections.

    ``identify`` takes detections (brightest first), a hint or None for a blind search, and the
    Julian year of the frame; it yields progress and returns matches or the reason for none.
    """

    def identify(
        self, detections: Detections, hint: Hint | None = None, year: float = 2016.0
    ) -> Task[Identification | NoSolution]:
        """Name the stars of one frame."""
        ...


IDENTIFIERS: dict[str, str] = {
    "patterns": "app.identify.patterns:Patterns",
    "voting": "app.identify.voting:Voting",
    "triads": "app.identify.triads:Triads",
    "angles": "app.identify.angles:Angles",
    "spherical_triangles": "app.identify.spherical_triangles:SphericalTriangles",
    "neighbours": "app.identify.neighbours:Neighbours",
    "predict": "app.identify.predict:Predict",
}


def make_identifier(name: str = "patterns", **options: object) -> Identifier:
    """The identifier registered as ``name``; raises KeyError for an unknown one."""
    module, _, cls = IDENTIFIERS[name].partition(":")
    maker = getattr(import_module(module), cls)
    made: Identifier = maker(**options)
    return made
