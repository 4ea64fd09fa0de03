"""The four large moons of Jupiter, and the eight of Saturn that telescopes show.

Jupiter's by the theory L1.2 of Lainey, Duriez and Vienne (2006, A&A 456, 783), Saturn's by TASS 1.7 of Vienne and
Duriez (1995, A&A 297, 588; Hyperion 1997, A&A 324, 366), both shortened.
"""

import json
from functools import cache
from typing import Any

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import ARCSEC, angle_between, radec_deg
from kochab.folders import data_folder
from kochab.sky.ephemeris import shipped_ephemeris
from kochab.sky.solar_system import AU_KM, Body, BodyKind, Observer, lit_share, phase_angle_deg

MOONS = {  # radius in km; V at 1 au from Sun and observer, full (Astronomical Almanac); sigma of the place, arcsec
    "Jupiter": {
        "Io": (1821.6, -1.68, 0.2),
        "Europa": (1560.8, -1.41, 0.2),
        "Ganymede": (2631.2, -2.09, 0.2),
        "Callisto": (2410.3, -1.05, 0.2),
    },
    "Saturn": {
        "Mimas": (198.2, 3.3, 0.3),
        "Enceladus": (252.1, 2.1, 0.1),
        "Tethys": (531.1, 0.6, 0.1),
        "Dione": (561.4, 0.8, 0.1),
        "Rhea": (763.5, 0.1, 0.1),
        "Titan": (2574.7, -1.28, 0.1),
        "Hyperion": (135.0, 4.63, 1.0),
        "Iapetus": (734.3, 1.5, 0.3),
    },
}
"""The sigmas are against other theories and integrated orbits (Hyperion is up to 1.6 arcsec off, Mimas 0.4); Iapetus is
0.9 mag brighter or fainter by the side that it turns to us."""


@cache
def _theory(planet: str) -> dict[str, Any]:
    path = data_folder("resources") / f"{planet.lower()}_moons.json"
    return dict(json.loads(path.read_text(encoding="utf-8")))


def _angles(terms: list[list[float]], t: Floats, swings: Floats) -> tuple[Floats, Floats]:
    """Sizes (K,) of terms and their angles (N, K); what follows phase and speed are shares of ``swings`` (N, M)."""
    rows = np.array(terms).reshape(len(terms), -1)
    size, phase, speed = rows[:, :3].T
    return size, phase + np.multiply.outer(t, speed) + swings @ rows[:, 3:].T


def from_planet(planet: str, name: str, jd_tdb: Floats) -> Floats:
    """Vectors (N, 3) au, ICRS axes, from a planet's centre to a moon at Julian dates (N,) TDB."""
    theory = _theory(planet)
    moon, t = theory["moons"][name], jd_tdb - theory["epoch"]
    swings = np.zeros((len(t), len(theory["swings"])))  # of the longitudes, which all other terms follow
    for column, terms in enumerate(theory["swings"].values()):
        size, turn = _angles(terms, t, np.zeros((len(t), 0)))
        swings[:, column] = np.sin(turn) @ size
    size, turn = _angles(moon["axis"], t, swings)
    axis = np.cos(turn) @ size
    size, turn = _angles(moon["longitude_terms"], t, swings)
    start, speed = moon["longitude"]
    longitude = start + t * speed + np.sin(turn) @ size
    size, turn = _angles(moon["eccentricity"], t, swings)
    k, h = np.cos(turn) @ size, np.sin(turn) @ size
    size, turn = _angles(moon["inclination"], t, swings)
    q, p = np.cos(turn) @ size, np.sin(turn) @ size
    anomaly = longitude
    # Newton's method for Kepler's equation in longitudes, k = e cos, h = e sin of the pericentre
    for _ in range(8):
        c, s = np.cos(anomaly), np.sin(anomaly)
        anomaly = anomaly + (longitude - anomaly + k * s - h * c) / (1.0 - k * c - h * s)
    c, s = np.cos(anomaly), np.sin(anomaly)
    lag, psi = h * c - k * s, 1.0 / (1.0 + np.sqrt(1.0 - k * k - h * h))
    x, y = axis * (c - k - psi * h * lag), axis * (s - h + psi * k * lag)
    up = 2.0 * np.sqrt(1.0 - q * q - p * p)
    places = [x * (1 - 2 * p * p) + 2 * y * p * q, 2 * x * p * q + y * (1 - 2 * q * q), (q * y - x * p) * up]
    return np.asarray(np.stack(places, axis=1) @ np.array(theory["to_icrs"]).T)


def planet_moons(observer: Observer, planet: Body, only: str = "") -> list[Body]:
    """The moons of Jupiter or Saturn that are not behind it; eclipses and the rings are left out.

    With ``only`` the moon of that name alone, hidden or not.
    """
    ephemeris, found = shipped_ephemeris(), []
    for name, (radius_km, v, sigma) in MOONS[planet.name].items():
        if only and name != only:
            continue

        def where(jd: Floats, name: str = name) -> Floats:
            return ephemeris(planet.name.lower(), jd) + from_planet(planet.name, name, jd)

        vectors, jd = observer.sees(where)
        # at the date when the light left, as the moon's own place is
        from_sun = (observer.place + vectors - ephemeris("sun", jd))[0]
        distance, solar = float(np.linalg.norm(vectors)), float(np.linalg.norm(from_sun))
        ra, dec = radec_deg(vectors[0])
        angle = phase_angle_deg(vectors[0], from_sun)
        body = Body(
            name=name,
            kind=BodyKind.SATELLITE,
            ra_deg=ra,
            dec_deg=dec,
            distance_au=distance,
            magnitude=v + float(5.0 * np.log10(distance * solar)),
            diameter_arcsec=float(2.0 * np.arcsin(radius_km / AU_KM / distance) / ARCSEC),
            phase=lit_share(angle),
            sigma_arcsec=observer.sigma_arcsec(distance, sigma),
        )
        apart = angle_between(body.vector, planet.vector) / ARCSEC
        # hidden only when farther than the planet and within its disc
        if only or distance < planet.distance_au or apart > planet.diameter_arcsec / 2.0:
            found.append(body)
    return found
