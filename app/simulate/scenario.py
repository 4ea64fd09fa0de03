"""Practice nights: what is wrong with the mount, the weather and the luck, all from a seed."""

import math
import time
from dataclasses import replace

import numpy as np

from app.core.hint import Site
from app.simulate.mechanics.axis import AxisWear
from app.simulate.mechanics.bolts import BoltWear
from app.simulate.mechanics.geometry import Build
from app.simulate.night import DARK_DEG, midnight_unix, sun_altitude_deg
from app.simulate.rig import Event, RigConfig
from app.simulate.weather import WeatherConfig

LATITUDE_DEG = 40.0


def tonight(seed: int = 0, site: Site | None = None, now_unix: float | None = None) -> RigConfig:
    """A good mount under a clear sky, where it is night.

    Without a site, one is chosen where it is about midnight now, so that the simulated time is
    the computer's. At a given site it is the computer's time when that is dark, else midnight.
    """
    now = time.time() if now_unix is None else now_unix
    if site is None:
        site = Site(LATITUDE_DEG, _midnight_longitude_deg(now), 300.0)
    dark = sun_altitude_deg(now, site) < DARK_DEG
    start = now if dark else midnight_unix(now, site)
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
            cone_deg=float(rng.normal(0.0, 0.1)), square_deg=float(rng.normal(0.0, 0.03)),
            flexure_arcsec=float(rng.uniform(0.0, 60.0)),
            camera_roll_deg=float(rng.uniform(-180.0, 180.0)),
        ),
        hour_wear=AxisWear(
            backlash_deg=float(rng.uniform(10.0, 60.0)) / 3600.0,
            periodic_arcsec=float(rng.uniform(5.0, 20.0)),
            worm_phase_deg=float(rng.uniform(0.0, 360.0)),
            slip=float(rng.uniform(0.003, 0.01)) if faults else 0.0,
            rate_error=float(rng.normal(0.0, 5e-4)),
            wobble_arcsec=float(rng.uniform(10.0, 40.0)),
        ),
        dec_wear=AxisWear(
            backlash_deg=float(rng.uniform(10.0, 60.0)) / 3600.0,
            wobble_arcsec=float(rng.uniform(10.0, 40.0)),
        ),
        bolts=BoltWear(
            (float(rng.uniform(0.2, 1.5)), float(rng.uniform(0.2, 1.5))),
            (float(rng.normal(0.0, 0.03)), float(rng.normal(0.0, 0.03))),
        ),
    )  # fmt: skip
    config = replace(config, mount=mount)
    return _with_bad_luck(config, rng) if faults else config


def _with_bad_luck(config: RigConfig, rng: np.random.Generator) -> RigConfig:
    bank = float(rng.uniform(300.0, 900.0))
    weather = WeatherConfig(
        cloud_cover=float(rng.uniform(0.1, 0.4)), cloud_mag=float(rng.uniform(1.0, 3.0)),
        banks=((bank, bank + float(rng.uniform(30.0, 90.0)), 8.0),),
        wind_arcsec=float(rng.uniform(1.0, 6.0)),
    )  # fmt: skip
    kick = Event(
        float(rng.uniform(600.0, 1800.0)), "kick",
        (float(rng.normal(0.0, 4.0)), float(rng.normal(0.0, 4.0))),
    )  # fmt: skip
    slip = Event(float(rng.uniform(200.0, 1200.0)), "slip", (float(rng.normal(0.0, 0.4)), 0.0))
    return replace(config, weather=weather, events=(kick, slip))


def _midnight_longitude_deg(unix_s: float) -> float:
    """A round longitude where mean solar time is nearest to midnight."""
    hours = unix_s % 86400.0 / 3600.0
    east = -15.0 * hours
    return float(round((east + 180.0) % 360.0 - 180.0))
