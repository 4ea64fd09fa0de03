"""Stars as connected regions above a threshold, at their centre of gravity.

Source: "Lost in space" for robotic telescopes (thesis, 2018), section 5.1.4, equations 5.1 and
5.2. The thesis takes OpenCV's contours; the pixels inside a contour are those scipy labels.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from app.core.detections import Detections
from app.core.frame import Frame
from app.core.options import integer, number, switch
from app.detect.flat import described, nothing, without_background


@dataclass(frozen=True, slots=True)
class ContourDetector:
    """Pixels above the threshold that touch, corners included, are one star.

    ``sigmas`` (above 0) is the thesis' 5; its unit is the standard deviation of all pixels, that
    of the background when ``clipped``. ``least_pixels`` (1 or more) is the smallest region that is
    a star; the thesis names none. At most ``max_stars`` are returned.
    """

    paper: ClassVar[str] = "Lost in space for robotic telescopes, 2018, section 5.1.4"

    sigmas: float = number(5.0, "sigma", 0.1, 1000.0, "threshold")
    clipped: bool = switch(False, "sigma is the background's noise, not that of all pixels")
    least_pixels: int = integer(1, "px", 1, 10_000, "smaller regions are no stars")
    max_stars: int = integer(6000, "stars", 1, 200_000, "at most so many stars, the brightest")

    def detect(self, frame: Frame) -> Detections:
        """Stars of ``frame``, brightest first."""
        from scipy.ndimage import label

        flat = without_background(frame)
        if flat is None:
            return nothing(frame)
        above = flat.image > flat.threshold(self.sigmas, self.clipped)
        regions, count = label(above, np.ones((3, 3)))
        if not count:
            return nothing(frame, flat)
        y, x = np.nonzero(above)
        region, light = regions[y, x] - 1, flat.image[y, x].astype(np.float64)
        pixels = np.bincount(region, minlength=count).astype(np.float64)
        flux, of_x, of_y = (
            np.asarray(np.bincount(region, weights, count), dtype=np.float64)
            for weights in (light, light * x, light * y)
        )
        xy = np.stack([of_x, of_y], axis=1) / flux[:, None]
        keep = pixels >= self.least_pixels
        return described(flat, xy[keep], flux[keep], pixels[keep], self.max_stars)
