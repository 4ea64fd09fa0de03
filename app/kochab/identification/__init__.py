"""Identification of a frame's stars: methods by name, and their options."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from kochab.core.frame import Detections, Hint
from kochab.core.progress import Task
from kochab.core.registry import Option, Registry, checked, options_of
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


# -- What can be chosen about each identifier, for the command line and the window -------------
# ::
#
#     for option in method_options("triads"):
#         print(option.name, option.value_text, option.range_text, option.text)
#     IDENTIFIERS.make("triads", **checked_options("triads", {"separation_deg": "0.08"}))


def method_options(name: str) -> tuple[Option, ...]:
    """The options of the method ``name``; () when it has none, as the default has."""
    return options_of(IDENTIFIERS.load(name))


def checked_options(name: str, values: Mapping[str, Any]) -> dict[str, Any]:
    """``values`` of options of the method ``name``, texts read as if typed; UsageError if wrong."""
    return checked(IDENTIFIERS.load(name), values)


def paper_of(name: str) -> str:
    """Author or title, year and chapter of the method's source; "" for our own."""
    return str(getattr(IDENTIFIERS.load(name), "paper", ""))


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
    numbered = finite[found.matches.detection].astype(np.int64)
    return replace(found, matches=replace(found.matches, detection=numbered))
