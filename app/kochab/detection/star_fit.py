"""Position, flux and shape of stars: fits of the frame's star image, adaptive moments.

The image is a Gaussian averaged over each pixel; flux and place are found by Gauss-Newton steps
of least squares with equal weights, which is the maximum likelihood where the background makes
the noise. Unused pixels (mosaic, saturated, broken) simply do not take part.
"""

import numpy as np

from kochab.core.arrays import Bools, Floats, Floats32, Table
from kochab.core.robust import median
from kochab.core.values import frozen
from kochab.detection.peaks import PreparedFrame, Stamps, cut


@frozen(eq=False)
class Fits(Table):
    """``dx``, ``dy`` (N,) px from the stamps' middles, ``flux`` (N,) and its ``snr`` (N,).

    ``snr`` is for a noise of 1 a pixel. ``moments`` (N, 3) are xx, yy, xy weighted by the star image, px^2.
    """

    dx: Floats
    dy: Floats
    flux: Floats
    snr: Floats
    moments: Floats


def fit_stars(stamps: Stamps, covariance: Floats, steps: int = 3) -> Fits:
    """Fit stamps with the star image whose second moments (2, 2) px^2 are ``covariance``."""
    if _turned(covariance):
        return _fit(stamps, covariance, steps)
    return _fit_straight(stamps, covariance, steps, whole=bool(stamps.weight.all()))


def _turned(covariance: Floats) -> bool:
    """Whether the star image is long in a direction that is not the pixels'."""
    return bool(abs(covariance[0, 1]) > 1e-3)


def refit_bright(stamps: Stamps, fits: Fits, covariance: Floats, light: Floats) -> None:
    """Fit bright stars again, in place, giving each pixel the weight its own light leaves it.

    A fit with equal weights would lose up to a third of the precision where the star's own photons make the noise.

    Parameters
    ----------
    stamps : Stamps
        The pixels (N, size, size) around each star.
    fits : Fits
        The plain fits of all; those of bright stars are replaced.
    covariance : Floats
        Second moments (2, 2) px^2 of a star's image.
    light : Floats
        Background (N,) above zero, whose noise is that of the stamps: a pixel with as much star light as that is
        half as certain.
    """
    # Peak of a unit-flux star image.
    top = 1.0 / (2.0 * np.pi * np.sqrt(np.linalg.det(covariance)))
    bright = np.flatnonzero(fits.flux * top > 0.3 * light)
    if not len(bright):
        return
    some, start = stamps.take(bright), fits.take(bright)
    image = _light(stamps.offsets, np.stack([start.dx, start.dy]).astype(np.float32), covariance)
    share = (start.flux / light[bright]).astype(np.float32)
    certain = some.weight / (1.0 + np.maximum(image, 0.0) * share[:, None, None])
    again = _fit if _turned(covariance) else _fit_straight
    better = again(Stamps(some.value, certain, some.x, some.y), covariance, 2, start)
    # A weighted fit that left the star is not better than the plain one.
    settled = (better.flux > 0) & (np.hypot(better.dx - start.dx, better.dy - start.dy) < 0.5)
    bright = bright[settled]
    fits.dx[bright], fits.dy[bright] = better.dx[settled], better.dy[settled]
    fits.flux[bright] = better.flux[settled]


def _fit(stamps: Stamps, covariance: Floats, steps: int, start: Fits | None = None) -> Fits:
    """Any star image, any pixels missing."""
    u, at = stamps.offsets, np.zeros((2, len(stamps.value)), dtype=np.float32)
    if start is not None:
        at[0], at[1] = start.dx, start.dy
    limit = np.float32(stamps.value.shape[1] / 2.0 - 1.0)
    for _ in range(steps):
        flux, step = _solve(*_star_image(u, at, covariance), stamps)
        at = _moved(at, step, flux, limit)
    image, _, _ = _star_image(u, at, covariance)
    seen = image * stamps.weight
    power = np.maximum((seen * image).sum(axis=(1, 2)), 1e-12)
    product = seen * stamps.value
    px, py = u - at[:, :, None]
    cols, rows = product.sum(axis=1), product.sum(axis=2)
    light = cols.sum(axis=1)
    cross = ((product @ px[:, :, None])[:, :, 0] * py).sum(axis=1)
    squares = (cols * px * px).sum(axis=1), (rows * py * py).sum(axis=1), cross
    return _fits(at, light, power, np.stack(squares, axis=1))


def _fit_straight(
    stamps: Stamps, covariance: Floats, steps: int, start: Fits | None = None, *, whole: bool = False
) -> Fits:
    """The same for a star image with axes along the pixels': sums over a stamp are products of sums along its sides.

    Parameters
    ----------
    stamps : Stamps
        The pixels (N, size, size) around each star.
    covariance : Floats
        Second moments (2, 2) px^2 of a star's image.
    steps : int
        How many are made.
    start : Fits or None
        Where they begin; None in the middle.
    whole : bool
        Whether every pixel counts alike.
    """
    u, value = stamps.offsets, stamps.value if whole else stamps.value * stamps.weight
    sigma = np.sqrt(np.diag(covariance))[:, None, None]
    at = np.zeros((2, len(value)), dtype=np.float32)
    if start is not None:
        at[0], at[1] = start.dx, start.dy
    limit = np.float32(value.shape[1] / 2.0 - 1.0)
    for _ in range(steps):
        light, slope = _profile(u - at[:, :, None], sigma)
        across, leaning = (value @ _columns(light[0], slope[0])).transpose(2, 0, 1)
        if whole:
            square = _dot(light, light)
            flux = _dot(light[1], across) / (square[0] * square[1])
            seen = np.stack([_dot(light[1], leaning), _dot(slope[1], across)]) / square[::-1]
            step = (seen - flux * _dot(light, slope)) / _dot(slope, slope)
        else:
            squares, cross, slopes = light * light, light * slope, slope * slope
            a, b, c = (stamps.weight @ _columns(squares[0], cross[0], slopes[0])).transpose(2, 0, 1)
            flux = _dot(light[1], across) / np.maximum(_dot(squares[1], a), np.float32(1e-12))
            step = _normal_step(
                _dot(squares[1], c),
                _dot(slopes[1], a),
                _dot(cross[1], b),
                np.asarray(_dot(light[1], leaning) - flux * _dot(squares[1], b)),
                np.asarray(_dot(slope[1], across) - flux * _dot(cross[1], a)),
            )
        at = _moved(at, step, flux, limit)
    x, y = away = u - at[:, :, None]
    ax, ay = light = _profile(away, sigma)[0]
    first, second, third = (value @ _columns(ax, ax * x, ax * x * x)).transpose(2, 0, 1)
    square = _dot(light, light)
    power = square[0] * square[1] if whole else _dot(ay * ay, (stamps.weight @ _columns(ax * ax))[:, :, 0])
    moments = (_dot(ay, third), _dot(ay * y * y, first), _dot(ay * y, second))
    return _fits(at, _dot(ay, first), np.maximum(power, np.float32(1e-12)), np.stack(moments, axis=1))


def _columns(*parts: Floats32 | Floats) -> Floats32:
    """P parts (N, K) along a new last axis (N, K, P), in single precision."""
    out = np.empty((*parts[0].shape, len(parts)), dtype=np.float32)
    for k, part in enumerate(parts):
        out[:, :, k] = part
    return out


def _moved(at: Floats32, step: Floats32, flux: Floats32, limit: np.float32) -> Floats32:
    """Places (2, N) after a step (2, N) of at most 1 px, which is given times the flux (N,)."""
    most = np.minimum(np.maximum(step / np.where(flux > 0, flux, np.float32(np.inf)), -1), 1)
    return np.minimum(np.maximum(at + most, -limit), limit)


def _fits(at: Floats32, light: Floats32, power: Floats32, squares: Floats32) -> Fits:
    """Fits at places (2, N) of the light seen through the star image and the image's own power."""
    moments = squares / np.where(light > 0, light, np.inf)[:, None]
    parts = (*at, light / power, light / np.sqrt(power), moments)
    return Fits(*(np.asarray(part, dtype=np.float64) for part in parts))


def _dot(a: Floats32, b: Floats32) -> Floats32:
    return np.asarray(np.einsum("...k,...k->...", a, b))


def _light(u: Floats32, at: Floats32, covariance: Floats) -> Floats32:
    """Unit-flux star image (N, K, K) at offsets (2, N)."""
    if _turned(covariance):
        return _star_image(u, at, covariance)[0]
    across, down = _profile(u - at[:, :, None], np.sqrt(np.diag(covariance))[:, None, None])[0]
    return np.asarray(down[:, :, None] * across[:, None, :])


def _star_image(u: Floats32, at: Floats32, covariance: Floats) -> tuple[Floats32, Floats32, Floats32]:
    """The image of a star that is long in any direction, and its slopes along x and y."""
    inverse = np.linalg.inv(covariance + np.eye(2) / 12.0).astype(np.float32)
    px, py = (u - at[0][:, None])[:, None, :], (u - at[1][:, None])[:, :, None]
    along_x = inverse[0, 0] * px + inverse[0, 1] * py
    along_y = inverse[0, 1] * px + inverse[1, 1] * py
    image = np.exp(-0.5 * (along_x * px + along_y * py))
    image *= np.float32(np.sqrt(np.linalg.det(inverse)) / (2.0 * np.pi))
    return image, image * along_x, image * along_y


NODES = np.array([-0.5, 0.0, 0.5], dtype=np.float32)[:, None, None, None] * np.float32(np.sqrt(0.6))
SHARES = np.array([5.0, 8.0, 5.0])[:, None, None, None] / 18.0


def _profile(d: Floats32, sigma: Floats) -> tuple[Floats32, Floats32]:
    """A unit Gaussian averaged over pixels centred at ``d`` (2, N, K), and minus its slope; ``sigma`` (2, 1, 1).

    Three-point Gauss-Legendre over the pixel: exact to 1e-4 of the peak for sigma > 0.5.
    """
    narrow = (1.0 / sigma).astype(np.float32)
    t = (d + NODES) * narrow
    parts = np.exp(-0.5 * t * t)
    parts *= (SHARES / (np.sqrt(2.0 * np.pi) * sigma)).astype(np.float32)
    value = parts.sum(axis=0)
    parts *= t
    parts *= narrow
    return value, parts.sum(axis=0)


def _solve(image: Floats32, gx: Floats32, gy: Floats32, stamps: Stamps) -> tuple[Floats32, Floats32]:
    """Flux (N,) by least squares, and the Gauss-Newton steps (2, N) of the place times the flux.

    What flux and place share of each other is left to the next step: it is nothing for a whole
    stamp and little for half a one, and where the steps end does not depend on it.
    """
    n = len(image)
    g, x, y = (part.reshape(n, -1) for part in (image, gx, gy))
    weight, value = stamps.weight.reshape(n, -1), stamps.value.reshape(n, -1)
    weighted = g * weight
    power: Floats32 = np.maximum(_dot(weighted, g), np.float32(1e-12))
    flux: Floats32 = _dot(weighted, value) / power
    rest: Floats32 = weight * (value - flux[:, None] * g)
    weighted_x = weight * x
    xx, yy, xy = _dot(weighted_x, x), _dot(weight * y, y), _dot(weighted_x, y)
    return flux, _normal_step(xx, yy, xy, _dot(rest, x), _dot(rest, y))


def _normal_step(xx: Floats32, yy: Floats32, xy: Floats32, along_x: Floats32, along_y: Floats32) -> Floats32:
    """The steps (2, N) along x and y of normal equations, (N,) each.

    Parameters
    ----------
    xx, yy, xy : Floats32
        Of the normal matrix.
    along_x, along_y : Floats32
        Its right side.
    """
    determinant = np.maximum(xx * yy - xy * xy, np.float32(1e-3) * xx * yy + np.float32(1e-12))
    return np.asarray(np.stack([yy * along_x - xy * along_y, xx * along_y - xy * along_x]) / determinant)


# -- Sizes, shapes and places of bright or odd stars by adaptive moments -----------------------
# The weight is an elliptical Gaussian that is made as large as the star itself: of a Gaussian star
# seen through its own shape the weighted second moments are half the true ones, and the iteration
# sits still (Bernstein & Jarvis 2002, AJ 123, 583, section 3).

FWHM_PER_SIGMA = 2.0 * float(np.sqrt(2.0 * np.log(2.0)))
PIXEL_VARIANCE = 1.0 / 12.0  # of a square pixel, px^2
NARROWEST = 0.995  # of a shape's correlation of x and y: it is twenty times as long as wide


@frozen(eq=False)
class Shapes(Table):
    """``dx``, ``dy`` (N,) px from the stamp's middle; ``xx``, ``yy``, ``xy`` (N,) px^2; ``flux``.

    ``good`` (N,) says that the iteration settled inside the stamp.
    """

    dx: Floats
    dy: Floats
    xx: Floats
    yy: Floats
    xy: Floats
    flux: Floats
    good: Bools

    def axes(self) -> tuple[Floats, Floats, Floats]:
        """Sigma along the major and the minor axis, px, and the major axis' angle, rad."""
        return principal_axes(self.xx, self.yy, self.xy)


def principal_axes(xx: Floats, yy: Floats, xy: Floats) -> tuple[Floats, Floats, Floats]:
    """Sigma of the major and minor axis and the angle (from +x to +y) of second moments (N,)."""
    mean, half = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    major = np.sqrt(np.maximum(mean + half, 1e-12))
    minor = np.sqrt(np.maximum(mean - half, 1e-12))
    return major, minor, 0.5 * np.arctan2(2.0 * xy, xx - yy)


def adaptive_moments(stamps: Stamps, sigma_px: float, steps: int = 12, least_px: float = 0.2) -> Shapes:
    """Moments of every stamp through a Gaussian weight that takes the star's own shape.

    Parameters
    ----------
    stamps : Stamps
        The pixels (N, size, size) around each star.
    sigma_px : float
        The round weight that it begins with, one sigma.
    steps : int
        How often the weight is fitted at most.
    least_px : float
        The weight's sigma never falls below it.
    """
    n, size, _ = stamps.value.shape
    u, value = stamps.offsets.astype(np.float64), stamps.value
    x, y = np.zeros(n), np.zeros(n)
    xx, yy, xy = np.full(n, sigma_px**2), np.full(n, sigma_px**2), np.zeros(n)
    limit, flux, good = size / 2.0 - 1.0, np.zeros(n), np.ones(n, dtype=np.bool_)
    light = np.empty_like(value)  # one for all steps: new memory costs as much as a sum
    for _ in range(steps):
        px, py = u - x[:, None], u - y[:, None]
        det = np.maximum(xx * yy - xy * xy, 1e-6)[:, None]
        # The exponent is one product of three columns and three rows, a tenth of the time of its terms a pixel each.
        shape = np.stack([yy[:, None] * px * px, -2.0 * xy[:, None] * px, xx[:, None] + 0.0 * px], axis=1)
        across = (shape * (-0.5 / det[:, None])).astype(np.float32)
        np.matmul(_columns(np.ones_like(py), py, py * py), across, out=light)
        np.exp(light, out=light)
        light *= value
        cols = light.sum(axis=1).astype(np.float64)
        rows, leaning = (light @ _columns(np.ones_like(px), px)).transpose(2, 0, 1).astype(np.float64)
        total = cols.sum(axis=1)
        good &= total > 0
        safe = np.where(total > 0, total, np.inf)
        mx, my = (cols * px).sum(axis=1) / safe, (rows * py).sum(axis=1) / safe
        sxx = (cols * px * px).sum(axis=1) / safe - mx * mx
        syy = (rows * py * py).sum(axis=1) / safe - my * my
        sxy = (leaning * py).sum(axis=1) / safe - mx * my
        # Seen through its own shape a Gaussian keeps half its light and half its moments.
        flux = 2.0 * total
        before = np.stack([x, y, xx, yy])
        x, y = np.clip(x + 2.0 * mx, -limit, limit), np.clip(y + 2.0 * my, -limit, limit)
        xx, yy, xy = _bounded(2.0 * sxx, 2.0 * syy, 2.0 * sxy, least_px, limit)
        if np.all(np.abs(np.stack([x, y, xx, yy]) - before) < 2e-3):
            break
    major, minor, _ = principal_axes(xx, yy, xy)
    good &= (np.hypot(x, y) < limit) & (major < 0.98 * limit) & (minor > 0.3)
    return Shapes(x, y, xx, yy, xy, flux, good)


def _bounded(xx: Floats, yy: Floats, xy: Floats, least: float, most: float) -> tuple[Floats, Floats, Floats]:
    """Second moments held between the squares of two sizes."""
    xx, yy = np.clip(xx, least**2, most**2), np.clip(yy, least**2, most**2)
    across = np.sqrt(np.maximum(xx - 0.99 * least**2, 0) * np.maximum(yy - 0.99 * least**2, 0))
    return xx, yy, np.clip(xy, -NARROWEST * across, NARROWEST * across)


# -- What a star looks like in this frame: its size and shape, and where pixels clip -----------

TYPICAL = np.eye(2) * 1.2**2  # px^2: a FWHM of 2.8 px, when too few stars show it
SHARPEST = 0.6  # px: a narrower star image cannot be told from a hot pixel
LARGE_PX = 2.5  # sigma: a larger star may be a ring, of which a small stamp holds one side
ENOUGH = 50  # stars to measure the width
ROUND = 1.4  # the elongation up to which stars are fitted as round


def clip_level(view: PreparedFrame, xy: Floats, given: float | None) -> float:
    """The level at which pixels count as saturated, guessed from flat tops when not ``given``."""
    if given is not None and np.isfinite(given):
        return 0.98 * float(given)
    values = cut(view.pixels, view.how, xy[:300], np.zeros(min(len(xy), 300)), 2).value
    top = float(values.max(initial=0.0))
    # Five of the 25 pixels within 2 % of the highest of all stars make a flat top.
    flat = (values >= 0.98 * top).sum(axis=(1, 2)) >= 5
    return 0.98 * top if flat.any() else float(np.inf)


def star_image(view: PreparedFrame, xy: Floats, clip: float) -> tuple[Floats, bool]:
    """Second moments (2, 2), px^2, of the frame's stars, from the brightest of ``xy`` (N, 2) px.

    Also whether most of them are well inside a few pixels. When not, stars are large or trailed, or are not stars.
    """
    stamps, level, _ = view.stamps(xy[:1000], 1)
    xy = xy[:1000][stamps.value.max(axis=(1, 2), initial=0.0) + level < clip][:ENOUGH]
    if len(xy) < 3:
        return TYPICAL, True
    found, settled = _usual_moments(view, xy, 8)
    large = found is not None and found.trace() > 2.0 * LARGE_PX**2
    if settled < 0.5 or large:  # or lines and edges instead of stars
        larger, of_larger = _usual_moments(view, xy, 20)
        if of_larger >= 0.5 or of_larger > 2.0 * settled:
            found = larger
    return TYPICAL if found is None else _plausible(found), settled >= 0.5


def unweighted(moments: Floats, covariance: Floats) -> Floats:
    """Second moments (N, 3) of the light itself from those weighted by the star image.

    Through a Gaussian weight W a Gaussian of moments C has M = (C^-1 + W^-1)^-1.
    """
    weight = np.linalg.inv(covariance + PIXEL_VARIANCE * np.eye(2))
    m = np.empty((len(moments), 2, 2))
    m[:, 0, 0], m[:, 1, 1] = np.maximum(moments[:, 0], 0.02), np.maximum(moments[:, 1], 0.02)
    most = 0.98 * np.sqrt(m[:, 0, 0] * m[:, 1, 1])
    m[:, 0, 1] = m[:, 1, 0] = np.clip(moments[:, 2], -most, most)
    values, vectors = np.linalg.eigh(np.linalg.inv(m) - weight)
    # A shape wider than its weight tells has an inverse near zero or below: its size is bounded.
    values = 1.0 / np.maximum(values, 1.0 / (100.0 * covariance.trace()))
    full = (vectors * values[:, None, :]) @ vectors.transpose(0, 2, 1)
    return np.stack([full[:, 0, 0], full[:, 1, 1], full[:, 0, 1]], axis=1)


def _usual_moments(view: PreparedFrame, xy: Floats, half: int) -> tuple[Floats | None, float]:
    """Medians of the moments over those stars whose size is usual, and the share that settled.

    A weight that has grown to fill the stamp has not found a star's edge. None when fewer than three settle.
    """
    stamps, _, _ = view.stamps(xy, half)
    least = 0.2 if view.how.greens is None else 0.8  # among greens a weight must hold several
    shapes = adaptive_moments(stamps, 1.5, 5 if half < 12 else 12, least)
    good = shapes.good & (np.hypot(shapes.dx, shapes.dy) < 0.3 * half)
    good &= shapes.axes()[0] < 0.6 * half
    if good.sum() < 3:
        return None, 0.0
    area = np.sqrt(np.maximum(shapes.xx * shapes.yy - shapes.xy**2, 1e-6))
    usual = np.percentile(area[good], 40, method="lower")  # between two of unlike size there is none
    near = good & (area > usual / 1.6) & (area < usual * 1.6)
    xx, yy, xy_ = (median(m[near]) for m in (shapes.xx, shapes.yy, shapes.xy))
    # Medians of shapes that agree in nothing may be no shape: one longer and thinner than any that is measured.
    if not xy_**2 < NARROWEST**2 * xx * yy:
        return None, float(good.mean())
    return np.array([[xx, xy_], [xy_, yy]]), float(good.mean())


def _plausible(found: Floats) -> Floats:
    """Round when nearly so, not as sharp as a hot pixel, and without the pixel's own width."""
    major, minor, _ = principal_axes(found[:1, 0], found[1:, 1], found[:1, 1])
    if major[0] < ROUND * minor[0]:
        found = np.eye(2) * float(major[0] * minor[0])
    scale = max(1.0, (SHARPEST**2 + PIXEL_VARIANCE) / float(minor[0] ** 2))
    return np.asarray(scale * found - PIXEL_VARIANCE * np.eye(2))
