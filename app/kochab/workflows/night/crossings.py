"""What crossed the field while a frame was exposed: satellites by their elements, aircraft, meteor candidates.

A streak says little of what made it. It is named where elements that people gave put a satellite on its line; strobes
and lights side by side make an aircraft; light that rises and fades with both ends in the frame makes a meteor
candidate, never more. What is left is told as what it is: in none of the elements.
"""

import math
from collections.abc import Sequence
from datetime import datetime
from enum import StrEnum

import numpy as np

from kochab.core.arrays import Bools, Floats
from kochab.core.attitude import cross_product, radec_deg, unit_vectors
from kochab.core.frame import Detections, Frame, Site
from kochab.core.mount import SIDEREAL_DEG_S, SIDEREAL_RAD_S
from kochab.core.progress import Task
from kochab.core.solution import Solution
from kochab.core.values import frozen
from kochab.detection.streaks import Streak, find_streaks
from kochab.sky.solar_system import Body, BodyKind, Moving, covers, observer_at
from kochab.text.translation import tr_noop

SAME_WAY_RAD = math.radians(1.5)
"""By which a streak and a satellite's way may differ in direction."""
ACROSS_SHARE, LEAST_ACROSS_ARCSEC = 0.6, 90.0
"""How far beside its way a satellite may be, of its uncertainty along it and at least: orbits are late, not beside."""
SIDE_BY_SIDE_DEG = 0.2
"""Two lights of one aircraft at most: 70 m in 20 km."""
FLASHES, FLASH, EVEN = 3, 2.5, 0.2
"""Flashes that make a strobe, how many times brighter than the rest they are, and how far their spacing may scatter."""
FADED = 0.5
"""Of its brightest, at both ends of a meteor."""
BESIDE_WIDTH = 0.005
"""How far beside a line what lies on it may be, of the frame's width."""
FAR_WIDTHS = 1000.0
GEOSTATIONARY_DEG = 20.0
"""From the equator: their orbits are tilted by up to 15 degrees, and seen from 8 beside at most."""


class CrossingKind(StrEnum):
    """What a streak is taken for."""

    SATELLITE = tr_noop("satellite")
    UNLISTED = tr_noop("satellite or aircraft")
    AIRCRAFT = tr_noop("aircraft")
    METEOR = tr_noop("meteor candidate")


@frozen
class Crossing:
    """One streak: ``name`` by the elements, or empty; ``ends_deg`` RA and Dec, ICRS, where it begins and ends.

    ``whole`` says whether both ends are in the frame; ``ends_px`` are theirs. ``sigma_arcsec`` is how well its line is
    known across; ``off_arcsec`` how far the named satellite's own way is from it; ``chance`` how likely a streak of
    something else lies as near to one of the satellites' ways.
    """

    kind: CrossingKind
    name: str
    ends_deg: tuple[tuple[float, float], tuple[float, float]]
    ends_px: tuple[tuple[float, float], tuple[float, float]]
    length_deg: float
    sigma_arcsec: float
    snr: float
    whole: bool
    off_arcsec: float = float("nan")
    chance: float = float("nan")


def crossings_of(
    frame: Frame,
    detections: Detections,
    solution: Solution,
    time_utc: datetime | None,
    site: Site | None,
    more: Sequence[Moving] = (),
) -> Task[tuple[Crossing, ...]]:
    """The streaks of a solved frame, each with what it is taken for.

    Parameters
    ----------
    frame : Frame
        With its pixels; its hint says how long it was exposed.
    detections : Detections
        Of the frame.
    solution : Solution
        Where it points.
    time_utc : datetime or None
        Mid-exposure; None where nobody knows.
    site : Site or None
        Where it was taken.
    more : sequence of Moving
        Satellites whose elements are known, and bodies, which make no streaks.
    """
    streaks = find_streaks(frame, detections, solution.stars_px)
    if not streaks:
        return ()
    listed: list[Body] = []
    if time_utc is not None and site is not None and covers(time_utc):
        observer = observer_at(time_utc, site, frame.hint.exposure_s or 0.0)
        for table in more:
            near = yield from table.near(observer, solution.centre_vector, solution.radius_rad, math.inf)
            listed += [body for body in near if body.kind is BodyKind.SPACECRAFT and len(body.trail) > 1]
    found: list[Crossing] = []
    for streak, parallel in _grouped(streaks, solution):
        found.append(_crossing(streak, parallel, solution, listed))
    return tuple(found)


def _grouped(streaks: Sequence[Streak], solution: Solution) -> list[tuple[Streak, bool]]:
    """The streaks, those side by side as one; whether a second ran beside."""
    left, found = list(streaks), []
    while left:
        first = left.pop(0)
        parallel = [other for other in left if _side_by_side(first, other, solution)]
        left = [other for other in left if not any(other is one for one in parallel)]
        found.append((first, bool(parallel)))
    return found


def _side_by_side(one: Streak, other: Streak, solution: Solution) -> bool:
    apart_px = _across(one.ends[0], one.ends[1] - one.ends[0], other.ends.mean(axis=0))
    near = apart_px * solution.camera.scale_arcsec_px < 3600.0 * SIDE_BY_SIDE_DEG
    return _turned_rad(one.angle_rad, other.angle_rad) < math.radians(1.0) and near


def _turned_rad(one: float, other: float) -> float:
    """The angle between two directions of which neither has a front."""
    return abs((one - other + math.pi / 2.0) % math.pi - math.pi / 2.0)


def _across(start: Floats, way: Floats, place: Floats) -> float:
    """How far a place (2,) is from the line through ``start`` (2,) along ``way`` (2,), px."""
    dx, dy = place - start
    return abs(float(way[0] * dy - way[1] * dx)) / float(np.hypot(*way))


def _crossing(streak: Streak, parallel: bool, solution: Solution, listed: Sequence[Body]) -> Crossing:
    vectors = solution.sky_at(streak.ends)
    length_deg = float(np.degrees(np.arccos(np.clip(vectors[0] @ vectors[1], -1.0, 1.0))))
    scale = solution.camera.scale_arcsec_px
    name, off, chance = _named(streak, solution, listed)
    if name:
        kind = CrossingKind.SATELLITE
    elif parallel or _flashes(streak.light):
        kind = CrossingKind.AIRCRAFT
    elif all(streak.inside) and _fades(streak.light):
        kind = CrossingKind.METEOR
    else:
        kind = CrossingKind.UNLISTED
    begin, end = (radec_deg(vector) for vector in vectors)
    px = tuple((float(x), float(y)) for x, y in streak.ends)
    return Crossing(
        kind,
        name,
        (begin, end),
        (px[0], px[1]),
        length_deg,
        math.hypot(streak.sigma_px * scale, solution.rms_arcsec / math.sqrt(max(len(solution.stars), 1))),
        streak.snr,
        all(streak.inside),
        off,
        chance,
    )


def _named(streak: Streak, solution: Solution, listed: Sequence[Body]) -> tuple[str, float, float]:
    """The satellite whose way is a streak's line, how far that is off in arcsec, and the chance of it; "" for none."""
    scale = solution.camera.scale_arcsec_px
    width_arcsec = min(solution.camera.width, solution.camera.height) * scale
    best, chance = ("", math.inf), 0.0
    middle = streak.ends.mean(axis=0)
    for body in listed:
        xy = solution.pixels_of(np.array([unit_vectors(*place) for place in body.trail]))
        xy = xy[np.isfinite(xy).all(axis=1)]
        if len(xy) < 2:
            continue
        k = int(np.clip(np.argmin(np.hypot(*(xy - middle).T)), 1, len(xy) - 1))
        way = xy[k] - xy[k - 1]
        turned = _turned_rad(math.atan2(way[1], way[0]), streak.angle_rad)
        off = _across(xy[k], way, middle) * scale
        allowed = max(ACROSS_SHARE * body.sigma_arcsec, LEAST_ACROSS_ARCSEC)
        chance += min(2.0 * allowed / width_arcsec, 1.0) * 2.0 * SAME_WAY_RAD / math.pi
        if turned < SAME_WAY_RAD and off < min(allowed, best[1]):
            best = (body.name, off)
    return (*best, min(chance, 1.0)) if best[0] else ("", float("nan"), float("nan"))


def _flashes(light: Floats) -> bool:
    """Whether light along a streak comes in even flashes, as of a strobe."""
    usual = float(np.median(light))
    bright = light > FLASH * max(usual, 1e-9)
    firsts = np.flatnonzero(bright & ~np.concatenate([[False], bright[:-1]]))
    if len(firsts) < FLASHES or bright.mean() > 0.5:
        return False
    gaps = np.diff(firsts)
    return bool(np.std(gaps) < EVEN * np.mean(gaps) + 0.5)


def _fades(light: Floats) -> bool:
    """Whether it is faint at both ends and bright between, without stars that lie on it."""
    smooth = np.array([np.median(light[max(k - 2, 0) : k + 3]) for k in range(len(light))])
    end = max(round(0.08 * len(light)), 1)
    ends = max(float(np.mean(smooth[:end])), float(np.mean(smooth[-end:])))
    return ends < FADED * float(np.percentile(smooth, 95))


def not_repeated(
    frames: Sequence[tuple[Crossing, ...]],
    width: float,
    times: Sequence[datetime | None] = (),
    exposures_s: Sequence[float | None] = (),
) -> list[tuple[Crossing, ...]]:
    """The crossings of frames without what lies on one line in several: of the sensor, of the sky or over the ground.

    A flaw of the sensor and what is in front of a camera that stands; a galaxy on its edge; a mast, a cable or a roof
    that a tracking camera turns past. Satellites are in one frame, or go on in the next elsewhere; what the elements
    name stays, and so does what stands over the equator, a star's trail in each frame.

    Parameters
    ----------
    frames : sequence of tuple
        Of each frame its crossings.
    width : float
        Of a frame, px.
    times : sequence of datetime or None
        Mid-exposure of each frame; without them nothing is compared over the ground.
    exposures_s : sequence of float or None
        Of each frame.
    """
    times, exposures_s = times or [None] * len(frames), exposures_s or [None] * len(frames)
    whose = [(k, one) for k, crossings in enumerate(frames) for one in crossings]
    first = next((time for time in times if time), None)
    again = np.zeros(len(whose), dtype=np.bool_)
    if len(whose) < 2:
        return list(frames)
    of_frame = np.array([k for k, _ in whose])
    on_sensor = np.array([_as_directions(one.ends_px, width) for _, one in whose])
    on_sky = np.array([[unit_vectors(*end) for end in one.ends_deg] for _, one in whose])
    seconds = [(time - first).total_seconds() if time and first else math.nan for time in times]
    turned_rad = SIDEREAL_RAD_S * np.array(seconds)[of_frame]
    turned_rad[[_stands_over_equator(one, exposures_s[k]) for k, one in whose]] = math.nan
    over_ground = _turned(on_sky, turned_rad)
    lengths_px = np.array([np.hypot(*np.subtract(*one.ends_px)) for _, one in whose])
    lengths_rad = np.radians([one.length_deg for _, one in whose])
    beside_rad = BESIDE_WIDTH * width * lengths_rad / np.maximum(lengths_px, 1.0)
    for ends, beside in (
        (on_sensor, np.full(len(whose), BESIDE_WIDTH / FAR_WIDTHS)),
        (on_sky, beside_rad),
        (over_ground, beside_rad),
    ):
        again |= (_on_one_line(ends, beside) & (of_frame[:, None] != of_frame)).any(axis=1)
    return [
        tuple(one for (of, one), twice in zip(whose, again, strict=True) if of == k and (one.name or not twice))
        for k in range(len(frames))
    ]


def _as_directions(ends_px: tuple[tuple[float, float], tuple[float, float]], width: float) -> Floats:
    """Ends (2, 2) px as unit vectors (2, 3) from so far that the sensor's lines are great circles of equal measure."""
    vectors = np.concatenate([np.asarray(ends_px) / (FAR_WIDTHS * width), np.ones((2, 1))], axis=1)
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def _stands_over_equator(one: Crossing, exposure_s: float | None) -> bool:
    """Whether a streak is what a light that turns with the Earth leaves beside stars that are followed."""
    (ra, dec), (other_ra, other_dec) = one.ends_deg
    if not exposure_s or not one.whole or abs(dec) > GEOSTATIONARY_DEG:
        return False
    along = abs((other_ra - ra + 180.0) % 360.0 - 180.0) * math.cos(math.radians(dec))
    return abs(along / (SIDEREAL_DEG_S * exposure_s) - 1.0) < 0.2 and abs(other_dec - dec) < 0.1 * along


def _turned(vectors: Floats, angle_rad: Floats) -> Floats:
    """Vectors (N, 2, 3) turned about the pole, westwards, by angles (N,)."""
    sine, cosine = np.sin(angle_rad)[:, None], np.cos(angle_rad)[:, None]
    x, y, z = np.moveaxis(vectors, 2, 0)
    return np.stack([x * cosine + y * sine, y * cosine - x * sine, z + 0.0 * sine], axis=2)


def _on_one_line(ends: Floats, beside_rad: Floats) -> Bools:
    """Which (N, N) of great circles' stretches lie upon another: within ``beside_rad`` (N,), half the shorter over it.

    ``ends`` (N, 2, 3) are unit vectors; NaN lies on nothing.
    """
    begin, end = ends[:, 0], ends[:, 1]
    pole = cross_product(begin, end)
    with np.errstate(invalid="ignore", divide="ignore"):
        pole = pole / np.linalg.norm(pole, axis=1, keepdims=True)
    off = np.maximum(np.abs(pole @ begin.T), np.abs(pole @ end.T))  # row: whose circle; column: whose ends
    along = cross_product(pole, begin)
    length = np.arctan2((along * end).sum(axis=1), (begin * end).sum(axis=1))
    places = [np.arctan2(along @ other.T, begin @ other.T) for other in (begin, end)]
    low, high = np.minimum(*places), np.maximum(*places)
    over = np.minimum(high, length[:, None]) - np.maximum(low, 0.0)
    return np.asarray((off < beside_rad[:, None]) & (over > 0.5 * np.minimum(length[:, None], high - low)))
