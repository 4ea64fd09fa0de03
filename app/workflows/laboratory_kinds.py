"""What the Laboratory compares: one part of a solve, while the others are the default ones."""

from collections.abc import Mapping
from enum import StrEnum
from importlib import import_module
from typing import Any

from app.attitude import ESTIMATORS
from app.core.errors import UsageError
from app.core.options import Option, checked, options_of
from app.detect import DETECTORS
from app.identify import IDENTIFIERS

FIT = "fit"
"""The default attitude: least squares of rotation and camera together, not an estimator's."""


class Kind(StrEnum):
    """The part of a solve that is exchanged, as the command line calls it."""

    METHOD = "method"
    DETECTOR = "detector"
    ATTITUDE = "attitude"


REGISTRIES: dict[Kind, Mapping[str, str]] = {
    Kind.METHOD: IDENTIFIERS,
    Kind.DETECTOR: DETECTORS,
    Kind.ATTITUDE: {FIT: "app.attitude.fit:refine", **ESTIMATORS},
}


def names_of(kind: Kind) -> list[str]:
    """All there are, the default first."""
    return list(REGISTRIES[kind])


def options_for(kind: Kind, name: str) -> tuple[Option, ...]:
    """What may be chosen about one of them; () when nothing is."""
    return options_of(_maker(kind, name))


def allowed(kind: Kind, name: str, values: Mapping[str, Any]) -> dict[str, Any]:
    """``values`` of its options, texts read as if typed; UsageError when one is wrong."""
    return checked(_maker(kind, name), values)


def paper_for(kind: Kind, name: str) -> str:
    """Author or title, year and chapter of its source."""
    return str(getattr(_maker(kind, name), "paper", "")) or "Kochab's own"


def _maker(kind: Kind, name: str) -> Any:
    if name not in REGISTRIES[kind]:
        there = ", ".join(REGISTRIES[kind])
        raise UsageError(f"There is no {kind} '{name}'; choose one of {there}.")
    module, _, attribute = REGISTRIES[kind][name].partition(":")
    return getattr(import_module(module), attribute)
