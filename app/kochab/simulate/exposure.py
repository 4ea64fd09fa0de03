"""One exposure: which stars, how bright, along what paths; as light on the sensor or as a star list."""

from collections.abc import Callable
from datetime import UTC, datetime

import numpy as np

from kochab.core.arrays import Floats, Floats32
from kochab.core.attitude import unit
from kochab.core.camera import Camera
from kochab.core.frame import Detections, Site
from kochab.core.values import frozen
from kochab.simulate.night_sky import EXTINCTION, LocalSky, Weather, airmass, sun_and_moon, surface_mag
from kochab.simulate.star_images import FWHM_PER_SIGMA
from kochab.sky import Catalogue
from kochab.sky.apparent import julian_years

AttitudeAt = Callable[[float], Floats]
"""Rotation (3, 3) from observed directions (E, N, U) to camera axes at a unix time."""

SAMPLES_A_SECOND = 12.0
MOST_SAMPLES = 96
WIDEST_RAD = np.radians(25.0)  # of sky swept in one exposure that is drawn


@frozen(eq=False)
class Paths:
    """Stars (N) over an exposure: ``xy`` (K, N, 2) px at ``times`` (K,), NaN behind the camera.

    ``mag`` (N,) is V at the top of the air, ``directions`` (N, 3) east, north, up at the middle.
    """

    times: Floats
    xy: Floats
    mag: Floats
    directions: Floats
    sky: LocalSky

    def lengths_px(self) -> Floats:
        """Length of each star's trail (N,), px; NaN where part of it lies behind the camera."""
        return np.asarray(np.linalg.norm(np.diff(self.xy, axis=0), axis=2).sum(axis=0))

    def cores(self, spacing_px: float, most: int = 400) -> Floats:
        """Places (M, N, 2) at equal times whose typical distance is ``spacing_px``."""
        whole = self.xy[:, np.isfinite(self.xy).all(axis=(0, 2))]
        if np.linalg.norm(np.ptp(whole, axis=0), axis=1).max(initial=0.0) < 0.5 * spacing_px:
            return np.asarray(self.xy.mean(axis=0)[None])  # no star moves so far that it would show
        count = int(np.clip(np.ceil(np.nanmedian(self.lengths_px()) / spacing_px), 2, most))
        at = (np.arange(count) + 0.5) / count * (len(self.times) - 1)
        low = np.minimum(at.astype(np.intp), len(self.times) - 2)
        part = (at - low)[:, None, None]
        return np.asarray(self.xy[low] * (1.0 - part) + self.xy[low + 1] * part)


class StarPaths:
    """Finds the stars of exposures; remembers the neighbourhood, as consecutive frames share it."""

    def __init__(self, catalogue: Catalogue, site: Site) -> None:
        self._catalogue = catalogue
        self._site = site
        self._near: tuple[Floats, float, float, float] | None = None
        self._vectors = np.empty((0, 3))
        self._mag = np.empty(0)

    def over(self, camera: Camera, attitude_at: AttitudeAt, start: float, exposure_s: float, faintest: float) -> Paths:
        """Paths of all stars over an exposure.

        Parameters
        ----------
        camera : Camera
            Projects them.
        attitude_at : AttitudeAt
            Rotation (3, 3) from east, north, up to camera axes at a unix time.
        start : float
            When it begins, unix time.
        exposure_s : float
            How long.
        faintest : float
            Faintest V.
        """
        samples = int(np.clip(np.ceil(exposure_s * SAMPLES_A_SECOND), 3, MOST_SAMPLES))
        times = start + np.linspace(0.0, exposure_s, samples)
        views = np.stack([attitude_at(float(t)) for t in times])
        middle = start + exposure_s / 2.0
        sky = LocalSky(self._site, middle)
        self._gather(camera, sky, views, middle, faintest)
        now = sky.to_enu(self._vectors)
        first, last = (LocalSky(self._site, t).to_enu(self._vectors) for t in (start, start + exposure_s))
        part = np.linspace(-1.0, 1.0, samples)[:, None, None]
        # the parabola through the directions at the beginning, the middle and the end
        bent = unit(now + 0.5 * part * (last - first) + 0.5 * part * part * (first - 2.0 * now + last))
        xy = camera.project(bent @ views.transpose(0, 2, 1))
        margin = 40.0  # px: a star this far outside still lights the edge
        with np.errstate(invalid="ignore"):
            inside = (xy > -margin).all(axis=2)
            inside &= (xy[..., 0] < camera.width + margin) & (xy[..., 1] < camera.height + margin)
        keep = inside.any(axis=0) & (now[:, 2] > 0.0)
        return Paths(times, xy[:, keep], self._mag[keep], now[keep], sky)

    def _gather(self, camera: Camera, sky: LocalSky, views: Floats, unix_s: float, faintest: float) -> None:
        boresights = views[:, 2]
        middle = boresights[len(boresights) // 2]
        swept = float(np.arccos(np.clip(boresights @ middle, -1.0, 1.0)).max())
        corners = np.array([[x, y] for x in (0.0, camera.width - 1.0) for y in (0.0, camera.height - 1.0)])
        half = float(np.arccos(camera.unproject(corners)[:, 2].min())) * 1.03  # room for distortion
        radius = half + min(swept, float(WIDEST_RAD))
        centre = sky.from_enu(middle)
        if self._near is not None:
            old, old_radius, old_faintest, old_time = self._near
            away = float(np.linalg.norm(centre - old))
            # not much narrower either: else a frame of a narrow field would carry a wide field's stars
            fits = away + radius < old_radius and radius > 0.4 * old_radius
            if fits and faintest == old_faintest and abs(unix_s - old_time) < 86400.0:
                return
        wide = min(1.25 * radius + np.radians(0.1), np.pi)
        year = julian_years(datetime.fromtimestamp(unix_s, UTC))
        rows = self._catalogue.cone(centre, wide, faintest, year)
        self._vectors, self._mag = self._catalogue.vectors(rows, year), self._catalogue.mag(rows)
        self._near = (centre, wide, faintest, unix_s)


COARSE = (19, 25)  # rows and columns of places where the glow is worked out


def electrons(mag: Floats, zero_point_e_s: float, seconds: float) -> Floats:
    """Electrons (N,) of stars of these magnitudes (N,); one of V = 0 above the air gives the zero point a second."""
    return np.asarray(zero_point_e_s * seconds * 10.0 ** (-0.4 * mag))


@frozen(eq=False)
class ExposureLight:
    """Everything the light of one exposure depends on."""

    paths: Paths
    attitude_at: AttitudeAt
    optics: Camera
    zero_point_e_s: float
    weather: Weather

    @property
    def seconds(self) -> float:
        """How long light is gathered."""
        return float(self.paths.times[-1] - self.paths.times[0])

    @property
    def middle(self) -> float:
        """Unix time of mid-exposure."""
        return float(self.paths.times[-1] + self.paths.times[0]) / 2.0


def starlight(light: ExposureLight) -> Floats:
    """Electrons (N,) that each star leaves on the sensor."""
    directions = light.paths.directions
    lost = EXTINCTION * airmass(directions) + light.weather.cloud_mag(directions, light.middle)
    return electrons(light.paths.mag + lost, light.zero_point_e_s, light.seconds)


def sky_electrons(light: ExposureLight) -> Floats:
    """Electrons a pixel of the sky on a coarse grid (COARSE), edge to edge."""
    rows, columns = COARSE
    y = np.linspace(0.0, light.optics.height - 1.0, rows)
    x = np.linspace(0.0, light.optics.width - 1.0, columns)
    pixels = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    directions = light.optics.unproject(pixels) @ light.attitude_at(light.middle)
    mag = surface_mag(directions, sun_and_moon(light.paths.sky, light.middle))
    through = 10.0 ** (-0.4 * light.weather.cloud_mag(directions, light.middle))
    area = light.optics.scale_arcsec_px**2
    dark = electrons(mag, light.zero_point_e_s, light.seconds) * area
    # Clouds over towns or under the Moon scatter: the sky behind them grows brighter.
    lit = dark * (1.0 + (1.0 - through))
    return np.asarray(np.where(directions[:, 2] > 0.0, lit, 0.1 * dark).reshape(rows, columns))


def background(light: ExposureLight) -> Floats32:
    """Electrons (H, W) of the sky alone, interpolated between the coarse places."""
    grid = sky_electrons(light)
    nodes = np.arange(grid.shape[1])
    across = np.linspace(0.0, nodes[-1], light.optics.width)
    # np.interp rather than a product of matrices: BLAS would wake all its threads for it.
    lines = np.stack([np.interp(across, nodes, line) for line in grid]).astype(np.float32)
    out = np.empty((light.optics.height, light.optics.width), dtype=np.float32)
    at = np.linspace(0.0, len(lines) - 1.0, len(out), dtype=np.float32)
    above = np.minimum(at.astype(np.intp), len(lines) - 2)
    for k in range(len(lines) - 1):
        band = slice(*np.searchsorted(above, [k, k + 1]))
        np.multiply((at[band] - k)[:, None], lines[k + 1] - lines[k], out=out[band])
        out[band] += lines[k]
    return out


# -- An exposure as a detector would list it, without making pixels: for runs by the hundred ------

FAINTEST_SNR = 6.0
FALSE_STARS = 0.02
MOST_STARS = 300
FLOOR_PX = 0.03  # no centroid is better: pixels are not evenly sensitive


def star_list(light: ExposureLight, fwhm_px: float, read_noise_e: float, rng: np.random.Generator) -> Detections:
    """Stars above ``FAINTEST_SNR`` with the errors that their light allows.

    A centroid's error is the image's sigma over the signal-to-noise ratio, with a floor of
    0.03 px. False stars are :data:`FALSE_STARS` of the real ones, rounded by chance.

    Parameters
    ----------
    light : ExposureLight
        The stars' paths and the sky's light.
    fwhm_px : float
        Width of a star's image.
    read_noise_e : float
        RMS of reading a pixel, electrons.
    rng : np.random.Generator
        Draws the errors.
    """
    width, height = light.optics.width, light.optics.height
    xy, flux = _over_time(light.paths.xy), starlight(light)
    away = light.paths.xy - xy
    xx, yy, both = (_over_time(away[..., i] * away[..., j]) for i, j in ((0, 0), (1, 1), (0, 1)))
    # the major axis of the second moments; one angle for all, as stars trail nearly alike
    angle = 0.5 * float(np.arctan2(2.0 * both.sum(), xx.sum() - yy.sum()))
    middle, half = (xx + yy) / 2.0, np.hypot((xx - yy) / 2.0, both)
    spread = np.stack([middle + half, np.maximum(middle - half, 0.0)], axis=1)  # px^2, along, across
    level = float(np.median(sky_electrons(light)))
    core = (fwhm_px / FWHM_PER_SIGMA) ** 2
    # noise-equivalent area of an elongated Gaussian: 4 pi times the two sigmas
    areas = 4.0 * np.pi * np.sqrt((core + spread[:, 0]) * (core + spread[:, 1]))
    snr = flux / np.sqrt(flux + areas * (level + read_noise_e**2))
    seen = (snr > FAINTEST_SNR) & (xy > -0.5).all(axis=1)
    seen &= (xy[:, 0] < width - 0.5) & (xy[:, 1] < height - 0.5)
    xy, flux, snr, spread = xy[seen], flux[seen], snr[seen], spread[seen]
    error = np.hypot(np.sqrt(core + spread.sum(axis=1)) / snr, FLOOR_PX)
    xy = xy + rng.normal(size=xy.shape) * error[:, None]
    flux = flux * (1.0 + rng.normal(size=len(flux)) / snr)
    extra = int(rng.poisson(FALSE_STARS * len(xy)))
    if extra:
        like = rng.integers(0, len(xy), extra)
        false = rng.uniform(-0.5, [width - 0.5, height - 0.5], (extra, 2))
        xy = np.concatenate([xy, false])
        flux, snr, spread = (np.concatenate([values, values[like]]) for values in (flux, snr, spread))
    order = np.argsort(-flux, kind="stable")[:MOST_STARS]
    along, across = np.sqrt(core + spread[order]).T
    fwhm, elongation = FWHM_PER_SIGMA * np.sqrt(along * across), along / across
    angles, no = np.full(len(order), angle), np.zeros(len(order), dtype=np.bool_)
    listed = xy[order], flux[order], snr[order], fwhm, elongation, angles, no, no
    return Detections(width, height, *listed, level, float(np.sqrt(level)))


def _over_time(values: Floats) -> Floats:
    """The mean over an exposure of values (K, ...) at equal steps, its ends counted half."""
    weights = np.ones(len(values))
    # the trapezoid rule: the end samples stand for half a step
    weights[[0, -1]] = 0.5
    return np.asarray(np.tensordot(weights / weights.sum(), values, axes=1))
