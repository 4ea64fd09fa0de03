"""The practice rig: one clock, one sky, a misaligned mount, a camera, and the truth about them."""

import math
import threading
import time
from dataclasses import field, replace
from datetime import UTC, datetime

import erfa
import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import (
    Attitude,
    attitude_from,
    cross_product,
    radec_deg,
    separation_deg,
    unit,
    unit_vectors,
    wrapped,
)
from kochab.core.frame import Detections, Frame, Hint, Site
from kochab.core.values import frozen
from kochab.simulate import night_sky
from kochab.simulate.camera import CameraConfig, SkyCamera
from kochab.simulate.exposure import star_list
from kochab.simulate.mechanics.axis import GearErrors
from kochab.simulate.mechanics.geometry import BoltErrors, Build, MountConfig, X, Y, about
from kochab.simulate.mechanics.mount import EquatorialMount
from kochab.sky import Catalogue, open_catalogue


@frozen
class AxisError:
    """The polar axis against a pole, arcsec.

    Altitude positive too high, azimuth raw as the knob turns and positive clockwise as seen from
    above, total as the angle on the sky.
    """

    altitude_arcsec: float
    azimuth_arcsec: float
    total_arcsec: float


@frozen(eq=False)
class MountTruth:
    """One moment. ``attitude`` takes ICRS catalogue vectors to camera axes near the boresight.

    ``of_date_deg`` is the boresight's geocentric apparent RA and Dec, what a mount should say. ``enu_to_camera``
    (3, 3) takes observed directions; ``axis_enu`` (3,) is the visible end of the polar axis.
    """

    unix_s: float
    attitude: Attitude
    of_date_deg: tuple[float, float]
    enu_to_camera: Floats
    axis_enu: Floats
    sky: night_sky.LocalSky

    @property
    def time_utc(self) -> datetime:
        """The moment as an aware time."""
        return datetime.fromtimestamp(self.unix_s, UTC)

    @property
    def ra_dec_deg(self) -> tuple[float, float]:
        """ICRS of the frame's principal point."""
        return self.attitude.ra_dec_deg

    def axis_error(self) -> AxisError:
        """The axis against the pole as seen through the air."""
        pole, axis = self.sky.pole_enu(), self.axis_enu
        high = float(night_sky.altitude_deg(axis) - night_sky.altitude_deg(pole))
        turned = float(wrapped(night_sky.azimuth_deg(axis) - night_sky.azimuth_deg(pole)))
        return AxisError(high * 3600.0, turned * 3600.0, separation_deg(axis, pole) * 3600.0)


SITE = Site(47.0, 8.0, 450.0)


@frozen
class Event:
    """Something that happens ``at_s`` seconds after the beginning.

    ``kick``: somebody stumbles over the tripod, ``amount`` arcmin in altitude and azimuth.
    ``slip``: the clutches give way, ``amount`` degrees of the hour and declination axis.
    """

    at_s: float
    kind: str
    amount: tuple[float, float]


@frozen
class RigConfig:
    """Everything a practice rig is made of; the seed decides all that is random.

    ``start_unix`` is None for the middle of a night near ``date_unix``. ``rate`` is that of :class:`SimulatedClock`,
    0 for tests. ``start_deg`` is the hour angle and declination where the telescope stands at first, None for a place
    from the seed above 35 deg of altitude; ``lost_deg`` is how far from there its computer believes to point.
    """

    seed: int = 0
    site: Site = SITE
    start_unix: float | None = None
    date_unix: float = 1_800_000_000.0
    rate: float = 0.0
    mount: MountConfig = field(default_factory=MountConfig)
    camera: CameraConfig = field(default_factory=CameraConfig)
    weather: night_sky.WeatherConfig = field(default_factory=night_sky.WeatherConfig)
    start_deg: tuple[float, float] | None = None
    lost_deg: float = 0.0
    tracking: bool = True
    events: tuple[Event, ...] = ()


class PracticeRig:
    """Mount, camera and sky that agree with each other. Safe from any thread.

    ``mount`` is what a protocol responder serves.
    """

    def __init__(
        self,
        config: RigConfig | None = None,
        catalogue: Catalogue | None = None,
        mount_class: type[EquatorialMount] = EquatorialMount,
    ) -> None:
        self.config = config = config or RigConfig()
        start = config.start_unix
        if start is None:
            start = night_sky.midnight_unix(config.date_unix, config.site)
        self.start_unix = start
        self.clock = night_sky.SimulatedClock(start, config.rate)
        self.mount = mount_class(config.mount, config.site, self.clock)
        self.weather = night_sky.Weather(config.weather, start, config.seed)
        stars = catalogue or open_catalogue()
        self.camera = SkyCamera(config.camera, stars, config.site, self.weather, config.seed)
        self._rng = np.random.default_rng([config.seed, 3])
        self._lock = threading.RLock()
        self._coming = sorted(config.events, key=lambda event: event.at_s)
        self._begin()

    # What the camera sees.

    def look(self, unix_s: float) -> Floats:
        """Rotation (3, 3) from observed directions (E, N, U) to camera axes, wind included."""
        view = self.mount.attitude_enu_to_camera(unix_s)
        x, y = self.weather.shake_rad(unix_s)
        return np.asarray(about(X, x) @ about(Y, y) @ view) if x or y else view

    def frame(self, exposure_s: float = 1.0, gain_e: float = 0.0) -> Frame:
        """Expose from now on and give the frame; the clock goes on by the exposure."""
        return self.frame_since(self._expose(exposure_s), exposure_s, gain_e)

    def frame_since(self, start: float, exposure_s: float, gain_e: float = 0.0) -> Frame:
        """The frame of an exposure that began at ``start`` and is over."""
        with self._lock:
            self.happen()
            return self.camera.frame(self.look, start, exposure_s, gain_e)

    def star_list(self, exposure_s: float = 1.0) -> tuple[Detections, Hint]:
        """As :meth:`frame`, but what a detector would list, and the frame's hint."""
        start = self._expose(exposure_s)
        with self._lock:
            light = self.camera.light(self.look, start, exposure_s)
            noise = self.config.camera.sensor.read_noise_e
            listed = star_list(light, self.config.camera.fwhm_px, noise, self._rng)
            return listed, self.camera.hint(start, exposure_s)

    # What is true.

    def truth(self, unix_s: float | None = None) -> MountTruth:
        """Where it really points, and where its axis does, now or at another time."""
        t = self.clock.now_unix() if unix_s is None else unix_s
        return self._truth(t, self.look(t))

    def _truth(self, t: float, camera_axes: Floats) -> MountTruth:
        """The truth of a camera whose ``camera_axes`` (3, 3) takes observed directions to camera axes."""
        sky = night_sky.LocalSky(self.config.site, t)
        boresight = sky.from_enu(camera_axes[2])
        # The air squeezes the field, so that right and down turn a little differently: take the mean,
        # as a fit over the whole frame does.
        offsets = sky.from_enu(camera_axes[2] + 1e-3 * camera_axes[:2]) - boresight
        offsets -= (offsets @ boresight)[:, None] * boresight
        right, down = unit(offsets)
        x = unit(right + cross_product(down, boresight))
        attitude = Attitude(np.stack([x, cross_product(boresight, x), boresight]))
        return MountTruth(t, attitude, sky.of_date(boresight), camera_axes, self.mount.wedge.axis_enu(), sky)

    def happen(self) -> None:
        """Let every event happen whose time has come."""
        with self._lock:
            passed = self.clock.now_unix() - self.start_unix
            while self._coming and self._coming[0].at_s <= passed:
                event = self._coming.pop(0)
                if event.kind == "kick":
                    self.mount.turn_bolts(*event.amount)
                else:
                    self.mount.turn_by_hand(*event.amount)

    def wait_until_still(self, settle_s: float = 0.0) -> None:
        """Let the time pass that all planned motion takes, and ``settle_s`` more."""
        self.clock.sleep(self.mount.busy_until() - self.clock.now_unix() + settle_s)

    def _expose(self, exposure_s: float) -> float:
        self.happen()
        start = self.clock.now_unix()
        self.clock.sleep(exposure_s)
        return start

    def _begin(self) -> None:
        latitude = self.config.site.latitude_deg
        hour, dec = self.config.start_deg or random_place(self._rng, latitude, (-75.0, 75.0), 35.0)
        self.mount.tracking = self.config.tracking
        self.mount.place(hour, dec, flipped=hour < 0.0 and self.config.mount.german)
        t = self.clock.now_unix()
        ra, dec = self._truth(t, self.mount.attitude_enu_to_camera(t)).of_date_deg
        if self.config.lost_deg:
            up = -attitude_from(ra, dec, float(self._rng.uniform(0, 360))).matrix[1]
            away = np.radians(self.config.lost_deg)
            ra, dec = radec_deg(np.cos(away) * unit_vectors(ra, dec) + np.sin(away) * up)
        self.mount.sync(ra, dec)


def random_place(
    rng: np.random.Generator,
    latitude_deg: float,
    hours_deg: tuple[float, float],
    lowest_deg: float,
    most_sine: float = 1.0,
) -> tuple[float, float]:
    """Hour angle and declination, degrees, evenly over a part of the sky.

    Parameters
    ----------
    rng : np.random.Generator
        Draws them.
    latitude_deg : float
        Of the site.
    hours_deg : tuple[float, float]
        Least and largest hour angle.
    lowest_deg : float
        Least altitude.
    most_sine : float
        Largest sine of the declination, either way.
    """
    latitude, lowest = np.radians([latitude_deg, lowest_deg])
    while True:
        hour, dec = rng.uniform(*hours_deg), np.arcsin(rng.uniform(-most_sine, most_sine))
        # by rejection: even over the sky that is left
        if erfa.hd2ae(np.radians(hour), dec, latitude)[1] > lowest:
            return float(hour), float(np.degrees(dec))


# -- Practice nights: what is wrong with the mount, the weather and the luck, all from a seed ----

LATITUDE_DEG = 40.0


def tonight(seed: int = 0, site: Site | None = None, now_unix: float | None = None) -> RigConfig:
    """A good mount under a clear sky, where it is night.

    Without a site, one is chosen where it is about midnight now, so that the simulated time is
    the computer's. At a given site it is the computer's time when that is dark, else midnight.
    """
    now = time.time() if now_unix is None else now_unix
    if site is None:
        east = -15.0 * (now % 86400.0) / 3600.0  # mean solar time is nearest to midnight there
        site = Site(LATITUDE_DEG, float(round(wrapped(east))), 300.0)
    dark = night_sky.sun_altitude_deg(now, site) < night_sky.DARK_DEG
    start = now if dark else night_sky.midnight_unix(now, site)
    return RigConfig(seed=seed, site=site, start_unix=start, rate=1.0)


def through(config: RigConfig, fov_deg: float) -> RigConfig:
    """The same with a telescope or lens of this field; the narrower, the larger it is."""
    wide = config.camera.fov_deg / fov_deg
    zero = config.camera.zero_point_e_s * wide
    return replace(config, camera=replace(config.camera, fov_deg=fov_deg, zero_point_e_s=zero))


def misaligned(config: RigConfig, total_arcmin: float | None, lost_deg: float = 0.0) -> RigConfig:
    """The same, with the axis off in a direction from the seed; None lets the seed say how far."""
    rng = np.random.default_rng([config.seed, 5])
    drawn = float(rng.uniform(20.0, 90.0))
    total = drawn if total_arcmin is None else total_arcmin
    turn = float(rng.uniform(0.0, 2.0 * np.pi))
    latitude = math.radians(config.site.latitude_deg)
    # a turn about the vertical moves the axis by only cos(latitude) of it; 0.05 bounds it near the poles
    knob = total * math.sin(turn) / max(math.cos(latitude), 0.05)
    mount = replace(config.mount, misalignment_arcmin=(total * math.cos(turn), knob))
    return replace(config, mount=mount, lost_deg=lost_deg)


def practice_night(config: RigConfig, faults: bool = True) -> RigConfig:
    """A mount as amateurs own; with ``faults`` also clouds, gusts, a kick and a weak clutch."""
    rng = np.random.default_rng([config.seed, 6])
    mount = replace(
        config.mount,
        approach_deg=0.1,
        build=Build(
            cone_deg=float(rng.normal(0.0, 0.1)),
            square_deg=float(rng.normal(0.0, 0.03)),
            flexure_arcsec=float(rng.uniform(0.0, 60.0)),
            camera_roll_deg=float(rng.uniform(-180.0, 180.0)),
        ),
        hour_gear=GearErrors(
            backlash_deg=float(rng.uniform(10.0, 60.0)) / 3600.0,
            periodic_arcsec=float(rng.uniform(5.0, 20.0)),
            worm_phase_deg=float(rng.uniform(0.0, 360.0)),
            slip=float(rng.uniform(0.003, 0.01)) if faults else 0.0,
            rate_error=float(rng.normal(0.0, 5e-4)),
            wobble_arcsec=float(rng.uniform(10.0, 40.0)),
        ),
        dec_gear=GearErrors(
            backlash_deg=float(rng.uniform(10.0, 60.0)) / 3600.0, wobble_arcsec=float(rng.uniform(10.0, 40.0))
        ),
        bolts=BoltErrors(tuple(rng.uniform(0.2, 1.5, 2).tolist()), tuple(rng.normal(0.0, 0.03, 2).tolist())),
    )
    if not faults:
        return replace(config, mount=mount)
    bank = float(rng.uniform(300.0, 900.0))
    weather = night_sky.WeatherConfig(
        cloud_cover=float(rng.uniform(0.1, 0.4)),
        cloud_mag=float(rng.uniform(1.0, 3.0)),
        banks=((bank, bank + float(rng.uniform(30.0, 90.0)), 8.0),),
        wind_arcsec=float(rng.uniform(1.0, 6.0)),
    )
    at_s, (altitude, azimuth) = float(rng.uniform(600.0, 1800.0)), rng.normal(0.0, 4.0, 2).tolist()
    kick = Event(at_s, "kick", (altitude, azimuth))
    slip = Event(float(rng.uniform(200.0, 1200.0)), "slip", (float(rng.normal(0.0, 0.4)), 0.0))
    return replace(config, mount=mount, weather=weather, events=(kick, slip))
