"""The practice rig: one clock, one sky, a mount that stands wrong and a camera that sees it."""

import threading
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import attitude_from, radec_deg, unit_vectors
from app.core.detections import Detections
from app.core.frame import Frame
from app.core.hint import Hint, Site
from app.simulate.camera import CameraConfig, SkyCamera
from app.simulate.clock import SimulatedClock
from app.simulate.local_sky import Air, LocalSky
from app.simulate.mechanics.geometry import about_x, about_y
from app.simulate.mechanics.mount import EquatorialMount, MountConfig
from app.simulate.night import midnight_unix
from app.simulate.sky_glow import Glow
from app.simulate.star_list import star_list
from app.simulate.truth import Truth, truth_of
from app.simulate.weather import Weather, WeatherConfig
from app.sky import open_catalogue
from app.sky.catalogue import Catalogue

Floats = NDArray[np.float64]
SITE = Site(47.0, 8.0, 450.0)


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happens ``at_s`` seconds after the beginning.

    ``kick``: somebody stumbles over the tripod, ``amount`` arcmin in altitude and azimuth.
    ``slip``: the clutches give way, ``amount`` degrees of the hour and declination axis.
    """

    at_s: float
    kind: str
    amount: tuple[float, float]


@dataclass(frozen=True, slots=True)
class RigConfig:
    """Everything a practice rig is made of; the seed decides all that is random.

    ``start_unix`` is None for the middle of a night near ``date_unix``. ``rate`` is that of
    :class:`SimulatedClock`, 0 for tests. ``start_deg`` is the hour angle and declination where
    the telescope stands at first, None for a place from the seed above 35 deg of altitude;
    ``lost_deg`` is how far from there its computer believes to point.
    """

    seed: int = 0
    site: Site = SITE
    start_unix: float | None = None
    date_unix: float = 1_800_000_000.0
    rate: float = 0.0
    mount: MountConfig = field(default_factory=MountConfig)
    camera: CameraConfig = field(default_factory=CameraConfig)
    weather: WeatherConfig = field(default_factory=WeatherConfig)
    air: Air = field(default_factory=Air)
    glow: Glow = field(default_factory=Glow)
    start_deg: tuple[float, float] | None = None
    lost_deg: float = 0.0
    tracking: bool = True
    events: tuple[Event, ...] = ()


class PracticeRig:
    """Mount, camera and sky that agree with each other. Safe from any thread.

    ``mount`` is the :class:`~app.simulate.telescope.Telescope` a protocol responder serves.
    """

    def __init__(self, config: RigConfig | None = None, catalogue: Catalogue | None = None) -> None:
        self.config = config = config or RigConfig()
        start = config.start_unix
        if start is None:
            start = midnight_unix(config.date_unix, config.site)
        self.start_unix = start
        self.clock = SimulatedClock(start, config.rate)
        self.mount = EquatorialMount(config.mount, config.site, self.clock, config.air)
        self.weather = Weather(config.weather, start, config.seed)
        self.camera = SkyCamera(
            config.camera, catalogue or open_catalogue(), config.site, config.air, config.glow,
            self.weather, config.seed,
        )  # fmt: skip
        self._rng = np.random.default_rng([config.seed, 3])
        self._lock = threading.RLock()
        self._coming = sorted(config.events, key=lambda event: event.at_s)
        self._begin()

    # What the camera sees.

    def look(self, unix_s: float) -> Floats:
        """Rotation (3, 3) from observed directions (E, N, U) to camera axes, wind included."""
        view = self.mount.attitude_enu_to_camera(unix_s)
        x, y = self.weather.shake_rad(unix_s)
        return np.asarray(about_x(x) @ about_y(y) @ view) if x or y else view

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
            light = self.camera.light(self.camera.paths(self.look, start, exposure_s), self.look)
            noise = self.config.camera.sensor.read_noise_e
            listed = star_list(light, self.config.camera.fwhm_px, noise, self._rng)
            return listed, self.camera.hint(start, exposure_s)

    # What is true.

    def truth(self, unix_s: float | None = None) -> Truth:
        """Where it really points, and where its axis does, now or at another time."""
        t = self.clock.now_unix() if unix_s is None else unix_s
        return self._truth(t, self.look(t))

    def _truth(self, t: float, look: Floats) -> Truth:
        sky = LocalSky(self.config.site, t, self.config.air)
        return truth_of(sky, t, look, self.mount.wedge.axis_enu())

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
        hour, dec = self.config.start_deg or self._somewhere()
        self.mount.tracking = self.config.tracking
        self.mount.place(hour, dec, flipped=hour < 0.0 and self.config.mount.german)
        t = self.clock.now_unix()
        ra, dec = self._truth(t, self.mount.attitude_enu_to_camera(t)).of_date_deg
        if self.config.lost_deg:
            ra, dec = _beside(ra, dec, self.config.lost_deg, float(self._rng.uniform(0, 360)))
        self.mount.sync(ra, dec)

    def _somewhere(self) -> tuple[float, float]:
        """An hour angle and declination that stand above 35 deg."""
        latitude = np.radians(self.config.site.latitude_deg)
        while True:
            hour, sine = self._rng.uniform(-75.0, 75.0), self._rng.uniform(-1.0, 1.0)
            dec = float(np.arcsin(sine))
            height = np.sin(latitude) * sine + np.cos(latitude) * np.cos(dec) * np.cos(
                np.radians(hour)
            )
            if height > np.sin(np.radians(35.0)):
                return float(hour), float(np.degrees(dec))


def _beside(
    ra_deg: float, dec_deg: float, away_deg: float, angle_deg: float
) -> tuple[float, float]:
    """The place ``away_deg`` from another, in the direction ``angle_deg`` east of north."""
    up = -attitude_from(ra_deg, dec_deg, angle_deg).matrix[1]
    away = np.radians(away_deg)
    return radec_deg(np.cos(away) * unit_vectors(ra_deg, dec_deg) + np.sin(away) * up)
