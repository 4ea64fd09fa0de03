"""What stood among the stars and is none: bodies of the Solar System by their elements, and what no catalogue has.

A bright detection without a star in one frame may be a cosmic ray or a glint. It is told when it returns: at the same
place in frame after frame, a new star; on a straight way at an even pace, a body that is in none of the elements.
"""

import math
from collections.abc import Sequence
from datetime import datetime
from enum import StrEnum
from itertools import combinations

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import radec_deg, unit_vectors, wrapped
from kochab.core.frame import Detections, Site
from kochab.core.progress import Task
from kochab.core.robust import median
from kochab.core.solution import Solution
from kochab.core.values import frozen
from kochab.sky import open_catalogue
from kochab.sky.frame_bodies import BodyInFrame, bodies_in_frame
from kochab.sky.solar_system import BodyKind, Moving
from kochab.text.translation import tr_noop
from kochab.workflows.night.measure import Measure

FEWEST_FRAMES, SHARE = 4, 0.5
"""Frames in which it has to be, and share of those that show its place."""
REACH_SIGMAS = 4.0
"""How near to its place a detection counts."""
FASTEST_ARCSEC_H = 3600.0
"""Faster ones leave a trail."""
STILL_SIGMAS = 5.0
"""Of its rate, below which it stands still."""
SURE_CHANCE = -6.0
"""Logarithm of the chance above which nothing is told."""
MOST = 150
"""Detections of a night that are linked; more of them are a field that does not fit."""
SEEN_SHARE = 0.3
"""Of the frames that show a body's place, in which it has to be seen."""
FIXED_PX = 1.5
"""What moves less over the sensor while the field moves more is of the sensor."""


class StrangerKind(StrEnum):
    """What it is taken for."""

    BODY = tr_noop("body of the Solar System")
    NEW_STAR = tr_noop("not in any catalogue")
    UNKNOWN_BODY = tr_noop("moves, not in any catalogue")


@frozen
class Sight:
    """One of them in one frame: ICRS degrees as measured, px, magnitude about V, and their sigmas.

    ``name`` and ``kind`` are those of a body whose place is here by its elements, ``off_arcsec`` (east, north) measured
    less predicted; else they are empty.
    """

    x: float
    y: float
    ra_deg: float
    dec_deg: float
    sigma_arcsec: float
    mag: float
    sigma_mag: float
    name: str = ""
    kind: str = ""
    off_arcsec: tuple[float, float] = (float("nan"), float("nan"))


@frozen(eq=False)
class Sights:
    """Of one frame: ``bodies`` seen, the names of those that should be ``there``, and detections without a star."""

    bodies: tuple[Sight, ...]
    there: tuple[str, ...]
    unknown: tuple[Sight, ...]


@frozen
class Stranger:
    """One thing over the night; ``frames`` are indices of those that show it, ``sights`` the same in order.

    Place ICRS degrees at the first of them with its sigma, rates on the sky in arcsec an hour, magnitude about V.
    ``off_arcsec`` is how far a body is from its elements' place; ``log10_chance`` how likely chance makes the rest.
    """

    kind: StrangerKind
    name: str
    frames: tuple[int, ...]
    sights: tuple[Sight, ...]
    sigma_arcsec: float
    rate_arcsec_h: tuple[Measure, Measure]
    mag: Measure
    off_arcsec: Measure | None
    log10_chance: float


def sights_of(
    solution: Solution,
    detections: Detections,
    time_utc: datetime | None,
    site: Site | None,
    more: Sequence[Moving] = (),
) -> Task[Sights]:
    """The bodies of a frame, and its bright detections that are in no catalogue.

    Parameters
    ----------
    solution : Solution
        Where it points.
    detections : Detections
        Of the frame.
    time_utc : datetime or None
        Mid-exposure; None where nobody knows.
    site : Site or None
        Where it was taken.
    more : sequence of Moving
        Bodies whose elements people gave; satellites are left to their streaks.
    """
    found = yield from bodies_in_frame(solution, detections, time_utc, site, open_catalogue(), more)
    zero = Measure(*found.zero_point)
    bodies = [one for one in found.bodies if one.body.kind in (BodyKind.ASTEROID, BodyKind.COMET, BodyKind.DWARF)]
    seen = [_seen(one, solution, detections, zero) for one in bodies if one.seen]
    unknown = tuple(
        Sight(one.x, one.y, one.ra_deg, one.dec_deg, one.sigma_arcsec, one.mag, one.sigma_mag) for one in found.unknown
    )
    return Sights(tuple(one for one in seen if one), tuple(one.body.name for one in bodies), unknown)


def _seen(one: BodyInFrame, solution: Solution, detections: Detections, zero: Measure) -> Sight | None:
    """A body at the detection nearest to its place."""
    apart = np.hypot(*(detections.xy - (one.x, one.y)).T)
    k = int(np.argmin(apart))
    vector = solution.sky_at(detections.xy[k : k + 1])[0]
    ra, dec = radec_deg(vector)
    snr = float(detections.snr[k])
    # a centroid is as good as the star image's width over its signal to noise
    own_px = float(np.nan_to_num(detections.fwhm_px[k], nan=3.0)) / 2.35 / max(snr, 1.0)
    sigma = math.hypot(own_px, 0.05) * solution.camera.scale_arcsec_px
    sigma = math.hypot(sigma, solution.rms_arcsec / math.sqrt(max(len(solution.stars), 1)))
    east = wrapped(ra - one.body.ra_deg) * math.cos(math.radians(dec)) * 3600.0
    off = (east, (dec - one.body.dec_deg) * 3600.0)
    mag = zero.value - 2.5 * math.log10(max(float(detections.flux[k]), 1e-12))
    x, y = detections.xy[k].tolist()
    sigma_mag = math.hypot(zero.sigma, 1.0857 / max(snr, 1.0))
    return Sight(x, y, ra, dec, sigma, mag, sigma_mag, one.body.name, str(one.body.kind), off)


# -- Over the night --------------------------------------------------------------------------------


def strangers_of(sights: Sequence[Sights | None], times: Sequence[datetime | None]) -> tuple[Stranger, ...]:
    """What the night's frames show together, bodies first.

    Parameters
    ----------
    sights : sequence of Sights or None
        Of each frame; None for those without a solution.
    times : sequence of datetime or None
        When each was taken.
    """
    bodies = [one for one in (_body(name, sights, times) for name in _names(sights)) if one]
    return (*bodies, *_linked(sights, times))


def _names(sights: Sequence[Sights | None]) -> list[str]:
    return list(dict.fromkeys(one.name for frame in sights if frame for one in frame.bodies))


def _body(name: str, sights: Sequence[Sights | None], times: Sequence[datetime | None]) -> Stranger | None:
    """A body that enough of the frames show where it should be."""
    there = [k for k, frame in enumerate(sights) if frame and name in frame.there]
    at = [(k, one) for k in there for one in (sights[k] or Sights((), (), ())).bodies if one.name == name]
    if len(at) < max(2, SEEN_SHARE * len(there)):
        return None
    frames, seen = [k for k, _ in at], [one for _, one in at]
    off = np.array([one.off_arcsec for one in seen])
    mean = np.median(off, axis=0)
    sigma = math.hypot(float(np.mean([one.sigma_arcsec for one in seen])), float(off.std())) / math.sqrt(len(seen))
    rate = _rates([times[k] for k in frames], seen)
    return Stranger(
        StrangerKind.BODY,
        name,
        tuple(frames),
        tuple(seen),
        seen[0].sigma_arcsec,
        rate,
        _mean_mag(seen),
        Measure(float(np.hypot(*mean)), sigma),
        -math.inf,
    )


def _mean_mag(seen: Sequence[Sight]) -> Measure:
    mags = np.array([one.mag for one in seen])
    own = float(np.mean([one.sigma_mag for one in seen]))
    # the stars' colours err alike in all frames
    return Measure(median(mags), own)


def _hours(times: Sequence[datetime | None]) -> Floats:
    first = next(time for time in times if time)
    return np.array([(time - first).total_seconds() / 3600.0 if time else math.nan for time in times])


def _plane(seen: Sequence[Sight]) -> Floats:
    """Places (N, 2), arcsec east and north of the first."""
    first = seen[0]
    ra = np.array([wrapped(one.ra_deg - first.ra_deg) for one in seen])
    dec = np.array([one.dec_deg for one in seen])
    return 3600.0 * np.stack([ra * math.cos(math.radians(first.dec_deg)), dec - first.dec_deg], axis=1)


def _rates(times: Sequence[datetime | None], seen: Sequence[Sight]) -> tuple[Measure, Measure]:
    """East and north, arcsec an hour."""
    if len(seen) < 3 or any(time is None for time in times):
        return Measure(math.nan, math.inf), Measure(math.nan, math.inf)
    hours = _hours(times)
    centred = hours - hours.mean()
    spread = float(centred @ centred)
    if not spread > 0.0:
        return Measure(math.nan, math.inf), Measure(math.nan, math.inf)
    own = float(np.mean([one.sigma_arcsec for one in seen]))
    found: list[Measure] = []
    for along in _plane(seen).T:
        slope = float(centred @ along) / spread
        left = along - along.mean() - slope * centred
        rms = math.sqrt(float(left @ left) / max(len(seen) - 2, 1))
        found.append(Measure(slope, max(rms, own) / math.sqrt(spread)))
    return found[0], found[1]


def _linked(sights: Sequence[Sights | None], times: Sequence[datetime | None]) -> list[Stranger]:
    """Detections without a star that are one thing in several frames: it stands still, or moves evenly."""
    named = [
        (k, one)
        for k, frame in enumerate(sights)
        if frame and times[k]
        for one in frame.unknown
        if not any(math.hypot(one.x - body.x, one.y - body.y) < 3.0 for body in frame.bodies)
    ]
    if not FEWEST_FRAMES <= len(named) <= 4 * MOST:
        return []
    counts = np.bincount([k for k, _ in named], minlength=len(sights))
    if counts.max() > MOST:
        return []
    solved = [k for k, frame in enumerate(sights) if frame and times[k]]
    hours = dict(zip(solved, _hours([times[k] for k in solved]).tolist(), strict=True))
    left, found = list(named), list[Stranger]()
    while True:
        best = _longest_track(left, hours)
        if best is None:
            return found
        stranger = _stranger(best, left, hours, [times[k] for k, _ in best], solved)
        if stranger is not None:
            found.append(stranger)
        left = [one for one in left if not any(one is other for other in best)]


Track = list[tuple[int, Sight]]


def _longest_track(left: Track, hours: dict[int, float]) -> Track | None:
    """The most detections, one a frame, on one straight way; None for fewer than `FEWEST_FRAMES`."""
    if len(left) < FEWEST_FRAMES:
        return None
    xyz = np.array([unit_vectors(one.ra_deg, one.dec_deg) for _, one in left])
    at = np.array([hours[k] for k, _ in left])
    frame = np.array([k for k, _ in left])
    reach = np.array([_reach_arcsec(one) for _, one in left])
    best: list[int] = []
    # the ends of a way are tried among few: the first and the last detections
    pairs = [(i, j) for i, j in combinations(range(len(left)), 2) if frame[i] != frame[j]]
    pairs = sorted(pairs, key=lambda pair: at[pair[0]] - at[pair[1]])[:4000]
    for i, j in pairs:
        span = at[j] - at[i]
        way = xyz[j] - xyz[i]
        if not span > 0.0 or np.degrees(np.linalg.norm(way)) * 3600.0 / span > FASTEST_ARCSEC_H:
            continue
        predicted = xyz[i] + ((at - at[i]) / span)[:, None] * way
        off = np.degrees(np.linalg.norm(xyz - predicted, axis=1)) * 3600.0
        on = np.flatnonzero(off < reach)
        chosen = [int(min(on[frame[on] == k], key=lambda row: off[row])) for k in np.unique(frame[on])]
        if len(chosen) > len(best):
            best = chosen
    return [left[row] for row in best] if len(best) >= FEWEST_FRAMES else None


def _reach_arcsec(one: Sight) -> float:
    return REACH_SIGMAS * one.sigma_arcsec


def _stranger(
    track: Track, left: Track, hours: dict[int, float], times: Sequence[datetime | None], solved: Sequence[int]
) -> Stranger | None:
    """What a track is; None where chance, the sensor or too few frames explain it.

    Parameters
    ----------
    track : Track
        Its frames and places.
    left : Track
        All detections that it was found among.
    hours : dict
        When each frame was taken.
    times : sequence of datetime or None
        When each of the track was.
    solved : sequence of int
        The frames that could show it.
    """
    frames, seen = [k for k, _ in track], [one for _, one in track]
    between = [k for k in solved if hours[frames[0]] <= hours[k] <= hours[frames[-1]]]
    if len(frames) < max(FEWEST_FRAMES, SHARE * len(between)) or len(between) < SHARE * min(len(solved), 8):
        return None
    rate = _rates(times, seen)
    moved_px = math.hypot(float(np.ptp([one.x for one in seen])), float(np.ptp([one.y for one in seen])))
    plane = _plane(seen)
    moved_arcsec = float(np.hypot(*np.ptp(plane, axis=0)))
    fast = math.hypot(rate[0].value, rate[1].value)
    moves = fast > STILL_SIGMAS * math.hypot(rate[0].sigma, rate[1].sigma)
    if moves and moved_px < FIXED_PX and moved_arcsec > 3.0 * max(_reach_arcsec(one) for one in seen):
        return None
    chance = _log10_chance(track, left, len(solved))
    if chance > SURE_CHANCE:
        return None
    kind = StrangerKind.UNKNOWN_BODY if moves else StrangerKind.NEW_STAR
    sigma = seen[0].sigma_arcsec
    return Stranger(kind, "", tuple(frames), tuple(seen), sigma, rate, _mean_mag(seen), None, chance)


def _log10_chance(track: Track, left: Track, frames: int) -> float:
    """How many such tracks detections that fall anywhere would make, as a logarithm."""
    width = max(np.ptp([one.x for _, one in left]), np.ptp([one.y for _, one in left]), 100.0)
    arcsec = max(_reach_arcsec(one) for _, one in track)
    scale = max(one.sigma_arcsec for _, one in track) / 0.3  # arcsec a pixel, about: a place is a third of one
    share = min(math.pi * (arcsec / scale) ** 2 / width**2, 1.0)
    a_frame = max(len(left) / max(frames, 1), 1.0)
    # two of them make a way, each further one has to fall on it
    return 2.0 * math.log10(max(len(left), 2)) + (len(track) - 2) * math.log10(min(a_frame * share, 1.0))
