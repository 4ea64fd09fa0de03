"""The simulated camera: what it is, and frames of wherever the mount really points."""

from dataclasses import field, replace
from datetime import UTC, datetime

import numpy as np

from kochab.core.arrays import Floats, Floats32
from kochab.core.camera import Camera
from kochab.core.frame import Frame, Hint, Site
from kochab.core.values import frozen
from kochab.simulate.exposure import AttitudeAt, ExposureLight, StarPaths, background, electrons, starlight
from kochab.simulate.night_sky import DARK_MAG, EXTINCTION, LocalSky, Weather, airmass
from kochab.simulate.star_images import FWHM_PER_SIGMA, RenderedStar, Sensor, Sky, add_stars, expose
from kochab.simulate.visitors import Visitor, light_of
from kochab.sky import Catalogue

FWHM_STEP = 0.04
"""px: stars of one width are drawn together."""
LONG_TRAIL = 64
"""Stamps per star: above this, stars are left out whose light, spread along the trail, is lost in the noise."""


@frozen
class CameraConfig:
    """A camera on a telescope; the default is a 1.2 MP guide camera with a field of 2.4 deg.

    Distortion as in :mod:`kochab.core.camera`. ``zero_point_e_s``: electrons a second of a star of V = 0 above the
    air. Stars fainter than ``faintest``, or than the noise, are left out. ``tilt_px`` is how much wider stars are half
    a diagonal to the right and down than amid, as on a tilted sensor. Noise is normal, which photons behind reading
    noise are nearly; ``cheap`` takes it from a pool that is made once, for 30 frames a second.
    """

    width: int = 1280
    height: int = 960
    fov_deg: float = 2.4
    mirrored: bool = False
    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    fwhm_px: float = 2.6
    tilt_px: tuple[float, float] = (0.0, 0.0)
    zero_point_e_s: float = 2e7
    faintest: float = 13.0
    sensor: Sensor = field(default_factory=lambda: Sensor(1.0, 5.0, 100.0))
    hot_per_mp: float = 20.0
    hot_e_s: tuple[float, float] = (20.0, 3000.0)
    rays_per_minute: float = 1.0
    cheap: bool = False
    name: str = "simulated camera"

    def optics(self) -> Camera:
        """The same as the :class:`~kochab.core.camera.Camera` that a solver should find."""
        focal = self.width / 2.0 / np.tan(np.radians(self.fov_deg) / 2.0)
        plain = Camera.centred(self.width, self.height, float(focal), self.mirrored)
        return replace(plain, k1=self.k1, k2=self.k2, p1=self.p1, p2=self.p2)


class SkyCamera:
    """Takes frames; the same seed and the same exposures give the same pixels."""

    def __init__(self, config: CameraConfig, catalogue: Catalogue, site: Site, weather: Weather, seed: int = 0) -> None:
        self.config = config
        self.optics = config.optics()
        self.site = site
        self.weather = weather
        self._stars = StarPaths(catalogue, site)
        # a stream of its own for each purpose: more frames do not move the hot pixels
        self._rng = np.random.default_rng([seed, 11])
        hot, size = np.random.default_rng([seed, 12]), config.width * config.height
        self._hot = hot.choice(size, round(config.hot_per_mp * size / 1e6), replace=False).astype(np.intp)
        low, high = np.log(config.hot_e_s)
        self._hot_e_s = np.exp(hot.uniform(low, high, len(self._hot)))
        self._pool: Floats32 | None = None
        self.visitors: tuple[Visitor, ...] = ()

    def faintest(self, exposure_s: float) -> float:
        """V of the stars that are half lost in the noise of a dark night, in half magnitudes."""
        lost = float(self._half_lost_e(exposure_s, np.zeros(1))[0])
        mag = 2.5 * np.log10(self.config.zero_point_e_s * exposure_s / lost)
        return float(min(self.config.faintest, np.ceil(2.0 * mag) / 2.0))

    def _half_lost_e(self, exposure_s: float, trail_px: Floats) -> Floats:
        """Signal (N,), electrons, of stars with trails this long (N,), px, that are half lost in a dark sky's noise."""
        pixel = self.optics.scale_arcsec_px**2
        dark = electrons(np.array(DARK_MAG), self.config.zero_point_e_s, exposure_s) * pixel
        # the noise-equivalent area of a Gaussian, 4 pi sigma^2 px, and of a line as wide, 2 sqrt(pi) sigma px a pixel
        sigma = self.config.fwhm_px / FWHM_PER_SIGMA
        area = 4.0 * np.pi * sigma**2 + 2.0 * np.sqrt(np.pi) * sigma * trail_px
        # signal-to-noise 2 of the background alone
        return np.asarray(2.0 * np.sqrt(area * (float(dark) + self.config.sensor.read_noise_e**2)))

    def light(self, attitude_at: AttitudeAt, start: float, exposure_s: float) -> ExposureLight:
        """The light of stars and sky in an exposure from unix time ``start`` on."""
        paths = self._stars.over(self.optics, attitude_at, start, exposure_s, self.faintest(exposure_s))
        return ExposureLight(paths, attitude_at, self.optics, self.config.zero_point_e_s, self.weather)

    def frame(self, attitude_at: AttitudeAt, start: float, exposure_s: float, gain_e: float = 0.0) -> Frame:
        """The frame of an exposure.

        Parameters
        ----------
        attitude_at : AttitudeAt
            Rotation (3, 3) from east, north, up to camera axes at a unix time.
        start : float
            When it begins, unix time.
        exposure_s : float
            How long.
        gain_e : float
            Electrons a unit; 0: the sensor's own.
        """
        light = self.light(attitude_at, start, exposure_s)
        image_e = background(light)
        cores, flux = light.paths.cores(0.4 * self.config.fwhm_px), starlight(light)
        if len(cores) > LONG_TRAIL:
            # while a mount slews: a second a frame, for stars that no one sees
            seen = ~(flux < self._half_lost_e(exposure_s, light.paths.lengths_px()))
            cores, flux = cores[:, seen], flux[seen]
        places, shares = cores.reshape(-1, 2), np.tile(flux / len(cores), len(cores))
        if self.visitors:
            more, light_e = self._visitors_light(attitude_at, start, exposure_s)
            places, shares = np.concatenate([places, more]), np.concatenate([shares, light_e])
        seen = np.isfinite(places).all(axis=1) & (shares > 0.0)
        self._add(image_e, places[seen], shares[seen])
        image_e.ravel()[self._hot] += (self._hot_e_s * exposure_s).astype(np.float32)
        rays = int(self._rng.poisson(self.config.rays_per_minute * exposure_s / 60.0))
        sensor = replace(self.config.sensor, gain_e=gain_e) if gain_e else self.config.sensor
        taken = expose(image_e, Sky(0.0, rays=rays), sensor, self._rng, self._noise(image_e.size))
        return replace(taken, hint=self.hint(start, exposure_s))

    def _add(self, image_e: Floats32, places: Floats, shares: Floats) -> None:
        """Add cores to light, in place: wider ones where a tilted sensor is out of focus."""
        across, down = self.config.tilt_px
        if not (across or down):
            add_stars(image_e, places, shares, RenderedStar(self.config.fwhm_px))
            return
        middle = (np.array([self.config.width, self.config.height]) - 1.0) / 2.0
        u, v = ((places - middle) / (np.hypot(self.config.width, self.config.height) / 2.0)).T
        steps = np.rint((self.config.fwhm_px + across * u + down * v) / FWHM_STEP).astype(np.intp)
        for step in np.unique(steps).tolist():
            same = steps == step
            add_stars(image_e, places[same], shares[same], RenderedStar(max(step * FWHM_STEP, 0.5)))

    def _visitors_light(self, attitude_at: AttitudeAt, start: float, exposure_s: float) -> tuple[Floats, Floats]:
        """Places (M, 2) px and electrons (M,) of what crosses the frame."""

        def project(vectors: Floats, times: Floats) -> Floats:
            seen = [
                attitude_at(t) @ LocalSky(self.site, t).to_enu(vector[None])[0]
                if np.isfinite(vector).all()
                else np.full(3, np.nan)
                for vector, t in zip(vectors, times.tolist(), strict=True)
            ]
            return self.optics.project(np.array(seen))

        span = (start, start + exposure_s)
        places, mags, seconds = light_of(self.visitors, project, self.optics, span, 0.4 * self.config.fwhm_px)
        if not len(places):
            return places, mags
        middle = start + exposure_s / 2.0
        directions = self.optics.unproject(places) @ attitude_at(middle)
        mags = mags + EXTINCTION * airmass(directions) + self.weather.cloud_mag(directions, middle)
        return places, electrons(mags, self.config.zero_point_e_s, 1.0) * seconds

    def hint(self, start: float, exposure_s: float) -> Hint:
        """What a header would say of an exposure."""
        scale = self.optics.scale_arcsec_px
        return Hint(
            scale_arcsec_px=(0.97 * scale, 1.03 * scale),
            time_utc=datetime.fromtimestamp(start + exposure_s / 2.0, UTC),
            exposure_s=exposure_s,
            site=self.site,
            camera=self.config.name,
            source="the simulated camera",
        )

    def _noise(self, size: int) -> Floats32:
        if not self.config.cheap:
            return self._rng.standard_normal(size, dtype=np.float32)
        # the pool is 262,144 numbers longer than a frame, so that each frame starts elsewhere in it
        if self._pool is None or len(self._pool) < size:
            self._pool = self._rng.standard_normal(size + (1 << 18), dtype=np.float32)
        first = int(self._rng.integers(0, len(self._pool) - size + 1))
        return self._pool[first : first + size]
