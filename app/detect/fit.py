"""Place and flux of every star by fitting the frame's own star image to it.

The image is a Gaussian averaged over each pixel; flux and place are found by Gauss-Newton steps
of least squares with equal weights, which is the maximum likelihood where the background makes
the noise. Unused pixels (mosaic, saturated, broken) simply do not take part.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.detect.stamps import Stamp, Stamps

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Fits:
    """``dx``, ``dy`` (N,) px from the stamps' middles, ``flux`` (N,), and two significances (N,).

    ``snr`` is that of the fitted flux, ``snr_pixel`` that of the brightest single pixel, both for
    a noise of 1 a pixel. ``moments`` (N, 3) are xx, yy, xy weighted by the star image, px^2.
    """

    dx: Floats
    dy: Floats
    flux: Floats
    snr: Floats
    snr_pixel: Floats
    moments: Floats


def fit_stars(stamps: Stamps, covariance: Floats, steps: int = 4) -> Fits:
    """Fit stamps with the star image whose second moments (2, 2) px^2 are ``covariance``."""
    n = len(stamps.value)
    x, y = np.zeros(n, dtype=np.float32), np.zeros(n, dtype=np.float32)
    limit = np.float32(stamps.value.shape[1] / 2.0 - 1.0)
    for _ in range(steps):
        image, gx, gy = _star_image(stamps.offsets, x, y, covariance)
        flux, mx, my = _solve(image, gx, gy, stamps)
        safe = np.where(flux > 0, flux, np.inf)
        x = np.clip(x + np.clip(mx / safe, -1, 1), -limit, limit).astype(np.float32)
        y = np.clip(y + np.clip(my / safe, -1, 1), -limit, limit).astype(np.float32)
    image, _, _ = _star_image(stamps.offsets, x, y, covariance)
    image *= stamps.weight
    power = np.einsum("nij,nij->n", image, image)
    product = image * stamps.value
    flux = product.sum(axis=(1, 2)) / np.maximum(power, 1e-12)
    u = stamps.offsets
    px, py = u - x[:, None], u - y[:, None]
    cols, rows = product.sum(axis=1), product.sum(axis=2)
    total = np.where(flux > 0, cols.sum(axis=1), np.inf)
    moments = np.stack(
        [
            (cols * px * px).sum(axis=1) / total,
            (rows * py * py).sum(axis=1) / total,
            np.einsum("nij,nj,ni->n", product, px, py) / total,
        ],
        axis=1,
    )
    return Fits(
        x.astype(np.float64), y.astype(np.float64), flux.astype(np.float64),
        (flux * np.sqrt(power)).astype(np.float64),
        stamps.value.max(axis=(1, 2)).astype(np.float64), moments.astype(np.float64),
    )  # fmt: skip


def _star_image(u: Stamp, x: Stamp, y: Stamp, covariance: Floats) -> tuple[Stamp, Stamp, Stamp]:
    """Unit-flux star image (N, K, K) at offsets ``x``, ``y`` and its slopes along them."""
    if abs(covariance[0, 1]) < 1e-3:
        ax, dax = _profile(u - x[:, None], float(np.sqrt(covariance[0, 0])))
        ay, day = _profile(u - y[:, None], float(np.sqrt(covariance[1, 1])))
        return (
            ay[:, :, None] * ax[:, None, :],
            ay[:, :, None] * dax[:, None, :],
            day[:, :, None] * ax[:, None, :],
        )
    inverse = np.linalg.inv(covariance + np.eye(2) / 12.0).astype(np.float32)
    px, py = (u - x[:, None])[:, None, :], (u - y[:, None])[:, :, None]
    along_x = inverse[0, 0] * px + inverse[0, 1] * py
    along_y = inverse[0, 1] * px + inverse[1, 1] * py
    image = np.exp(-0.5 * (along_x * px + along_y * py))
    image *= np.float32(np.sqrt(np.linalg.det(inverse)) / (2.0 * np.pi))
    return image, image * along_x, image * along_y


def _profile(d: Stamp, sigma: float) -> tuple[Stamp, Stamp]:
    """A unit Gaussian averaged over pixels centred at ``d`` (N, K), and minus its slope.

    Three-point Gauss-Legendre over the pixel: exact to 1e-4 of the peak for sigma > 0.5.
    """
    node = np.float32(0.5 * np.sqrt(0.6))
    scale = np.float32(1.0 / sigma)
    value, slope = np.zeros_like(d), np.zeros_like(d)
    for shift, share in ((-node, 5 / 18), (np.float32(0), 8 / 18), (node, 5 / 18)):
        t = (d + shift) * scale
        part = np.exp(-0.5 * t * t) * np.float32(share / (np.sqrt(2.0 * np.pi) * sigma))
        value += part
        slope += part * t * scale
    return value, slope


def _solve(image: Stamp, gx: Stamp, gy: Stamp, stamps: Stamps) -> tuple[Floats, Floats, Floats]:
    """Least squares for flux and flux times the shifts, each (N,)."""
    base = np.stack([image, gx, gy], axis=1).reshape(len(image), 3, -1)
    weighted = base * stamps.weight.reshape(len(image), 1, -1)
    normal = (weighted @ base.transpose(0, 2, 1)).astype(np.float64)
    right = (weighted @ stamps.value.reshape(len(image), -1, 1)).astype(np.float64)
    normal += 1e-9 * np.eye(3) * (np.trace(normal, axis1=1, axis2=2)[:, None, None] + 1e-30)
    out = np.linalg.solve(normal, right)[:, :, 0]
    return out[:, 0], out[:, 1], out[:, 2]
