"""The Sun, the Moon and the planets as they stand among the stars of a frame.

Places are astrometric: light time is counted and aberration is not, as of the catalogue's stars that a frame is solved
by. The site counts for the nearer ones, most for the Moon.
"""

import math
from collections.abc import Callable, Sequence
from datetime import datetime
from enum import StrEnum
from functools import partial
from typing import Protocol

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import ARCSEC, radec_deg, unit, unit_vectors
from kochab.core.frame import Site
from kochab.core.progress import Task
from kochab.core.values import frozen
from kochab.sky.apparent import JD_UNIX, LIGHT_AU_DAY, julian_date_tt, of_date_matrix
from kochab.sky.ephemeris import shipped_ephemeris
from kochab.text.translation import tr_noop

AU_KM = 149597870.7
PARALLAX_ARCSEC = 8.794143
"""How far the Earth's radius shifts a body at 1 au."""


class BodyKind(StrEnum):
    """What moves among the stars."""

    SUN = tr_noop("sun")
    MOON = tr_noop("moon")
    PLANET = tr_noop("planet")
    DWARF = tr_noop("dwarf planet")
    SATELLITE = tr_noop("moon of a planet")
    ASTEROID = tr_noop("asteroid")
    COMET = tr_noop("comet")
    SPACECRAFT = tr_noop("satellite")


@frozen
class Body:
    """A body of the Solar System at one moment, seen from one place.

    ``ra_deg``, ``dec_deg`` ICRS, astrometric; ``distance_au`` from the observer; ``magnitude`` V, NaN when not known;
    ``diameter_arcsec`` of the disc, 0 when not known; ``phase`` the lit share of the disc; ``sigma_arcsec`` 1 sigma of
    the place, a site that is not known included; ``trail`` RA and Dec, degrees, of a satellite during the exposure.
    """

    name: str
    kind: BodyKind
    ra_deg: float
    dec_deg: float
    distance_au: float
    magnitude: float
    diameter_arcsec: float
    phase: float
    sigma_arcsec: float
    trail: tuple[tuple[float, float], ...] = ()

    @property
    def vector(self) -> Floats:
        """ICRS unit vector (3,)."""
        return unit_vectors(self.ra_deg, self.dec_deg)


@frozen(eq=False)
class Observer:
    """Where and when: ``place`` (1, 3) au from the barycentre, ICRS axes, at ``jd_tdb`` (1,), of mid-exposure."""

    time_utc: datetime
    site: Site | None
    jd_tdb: Floats
    place: Floats
    exposure_s: float = 0.0

    def sees(self, where: Callable[[Floats], Floats]) -> tuple[Floats, Floats]:
        """Vectors (N, 3) au from here to bodies as their light shows them, and the light's dates (N,).

        ``where`` gives barycentric places (N, 3) au at Julian dates TDB, (1,) or one a body.
        """
        jd = self.jd_tdb
        # light time: each pass gains a factor of v/c, 1e-4
        for _ in range(3):
            vectors = where(jd) - self.place
            jd = self.jd_tdb - np.linalg.norm(vectors, axis=1) / LIGHT_AU_DAY
        return vectors, jd

    def sigma_arcsec(self, distance_au: float, own: float) -> float:
        """Uncertainty of a place: the table's ``own``, and the parallax when the site is not known."""
        return math.hypot(own, 0.0 if self.site else PARALLAX_ARCSEC / distance_au)


class Moving(Protocol):
    """A table of bodies that move among the stars."""

    @property
    def names(self) -> Sequence[str]:
        """What each is called."""

    def body(self, row: int, observer: Observer) -> Task[Body | None]:
        """One of them wherever it is; None when that is not known."""

    def near(self, observer: Observer, centre: Floats, radius_rad: float, faintest: float) -> Task[list[Body]]:
        """Its bodies near a direction.

        Parameters
        ----------
        observer : Observer
            Where and when.
        centre : Floats
            ICRS unit vector (3,).
        radius_rad : float
            How near, radians.
        faintest : float
            Faintest magnitude.
        """

    def warning(self, time_utc: datetime, site: Site | None) -> str:
        """What is to be said of its elements at that time, in a sentence, or nothing."""


def covers(time_utc: datetime) -> bool:
    """Whether the shipped ephemeris reaches that date, a year of light time and integration steps left."""
    ephemeris = shipped_ephemeris()
    return bool(ephemeris.first_jd + 1.0 < julian_date_tt(time_utc) < ephemeris.last_jd - 1.0)


def observer_at(time_utc: datetime, site: Site | None, exposure_s: float = 0.0) -> Observer:
    """An observer on the ground at ``site``, or at the Earth's centre when that is not known.

    UT1 is taken for UTC and polar motion left out: 0.2 arcsec of the Moon.
    """
    jd = np.array([julian_date_tt(time_utc)])
    place = shipped_ephemeris()("earth", jd)
    if site is not None:
        import erfa

        ut1 = JD_UNIX + time_utc.timestamp() / 86400.0
        ground = erfa.gd2gc(1, np.radians(site.longitude_deg), np.radians(site.latitude_deg), site.height_m)
        # from the turning Earth to the true equator of date; of_date_matrix on the right then takes it to ICRS
        of_date = erfa.rz(-erfa.gst06a(ut1, 0.0, jd[0], 0.0), np.eye(3)) @ ground
        place = place + of_date @ of_date_matrix(time_utc) / (1e3 * AU_KM)
    return Observer(time_utc, site, jd, place, exposure_s)


RADIUS_KM = {
    "sun": 695700.0,
    "moon": 1737.4,
    "mercury": 2439.7,
    "venus": 6051.8,
    "mars": 3396.2,
    "jupiter": 71492.0,
    "saturn": 60268.0,
    "uranus": 25559.0,
    "neptune": 24764.0,
    "pluto": 1188.3,
}
"""Of the equator (IAU WGCCRE 2015), in the order in which bodies are told."""

KIND = {"sun": BodyKind.SUN, "moon": BodyKind.MOON, "pluto": BodyKind.DWARF}
SATURN_POLE = unit_vectors(40.589, 83.537)
"""ICRS, J2000 (IAU WGCCRE 2015)."""


def major_bodies(observer: Observer, only: str = "") -> list[Body]:
    """The Sun, the Moon, the planets and Pluto; with ``only`` the one of that name, lower case."""
    ephemeris = shipped_ephemeris()
    found = []
    for name, radius_km in RADIUS_KM.items():
        if only and name != only:
            continue
        vectors, jd = observer.sees(partial(ephemeris, name))
        from_sun = (observer.place + vectors - ephemeris("sun", jd))[0]
        distance = float(np.linalg.norm(vectors))
        angle = 0.0 if name == "sun" else phase_angle_deg(vectors[0], from_sun)
        ra, dec = radec_deg(vectors[0])
        found.append(
            Body(
                name=name.capitalize(),
                kind=KIND.get(name, BodyKind.PLANET),
                ra_deg=ra,
                dec_deg=dec,
                distance_au=distance,
                magnitude=magnitude(name, vectors[0], from_sun, angle),
                diameter_arcsec=float(2.0 * np.arcsin(radius_km / AU_KM / distance) / ARCSEC),
                phase=lit_share(angle),
                sigma_arcsec=observer.sigma_arcsec(distance, 0.3 if name == "moon" else 0.1),
            )
        )
    return found


def phase_angle_deg(from_observer: Floats, from_sun: Floats) -> float:
    """The angle at the body between observer and Sun."""
    return float(np.degrees(np.arccos(np.clip(unit(from_observer) @ unit(from_sun), -1.0, 1.0))))


def lit_share(phase_angle_deg: float) -> float:
    """The share of a round disc that the Sun lights."""
    return float((1.0 + np.cos(np.radians(phase_angle_deg))) / 2.0)


MAGNITUDES = {  # V at 1 au from Sun and observer: up to a phase angle in degrees, powers of that angle
    "moon": ((180.0, (0.21, 0.026, 0.0, 0.0, 4e-9)),),
    "mercury": ((180.0, (-0.613, 6.328e-2, -1.6336e-3, 3.3644e-5, -3.4265e-7, 1.6893e-9, -3.0334e-12)),),
    "venus": ((163.7, (-4.384, -1.044e-3, 3.687e-4, -2.814e-6, 8.938e-9)), (180.0, (236.05828, -2.81914, 8.39034e-3))),
    "mars": ((50.0, (-1.601, 2.267e-2, -1.302e-4)), (180.0, (-0.367, -0.02573, 3.445e-4))),
    "jupiter": ((180.0, (-9.395, -3.7e-4, 6.16e-4)),),
    "saturn": ((180.0, (-8.914, 0.026)),),
    "uranus": ((180.0, (-7.110, 6.587e-3, 1.045e-4)),),
    "neptune": ((180.0, (-7.00,)),),
    "pluto": ((180.0, (-1.01, 0.031)),),
}
"""Planets: Mallama and Hilton 2018, Astronomy and Computing 25, 10; the Moon: Allen, *Astrophysical Quantities*."""


CRESCENT_DEG, EARTHLIT_DEG = 150.0, 173.0
"""Beyond the first the lit Moon fades with the third power of what is left of 180 deg (Samaha, Asaad and Mikhail 1969,
Helwan Observatory Bulletin 84); beyond the second the Earth lights it more."""


def magnitude(name: str, from_observer: Floats, from_sun: Floats, phase_angle: float) -> float:
    """V of the Sun, the Moon or a planet; spots, seasons and eclipses are left out.

    Parameters
    ----------
    name : str
        ``sun``, ``moon`` or a planet's name.
    from_observer : Floats
        From the observer to the body (3,), au.
    from_sun : Floats
        From the Sun to the body (3,), au.
    phase_angle : float
        Between the Sun and the observer as the body sees them, degrees.
    """
    distances = float(5.0 * np.log10(np.linalg.norm(from_observer)))
    if name == "sun":
        return -26.74 + distances
    if name == "moon" and phase_angle > CRESCENT_DEG:
        left = 180.0 - min(phase_angle, EARTHLIT_DEG)
        distances += 7.5 * math.log10((180.0 - CRESCENT_DEG) / left)
        phase_angle = CRESCENT_DEG
    powers = next(powers for limit, powers in MAGNITUDES[name] if phase_angle <= limit)
    value = float(np.polynomial.polynomial.polyval(phase_angle, powers)) + distances
    if name == "saturn":
        # sines of the ring's tilt to us and to the Sun: of opposite sign we see its dark side
        tilt, lit = -unit(from_observer) @ SATURN_POLE, -unit(from_sun) @ SATURN_POLE
        ring = math.sqrt(max(0.0, float(tilt * lit)))
        value -= ring * (1.825 + 0.378 * math.exp(-2.25 * phase_angle))
    return value + float(5.0 * np.log10(np.linalg.norm(from_sun)))
