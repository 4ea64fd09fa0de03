"""Where a star is tonight: from ICRS to the horizon of a site (precession, aberration, refraction) and back.

All of it is ERFA's (``apco``, ``atciqz``, ``atioq``) but the refraction below 10 degrees, where its two terms no
longer hold (10' at the horizon; it is 34). Nothing is downloaded: UT1 is taken for UTC,
which turns the sky by at most 0.9 s about the pole and so moves an axis by no more than its
distance from the pole times 13.5 arcsec a radian; polar motion (0.3 arcsec) is left out.
"""

from datetime import UTC, datetime
from functools import lru_cache
from typing import Any

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import Degrees, cross_product, radec_deg, unit_vectors, wrapped
from kochab.core.frame import Frame, Site
from kochab.core.values import frozen
from kochab.sky.apparent import JD_UNIX, apparent, earth, greenwich_deg, julian_date_tt

SEA_LEVEL_HPA = 1013.25
SCALE_HEIGHT_M = 8434.0  # R T / (M g) of air at 288 K


@frozen
class Refraction:
    """The atmosphere's state; ``pressure_hpa`` None takes that of the site's height, 0 is no refraction."""

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

        a, b = erfa.refco(self.pressure_at(site), self.temperature_c, self.humidity, self.wavelength_um)
        return float(a), float(b)


STANDARD_REFRACTION = Refraction()
NO_AIR = Refraction(pressure_hpa=0.0)
LOW_DEG, HIGH_DEG = 5.0, 10.0
"""Geometric altitudes between which ERFA's refraction gives way to Saemundsson's."""


def low_refraction_deg(altitude_deg: Floats, refraction: Refraction, site: Site) -> Floats:
    """Refraction (N,), degrees, of low geometric altitudes (N,): Saemundsson 1986, Sky and Telescope 72, 70.

    Below -1 deg, where nothing is seen, that of -1 deg. Within 0.1' of Bennett's inverse (1982).
    """
    h = np.maximum(altitude_deg, -1.0)
    usual = 1.02 / np.tan(np.radians(h + 10.3 / (h + 5.11))) / 60.0
    air = refraction.pressure_at(site) / 1010.0 * 283.0 / (273.0 + refraction.temperature_c)
    return np.asarray(usual * air, dtype=np.float64)


@frozen
class Horizon:
    """One site at one moment."""

    site: Site
    time_utc: datetime
    refraction: Refraction = STANDARD_REFRACTION

    def observed(self, vectors: Floats) -> Floats:
        """Directions (N, 3) in E, N, U refracted, of ICRS unit vectors (N, 3)."""
        import erfa

        v = np.asarray(vectors, dtype=np.float64).reshape(-1, 3)
        ra, dec = np.arctan2(v[:, 1], v[:, 0]), np.arctan2(v[:, 2], np.hypot(v[:, 0], v[:, 1]))
        context = _context(self.site, self.time_utc, self.refraction)
        place = erfa.atciqz(ra, dec, context)
        azimuth, zenith_distance, *_ = erfa.atioq(*place, context)
        if (zenith_distance > np.radians(90.0 - HIGH_DEG)).any():
            _, airless, *_ = erfa.atioq(*place, _context(self.site, self.time_utc, NO_AIR))
            zenith_distance = self._lifted(airless, zenith_distance)
        level = np.sin(zenith_distance)
        return np.stack([level * np.sin(azimuth), level * np.cos(azimuth), np.cos(zenith_distance)], axis=-1)

    def _lifted(self, airless: Floats, erfas: Floats) -> Floats:
        """Zenith distances (N,), radians, seen through the air: of ERFA's where they hold, else Saemundsson's."""
        altitude = 90.0 - np.degrees(airless)
        low = airless - np.radians(low_refraction_deg(altitude, self.refraction, self.site))
        share = np.clip((HIGH_DEG - altitude) / (HIGH_DEG - LOW_DEG), 0.0, 1.0)
        return np.asarray(erfas + share * (low - erfas))

    def catalogue(self, directions: Floats) -> Floats:
        """ICRS unit vectors (N, 3) of refracted directions (N, 3) in E, N, U (ERFA ``atoiq``, ``aticq``)."""
        import erfa

        east, north, up = np.asarray(directions, dtype=np.float64).reshape(-1, 3).T
        context = _context(self.site, self.time_utc, self.refraction)
        azimuth, zenith_distance = np.arctan2(east, north), np.arctan2(np.hypot(east, north), up)
        place = np.array(erfa.atoiq("A", azimuth, zenith_distance, context))
        low = zenith_distance > np.radians(90.0 - HIGH_DEG)
        if low.any():
            place[:, low] = self._airless_place(azimuth[low], zenith_distance[low])
        return np.asarray(erfa.s2c(*erfa.aticq(*place, context)))

    def _airless_place(self, azimuth: Floats, zenith_distance: Floats) -> Any:
        """Apparent RA and Dec (2, N), radians, of low directions that :meth:`observed` lifts to where they are seen."""
        import erfa

        context, bare = (_context(self.site, self.time_utc, air) for air in (self.refraction, NO_AIR))
        airless = zenith_distance
        for _ in range(12):  # the refraction changes by at most a fifth of a change of altitude
            place = erfa.atoiq("A", azimuth, airless, bare)
            _, erfas, *_ = erfa.atioq(*place, context)
            airless = airless + zenith_distance - self._lifted(airless, erfas)
        return erfa.atoiq("A", azimuth, airless, bare)

    def altaz_deg(self, vector: Floats) -> tuple[float, float]:
        """Refracted altitude and azimuth (from north through east), degrees, of an ICRS unit vector (3,)."""
        east, north, up = self.observed(vector)[0]
        altitude = np.degrees(np.arcsin(np.clip(up, -1.0, 1.0)))
        return float(altitude), float(np.degrees(np.arctan2(east, north)) % 360.0)


def air_masses(altitude_deg: Floats) -> Floats:
    """Air masses (N,) at geometric altitudes (N,), degrees; 38 at the horizon and below.

    Kasten and Young (1989), Applied Optics 28, 4735.
    """
    h = np.maximum(altitude_deg, 0.0)
    return np.asarray(1.0 / (np.sin(np.radians(h)) + 0.50572 * (h + 6.07995) ** -1.6364))


def observed_at(site: Site, refraction: Refraction, hour_rad: Floats, declination_rad: Floats) -> Floats:
    """Directions (N, 3) in east, north, up, refracted.

    Parameters
    ----------
    site : Site
        Where the observer stands.
    refraction : Refraction
        The air's pressure and temperature.
    hour_rad : Floats
        Apparent hour angles (N,), radians, west positive.
    declination_rad : Floats
        Apparent declinations (N,), radians.
    """
    import erfa

    latitude, height = np.radians(site.latitude_deg), site.height_m
    context = erfa.apio(0.0, 0.0, 0.0, latitude, height, 0.0, 0.0, *refraction.constants(site))
    context["diurab"] = 0.0  # diurnal aberration moves a star there by 0.3 arcsec, but not the axis
    azimuth, zenith_distance, *_ = erfa.atioq(-np.asarray(hour_rad), np.asarray(declination_rad), context)
    level = np.sin(zenith_distance)
    return np.stack([level * np.sin(azimuth), level * np.cos(azimuth), np.cos(zenith_distance)], axis=-1)


def horizon_of(frame: Frame, site: Site | None = None) -> Horizon | None:
    """Where and when a frame was taken, at ``site`` if it does not say where; None when either is not known."""
    where = frame.hint.site or site
    return None if where is None or frame.hint.time_utc is None else Horizon(where, frame.hint.time_utc)


def sun_altitude_deg(site: Site, time_utc: datetime) -> float:
    """How high the Sun stands, degrees, to a few minutes of arc, without refraction."""
    return float(altitude_deg(sun_vector(time_utc)[None], site, time_utc)[0])


@lru_cache(maxsize=64)
def _context(site: Site, time_utc: datetime, refraction: Refraction) -> Any:
    """ERFA's star-independent parameters for a site and a moment."""
    import erfa

    tt = julian_date_tt(time_utc)
    ut = JD_UNIX + time_utc.astimezone(UTC).timestamp() / 86400.0
    heliocentric, barycentric = erfa.epv00(tt, 0.0)  # TT for TDB: 2 ms at most
    x, y, s = erfa.xys06a(tt, 0.0)  # a series of thousands of terms
    earth = (barycentric, heliocentric["p"], x, y, s, erfa.era00(ut, 0.0))
    place = (np.radians(site.longitude_deg), np.radians(site.latitude_deg), site.height_m)
    polar_motion = (0.0, 0.0, erfa.sp00(tt, 0.0))
    return erfa.apco(tt, 0.0, *earth, *place, *polar_motion, *refraction.constants(site))


# -- Without refraction: sidereal time, hour angles and geometric altitudes of places of date ------


def sidereal_deg(site: Site, time_utc: datetime) -> float:
    """Local apparent sidereal time, degrees in [0, 360) (ERFA ``gst06a``, UT1 taken as UTC)."""
    ut1 = JD_UNIX + time_utc.astimezone(UTC).timestamp() / 86400.0  # they differ by less than 0.9 s, which is 14 arcsec
    return (greenwich_deg(ut1, julian_date_tt(time_utc)) + site.longitude_deg) % 360.0


def hour_angle_deg(ra_deg: float, site: Site, time_utc: datetime) -> float:
    """Hour angle of a right ascension of date, degrees in [-180, 180), west positive."""
    return wrapped(sidereal_deg(site, time_utc) - ra_deg)


def altitude_deg(vectors: Floats, site: Site, time_utc: datetime) -> Floats:
    """Geometric altitudes (N,), degrees, of equatorial vectors of date (N, 3); no refraction."""
    zenith = unit_vectors(sidereal_deg(site, time_utc), site.latitude_deg)
    return np.degrees(np.arcsin(np.clip(vectors @ zenith, -1.0, 1.0)))


def horizon_frame(site: Site, sidereal: float) -> Floats:
    """Rotation (3, 3) to vectors of date from (south, east, up); ``sidereal`` in degrees."""
    up = unit_vectors(sidereal, site.latitude_deg)
    east = unit_vectors(sidereal + 90.0, 0.0)
    return np.stack([cross_product(east, up), east, up], axis=1)


def sun_vector(time_utc: datetime) -> Floats:
    """Apparent direction (3,) of the Sun, true equator and equinox of date (ERFA ``epv00``)."""
    towards = -earth(julian_date_tt(time_utc))[0]
    return np.asarray(apparent(np.atleast_2d(towards / np.linalg.norm(towards)), time_utc)[0])


def from_altaz(altitude: float, azimuth: float, site: Site, time_utc: datetime) -> Degrees:
    """RA and Dec of date, degrees.

    Parameters
    ----------
    altitude : float
        Geometric altitude, degrees.
    azimuth : float
        Degrees from north over east.
    site : Site
        Where the observer stands.
    time_utc : datetime
        When.
    """
    h, a = np.radians([altitude, azimuth])
    # The frame's x is south, its y east, its z up.
    level = np.array([-np.cos(h) * np.cos(a), np.cos(h) * np.sin(a), np.sin(h)])
    return radec_deg(horizon_frame(site, sidereal_deg(site, time_utc)) @ level)
