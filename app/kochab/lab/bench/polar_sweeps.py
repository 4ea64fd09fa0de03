"""Sweeps of a mount under erfa's sky, made without anything of ``kochab.polar``.

A rigid mount stands on the ground: a polar axis fixed in E, N, U; a declination axis at right angles to it; a camera
on that. Where a pixel looks is geometry; which catalogue place lies there is ``erfa.atoc13`` (observed place to ICRS:
refraction, aberration, nutation, precession). What goes wrong (Dec moved, a kicked tripod, a turned camera, a flip, a
wrong clock, a wrong site) happens to the mount, or to what is said about it, as it does at night; the answer that is
right afterwards is where the axis points now, after the last frame.
"""

import datetime as dt
from collections.abc import Callable
from dataclasses import dataclass, replace

import erfa
import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import ARCSEC, cross_product

Random = np.random.Generator

ARCMIN = np.pi / 180 / 60
DARK_DEG = -12.0  # of the Sun: nautical twilight has ended


@dataclass(frozen=True)
class Place:
    """Where the mount stands and what air it looks through."""

    latitude_deg: float
    longitude_deg: float
    height_m: float = 200.0
    pressure_hpa: float = 990.0
    temperature_c: float = 10.0
    humidity: float = 0.5

    def erfa_site(self) -> tuple[float, ...]:
        """What erfa wants after UTC and dUT1: place, polar motion, air, wavelength (visible light)."""
        return (
            *np.radians((self.longitude_deg, self.latitude_deg)),
            self.height_m,
            0.0,
            0.0,
            self.pressure_hpa,
            self.temperature_c,
            self.humidity,
            0.55,
        )


def julian_dates(when: dt.datetime) -> tuple[float, float]:
    """The two parts of a UTC date as erfa counts it."""
    seconds = when.second + when.microsecond * 1e-6
    whole, part = erfa.dtf2d("UTC", when.year, when.month, when.day, when.hour, when.minute, seconds)
    return float(whole), float(part)


def catalogue_places(enu: Floats, when: dt.datetime, place: Place) -> Floats:
    """ICRS unit vectors (N, 3) of what is observed in directions (N, 3; E, N, U) at a moment, UTC."""
    azimuth = np.arctan2(enu[:, 0], enu[:, 1])
    zenith_distance = np.arccos(np.clip(enu[:, 2], -1, 1))
    moment, _ = erfa.apco13(*julian_dates(when), 0.0, *place.erfa_site())
    ra, dec = erfa.aticq(*erfa.atoiq("A", azimuth, zenith_distance, moment), moment)
    return np.asarray(erfa.s2c(ra, dec))


def observed_places(icrs: Floats, when: dt.datetime, place: Place) -> Floats:
    """East, north, up of where catalogue places (N, 3) are observed: the way back, by erfa.atco13."""
    ra, dec = erfa.c2s(icrs)
    moment, _ = erfa.apco13(*julian_dates(when), 0.0, *place.erfa_site())
    azimuth, zenith_distance, *_ = erfa.atioq(*erfa.atciqz(ra, dec, moment), moment)
    return np.stack(
        (np.sin(azimuth) * np.sin(zenith_distance), np.cos(azimuth) * np.sin(zenith_distance), np.cos(zenith_distance)),
        axis=-1,
    )


def sun_altitude_deg(place: Place, when: dt.datetime) -> float:
    """How high the Sun stands, without refraction."""
    sun = -erfa.epv00(*julian_dates(when))[0]["p"]
    up = observed_places((sun / np.linalg.norm(sun))[None], when, replace(place, pressure_hpa=0.0))
    return float(np.degrees(np.arcsin(up[0, 2])))


def refracted_pole(place: Place) -> Floats:
    """E, N, U of the refracted pole above the horizon by Bennett's formula (1982): 2 arcsec from 20 deg on."""
    altitude_deg = abs(place.latitude_deg)
    air = place.pressure_hpa / 1010 * 283 / (273 + place.temperature_c)
    for _ in range(3):  # Bennett's formula takes the apparent altitude
        arcmin = air / np.tan(np.radians(altitude_deg + 7.31 / (altitude_deg + 4.4)))
        altitude_deg = abs(place.latitude_deg) + arcmin / 60
    altitude = np.radians(altitude_deg)
    return np.array((0.0, np.copysign(np.cos(altitude), place.latitude_deg), np.sin(altitude)))


def turned(axis: Floats, angle: float) -> Floats:
    """The matrix that turns by ``angle`` (rad) about the unit vector ``axis``, right handed (Rodrigues)."""
    x, y, z = axis
    cross = np.array(((0, -z, y), (z, 0, -x), (-y, x, 0)))
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


@dataclass(frozen=True)
class Rig:
    """A pinhole camera: pixels across, down, and the focal length in pixels."""

    width: int
    height: int
    focal_px: float

    def directions(self, xy_px: Floats) -> Floats:
        """Unit vectors (N, 3) of pixels in camera axes: x right, y down, z out."""
        centre = (np.array((self.width, self.height)) - 1) / 2
        rays = np.column_stack(((xy_px - centre) / self.focal_px, np.ones(len(xy_px))))
        return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


@dataclass(frozen=True)
class Mount:
    """A German mount: how its base stands (base axes to E, N, U; z is the polar axis) and how the camera sits on it."""

    base: Floats
    camera: Floats  # camera axes to the tube's: z out, with cone and roll

    @property
    def axis(self) -> Floats:
        """East, north, up of the polar axis, towards the sky."""
        return np.asarray(self.base[:, 2])

    def attitude(self, ra_turn: float, dec_turn: float) -> Floats:
        """Camera axes to east, north, up with the axes turned so far (rad). Dec 90 deg looks along the polar axis."""
        _, y, z = np.eye(3)
        ra = turned(z, ra_turn)
        dec = turned(y, np.pi / 2 - dec_turn)
        return np.asarray(self.base @ ra @ dec @ self.camera)

    def kicked(self, turn_axis: Floats, angle: float) -> "Mount":
        """The same mount with its tripod or a bolt moved by ``angle`` about ``turn_axis`` (east, north, up)."""
        return replace(self, base=turned(turn_axis, angle) @ self.base)

    def camera_turned(self, angle: float) -> "Mount":
        """The same mount with the camera turned in its drawtube by ``angle``."""
        return replace(self, camera=self.camera @ turned(np.array((0.0, 0.0, 1.0)), angle))

    def camera_tilted(self, way_deg: float, angle: float) -> "Mount":
        """The same mount with the camera knocked sideways on the tube by ``angle``."""
        way = np.radians(way_deg)
        return replace(self, camera=turned(np.array((np.cos(way), np.sin(way), 0.0)), angle) @ self.camera)


def mount_at(place: Place, away: float, towards: float, camera: Floats) -> Mount:
    """A mount whose axis stands beside the refracted pole.

    Parameters
    ----------
    place : Place
        Where it stands, and the air there.
    away : float
        How far from the pole, radians.
    towards : float
        Position angle there, radians.
    camera : Floats
        Rotation (3, 3) of the camera on the tube.
    """
    pole = refracted_pole(place)
    east = np.array((1.0, 0.0, 0.0))
    aside = turned(pole, towards) @ east
    axis = turned(aside, away) @ pole
    x = cross_product(np.array((0.0, 0.0, 1.0)), axis)  # level, so that a turn of 0 has the tube at the meridian's side
    x /= np.linalg.norm(x)
    return Mount(np.column_stack((x, cross_product(axis, x), axis)), camera)


@dataclass(frozen=True)
class Exposure:
    """One exposure: the mount as it then was, how its axes stood, when, and when the frame's header says it was."""

    mount: Mount
    ra_turn: float
    dec_turn: float
    when: dt.datetime
    stated: dt.datetime

    @property
    def attitude(self) -> Floats:
        """Camera axes to east, north, up."""
        return self.mount.attitude(self.ra_turn, self.dec_turn)


@dataclass(frozen=True)
class Sweep:
    """Exposures in the order of the night, with the place where they were taken and the place that is said."""

    place: Place
    stated_place: Place
    rig: Rig
    exposures: tuple[Exposure, ...]
    noise_px: float

    @property
    def axis(self) -> Floats:
        """Where the axis points after the last exposure: what the bolts must be turned by."""
        return self.exposures[-1].mount.axis

    def away_arcsec(self, axis: Floats) -> float:
        """How far a found axis (east, north, up) lies from the true one."""
        return float(np.arctan2(np.linalg.norm(cross_product(axis, self.axis)), axis @ self.axis)) / ARCSEC

    def is_dark(self) -> bool:
        """Whether the Sun is below the horizon by what an evening needs, from the first exposure to the last."""
        return all(sun_altitude_deg(self.place, shot.when) < DARK_DEG for shot in self.exposures)

    def lowest_deg(self) -> float:
        """The lowest altitude of a boresight in the sweep."""
        return float(min(np.degrees(np.arcsin(shot.attitude[2, 2])) for shot in self.exposures))

    def stars(self, index: int, rng: Random, count: int = 60) -> tuple[Floats, Floats]:
        """Pixels (N, 2), with noise, and ICRS places (N, 3) of ``count`` stars on one exposure."""
        shot = self.exposures[index]
        size = np.array((self.rig.width, self.rig.height))
        xy = rng.uniform(0, 1, (count, 2)) * (size - 1)
        enu = self.rig.directions(xy) @ shot.attitude.T
        return xy + rng.normal(0, self.noise_px, xy.shape), catalogue_places(enu, shot.when, self.place)


def random_place(rng: Random) -> Place:
    """A site between the latitudes where people live, with ordinary air."""
    latitude = rng.uniform(22, 60) * rng.choice((-1, 1), p=(0.35, 0.65))
    height = rng.uniform(0, 1500)
    return Place(
        latitude,
        rng.uniform(-180, 180),
        height,
        1013 * np.exp(-height / 8400),
        rng.uniform(-5, 25),
        rng.uniform(0.2, 0.9),
    )


def random_rig(rng: Random) -> Rig:
    """A camera from a guide scope (about 1.5 deg wide) to a lens (about 14 deg)."""
    width_deg = np.exp(rng.uniform(np.log(1.5), np.log(14)))
    width, height = ((1280, 960), (1936, 1216), (3096, 2080))[rng.integers(3)]
    return Rig(width, height, width / 2 / np.tan(np.radians(width_deg) / 2))


def random_sweep(rng: Random, frames: int | None = None, turn_deg: float | None = None) -> Sweep:
    """A healthy sweep: RA turned in equal steps, all frames above 25 deg, the axis 2 arcmin to 3 deg off."""
    while True:
        place = random_place(rng)
        frames_now = frames or int(rng.integers(3, 8))
        span = np.radians(turn_deg or rng.uniform(35, 90))
        away = np.radians(np.exp(rng.uniform(np.log(2 / 60), np.log(3))))
        camera = turned(np.array((0.0, 0.0, 1.0)), rng.uniform(0, 2 * np.pi))
        camera = turned(np.array((1.0, 0.0, 0.0)), rng.normal(0, np.radians(0.5))) @ camera
        mount = mount_at(place, away, rng.uniform(0, 2 * np.pi), camera)
        dec = np.radians(rng.uniform(10, 85))
        first = rng.uniform(0, 2 * np.pi)
        turns = first + np.linspace(0, span, frames_now) * rng.choice((-1, 1))
        start = dt.datetime(2024, 1, 1, tzinfo=dt.UTC) + dt.timedelta(minutes=int(rng.integers(0, 2 * 365 * 1440)))
        gap_s = rng.uniform(15, 60)
        times = [start + dt.timedelta(seconds=float(gap_s * k)) for k in range(frames_now)]
        shots = tuple(Exposure(mount, turn, dec, when, when) for turn, when in zip(turns, times, strict=True))
        sweep = Sweep(place, place, random_rig(rng), shots, noise_px=rng.uniform(0.1, 0.4))
        if sweep.lowest_deg() > 25 and sun_altitude_deg(place, start) < DARK_DEG:
            return sweep


def _from(sweep: Sweep, first: int, change: Callable[[Exposure], Exposure]) -> Sweep:
    """The sweep with ``change(exposure)`` made to every exposure from ``first`` on."""
    shots = tuple(change(shot) if index >= first else shot for index, shot in enumerate(sweep.exposures))
    return replace(sweep, exposures=shots)


def with_dec_moved(sweep: Sweep, rng: Random, arcsec: float | None = None, first: int | None = None) -> Sweep:
    """Dec slips by up to a degree between two frames.

    Parameters
    ----------
    sweep : Sweep
        The sweep that is spoilt.
    rng : Random
        Draws what is not given.
    arcsec : float or None
        How far Dec slips; None: drawn.
    first : int or None
        The first frame after it; None: drawn.
    """
    first = first or int(rng.integers(1, len(sweep.exposures)))
    move = (arcsec or np.exp(rng.uniform(np.log(200), np.log(3600)))) * ARCSEC * rng.choice((-1, 1))
    return _from(sweep, first, lambda shot: replace(shot, dec_turn=shot.dec_turn + move))


def with_kick(sweep: Sweep, rng: Random, arcmin: float | None = None, first: int | None = None) -> Sweep:
    """A foot hits the tripod, or a hand a bolt: the whole mount moves by 5 to 60 arcmin about a direction of chance.

    Parameters
    ----------
    sweep : Sweep
        The sweep that is spoilt.
    rng : Random
        Draws what is not given.
    arcmin : float or None
        How far the mount moves; None: drawn.
    first : int or None
        The first frame after it; None: drawn.
    """
    first = first or int(rng.integers(1, len(sweep.exposures)))
    turn_axis = rng.normal(size=3)
    turn_axis /= np.linalg.norm(turn_axis)
    axis = sweep.axis
    turn_axis = turn_axis - (turn_axis @ axis) * axis  # what turns about the axis itself is RA, and harms nothing
    turn_axis /= np.linalg.norm(turn_axis)
    angle = (arcmin or rng.uniform(5, 60)) * ARCMIN
    return _from(sweep, first, lambda shot: replace(shot, mount=shot.mount.kicked(turn_axis, angle)))


def with_bolt(sweep: Sweep, rng: Random, arcmin: float | None = None, first: int | None = None) -> Sweep:
    """Somebody turns one bolt among the frames: azimuth (about the vertical), or altitude (about a level line).

    Parameters
    ----------
    sweep : Sweep
        The sweep that is spoilt.
    rng : Random
        Draws what is not given.
    arcmin : float or None
        How far the bolt moves the axis; None: drawn.
    first : int or None
        The first frame after it; None: drawn.
    """
    first = first or int(rng.integers(1, len(sweep.exposures)))
    up = np.array((0.0, 0.0, 1.0))
    across = cross_product(up, sweep.axis)
    turn_axis = up if rng.random() < 0.5 else across / np.linalg.norm(across)
    angle = (arcmin or rng.uniform(5, 60)) * ARCMIN * rng.choice((-1, 1))
    return _from(sweep, first, lambda shot: replace(shot, mount=shot.mount.kicked(turn_axis, angle)))


def with_camera_tilted(sweep: Sweep, rng: Random, arcmin: float | None = None, first: int | None = None) -> Sweep:
    """The camera is knocked on the tube by 5 to 60 arcmin.

    Parameters
    ----------
    sweep : Sweep
        The sweep that is spoilt.
    rng : Random
        Draws what is not given.
    arcmin : float or None
        How far; None: drawn.
    first : int or None
        The first frame after it; None: drawn.
    """
    first = first or int(rng.integers(1, len(sweep.exposures)))
    angle = (arcmin or rng.uniform(5, 60)) * ARCMIN
    way = rng.uniform(0, 360)
    return _from(sweep, first, lambda shot: replace(shot, mount=shot.mount.camera_tilted(way, angle)))


def with_camera_turned(sweep: Sweep, rng: Random, degrees: float | None = None, first: int | None = None) -> Sweep:
    """The camera is turned in its drawtube by 2 to 180 deg.

    Parameters
    ----------
    sweep : Sweep
        The sweep that is spoilt.
    rng : Random
        Draws what is not given.
    degrees : float or None
        How far; None: drawn.
    first : int or None
        The first frame after it; None: drawn.
    """
    first = first or int(rng.integers(1, len(sweep.exposures)))
    angle = np.radians(degrees or rng.uniform(2, 180))
    return _from(sweep, first, lambda shot: replace(shot, mount=shot.mount.camera_turned(angle)))


def with_flip(sweep: Sweep, rng: Random, first: int | None = None, centred: bool = False) -> Sweep:
    """The mount goes over the meridian: half a turn of RA, and Dec through the pole.

    Parameters
    ----------
    sweep : Sweep
        The sweep that is spoilt.
    rng : Random
        Draws what is not given.
    first : int or None
        The first frame after it; None: drawn.
    centred : bool
        Whether it looks at the same place; else elsewhere by twice what camera and tube are askew.
    """
    first = first or int(rng.integers(1, len(sweep.exposures)))

    def flipped(shot: Exposure) -> Exposure:
        ra, dec = shot.ra_turn + np.pi, np.pi - shot.dec_turn
        if centred:
            ra, dec = _pointed(shot.mount, ra, dec, shot.attitude[:, 2])
        return replace(shot, ra_turn=ra, dec_turn=dec)

    return _from(sweep, first, flipped)


def with_one_time_wrong(sweep: Sweep, rng: Random, minutes: float = 10.0, index: int | None = None) -> Sweep:
    """The header of one frame says another time.

    Parameters
    ----------
    sweep : Sweep
        The sweep that is spoilt.
    rng : Random
        Draws what is not given, and the sign.
    minutes : float
        How wrong.
    index : int or None
        Which frame; None: drawn.
    """
    index = int(rng.integers(0, len(sweep.exposures))) if index is None else index
    off = dt.timedelta(minutes=minutes * float(rng.choice((-1, 1))))
    shots = tuple(replace(s, stated=s.stated + off) if k == index else s for k, s in enumerate(sweep.exposures))
    return replace(sweep, exposures=shots)


def with_clock_wrong(sweep: Sweep, rng: Random, hours: float = 1.0) -> Sweep:
    """The clock is wrong for all frames (daylight saving)."""
    off = dt.timedelta(hours=hours * float(rng.choice((-1, 1))))
    return replace(sweep, exposures=tuple(replace(s, stated=s.stated + off) for s in sweep.exposures))


def with_site_wrong(sweep: Sweep, rng: Random, degrees: float = 1.0) -> Sweep:
    """The site that is said lies a degree of the sky away, in a direction of chance."""
    way = rng.uniform(0, 2 * np.pi)
    place = sweep.place
    stated = replace(
        place,
        latitude_deg=place.latitude_deg + degrees * np.cos(way),
        longitude_deg=place.longitude_deg + degrees * np.sin(way) / np.cos(np.radians(place.latitude_deg)),
    )
    return replace(sweep, stated_place=stated)


def with_sign_wrong(sweep: Sweep, which: str = "latitude") -> Sweep:
    """The site that is said has its latitude or longitude with the other sign."""
    place = sweep.place
    if which == "latitude":
        stated = replace(place, latitude_deg=-place.latitude_deg)
    else:
        stated = replace(place, longitude_deg=-place.longitude_deg)
    return replace(sweep, stated_place=stated)


def tracked(sweep: Sweep, rng: Random, minutes: float = 60.0, guided: bool = True) -> Sweep:
    """Light frames of one target that the mount follows: RA at the sky's rate.

    Guiding turns both axes so that the middle of the frame stays on one catalogue place: what is left is the field's
    turning. Without guiding the middle drifts.

    Parameters
    ----------
    sweep : Sweep
        Gives mount, place and first frame.
    rng : Random
        Draws how many frames.
    minutes : float
        From the first to the last.
    guided : bool
        Whether a guider holds the target.
    """
    frames = int(rng.integers(6, 16))
    shot = sweep.exposures[0]
    times = [shot.when + dt.timedelta(minutes=float(m)) for m in np.linspace(0, minutes, frames)]
    rate = -2 * np.pi / 86164.0905 * np.sign(sweep.place.latitude_deg)  # about the end of the axis that points up
    target = catalogue_places(shot.attitude[:, 2][None], shot.when, sweep.place)
    shots = []
    for when in times:
        ra, dec = shot.ra_turn + rate * (when - shot.when).total_seconds(), shot.dec_turn
        if guided:
            ra, dec = _pointed(shot.mount, ra, dec, observed_places(target, when, sweep.place)[0])
        shots.append(Exposure(shot.mount, ra, dec, when, when))
    return replace(sweep, exposures=tuple(shots))


def _pointed(mount: Mount, ra: float, dec: float, towards: Floats) -> tuple[float, float]:
    """The turns (Newton, from ``ra``, ``dec``) that put the middle of the frame on ``towards`` (east, north, up)."""
    for _ in range(8):
        now = mount.attitude(ra, dec)
        off = now[:, :2].T @ towards
        step = 1e-5
        slope = np.column_stack(
            (
                now[:, :2].T @ (mount.attitude(ra + step, dec)[:, 2] - now[:, 2]) / step,
                now[:, :2].T @ (mount.attitude(ra, dec + step)[:, 2] - now[:, 2]) / step,
            )
        )
        turn = np.linalg.solve(slope, off)
        ra, dec = ra + turn[0], dec + turn[1]
    return ra, dec
