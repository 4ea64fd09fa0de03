"""Frames whose blur, tilt and trail are known, drawn here from the error function alone."""

import numpy as np
from scipy.special import erf

TO_SIGMA = 1.0 / 2.3548200450309493


def drawn(size, xy, flux, fwhm, seed=0, sky=300.0, stretch=1.0, angle_deg=0.0):
    """A 16 bit frame (H, W): Gaussian stars averaged over pixels, photon noise; ``fwhm`` (N,) px across the trail.

    ``stretch`` is the ratio of axes, the major one ``angle_deg`` from +x towards +y.
    """
    width, height = size
    image = np.full((height, width), float(sky))
    sub = 5 if stretch != 1.0 else 1
    for (x, y), light, wide in zip(xy, flux, fwhm, strict=True):
        sigma = wide * TO_SIGMA
        reach = int(6 * sigma * stretch) + 3
        x0, x1 = max(0, int(x) - reach), min(width, int(x) + reach + 1)
        y0, y1 = max(0, int(y) - reach), min(height, int(y) + reach + 1)
        if stretch == 1.0:
            across = [
                np.diff(erf((np.arange(a, b + 1) - 0.5 - c) / (sigma * np.sqrt(2)))) / 2
                for a, b, c in ((x0, x1, x), (y0, y1, y))
            ]
            image[y0:y1, x0:x1] += light * across[1][:, None] * across[0]
        else:
            fine = (np.arange(sub) - (sub - 1) / 2) / sub
            px = (np.arange(x0, x1)[:, None] + fine).ravel() - x
            py = (np.arange(y0, y1)[:, None] + fine).ravel() - y
            c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
            along, over = c * px + s * py[:, None], -s * px + c * py[:, None]
            value = np.exp(-0.5 * ((along / (sigma * stretch)) ** 2 + (over / sigma) ** 2))
            value = value.reshape(y1 - y0, sub, x1 - x0, sub).mean(axis=(1, 3))
            image[y0:y1, x0:x1] += light * value / (2 * np.pi * sigma**2 * stretch)
    noisy = np.random.default_rng(seed).poisson(image) + np.random.default_rng(seed + 1).normal(0, 5, image.shape)
    return np.clip(np.rint(noisy), 0, 65535).astype(np.uint16)


def scattered(size, count, seed, margin=15):
    """Places (N, 2) at least 14 px apart, and fluxes (N,) of a usual spread."""
    rng = np.random.default_rng(seed)
    places, n = np.empty((count, 2)), 0
    while n < count:
        places[n] = rng.uniform(margin, np.array(size) - margin)
        n += bool((np.hypot(*(places[:n] - places[n]).T) > 14).all())
    return places, 10 ** rng.uniform(3.6, 5.0, count)
