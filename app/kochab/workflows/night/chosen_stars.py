"""Stars that a person wants followed through a night, each measured in a frame against all the others.

Each in the aperture that the others have, and brought to V by their catalogue magnitudes at its own colour.
"""

import math
from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import unit_vectors
from kochab.core.errors import UsageError
from kochab.core.frame import Frame
from kochab.core.progress import run
from kochab.core.robust import median
from kochab.core.solution import Solution
from kochab.core.values import frozen
from kochab.sky.catalogue import open_catalogue
from kochab.sky.finder import NotFound, find
from kochab.workflows.night.sky_brightness import COLOUR, OfColour, StarsOnSky, colours_of, of_colour, photometry_at

SAME_RAD = 1e-4
"""Within 20 arcsec of where a name is said to be the catalogue has the star."""
CHECKS = 30
"""Catalogued stars most like one that are kept beside it: while it changes, others are."""


@frozen(eq=False)
class ChosenStar:
    """A star to follow: its name, ICRS unit vector (3,), and V and B-V of the catalogue, NaN where it has none."""

    name: str
    vector: Floats
    mag: float
    colour: float


@frozen
class StarInFrame:
    """What one frame says of a chosen star: V, its noise by the sky, and what the catalogue makes uncertain.

    ``checks`` are identifiers and V, in the same frame, of catalogued stars like it, the most alike first.
    """

    name: str
    mag: float
    noise_mag: float
    zero_mag: float
    checks: tuple[tuple[str, float], ...]


def chosen_star(text: str) -> ChosenStar:
    """The star that a person names; by a name, a number or a position; UsageError where there is none."""
    found = run(find(text, datetime.now(UTC), None, []))  # the time is for what moves, which is no star
    if isinstance(found, NotFound) or found.kind not in ("star", "position"):
        raise UsageError("{text} is not a known star. Give its name, or its RA and Dec.", text=text)
    catalogue = open_catalogue()
    rows = catalogue.brightest(found.vector, SAME_RAD, 1)
    if not len(rows):
        return ChosenStar(found.name, found.vector, math.nan, math.nan)
    (mag,), (colour,) = catalogue.mag(rows).tolist(), catalogue.bv(rows).tolist()
    return ChosenStar(found.name, catalogue.vectors(rows)[0], mag, colour)


def stars_in_frame(
    frame: Frame, solution: Solution, stars: StarsOnSky, chosen: Sequence[ChosenStar]
) -> tuple[StarInFrame, ...]:
    """Measure chosen stars; those outside the frame, saturated or without light are left out.

    Parameters
    ----------
    frame : Frame
        Its pixels.
    solution : Solution
        Where it points.
    stars : StarsOnSky
        The frame's other stars.
    chosen : sequence of ChosenStar
        Whom to measure.
    """
    found, others = [], _others(frame, solution, stars)
    places = solution.pixels_of(np.array([star.vector for star in chosen]).reshape(-1, 3))
    lights, noise = photometry_at(frame, places, stars)
    for star, light in zip(chosen, lights.tolist(), strict=True):
        if light > 0.0:
            zero = _zero(stars, star.colour)
            mag = zero.value - 2.5 * math.log10(light)
            checks = _checks(others, star, mag)
            found.append(StarInFrame(star.name, mag, 1.0857 * noise / light, zero.sigma, checks))
    return tuple(found)


@frozen(eq=False)
class _Others:
    """The catalogue stars that a solution matched and a frame measures.

    Identifiers, V and B-V (N,) of the catalogue, V as this frame has it (N,), and ICRS unit vectors (N, 3).
    """

    ids: tuple[str, ...]
    mag: Floats
    colour: Floats
    seen_mag: Floats
    vectors: Floats


def _others(frame: Frame, solution: Solution, stars: StarsOnSky) -> _Others:
    known = [star for star in solution.stars if math.isfinite(star.mag)]
    vectors = unit_vectors(*np.array([(star.ra_deg, star.dec_deg) for star in known]).reshape(-1, 2).T)
    light, _ = photometry_at(frame, solution.pixels_of(vectors), stars)
    lit = np.flatnonzero(light > 0.0)
    known = [known[k] for k in lit]
    colour = colours_of(known, solution) if known else np.zeros(0)
    colour = np.where(np.isfinite(colour), colour, COLOUR)
    zero = _zero(stars, math.nan)
    tint = 0.0 if math.isnan(zero.slope) else zero.slope * (colour - COLOUR)
    seen = zero.value + tint - 2.5 * np.log10(light[lit])
    return _Others(tuple(star.id for star in known), np.array([s.mag for s in known]), colour, seen, vectors[lit])


def _zero(stars: StarsOnSky, colour: float) -> OfColour:
    """The magnitude of one count for a star of a colour B-V, NaN where it is unknown."""
    values = stars.mag + 2.5 * np.log10(stars.light)
    return of_colour(values, stars.colour, COLOUR if math.isnan(colour) else colour)


def _checks(others: _Others, star: ChosenStar, mag: float) -> tuple[tuple[str, float], ...]:
    """V of the stars most like one, beside itself, as this frame has them: as faint as those that look as it does.

    By their catalogue magnitudes, which do not change from frame to frame; but not by its own measured one, for a frame
    whose numbers are not proportional to light shows faint stars brighter than they are, and bright ones scatter less.

    Parameters
    ----------
    others : _Others
        All that are known in the frame.
    star : ChosenStar
        The one.
    mag : float
        Its V in this frame.
    """
    beside = np.linalg.norm(others.vectors - star.vector, axis=1) >= SAME_RAD  # not itself
    if not beside.any():
        return ()
    look_alike = np.argsort(np.where(beside, np.abs(others.seen_mag - mag), np.inf))[: min(CHECKS, int(beside.sum()))]
    colour = COLOUR if math.isnan(star.colour) else star.colour
    unlike = np.abs(others.mag - median(others.mag[look_alike])) + 0.5 * np.abs(others.colour - colour)
    alike = np.argsort(np.where(beside, unlike, np.inf))[: min(CHECKS, int(beside.sum()))]
    return tuple((others.ids[k], float(others.seen_mag[k])) for k in alike.tolist())
