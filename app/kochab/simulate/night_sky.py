"""The sky over one site: time, directions, glow, clouds and wind.

Everything is ERFA's: light bending, annual and diurnal aberration, precession, nutation and
refraction. UT1 is taken for UTC and polar motion is left out (under 1 arcsec in azimuth and
0.4 arcsec elsewhere, the same for the whole sky), so that nothing is ever fetched.
"""

import threading
import time
from datetime import UTC, datetime
from math import inf

import erfa
import numpy as np

from kochab.core.arrays import Floats
from kochab.core.frame import Site
from kochab.core.values import frozen
from kochab.sky.apparent import JD_UNIX, TT_MINUS_UTC_S


@frozen
class Atmosphere:
    """Sets the refraction; a pressure of 0 means none."""

    pressure_hpa: float = 1010.0
    temperature_c: float = 10.0
    humidity: float = 0.5
    wavelength_um: float = 0.55


AIR = Atmosphere()
"""Every night's."""


class LocalSky:
    """Directions over ``site`` at ``unix_s``; making one costs a third of a millisecond."""

    def __init__(self, site: Site, unix_s: float, air: Atmosphere = AIR) -> None:
        day, fraction = JD_UNIX + unix_s // 86400.0, (unix_s % 86400.0) / 86400.0
        tt = fraction + TT_MINUS_UTC_S / 86400.0
        self._to_cirs, self._origins = erfa.apci13(day, tt)
        bend_a, bend_b = erfa.refco(air.pressure_hpa, air.temperature_c, air.humidity, air.wavelength_um)
        longitude, latitude = np.radians([site.longitude_deg, site.latitude_deg])
        self._rotation = float(erfa.era00(day, fraction))
        self._longitude = float(longitude)
        self._to_observed = erfa.apio(
            erfa.sp00(day, tt), self._rotation, longitude, latitude, site.height_m, 0.0, 0.0, bend_a, bend_b
        )
        self._north = site.latitude_deg >= 0.0

    @property
    def sidereal_rad(self) -> float:
        """Apparent local sidereal time."""
        return float((self._rotation - self._origins + self._longitude) % (2.0 * np.pi))

    def to_enu(self, vectors: Floats) -> Floats:
        """Observed directions (N, 3), east, north, up, of ICRS catalogue vectors (N, 3)."""
        cirs = erfa.atciqz(*erfa.c2s(vectors), self._to_cirs)
        return _enu(*erfa.atioq(*cirs, self._to_observed)[:2])

    def from_enu(self, directions: Floats) -> Floats:
        """ICRS catalogue vectors (N, 3) of observed directions (N, 3), east, north, up."""
        e, n, u = np.moveaxis(np.asarray(directions, dtype=np.float64), -1, 0)
        zenith = np.arctan2(np.hypot(e, n), u)
        cirs = erfa.atoiq("A", np.arctan2(e, n), zenith, self._to_observed)
        return np.asarray(erfa.s2c(*erfa.aticq(*cirs, self._to_cirs)))

    def of_date(self, vectors: Floats) -> tuple[float, float]:
        """Apparent geocentric RA and Dec, degrees, equinox of date, of one ICRS vector (3,)."""
        ra, dec = erfa.atciqz(*erfa.c2s(vectors), self._to_cirs)
        return float(np.degrees(ra - self._origins) % 360.0), float(np.degrees(dec))

    def pole_enu(self) -> Floats:
        """The visible celestial pole (3,) of date, as seen through the air."""
        dec = np.pi / 2 if self._north else -np.pi / 2
        return _enu(*erfa.atioq(0.0, dec, self._to_observed)[:2])


def _enu(azimuth: Floats, zenith: Floats) -> Floats:
    """Directions (..., 3), east, north, up."""
    return np.asarray(erfa.s2c(np.pi / 2 - azimuth, np.pi / 2 - zenith))


def altitude_deg(directions: Floats) -> Floats:
    """Altitudes (N,), degrees, of directions (N, 3), east, north, up."""
    return np.asarray(np.degrees(np.arcsin(np.clip(np.asarray(directions)[..., 2], -1.0, 1.0))))


def azimuth_deg(directions: Floats) -> Floats:
    """Azimuths (N,), degrees in [0, 360) from north through east, of directions (N, 3)."""
    e, n, _ = np.moveaxis(np.asarray(directions, dtype=np.float64), -1, 0)
    return np.asarray(np.degrees(np.arctan2(e, n)) % 360.0)


# -- How bright the sky is between the stars, and how much of the starlight the air takes ------
# The Moon's light is that of Krisciunas and Schaefer (1991, PASP 103, 1033, eq. 3, 9, 15, 20 and
# 21). The twilight is a rough line through commonly measured zenith values.

TWILIGHT_DEG = (-18.0, -12.0, -6.0, 0.0, 10.0)
TWILIGHT_MAG = (24.0, 19.5, 13.5, 7.5, 4.0)
DARK_MAG = 20.5  # V of a square arcsec at the zenith without Moon
EXTINCTION = 0.2  # magnitudes an airmass
LIGHT_POLLUTION = 0.35  # how much brighter each further airmass makes the sky


@frozen(eq=False)
class SunAndMoon:
    """Sun and Moon now: directions (3,) east, north, up, and the Moon's phase angle, degrees."""

    sun: Floats
    moon: Floats
    phase_deg: float


def airmass(directions: Floats) -> Floats:
    """Airmass (N,) towards directions (N, 3) (Rozenberg 1966); 40 at the horizon and below."""
    sine = np.maximum(np.asarray(directions, dtype=np.float64)[..., 2], 0.0)
    return np.asarray(1.0 / (sine + 0.025 * np.exp(-11.0 * sine)))


def sun_and_moon(sky: LocalSky, unix_s: float) -> SunAndMoon:
    """Where Sun and Moon stand over the site (ERFA ``epv00``, ``moon98``; no parallax)."""
    day, fraction = JD_UNIX + unix_s // 86400.0, (unix_s % 86400.0) / 86400.0
    sun = -np.asarray(erfa.epv00(day, fraction)[0]["p"])
    moon = np.asarray(erfa.moon98(day, fraction)["p"])
    sun_u, moon_u = sun / np.linalg.norm(sun), moon / np.linalg.norm(moon)
    to_sun = sun - moon
    phase = np.degrees(np.arccos(np.clip(-moon_u @ to_sun / np.linalg.norm(to_sun), -1.0, 1.0)))
    return SunAndMoon(sky.to_enu(sun_u), sky.to_enu(moon_u), float(phase))


def surface_mag(directions: Floats, light: SunAndMoon) -> Floats:
    """V of a square arcsec of sky (N,) towards directions (N, 3), east, north, up."""
    masses = np.minimum(airmass(directions), 10.0)
    flux = 10.0 ** (-0.4 * DARK_MAG) * (1.0 + LIGHT_POLLUTION * (masses - 1.0))
    sun = float(altitude_deg(light.sun))
    # darker than 24 mag per square arcsec adds nothing to a sky of 20.5
    if sun > TWILIGHT_DEG[0]:
        flux = flux + 10.0 ** (-0.4 * float(np.interp(sun, TWILIGHT_DEG, TWILIGHT_MAG)))
    if light.moon[2] > 0.0:
        flux = flux + _moonlight(directions, light)
    return np.asarray(-2.5 * np.log10(flux))


def _moonlight(directions: Floats, light: SunAndMoon) -> Floats:
    phase = light.phase_deg
    bright = 10.0 ** (-0.4 * (3.84 + 0.026 * abs(phase) + 4e-9 * phase**4))
    cosine = np.clip(directions @ light.moon, -1.0, 1.0)
    away = np.maximum(np.degrees(np.arccos(cosine)), 1.0)
    scattered = 10.0**5.36 * (1.06 + cosine**2)
    scattered = scattered + np.where(away > 10.0, 10.0 ** (6.15 - away / 40.0), 6.2e7 / away**2)
    through = 10.0 ** (-0.4 * EXTINCTION * _scatter_mass(light.moon))
    lit = 1.0 - 10.0 ** (-0.4 * EXTINCTION * _scatter_mass(directions))
    nanolamberts = scattered * bright * through * lit
    return np.asarray(nanolamberts / 34.08 * np.exp(-20.7233))


def _scatter_mass(directions: Floats) -> Floats:
    flat2 = 1.0 - np.maximum(np.asarray(directions)[..., 2], 0.0) ** 2
    return np.asarray(1.0 / np.sqrt(1.0 - 0.96 * flat2))


DARK_DEG = -16.0


def midnight_unix(near_unix: float, site: Site) -> float:
    """The true midnight nearest to a time: the Sun is then lowest at the site."""
    hours = np.arange(-12.0, 12.0, 0.25) * 3600.0
    return float(near_unix + hours[np.argmin([sun_altitude_deg(near_unix + h, site) for h in hours])])


def sun_altitude_deg(unix_s: float, site: Site) -> float:
    """How high the Sun stands, degrees."""
    return float(altitude_deg(sun_and_moon(LocalSky(site, unix_s), unix_s).sun))


# -- Clouds that drift, wind that shakes; all from a seed, and any moment can be asked for -----


@frozen
class WeatherConfig:
    """The weather of a night.

    ``cloud_cover`` 0 to 1 is how much of the sky is under patchy cloud of up to ``cloud_mag``
    magnitudes. ``banks`` are (start, end, mag): solid cloud between these seconds after the
    beginning. ``wind_arcsec`` is how far gusts swing the telescope (RMS, each way).
    """

    cloud_cover: float = 0.0
    cloud_mag: float = 3.0
    banks: tuple[tuple[float, float, float], ...] = ()
    wind_arcsec: float = 0.0


class Weather:
    """What one seed makes of a :class:`WeatherConfig`, beginning at ``start`` unix seconds."""

    def __init__(self, config: WeatherConfig, start: float, seed: int = 0) -> None:
        self.config = config
        self._start = start
        rng = np.random.default_rng([seed, 71])
        turn, size = rng.uniform(0, 2 * np.pi, 9), np.geomspace(1.5, 25.0, 9)
        self._waves = np.stack([size * np.cos(turn), size * np.sin(turn)], axis=1)
        # scaled so that the sum of the sines has variance 1, as the normal quantile below assumes
        self._heights = size**-0.6 / np.sqrt(0.5 * (size**-1.2).sum())
        self._phases = rng.uniform(0, 2 * np.pi, 9)
        self._drift = rng.normal(0.0, 0.004, 2)  # cloud heights a second
        self._gusts_hz = rng.uniform(0.4, 4.0, (2, 6))
        self._gust_phases = rng.uniform(0, 2 * np.pi, (2, 6))

    def cloud_mag(self, directions: Floats, unix_s: float) -> Floats:
        """Magnitudes (N,) lost in cloud towards directions (N, 3), east, north, up."""
        config, t = self.config, unix_s - self._start
        lost = np.zeros(np.asarray(directions).shape[:-1])
        if config.cloud_cover > 0.0:
            from scipy.special import ndtri

            # where the line of sight meets a flat layer at height 1; 0.08 keeps it finite at the horizon
            overhead = directions[..., :2] / np.maximum(directions[..., 2:], 0.08)
            phase = (overhead - self._drift * t) @ self._waves.T + self._phases
            height = np.sin(phase) @ self._heights  # about normal, variance 1
            edge = float(ndtri(1.0 - min(config.cloud_cover, 1.0 - 1e-6)))
            lost += config.cloud_mag * np.clip(height - edge, 0.0, 1.0)
        for begin, end, mag in config.banks:
            lost += mag * float(np.clip(min(t - begin, end - t) / 5.0, 0.0, 1.0))
        return np.asarray(lost)

    def shake_rad(self, unix_s: float) -> tuple[float, float]:
        """How far gusts turn the telescope about its camera's x and y axes, now."""
        if not self.config.wind_arcsec:
            return 0.0, 0.0
        t = unix_s - self._start
        swing = np.sin(2 * np.pi * self._gusts_hz * t + self._gust_phases).sum(axis=1) / np.sqrt(3)
        gust = 0.5 + 0.5 * np.sin(t / 7.0 + self._gust_phases[0, 0])
        x, y = np.radians(self.config.wind_arcsec / 3600.0) * gust * swing
        return float(x), float(y)


class SimulatedClock:
    """Seconds since 1970 UTC that pass ``rate`` times as fast as real ones; `set_rate` alone may change that.

    With a rate of 0 time stands still but for :meth:`step` and :meth:`sleep`, so that a test
    is as fast as it can compute and comes out the same every time. Of real time between two looks ``most_s`` pass
    at most: on a busy computer the sky does not run ahead of who follows it. Safe from any thread.
    """

    most_s = inf

    def __init__(self, start_unix_s: float, rate: float = 1.0) -> None:
        self._lock = threading.Lock()
        self.rate = 0.0
        self._base_unix_s, self._base_real_s = start_unix_s, time.monotonic()
        self.set_rate(rate)

    def now_unix(self) -> float:
        """Simulated seconds since 1970 UTC."""
        with self._lock:
            return self._now()

    def now_utc(self) -> datetime:
        """The same as an aware time."""
        return datetime.fromtimestamp(self.now_unix(), UTC)

    def step(self, seconds: float) -> float:
        """Jump ahead by so much and return the new time."""
        if seconds < 0.0:
            raise ValueError("a clock cannot run backwards")
        with self._lock:
            self._base_unix_s += seconds
            return self._now()

    def set_rate(self, rate: float) -> None:
        """Run faster or slower from now on; the time does not jump."""
        if rate < 0.0:
            raise ValueError("a clock cannot run backwards")
        with self._lock:
            self._now()
            self.rate = rate

    def sleep(self, seconds: float) -> None:
        """Let so many simulated seconds pass: by waiting, or by stepping when time stands still."""
        if self.rate == 0.0:
            self.step(max(0.0, seconds))
        else:
            time.sleep(max(0.0, seconds) / self.rate)

    def _now(self) -> float:
        real_s = time.monotonic()
        self._base_unix_s += self.rate * min(real_s - self._base_real_s, self.most_s)
        # each look starts a new base, so that most_s bounds every gap by itself
        self._base_real_s = real_s
        return self._base_unix_s
