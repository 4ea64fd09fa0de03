"""What a person or a header believes about a frame. Hints save time; they never decide."""

from dataclasses import dataclass
from datetime import datetime


@dataclass(frozen=True, slots=True)
class Site:
    """A place on the Earth: geodetic degrees, east positive, metres above the ellipsoid."""

    latitude_deg: float
    longitude_deg: float
    height_m: float = 0.0


@dataclass(frozen=True, slots=True)
class Hint:
    """Optional beliefs about scale, place and time; any of them may be wrong.

    ``scale_arcsec_px`` is a (low, high) range at the frame's centre; ``centre_deg`` is
    (RA, Dec, radius) in ICRS degrees; ``time_utc`` is aware, at mid-exposure.
    """

    scale_arcsec_px: tuple[float, float] | None = None
    centre_deg: tuple[float, float, float] | None = None
    time_utc: datetime | None = None
    exposure_s: float | None = None
    site: Site | None = None
    camera: str = ""
    source: str = ""

    @property
    def helps(self) -> bool:
        """Whether it narrows the search at all."""
        return self.scale_arcsec_px is not None or self.centre_deg is not None
