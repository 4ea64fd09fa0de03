"""The four large moons of Jupiter: the theory L1.2 of Lainey, Duriez and Vienne (2006, A&A 456, 783), shortened."""

import json
from functools import cache
from typing import Any

import numpy as np

from kochab.core import data_folder
from kochab.core.arrays import Floats
from kochab.core.attitude import angle_between, radec_deg
from kochab.sky.ephemeris import shipped_ephemeris
from kochab.sky.solar_system import ARCSEC, AU_KM, Body, BodyKind, Observer, lit_share, phase_angle_deg

JD_1950 = 2433282.5
RADIUS_KM = {"Io": 1821.6, "Europa": 1560.8, "Ganymede": 2631.2, "Callisto": 2410.3}
V_AT_1_AU = {"Io": -1.68, "Europa": -1.41, "Ganymede": -2.09, "Callisto": -1.05}
"""At 1 au from Sun and observer, full (Astronomical Almanac)."""

SIGMA_ARCSEC = 0.5
"""Of Callisto, against another theory; the others are within half of it."""


@cache
def _theory() -> dict[str, Any]:
    return dict(json.loads((data_folder("resources") / "jupiter_moons.json").read_text(encoding="utf-8")))


def from_jupiter(name: str, jd_tdb: Floats) -> Floats:
    """Vectors (N, 3) au, ICRS axes, from Jupiter's centre to a moon at Julian dates (N,) TDB."""
    theory = _theory()
    moon, t = theory["moons"][name], jd_tdb - JD_1950

    def angles(key: str) -> tuple[Floats, Floats]:
        size, phase, speed = np.array(moon[key]).T
        return size, phase + np.multiply.outer(t, speed)

    size, turn = angles("axis")
    axis = np.cos(turn) @ size
    size, turn = angles("longitude_terms")
    start, speed = moon["longitude"]
    longitude = start + t * speed + np.sin(turn) @ size
    size, turn = angles("eccentricity")
    k, h = np.cos(turn) @ size, np.sin(turn) @ size
    size, turn = angles("inclination")
    q, p = np.cos(turn) @ size, np.sin(turn) @ size
    anomaly = longitude
    for _ in range(6):
        c, s = np.cos(anomaly), np.sin(anomaly)
        anomaly = anomaly + (longitude - anomaly + k * s - h * c) / (1.0 - k * c - h * s)
    c, s = np.cos(anomaly), np.sin(anomaly)
    lag, psi = h * c - k * s, 1.0 / (1.0 + np.sqrt(1.0 - k * k - h * h))
    x, y = axis * (c - k - psi * h * lag), axis * (s - h + psi * k * lag)
    up = 2.0 * np.sqrt(1.0 - q * q - p * p)
    places = [x * (1 - 2 * p * p) + 2 * y * p * q, 2 * x * p * q + y * (1 - 2 * q * q), (q * y - x * p) * up]
    return np.asarray(np.stack(places, axis=1) @ np.array(theory["to_icrs"]).T)


def planet_moons(observer: Observer, jupiter: Body) -> list[Body]:
    """The moons that are not behind ``jupiter``; eclipses are left out."""
    ephemeris, found = shipped_ephemeris(), []
    for name, radius_km in RADIUS_KM.items():

        def where(jd: Floats, name: str = name) -> Floats:
            return ephemeris("jupiter", jd) + from_jupiter(name, jd)

        vectors, jd = observer.sees(where)
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
            magnitude=V_AT_1_AU[name] + float(5.0 * np.log10(distance * solar)),
            diameter_arcsec=float(2.0 * np.arcsin(radius_km / AU_KM / distance) * ARCSEC),
            phase=lit_share(angle),
            sigma_arcsec=observer.sigma_arcsec(distance, SIGMA_ARCSEC),
        )
        apart = angle_between(body.vector, jupiter.vector) * ARCSEC
        if distance < jupiter.distance_au or apart > jupiter.diameter_arcsec / 2.0:
            found.append(body)
    return found
