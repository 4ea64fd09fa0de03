"""From ICRS to where a direction is seen from a site: precession, aberration, refraction.

All of it is ERFA's (``apco``, ``atciqz``, ``atioq``). Nothing is downloaded: UT1 is taken for UTC,
which turns the sky by at most 0.9 s about the pole and so moves an axis by no more than its
distance from the pole times 13.5 arcsec a radian; polar motion (0.3 arcsec) is left out.
"""

from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.core.hint import Site
from app.sky.apparent import JD_UNIX, julian_date_tt

Floats = NDArray[np.float64]

SEA_LEVEL_HPA = 1013.25
SCALE_HEIGHT_M = 8434.0


@dataclass(frozen=True, slots=True)
class Air:
    """What bends the light; ``pressure_hpa`` None takes that of the site's height, 0 is vacuum."""

    pressure_hpa: float | None = None
    temperature_c: float = 10.0
    humidity: float = 0.5
    wavelength_um: float = 0.55

    def pressure_at(self, site: Site) -> float:
        """Pressure, hPa, at the site."""
        if self.pressure_hpa is not None:
            return self.pressure_hpa
        return float(SEA_LEVEL_HPA * np.exp(-site.height_m / SCALE_HEIGHT_M))

    def constants(self, site: Site) -> tuple[float, float]:
        """A and B, radians, of the refraction A tan z + B tan^3 z (ERFA ``refco``)."""
        import erfa

        a, b = erfa.refco(
            self.pressure_at(site), self.temperature_c, self.humidity, self.wavelength_um
        )
        return float(a), float(b)


STANDARD_AIR = Air()


@dataclass(frozen=True, slots=True)
class Horizon:
    """One site at one moment."""

    site: Site
    time_utc: datetime
    air: Air = STANDARD_AIR

    def observed(self, vectors: Floats) -> Floats:
        """Directions (N, 3) in E, N, U as the air shows them, of ICRS unit vectors (N, 3)."""
        import erfa

        v = np.asarray(vectors, dtype=np.float64).reshape(-1, 3)
        ra, dec = np.arctan2(v[:, 1], v[:, 0]), np.arctan2(v[:, 2], np.hypot(v[:, 0], v[:, 1]))
        context = _context(self.site, self.time_utc, self.air)
        azimuth, zenith_distance, *_ = erfa.atioq(*erfa.atciqz(ra, dec, context), context)
        level = np.sin(zenith_distance)
        return np.stack(
            [level * np.sin(azimuth), level * np.cos(azimuth), np.cos(zenith_distance)], axis=-1
        )

    def altitude_deg(self, vector: Floats) -> float:
        """Altitude, degrees, of one ICRS unit vector (3,), as the air shows it."""
        return float(np.degrees(np.arcsin(np.clip(self.observed(vector)[0, 2], -1.0, 1.0))))


@lru_cache(maxsize=64)
def _context(site: Site, time_utc: datetime, air: Air) -> Any:
    """ERFA's star-independent parameters for a site and a moment."""
    import erfa

    tt = julian_date_tt(time_utc)
    ut = JD_UNIX + time_utc.astimezone(UTC).timestamp() / 86400.0
    heliocentric, barycentric = erfa.epv00(tt, 0.0)
    x, y, s = erfa.xys06a(tt, 0.0)
    return erfa.apco(
        tt, 0.0, barycentric, heliocentric["p"], x, y, s, erfa.era00(ut, 0.0),
        np.radians(site.longitude_deg), np.radians(site.latitude_deg), site.height_m,
        0.0, 0.0, erfa.sp00(tt, 0.0), *air.constants(site),
    )  # fmt: skip
