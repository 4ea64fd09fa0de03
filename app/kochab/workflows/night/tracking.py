"""What the pointing did between frames: drift in RA and Dec with its uncertainty, wander about it, and jumps.

The places are those of solved frames, so that the mount's own word is not asked. A straight line is fitted to each
stretch without jumps; its uncertainty is that of the scatter about it, widened where neighbours err alike (a periodic
error seen for less than some turns looks like drift) and for few frames.

A jump is a dither where others are as large: programs dither often, by some pixels, in any direction. What stands alone
and is large is none: a clutch that slipped, a knock, or somebody who centred again.
"""

import math
from collections.abc import Sequence
from datetime import datetime
from enum import StrEnum

import numpy as np

from kochab.core.arrays import Bools, Floats
from kochab.core.attitude import wrapped
from kochab.core.mount import SIDEREAL_DEG_S, SIDEREAL_RAD_S
from kochab.core.robust import mad_sigma
from kochab.core.values import frozen
from kochab.polar.error import angle_in_words
from kochab.text.translation import tr
from kochab.workflows.night.backlash import dec_backlash
from kochab.workflows.night.measure import Measure, slope
from kochab.workflows.night.periodic import FEWEST as FEWEST_FOR_A_WORM
from kochab.workflows.night.periodic import Periodic, periodic_error

FEWEST = 4
"""Frames of a stretch from which a drift is told."""
ANOTHER_FIELD = 0.2
"""Share of the frame's width beyond which the next frame shows another field."""
LONGEST_GAP_S = 6 * 3600.0
DITHER = 6.0
"""Times the usual step beyond which a step is a jump."""
SPLIT, PASSES = 4.0, 6
"""The same while a worm is looked for: a step too much taken for a jump costs it little, one too few spoils it."""
LONE = 0.015
"""Share of the frame's width, 60 px of 4000: no jump below it is told as a knock, as programs dither by less."""
AS_DITHERS, OF_DITHERS = 3, 4.0
"""Jumps from which on they are dithers, and times their median up to which: in a square the farthest are 2.8 apart."""
TURNED_DEG, FLIPPED_DEG = 10.0, 170.0
"""By which a camera is turned on purpose, and by which a German mount has changed sides."""
POLAR_ARCSEC = 600.0
"""One sigma of a polar axis that nobody measured."""
SIDEREAL_ARCSEC_S = 3600.0 * SIDEREAL_DEG_S
SURELY = 3.0
"""Sigmas by which a field that was not tracked drifts faster than half the sky, and no faster than half more."""
FLOOR_ARCSEC = 0.5
"""No jump is known better: refraction and the drift of the middle of the frame differ from place to place."""
ALONG = 0.15
"""Share of the other axis up to which a jump is one of RA or of Dec alone."""


@frozen
class Place:
    """Where the middle of a frame pointed, ICRS degrees, when, and the frame's width and roll, degrees.

    ``axis_arcsec`` is how far the RA axis has fallen behind the stars, of its own angle, refraction taken out; NaN
    where site or time are unknown. ``exposure_s`` is how long it was exposed; ``reported_deg`` where the header has the
    mount, None without.
    """

    time_utc: datetime
    ra_deg: float
    dec_deg: float
    width_deg: float
    roll_deg: float = 0.0
    axis_arcsec: float = math.nan
    exposure_s: float = 0.0
    reported_deg: tuple[float, float] | None = None


class JumpKind(StrEnum):
    """What a jump of the pointing was."""

    DITHER = "dither"
    KNOCK = "jump"
    FLIP = "flip"
    TURNED = "turned"


@frozen
class Jump:
    """Between the frames ``before`` and ``after``, indices into the places; ways on the sky in RA and Dec."""

    kind: JumpKind
    before: int
    after: int
    time_utc: datetime
    ra_arcsec: Measure
    dec_arcsec: Measure

    @property
    def size(self) -> Measure:
        """How far, arcsec."""
        far = math.hypot(self.ra_arcsec.value, self.dec_arcsec.value)
        return Measure(far, max(self.ra_arcsec.sigma, self.dec_arcsec.sigma))

    @property
    def axis(self) -> str:
        """The one axis that moved, RA or Dec; empty for both."""
        ra, dec = abs(self.ra_arcsec.value), abs(self.dec_arcsec.value)
        if dec < max(ALONG * ra, 3.0 * self.dec_arcsec.sigma):
            return tr("RA")
        return tr("Dec") if ra < max(ALONG * dec, 3.0 * self.ra_arcsec.sigma) else ""

    @property
    def words(self) -> str:
        """What happened, in a sentence."""
        if self.kind is JumpKind.FLIP:
            return tr("Meridian flip.")
        if self.kind is JumpKind.TURNED:
            return tr("The camera was turned.")
        far, off = (angle_in_words(one) for one in (self.size.value, self.size.sigma))
        if axis := self.axis:
            text = tr("The field jumped {far} ± {off} in {axis}: a slipped clutch, a knock, or a new centring.",
                      far=far, off=off, axis=axis)  # fmt: skip
            return text
        return tr("The field jumped {far} ± {off}: a knock, a slipped clutch, or a new centring.", far=far, off=off)


@frozen
class Tracking:
    """Of one field: drift a second on the sky in arcsec an hour (RA as an arc), wander about it in arcsec RMS.

    ``frames`` are indices into the places; ``jumps`` are its steps across which nothing is taken. ``periodic`` is the
    error of the worm, taken out of the rest; ``rate_arcsec_s`` the rate of the RA axis, with what a polar axis that is
    off makes of it; None where refraction is unknown. ``backlash_arcsec`` is Dec's, or a sentence why it is unknown.
    """

    frames: tuple[int, ...]
    hours: float
    ra_arcsec_h: Measure
    dec_arcsec_h: Measure
    wander_arcsec: tuple[Measure, Measure]
    jumps: tuple[Jump, ...]
    dec_deg: float
    periodic: Periodic | None = None
    rate_arcsec_s: Measure | None = None
    backlash_arcsec: Measure | str = ""

    @property
    def dithers(self) -> int:
        """How many of its jumps were dithers."""
        return sum(jump.kind is JumpKind.DITHER for jump in self.jumps)

    @property
    def knocks(self) -> tuple[Jump, ...]:
        """Jumps that nobody ordered, as far as the frames tell."""
        return tuple(jump for jump in self.jumps if jump.kind is JumpKind.KNOCK)

    @property
    def drifts(self) -> tuple[Measure | None, Measure | None]:
        """Drift in RA and Dec, None where the frames tell less than what mounts do anyway: they are too few."""
        usual = 3600.0 * SIDEREAL_RAD_S * POLAR_ARCSEC  # of a polar axis that nobody measured
        ra, dec = ((one if one.tells(usual) else None) for one in (self.ra_arcsec_h, self.dec_arcsec_h))
        return ra, dec

    @property
    def rate(self) -> Measure | None:
        """The rate of the RA axis, arcsec/s, None where it is unknown or as unsure as the drift may be."""
        if self.rate_arcsec_s is None:
            return None
        off = Measure(self.rate_arcsec_s.value - SIDEREAL_ARCSEC_S, self.rate_arcsec_s.sigma)
        return self.rate_arcsec_s if off.tells(SIDEREAL_RAD_S * POLAR_ARCSEC) else None

    @property
    def untracked(self) -> bool:
        """Whether the field moved as the sky does: a fixed tripod, or a motor that is off."""
        whole = 3600.0 * SIDEREAL_ARCSEC_S * math.cos(math.radians(self.dec_deg))
        unsure = SURELY * self.ra_arcsec_h.sigma
        return self.ra_arcsec_h.value - unsure > 0.5 * whole > abs(self.ra_arcsec_h.value - whole) - unsure


def tracking_of(places: Sequence[Place], polar_arcsec: float = POLAR_ARCSEC) -> list[Tracking]:
    """The drift of every field that was held for `FEWEST` frames or more, in order of time.

    ``polar_arcsec`` is how far the polar axis may be off its pole, one sigma.
    """
    order = sorted(range(len(places)), key=lambda k: places[k].time_utc)
    fields: list[list[int]] = []
    for k in order:
        if fields and _goes_on(places[fields[-1][-1]], places[k]):
            fields[-1].append(k)
        else:
            fields.append([k])
    long = [field for field in fields if len(field) >= FEWEST]
    found = [_held([places[k] for k in field], tuple(field), polar_arcsec) for field in long]
    return [one for one in found if one is not None]


def _goes_on(before: Place, after: Place) -> bool:
    """Whether a frame is of the same field and night as the one before."""
    waited_s = (after.time_utc - before.time_utc).total_seconds()
    return waited_s < LONGEST_GAP_S and _apart_deg(before, after) < ANOTHER_FIELD * after.width_deg


def _apart_deg(one: Place, other: Place) -> float:
    east = wrapped(other.ra_deg - one.ra_deg) * math.cos(math.radians(one.dec_deg))
    return math.hypot(east, other.dec_deg - one.dec_deg)


def _held(places: list[Place], frames: tuple[int, ...], polar_arcsec: float) -> Tracking | None:
    first = places[0]
    hours = np.array([(p.time_utc - first.time_utc).total_seconds() / 3600.0 for p in places])
    ra = np.array([wrapped(p.ra_deg - first.ra_deg) for p in places])
    dec = np.array([p.dec_deg for p in places])
    cosine = math.cos(math.radians(first.dec_deg))
    xy = 3600.0 * np.stack([ra * cosine, dec - first.dec_deg])
    axis = np.array([p.axis_arcsec for p in places])
    seen = bool(np.isfinite(axis).all())
    if not seen:
        axis = 3600.0 * ra
    if hours[-1] <= 0.0:
        return None
    exposure_s = float(np.median([p.exposure_s for p in places]))
    beside, jump = _steps(xy, hours)
    worm = _worm(xy, axis, hours, cosine, exposure_s)
    if worm is not None:  # without it smaller jumps stand out, and those told are surer
        xy[0] -= worm.error * cosine
        beside, jump = _steps(xy, hours)
    group = np.concatenate([[0], np.cumsum(jump)])
    if len(places) - int(group[-1]) - 2 < 1:
        return None
    fits = [slope(hours, along, group) for along in xy]
    if fits[0] is None or fits[1] is None:
        return None
    (ra_drift, ra_rms), (dec_drift, dec_rms) = fits[0], fits[1]
    if worm is not None:
        ra_drift = Measure(ra_drift.value, max(ra_drift.sigma, worm.rate.sigma * abs(cosine)))
    jumps = _jumps(places, frames, beside, jump.nonzero()[0].tolist(), (ra_rms.value, dec_rms.value))
    lag = worm.rate if worm else (slope(hours, axis, group) or (None,))[0]
    rate = None
    if seen and lag is not None:
        off = math.radians(polar_arcsec / 3600.0) * abs(math.tan(math.radians(first.dec_deg)))
        rate = Measure(SIDEREAL_ARCSEC_S - lag.value / 3600.0, math.hypot(lag.sigma / 3600.0, SIDEREAL_ARCSEC_S * off))
    play = _backlash(places, frames, hours, jumps)
    wander = ra_rms, dec_rms
    return Tracking(frames, float(hours[-1]), ra_drift, dec_drift, wander, jumps, first.dec_deg, worm, rate, play)


def _backlash(places: list[Place], frames: tuple[int, ...], hours: Floats, jumps: tuple[Jump, ...]) -> Measure | str:
    """Of Dec; the motor knows of dithers, and nothing of knocks and of a camera that was turned.

    Parameters
    ----------
    places : list of Place
        Of the field.
    frames : tuple of int
        Their indices.
    hours : Floats
        When (N,).
    jumps : tuple of Jump
        Of the field.
    """
    unknown = {jump.after for jump in jumps if jump.kind is not JumpKind.DITHER}
    level = np.cumsum([frame in unknown for frame in frames]).astype(np.float64)
    reported = np.array([p.reported_deg or (math.nan, math.nan) for p in places])
    dec = np.array([p.dec_deg for p in places])
    off_ra = np.array([wrapped(p.ra_deg - ra) for p, (ra, _) in zip(places, reported, strict=True)])
    off_ra *= math.cos(math.radians(places[0].dec_deg))
    return dec_backlash(3600.0 * hours, 3600.0 * dec, 3600.0 * reported[:, 1], level, 3600.0 * off_ra)


def _worm(xy: Floats, axis: Floats, hours: Floats, cosine: float, exposure_s: float) -> Periodic | None:
    """The periodic error, found together with the jumps that it hides; None where there is none to tell.

    Parameters
    ----------
    xy : Floats
        Places (2, N) in RA and Dec on the sky, arcsec.
    axis : Floats
        Of the RA axis (N,), arcsec of its own angle.
    hours : Floats
        When (N,).
    cosine : float
        Of the declination.
    exposure_s : float
        How long each was exposed.
    """
    error, before = np.zeros(len(hours)), None
    for _ in range(PASSES):
        left = np.stack([xy[0] - error * cosine, xy[1]])
        group = np.concatenate([[0], np.cumsum(_steps(left, hours, SPLIT)[1])])
        if before is not None and (group == before).all():
            break
        worm = periodic_error(3600.0 * hours, axis, group, exposure_s, sure=False)
        if worm is None:
            return None
        error, before = worm.error, group
    return periodic_error(3600.0 * hours, axis, group, exposure_s)


def _steps(xy: Floats, hours: Floats, times: float = DITHER) -> tuple[Floats, Bools]:
    """Ways (2, N - 1) from place to place beside the drift, arcsec, and which are jumps: ``times`` the usual."""
    # Frames may be missing, so a step is judged by the drift over its own time.
    steps, took = np.diff(xy, axis=1), np.maximum(np.diff(hours), 1e-9)
    off_drift = steps - np.median(steps / took, axis=1, keepdims=True) * took
    off = np.hypot(*off_drift)
    jump = off > times * max(mad_sigma(off, 0.0), 1e-6)
    if len(hours) >= FEWEST_FOR_A_WORM:  # each axis by its own scatter: the worm moves one of them, dithers both
        for way in off_drift:
            jump |= np.abs(way) > times * max(mad_sigma(way, 0.0), 1e-6)
    return off_drift, np.asarray(jump)


def _jumps(
    places: list[Place], frames: tuple[int, ...], steps: Floats, at: list[int], wander: tuple[float, float]
) -> tuple[Jump, ...]:
    """What each jump was.

    Parameters
    ----------
    places : list of Place
        Of the field.
    frames : tuple of int
        Their indices.
    steps : Floats
        Ways (2, N - 1) in RA and Dec beside the drift, arcsec.
    at : list of int
        Which of them are jumps.
    wander : tuple of float
        Scatter of a frame in RA and Dec, arcsec.
    """
    size = np.hypot(*steps)
    found: list[Jump] = []
    for k in at:
        one, other = places[k], places[k + 1]
        turned = abs(wrapped(other.roll_deg - one.roll_deg))
        others = [size[j] for j in at if j != k]
        largest = OF_DITHERS * float(np.median(others)) if len(others) >= AS_DITHERS else 0.0
        if turned > TURNED_DEG:
            kind = JumpKind.FLIP if turned > FLIPPED_DEG else JumpKind.TURNED
        elif size[k] > max(LONE * 3600.0 * one.width_deg, largest):
            kind = JumpKind.KNOCK
        else:
            kind = JumpKind.DITHER
        # of two frames, each with the scatter of its place
        ra, dec = (
            Measure(float(way), math.hypot(math.sqrt(2.0) * rms, FLOOR_ARCSEC))
            for way, rms in zip(steps[:, k], wander, strict=True)
        )
        found.append(Jump(kind, frames[k], frames[k + 1], other.time_utc, ra, dec))
    return tuple(_joined(found))


def _joined(jumps: list[Jump]) -> list[Jump]:
    """Two knocks in a row are one that a frame was exposed through."""
    found: list[Jump] = []
    for jump in jumps:
        last = found[-1] if found else None
        if last and last.kind is jump.kind is JumpKind.KNOCK and last.after == jump.before:
            ra, dec = (
                Measure(one.value + other.value, max(one.sigma, other.sigma))
                for one, other in ((last.ra_arcsec, jump.ra_arcsec), (last.dec_arcsec, jump.dec_arcsec))
            )
            found[-1] = Jump(JumpKind.KNOCK, last.before, jump.after, last.time_utc, ra, dec)
        else:
            found.append(jump)
    return found
