"""What can be wrong with a mount's idea of the sky, one cause a function."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import timedelta
from functools import partial

import numpy as np

from app.core.attitude import radec_deg, unit_vectors
from app.core.earth import SIDEREAL_DEG_S
from app.core.hint import Site
from app.core.mount import Epoch, PierSide
from app.mounts.epoch import to_mount_epoch
from app.mounts.sky_frame import hour_angle_deg, sidereal_deg, wrapped
from app.solve.disagreement import TIGHT_DEG, Cause, Degrees, Sighting

SIDEREAL_DEG_H = 3600.0 * SIDEREAL_DEG_S
CLOCK_S, PLACE_DEG = 60.0, 0.2  # within these a mount's own clock and site are right
TOLD, DENIED = 20.0, 0.02  # what a witness is worth
CONE_DEG = 5.0 / 60.0

Say = Callable[[Sighting], Degrees]


def causes(sightings: Sequence[Sighting]) -> list[Cause]:
    """Every cause that can be asked of these sightings."""
    found = [*clocks(sightings), *epochs(sightings), *hemispheres(sightings)]
    found += [*sites(sightings), *sides(sightings), *alignments(sightings), *cones(sightings)]
    return [cause for cause in found if cause.would_say]


def clocks(sightings: Sequence[Sighting]) -> list[Cause]:
    """Summer time and other whole hours; and what the mount's own clock is seen to be off."""
    found = []
    for hours in (h for h in range(-11, 13) if h):
        summer = abs(hours) == 1
        ahead = "ahead" if hours > 0 else "behind"
        found.append(
            Cause(
                "summer time" if summer else "time zone",
                "Set summer time on the hand control as it is tonight, then align again."
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
                witness=TOLD,
                evidence=f"The mount's own clock is {abs(off) / 60.0:.0f} min "
                f"{'ahead of' if off > 0 else 'behind'} the computer's.",
            )
        )
    return found


def epochs(sightings: Sequence[Sighting]) -> list[Cause]:
    """J2000 taken for the equator of date, or the reverse: some 20 arcmin."""

    def other(s: Sighting) -> Degrees:
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
            evidence=f"The mount speaks in {really} and is taken to speak in that of "
            f"{'date' if own is Epoch.DATE else 'J2000'}.",
        )
    ]


def hemispheres(sightings: Sequence[Sighting]) -> list[Cause]:
    """South taken for north: the declination is mirrored, perhaps the hour angle too."""
    told = [s.beliefs.site for s in sightings if s.beliefs.site is not None]
    own = sightings[-1].site
    witness = 1.0
    if told and own is not None and abs(own.latitude_deg) > 1.0:
        opposite = told[-1].latitude_deg * own.latitude_deg < 0.0
        witness = TOLD if opposite else DENIED

    def turned(s: Sighting) -> Degrees:
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
        evidence="The declination is mirrored: the mount takes itself to be on the other side of "
        "the equator.",
    )
    if all(s.site is None for s in sightings):
        return [base]
    return [base, replace(base, would_say=_all(sightings, turned), weight=0.03)]


def sites(sightings: Sequence[Sighting]) -> list[Cause]:
    """East taken for west, and a site that the mount itself tells to be another."""
    own, told = sightings[-1].site, sightings[-1].beliefs.site
    found: list[Cause] = []
    if own is not None and abs(own.longitude_deg) > 1.0:
        off = wrapped(-2.0 * own.longitude_deg)
        witness = 1.0
        if told is not None:
            opposite = abs(wrapped(told.longitude_deg + own.longitude_deg)) < PLACE_DEG
            witness = TOLD if opposite else DENIED
        found.append(
            Cause(
                "longitude sign",
                "Change east and west of the longitude on the hand control, then align again.",
                _all(sightings, lambda s: _east(s, off)),
                0.08,
                witness=witness,
                evidence=f"Right ascension is off by twice the longitude, {off:+.1f} deg: east is "
                "taken for west.",
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
                witness=TOLD,
                evidence=f"The mount takes itself to be {east:+.1f} deg further east.",
            )
        )
    if abs(north - own.latitude_deg) > PLACE_DEG and north * own.latitude_deg >= 0.0:
        found.append(
            Cause(
                "site latitude",
                "Set the latitude on the hand control, then align again.",
                _all(sightings, lambda s: _tilted(s, own, north)),
                0.1,
                witness=TOLD,
                evidence=f"The mount takes its latitude to be {north:.1f} deg, it is "
                f"{own.latitude_deg:.1f}.",
            )
        )
    return found


def sides(sightings: Sequence[Sighting]) -> list[Cause]:
    """The mount takes its telescope to be on the other side of the pier: 12 h away."""
    return [
        Cause(
            "pier side",
            "Slew to the other side of the meridian and back, or begin again from home.",
            _all(sightings, lambda s: ((s.expected_deg[0] + 180.0) % 360.0, s.expected_deg[1])),
            0.05,
            evidence="Right ascension is off by 12 h with the declination right: the telescope is "
            "on the other side of its pier than the mount believes.",
        )
    ]


def alignments(sightings: Sequence[Sighting]) -> list[Cause]:
    """Still at home, or one offset everywhere."""
    found = []
    if any(s.aligned is False for s in sightings) or all(
        abs(s.said.dec_deg) > 89.5 for s in sightings
    ):
        unaligned = any(s.aligned is False for s in sightings)
        found.append(
            Cause(
                "not aligned",
                "Align the mount, or sync it on a solved frame.",
                tuple(s.said_deg for s in sightings),
                0.3,
                freedom=2,
                witness=TOLD * TOLD if unaligned else TOLD,
                evidence="The mount says itself that it is not aligned."
                if unaligned
                else "The mount says that it points at the pole, as it does at home.",
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
                evidence=f"Both axes are off by the same angles everywhere, {ra:+.2f} and "
                f"{dec:+.2f} deg.",
            )
        )
    return found


def cones(sightings: Sequence[Sighting]) -> list[Cause]:
    """A tube not square to its axis: the offset in right ascension flips across the meridian."""
    side = np.array([_side(s) for s in sightings])
    if len(set(side.tolist()) - {0.0}) < 2 or not side.all():
        return []
    narrow = np.cos(np.radians([s.expected_deg[1] for s in sightings]))
    across = np.array([_shift(s)[0] for s in sightings]) * narrow
    cone = float((across * side).mean())

    def off(s: Sighting) -> Degrees:
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
            evidence=f"The offset changes sign across the meridian, {abs(cone) * 60.0:.0f} arcmin "
            "on either side.",
        )
    ]


def _all(sightings: Sequence[Sighting], say: Say) -> tuple[Degrees, ...]:
    return tuple(say(s) for s in sightings)


def _east(s: Sighting, degrees: float) -> Degrees:
    """A mount whose sidereal time is ahead says a right ascension as much too large."""
    ra, dec = s.expected_deg
    return (ra + degrees) % 360.0, dec


def _shift(s: Sighting) -> Degrees:
    """What the mount says too much, degrees along both axes."""
    there, said = s.expected_deg, s.said_deg
    return wrapped(said[0] - there[0]), said[1] - there[1]


def _side(s: Sighting) -> float:
    """1 west of the meridian or on the pier's east side, -1 on the other, 0 when unknown."""
    if s.pier_side is not None:
        return 1.0 if s.pier_side is PierSide.EAST else -1.0
    if s.site is None:
        return 0.0
    return 1.0 if hour_angle_deg(s.expected_deg[0], s.site, s.time_utc) >= 0.0 else -1.0


def _tilted(s: Sighting, own: Site, latitude_deg: float) -> Degrees:
    """A mount in altitude and azimuth, levelled and set north, that thinks of another latitude."""
    lst = sidereal_deg(own, s.time_utc)
    hour, dec = lst - s.expected_deg[0], s.expected_deg[1]
    meridian = unit_vectors(-hour, dec)  # x towards the equator on the meridian, z the pole
    turn = np.radians(latitude_deg - own.latitude_deg)
    c, n = np.cos(turn), np.sin(turn)
    x, y, z = meridian
    found = radec_deg(np.array([c * x - n * z, y, n * x + c * z]))
    return (found[0] + lst) % 360.0, found[1]


def _clock_off_s(sightings: Sequence[Sighting]) -> float | None:
    """How far the mount's clock is ahead of the computer's, when it tells."""
    s = sightings[-1]
    if s.beliefs.time_utc is None:
        return None
    return (s.beliefs.time_utc - s.time_utc) / timedelta(seconds=1)


def _clock_witness(sightings: Sequence[Sighting], wrong_s: float) -> float:
    off = _clock_off_s(sightings)
    if off is None:
        return 1.0
    return TOLD if abs(off - wrong_s) < CLOCK_S else DENIED
