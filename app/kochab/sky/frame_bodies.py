"""What a dated frame shows besides stars: bodies of the Solar System, and bright detections without a name."""

import math
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from typing import TYPE_CHECKING

import numpy as np

from kochab.core.arrays import Bools, Floats, Ints
from kochab.core.attitude import radec_deg, unit_vectors
from kochab.core.frame import Detections, Frame, Site
from kochab.core.progress import Task
from kochab.core.robust import mad_sigma, median
from kochab.core.solution import Solution
from kochab.core.values import frozen
from kochab.sky.apparent import julian_years
from kochab.sky.catalogue import Catalogue, open_catalogue

if TYPE_CHECKING:  # what follows is loaded by those who need it: a cold solve of an undated frame does not
    from kochab.sky.layer import Mark
    from kochab.sky.solar_system import Body, Moving

COMPLETE_TO_V = 9.5
"""The catalogue lacks no star to V 10; half a magnitude is for the frame's colours."""
FEWEST, BRIGHTEST = 10, 100
"""Stars from which a zero point is taken, and detections without a star that are looked up: each costs 0.4 ms."""

UNDATED = 2015.0
"""The year for which the stars' places are taken in a frame without a date."""
SEEN_ARCSEC = 100.0
"""No detection is taken for a body whose place is less certain; for the Moon it is."""
SAME_PX = 1e-6
COMPARED = 2000
"""Stars of a frame that all its detections are compared with at once, 1 ms; few frames show more."""
TRAIL_POINTS = 16


@frozen
class BodyInFrame:
    """A body at its pixel; ``seen`` when a detection that is no star lies within three sigma of it."""

    body: "Body"
    x: float
    y: float
    seen: bool


@frozen
class UnknownSource:
    """A bright detection that is in no catalogue; degrees are ICRS, ``mag`` about V by the frame's matched stars."""

    x: float
    y: float
    ra_deg: float
    dec_deg: float
    sigma_arcsec: float
    mag: float
    sigma_mag: float


@frozen
class FrameBodies:
    """What :func:`bodies_in_frame` finds, each brightest first.

    ``zero_point`` is the V of a detection of flux 1, the median over matched stars, and the scatter of one of them,
    mag; NaN where fewer than three are matched.
    """

    bodies: tuple[BodyInFrame, ...]
    unknown: tuple[UnknownSource, ...]
    zero_point: tuple[float, float] = (math.nan, math.nan)


def bodies_in_frame(
    solution: Solution,
    detections: Detections,
    time_utc: datetime | None,
    site: Site | None,
    catalogue: Catalogue,
    more: "Sequence[Moving]" = (),
    exposure_s: float = 0.0,
) -> Task[FrameBodies]:
    """The bodies within a solved frame, no fainter than its faintest matched star, and what remains unnamed.

    Of a frame without a time no bodies are looked for; a planet in it is a detection that is in no catalogue.

    Parameters
    ----------
    solution : Solution
        Where the frame points.
    detections : Detections
        Its detections; those without a star may be bodies.
    time_utc : datetime or None
        Mid-exposure; None where nobody knows.
    site : Site or None
        Where it was taken; None: the Earth's centre.
    catalogue : Catalogue
        The star catalogue.
    more : Sequence[Moving]
        Tables of asteroids, comets and satellites that count beside the shipped ones.
    exposure_s : float
        How long it was exposed: satellites leave trails.
    """
    camera, radius, px = solution.camera, solution.radius_rad + np.radians(0.3), solution.stars_px
    faintest = max((star.mag for star in solution.stars), default=0.0)
    near: Sequence[Body] = ()
    if time_utc is not None:
        from kochab.sky.small_bodies import bodies_near

        near = yield from bodies_near(time_utc, site, solution.centre_vector, radius, faintest, more, exposure_s)
    matched = _matched(detections.xy, px)
    free = np.ones(len(detections), dtype=bool)
    free[matched[0]] = False
    bodies = []
    for given in near:
        body = _clipped_to_frame(solution, given) if given.trail else given
        (x, y) = solution.pixels_of(body.vector[None])[0].tolist()
        disc_px = body.diameter_arcsec / 2.0 / camera.scale_arcsec_px
        if not (-disc_px <= x <= camera.width - 1 + disc_px and -disc_px <= y <= camera.height - 1 + disc_px):
            continue
        # three sigma of the fit, of half a pixel of centroid, and of the body's own place
        reach = disc_px + 3.0 * float(np.hypot(solution.rms_px + 0.5, body.sigma_arcsec / camera.scale_arcsec_px))
        its = (
            free
            & (np.hypot(*(detections.xy - (x, y)).T) <= reach)
            & (body.sigma_arcsec <= SEEN_ARCSEC or body.kind == "moon")
        )
        # a detection belongs to one body: the brightest, as bodies come in that order
        free &= ~its
        bodies.append(BodyInFrame(body, x, y, bool(its.any())))
    year = UNDATED if time_utc is None else julian_years(time_utc)
    zero_point = _zero_point(solution, detections, matched)
    known = len(matched[0]) >= FEWEST
    unknown = _unknown(solution, detections, zero_point, free, year, catalogue) if known else ()
    return FrameBodies(tuple(bodies), unknown, zero_point)


def _zero_point(solution: Solution, detections: Detections, matched: tuple[Ints, Ints]) -> tuple[float, float]:
    """As :class:`FrameBodies` has it, from the rows of detections and stars that are ``matched``."""
    row, star = matched
    if len(row) < 3:
        return math.nan, math.nan
    mags = np.array([s.mag for s in solution.stars])[star]
    each = mags + 2.5 * np.log10(np.maximum(detections.flux[row], 1e-12))
    middle = median(each)
    return middle, mad_sigma(each, middle)


def _matched(detected: Floats, stars: Floats) -> tuple[Ints, Ints]:
    """Which rows of ``detected`` (N, 2) are which of ``stars`` (M, 2), px: the same place, of numbers that went about.

    Sorted by x: all N x M pairs at once took a tenth of the whole solve.
    """
    order = np.argsort(stars[:, 0])
    sorted_x = stars[order, 0]
    low = sorted_x.searchsorted(detected[:, 0] - SAME_PX)
    count = sorted_x.searchsorted(detected[:, 0] + SAME_PX, side="right") - low
    row = np.repeat(np.arange(len(detected)), count)
    star = order[np.arange(len(row)) + np.repeat(low - (np.cumsum(count) - count), count)]
    same = np.abs(detected[row, 1] - stars[star, 1]) <= SAME_PX
    return row[same], star[same]


def _clipped_to_frame(solution: Solution, body: "Body") -> "Body":
    """A satellite at the middle of its trail through the frame, with that part alone; the same when it is outside."""
    xy = solution.pixels_of(np.array([unit_vectors(*place) for place in body.trail]))
    size = (solution.camera.width - 0.5, solution.camera.height - 0.5)
    inside = np.flatnonzero(((xy >= -0.5) & (xy <= size)).all(axis=1))
    if not len(inside):
        return body
    kept = np.unique(np.linspace(inside[0], inside[-1], TRAIL_POINTS + 1).round().astype(int))
    ra, dec = body.trail[inside[len(inside) // 2]]
    return replace(body, ra_deg=ra, dec_deg=dec, trail=tuple(body.trail[k] for k in kept.tolist()))


def body_marks(
    frame: Frame, solution: Solution, site: Site | None = None, more: "Sequence[Moving]" = ()
) -> "Task[tuple[Mark, ...]]":
    """The bodies of a frame that says when it was taken, for the sky layer; discs as outlines.

    Parameters
    ----------
    frame : Frame
        Its hint says when and where it was taken.
    solution : Solution
        Where it points.
    site : Site or None
        Used where the frame does not say its own.
    more : Sequence[Moving]
        Tables of bodies besides the shipped ones.
    """
    hint = frame.hint
    if hint.taken_utc is None:
        return ()
    nothing = Detections.from_list(np.empty((0, 2)), frame.width, frame.height)
    place, exposure_s = hint.site or site, hint.exposure_s or 0.0
    found = yield from bodies_in_frame(solution, nothing, hint.taken_utc, place, open_catalogue(), more, exposure_s)
    return tuple(body_mark(solution, one.body, k, np.array([one.x, one.y])) for k, one in enumerate(found.bodies))


def body_mark(solution: Solution, body: "Body", row: int, xy: Floats) -> "Mark":
    """A body with its disc or its trail, as a mark of the sky layer.

    Parameters
    ----------
    solution : Solution
        Where the frame points.
    body : Body
        What it is and where.
    row : int
        Its number among the bodies of the frame.
    xy : Floats
        Its pixel (2,).
    """
    from kochab.sky.layer import BODY_MAG, Mark

    turn = np.linspace(0.0, 2.0 * np.pi, 49)
    radius = body.diameter_arcsec / 2.0 / solution.camera.scale_arcsec_px
    shape = xy + radius * np.column_stack([np.cos(turn), np.sin(turn)])
    if body.trail:
        shape = solution.pixels_of(np.array([unit_vectors(*place) for place in body.trail]))
        radius = float(np.hypot(*(shape - xy).T).max())
    rank = float(np.nan_to_num(body.magnitude, nan=20.0)) - BODY_MAG
    return Mark(str(body.kind), row, xy, radius, rank, body.name, body.name, (shape,), body)


def _unknown(
    solution: Solution,
    detections: Detections,
    zero_point: tuple[float, float],
    free: Bools,
    year: float,
    catalogue: Catalogue,
) -> tuple[UnknownSource, ...]:
    """The ``free`` (N,) that the zero point makes brighter than the catalogue's limit, and nothing near."""
    zero, scatter = zero_point
    found = []
    clean = np.flatnonzero(free & ~detections.blended & (detections.flux > 0.0))
    clean = clean[np.argsort(-detections.flux[clean], kind="stable")[:BRIGHTEST]]
    mag = zero - 2.5 * np.log10(detections.flux[clean])
    bright = mag + 3.0 * scatter <= COMPLETE_TO_V
    clean, mag = clean[bright], mag[bright]
    directions = solution.sky_at(detections.xy[clean])
    near_px = 10.0 * solution.rms_px + 3.0 * np.nan_to_num(detections.fwhm_px[clean], nan=3.0) + 5.0
    near = np.radians(near_px * solution.camera.scale_arcsec_px / 3600.0)
    alone = ~_beside_a_bright_star(solution, directions, near, mag + 3.0, year, catalogue)
    for k in np.flatnonzero(alone).tolist():
        if len(catalogue.cone(directions[k], near[k], mag[k] + 3.0, year)):
            continue  # a star that the fit left out: saturated, double, or beyond its lens model
        ra, dec = radec_deg(directions[k])
        x, y = detections.xy[clean[k]].tolist()
        found.append(UnknownSource(x, y, ra, dec, solution.rms_arcsec, float(mag[k]), scatter))
    return tuple(sorted(found, key=lambda source: source.mag))


def _beside_a_bright_star(
    solution: Solution, directions: Floats, near: Floats, limits: Floats, year: float, catalogue: Catalogue
) -> Bools:
    """Which directions (N, 3) have one of the frame's ``COMPARED`` brightest stars within ``near`` (N,), radians.

    The star is no fainter than ``limits`` (N,). All are compared at once: a cone for each took a seventh of a solve.
    """
    if not len(directions):
        return np.zeros(0, dtype=bool)
    rows = catalogue.brightest(solution.centre_vector, solution.radius_rad + float(near.max()), COMPARED, year)
    # Of a far larger angle than a cosine's rounding; those left out by it get a cone of their own.
    near_star = directions @ catalogue.vectors(rows, year).T >= np.cos(near)[:, None]
    return np.asarray((near_star & (catalogue.mag(rows) <= limits[:, None])).any(axis=1))
