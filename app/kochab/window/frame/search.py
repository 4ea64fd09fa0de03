"""Find what a person means by what they type, and say how far from the open frame it is."""

from datetime import datetime

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import angle_between, east_north
from kochab.core.frame import Site
from kochab.core.progress import run as finish
from kochab.core.solution import Solution
from kochab.sky.finder import Found, NotFound, find
from kochab.text.translation import tr, tr_noop

WAYS = (
    tr_noop("{angle} north"),
    tr_noop("{angle} north-east"),
    tr_noop("{angle} east"),
    tr_noop("{angle} south-east"),
    tr_noop("{angle} south"),
    tr_noop("{angle} south-west"),
    tr_noop("{angle} west"),
    tr_noop("{angle} north-west"),
)


def taken_for(text: str, found: Found) -> str:
    """What was taken where a name is short for several things; nothing where there is no doubt."""
    if found.sure and not found.alternatives:
        return ""
    others = ", ".join(found.alternatives) or "–"
    return tr("{text} is taken for {name}. Others: {others}", text=text, name=found.name, others=others)


def away(solution: Solution, vector: Floats) -> str:
    """How far from the frame's centre a place (3,) is, and in which direction of the sky."""
    centre = solution.centre_vector
    east, north = east_north(centre) @ vector
    degrees = float(np.degrees(angle_between(centre, vector)))
    way = WAYS[round(float(np.degrees(np.arctan2(east, north))) / 45.0) % 8]
    return tr(way, angle=f"{degrees:.{0 if degrees >= 10.0 else 1}f}°")


def sought(text: str, when: datetime | None = None, site: Site | None = None) -> Found | NotFound:
    """What a person means; bodies of the Solar System where they are at a time, with the person's own elements."""
    from kochab.sky.elements import kept_elements

    return finish(find(text, when, site, [] if when is None else kept_elements()))
