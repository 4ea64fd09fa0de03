"""What is believed of a camera before its stars are looked at."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class FocalBelief:
    """A focal length, px, and the one-sigma error of its logarithm: a Gaussian prior of a fit."""

    focal_px: float
    sigma: float

    @classmethod
    def of_scale(cls, low_arcsec_px: float, high_arcsec_px: float) -> "FocalBelief":
        """From a range of scales at the frame's centre; half of it is taken for one sigma."""
        middle = np.sqrt(low_arcsec_px * high_arcsec_px)
        focal_px = float(np.degrees(1.0) * 3600.0 / middle)
        return cls(focal_px, float(np.log(high_arcsec_px / low_arcsec_px) / 2.0))
