"""Mounts with one thing wrong, made from axes and rotations with ERFA: the truth for the detective.

Nothing here is shared with :mod:`kochab.pointing.disagreement`: both axes are turned, the tube's place
follows from rotations, and what the mount says from its own clock, site and settings.
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from typing import Any

import erfa
import numpy as np
from scipy.spatial.transform import Rotation

from kochab.core.frame import Site
from kochab.core.mount import Epoch, PierSide, Pointing, SiteReport
from kochab.pointing.disagreement import MountSighting, investigate

CASES, MOST_SIGHTINGS = 200, 5
NOISE_ARCMIN = 2.0
ROUGH_DEG = 10.0 / 60.0  # how well a mount is set up whose clock, site or side is wrong
FROM = {"not aligned": 2, "cone error": 2, "polar axis": 3, "base tilt": 3}  # sightings it takes to tell
TELLS = ("clock", "site longitude", "site latitude")  # only a mount that tells its clock and site
ALT_AZIMUTH = ("site latitude", "base tilt")
FAULTS = (
    "",
    *("summer time", "time zone", "clock", "longitude sign", "site longitude", "site latitude", "hemisphere"),
    *("pier side", "epoch", "not aligned", "cone error", "polar axis", "base tilt"),
)


@dataclass(slots=True)
class FaultyMount:
    """A mount and what it believes; angles in degrees, noise in arcmin on the sky."""

    site: Site
    believes: Site
    noise: float
    clock: timedelta = timedelta(0)
    base: Rotation | None = None  # of the whole mount against the ground or the pole
    cone: float = 0.0
    offset: tuple[float, float] = (0.0, 0.0)  # of both axes' readings
    alt_azimuth: bool = False
    mirrored: str = ""
    half_turn: bool = False
    epoch: Epoch = Epoch.DATE
    read_as: Epoch = Epoch.DATE
    tells: bool = False
    tells_side: bool = False


def make(fault: str, rng: np.random.Generator) -> FaultyMount:
    """A random mount with this one fault."""
    latitude = rng.choice([-1.0, 1.0]) * rng.uniform(20.0, 60.0)
    site = Site(float(latitude), float(rng.choice([-1.0, 1.0]) * rng.uniform(5.0, 160.0)))
    tells, side = rng.random(2) < 0.5
    alt_azimuth = fault in ALT_AZIMUTH or (fault == "" and rng.random() < 0.3)
    mount = FaultyMount(site, site, rng.uniform(0.0, NOISE_ARCMIN), alt_azimuth=alt_azimuth)
    mount.tells, mount.tells_side = bool(tells or fault in TELLS), bool(side and not alt_azimuth)
    sign, size = float(rng.choice([-1.0, 1.0])), 10.0 ** rng.uniform(np.log10(0.25), np.log10(3.0))
    if fault in (*FAULTS[1:7], "hemisphere", "pier side"):
        mount.base, mount.offset = _tilt(rng, rng.rayleigh(ROUGH_DEG)), tuple(rng.normal(0.0, ROUGH_DEG, 2))
    match fault:
        case "summer time":
            mount.clock = timedelta(hours=sign)
        case "time zone":
            mount.clock = timedelta(hours=sign * float(rng.integers(2, 12)))
        case "clock":
            mount.clock = timedelta(minutes=sign * float(rng.uniform(4.0, 56.0)))
        case "longitude sign":
            mount.believes = replace(site, longitude_deg=-site.longitude_deg)
        case "site longitude":
            mount.believes = replace(site, longitude_deg=site.longitude_deg + sign * rng.uniform(1.5, 20.0))
        case "site latitude":
            mount.believes = replace(site, latitude_deg=site.latitude_deg + sign * rng.uniform(1.5, 8.0))
        case "hemisphere":
            mount.mirrored = str(rng.choice(["dec", "both"]))
            mount.believes = replace(site, latitude_deg=-site.latitude_deg)
        case "pier side":
            mount.half_turn = True
        case "epoch":
            epochs = [Epoch.DATE, Epoch.J2000]
            mount.epoch, mount.read_as = epochs[:: int(sign)]
        case "not aligned":
            mount.offset = tuple(rng.choice([-1.0, 1.0], 2) * 10.0 ** rng.uniform(-0.7, 1.0, 2))
        case "cone error":
            mount.cone = sign * rng.uniform(10.0, 60.0) / 60.0
            mount.offset = tuple(rng.normal(0.0, 0.5, 2)) if rng.random() < 0.5 else (0.0, 0.0)
        case "polar axis" | "base tilt":
            mount.base = _tilt(rng, size)
            mount.offset = tuple(rng.normal(0.0, 0.5, 2)) if rng.random() < 0.5 else (0.0, 0.0)
    return mount


def _tilt(rng: np.random.Generator, size_deg: float) -> Rotation:
    """A turn by this angle about an axis across the mount's own."""
    towards = rng.uniform(0.0, 2.0 * np.pi)
    return Rotation.from_rotvec(np.radians(size_deg) * np.array([np.cos(towards), np.sin(towards), 0.0]))


def sightings(mount: FaultyMount, count: int, rng: np.random.Generator, sides: bool = False) -> list[MountSighting]:
    """Frames in one night; with ``sides`` the second is on the other side of the meridian than the first."""
    begin = datetime(2026, 1, 1, tzinfo=UTC) + timedelta(days=rng.uniform(0.0, 365.0))
    out: list[MountSighting] = []
    west: list[bool] = []
    while len(out) < count:
        east_of = not west[0] if sides and len(west) == 1 else bool(rng.random() < 0.5)
        seen = _sighting(mount, begin + timedelta(minutes=float(20 * len(out))), east_of, rng)
        if seen is not None:
            out.append(seen)
            west.append(east_of)
    return out


def _sighting(mount: FaultyMount, time: datetime, west: bool, rng: np.random.Generator) -> MountSighting | None:
    """One frame: the axes' readings, the tube's true place, and what the mount says; None below 15 deg."""
    latitude = np.radians(mount.site.latitude_deg)
    hour = (1.0 if west else -1.0) * rng.uniform(0.1, 1.4)
    dec = np.arcsin(rng.uniform(-0.9, 0.97)) * np.sign(latitude)
    azimuth, altitude = erfa.hd2ae(hour, dec, latitude)
    if not np.radians(15.0) < altitude < np.radians(80.0):
        return None
    # Hour angles and azimuths (north over east) run clockwise from above.
    first, second = (azimuth, altitude) if mount.alt_azimuth else (hour, dec)
    flip = mount.alt_azimuth or west  # a tube on the east side of the pier looks west
    tube = Rotation.from_euler("yz", [-second, -first]).apply([1.0, 0.0, 0.0])
    across = np.array([-np.sin(-first), np.cos(-first), 0.0]) * (1.0 if flip else -1.0)
    cone = np.radians(mount.cone)
    tube = np.cos(cone) * tube - np.sin(cone) * across
    tube = mount.base.apply(tube) if mount.base is not None else tube
    first_true, second_true = -np.arctan2(tube[1], tube[0]), np.arcsin(tube[2])
    if mount.alt_azimuth:
        first_true, second_true = erfa.ae2hd(first_true, second_true, latitude)
    # The place on the sky, ICRS.
    jd, tt = 2440587.5 + time.timestamp() / 86400.0, 69.184 / 86400.0
    sidereal = erfa.gst06a(jd, 0.0, jd, tt) + np.radians(mount.site.longitude_deg)
    icrs = erfa.atic13(sidereal - first_true + erfa.eo06a(jd, tt), second_true, jd, tt)[:2]
    # What the mount says.
    first, second = np.radians(mount.offset) + np.array([first, second])
    if mount.alt_azimuth:
        first, second = erfa.ae2hd(first, second, np.radians(mount.believes.latitude_deg))
    own = jd + mount.clock / timedelta(days=1)
    believed = erfa.gst06a(own, 0.0, own, tt) + np.radians(mount.believes.longitude_deg)
    if mount.mirrored:
        first, second = (-first if mount.mirrored == "both" else first), -second
    east, north = np.radians(rng.normal(0.0, mount.noise / 60.0, 2))
    ra, dec = believed - first + east / np.cos(second) + np.pi * mount.half_turn, second + north
    if mount.epoch is Epoch.J2000:
        ra, dec = erfa.atic13(ra + erfa.eo06a(jd, tt), dec, jd, tt)[:2]
    dec = np.clip(dec, -np.pi / 2, np.pi / 2)
    said = Pointing(float(np.degrees(erfa.anp(ra))), float(np.degrees(dec)), mount.read_as)
    report = SiteReport(mount.believes, time + mount.clock) if mount.tells else SiteReport()
    side = (PierSide.EAST if west else PierSide.WEST) if mount.tells_side else None
    more: dict[str, Any] = {"alt_azimuth": mount.alt_azimuth} if mount.alt_azimuth or mount.tells else {}
    sky = float(np.degrees(erfa.anp(icrs[0]))), float(np.degrees(icrs[1]))
    return MountSighting(sky, said, time, mount.site, side, None, report, **more)


def verdicts(fault: str, cases: int, seed: int = 1) -> Iterator[tuple[int, str]]:
    """The number of sightings of each case, and the cause that is named."""
    for case in range(cases):
        rng = np.random.default_rng([seed, FAULTS.index(fault), case])
        count = FROM.get(fault, 1) + case % (MOST_SIGHTINGS + 1 - FROM.get(fault, 1))
        seen = sightings(make(fault, rng), count, rng, fault == "cone error")
        yield count, investigate(seen).cause


def main() -> None:
    """Tell how often the one thing that is wrong is named: ``python -m tests.pointing.faulty_mounts [CASES]``."""
    cases = int(sys.argv[1]) if len(sys.argv) > 1 else CASES
    for fault in FAULTS:
        named = [cause for _, cause in verdicts(fault, cases)]
        right, wrong = (100.0 * n / cases for n in (named.count(fault), sum(c not in ("", fault) for c in named)))
        print(f"{fault or 'healthy':16} {right:5.1f} % right, {wrong:4.1f} % wrong, of {cases}", flush=True)


if __name__ == "__main__":
    main()
