"""How far an axis is from its pole, and how surely."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import angle_between
from app.polar.rotations import ARCSEC, alt_az

Floats = NDArray[np.float64]

NOTHING = np.zeros((2, 2))

CHI2_68, CHI2_95 = 2.2957, 5.9915  # two degrees of freedom, probabilities 0.6827 and 0.95


@dataclass(frozen=True, slots=True, eq=False)
class PolarError:
    """An axis against its pole, both unit vectors (3,) in E, N, U.

    ``covariance`` (2, 2), rad^2, is of the axis along (altitude, azimuth on the sky). Altitude is
    positive when the axis is too high, azimuth positive when it must go anticlockwise, seen from
    above, that is when it stands too far clockwise. ``unseen`` (2, 2), rad^2, comes on top: what
    the frames could not show, such as a tube that bends. Whatever is shown after a ± is of
    :attr:`whole`, which has both; sigmas without it are the frames' own, by which they are judged.
    """

    axis: Floats
    pole: Floats
    covariance: Floats
    unseen: Floats = field(default_factory=NOTHING.copy)

    @property
    def altitude_arcsec(self) -> float:
        """Altitude of the axis less that of the pole."""
        return (alt_az(self.axis)[0] - alt_az(self.pole)[0]) / ARCSEC

    @property
    def azimuth_arcsec(self) -> float:
        """Azimuth of the axis less that of the pole: what the azimuth knob has to turn."""
        turn = alt_az(self.axis)[1] - alt_az(self.pole)[1]
        return float((turn + np.pi) % (2.0 * np.pi) - np.pi) / ARCSEC

    @property
    def azimuth_on_sky_arcsec(self) -> float:
        """The share of the azimuth error in the total: shorter by the cosine of the altitude."""
        return self.azimuth_arcsec * float(np.cos(alt_az(self.axis)[0]))

    @property
    def total_arcsec(self) -> float:
        """The angle between axis and pole."""
        return angle_between(self.axis, self.pole) / ARCSEC

    @property
    def sigma_arcsec(self) -> tuple[float, float]:
        """One-sigma errors along altitude and along azimuth on the sky."""
        alt, az = np.sqrt(np.diag(self.covariance)) / ARCSEC
        return float(alt), float(az)

    @property
    def sigma_azimuth_arcsec(self) -> float:
        """One-sigma error of the knob's azimuth, not shortened."""
        return self.sigma_arcsec[1] / max(float(np.cos(alt_az(self.axis)[0])), 1e-6)

    @property
    def uncertainty_arcsec(self) -> float:
        """Root mean square distance of the measured from the true axis, both directions."""
        return float(np.sqrt(np.trace(self.covariance))) / ARCSEC

    @property
    def unseen_arcsec(self) -> tuple[float, float]:
        """One-sigma errors, altitude and azimuth on the sky, that the frames could not show."""
        alt, az = np.sqrt(np.maximum(np.diag(self.unseen), 0.0)) / ARCSEC
        return float(alt), float(az)

    @property
    def unseen_total_arcsec(self) -> float:
        """Root mean square distance by what the frames could not show, both directions."""
        return float(np.hypot(*self.unseen_arcsec))

    @property
    def whole(self) -> "PolarError":
        """The same with everything in its covariance that may be wrong."""
        return PolarError(self.axis, self.pole, self.covariance + self.unseen)

    @property
    def sigma_total_arcsec(self) -> float:
        """One-sigma error of the total, along the line from pole to axis."""
        line = np.array([self.altitude_arcsec, self.azimuth_on_sky_arcsec])
        length = float(np.linalg.norm(line))
        if length < 1e-9:
            return self.uncertainty_arcsec / float(np.sqrt(2.0))
        along = line / length
        return float(np.sqrt(along @ self.covariance @ along) / ARCSEC)

    @property
    def unseen_along_arcsec(self) -> float:
        """The share in ``whole.sigma_total_arcsec`` of what the frames could not show."""
        both, noise = self.whole.sigma_total_arcsec, self.sigma_total_arcsec
        return float(np.sqrt(max(both**2 - noise**2, 0.0)))

    @property
    def below_uncertainty(self) -> bool:
        """Whether the error is not told from zero: the pole is inside the 68 % ellipse."""
        return self.distance2(self.pole) <= CHI2_68

    def distance2(self, truth: Floats) -> float:
        """Squared Mahalanobis distance of a direction (3,) from the axis; chi-square of two."""
        alt, az = alt_az(truth)
        own_alt, own_az = alt_az(self.axis)
        turn = (az - own_az + np.pi) % (2.0 * np.pi) - np.pi
        gap = np.array([alt - own_alt, turn * np.cos(own_alt)])
        return float(gap @ np.linalg.solve(self.covariance, gap))

    def ellipse_arcsec(self, probability: float = 0.6827) -> tuple[float, float, float]:
        """Semi-axes (long, short), arcsec, and the long one's angle from azimuth to altitude, rad.

        The true axis is inside with the given probability.
        """
        scale = np.sqrt(-2.0 * np.log1p(-probability)) / ARCSEC
        values, vectors = np.linalg.eigh(self.covariance)
        short, long = np.sqrt(np.maximum(values, 0.0)) * scale
        return float(long), float(short), float(np.arctan2(vectors[0, 1], vectors[1, 1]))
