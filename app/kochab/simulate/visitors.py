"""What crosses a simulated sky: asteroids and satellites of real elements, meteors, aircraft, each with its light."""

import math
from collections.abc import Callable, Sequence
from datetime import UTC, datetime

import numpy as np

from kochab.core.arrays import Bools, Floats
from kochab.core.attitude import unit
from kochab.core.camera import Camera
from kochab.core.frame import Site
from kochab.core.progress import run
from kochab.core.values import frozen
from kochab.sky.apparent import without_aberration
from kochab.sky.satellites import Satellites, topocentric_km
from kochab.sky.solar_system import Moving, observer_at

LOOK_S = 0.25
"""Between two looks whether something is in the frame."""
PATH_POINTS = 48
"""Of a path through the frame, between which it is straight."""
MOST_CORES = 20_000


@frozen
class Visitor:
    """One thing that moves: ``path`` gives ICRS unit vectors (K, 3) at unix times (K,), NaN where it is not there.

    ``mag`` gives V (K,) above the air at the same times. ``span`` is from when to when it is there, unix times.
    """

    name: str
    path: Callable[[Floats], Floats]
    mag: Callable[[Floats], Floats]
    span: tuple[float, float] = (-math.inf, math.inf)


def steady(mag: float) -> Callable[[Floats], Floats]:
    """A light that does not change."""
    return lambda times: np.full(len(times), mag)


def body_visitor(table: Moving, row: int, site: Site, span: tuple[float, float], mag: float) -> Visitor:
    """A body of the Solar System between two unix times; over a night its path is a parabola.

    Parameters
    ----------
    table : Moving
        The bodies.
    row : int
        Which of them.
    site : Site
        Where it is seen from.
    span : tuple of float
        First and last unix time.
    mag : float
        Its V.
    """
    nodes = np.linspace(*span, 3)
    found = [run(table.body(row, observer_at(datetime.fromtimestamp(t, UTC), site))) for t in nodes.tolist()]
    places = np.array([body.vector for body in found if body is not None])

    def path(times: Floats) -> Floats:
        s = (np.asarray(times) - nodes[1]) / (nodes[2] - nodes[1])
        shares = np.stack([0.5 * s * (s - 1.0), 1.0 - s * s, 0.5 * s * (s + 1.0)], axis=1)
        return unit(shares @ places)

    return Visitor(table.names[row], path, steady(mag))


def satellite_visitor(table: Satellites, row: int, site: Site, mag: float) -> Visitor:
    """A satellite of two-line elements, lit always.

    Parameters
    ----------
    table : Satellites
        Its elements.
    row : int
        Which of them.
    site : Site
        Where it is seen from.
    mag : float
        Its V.
    """

    def path(times: Floats) -> Floats:
        begin = float(times[0])
        observer = observer_at(datetime.fromtimestamp(begin, UTC), site)
        (places,), _ = topocentric_km(table.orbits[row : row + 1], observer, np.asarray(times) - begin)
        return without_aberration(unit(places), observer.time_utc)

    return Visitor(table.names[row], path, steady(mag))


def crossing(
    name: str, ends: tuple[Floats, Floats], span: tuple[float, float], mag: Callable[[Floats], Floats]
) -> Visitor:
    """Something on a great circle, at even speed.

    Parameters
    ----------
    name : str
        What it is.
    ends : tuple of Floats
        ICRS unit vectors (3,) where it begins and ends, less than half a turn apart.
    span : tuple of float
        When, unix times; before and after it is not there.
    mag : callable
        V (K,) at times (K,).
    """
    begin, end = ends
    angle = float(np.arccos(np.clip(begin @ end, -1.0, 1.0)))

    def path(times: Floats) -> Floats:
        share = (np.asarray(times) - span[0]) / (span[1] - span[0])
        sines = np.sin(np.stack([(1.0 - share) * angle, share * angle], axis=1)) / np.sin(angle)
        places = sines @ np.stack([begin, end])
        return np.asarray(places)

    return Visitor(name, path, mag, span)


def fixed_visitor(name: str, place: Floats, mag: Callable[[Floats], Floats]) -> Visitor:
    """A star that no catalogue has: ``place`` is its ICRS unit vector (3,)."""
    return Visitor(name, lambda times: np.repeat(place[None], len(times), axis=0), mag)


Project = Callable[[Floats, Floats], Floats]
"""Pixels (K, 2) of ICRS unit vectors (K, 3), each at its unix time (K,); NaN where the camera does not look."""


def cores_of(
    visitor: Visitor, project: Project, camera: Camera, span: tuple[float, float], spacing_px: float
) -> tuple[Floats, Floats, Floats]:
    """What an exposure gets of a visitor: places (M, 2) px, V (M,), and for how long each holds, seconds (M,).

    Parameters
    ----------
    visitor : Visitor
        What moves.
    project : Project
        Where the camera sees it.
    camera : Camera
        Its size.
    span : tuple of float
        Begin and end of the exposure, unix times.
    spacing_px : float
        Between two places.
    """
    span = max(span[0], visitor.span[0]), min(span[1], visitor.span[1])
    nothing = np.empty((0, 2)), np.empty(0), np.empty(0)
    if span[0] >= span[1]:
        return nothing
    looks = np.linspace(*span, 3 + int((span[1] - span[0]) / LOOK_S))
    # what passes between two looks is seen by where the chord leads
    seen = _near(project(visitor.path(looks), looks), camera)
    if not seen.any():
        return nothing
    at = np.flatnonzero(seen)
    times = np.linspace(looks[max(at[0] - 1, 0)], looks[min(at[-1] + 1, len(looks) - 1)], PATH_POINTS)
    xy = project(visitor.path(times), times)
    whole = np.isfinite(xy).all(axis=1)
    if whole.sum() < 2:
        return nothing
    times, xy = times[whole], xy[whole]
    length = float(np.hypot(*np.diff(xy, axis=0).T).sum())
    count = int(np.clip(np.ceil(length / spacing_px), 2, MOST_CORES))
    fine = times[0] + (np.arange(count) + 0.5) / count * (times[-1] - times[0])
    places = np.stack([np.interp(fine, times, side) for side in xy.T], axis=1)
    return places, visitor.mag(fine), np.full(count, (times[-1] - times[0]) / count)


def _near(xy: Floats, camera: Camera) -> Bools:
    """Which positions (K,) lie in the frame, or end a segment that crosses it."""
    with np.errstate(invalid="ignore"):
        ends = np.stack([xy[:-1], xy[1:]])
        low, high = ends.min(axis=0), ends.max(axis=0)
        size = np.array([camera.width, camera.height], dtype=np.float64)
        chord = ((high >= 0.0) & (low <= size)).all(axis=1)
    return np.asarray(np.concatenate([chord, [False]]) | np.concatenate([[False], chord]))


def light_of(
    visitors: Sequence[Visitor], project: Project, camera: Camera, span: tuple[float, float], spacing_px: float
) -> tuple[Floats, Floats, Floats]:
    """As `cores_of`, of all of them.

    Parameters
    ----------
    visitors : sequence of Visitor
        What moves.
    project : Project
        Where the camera sees it.
    camera : Camera
        Its size.
    span : tuple of float
        Begin and end of the exposure, unix times.
    spacing_px : float
        Between two places.
    """
    parts = [cores_of(one, project, camera, span, spacing_px) for one in visitors]
    places, mags, seconds = (np.concatenate([part[k] for part in parts]) for k in range(3))
    return places, mags, seconds
