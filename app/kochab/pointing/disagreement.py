"""Why the mount and the sky disagree: one model of a mount, and what is likeliest wrong with it.

A cause says which place the mount would report, and which terms of a pointing model it frees: an
offset of both axes, the tilt of the first axis (2), a cone. What each cause leaves is explained by
small terms and by noise of an unknown size. All of that is normal, so that the probability of the
sightings under a cause has a closed form, and the causes are weighed by Bayes' theorem: freer ones
pay for their freedom, and every sighting more counts (MacKay 2003, Information Theory, chapter 28).
A mount that tells its own clock and site is a witness besides.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import field, replace
from datetime import datetime, timedelta
from itertools import product
from math import cos, exp, log, pi, radians, sin

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import Degrees, apart_deg, cross_matrix, radec_deg, unit_vectors, wrapped
from kochab.core.frame import Site
from kochab.core.mount import SIDEREAL_DEG_S, Epoch, PierSide, Pointing, SiteReport
from kochab.core.values import frozen
from kochab.gear.mounts.coordinates import to_mount_epoch
from kochab.sky.horizon import sidereal_deg
from kochab.text.translation import tr, tr_noop

AGREE_ARCSEC = 120.0  # a mount's own rounding, and what mechanics leave
NAMED = 0.8
HEALTHY = 0.5  # weight of nothing but noise
UNKNOWN = 0.3  # weight of "something else"
FAR_DEG = 5.0  # how large offsets without one of these causes usually are
TIGHT_DEG = 2.0 / 60.0

# Priors by size, degrees: each tuple has the standard deviations that are equally likely.
SMALL = (0.5 / 60.0,)
SET_UP = (0.5 / 60.0, 0.2, 0.5)  # a mount set up well, or by hand
BUILT = (0.5 / 60.0, 0.1)  # and how square its tube is
OFFSETS, AXES, CONES = (0.3, 2.0, 10.0, 60.0), (0.3, 1.0, 4.0), (0.2, 0.6)
COMPASS = (2.0, 10.0)  # magnetic declinations, and the iron of a tripod
NOISES = (0.4 / 60.0, 1.0 / 60.0, 2.0 / 60.0, 4.0 / 60.0, 10.0 / 60.0)
RARE_DEG = 4.0 / 60.0  # noise of this size is half as likely as little: few mounts are so loose
ANYWHERE = (60.0,)

LEAST_COMPASS_DEG = 1.5  # an equatorial mount turned by less was polar aligned, only not well
POLAR_AXIS = (
    tr_noop("polar axis"),
    tr_noop("Polar align the mount, then sync it."),
    tr_noop("The polar axis is {axis} from the pole."),
)
"""Name, advice and evidence: an axis that leans anyhow, and one that leans because the mount is turned a little."""


@frozen
class MountSighting:
    """One solved frame, and what the mount said when it was taken.

    ``sky_deg`` is ICRS; ``time_utc`` and ``site`` are the computer's. ``alt_azimuth`` is None where it is not known.
    """

    sky_deg: Degrees
    reported: Pointing
    time_utc: datetime
    site: Site | None = None
    pier_side: PierSide | None = None
    aligned: bool | None = None
    beliefs: SiteReport = field(default_factory=SiteReport)
    alt_azimuth: bool | None = None

    @property
    def expected_deg(self) -> Degrees:
        """What a mount without fault would say, in its own epoch."""
        return to_mount_epoch(*self.sky_deg, self.reported.epoch, self.time_utc)


class Seen:
    """The sightings as arrays (N, 2) of right ascension and declination, degrees.

    ``sidereal`` (N,) is of the site; without one of Greenwich, which only turns every hour angle. ``side`` (N,) is
    1 west of the meridian or on the pier's east side, -1 on the other, 0 when unknown.
    """

    def __init__(self, sightings: Sequence[MountSighting]) -> None:
        self.sightings, self.last = sightings, sightings[-1]
        self.site = self.last.site
        self.expected = np.array([s.expected_deg for s in sightings])
        self.reported = np.array([(s.reported.ra_deg, s.reported.dec_deg) for s in sightings])
        self.sidereal = np.array([sidereal_deg(s.site or Site(0.0, 0.0), s.time_utc) for s in sightings])
        west = np.mod(self.sidereal - self.expected[:, 0], 360.0) < 180.0
        by_hour = np.where(west, 1.0, -1.0) * (self.site is not None)  # no site, no meridian
        by_side: dict[PierSide | None, float] = {PierSide.EAST: 1.0, PierSide.WEST: -1.0}
        self.side = np.array([by_side.get(s.pier_side, h) for s, h in zip(sightings, by_hour, strict=True)])

    @property
    def shift(self) -> Floats:
        """What the mount says too much (N, 2), degrees of right ascension and declination."""
        return np.stack(
            [wrapped(self.reported[:, 0] - self.expected[:, 0]), self.reported[:, 1] - self.expected[:, 1]], axis=1
        )

    def in_axes(self, places: Floats, alt_azimuth: bool) -> Floats:
        """Directions (N, 3) in the mount's axes: x where the second axis is level, y east, z along the first."""
        return np.asarray(unit_vectors(places[:, 0] - self.sidereal, places[:, 1]) @ axes_of(self.site, alt_azimuth))


def axes_of(site: Site | None, alt_azimuth: bool) -> Floats:
    """The mount's axes, columns of (3, 3), in those of hour angle and declination."""
    if not alt_azimuth or site is None:
        return np.eye(3)
    tilt = radians(90.0 - site.latitude_deg)
    c, s = cos(tilt), sin(tilt)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


Say = Callable[[Seen], Floats]


@frozen
class Cause:
    """A hypothesis: what the mount would say (N, 2) if only this were wrong.

    ``weight`` is how often that happens before anything is known, times what the mount's own clock and site say of
    it. ``offset``, ``axis`` and ``cone`` are the priors of the terms, ``noise`` those of what is left; ``second`` is
    that of the second axis' offset where it is not the first one's.
    Where the terms are the cause itself, ``fitted``, they count as explained, and ``evidence`` has fields for them.
    ``reverses``: the second axis' offset is one of its own angle, and of declination the other way where the tube is on
    the other side of the pier; else one of declination.
    With fewer sightings than it ``needs`` it weighs, and is not named. ``small``: name, advice and evidence of a turn
    about the vertical by less than a compass is wrong.
    """

    name: str
    advice: str
    would_say: Say
    weight: float
    evidence: str = ""
    offset: Sequence[float] = SET_UP
    second: Sequence[float] | None = None
    axis: Sequence[float] = SET_UP
    cone: Sequence[float] = BUILT
    noise: Sequence[float] = NOISES
    alt_azimuth: bool = False
    fitted: bool = False
    reverses: bool = False
    needs: int = 1
    small: tuple[str, str, str] | None = None

    def geometry(self, seen: Seen) -> tuple[Floats, Floats, Floats, Floats]:
        """What :func:`residuals` takes beside the terms: ``there``, ``reported``, ``side`` and ``ways``."""
        there, reported = (seen.in_axes(p, self.alt_azimuth) for p in (self.would_say(seen), seen.reported))
        alike = np.ones(len(there))
        side = alike if self.alt_azimuth else seen.side  # no fork changes sides
        return there, reported, side, side if self.reverses else alike

    def scales(self) -> Floats:
        """Standard deviations (C, 5) of the terms, every combination as likely."""
        offsets = [(o, o) for o in self.offset] if self.second is None else list(product(self.offset, self.second))
        return np.array([(*o, a, a, c) for o, a, c in product(offsets, self.axis, self.cone)])


@frozen
class Suspect:
    """A cause with its score in 0..1; ``evidence`` says what it leaves unexplained."""

    name: str
    score: float
    evidence: str
    advice: str
    needs: int = 1


@frozen
class Disagreement:
    """The verdict: ``cause`` is empty when no single cause explains it or nothing is wrong."""

    agrees: bool
    cause: str
    sentence: str
    offset_arcsec: float
    east_arcsec: float
    north_arcsec: float
    suspects: tuple[Suspect, ...]


UNEXPLAINED = tr_noop("Mount is off by {angle}, and no single cause explains it: align it, or sync and check again.")
UNTOLD = {
    1: tr_noop(
        "Mount is off by {angle}, and why is not told by one sighting: the polar axis, the base, the tube's cone, a"
        " compass and a sync all look alike here. Sync, or check again at two places far from here, on both sides of"
        " the meridian."
    ),
    2: tr_noop("Mount is off by {angle}, and why is not told by two sightings: check again at a third place."),
}
"""Sightings -> what is said when they name no cause."""


def investigate(sightings: Sequence[MountSighting]) -> Disagreement:
    """Name the cause of the disagreement, or say that no single one explains it.

    More sightings, on both sides of the meridian above all, tell more. At least one is needed.
    """
    seen = Seen(sightings)
    suspects = weigh(seen, list(causes(seen)))
    offset = 3600.0 * max(map(apart_deg, seen.expected, seen.reported))
    shares = {s.name: sum(t.score for t in suspects if t.name == s.name) for s in suspects}
    name = max(shares, key=lambda one: shares[one])
    best = next(s for s in suspects if s.name == name)
    agrees = offset <= AGREE_ARCSEC
    testable = len(sightings) >= max(s.needs for s in suspects if s.name == name)
    cause = name if shares[name] >= NAMED and testable and not agrees else ""
    if agrees:
        sentence = tr("Mount and sky agree within {angle}.", angle=_angle(offset))
    elif cause:
        sentence = f"{tr(cause)}: {best.evidence} {best.advice}"
    else:
        sentence = tr(UNTOLD.get(len(sightings), UNEXPLAINED), angle=_angle(offset))
    (ra, dec), there = seen.shift[-1], seen.expected[-1]
    east, north = -3600.0 * float(ra) * cos(radians(there[1])), -3600.0 * float(dec)
    return Disagreement(agrees, cause, sentence, offset, east, north, tuple(suspects))


def weigh(seen: Seen, causes: Sequence[Cause]) -> list[Suspect]:
    """Each cause's share of the probability, likeliest first; what is left is for none of them."""
    fits = [fit(seen, cause) for cause in causes]
    logs = [log(cause.weight) + found for cause, (found, _, _) in zip(causes, fits, strict=True)]
    unknown = log(UNKNOWN) + sum(map(_unknown, map(apart_deg, seen.expected, seen.reported)))
    total = float(np.logaddexp.reduce([unknown, *logs]))
    found = []
    for c, x, (_, terms, left) in zip(causes, logs, fits, strict=True):
        tilt, cone = np.hypot(*terms[2:4]), abs(terms[4])
        if c.small and seen.site and abs(terms[0]) < LEAST_COMPASS_DEG:
            c = replace(c, name=c.small[0], advice=c.small[1], evidence=c.small[2])
            tilt = abs(terms[0]) * cos(radians(seen.site.latitude_deg))
        evidence = tr(c.evidence).format(first=terms[0], second=terms[1], axis=_angle(3600.0 * tilt), cone=60.0 * cone)
        worst = 3600.0 * float(np.hypot(*left.T).max())
        evidence = tr("{shown} It leaves {angle} unexplained.", shown=evidence, angle=_angle(worst))
        found.append(Suspect(c.name, exp(x - total), evidence, tr(c.advice), c.needs))
    return sorted((s for s in found if s.name), key=lambda s: -s.score)


STEPS = 3  # of Gauss and Newton, as turns by degrees are not quite linear
FARTHEST_DEG = 15.0
NARROW = 0.05  # the cosine beside the pole, where the first axis says nothing


def fit(seen: Seen, cause: Cause) -> tuple[float, Floats, Floats]:
    """Log probability of the sightings under a cause, its terms (5,) and what they leave (N, 2), all in degrees.

    The probability is that of normal data whose mean is linear in terms with normal priors, summed over
    the sizes of those and of the noise (Bishop 2006, Pattern Recognition and Machine Learning, 3.5.1).
    Large noise is rare, or three sightings of a leaning axis would pass for those of a loose mount.
    """
    geometry = cause.geometry(seen)
    prior = cause.scales()[:, None] ** -2.0  # (C, 1, 5)
    noise = np.asarray(cause.noise)[:, None] ** 2  # (S, 1)
    terms, priors, diagonal = np.zeros(5), np.log(prior).sum(axis=-1), prior[..., None] * np.eye(5)
    for _ in range(STEPS if cause.fitted else 1):
        left, slopes = residuals(terms, *geometry)
        y, a = left.ravel() + slopes.reshape(-1, 5) @ terms, slopes.reshape(-1, 5)
        precision = diagonal + (a.T @ a) / noise[..., None]  # (C, S, 5, 5)
        weighted = np.broadcast_to((a.T @ y) / noise, precision.shape[:-1])
        means = np.linalg.solve(precision, weighted[..., None])[..., 0]
        freedom = np.linalg.slogdet(precision)[1] - priors + len(y) * np.log(2.0 * pi * noise[:, 0])
        logs = -0.5 * (y @ y / noise[:, 0] - (weighted * means).sum(axis=-1) + freedom)
        terms = means.reshape(-1, 5)[logs.argmax()]
        if np.abs(terms[2:4]).max() > FARTHEST_DEG:
            break  # no such place for a mount; and the slopes hold no longer
    if cause.fitted:
        left = residuals(terms, *geometry)[0]
    else:
        terms = np.zeros(5)  # those that ``left`` was taken with
    odds = 1.0 / (1.0 + noise[:, 0] / RARE_DEG**2)
    total = np.logaddexp.reduce(logs + np.log(odds / odds.sum()), axis=None)
    return float(total) - log(len(logs)), terms, left


def residuals(terms: Floats, there: Floats, reported: Floats, side: Floats, ways: Floats) -> tuple[Floats, Floats]:
    """What the mount says too much (N, 2) east and north on the sky, degrees, and its slopes (N, 2, 5) by the terms.

    Parameters
    ----------
    terms : Floats
        Offsets of both axes, turn about x and y, and the cone (5,), degrees.
    there : Floats
        Where the tube pointed, unit vectors (N, 3) in the mount's axes.
    reported : Floats
        Where the mount said it pointed, likewise (N, 3).
    side : Floats
        1 or -1 (N,): the cone adds to the first axis on one side of the pier and takes away on the other.
    ways : Floats
        1 or -1 (N,): which way the second axis' offset counts.
    """
    there = turned(there, terms) if terms[2:4].any() else there  # one cause in ten has its terms fitted
    (lon, lat), (at, high) = (
        (np.arctan2(v[:, 1], v[:, 0]), np.arctan2(v[:, 2], np.hypot(v[:, 0], v[:, 1]))) for v in (there, reported)
    )
    level = np.cos(high)
    narrow = np.maximum(np.cos(lat), NARROW)
    first = terms[0] + terms[4] * side / narrow
    off = np.stack([wrapped(np.degrees(at - lon) - first) * level, np.degrees(high - lat) - terms[1] * ways], axis=1)
    slopes = np.zeros((len(there), 2, 5))
    slopes[:, 0, 0], slopes[:, 1, 1], slopes[:, 0, 4] = level, ways, side * level / narrow
    # How far east and north a small turn about x, and about y, moves a direction: the cross product of both.
    s, c, rise = np.sin(lon), np.cos(lon), there[:, 2] * level / narrow
    slopes[:, 0, 2], slopes[:, 1, 2] = rise * c, -s
    slopes[:, 0, 3], slopes[:, 1, 3] = rise * s, c
    return off, slopes


def turned(there: Floats, terms: Floats) -> Floats:
    """Directions (..., 3) in the axes of a mount whose first axis is tilted by two of the terms, to second order."""
    cross = cross_matrix(np.radians([*terms[2:4], 0.0]))
    return np.asarray(there @ (np.eye(3) - cross + 0.5 * cross @ cross).T)


def _unknown(offset_deg: float) -> float:
    """Log density of an offset without a cause: mostly some degrees, sometimes anything."""
    r = max(offset_deg, TIGHT_DEG)
    near = exp(-r / FAR_DEG) / (2.0 * pi * r * FAR_DEG)
    return log(0.9 * near + 0.1 / 41253.0)


def _angle(arcsec: float) -> str:
    if arcsec < 100.0:
        return tr("{angle:.0f} arcsec", angle=arcsec)
    return (
        tr("{angle:.1f} arcmin", angle=arcsec / 60.0) if arcsec < 6e3 else tr("{angle:.1f} deg", angle=arcsec / 3600.0)
    )


# -- What can be wrong with a mount's idea of the sky, one cause a function --------------------

SIDEREAL_DEG_H = 3600.0 * SIDEREAL_DEG_S
DAY_S, LARGEST_ZONE_S, MOST_DAYS = 86400.0, 12.5 * 3600.0, 31
CLOCK_S, PLACE_DEG = 60.0, 0.2  # within these a mount's own clock and site are right
CONFIRMED, DENIED = 20.0, 0.02  # what a witness is worth


def causes(seen: Seen) -> Iterator[Cause]:
    """Every cause that can be asked of these sightings."""
    yield Cause("", "", _off(0.0), HEALTHY, offset=SMALL, axis=SMALL, cone=SMALL, noise=NOISES[:-1])
    yield from clocks(seen)
    yield from epochs(seen.last)
    yield from sites(seen.last)
    yield Cause(
        tr_noop("pier side"),
        tr_noop("Slew to the other side of the meridian and back, or start again from home."),
        _off(180.0),
        0.05,
        tr_noop("Right ascension is off by 12 h, declination is right: the tube is on the other side of the pier."),
    )
    yield from homes(seen)
    yield from compasses(seen)
    if len(seen.sightings) > 1:
        yield from alignments(seen)


AHEAD = tr_noop("The mount's clock is {hours} h ahead, which is {angle:.1f} deg in right ascension.")
BEHIND = tr_noop("The mount's clock is {hours} h behind, which is {angle:.1f} deg in right ascension.")
FAST = tr_noop("The mount's own clock is {minutes:.0f} min ahead of the computer's.")
SLOW = tr_noop("The mount's own clock is {minutes:.0f} min behind the computer's.")


LATE = tr_noop("The mount's own date is {days:.1f} days ahead of the computer's.")
EARLY = tr_noop("The mount's own date is {days:.1f} days behind the computer's.")
AHEAD_DAYS = tr_noop("Right ascension is off as by a date {days} days ahead, which is {angle:.1f} deg.")
BEHIND_DAYS = tr_noop("Right ascension is off as by a date {days} days behind, which is {angle:.1f} deg.")


def clocks(seen: Seen) -> Iterator[Cause]:
    """Summer time and other whole hours; and what the mount's own clock is seen to be off."""
    last = seen.last
    clock = last.beliefs.time_utc
    off_s = None if clock is None else (clock - last.time_utc) / timedelta(seconds=1)
    for hours in (h for h in range(-11, 13) if h):
        summer = abs(hours) == 1
        off_deg = hours * SIDEREAL_DEG_H
        yield Cause(
            tr_noop("summer time") if summer else tr_noop("time zone"),
            tr_noop("Set daylight saving (summer time) on the hand control, then align again.")
            if summer
            else tr_noop("Set the time zone on the hand control, then align again."),
            _off(off_deg),
            (0.15 if summer else 0.10 / 21.0)
            * _witness(None if off_s is None else abs(off_s - 3600.0 * hours) < CLOCK_S),
            tr(AHEAD if hours > 0 else BEHIND, hours=abs(hours), angle=abs(off_deg)),
        )
    yield from days(off_s, float(seen.shift[-1, 0]))
    if off_s is not None and LARGEST_ZONE_S > abs(off_s) > CLOCK_S and abs(abs(off_s) % 3600.0 - 1800.0) < 1740.0:
        yield Cause(
            tr_noop("clock"),
            tr_noop("Set the mount's clock, then align again."),
            _off(off_s / 3600.0 * SIDEREAL_DEG_H),
            0.1 * CONFIRMED,
            tr(FAST if off_s > 0 else SLOW, minutes=abs(off_s) / 60.0),
        )


def days(off_s: float | None, shift_deg: float) -> Iterator[Cause]:
    """A wrong day, which is some four minutes of sidereal time each; ``off_s`` is what the mount's own clock is off.

    Where it tells none, those near what it says too much in right ascension: all others are far from it.
    """
    wrong = Cause(tr_noop("wrong day"), tr_noop("Set the date on the hand control, then align again."), _off(0.0), 0.1)
    if off_s is not None and abs(off_s) > LARGEST_ZONE_S:
        sentence = tr(LATE if off_s > 0 else EARLY, days=abs(off_s) / DAY_S)
        off_deg = wrapped(off_s / 3600.0 * SIDEREAL_DEG_H)
        yield replace(wrong, would_say=_off(off_deg), weight=0.1 * CONFIRMED, evidence=sentence)
        return
    share = 0.05 / sum(2.0 / days for days in range(1, MOST_DAYS + 1))
    day_deg = 24.0 * SIDEREAL_DEG_H - 360.0
    nearest = round(shift_deg / day_deg)
    for day in (d for d in range(nearest - 2, nearest + 3) if d and abs(d) <= MOST_DAYS):
        off_deg = day * day_deg
        sentence = tr(AHEAD_DAYS if day > 0 else BEHIND_DAYS, days=abs(day), angle=abs(off_deg))
        weight = share / abs(day) * _witness(None if off_s is None else False)
        # On the shift alone, which a longitude or a slow clock makes as well: nothing else may be wrong beside it.
        yield replace(
            wrong,
            would_say=_off(off_deg),
            weight=weight,
            evidence=sentence,
            offset=SMALL,
            axis=SMALL,
            cone=SMALL,
            needs=2,
        )


def epochs(last: MountSighting) -> Iterator[Cause]:
    """J2000 taken for the equator of date, or the reverse: some 20 arcmin."""
    other = Epoch.J2000 if last.reported.epoch is Epoch.DATE else Epoch.DATE
    option = "J2000" if other is Epoch.J2000 else "date"
    yield Cause(
        tr_noop("epoch"),
        tr("Choose the epoch {option} for this mount (--epoch {option}).", option=option),
        lambda seen: np.array([to_mount_epoch(*s.sky_deg, other, s.time_utc) for s in seen.sightings]),
        0.15,
        tr_noop("The mount reports J2000 but Kochab takes its coordinates as the equator of date.")
        if other is Epoch.J2000
        else tr_noop("The mount reports the equator of date but Kochab takes its coordinates as J2000."),
        offset=SMALL,  # where the mount was well aligned, but in another epoch
        axis=SMALL,
        cone=SMALL,
    )


def sites(last: MountSighting) -> Iterator[Cause]:
    """South taken for north, east for west, and a site that the mount itself tells to be another."""
    own, mount_site = last.site, last.beliefs.site
    opposite = None
    if mount_site is not None and own is not None and abs(own.latitude_deg) > 1.0:
        opposite = mount_site.latitude_deg * own.latitude_deg < 0.0
    mirrored = Cause(
        tr_noop("hemisphere"),
        tr_noop("Set north or south on the hand control, then align again."),
        lambda seen: seen.expected * (1.0, -1.0),
        0.05 * _witness(opposite),
        tr_noop("The declination is mirrored: the mount is set to the other hemisphere."),
    )
    yield mirrored
    if own is None:
        return
    # a mount that counts hour angles the other way, too
    reverse = replace(mirrored, would_say=_reversed, weight=0.03 * _witness(opposite))
    yield reverse
    swapped = None if mount_site is None else abs(wrapped(mount_site.longitude_deg + own.longitude_deg)) < PLACE_DEG
    if abs(own.longitude_deg) > 1.0:  # nearer to Greenwich both signs say the same
        off = wrapped(-2.0 * own.longitude_deg)
        yield Cause(
            tr_noop("longitude sign"),
            tr_noop("Change east and west of the longitude on the hand control, then align again."),
            _off(off),
            0.08 * _witness(swapped),
            tr("Right ascension is off by twice the longitude, {off:+.1f} deg: east and west are swapped.", off=off),
        )
    if mount_site is None:
        return
    east, north = wrapped(mount_site.longitude_deg - own.longitude_deg), mount_site.latitude_deg
    if abs(east) > PLACE_DEG and not swapped:
        yield Cause(
            tr_noop("site longitude"),
            tr_noop("Set the longitude on the hand control, then align again."),
            _off(east),
            0.1 * CONFIRMED,
            tr("The mount's longitude is {east:+.1f} deg too far east.", east=east),
        )
    if abs(north - own.latitude_deg) > PLACE_DEG and north * own.latitude_deg >= 0.0:
        yield Cause(
            tr_noop("site latitude"),
            tr_noop("Set the latitude on the hand control, then align again."),
            lambda seen: _wrong_latitude(seen, north - own.latitude_deg),
            0.1 * CONFIRMED,
            tr("The mount's latitude is {its:.1f} deg instead of {own:.1f} deg.", its=north, own=own.latitude_deg),
            alt_azimuth=True,
        )


def homes(seen: Seen) -> Iterator[Cause]:
    """Still at home: what the mount says has nothing to do with the sky."""
    unaligned = any(s.aligned is False for s in seen.sightings)
    if unaligned or (np.abs(seen.reported[:, 1]) > 89.5).all():
        yield Cause(
            tr_noop("not aligned"),
            tr_noop("Align the mount, or sync it on a solved frame."),
            lambda seen: seen.reported,
            0.3 * (CONFIRMED * CONFIRMED if unaligned else CONFIRMED),
            tr_noop("The mount reports that it is not aligned.")
            if unaligned
            else tr_noop("The mount reports the pole, its home position."),
            noise=ANYWHERE,
        )


def compasses(seen: Seen) -> Iterator[Cause]:
    """The whole mount rotated about the vertical, whatever its type."""
    if seen.site is None:
        return
    turned_base = Cause(
        tr_noop("compass azimuth"),
        tr_noop("Turn the mount to true north, or align it on stars, or sync it on a solved frame."),
        _off(0.0),
        0.2,
        tr_noop(
            "The azimuth is off by {first:+.1f} deg everywhere and the altitude is right: the mount was turned to"
            " the north of a compass, not to the true one."
        ),
        offset=COMPASS,
        second=BUILT,
        axis=BUILT,
        cone=BUILT,
        alt_azimuth=True,
        fitted=True,
        needs=2,
    )
    alt_azimuth = _alt_azimuth(seen.last)
    for share, small in ((alt_azimuth, None), (1.0 - alt_azimuth, POLAR_AXIS)):
        if share:
            yield replace(turned_base, weight=0.2 * share, small=small)


def alignments(seen: Seen) -> Iterator[Cause]:
    """One offset everywhere, a first axis that leans, a tube not square to its axis; or all of that."""
    alt_azimuth = _alt_azimuth(seen.last)
    offset = Cause(
        "not aligned",
        tr_noop("Sync it on a solved frame."),
        _off(0.0),
        0.3,
        tr_noop("Both axes are off by the same angles everywhere, {first:+.2f} and {second:+.2f} deg."),
        offset=OFFSETS,
        axis=SMALL,
        cone=SMALL,
        fitted=True,
    )
    leaning = replace(offset, offset=(*SMALL, *OFFSETS), axis=AXES)
    if alt_azimuth:
        yield replace(offset, weight=0.3 * alt_azimuth, alt_azimuth=True)
        yield replace(
            leaning,
            name=tr_noop("base tilt"),
            advice=tr_noop("Level the base, then align again."),
            evidence=tr_noop("The base is tilted by {axis}."),
            weight=0.2 * alt_azimuth,
            alt_azimuth=True,
        )
    if alt_azimuth == 1.0:
        return
    both = set(seen.side) >= {-1.0, 1.0}
    ways = (False, True) if both else (False,)
    for reverses in ways:
        share = (1.0 - alt_azimuth) / len(ways)
        yield replace(offset, weight=0.3 * share, reverses=reverses)
        leaning = replace(leaning, reverses=reverses)
        yield replace(leaning, name=POLAR_AXIS[0], advice=POLAR_AXIS[1], evidence=POLAR_AXIS[2], weight=0.2 * share)
        if both:
            yield replace(
                leaning,
                name=tr_noop("cone error"),
                advice=tr_noop("Shim the dovetail until both sides agree, or sync after every flip."),
                evidence=tr_noop("The offset changes sign across the meridian, {cone:.0f} arcmin on either side."),
                weight=0.1 * share,
                axis=SMALL,
                cone=CONES,
            )
            yield replace(leaning, name="", weight=0.02 * share, cone=CONES)  # healthy, but for a cone


def _alt_azimuth(last: MountSighting) -> float:
    """The probability that the mount stands in altitude and azimuth."""
    if last.site is None or last.pier_side is not None or last.alt_azimuth is False:
        return 0.0
    return float(last.alt_azimuth or 0.2)


def _off(ra_deg: float) -> Say:
    """The same angle too much everywhere, as a right ascension is where sidereal time is ahead."""
    return lambda seen: seen.expected + np.array([ra_deg, 0.0])


def _witness(confirms: bool | None) -> float:
    """What the mount's own word is worth; None where it says nothing of it."""
    return 1.0 if confirms is None else CONFIRMED if confirms else DENIED


def _reversed(seen: Seen) -> Floats:
    """Hour angles counted the other way, and declinations from the other pole."""
    ra, dec = seen.expected.T
    return np.stack([2.0 * seen.sidereal - ra, -dec], axis=1)


def _wrong_latitude(seen: Seen, turn_deg: float) -> Floats:
    """A mount in altitude and azimuth, levelled and set north, that thinks of a latitude so much greater."""
    ra, dec = seen.expected.T
    x, y, z = unit_vectors(ra - seen.sidereal, dec).T  # x towards the equator on the meridian, z the pole
    c, n = cos(radians(turn_deg)), sin(radians(turn_deg))
    turned = np.stack([c * x - n * z, y, n * x + c * z], axis=1)
    found = np.array([radec_deg(vector) for vector in turned])
    found[:, 0] += seen.sidereal
    return found
