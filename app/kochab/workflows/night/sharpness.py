"""How sharp a frame is, and where: FWHM, elongation, tilt and curvature of field.

FWHM over the field is fitted as ``a + b u + c v + d (u^2 + v^2)``, u to the right and v down from the middle in half
diagonals. A tilted sensor makes the linear part: one side is nearer to focus than the other. How many micrometres it is
tilted by cannot be told at one focus position, so nothing says so. Curvature of field makes the last part.
"""

import math

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.frame import Detections
from kochab.core.robust import mad_sigma
from kochab.core.values import frozen
from kochab.text.translation import tr_noop
from kochab.workflows.night.measure import Measure, clipped, median_of

LEAST_SNR = 20.0
"""Of a star whose shape is looked at: fainter ones' widths scatter by more than a tenth and are biased."""
WIDTH_SHARE = 0.01
"""One sigma of all widths together: a star image that is no Gaussian and pixels as wide as it is change them alike."""
TILT_SHARE = 0.07
"""The same of a tilt: over a real frame (HATP-32, 2.3 px) Gaussians that photutils fits widen by 14 % less."""
FEWEST = 30
"""Stars from which tilt and curvature are fitted."""
CORNERS = {
    (-1, -1): tr_noop("upper left"),
    (1, -1): tr_noop("upper right"),
    (-1, 1): tr_noop("lower left"),
    (1, 1): tr_noop("lower right"),
}
"""As the frame is recorded, row 0 at the top."""
SIDES = (
    *(tr_noop("right"), CORNERS[1, 1], tr_noop("bottom"), CORNERS[-1, 1]),
    *(tr_noop("left"), CORNERS[-1, -1], tr_noop("top"), CORNERS[1, -1]),
)
"""Every 45 degrees from the right, down first."""


@frozen(eq=False)
class FieldOfSharpness:
    """FWHM over the field, px: ``terms`` (4,) a, b, c, d of the module's text, and their covariance (4, 4).

    ``corner`` (2,) is where the lower right corner lies in u and v.
    """

    terms: Floats
    covariance: Floats
    corner: Floats

    def at(self, u: float, v: float) -> Measure:
        """FWHM at a place, px."""
        row = np.array([1.0, u, v, u * u + v * v])
        return Measure(float(row @ self.terms), math.sqrt(float(row @ self.covariance @ row)))

    @property
    def corners(self) -> dict[str, Measure]:
        """FWHM in each corner, px, by its name."""
        return {name: self.at(x * self.corner[0], y * self.corner[1]) for (x, y), name in CORNERS.items()}

    @property
    def tilt(self) -> Measure:
        """How much wider stars are at the softest point of the rim than opposite, px: twice the slope."""
        slope = self.terms[1:3]
        size = float(np.hypot(*slope))
        along = slope / size if size else np.array([1.0, 0.0])
        sigma = math.hypot(math.sqrt(float(along @ self.covariance[1:3, 1:3] @ along)), TILT_SHARE * size)
        return Measure(2.0 * size, 2.0 * sigma)

    @property
    def tilt_chance(self) -> float:
        """How likely a field without tilt looks as tilted as this."""
        slope = self.terms[1:3]
        return math.exp(-0.5 * float(slope @ np.linalg.solve(self.covariance[1:3, 1:3], slope)))

    @property
    def curvature(self) -> Measure:
        """How much wider stars are in the corners than in the middle, tilt apart, px."""
        return Measure(float(self.terms[3]), math.sqrt(float(self.covariance[3, 3])))

    @property
    def softest(self) -> str:
        """The side or corner to which the field gets softer."""
        return SIDES[round(math.degrees(math.atan2(self.terms[2], self.terms[1])) / 45.0) % 8]


@frozen(eq=False)
class Sharpness:
    """Of one frame: stars used, FWHM px, elongation (major over minor axis), and the common trail.

    ``trail`` is the elongation that all stars share, as the ratio of axes less one (a tracking error; what optics do to
    opposite corners cancels), and ``trail_deg`` its direction from +x towards +y. ``field`` is None for few stars.
    """

    stars: int
    fwhm_px: Measure
    elongation: Measure
    trail: Measure
    trail_deg: float
    field: FieldOfSharpness | None


def sharpness(detections: Detections) -> Sharpness | None:
    """Measure a frame's stars; None where fewer than three can be used."""
    good = ~detections.saturated & ~detections.blended & (detections.snr >= LEAST_SNR)
    good &= np.isfinite(detections.fwhm_px) & np.isfinite(detections.elongation)
    stars = detections.take(np.flatnonzero(good))
    widths, ratios = median_of(stars.fwhm_px), median_of(stars.elongation)
    if widths is None or ratios is None:
        return None
    trail, direction = _common(stars.elongation, stars.angle_rad)
    field = field_of(stars.xy, stars.fwhm_px, (stars.width, stars.height)) if len(stars) >= FEWEST else None
    return Sharpness(len(stars), widths, ratios, trail, direction, field)


def _common(ratio: Floats, angle_rad: Floats) -> tuple[Measure, float]:
    """The elongation that stars share, as a ratio of axes less one, and its direction, degrees from +x to +y."""
    size = (ratio**2 - 1.0) / (ratio**2 + 1.0)
    parts = np.stack([size * np.cos(2.0 * angle_rad), size * np.sin(2.0 * angle_rad)])
    x, y = np.median(parts, axis=1)
    sigma = math.sqrt(math.pi / 2.0 / len(ratio)) * max(mad_sigma(parts[0]), mad_sigma(parts[1]))
    # Noise alone makes a length of its own size; what is left is the shared part.
    e = math.sqrt(max(float(x * x + y * y) - sigma**2, 0.0))
    slope = 1.0 / ((1.0 - e) * math.sqrt(max(1.0 - e * e, 1e-6)))
    return Measure(math.sqrt((1.0 + e) / (1.0 - e)) - 1.0, slope * sigma), float(np.degrees(np.arctan2(y, x))) / 2.0


def field_of(xy: Floats, fwhm_px: Floats, size: tuple[int, int]) -> FieldOfSharpness | None:
    """Fit FWHM over the field; None where the stars leave a term open.

    Parameters
    ----------
    xy : Floats
        Places (N, 2), px; (0, 0) is the centre of the first pixel.
    fwhm_px : Floats
        Widths (N,), px.
    size : tuple of int
        Width and height of the frame, px.
    """
    middle = (np.array(size) - 1.0) / 2.0
    half = float(np.hypot(*size)) / 2.0
    u, v = ((xy - middle) / half).T
    rows = np.stack([np.ones(len(u)), u, v, u * u + v * v], axis=1)
    kept = np.ones(len(u), dtype=np.bool_)
    for _ in range(4):
        if kept.sum() < FEWEST // 2 or np.linalg.cond(rows[kept]) > 1e3:
            return None
        terms, *_ = np.linalg.lstsq(rows[kept], fwhm_px[kept], rcond=None)
        kept = clipped(fwhm_px - rows @ terms)
    left = (fwhm_px - rows @ terms)[kept]
    variance = float(left @ left) / (len(left) - 4)
    return FieldOfSharpness(terms, variance * np.linalg.inv(rows[kept].T @ rows[kept]), middle / half)


def night_field(fields: list[FieldOfSharpness]) -> FieldOfSharpness | None:
    """The shape of a night's field: the mean of its frames, each by its weight, less certain where they disagree.

    Focus and seeing change from frame to frame, so the level is the frames' plain mean and says nothing of the shape.
    """
    if not fields:
        return None
    shapes = np.array([field.terms[1:] for field in fields])
    own = np.array([field.covariance[1:, 1:] for field in fields])
    weights = np.linalg.inv(own)
    shape_covariance = np.linalg.inv(weights.sum(axis=0))
    shape = shape_covariance @ np.einsum("kij,kj->i", weights, shapes)
    levels = np.array([field.terms[0] for field in fields])
    spread = max(float(levels.var(ddof=1)) if len(fields) > 1 else 0.0, fields[0].covariance[0, 0]) / len(fields)
    covariance = np.zeros((4, 4))
    covariance[0, 0] = spread
    excess = np.mean((shapes - shape) ** 2, axis=0) / np.mean(np.diagonal(own, axis1=1, axis2=2), axis=0)
    wide = np.sqrt(np.maximum(1.0, excess))
    covariance[1:, 1:] = shape_covariance * np.outer(wide, wide)
    covariance[1:, 1:] += _common_share(excess, len(fields)) * np.mean(own, axis=0)
    return FieldOfSharpness(np.array([levels.mean(), *shape]), covariance, fields[0].corner)


def _common_share(excess: Floats, n: int) -> float:
    """The share of each frame's variance that is in all ``n`` alike: they have the same stars, which no number mends.

    Frames that agree better than each is sure of show it; what they may agree by chance, by one sigma, is left out.
    """
    if n < 2:
        return 0.0
    apart = float(np.mean(excess)) * n / (n - 1.0)
    return max(1.0 - apart * (1.0 + math.sqrt(2.0 / (len(excess) * (n - 1.0)))), 0.0)
