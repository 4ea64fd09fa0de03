"""Stars as peaks shaped like a Gaussian: photutils' DAOStarFinder (Stetson 1987, PASP 99, 191).

Source: "Lost in space" for robotic telescopes (thesis, 2018), section 5.1.2, the "source
detection method".
"""

import warnings
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from app.core.detections import Detections
from app.core.frame import Frame
from app.core.options import integer, number, switch
from app.detect.flat import box_light, described, nothing, without_background
from app.detect.weed import apart


@dataclass(frozen=True, slots=True)
class GaussianDetector:
    """``sigmas`` (above 0) sets the threshold, ``fwhm_px`` (1 to 50 px) the Gaussian's width.

    Both defaults are the thesis'. Its threshold is in standard deviations of all pixels, so that
    many bright stars raise it; with ``clipped`` the background's noise is the unit. Sources within
    half a FWHM of a brighter one, which flat tops give, are left out. At most ``max_stars`` are
    returned.
    """

    paper: ClassVar[str] = "Lost in space for robotic telescopes, 2018, section 5.1.2"

    sigmas: float = number(5.0, "sigma", 0.1, 1000.0, "threshold")
    fwhm_px: float = number(5.0, "px", 1.0, 50.0, "width of the Gaussian")
    clipped: bool = switch(False, "sigma is the background's noise, not that of all pixels")
    max_stars: int = integer(6000, "stars", 1, 200_000, "at most so many stars, the brightest")

    def detect(self, frame: Frame) -> Detections:
        """Stars of ``frame``, brightest first."""
        from photutils.detection import DAOStarFinder

        flat = without_background(frame)
        if flat is None:
            return nothing(frame)
        finder = DAOStarFinder(
            threshold=flat.threshold(self.sigmas, self.clipped), fwhm=self.fwhm_px
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that there are none is an answer
            table = finder(flat.image, mask=flat.broken if flat.broken.any() else None)
        if table is None or not len(table):
            return nothing(frame, flat)
        new = "x_centroid" in table.colnames  # "xcentroid" before photutils 3
        names = ("x_centroid", "y_centroid") if new else ("xcentroid", "ycentroid")
        xy = np.stack([np.asarray(table[name], dtype=np.float64) for name in names], axis=1)
        xy = xy[np.isfinite(xy).all(axis=1)]
        flux, pixels = box_light(flat, xy, max(2, round(self.fwhm_px / 2)))
        order = np.argsort(-flux, kind="stable")
        order = order[apart(xy[order], np.full(len(order), 0.5 * self.fwhm_px))]
        return described(flat, xy[order], flux[order], pixels[order], self.max_stars)
