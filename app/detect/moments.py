"""Sizes, shapes and places of bright or odd stars by adaptive moments.

The weight is an elliptical Gaussian that is made as large as the star itself: of a Gaussian star
seen through its own shape the weighted second moments are half the true ones, and the iteration
sits still (Bernstein & Jarvis 2002, AJ 123, 583, section 3).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.detect.stamps import Stamps

Floats = NDArray[np.float64]
FWHM_PER_SIGMA = 2.0 * float(np.sqrt(2.0 * np.log(2.0)))
PIXEL_VARIANCE = 1.0 / 12.0  # of a square pixel, px^2


@dataclass(frozen=True, slots=True, eq=False)
class Shapes:
    """``dx``, ``dy`` (N,) px from the stamp's middle; ``xx``, ``yy``, ``xy`` (N,) px^2; ``flux``.

    ``good`` (N,) says that the iteration settled inside the stamp.
    """

    dx: Floats
    dy: Floats
    xx: Floats
    yy: Floats
    xy: Floats
    flux: Floats
    good: NDArray[np.bool_]

    def axes(self) -> tuple[Floats, Floats, Floats]:
        """Sigma along the major and the minor axis, px, and the major axis' angle, rad."""
        return principal_axes(self.xx, self.yy, self.xy)


def principal_axes(xx: Floats, yy: Floats, xy: Floats) -> tuple[Floats, Floats, Floats]:
    """Sigma of the major and minor axis and the angle (from +x to +y) of second moments (N,)."""
    mean, half = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    major = np.sqrt(np.maximum(mean + half, 1e-12))
    minor = np.sqrt(np.maximum(mean - half, 1e-12))
    return major, minor, 0.5 * np.arctan2(2.0 * xy, xx - yy)


def adaptive_moments(
    stamps: Stamps, sigma_px: float, steps: int = 12, least_px: float = 0.2
) -> Shapes:
    """Moments of every stamp, from a round weight of ``sigma_px``, never below ``least_px``."""
    n, size, _ = stamps.value.shape
    u = stamps.offsets.astype(np.float64)
    x, y = np.zeros(n), np.zeros(n)
    xx, yy, xy = np.full(n, sigma_px**2), np.full(n, sigma_px**2), np.zeros(n)
    limit, flux, good = size / 2.0 - 1.0, np.zeros(n), np.ones(n, dtype=np.bool_)
    for _ in range(steps):
        px, py = u - x[:, None], u - y[:, None]
        det = np.maximum(xx * yy - xy * xy, 1e-6)
        a, b, c = yy / det, xx / det, -xy / det
        power = a[:, None, None] * (px * px)[:, None, :] + b[:, None, None] * (py * py)[:, :, None]
        power += (2.0 * c)[:, None, None] * px[:, None, :] * py[:, :, None]
        light = np.exp(-0.5 * power) * stamps.value
        cols, rows = light.sum(axis=1), light.sum(axis=2)
        total = cols.sum(axis=1)
        good &= total > 0
        safe = np.where(total > 0, total, np.inf)
        mx, my = (cols * px).sum(axis=1) / safe, (rows * py).sum(axis=1) / safe
        sxx = (cols * px * px).sum(axis=1) / safe - mx * mx
        syy = (rows * py * py).sum(axis=1) / safe - my * my
        sxy = np.einsum("nij,nj,ni->n", light, px, py) / safe - mx * my
        flux = 2.0 * total
        before = np.stack([x, y, xx, yy])
        x, y = np.clip(x + 2.0 * mx, -limit, limit), np.clip(y + 2.0 * my, -limit, limit)
        xx, yy, xy = _bounded(2.0 * sxx, 2.0 * syy, 2.0 * sxy, least_px, limit)
        if np.all(np.abs(np.stack([x, y, xx, yy]) - before) < 2e-3):
            break
    major, minor, _ = principal_axes(xx, yy, xy)
    good &= (np.hypot(x, y) < limit) & (major < 0.98 * limit) & (minor > 0.3)
    return Shapes(x, y, xx, yy, xy, flux, good)


def _bounded(
    xx: Floats, yy: Floats, xy: Floats, least: float, most: float
) -> tuple[Floats, Floats, Floats]:
    """Second moments held between the squares of two sizes."""
    xx, yy = np.clip(xx, least**2, most**2), np.clip(yy, least**2, most**2)
    across = np.sqrt(np.maximum(xx - 0.99 * least**2, 0) * np.maximum(yy - 0.99 * least**2, 0))
    return xx, yy, np.clip(xy, -0.995 * across, 0.995 * across)
