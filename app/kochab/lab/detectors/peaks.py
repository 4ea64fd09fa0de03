"""Stars as peaks: local maxima, Gaussians (photutils' DAOStarFinder), and both combined.

Source: "Lost in space" for robotic telescopes (thesis, 2018), section 5.1.3, the "peak detection method".
"""

from dataclasses import field
from typing import ClassVar

import numpy as np

from kochab.core.frame import Detections, Frame
from kochab.core.registry import integer, number, switch
from kochab.core.values import frozen
from kochab.lab.detectors.background import measured_detections, no_detections, separated_stars, without_background
from kochab.lab.detectors.star_finders import found_places


@frozen
class MaximaDetector:
    """A pixel above the threshold that none in the box around it exceeds.

    ``sigmas`` and ``box_px`` are the thesis'. Pixels of equal height that touch, or are within half
    a box, are one star, as it asks without saying how. It does not take the ``refined`` place.
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
            return no_detections(frame)
        top = flat.image == maximum_filter(flat.image, size=self.box_px)
        top &= flat.image > flat.threshold(self.sigmas, self.clipped)
        # Corners touch as well, so that a flat top is one plateau, at its middle.
        plateaus, count = label(top, np.ones((3, 3)))
        places = center_of_mass(top, plateaus, np.arange(1, count + 1))
        xy = np.array(places, dtype=np.float64).reshape(-1, 2)[:, ::-1]
        half = self.box_px // 2
        xy, flux, pixels = separated_stars(flat, xy, half, half + 0.5)
        if self.refined:
            stamps = flat.stamps(xy, half)
            # Negative pixels around a faint star would push the centre out of the box.
            light = np.maximum(stamps.value, 0.0)
            total = np.maximum(light.sum(axis=(1, 2)), 1e-30)
            dx = (light.sum(axis=1) @ stamps.offsets) / total
            dy = (light.sum(axis=2) @ stamps.offsets) / total
            xy = np.stack([stamps.x + dx, stamps.y + dy], axis=1).astype(np.float64)
        return measured_detections(flat, xy, flux, pixels, self.max_stars)


# Stars as peaks shaped like a Gaussian: photutils' DAOStarFinder (Stetson 1987, PASP 99, 191). Source: "Lost in
# space" for robotic telescopes (thesis, 2018), section 5.1.2, the "source detection method".


@frozen
class GaussianDetector:
    """Peaks of a Gaussian's width, with the thesis' defaults.

    Its threshold is in standard deviations of all pixels, so that many bright stars raise it, unless
    ``clipped``. Sources within half a FWHM of a brighter one, which flat tops give, are left out.
    """

    paper: ClassVar[str] = "Lost in space for robotic telescopes, 2018, section 5.1.2"

    sigmas: float = number(5.0, "sigma", 0.1, 1000.0, "threshold")
    fwhm_px: float = number(5.0, "px", 1.0, 50.0, "width of the Gaussian")
    clipped: bool = switch(False, "sigma is the background's noise, not that of all pixels")
    max_stars: int = integer(6000, "stars", 1, 200_000, "at most so many stars, the brightest")

    def detect(self, frame: Frame) -> Detections:
        """Stars of ``frame``, brightest first."""
        flat = without_background(frame)
        if flat is None:
            return no_detections(frame)
        broken = flat.broken if flat.broken.any() else None
        threshold = flat.threshold(self.sigmas, self.clipped)
        xy = found_places("DAOStarFinder", flat.image, threshold, self.fwhm_px, broken)
        xy = xy[np.isfinite(xy).all(axis=1)]
        stars = separated_stars(flat, xy, max(2, round(self.fwhm_px / 2)), 0.5 * self.fwhm_px)
        return measured_detections(flat, *stars, self.max_stars)


# -- The combined detector of "Lost in space" for robotic telescopes (thesis, 2018) ------------
# Source: sections 6.2.4 and 7.1.5: Gaussian sources first, and local maxima where those are too few.


@frozen
class ThesisDetector:
    """The stars of ``first`` when they are ``fewest`` (1 or more; the thesis' 5) or more.

    Else those of ``second``, which bears blurred and elongated stars better.
    """

    paper: ClassVar[str] = "Lost in space for robotic telescopes, 2018, section 6.2.4"

    fewest: int = integer(5, "stars", 1, 1000, "with fewer Gaussian sources, maxima are taken")
    first: GaussianDetector = field(default_factory=GaussianDetector)
    second: MaximaDetector = field(default_factory=MaximaDetector)

    def detect(self, frame: Frame) -> Detections:
        """Stars of ``frame``, brightest first."""
        found = self.first.detect(frame)
        return found if len(found) >= self.fewest else self.second.detect(frame)
