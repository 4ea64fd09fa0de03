"""photutils' star finders: DAOStarFinder (Stetson 1987, PASP 99, 191) and IRAFStarFinder (IRAF's ``starfind``).

Both convolve the frame with a Gaussian and take peaks; DAOStarFinder judges them by fits of their profiles along x and
y, IRAFStarFinder by the moments of the pixels above the local sky. Their defaults here are those of photutils' own
documentation: a background and a noise with stars clipped away, 5 sigma, an FWHM of 3 px.
"""

import warnings
from importlib import import_module
from typing import ClassVar

import numpy as np

from kochab.core.arrays import Bools, Floats, Floats32
from kochab.core.errors import UsageError
from kochab.core.frame import Detections, Frame
from kochab.core.registry import integer, number
from kochab.core.values import frozen
from kochab.lab.detectors.background import measured_detections, no_detections, separated_stars, without_background

FAINTEST_SNR = 3.0  # of the light in a box; IRAFStarFinder gives some peaks of the noise


@frozen
class DaoStarFinder:
    """Peaks whose profiles along x and y a Gaussian fits, by photutils' DAOStarFinder."""

    paper: ClassVar[str] = "Stetson 1987, PASP 99, 191; photutils"

    sigmas: float = number(5.0, "sigma", 0.1, 1000.0, "threshold above the background's noise")
    fwhm_px: float = number(3.0, "px", 1.0, 50.0, "width of the Gaussian")
    max_stars: int = integer(6000, "stars", 1, 200_000, "at most so many stars, the brightest")

    def detect(self, frame: Frame) -> Detections:
        """Stars of ``frame``, brightest first; `UsageError` where photutils is not installed."""
        return _detect("DAOStarFinder", frame, self.sigmas, self.fwhm_px, self.max_stars)


@frozen
class IrafStarFinder:
    """Peaks whose moments are those of a star, by photutils' IRAFStarFinder."""

    paper: ClassVar[str] = "IRAF starfind; photutils"

    sigmas: float = number(5.0, "sigma", 0.1, 1000.0, "threshold above the background's noise")
    fwhm_px: float = number(3.0, "px", 1.0, 50.0, "width of the Gaussian")
    max_stars: int = integer(6000, "stars", 1, 200_000, "at most so many stars, the brightest")

    def detect(self, frame: Frame) -> Detections:
        """Stars of ``frame``, brightest first; `UsageError` where photutils is not installed."""
        return _detect("IRAFStarFinder", frame, self.sigmas, self.fwhm_px, self.max_stars)


def _detect(finder: str, frame: Frame, sigmas: float, fwhm_px: float, most: int) -> Detections:
    flat = without_background(frame)
    if flat is None:
        return no_detections(frame)
    broken = flat.broken if flat.broken.any() else None
    xy = found_places(finder, flat.image, sigmas * flat.noise, fwhm_px, broken)
    xy = xy[np.isfinite(xy).all(axis=1)]
    half = max(2, round(fwhm_px))
    xy, flux, pixels = separated_stars(flat, xy, half, fwhm_px)
    real = flux > FAINTEST_SNR * flat.noise * np.sqrt(np.maximum(pixels, 1.0))
    return measured_detections(flat, xy[real], flux[real], pixels[real], most)


def found_places(finder: str, image: Floats32, threshold: float, fwhm_px: float, mask: Bools | None = None) -> Floats:
    """Places (N, 2) px that photutils gives.

    Raises `UsageError` where photutils is not installed.

    Parameters
    ----------
    finder : str
        Name of photutils' class.
    image : Floats32
        Pixels (H, W) without their background.
    threshold : float
        In the units of the image.
    fwhm_px : float
        Width of a star's image.
    mask : Bools or None
        Pixels (H, W) that are no stars; None: there are none.
    """
    try:
        detection = import_module("photutils.detection")
    except ImportError as error:
        raise UsageError(
            "This detector needs photutils, which has no wheel for this system: pip install photutils builds it"
        ) from error
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that there are none is an answer
        table = getattr(detection, finder)(threshold=threshold, fwhm=fwhm_px)(image, mask=mask)
    if table is None:
        return np.empty((0, 2))
    new = "x_centroid" in table.colnames  # "xcentroid" before photutils 3
    names = ("x_centroid", "y_centroid") if new else ("xcentroid", "ycentroid")
    return np.stack([np.asarray(table[name], dtype=np.float64) for name in names], axis=1)
