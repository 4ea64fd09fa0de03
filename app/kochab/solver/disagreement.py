"""Why the mount and the sky disagree: each possible cause, weighed.

Every cause, if it were the only one, would make the mount say a certain thing of the place the sky
shows. Causes are weighed by how near that comes to what it does say, against the chance that some
unknown offset comes as near; a mount that tells its own clock and site is a witness besides.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from math import cos, exp, log, pi, radians

import numpy as np

from kochab.core.attitude import apart_deg, radec_deg, unit_vectors, wrapped
from kochab.core.frame import Site
from kochab.core.mount import SIDEREAL_DEG_S, Epoch, PierSide, Pointing, SiteReport
from kochab.gear.mounts.coordinates import hour_angle_deg, sidereal_deg, to_mount_epoch

Degrees = tuple[float, float]

AGREE_ARCSEC = 120.0  # a mount's own rounding, and what mechanics leave
LOOSE_DEG = 0.6  # how well a roughly set up mount points once the cause is allowed for
TIGHT_DEG = 2.0 / 60.0  # where the mount was well aligned, but in another epoch
NAMED = 0.8
UNKNOWN = 0.3  # weight of "something else"
FAR_DEG = 5.0  # how large offsets without one of these causes usually are


@dataclass(frozen=True, slots=True)
class MountSighting:
    """One solved frame, and what the mount said when it was taken.

    ``sky_deg`` is ICRS; ``time_utc`` and ``site`` are the computer's.
    """

    sky_deg: Degrees
    said: Pointing
    time_utc: datetime
    site: Site | None = None
    pier_side: PierSide | None = None
    aligned: bool | None = None
    beliefs: SiteReport = field(default_factory=SiteReport)

    @property
    def expected_deg(self) -> Degrees:
        """What a mount without fault would say, in its own epoch."""
        return to_mount_epoch(*self.sky_deg, self.said.epoch, self.time_utc)

    @property
    def said_deg(self) -> Degrees:
        """RA and Dec the mount said."""
        return self.said.ra_deg, self.said.dec_deg

    @property
    def shift_deg(self) -> Degrees:
        """What the mount says too much along both axes."""
        there = self.expected_deg
        return wrapped(self.said.ra_deg - there[0]), self.said.dec_deg - there[1]


Say = Callable[[MountSighting], Degrees]


@dataclass(frozen=True, slots=True)
class Cause:
    """A hypothesis: what the mount would say of a sighting if only this were wrong.

    ``weight`` is how often that happens before anything is known; ``spread_deg`` how near a mount
    comes to it; ``freedom`` how many numbers were fitted to the sightings. ``witness`` multiplies
    the weight by what the mount tells of its clock and site.
    """

    name: str
    advice: str
    would_say: Say
    weight: float
    spread_deg: float = LOOSE_DEG
    freedom: int = 0
    witness: float = 1.0
    evidence: str = ""


@dataclass(frozen=True, slots=True)
class Suspect:
    """A cause with its score in 0..1 and what it leaves unexplained."""

    name: str
    score: float
    residual_arcsec: float
    evidence: str
    advice: str


@dataclass(frozen=True, slots=True)
class Disagreement:
    """The verdict: ``cause`` is empty when no single cause explains it or nothing is wrong."""

    agrees: bool
    cause: str
    sentence: str
    offset_arcsec: float
    east_arcsec: float
    north_arcsec: float
    suspects: tuple[Suspect, ...]


def investigate(sightings: Sequence[MountSighting]) -> Disagreement:
    """Name the cause of the disagreement, or say that no single one explains it.

    More sightings, on both sides of the meridian above all, tell more. At least one is needed.
    """
    suspects = weigh(sightings, list(causes(sightings)))
    best, last = suspects[0], sightings[-1]
    offset = max(apart_deg(s.expected_deg, s.said_deg) for s in sightings) * 3600.0
    ra, dec = last.shift_deg
    agrees = offset <= AGREE_ARCSEC
    cause = best.name if best.score >= NAMED and not agrees else ""
    if agrees:
        sentence = f"Mount and sky agree within {_angle(offset)}."
    elif cause:
        sentence = f"{cause}: {best.evidence} {best.advice}"
    else:
        sentence = (
            f"Mount is off by {_angle(offset)}, and no single cause explains it: align the mount or "
            "sync it on a solved frame, then check again elsewhere in the sky."
        )
    east, north = -3600.0 * ra * cos(radians(last.expected_deg[1])), -3600.0 * dec
    return Disagreement(agrees, cause, sentence, offset, east, north, tuple(suspects))


def weigh(sightings: Sequence[MountSighting], causes: Sequence[Cause]) -> list[Suspect]:
    """Each cause's share of the probability, likeliest first; what is left is for no cause."""
    left = [[apart_deg(cause.would_say(s), s.said_deg) for s in sightings] for cause in causes]
    logs = [_support(cause, residuals) for cause, residuals in zip(causes, left, strict=True)]
    nothing = log(UNKNOWN) + sum(_unknown(apart_deg(s.expected_deg, s.said_deg)) for s in sightings)
    total = float(np.logaddexp.reduce([nothing, *logs]))
    found = [
        Suspect(c.name, exp(x - total), worst, f"{c.evidence} It leaves {_angle(worst)} unexplained.", c.advice)
        for c, x, worst in zip(causes, logs, (3600.0 * max(residuals) for residuals in left), strict=True)
    ]
    return sorted(found, key=lambda s: -s.score)


def _support(cause: Cause, residuals_deg: Sequence[float]) -> float:
    """Logarithm of weight times likelihood; a fitted number costs as much as it could gain."""
    spread = cause.spread_deg
    densities = (-0.5 * (residual / spread) ** 2 - log(2.0 * pi * spread**2) for residual in residuals_deg)
    return log(cause.weight * cause.witness) + sum(densities) - cause.freedom * log(FAR_DEG / spread)


def _unknown(offset_deg: float) -> float:
    """Log density of an offset without a cause: mostly some degrees, sometimes anything."""
    r = max(offset_deg, TIGHT_DEG)
    near = exp(-r / FAR_DEG) / (2.0 * pi * r * FAR_DEG)
    return log(0.9 * near + 0.1 / 41253.0)


def _angle(arcsec: float) -> str:
    if arcsec < 100.0:
        return f"{arcsec:.0f} arcsec"
    return f"{arcsec / 60.0:.1f} arcmin" if arcsec < 6000.0 else f"{arcsec / 3600.0:.1f} deg"


# -- What can be wrong with a mount's idea of the sky, one cause a function --------------------

SIDEREAL_DEG_H = 3600.0 * SIDEREAL_DEG_S
CLOCK_S, PLACE_DEG = 60.0, 0.2  # within these a mount's own clock and site are right
CONFIRMED, DENIED = 20.0, 0.02  # what a witness is worth
CONE_DEG = 5.0 / 60.0


def causes(sightings: Sequence[MountSighting]) -> Iterator[Cause]:
    """Every cause that can be asked of these sightings."""
    last = sightings[-1]
    yield from clocks(last)
    yield from epochs(last)
    yield from sites(last)
    yield Cause(
        "pier side",
        "Slew to the other side of the meridian and back, or start again from home.",
        _off(180.0),
        0.05,
        evidence="Right ascension is off by 12 h with the declination right: the telescope is "
        "on the other side of the pier than the mount assumes.",
    )
    yield from alignments(sightings)
    yield from cones(sightings)


def clocks(last: MountSighting) -> Iterator[Cause]:
    """Summer time and other whole hours; and what the mount's own clock is seen to be off."""
    clock = last.beliefs.time_utc
    off_s = None if clock is None else (clock - last.time_utc) / timedelta(seconds=1)
    for hours in (h for h in range(-11, 13) if h):
        summer = abs(hours) == 1
        off_deg = hours * SIDEREAL_DEG_H
        yield Cause(
            "summer time" if summer else "time zone",
            f"Set {'daylight saving (summer time)' if summer else 'the time zone'} on the hand control, "
            "then align again.",
            _off(off_deg),
            0.15 if summer else 0.10 / 21.0,
            witness=_witness(None if off_s is None else abs(off_s - 3600.0 * hours) < CLOCK_S),
            evidence=f"The mount's clock is {abs(hours)} h {'ahead' if hours > 0 else 'behind'}, which is "
            f"{abs(off_deg):.1f} deg in right ascension.",
        )
    if off_s is not None and abs(off_s) > CLOCK_S and abs(abs(off_s) % 3600.0 - 1800.0) < 1740.0:
        yield Cause(
            "clock",
            "Set the mount's clock, then align again.",
            _off(off_s / 3600.0 * SIDEREAL_DEG_H),
            0.1,
            witness=CONFIRMED,
            evidence=f"The mount's own clock is {abs(off_s) / 60.0:.0f} min "
            f"{'ahead of' if off_s > 0 else 'behind'} the computer's.",
        )


def epochs(last: MountSighting) -> Iterator[Cause]:
    """J2000 taken for the equator of date, or the reverse: some 20 arcmin."""
    words = {Epoch.DATE: "the equator of date", Epoch.J2000: "J2000"}
    other = Epoch.J2000 if last.said.epoch is Epoch.DATE else Epoch.DATE
    option = "J2000" if other is Epoch.J2000 else "date"
    yield Cause(
        "epoch",
        f"Choose the epoch {option} for this mount (--epoch {option}).",
        lambda s: to_mount_epoch(*s.sky_deg, other, s.time_utc),
        0.15,
        TIGHT_DEG,
        evidence=f"The mount reports {words[other]} but is read as {words[last.said.epoch]}.",
    )


def sites(last: MountSighting) -> Iterator[Cause]:
    """South taken for north, east for west, and a site that the mount itself tells to be another."""
    own, told = last.site, last.beliefs.site
    opposite = None
    if told is not None and own is not None and abs(own.latitude_deg) > 1.0:
        opposite = told.latitude_deg * own.latitude_deg < 0.0
    mirrored = Cause(
        "hemisphere",
        "Set north or south on the hand control, then align again.",
        lambda s: (s.expected_deg[0], -s.expected_deg[1]),
        0.05,
        witness=_witness(opposite),
        evidence="The declination is mirrored: the mount is set to the other hemisphere.",
    )
    yield mirrored
    if own is None:
        return
    yield replace(mirrored, would_say=lambda s: _hour_angle_reversed(s, own), weight=0.03)
    swapped = None if told is None else abs(wrapped(told.longitude_deg + own.longitude_deg)) < PLACE_DEG
    if abs(own.longitude_deg) > 1.0:
        off = wrapped(-2.0 * own.longitude_deg)
        yield Cause(
            "longitude sign",
            "Change east and west of the longitude on the hand control, then align again.",
            _off(off),
            0.08,
            witness=_witness(swapped),
            evidence=f"Right ascension is off by twice the longitude, {off:+.1f} deg: east "
            "and west of the longitude are swapped.",
        )
    if told is None:
        return
    east, north = wrapped(told.longitude_deg - own.longitude_deg), told.latitude_deg
    if abs(east) > PLACE_DEG and not swapped:
        yield Cause(
            "site longitude",
            "Set the longitude on the hand control, then align again.",
            _off(east),
            0.1,
            witness=CONFIRMED,
            evidence=f"The mount's longitude is {east:+.1f} deg too far east.",
        )
    if abs(north - own.latitude_deg) > PLACE_DEG and north * own.latitude_deg >= 0.0:
        yield Cause(
            "site latitude",
            "Set the latitude on the hand control, then align again.",
            lambda s: _wrong_latitude(s, own, north),
            0.1,
            witness=CONFIRMED,
            evidence=f"The mount's latitude is {north:.1f} deg instead of {own.latitude_deg:.1f} deg.",
        )


def alignments(sightings: Sequence[MountSighting]) -> Iterator[Cause]:
    """Still at home, or one offset everywhere."""
    unaligned = any(s.aligned is False for s in sightings)
    if unaligned or all(abs(s.said.dec_deg) > 89.5 for s in sightings):
        yield Cause(
            "not aligned",
            "Align the mount, or sync it on a solved frame.",
            lambda s: s.said_deg,
            0.3,
            freedom=2,
            witness=CONFIRMED * CONFIRMED if unaligned else CONFIRMED,
            evidence=f"The mount reports {'that it is not aligned' if unaligned else 'the pole, its home position'}.",
        )
    if len(sightings) > 1:
        ra, dec = np.mean([s.shift_deg for s in sightings], axis=0).tolist()
        yield Cause(
            "not aligned",
            "Sync it on a solved frame.",
            _off(ra, dec),
            0.3,
            CONE_DEG,
            freedom=2,
            evidence=f"Both axes are off by the same angles everywhere, {ra:+.2f} and {dec:+.2f} deg.",
        )


def cones(sightings: Sequence[MountSighting]) -> Iterator[Cause]:
    """A tube not square to its axis: the offset in right ascension flips across the meridian."""
    sides = [_side(s) for s in sightings]
    if set(sides) != {-1.0, 1.0}:
        return
    narrow = [cos(radians(s.expected_deg[1])) for s in sightings]
    cone = float(np.mean([s.shift_deg[0] * n * side for s, n, side in zip(sightings, narrow, sides, strict=True)]))

    def off(s: MountSighting) -> Degrees:
        ra, dec = s.expected_deg
        return (ra + cone * _side(s) / max(cos(radians(dec)), 0.05)) % 360.0, dec

    yield Cause(
        "cone error",
        "Shim the dovetail until both sides agree, or sync after every flip.",
        off,
        0.15,
        CONE_DEG,
        freedom=1,
        evidence=f"The offset changes sign across the meridian, {abs(cone) * 60.0:.0f} arcmin on either side.",
    )


def _off(ra_deg: float, dec_deg: float = 0.0) -> Say:
    """The same angles too much everywhere, as a right ascension is where sidereal time is ahead."""
    return lambda s: ((s.expected_deg[0] + ra_deg) % 360.0, s.expected_deg[1] + dec_deg)


def _witness(confirms: bool | None) -> float:
    """What the mount's own word is worth; None where it says nothing of it."""
    return 1.0 if confirms is None else CONFIRMED if confirms else DENIED


def _side(s: MountSighting) -> float:
    """1 west of the meridian or on the pier's east side, -1 on the other, 0 when unknown."""
    if s.pier_side is not None:
        return 1.0 if s.pier_side is PierSide.EAST else -1.0
    if s.site is None:
        return 0.0
    return 1.0 if hour_angle_deg(s.expected_deg[0], s.site, s.time_utc) >= 0.0 else -1.0


def _hour_angle_reversed(s: MountSighting, own: Site) -> Degrees:
    """A mount that counts hour angles the other way, and declinations from the other pole."""
    ra, dec = s.expected_deg
    return (sidereal_deg(own, s.time_utc) + hour_angle_deg(ra, own, s.time_utc)) % 360.0, -dec


def _wrong_latitude(s: MountSighting, own: Site, latitude_deg: float) -> Degrees:
    """A mount in altitude and azimuth, levelled and set north, that thinks of another latitude."""
    lst = sidereal_deg(own, s.time_utc)
    ra, dec = s.expected_deg
    x, y, z = unit_vectors(ra - lst, dec)  # x towards the equator on the meridian, z the pole
    turn = np.radians(latitude_deg - own.latitude_deg)
    c, n = np.cos(turn), np.sin(turn)
    found = radec_deg(np.array([c * x - n * z, y, n * x + c * z]))
    return (found[0] + lst) % 360.0, found[1]
