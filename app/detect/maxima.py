"""Stars as local maxima, whatever their shape.

Source: "Lost in space" for robotic telescopes (thesis, 2018), section 5.1.3, the "peak detection
method".
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from app.core.detections import Detections
from app.core.frame import Frame
from app.core.options import integer, number, switch
from app.detect.flat import box_light, described, nothing, without_background
from app.detect.weed import apart


@dataclass(frozen=True, slots=True)
class MaximaDetector:
    """A pixel above the threshold that none in the box around it exceeds.

    ``sigmas`` (above 0) and ``box_px`` (odd, 3 to 99 px) are the thesis' 5 and 5; its unit of the
    threshold is the standard deviation of all pixels, that of the background when ``clipped``.
    Pixels of equal height that touch, or are within half a box, are one star, as the thesis asks
    without saying how. The place is the maximum's pixel, or with ``refined`` the centre of gravity
    of the box, which the thesis does not take. At most ``max_stars`` are returned.
    """

    paper: ClassVar[str] = "Lost in space for robotic telescopes, 2018, section 5.1.3"

    sigmas: float = number(5.0, "sigma", 0.1, 1000.0, "threshold")
    box_px: int = integer(5, "px", 3, 99, "the box of which a peak is the maximum, odd")
    clipped: bool = switch(False, "sigma is the background's noise, not that of all pixels")
    refined: bool = switch(False, "centre of gravity of the box instead of the pixel")
    max_stars: int = integer(6000, "stars", 1, 200_000, "at most so many stars, the brightest")

    def detect(self, frame: Frame) -> Detections:
        """Stars of ``frame``, brightest first."""
        from scipy.ndimage import center_of_mass, label, maximum_filter

        flat = without_background(frame)
        if flat is None:
            return nothing(frame)
        top = flat.image == maximum_filter(flat.image, size=self.box_px)
        top &= flat.image > flat.threshold(self.sigmas, self.clipped)
        plateaus, count = label(top, np.ones((3, 3)))
        if not count:
            return nothing(frame, flat)
        places = center_of_mass(top, plateaus, np.arange(1, count + 1))
        xy = np.array(places, dtype=np.float64).reshape(-1, 2)[:, ::-1]
        half = self.box_px // 2
        flux, pixels = box_light(flat, xy, half)
        order = np.argsort(-flux, kind="stable")
        order = order[apart(xy[order], np.full(len(order), half + 0.5))]
        xy, flux, pixels = xy[order], flux[order], pixels[order]
        if self.refined:
            stamps = flat.stamps(xy, half)
            light = np.maximum(stamps.value, 0.0)
            total = np.maximum(light.sum(axis=(1, 2)), 1e-30)
            dx = (light.sum(axis=1) @ stamps.offsets) / total
            dy = (light.sum(axis=2) @ stamps.offsets) / total
            xy = np.stack([stamps.x + dx, stamps.y + dy], axis=1).astype(np.float64)
        return described(flat, xy, flux, pixels, self.max_stars)
