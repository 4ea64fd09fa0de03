"""Why the mount and the sky disagree: each possible cause, weighed.

Every cause, if it were the only one, would make the mount say a certain thing of the place the sky
shows. Causes are weighed by how near that comes to what it does say, against the chance that some
unknown offset comes as near; a mount that tells its own clock and site is a witness besides.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from functools import partial
from math import cos, exp, inf, log, pi, radians

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


@dataclass(frozen=True, slots=True)
class Cause:
    """A hypothesis: what the mount would say of each sighting if only this were wrong.

    ``weight`` is how often that happens before anything is known; ``spread_deg`` how near a mount
    comes to it; ``freedom`` how many numbers were fitted to the sightings. ``witness`` multiplies
    the weight by what the mount tells of its clock and site.
    """

    name: str
    advice: str
    would_say: tuple[Degrees, ...]
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
    suspects = weigh(sightings, causes(sightings))
    last = sightings[-1]
    offset = max(apart_deg(s.expected_deg, s.said_deg) for s in sightings) * 3600.0
    east, north = _parts_arcsec(last)
    agrees = offset <= AGREE_ARCSEC
    best = suspects[0] if suspects else None
    named = best is not None and best.score >= NAMED and not agrees
    if agrees:
        sentence = f"Mount and sky agree within {_angle(offset)}."
    elif best is not None and named:
        sentence = f"{best.name}: {best.evidence} {best.advice}"
    else:
        sentence = (
            f"Mount is off by {_angle(offset)}, and no single cause explains it: align the mount or "
            "sync it on a solved frame, then check again elsewhere in the sky."
        )
    cause = best.name if best is not None and named else ""
    return Disagreement(agrees, cause, sentence, offset, east, north, tuple(suspects))


def weigh(sightings: Sequence[MountSighting], causes: Sequence[Cause]) -> list[Suspect]:
    """Each cause's share of the probability, likeliest first; what is left is for no cause."""
    said = [s.said_deg for s in sightings]
    offsets = [apart_deg(s.expected_deg, s.said_deg) for s in sightings]
    nothing = log(UNKNOWN) + sum(_unknown(offset) for offset in offsets)
    logs = [_support(cause, said) for cause in causes]
    top = max([nothing, *logs])
    total = sum(exp(x - top) for x in [nothing, *logs])
    found = [
        Suspect(
            c.name,
            exp(x - top) / total,
            left := _worst_arcsec(c, said),
            f"{c.evidence} It leaves {_angle(left)} unexplained.",
            c.advice,
        )
        for c, x in zip(causes, logs, strict=True)
    ]
    return sorted(found, key=lambda s: -s.score)


def _support(cause: Cause, said: Sequence[Degrees]) -> float:
    """Logarithm of weight times likelihood; a fitted number costs as much as it could gain."""
    if not cause.would_say or cause.weight * cause.witness <= 0.0:
        return -inf
    fit = sum(
        _near(apart_deg(would, does), cause.spread_deg) for would, does in zip(cause.would_say, said, strict=True)
    )
    return log(cause.weight * cause.witness) + fit - cause.freedom * log(FAR_DEG / cause.spread_deg)


def _near(residual_deg: float, spread_deg: float) -> float:
    """Log density on the sky, per square degree, of a residual."""
    return -0.5 * (residual_deg / spread_deg) ** 2 - log(2.0 * pi * spread_deg**2)


def _unknown(offset_deg: float) -> float:
    """Log density of an offset without a cause: mostly some degrees, sometimes anything."""
    r = max(offset_deg, TIGHT_DEG)
    near = exp(-r / FAR_DEG) / (2.0 * pi * r * FAR_DEG)
    return log(0.9 * near + 0.1 / 41253.0)


def _worst_arcsec(cause: Cause, said: Sequence[Degrees]) -> float:
    pairs = zip(cause.would_say, said, strict=True)
    return max(apart_deg(would, does) for would, does in pairs) * 3600.0


def _parts_arcsec(s: MountSighting) -> tuple[float, float]:
    """From what the mount says to where the sky is, towards east and north."""
    there, said = s.expected_deg, s.said_deg
    east = wrapped(there[0] - said[0]) * cos(radians(there[1]))
    return east * 3600.0, (there[1] - said[1]) * 3600.0


def _angle(arcsec: float) -> str:
    if arcsec < 100.0:
        return f"{arcsec:.0f} arcsec"
    return f"{arcsec / 60.0:.1f} arcmin" if arcsec < 6000.0 else f"{arcsec / 3600.0:.1f} deg"


# -- What can be wrong with a mount's idea of the sky, one cause a function --------------------

SIDEREAL_DEG_H = 3600.0 * SIDEREAL_DEG_S
CLOCK_S, PLACE_DEG = 60.0, 0.2  # within these a mount's own clock and site are right
CONFIRMED, DENIED = 20.0, 0.02  # what a witness is worth
CONE_DEG = 5.0 / 60.0

Say = Callable[[MountSighting], Degrees]


def causes(sightings: Sequence[MountSighting]) -> list[Cause]:
    """Every cause that can be asked of these sightings."""
    found = [*clocks(sightings), *epochs(sightings), *hemispheres(sightings)]
    found += [*sites(sightings), *sides(sightings), *alignments(sightings), *cones(sightings)]
    return [cause for cause in found if cause.would_say]


def clocks(sightings: Sequence[MountSighting]) -> list[Cause]:
    """Summer time and other whole hours; and what the mount's own clock is seen to be off."""
    found = []
    for hours in (h for h in range(-11, 13) if h):
        summer = abs(hours) == 1
        ahead = "ahead" if hours > 0 else "behind"
        found.append(
            Cause(
                "summer time" if summer else "time zone",
                "Set daylight saving (summer time) on the hand control, then align again."
                if summer
                else "Set the time zone on the hand control, then align again.",
                _all(sightings, partial(_east, degrees=hours * SIDEREAL_DEG_H)),
                0.15 if summer else 0.10 / 21.0,
                witness=_clock_witness(sightings, hours * 3600.0),
                evidence=f"The mount's clock is {abs(hours)} h {ahead}, which is "
                f"{abs(hours) * SIDEREAL_DEG_H:.1f} deg in right ascension.",
            )
        )
    off = _clock_off_s(sightings)
    if off is not None and abs(off) > CLOCK_S and abs(abs(off) % 3600.0 - 1800.0) < 1740.0:
        found.append(
            Cause(
                "clock",
                "Set the mount's clock, then align again.",
                _all(sightings, lambda s: _east(s, off / 3600.0 * SIDEREAL_DEG_H)),
                0.1,
                witness=CONFIRMED,
                evidence=f"The mount's own clock is {abs(off) / 60.0:.0f} min "
                f"{'ahead of' if off > 0 else 'behind'} the computer's.",
            )
        )
    return found


def epochs(sightings: Sequence[MountSighting]) -> list[Cause]:
    """J2000 taken for the equator of date, or the reverse: some 20 arcmin."""

    def other(s: MountSighting) -> Degrees:
        # What the mount says is in the other epoch than it is taken to be.
        epoch = Epoch.J2000 if s.said.epoch is Epoch.DATE else Epoch.DATE
        return to_mount_epoch(*s.sky_deg, epoch, s.time_utc)

    own = sightings[-1].said.epoch
    really = "J2000" if own is Epoch.DATE else "the equator of date"
    option = "J2000" if own is Epoch.DATE else "date"
    return [
        Cause(
            "epoch",
            f"Choose the epoch {option} for this mount (--epoch {option}).",
            _all(sightings, other),
            0.15,
            TIGHT_DEG,
            evidence=f"The mount reports {really} but is read as "
            f"{'the equator of date' if own is Epoch.DATE else 'J2000'}.",
        )
    ]


def hemispheres(sightings: Sequence[MountSighting]) -> list[Cause]:
    """South taken for north: the declination is mirrored, perhaps the hour angle too."""
    told = [s.beliefs.site for s in sightings if s.beliefs.site is not None]
    own = sightings[-1].site
    witness = 1.0
    if told and own is not None and abs(own.latitude_deg) > 1.0:
        opposite = told[-1].latitude_deg * own.latitude_deg < 0.0
        witness = CONFIRMED if opposite else DENIED

    def turned(s: MountSighting) -> Degrees:
        ra, dec = s.expected_deg
        if s.site is None:
            return ra, -dec
        hour = hour_angle_deg(ra, s.site, s.time_utc)
        return (sidereal_deg(s.site, s.time_utc) + hour) % 360.0, -dec

    base = Cause(
        "hemisphere",
        "Set north or south on the hand control, then align again.",
        _all(sightings, lambda s: (s.expected_deg[0], -s.expected_deg[1])),
        0.05,
        witness=witness,
        evidence="The declination is mirrored: the mount is set to the other hemisphere.",
    )
    if all(s.site is None for s in sightings):
        return [base]
    return [base, replace(base, would_say=_all(sightings, turned), weight=0.03)]


def sites(sightings: Sequence[MountSighting]) -> list[Cause]:
    """East taken for west, and a site that the mount itself tells to be another."""
    own, told = sightings[-1].site, sightings[-1].beliefs.site
    found: list[Cause] = []
    if own is not None and abs(own.longitude_deg) > 1.0:
        off = wrapped(-2.0 * own.longitude_deg)
        witness = 1.0
        if told is not None:
            opposite = abs(wrapped(told.longitude_deg + own.longitude_deg)) < PLACE_DEG
            witness = CONFIRMED if opposite else DENIED
        found.append(
            Cause(
                "longitude sign",
                "Change east and west of the longitude on the hand control, then align again.",
                _all(sightings, lambda s: _east(s, off)),
                0.08,
                witness=witness,
                evidence=f"Right ascension is off by twice the longitude, {off:+.1f} deg: east "
                "and west of the longitude are swapped.",
            )
        )
    if own is None or told is None:
        return found
    east, north = wrapped(told.longitude_deg - own.longitude_deg), told.latitude_deg
    if abs(east) > PLACE_DEG and abs(wrapped(told.longitude_deg + own.longitude_deg)) > PLACE_DEG:
        found.append(
            Cause(
                "site longitude",
                "Set the longitude on the hand control, then align again.",
                _all(sightings, lambda s: _east(s, east)),
                0.1,
                witness=CONFIRMED,
                evidence=f"The mount's longitude is {east:+.1f} deg too far east.",
            )
        )
    if abs(north - own.latitude_deg) > PLACE_DEG and north * own.latitude_deg >= 0.0:
        found.append(
            Cause(
                "site latitude",
                "Set the latitude on the hand control, then align again.",
                _all(sightings, lambda s: _wrong_latitude(s, own, north)),
                0.1,
                witness=CONFIRMED,
                evidence=f"The mount's latitude is {north:.1f} deg instead of {own.latitude_deg:.1f} deg.",
            )
        )
    return found


def sides(sightings: Sequence[MountSighting]) -> list[Cause]:
    """The mount takes its telescope to be on the other side of the pier: 12 h away."""
    return [
        Cause(
            "pier side",
            "Slew to the other side of the meridian and back, or start again from home.",
            _all(sightings, lambda s: ((s.expected_deg[0] + 180.0) % 360.0, s.expected_deg[1])),
            0.05,
            evidence="Right ascension is off by 12 h with the declination right: the telescope is "
            "on the other side of the pier than the mount assumes.",
        )
    ]


def alignments(sightings: Sequence[MountSighting]) -> list[Cause]:
    """Still at home, or one offset everywhere."""
    found = []
    if any(s.aligned is False for s in sightings) or all(abs(s.said.dec_deg) > 89.5 for s in sightings):
        unaligned = any(s.aligned is False for s in sightings)
        found.append(
            Cause(
                "not aligned",
                "Align the mount, or sync it on a solved frame.",
                tuple(s.said_deg for s in sightings),
                0.3,
                freedom=2,
                witness=CONFIRMED * CONFIRMED if unaligned else CONFIRMED,
                evidence="The mount reports that it is not aligned."
                if unaligned
                else "The mount reports the pole, its home position.",
            )
        )
    if len(sightings) > 1:
        shifts = np.array([_shift(s) for s in sightings])
        ra, dec = shifts.mean(axis=0)
        found.append(
            Cause(
                "not aligned",
                "Sync it on a solved frame.",
                _all(sightings, lambda s: (s.expected_deg[0] + ra, s.expected_deg[1] + dec)),
                0.3,
                CONE_DEG,
                freedom=2,
                evidence=f"Both axes are off by the same angles everywhere, {ra:+.2f} and {dec:+.2f} deg.",
            )
        )
    return found


def cones(sightings: Sequence[MountSighting]) -> list[Cause]:
    """A tube not square to its axis: the offset in right ascension flips across the meridian."""
    side = np.array([_side(s) for s in sightings])
    if len(set(side.tolist()) - {0.0}) < 2 or not side.all():
        return []
    narrow = np.cos(np.radians([s.expected_deg[1] for s in sightings]))
    across = np.array([_shift(s)[0] for s in sightings]) * narrow
    cone = float((across * side).mean())

    def off(s: MountSighting) -> Degrees:
        ra, dec = s.expected_deg
        return (ra + cone * _side(s) / max(np.cos(np.radians(dec)), 0.05)) % 360.0, dec

    return [
        Cause(
            "cone error",
            "Shim the dovetail until both sides agree, or sync after every flip.",
            _all(sightings, off),
            0.15,
            CONE_DEG,
            freedom=1,
            evidence=f"The offset changes sign across the meridian, {abs(cone) * 60.0:.0f} arcmin on either side.",
        )
    ]


def _all(sightings: Sequence[MountSighting], say: Say) -> tuple[Degrees, ...]:
    return tuple(say(s) for s in sightings)


def _east(s: MountSighting, degrees: float) -> Degrees:
    """A mount whose sidereal time is ahead says a right ascension as much too large."""
    ra, dec = s.expected_deg
    return (ra + degrees) % 360.0, dec


def _shift(s: MountSighting) -> Degrees:
    """What the mount says too much, degrees along both axes."""
    there, said = s.expected_deg, s.said_deg
    return wrapped(said[0] - there[0]), said[1] - there[1]


def _side(s: MountSighting) -> float:
    """1 west of the meridian or on the pier's east side, -1 on the other, 0 when unknown."""
    if s.pier_side is not None:
        return 1.0 if s.pier_side is PierSide.EAST else -1.0
    if s.site is None:
        return 0.0
    return 1.0 if hour_angle_deg(s.expected_deg[0], s.site, s.time_utc) >= 0.0 else -1.0


def _wrong_latitude(s: MountSighting, own: Site, latitude_deg: float) -> Degrees:
    """A mount in altitude and azimuth, levelled and set north, that thinks of another latitude."""
    lst = sidereal_deg(own, s.time_utc)
    hour, dec = lst - s.expected_deg[0], s.expected_deg[1]
    meridian = unit_vectors(-hour, dec)  # x towards the equator on the meridian, z the pole
    turn = np.radians(latitude_deg - own.latitude_deg)
    c, n = np.cos(turn), np.sin(turn)
    x, y, z = meridian
    found = radec_deg(np.array([c * x - n * z, y, n * x + c * z]))
    return (found[0] + lst) % 360.0, found[1]


def _clock_off_s(sightings: Sequence[MountSighting]) -> float | None:
    """How far the mount's clock is ahead of the computer's, when it tells."""
    s = sightings[-1]
    if s.beliefs.time_utc is None:
        return None
    return (s.beliefs.time_utc - s.time_utc) / timedelta(seconds=1)


def _clock_witness(sightings: Sequence[MountSighting], wrong_s: float) -> float:
    off = _clock_off_s(sightings)
    if off is None:
        return 1.0
    return CONFIRMED if abs(off - wrong_s) < CLOCK_S else DENIED
