"""A frame in memory, the hints about it (scale, place, time, site), and its detections."""

import math
from collections.abc import Mapping
from dataclasses import field
from datetime import datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Floats, Table
from kochab.core.robust import median
from kochab.core.values import frozen

# -- What a person or a header believes about a frame. Hints save time; they never decide ------


@frozen
class Site:
    """A place on the Earth: geodetic degrees, east positive, metres above the ellipsoid."""

    latitude_deg: float
    longitude_deg: float
    height_m: float = 0.0


@frozen
class Hint:
    """Optional beliefs about scale, place and time; any of them may be wrong.

    ``scale_arcsec_px`` is a (low, high) range at the frame's centre; ``centre_deg`` is
    (RA, Dec, radius) in ICRS degrees; ``time_utc`` is aware, at mid-exposure, and
    ``time_of_file`` says that it is only when the file was written.
    """

    scale_arcsec_px: tuple[float, float] | None = None
    centre_deg: tuple[float, float, float] | None = None
    time_utc: datetime | None = None
    exposure_s: float | None = None
    site: Site | None = None
    camera: str = ""
    source: str = ""
    time_of_file: bool = False

    @property
    def taken_utc(self) -> datetime | None:
        """When it was taken; None where only its file has a time."""
        return None if self.time_of_file else self.time_utc

    @property
    def helps(self) -> bool:
        """Whether it narrows the search at all."""
        return self.scale_arcsec_px is not None or self.centre_deg is not None

    @property
    def focal_px(self) -> tuple[float, float] | None:
        """The shortest and the longest focal length that the scale means, px."""
        if self.scale_arcsec_px is None:
            return None
        # The largest scale means the shortest focal length.
        shortest, longest = (math.degrees(3600.0 / scale) for scale in sorted(self.scale_arcsec_px, reverse=True))
        return shortest, longest


@frozen(eq=False)
class Frame:
    """One exposure as read from a file or a camera.

    ``pixels`` (H, W), native dtype, native byte order, C-contiguous, row 0 at the top of the
    screen: what detection sees (luminance, or the raw mosaic when ``bayer`` names its pattern,
    e.g. ``"RGGB"``, read from pixel (0, 0)). ``colour`` (H, W, 3) is kept for display only.
    ``saturation`` is the level at which pixels clip, in the units of ``pixels``, None if unknown.
    ``warnings`` are sentences for the person; ``header`` is whatever the file said of itself.
    """

    pixels: NDArray[Any]
    colour: NDArray[Any] | None = None
    bayer: str | None = None
    saturation: float | None = None
    path: str = ""
    hint: Hint = field(default_factory=Hint)
    warnings: tuple[str, ...] = ()
    header: Mapping[str, Any] = field(default_factory=dict)

    @property
    def width(self) -> int:
        """Columns."""
        return int(self.pixels.shape[1])

    @property
    def height(self) -> int:
        """Rows."""
        return int(self.pixels.shape[0])


# -- What a detector found in a frame ----------------------------------------------------------


@frozen(eq=False)
class Detections(Table):
    """Stars of one frame, brightest first; all per-star arrays share the length N.

    ``xy`` (N, 2) float64 px, (0, 0) is the centre of the first pixel, x right, y down. ``flux`` (N,) in the frame's
    units above background; ``snr`` (N,); ``fwhm_px`` (N,); ``elongation`` (N,) major over minor axis, 1 is round;
    ``angle_rad`` (N,) of the major axis from +x towards +y; ``saturated`` and ``blended`` (N,) bool. ``background``
    and ``noise`` are the frame's median level and RMS per pixel.
    """

    width: int
    height: int
    xy: Floats
    flux: Floats
    snr: Floats
    fwhm_px: Floats
    elongation: Floats
    angle_rad: Floats
    saturated: NDArray[np.bool_]
    blended: NDArray[np.bool_]
    background: float = float("nan")
    noise: float = float("nan")

    def usual_fwhm_px(self, least_px: float) -> float | None:
        """The median width of the stars, from ``least_px`` to 10; None where none is known."""
        known = self.fwhm_px[np.isfinite(self.fwhm_px)]
        return float(np.clip(median(known), least_px, 10.0)) if len(known) else None

    @classmethod
    def from_list(cls, xy: Floats, width: int, height: int, flux: Floats | None = None) -> "Detections":
        """Detections from bare positions.

        Parameters
        ----------
        xy : Floats
            Positions (N, 2), px; (0, 0) is the centre of the first pixel.
        width, height : int
            Size of the frame, px.
        flux : Floats or None
            Flux (N,) in any linear unit; None: the list is brightest first.
        """
        xy = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
        n = len(xy)
        # Falling numbers keep the order of the list through the sort.
        flux = np.asarray(np.arange(n, 0, -1) if flux is None else flux, dtype=np.float64)
        order = np.argsort(-flux, kind="stable")
        nan, no = np.full(n, np.nan), np.zeros(n, dtype=np.bool_)
        return cls(width, height, xy[order], flux[order], nan, nan, nan, nan, no, no)
