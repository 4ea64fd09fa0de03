"""From a frame to a pointing, or to the reason why there is none; and the options of a solve."""

from collections.abc import Mapping
from dataclasses import field
from typing import Any

from kochab.core.frame import Hint
from kochab.core.values import frozen

# -- What a person may choose about a solve ----------------------------------------------------

DEFAULT_METHOD = "patterns"
UNKNOWN_YEAR = 2016.0
"""The date stars are placed at when a frame does not say when it was taken (Julian year)."""
UNKNOWN_YEAR_SIGMA = 10.0
"""One sigma of that date, years: digital frames are of about 1996 and later, and there will be more."""
FEWEST_STARS = 6
"""Fewer prove a pointing only when all of them are bright stars."""


@frozen
class SolveOptions:
    """Choices for one solve; the defaults solve blind.

    ``method`` and ``detector`` are names of the registries; ``method_options`` are the method's
    own, as :func:`kochab.core.registry.checked` returns them, ``detector_options`` and
    ``attitude_options`` the same for the other two. ``hint`` is what the person says; where it is
    silent the frame's own header speaks, unless ``use_header`` is off. Hints are tried first and
    never trusted: when they lead nowhere the search is repeated without them, unless
    ``blind_after_hint`` is off. ``fov_deg`` is the frame's width as the person believes it, good
    to a tenth, and stands in for the hint's scale. ``timeout_s`` bounds the search, None means for
    ever.
    ``attitude`` names an estimator of ``kochab.attitude.ESTIMATORS``. None, the default, reports the
    attitude of the final fit: least squares, weighted by the centroids' errors, of rotation and
    camera together. With a name, that fit still finds the stars and the camera, but the attitude,
    its errors and the residuals reported are the estimator's, from the same stars.
    ``distortion`` lets the camera model grow beyond rotation and focal length when the matches
    support it. ``aberration`` takes the annual aberration of starlight (up to 20.5 arcsec) out of
    the attitude; without it the answer is where the stars are seen in ICRS, which is what a
    plate solution means, and the differential part (under 0.2 arcsec across 1 deg) goes into the
    focal length. ``worst_px`` is how far off its place a star may be at worst, for who has measured
    it of a camera; None learns the errors from the frame.
    """

    method: str = DEFAULT_METHOD
    method_options: Mapping[str, Any] = field(default_factory=dict, hash=False)
    detector: str = "auto"
    detector_options: Mapping[str, Any] = field(default_factory=dict, hash=False)
    attitude: str | None = None
    attitude_options: Mapping[str, Any] = field(default_factory=dict, hash=False)
    hint: Hint | None = None
    fov_deg: float | None = None
    use_header: bool = True
    blind_after_hint: bool = True
    timeout_s: float | None = 30.0
    distortion: bool = True
    aberration: bool = False
    worst_px: float | None = None
    max_stars: int = 600
