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
Index = NDArray[np.bool_] | NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Fits:
    """``dx``, ``dy`` (N,) px from the stamps' middles, ``flux`` (N,) and its ``snr`` (N,).

    ``snr`` is for a noise of 1 a pixel. ``moments`` (N, 3) are xx, yy, xy weighted by the star
    image, px^2.
    """

    dx: Floats
    dy: Floats
    flux: Floats
    snr: Floats
    moments: Floats

    @classmethod
    def empty(cls, n: int) -> "Fits":
        """Room for ``n`` fits."""
        return cls(np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty((n, 3)))

    def take(self, index: Index) -> "Fits":
        """Only the fits that ``index`` selects."""
        return Fits(*(getattr(self, name)[index] for name in _FIELDS))

    def put(self, index: Index, fits: "Fits") -> None:
        """Set those that ``index`` selects."""
        for name in _FIELDS:
            getattr(self, name)[index] = getattr(fits, name)


_FIELDS = ("dx", "dy", "flux", "snr", "moments")


def fit_stars(stamps: Stamps, covariance: Floats, steps: int = 3) -> Fits:
    """Fit stamps with the star image whose second moments (2, 2) px^2 are ``covariance``."""
    if abs(covariance[0, 1]) > 1e-3:
        return _fit(stamps, covariance, steps)
    whole = np.asarray(stamps.weight.all(axis=(1, 2)))
    if whole.all():
        return _fit_whole(stamps, covariance, steps)
    out = Fits.empty(len(whole))
    for chosen, fit in ((whole, _fit_whole), (~whole, _fit)):
        if chosen.any():
            out.put(chosen, fit(stamps.take(chosen), covariance, steps))
    return out


def refit_bright(stamps: Stamps, fits: Fits, covariance: Floats, light: Floats) -> None:
    """Fit bright stars again, in place, giving each pixel the weight its own light leaves it.

    ``light`` (N,) is the background above zero, whose noise is that of the stamps: a pixel with
    as much star light as that is half as certain. A fit with equal weights would lose up to a
    third of the precision where the star's own photons make the noise.
    """
    top = 1.0 / (2.0 * np.pi * np.sqrt(np.linalg.det(covariance)))
    bright = np.flatnonzero(fits.flux * top > 0.3 * light)
    if not len(bright):
        return
    some, start = stamps.take(bright), fits.take(bright)
    x, y = start.dx.astype(np.float32), start.dy.astype(np.float32)
    image, _, _ = _star_image(stamps.offsets, x, y, covariance)
    share = (start.flux / light[bright]).astype(np.float32)
    certain = some.weight / (1.0 + np.maximum(image, 0.0) * share[:, None, None])
    better = _fit(Stamps(some.value, certain, some.x, some.y), covariance, 2, start)
    settled = (better.flux > 0) & (np.hypot(better.dx - start.dx, better.dy - start.dy) < 0.5)
    bright = bright[settled]
    fits.dx[bright], fits.dy[bright] = better.dx[settled], better.dy[settled]
    fits.flux[bright] = better.flux[settled]


def _fit(stamps: Stamps, covariance: Floats, steps: int, start: Fits | None = None) -> Fits:
    """Any star image, any pixels missing."""
    n, u = len(stamps.value), stamps.offsets
    x, y = np.zeros(n, dtype=np.float32), np.zeros(n, dtype=np.float32)
    if start is not None:
        x, y = start.dx.astype(np.float32), start.dy.astype(np.float32)
    limit = np.float32(stamps.value.shape[1] / 2.0 - 1.0)
    for _ in range(steps):
        image, gx, gy = _star_image(u, x, y, covariance)
        flux, mx, my = _solve(image, gx, gy, stamps)
        safe = np.where(flux > 0, flux, np.inf)
        x = np.clip(x + np.clip(mx / safe, -1, 1), -limit, limit).astype(np.float32)
        y = np.clip(y + np.clip(my / safe, -1, 1), -limit, limit).astype(np.float32)
    image, _, _ = _star_image(u, x, y, covariance)
    seen = image * stamps.weight
    power = np.maximum((seen * image).sum(axis=(1, 2)), 1e-12)
    product = seen * stamps.value
    px, py = u - x[:, None], u - y[:, None]
    cols, rows = product.sum(axis=1), product.sum(axis=2)
    light = cols.sum(axis=1)
    cross = ((product @ px[:, :, None])[:, :, 0] * py).sum(axis=1)
    squares = (cols * px * px).sum(axis=1), (rows * py * py).sum(axis=1), cross
    return _fits(x, y, light, power, np.stack(squares, axis=1))


def _fit_whole(stamps: Stamps, covariance: Floats, steps: int) -> Fits:
    """The same for a star image with axes along the pixels' and all pixels there.

    Sums over a stamp are then products of sums along its sides.
    """
    n, u, value = len(stamps.value), stamps.offsets, stamps.value
    sigma_x, sigma_y = (float(np.sqrt(covariance[k, k])) for k in (0, 1))
    x, y = np.zeros(n, dtype=np.float32), np.zeros(n, dtype=np.float32)
    limit = np.float32(value.shape[1] / 2.0 - 1.0)
    for _ in range(steps):
        (ax, dx), (ay, dy) = _profile(u - x[:, None], sigma_x), _profile(u - y[:, None], sigma_y)
        lines = value @ np.stack([ax, dx], axis=2)
        sx, sy, ux, uy = _dot(ax, ax), _dot(ay, ay), _dot(ax, dx), _dot(ay, dy)
        flux = _dot(ay, lines[:, :, 0]) / (sx * sy)
        safe = np.where(flux > 0, flux, np.inf)
        mx = (_dot(ay, lines[:, :, 1]) / sy - flux * ux) / (safe * _dot(dx, dx))
        my = (_dot(dy, lines[:, :, 0]) / sx - flux * uy) / (safe * _dot(dy, dy))
        x, y = (
            np.clip(x + np.clip(mx, -1, 1), -limit, limit),
            np.clip(y + np.clip(my, -1, 1), -limit, limit),
        )
    px, py = u - x[:, None], u - y[:, None]
    (ax, _), (ay, _) = _profile(px, sigma_x), _profile(py, sigma_y)
    lines = value @ np.stack([ax, ax * px, ax * px * px], axis=2)
    power = np.maximum(_dot(ax, ax) * _dot(ay, ay), 1e-12)
    squares = (
        _dot(ay, lines[:, :, 2]), _dot(ay * py * py, lines[:, :, 0]), _dot(ay * py, lines[:, :, 1])
    )  # fmt: skip
    return _fits(x, y, _dot(ay, lines[:, :, 0]), power, np.stack(squares, axis=1))


def _fits(x: Stamp, y: Stamp, light: Stamp, power: Stamp, squares: Stamp) -> Fits:
    """Fits of the light seen through the star image and the image's own power."""
    moments = squares / np.where(light > 0, light, np.inf)[:, None]
    parts = (x, y, light / power, light / np.sqrt(power), moments)
    return Fits(*(np.asarray(part, dtype=np.float64) for part in parts))


def _dot(a: Stamp, b: Stamp) -> Stamp:
    return np.asarray(np.einsum("nk,nk->n", a, b))


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


def _solve(image: Stamp, gx: Stamp, gy: Stamp, stamps: Stamps) -> tuple[Stamp, Stamp, Stamp]:
    """Flux (N,) by least squares, and the Gauss-Newton steps of the place times the flux.

    What flux and place share of each other is left to the next step: it is nothing for a whole
    stamp and little for half a one, and where the steps end does not depend on it.
    """
    n = len(image)
    g, x, y = (part.reshape(n, -1) for part in (image, gx, gy))
    weight, value = stamps.weight.reshape(n, -1), stamps.value.reshape(n, -1)
    weighted = g * weight
    power: Stamp = np.maximum(_dot(weighted, g), np.float32(1e-12))
    flux: Stamp = _dot(weighted, value) / power
    rest: Stamp = weight * (value - flux[:, None] * g)
    weighted_x = weight * x
    xx, yy, xy = _dot(weighted_x, x), _dot(weight * y, y), _dot(weighted_x, y)
    along_x, along_y = _dot(rest, x), _dot(rest, y)
    determinant = np.maximum(xx * yy - xy * xy, np.float32(1e-3) * xx * yy + np.float32(1e-12))
    dx = (yy * along_x - xy * along_y) / determinant
    dy = (xx * along_y - xy * along_x) / determinant
    return flux, np.asarray(dx), np.asarray(dy)
