"""The sky over one site at one moment: catalogue directions to east, north, up, and back.

Everything is ERFA's: light bending, annual and diurnal aberration, precession, nutation and
refraction. UT1 is taken for UTC and polar motion is left out (under 1 arcsec in azimuth and
0.4 arcsec elsewhere, the same for the whole sky), so that nothing is ever fetched.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.core.hint import Site
from app.sky.apparent import JD_UNIX, TT_MINUS_UTC_S

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Air:
    """What bends light near the ground; a pressure of 0 means no refraction."""

    pressure_hpa: float = 1010.0
    temperature_c: float = 10.0
    humidity: float = 0.5
    wavelength_um: float = 0.55


class LocalSky:
    """Directions over ``site`` at ``unix_s``; making one costs a third of a millisecond."""

    def __init__(self, site: Site, unix_s: float, air: Air | None = None) -> None:
        import erfa

        air = air or Air()
        day, fraction = JD_UNIX + unix_s // 86400.0, (unix_s % 86400.0) / 86400.0
        tt = fraction + TT_MINUS_UTC_S / 86400.0
        self._to_cirs, self._origins = erfa.apci13(day, tt)
        bend_a, bend_b = erfa.refco(
            air.pressure_hpa, air.temperature_c, air.humidity, air.wavelength_um
        )
        longitude, latitude = np.radians([site.longitude_deg, site.latitude_deg])
        self._rotation = float(erfa.era00(day, fraction))
        self._longitude = float(longitude)
        self._to_observed = erfa.apio(
            erfa.sp00(day, tt), self._rotation, longitude, latitude, site.height_m,
            0.0, 0.0, bend_a, bend_b,
        )  # fmt: skip
        self._north = site.latitude_deg >= 0.0

    @property
    def sidereal_rad(self) -> float:
        """Apparent local sidereal time."""
        return float((self._rotation - self._origins + self._longitude) % (2.0 * np.pi))

    def to_enu(self, vectors: Floats) -> Floats:
        """Observed directions (N, 3), east, north, up, of ICRS catalogue vectors (N, 3)."""
        import erfa

        ra, dec = _angles(vectors)
        azimuth, zenith, *_ = erfa.atioq(*erfa.atciqz(ra, dec, self._to_cirs), self._to_observed)
        return _enu(azimuth, zenith)

    def from_enu(self, directions: Floats) -> Floats:
        """ICRS catalogue vectors (N, 3) of observed directions (N, 3), east, north, up."""
        import erfa

        e, n, u = np.moveaxis(np.asarray(directions, dtype=np.float64), -1, 0)
        zenith = np.arctan2(np.hypot(e, n), u)
        cirs = erfa.atoiq("A", np.arctan2(e, n), zenith, self._to_observed)
        return _unit(*erfa.aticq(*cirs, self._to_cirs))

    def of_date(self, vectors: Floats) -> tuple[float, float]:
        """Apparent geocentric RA and Dec, degrees, equinox of date, of one ICRS vector (3,)."""
        import erfa

        ra, dec = erfa.atciqz(*_angles(vectors), self._to_cirs)
        return float(np.degrees(ra - self._origins) % 360.0), float(np.degrees(dec))

    def pole_enu(self, refracted: bool = True) -> Floats:
        """The visible celestial pole (3,) of date, as seen through the air or without it."""
        import erfa

        dec = np.pi / 2 if self._north else -np.pi / 2
        through = self._to_observed.copy()
        if not refracted:
            through["refa"] = through["refb"] = 0.0
        azimuth, zenith, *_ = erfa.atioq(0.0, dec, through)
        return _enu(azimuth, zenith)


def altitude_deg(directions: Floats) -> Floats:
    """Altitudes (N,), degrees, of directions (N, 3), east, north, up."""
    return np.asarray(np.degrees(np.arcsin(np.clip(np.asarray(directions)[..., 2], -1.0, 1.0))))


def azimuth_deg(directions: Floats) -> Floats:
    """Azimuths (N,), degrees in [0, 360) from north through east, of directions (N, 3)."""
    e, n, _ = np.moveaxis(np.asarray(directions, dtype=np.float64), -1, 0)
    return np.asarray(np.degrees(np.arctan2(e, n)) % 360.0)


def _angles(vectors: Floats) -> tuple[Floats, Floats]:
    x, y, z = np.moveaxis(np.asarray(vectors, dtype=np.float64), -1, 0)
    return np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))


def _unit(ra: Floats, dec: Floats) -> Floats:
    return np.stack([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)], axis=-1)


def _enu(azimuth: Floats, zenith: Floats) -> Floats:
    flat = np.sin(zenith)
    return np.stack([flat * np.sin(azimuth), flat * np.cos(azimuth), np.cos(zenith)], axis=-1)
