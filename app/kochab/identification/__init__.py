"""Identification of a frame's stars: methods by name."""

from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import numpy as np

from kochab.core.frame import Detections, Hint
from kochab.core.progress import Task
from kochab.core.registry import Registry
from kochab.core.solution import Identification, NoSolution


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


IDENTIFIERS: Registry[Identifier] = Registry(
    "method", "kochab.methods", {"patterns": "kochab.identification.patterns:Patterns"}
)


# -- Detections without a place are set aside before a method sees them ------------------------

Answer = Identification | NoSolution


def with_places(detections: Detections, work: Callable[[Detections], Task[Answer]]) -> Task[Answer]:
    """What ``work`` makes of the detections whose x and y are finite, numbered as they came."""
    there = np.isfinite(detections.xy)
    if there.all():
        return (yield from work(detections))
    finite = np.flatnonzero(there.all(axis=1))
    found = yield from work(detections.take(finite))
    if isinstance(found, NoSolution):
        return replace(found, detections=len(detections))
    # whoever asked counts the detections that were set aside, too
    numbered = finite[found.matches.detection].astype(np.int64)
    return replace(found, matches=replace(found.matches, detection=numbered))
