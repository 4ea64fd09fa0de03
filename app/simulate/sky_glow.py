"""How bright the sky is between the stars, and how much of the starlight the air takes.

The Moon's light is that of Krisciunas and Schaefer (1991, PASP 103, 1033, eq. 3, 9, 15, 20 and
21). The twilight is a rough line through commonly measured zenith values.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.simulate.local_sky import LocalSky, altitude_deg
from app.sky.apparent import JD_UNIX

Floats = NDArray[np.float64]
TWILIGHT_DEG = (-18.0, -12.0, -6.0, 0.0, 10.0)
TWILIGHT_MAG = (24.0, 19.5, 13.5, 7.5, 4.0)


@dataclass(frozen=True, slots=True)
class Glow:
    """The site's sky: ``dark_mag`` is V of a square arcsec at the zenith without Moon.

    ``extinction`` is magnitudes an airmass,
    ``lamps`` is how much brighter each further airmass makes the sky. ``moon`` may be left out.
    """

    dark_mag: float = 20.5
    extinction: float = 0.2
    lamps: float = 0.35
    moon: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class Lamps:
    """Sun and Moon now: directions (3,) east, north, up, and the Moon's phase angle, degrees."""

    sun: Floats
    moon: Floats
    phase_deg: float


def airmass(directions: Floats) -> Floats:
    """Airmass (N,) towards directions (N, 3) (Rozenberg 1966); 40 at the horizon and below."""
    sine = np.maximum(np.asarray(directions, dtype=np.float64)[..., 2], 0.0)
    return np.asarray(1.0 / (sine + 0.025 * np.exp(-11.0 * sine)))


def lamps(sky: LocalSky, unix_s: float) -> Lamps:
    """Where Sun and Moon stand over the site (ERFA ``epv00``, ``moon98``; no parallax)."""
    import erfa

    day, fraction = JD_UNIX + unix_s // 86400.0, (unix_s % 86400.0) / 86400.0
    sun = -np.asarray(erfa.epv00(day, fraction)[0]["p"])
    moon = np.asarray(erfa.moon98(day, fraction)["p"])
    sun_u, moon_u = sun / np.linalg.norm(sun), moon / np.linalg.norm(moon)
    to_sun = sun - moon
    cosine = float(-moon_u @ to_sun / np.linalg.norm(to_sun))
    return Lamps(
        sky.to_enu(sun_u), sky.to_enu(moon_u), float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
    )


def surface_mag(directions: Floats, glow: Glow, light: Lamps) -> Floats:
    """V of a square arcsec of sky (N,) towards directions (N, 3), east, north, up."""
    masses = np.minimum(airmass(directions), 10.0)
    flux = 10.0 ** (-0.4 * glow.dark_mag) * (1.0 + glow.lamps * (masses - 1.0))
    sun = float(altitude_deg(light.sun))
    if sun > TWILIGHT_DEG[0]:
        flux = flux + 10.0 ** (-0.4 * float(np.interp(sun, TWILIGHT_DEG, TWILIGHT_MAG)))
    if glow.moon and light.moon[2] > 0.0:
        flux = flux + _moonlight(directions, glow.extinction, light)
    return np.asarray(-2.5 * np.log10(flux))


def _moonlight(directions: Floats, extinction: float, light: Lamps) -> Floats:
    phase = light.phase_deg
    bright = 10.0 ** (-0.4 * (3.84 + 0.026 * abs(phase) + 4e-9 * phase**4))
    cosine = np.clip(directions @ light.moon, -1.0, 1.0)
    away = np.maximum(np.degrees(np.arccos(cosine)), 1.0)
    scattered = 10.0**5.36 * (1.06 + cosine**2)
    scattered = scattered + np.where(away > 10.0, 10.0 ** (6.15 - away / 40.0), 6.2e7 / away**2)
    through = 10.0 ** (-0.4 * extinction * _scatter_mass(light.moon))
    lit = 1.0 - 10.0 ** (-0.4 * extinction * _scatter_mass(directions))
    nanolamberts = scattered * bright * through * lit
    return np.asarray(nanolamberts / 34.08 * np.exp(-20.7233))


def _scatter_mass(directions: Floats) -> Floats:
    flat2 = 1.0 - np.maximum(np.asarray(directions)[..., 2], 0.0) ** 2
    return np.asarray(1.0 / np.sqrt(1.0 - 0.96 * flat2))
