"""Detections without a place are set aside before a method sees them."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from app.core.detections import Detections
from app.core.progress import Task
from app.core.solution import Identification, NoSolution

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
    numbered = finite[found.matches.detection].astype(np.int64)
    return replace(found, matches=replace(found.matches, detection=numbered))
