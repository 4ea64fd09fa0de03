"""What crossed the field while a frame was exposed: satellites by their elements, aircraft, meteor candidates.

A streak says little of what made it. It is named where elements that people gave put a satellite on its line; strobes
and lights side by side make an aircraft; light that rises and fades with both ends in the frame makes a meteor
candidate, never more. What is left is told as what it is: in none of the elements.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import radec_deg, unit_vectors
from kochab.core.frame import Detections, Frame, Site
from kochab.core.progress import Task
from kochab.core.solution import Solution
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


class CrossingKind(StrEnum):
    """What a streak is taken for."""

    SATELLITE = tr_noop("satellite")
    UNLISTED = tr_noop("satellite or aircraft")
    AIRCRAFT = tr_noop("aircraft")
    METEOR = tr_noop("meteor candidate")


@dataclass(frozen=True, slots=True)
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


def not_repeated(frames: Sequence[tuple[Crossing, ...]], width: float) -> list[tuple[Crossing, ...]]:
    """The crossings of frames without what is in several of them at one place of the sensor or of the sky.

    A flaw of the sensor, a wire, a galaxy on its edge; satellites are in one frame, or go on in the next elsewhere.

    Parameters
    ----------
    frames : sequence of tuple
        Of each frame its crossings.
    width : float
        Of a frame, px.
    """
    near_px, near_deg = 0.01 * width, 0.01

    def same(one: Crossing, other: Crossing) -> bool:
        px = np.abs(np.subtract(one.ends_px, other.ends_px)).max()
        sky = np.array([unit_vectors(*place) for pair in (one.ends_deg, other.ends_deg) for place in pair])
        # the ends may be given the other way round
        turned_px = np.abs(np.subtract(one.ends_px, other.ends_px[::-1])).max()
        apart = min(
            max(np.linalg.norm(sky[0] - sky[2]), np.linalg.norm(sky[1] - sky[3])),
            max(np.linalg.norm(sky[0] - sky[3]), np.linalg.norm(sky[1] - sky[2])),
        )
        return bool(min(px, turned_px) < near_px or np.degrees(apart) < near_deg)

    kept = []
    for k, crossings in enumerate(frames):
        others = [other for j, more in enumerate(frames) if j != k for other in more]
        kept.append(tuple(one for one in crossings if not any(same(one, other) for other in others)))
    return kept
