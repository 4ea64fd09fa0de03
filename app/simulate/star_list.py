"""An exposure as a detector would list it, without making pixels: for runs by the hundred."""

import numpy as np
from numpy.typing import NDArray

from app.core.detections import Detections
from app.simulate.light import Light, sky_electrons, starlight
from app.simulate.stars import FWHM_PER_SIGMA

Floats = NDArray[np.float64]
FAINTEST_SNR = 6.0
FLOOR_PX = 0.03  # no centroid is better: pixels are not evenly sensitive


def star_list(
    light: Light, fwhm_px: float, read_noise_e: float, rng: np.random.Generator,
    false_stars: float = 0.02, most: int = 300,
) -> Detections:  # fmt: skip
    """Stars above ``FAINTEST_SNR`` with the errors that their light allows.

    A centroid's error is the image's sigma over the signal-to-noise ratio, with a floor of
    0.03 px. ``false_stars`` is their number as a share of the real ones, rounded by chance.
    """
    width, height = light.optics.width, light.optics.height
    xy, flux, spread = _over_time(light.paths.xy), starlight(light), _spread(light)
    level = float(np.median(sky_electrons(light)))
    core = (fwhm_px / FWHM_PER_SIGMA) ** 2
    areas = 4.0 * np.pi * np.sqrt((core + spread[:, 0]) * (core + spread[:, 1]))
    snr = flux / np.sqrt(flux + areas * (level + read_noise_e**2))
    seen = (snr > FAINTEST_SNR) & (xy > -0.5).all(axis=1)
    seen &= (xy[:, 0] < width - 0.5) & (xy[:, 1] < height - 0.5)
    xy, flux, snr, spread = xy[seen], flux[seen], snr[seen], spread[seen]
    error = np.hypot(np.sqrt(core + spread.sum(axis=1)) / snr, FLOOR_PX)
    xy = xy + rng.normal(size=xy.shape) * error[:, None]
    flux = flux * (1.0 + rng.normal(size=len(flux)) / snr)
    extra = int(rng.poisson(false_stars * len(xy)))
    if extra:
        like = rng.integers(0, len(xy), extra)
        false = rng.uniform(-0.5, [width - 0.5, height - 0.5], (extra, 2))
        xy, flux, snr = np.concatenate([xy, false]), _more(flux, like), _more(snr, like)
        spread = np.concatenate([spread, spread[like]])
    order = np.argsort(-flux, kind="stable")[:most]
    return _listed(light, xy[order], flux[order], snr[order], spread[order], core, level)


def _more(values: Floats, like: NDArray[np.intp]) -> Floats:
    return np.concatenate([values, values[like]])


def _over_time(values: Floats) -> Floats:
    """The mean over an exposure of values (K, ...) at equal steps, its ends counted half."""
    weights = np.ones(len(values))
    weights[[0, -1]] = 0.5
    return np.asarray(np.tensordot(weights / weights.sum(), values, axes=1))


def _moments(light: Light) -> tuple[Floats, Floats, Floats]:
    """Second moments xx, yy, xy (N,) px^2 of the trails."""
    away = light.paths.xy - _over_time(light.paths.xy)
    x, y = away[..., 0], away[..., 1]
    return _over_time(x * x), _over_time(y * y), _over_time(x * y)


def _spread(light: Light) -> Floats:
    """Variances (N, 2) px^2 along the trail and across it."""
    xx, yy, xy = _moments(light)
    middle, half = (xx + yy) / 2.0, np.hypot((xx - yy) / 2.0, xy)
    return np.stack([middle + half, np.maximum(middle - half, 0.0)], axis=1)


def _listed(
    light: Light, xy: Floats, flux: Floats, snr: Floats, spread: Floats, core: float, level: float
) -> Detections:
    along, across = np.sqrt(core + spread).T
    xx, yy, xy_ = (float(moment.sum()) for moment in _moments(light))
    angle = 0.5 * float(np.arctan2(2.0 * xy_, xx - yy))
    no = np.zeros(len(xy), dtype=np.bool_)
    return Detections(
        light.optics.width, light.optics.height, xy, flux, snr,
        FWHM_PER_SIGMA * np.sqrt(along * across), along / across, np.full(len(xy), angle),
        no, no, level, float(np.sqrt(level)),
    )  # fmt: skip
