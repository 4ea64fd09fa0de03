"""Mounts with one thing wrong, by the terms of Wallace's TPOINT as exact rotations, with ERFA and nothing else.

Written by who has the manual of TPOINT and ERFA's, not from :mod:`kochab.pointing.disagreement`, whose input type is all
that is used of it. Conventions: hour angles west positive, azimuths from north over east; ``h, d`` (``a, e`` of a mount
in altitude and azimuth) are the axes' own readings, and a reading is turned into the tube's true direction by

- ``IH ID`` (``IA IE``): an angle added to either reading,
- ``CH`` (``CA``): the tube's angle to the plane across its second axis, which a German mount turns round at the meridian
  with the tube on the other side,
- ``ME MA`` (``AN AW``): the first axis' turn against the pole (the zenith) about the level line east-west, and about the
  line across both,
- ``compass``: the whole mount's turn about the vertical, whatever its kind: its north was a compass's.

ERFA's ``hd2ae`` and ``ae2hd`` turn equatorial and horizontal places into each other, ``rx ry rz s2c c2s`` are the
rotations, ``gst06a`` the sidereal time of clock and place believed, ``atic13`` the way to ICRS. Noise is normal, so many
arcmin on each axis of the sky. Half of the mounts tell what they believe of clock and site, half of those of a German
kind the side of the pier. A mount in altitude and azimuth always says that it is one.
"""

import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta

import erfa
import numpy as np

from kochab.core.frame import Site
from kochab.core.mount import Epoch, PierSide, Pointing, SiteReport
from kochab.pointing.disagreement import MountSighting, investigate

CASES, MOST_SIGHTINGS = 200, 5
NOISE_ARCMIN = 1.8
ROUGH_DEG = 0.1  # how well a mount is set up whose clock or place is wrong
APART_DEG = 25.0  # sightings are spread over the sky
NEEDS = {"cone error": 3, "polar axis": 3, "base tilt": 3, "compass azimuth": 2, "not aligned": 2}
"""Sightings that it takes to tell; with fewer the right word is none, or the right name all the same."""
CLOCKS = ("summer time", "time zone", "wrong day", "longitude sign", "hemisphere", "pier side", "compass azimuth")
FAULTS = ("", *CLOCKS, "epoch", "not aligned", "cone error", "polar axis", "base tilt")


@dataclass(slots=True)
class TpointMount:
    """Terms in degrees; the site, the one it believes, and by how much its clock is ahead."""

    site: Site
    believes: Site
    alt_azimuth: bool = False
    terms: dict[str, float] = field(default_factory=dict)
    clock: timedelta = timedelta(0)
    half_turn: bool = False
    mirrored: bool = False
    j2000: bool = False
    tells: bool = False
    tells_side: bool = False
    noise_arcmin: float = NOISE_ARCMIN


def make(fault: str, rng: np.random.Generator) -> TpointMount:
    """A random mount with this one fault."""
    latitude, longitude = (rng.choice([-1.0, 1.0], 2) * rng.uniform((15.0, 8.0), (62.0, 170.0))).tolist()
    site = Site(latitude, longitude)
    mount = TpointMount(site, site, alt_azimuth=fault == "base tilt" or (fault != "cone error" and rng.random() < 0.3))
    mount.tells, mount.tells_side = bool(rng.random() < 0.5), bool(rng.random() < 0.5)
    sign = float(rng.choice([-1.0, 1.0]))
    if fault in ("polar axis", "pier side"):
        mount.alt_azimuth = False
    if fault in CLOCKS:
        mount.terms = dict(zip(("I1", "I2", "M1", "M2"), rng.normal(0.0, ROUGH_DEG, 4).tolist(), strict=True))
    match fault:
        case "summer time":
            mount.clock = timedelta(hours=sign)
        case "time zone":
            mount.clock = timedelta(hours=sign * float(rng.integers(2, 12)))
        case "wrong day":
            mount.clock, mount.tells = timedelta(days=sign * float(rng.integers(1, 31))), True
        case "longitude sign":
            mount.believes = Site(latitude, -longitude)
        case "hemisphere":
            mount.mirrored, mount.believes = True, Site(-latitude, longitude)
        case "pier side":
            mount.half_turn = True
        case "compass azimuth":
            mount.terms["compass"] = sign * rng.uniform(2.0, 20.0)
        case "epoch":
            mount.j2000 = True
        case "not aligned":
            mount.terms = dict(
                zip(
                    ("I1", "I2"), (rng.choice([-1.0, 1.0], 2) * 10.0 ** rng.uniform(-0.5, 1.0, 2)).tolist(), strict=True
                )
            )
        case "cone error":
            mount.terms = {"C": sign * rng.uniform(10.0, 60.0) / 60.0} | _synced(rng)
        case "polar axis" | "base tilt":
            size, towards = 10.0 ** rng.uniform(np.log10(0.4), np.log10(4.0)), rng.uniform(0.0, 2.0 * np.pi)
            mount.terms = {"M1": size * np.cos(towards), "M2": size * np.sin(towards)} | _synced(rng)
    return mount


def _synced(rng: np.random.Generator) -> dict[str, float]:
    """Half of them are off in both axes besides, as by a sync on a star somewhere."""
    return dict(zip(("I1", "I2"), rng.normal(0.0, 0.5, 2).tolist(), strict=True)) if rng.random() < 0.5 else {}


def sightings(
    mount: TpointMount, count: int, rng: np.random.Generator, both_sides: bool = False
) -> list[MountSighting]:
    """Frames of one night, spread over the sky; ``both_sides``: the second across the meridian from the first."""
    begin = datetime(2026, 1, 1, tzinfo=UTC) + timedelta(days=float(rng.uniform(0.0, 365.0)))
    places: list[np.ndarray] = []
    hours: list[float] = []
    found: list[MountSighting] = []
    while len(found) < count:
        altitude, azimuth = np.arcsin(rng.uniform(np.sin(0.3), np.sin(1.35))), rng.uniform(0.0, 2.0 * np.pi)
        hour, dec = erfa.ae2hd(azimuth, altitude, np.radians(mount.site.latitude_deg))
        across = both_sides and len(hours) == 1 and np.sin(hour) * np.sin(hours[0]) > 0.0
        near = any(np.degrees(erfa.sepp(place, erfa.s2c(azimuth, altitude))) < APART_DEG for place in places)
        if abs(dec) > 1.45 or abs(np.sin(hour)) < 0.05 or across or near:
            continue
        places.append(erfa.s2c(azimuth, altitude))
        hours.append(float(hour))
        found.append(_sighting(mount, begin + timedelta(minutes=15 * len(found)), float(hour), float(dec), rng))
    return found


def _sighting(mount: TpointMount, time: datetime, hour: float, dec: float, rng: np.random.Generator) -> MountSighting:
    """One frame with the axes' readings where a faultless mount looks at this hour angle and declination."""
    latitude = np.radians(mount.site.latitude_deg)
    west = np.sin(hour) > 0.0
    first, second = erfa.hd2ae(hour, dec, latitude) if mount.alt_azimuth else (hour, dec)
    true_first, true_second = _tube(mount, first, second, 1.0 if west or mount.alt_azimuth else -1.0)
    compass = np.radians(mount.terms.get("compass", 0.0))
    if mount.alt_azimuth:
        true_hour, true_dec = erfa.ae2hd(true_first + compass, true_second, latitude)
    else:
        azimuth, altitude = erfa.hd2ae(true_first, true_second, latitude)
        true_hour, true_dec = erfa.ae2hd(azimuth + compass, altitude, latitude)
    jd, tt = 2440587.5 + time.timestamp() / 86400.0, 69.184 / 86400.0
    sidereal = erfa.gst06a(jd, 0.0, jd, tt) + np.radians(mount.site.longitude_deg)
    sky = erfa.atic13(sidereal - true_hour + erfa.eo06a(jd, tt), true_dec, jd, tt)[:2]
    # What it says, by its own clock and place.
    if mount.alt_azimuth:
        hour, dec = erfa.ae2hd(first, second, latitude)
    own = jd + mount.clock / timedelta(days=1)
    believed = erfa.gst06a(own, 0.0, own, tt) + np.radians(mount.believes.longitude_deg)
    east, north = np.radians(rng.normal(0.0, mount.noise_arcmin / 60.0, 2))
    says_ra = believed - hour + east / np.cos(dec) + np.pi * mount.half_turn
    says_dec = float(np.clip((-dec if mount.mirrored else dec) + north, -np.pi / 2, np.pi / 2))
    if mount.j2000:
        says_ra, says_dec = erfa.atic13(says_ra + erfa.eo06a(jd, tt), says_dec, jd, tt)[:2]
    said = Pointing(float(np.degrees(erfa.anp(says_ra))), float(np.degrees(says_dec)), Epoch.DATE)
    side = (PierSide.EAST if west else PierSide.WEST) if mount.tells_side and not mount.alt_azimuth else None
    beliefs = SiteReport(mount.believes, time + mount.clock) if mount.tells else SiteReport()
    kind = True if mount.alt_azimuth else False if mount.tells else None
    place = float(np.degrees(erfa.anp(sky[0]))), float(np.degrees(sky[1]))
    return MountSighting(place, said, time, mount.site, side, None, beliefs, kind)


def _tube(mount: TpointMount, first: float, second: float, side: float) -> tuple[float, float]:
    """The tube's true place by its mount's axes, in the same two angles as the readings."""
    first_index, second_index, cone, m_1, m_2 = np.radians(
        [mount.terms.get(n, 0.0) for n in ("I1", "I2", "C", "M1", "M2")]
    )
    along, across = (
        erfa.s2c(-(first + first_index), second + second_index),
        erfa.s2c(-(first + first_index) + np.pi / 2, 0.0),
    )
    tube = np.cos(cone) * along + np.sin(side * cone) * across
    tilted = erfa.rx(m_2, erfa.ry(m_1, np.eye(3))) @ tube
    theta, phi = erfa.c2s(tilted)
    return float(-theta), float(phi)


@dataclass(frozen=True, slots=True)
class Verdict:
    """What was named in one case, by so many sightings."""

    fault: str
    count: int
    cause: str

    @property
    def right(self) -> bool:
        """The fault is named, or nothing where it cannot be told."""
        return self.cause == self.fault or (self.cause == "" and self.count < NEEDS.get(self.fault, 1))

    @property
    def wrong(self) -> bool:
        """Another one is named."""
        return self.cause not in ("", self.fault)


def verdicts(fault: str, cases: int, seed: int = 1) -> Iterator[Verdict]:
    """One to five sightings in turn."""
    for case in range(cases):
        rng, count = np.random.default_rng([seed, FAULTS.index(fault), case]), 1 + case % MOST_SIGHTINGS
        seen = sightings(make(fault, rng), count, rng, fault == "cone error")
        yield Verdict(fault, count, investigate(seen).cause)


def main() -> None:
    """Tell how often the one thing that is wrong is named: ``python -m tests.pointing.tpoint_mounts [CASES]``."""
    cases = int(sys.argv[1]) if len(sys.argv) > 1 else CASES
    for fault in FAULTS:
        found = list(verdicts(fault, cases))
        right, wrong = (100.0 * sum(getattr(one, what) for one in found) / cases for what in ("right", "wrong"))
        others = Counter((one.count, one.cause) for one in found if not one.right)
        print(
            f"{fault or 'healthy':16} {right:5.1f} % right, {wrong:4.1f} % wrong, of {cases} {dict(others)}", flush=True
        )


if __name__ == "__main__":
    main()
