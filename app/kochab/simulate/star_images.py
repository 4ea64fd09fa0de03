"""Star images on a frame: point-spread functions, trails, noise and what sensors do to them.

Light is counted in electrons until the last step. Every pixel holds the light that falls on its area, not the value
at its middle: a Gaussian by the error function, a Moffat by 3 x 3 Gauss-Legendre nodes a pixel.
"""

from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Floats, Floats32
from kochab.core.frame import Frame
from kochab.core.values import frozen

FWHM_PER_SIGMA = 2.0 * float(np.sqrt(2.0 * np.log(2.0)))
HOT_E = (500.0, 30000.0)  # of a hot pixel, least and most
BAND = 256  # rows that are made at once: noise for a whole 61 MP frame would need 250 MB


@frozen
class RenderedStar:
    """The image of one star: a Gaussian, or a Moffat of index ``beta``, of ``fwhm_px``.

    ``trail_px`` (dx, dy) smears it evenly; ``ring_px`` (inner, outer) is the out-of-focus image
    of an annular aperture, convolved with the core.
    """

    fwhm_px: float = 3.0
    beta: float | None = None
    trail_px: tuple[float, float] = (0.0, 0.0)
    ring_px: tuple[float, float] | None = None

    def points(self) -> Floats:
        """Offsets (M, 2) px at which cores of equal flux add up to the image."""
        at = np.zeros((1, 2))
        spacing = 0.25 * self.fwhm_px
        if self.ring_px is not None:
            inner, outer = self.ring_px
            ticks = np.linspace(-outer, outer, 1 + 2 * int(np.ceil(outer / spacing)))
            grid = np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)
            r = np.hypot(*grid.T).round(9)  # on both sides alike
            at = grid[(r >= inner) & (r <= outer)]
        length = float(np.hypot(*self.trail_px))
        if length > 0:
            along = (np.arange(n := 1 + int(np.ceil(length / spacing))) + 0.5) / n - 0.5
            at = (at[:, None] + along[:, None] * np.array(self.trail_px)).reshape(-1, 2)
        return at

    @property
    def reach_px(self) -> float:
        """Radius of the core's stamp: 5 sigma, or what holds all but 1 % of a Moffat."""
        return self.fwhm_px * (2.2 if self.beta is None else 4.0)


@frozen
class Sensor:
    """Electrons to numbers. ``gain_e`` is electrons a unit; ``saturation`` and ``bias`` units."""

    gain_e: float = 1.0
    read_noise_e: float = 5.0
    bias: float = 100.0
    saturation: float = 65535.0
    bayer: str | None = None
    response: dict[str, float] = field(default_factory=lambda: {"R": 0.6, "G": 1.0, "B": 0.7})  # of the filters


@frozen
class Sky:
    """Background: ``level_e`` electrons a pixel amid, ``gradient_e`` (x, y) edge to edge."""

    level_e: float = 400.0
    gradient_e: tuple[float, float] = (0.0, 0.0)
    hot_per_mp: float = 0.0
    rays: int = 0


def render(
    width: int,
    height: int,
    xy: Floats,
    flux_e: Floats,
    image: RenderedStar | None = None,
    sky: Sky | None = None,
    sensor: Sensor | None = None,
    seed: int = 0,
) -> Frame:
    """A uint16 frame of stars.

    Noise is Poisson in the light (normal where all of it is above 30 e) and normal in reading.

    Parameters
    ----------
    width, height : int
        Size of the frame, px.
    xy : Floats
        Places (N, 2), px.
    flux_e : Floats
        Electrons of each star (N,).
    image : RenderedStar or None
        A star's shape; None for the usual.
    sky : Sky or None
        Background and rays; None: dark.
    sensor : Sensor or None
        Gain, noise and mosaic; None for the usual.
    seed : int
        Draws the noise.
    """
    image, sky, sensor = image or RenderedStar(), sky or Sky(), sensor or Sensor()
    rng = np.random.default_rng(seed)
    light = np.zeros((height, width), dtype=np.float32)
    add_stars(light, np.asarray(xy, dtype=np.float64), np.asarray(flux_e, dtype=np.float64), image)
    return expose(light, sky, sensor, rng)


def expose(light: Floats32, sky: Sky, sensor: Sensor, rng: np.random.Generator, noise: Floats32 | None = None) -> Frame:
    """The uint16 frame of light.

    Parameters
    ----------
    light : Floats32
        Electrons (H, W); used up.
    sky : Sky
        Background and rays.
    sensor : Sensor
        Gain, noise and mosaic.
    rng : np.random.Generator
        Draws the noise.
    noise : Floats32 or None
        At least H x W numbers of a normal distribution, which saves making new ones; None: they are made.
    """
    height, width = light.shape
    out = np.empty((height, width), dtype=np.uint16)
    x = np.linspace(-0.5, 0.5, width, dtype=np.float32) * np.float32(sky.gradient_e[0])
    y = np.linspace(-0.5, 0.5, height, dtype=np.float32) * np.float32(sky.gradient_e[1])
    light_filter = None
    if sensor.bayer is not None:  # two rows of the mosaic's responses
        cell = np.array([sensor.response[c] for c in sensor.bayer], dtype=np.float32).reshape(2, 2)
        light_filter = np.tile(cell, (1, width // 2 + 1))[:, :width]
    for top in range(0, height, BAND):
        band = light[top : top + BAND]
        if sky.level_e or any(sky.gradient_e):
            band += np.float32(sky.level_e) + x + y[top : top + BAND, None]
            np.maximum(band, 0.0, out=band)
        if light_filter is not None:
            band *= np.resize(light_filter, band.shape)
        ready = None if noise is None else noise.ravel()[top * width :][: band.size]
        out[top : top + BAND] = _read_out(band, sensor, rng, ready)
    _add_hot_pixels(out, sky, sensor, rng)
    _add_rays(out, sky, sensor, rng)
    return Frame(out, bayer=sensor.bayer, saturation=sensor.saturation)


def add_stars(light: Floats32, xy: Floats, flux: Floats, image: RenderedStar) -> None:
    """Add stars to light, in place.

    Parameters
    ----------
    light : Floats32
        Electrons (H, W), contiguous.
    xy : Floats
        Places (N, 2), px.
    flux : Floats
        Electrons of each star (N,).
    image : RenderedStar
        A star's shape.
    """
    at = image.points()
    places = (xy[:, None] + at).reshape(-1, 2)
    shares = np.repeat(flux / len(at), len(at))
    for k in range(0, len(places), 4096):
        _add_cores(light, places[k : k + 4096], shares[k : k + 4096], image)


def _add_cores(light: Floats32, xy: Floats, flux: Floats, image: RenderedStar) -> None:
    half = int(np.ceil(image.reach_px)) + 1
    reach = np.arange(-half, half + 1)
    height, width = light.shape
    middle = np.rint(xy).astype(np.intp)
    near = (middle > -half).all(axis=1) & (middle < np.array([width, height]) + half).all(axis=1)
    xy, flux, middle = xy[near], flux[near], middle[near]
    columns, rows = middle[:, :1] + reach, middle[:, 1:] + reach
    dx, dy = columns - xy[:, :1], rows - xy[:, 1:]
    # all at once: a loop over stars took most of a frame's time. What is outside adds nothing, at the nearest pixel.
    x, y = columns.clip(0, width - 1), rows.clip(0, height - 1)
    down, across = flux[:, None] * (rows == y), (columns == x).astype(np.float64)
    if image.beta is None:  # a product of two: nothing else is worked out pixel by pixel
        down, across = down * _along(dy, image), across * _along(dx, image)
    stamp = down.astype(np.float32)[:, :, None] * across.astype(np.float32)[:, None, :]
    if image.beta is not None:
        stamp *= _moffat(dx, dy, image)
    np.add.at(light.reshape(-1), (y[:, :, None] * width + x[:, None]).reshape(-1), stamp.reshape(-1))


def _along(away_px: Floats, image: RenderedStar) -> Floats:
    """Fraction of a Gaussian in each of K neighbouring pixels (N, K), centred ``away_px`` (N, K) from it."""
    from scipy.special import ndtr

    edges = np.concatenate([away_px - 0.5, away_px[:, -1:] + 0.5], axis=1)
    return np.diff(ndtr(edges / (image.fwhm_px / FWHM_PER_SIGMA)), axis=1)


def _moffat(dx: Floats, dy: Floats, image: RenderedStar) -> Floats:
    beta = image.beta or 4.765
    core2 = (image.fwhm_px / 2.0) ** 2 / (2.0 ** (1.0 / beta) - 1.0)
    # Gauss-Legendre nodes of three points on a pixel of width 1, weights 5/18, 8/18, 5/18
    node = 0.5 * np.sqrt(0.6)
    total = np.zeros((len(dx), dy.shape[1], dx.shape[1]))
    for sx, wx in ((-node, 5 / 18), (0.0, 8 / 18), (node, 5 / 18)):
        for sy, wy in ((-node, 5 / 18), (0.0, 8 / 18), (node, 5 / 18)):
            r2 = ((dy + sy) ** 2)[:, :, None] + ((dx + sx) ** 2)[:, None, :]
            total += wx * wy * (1.0 + r2 / core2) ** -beta
    return np.asarray(total * (beta - 1.0) / (np.pi * core2))


def _read_out(
    light: Floats32, sensor: Sensor, rng: np.random.Generator, ready: Floats32 | None = None
) -> NDArray[np.uint16]:
    """Electrons to units, with noise (normal when it is ``ready`` made), rounding and clipping."""
    if ready is not None:
        read = np.sqrt(light + np.float32(sensor.read_noise_e**2))
        read *= ready.reshape(light.shape)
        read += light
        read *= np.float32(1.0 / sensor.gain_e)
        read += np.float32(sensor.bias + 0.5)
        np.clip(read, 0.0, sensor.saturation, out=read)
        return np.asarray(read, dtype=np.uint16)
    noise = rng.standard_normal(light.shape, dtype=np.float32)
    # Poisson numbers are slow to draw, so only for small frames with faint light; above 30 e normal is close enough
    if 0 < light.size <= 4_000_000 and float(light.min()) < 30.0:
        read = rng.poisson(light).astype(np.float32) + np.float32(sensor.read_noise_e) * noise
    else:
        read = light + noise * np.sqrt(light + np.float32(sensor.read_noise_e**2))
    units = read / np.float32(sensor.gain_e) + np.float32(sensor.bias + 0.5)
    return np.asarray(np.clip(units, 0.0, sensor.saturation), dtype=np.uint16)


def _add_hot_pixels(out: NDArray[np.uint16], sky: Sky, sensor: Sensor, rng: np.random.Generator) -> None:
    count = round(sky.hot_per_mp * out.size / 1e6)
    y, x = rng.integers(0, out.shape[0], count), rng.integers(0, out.shape[1], count)
    low, high = np.log(HOT_E)
    extra = np.exp(rng.uniform(low, high, count)) / sensor.gain_e
    out[y, x] = np.minimum(out[y, x] + extra, sensor.saturation).astype(np.uint16)


def _add_rays(out: NDArray[np.uint16], sky: Sky, sensor: Sensor, rng: np.random.Generator) -> None:
    """Tracks of 1 to 12 pixels, a few hundred to a few thousand electrons a pixel."""
    for _ in range(sky.rays):
        start, angle = rng.random(2) * (np.array(out.shape)[::-1] - 1), rng.uniform(0, 2 * np.pi)
        steps = np.arange(0.0, rng.uniform(1.0, 12.0), 0.7)[:, None]
        x, y = np.rint(start + steps * [np.cos(angle), np.sin(angle)]).astype(np.intp).T
        inside = (x >= 0) & (y >= 0) & (x < out.shape[1]) & (y < out.shape[0])
        x, y = x[inside], y[inside]
        extra = rng.uniform(300.0, 6000.0, len(x)) / sensor.gain_e
        out[y, x] = np.minimum(out[y, x] + extra, sensor.saturation).astype(np.uint16)
