"""What the pointing did between frames: drift in RA and Dec with its uncertainty, wander about it, and jumps.

The places are those of solved frames, so that the mount's own word is not asked. A straight line is fitted to each
stretch without jumps; its uncertainty is that of the scatter about it, widened where neighbours err alike (a periodic
error seen for less than some turns looks like drift) and for few frames.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np

from kochab.core.robust import mad_sigma
from kochab.workflows.night.measure import Measure, slope

FEWEST = 4
"""Frames of a stretch from which a drift is told."""
ANOTHER_FIELD = 0.2
"""Share of the frame's width beyond which the next frame shows another field."""
LONGEST_GAP_S = 6 * 3600.0
DITHER = 6.0
"""Times the usual step beyond which a step is a dither or a knock."""
SIDEREAL_ARCSEC_H = 54148.0


@dataclass(frozen=True, slots=True)
class Place:
    """Where the middle of a frame pointed, ICRS degrees, when, and the frame's width, degrees."""

    time_utc: datetime
    ra_deg: float
    dec_deg: float
    width_deg: float


@dataclass(frozen=True, slots=True)
class Tracking:
    """Of one field: drift a second on the sky in arcsec an hour (RA as an arc), wander about it in arcsec RMS.

    ``frames`` are indices into the places; ``dithers`` how many of its steps were jumps, across which nothing is taken.
    """

    frames: tuple[int, ...]
    hours: float
    ra_arcsec_h: Measure
    dec_arcsec_h: Measure
    wander_arcsec: tuple[float, float]
    dithers: int
    dec_deg: float

    @property
    def untracked(self) -> bool:
        """Whether the field moved as the sky does: a fixed tripod, or a motor that is off."""
        return self.ra_arcsec_h.value > 0.5 * SIDEREAL_ARCSEC_H * math.cos(math.radians(self.dec_deg))


def tracking_of(places: Sequence[Place]) -> list[Tracking]:
    """The drift of every field that was held for `FEWEST` frames or more, in order of time."""
    order = sorted(range(len(places)), key=lambda k: places[k].time_utc)
    fields: list[list[int]] = []
    for k in order:
        if fields and _goes_on(places[fields[-1][-1]], places[k]):
            fields[-1].append(k)
        else:
            fields.append([k])
    found = [_held([places[k] for k in field], tuple(field)) for field in fields if len(field) >= FEWEST]
    return [one for one in found if one is not None]


def _goes_on(before: Place, after: Place) -> bool:
    """Whether a frame is of the same field and night as the one before."""
    waited_s = (after.time_utc - before.time_utc).total_seconds()
    return waited_s < LONGEST_GAP_S and _apart_deg(before, after) < ANOTHER_FIELD * after.width_deg


def _apart_deg(one: Place, other: Place) -> float:
    east = ((other.ra_deg - one.ra_deg + 180.0) % 360.0 - 180.0) * math.cos(math.radians(one.dec_deg))
    return math.hypot(east, other.dec_deg - one.dec_deg)


def _held(places: list[Place], frames: tuple[int, ...]) -> Tracking | None:
    first = places[0]
    hours = np.array([(p.time_utc - first.time_utc).total_seconds() / 3600.0 for p in places])
    ra = np.array([(p.ra_deg - first.ra_deg + 180.0) % 360.0 - 180.0 for p in places])
    dec = np.array([p.dec_deg for p in places])
    xy = 3600.0 * np.stack([ra * math.cos(math.radians(first.dec_deg)), dec - first.dec_deg])
    # Frames may be missing, so a step is judged by the drift over its own time.
    steps, took = np.diff(xy, axis=1), np.maximum(np.diff(hours), 1e-9)
    off = np.hypot(*(steps - np.median(steps / took, axis=1, keepdims=True) * took))
    jump = off > DITHER * max(mad_sigma(off, 0.0), 1e-6)
    group = np.concatenate([[0], np.cumsum(jump)])
    if hours[-1] <= 0.0 or len(places) - int(group[-1]) - 2 < 1:
        return None
    fits = [slope(hours, along, group) for along in xy]
    if fits[0] is None or fits[1] is None:
        return None
    (ra_drift, ra_rms), (dec_drift, dec_rms) = fits[0], fits[1]
    return Tracking(frames, float(hours[-1]), ra_drift, dec_drift, (ra_rms, dec_rms), int(group[-1]), first.dec_deg)
