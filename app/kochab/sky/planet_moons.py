"""The four large moons of Jupiter, and the eight of Saturn that telescopes show.

Jupiter's by the theory L1.2 of Lainey, Duriez and Vienne (2006, A&A 456, 783), shortened; Saturn's by Dourneau (1993,
A&A 267, 292) and by Harper and Taylor, as in Meeus, *Astronomical Algorithms* (1998), chapter 46.
"""

import json
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from kochab.core import data_folder
from kochab.core.arrays import Floats
from kochab.core.attitude import angle_between, radec_deg
from kochab.sky.ephemeris import shipped_ephemeris
from kochab.sky.solar_system import ARCSEC, AU_KM, Body, BodyKind, Observer, lit_share, phase_angle_deg

JD_1950 = 2433282.5
MOONS = {  # radius in km; V at 1 au from Sun and observer, full (Astronomical Almanac); sigma of the place, arcsec
    "Jupiter": {
        "Io": (1821.6, -1.68, 0.2),
        "Europa": (1560.8, -1.41, 0.2),
        "Ganymede": (2631.2, -2.09, 0.2),
        "Callisto": (2410.3, -1.05, 0.5),
    },
    "Saturn": {
        "Mimas": (198.2, 3.3, 0.1),
        "Enceladus": (252.1, 2.1, 0.1),
        "Tethys": (531.1, 0.6, 0.1),
        "Dione": (561.4, 0.8, 0.1),
        "Rhea": (763.5, 0.1, 0.1),
        "Titan": (2574.7, -1.28, 0.3),
        "Hyperion": (135.0, 4.63, 1.3),
        "Iapetus": (734.3, 1.5, 0.7),
    },
}
"""The sigmas are against other theories; Iapetus is 0.9 mag brighter or fainter by the side that it turns to us."""


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


SATURN_KM, JD_B1950 = 60330.0, 2433282.423
"""What the distances of Saturn's moons are counted in, and the date of their ecliptic."""
EQUATOR_NODE, EQUATOR_TILT = 168.8112, 28.0817
"""Of Saturn's equator on that ecliptic, degrees."""
INNER = {
    # Degrees from JD 2411093: longitude and its motion a day; pericentre and its motion a year; eccentricity; Saturn's
    # radii; node and its motion a year; tilt.
    "Mimas": (127.64, 381.994497, 106.1, 365.549, 0.01905, 3.0699, 54.5, -365.072, 1.563),
    "Enceladus": (200.317, 262.7319002, 309.107, 123.44121, 0.00485, 3.94127, 348.0, -151.95, 0.0262),
    "Tethys": (285.306, 190.69791226, 0.0, 0.0, 0.0, 4.880998, 111.33, -72.2441, 1.0976),
    "Dione": (254.712, 131.53493193, 174.8, 30.82, 0.002157, 6.24874, 232.0, -30.27, 0.0139),
}
SWINGS = {"Mimas": (-43.57, -0.72, -0.02144), "Tethys": (2.063, 0.03409, 0.001015)}
SWINGS |= {"Enceladus": (0.25667, 0.20883, 0.0), "Dione": (-0.0215, -0.01733, 0.0)}
"""Of the longitudes in their resonances, degrees."""
Angle = Floats | float
Orbit = tuple[Floats, Angle, Angle, Angle, Angle, Angle]
"""Mean longitude, pericentre, eccentricity, semi-major axis, node, tilt: degrees, and radii of Saturn."""


def _sin(degrees: Angle) -> Floats:
    return np.asarray(np.sin(np.radians(degrees)))


def _cos(degrees: Angle) -> Floats:
    return np.asarray(np.cos(np.radians(degrees)))


def _inner(name: str, jd: Floats) -> Orbit:
    """Mimas to Dione, about Saturn's equator."""
    longitude, motion, apse, apse_motion, e, axis, node, node_motion, tilt = INNER[name]
    days = jd - 2411093.0
    years = days / 365.25
    turn = 5.095 * (22.85866 + years)
    turns = (turn, 3.0 * turn, 5.0 * turn)
    if name in ("Enceladus", "Dione"):
        turns = (74.4 + 32.39 * years, 134.3 + 92.62 * years, 0.0 * years)
    swing = np.sum([size * _sin(turn) for size, turn in zip(SWINGS[name], turns, strict=True)], axis=0)
    return longitude + motion * days + swing, apse + apse_motion * years, e, axis, node + node_motion * years, tilt


def _rhea(jd: Floats) -> Orbit:
    days = jd - 2411093.0
    years, later = days / 365.25, (jd - 2411368.0) / 365.25
    own, titan, node = 342.7 + 10.057 * years, 276.59 + 0.5118 * later, 345.0 - 10.057 * years
    k = 0.000265 * _cos(own) + 0.001 * _cos(titan)
    h = 0.000265 * _sin(own) + 0.001 * _sin(titan)
    slow = 42.0 - 0.5118 * later
    return (
        359.244 + 79.6900472 * days + 0.086754 * _sin(node),
        np.degrees(np.arctan2(h, k)),
        np.hypot(h, k),
        8.725924,
        168.8034 + 0.736936 * _sin(node) + 0.041 * _sin(slow),
        28.0362 + 0.346898 * _cos(node) + 0.0193 * _cos(slow),
    )


def _titan(jd: Floats) -> Orbit:
    days, centuries = jd - 2411368.0, (jd - 2415020.0) / 36525.0
    slow, apse = 42.0 - 0.5118 * days / 365.25, 276.59 + 0.5118 * days / 365.25
    saturn, anomaly = 267.2635 + 1222.1136 * centuries, 175.4762 + 1221.5515 * centuries
    tilt_s, node_s = 2.4891 + 0.002435 * centuries, 113.35 - 0.2597 * centuries  # of Saturn's orbit
    e_s = 0.05589 - 0.000346 * centuries
    tilt, node = 27.45141 + 0.295999 * _cos(slow), 168.66925 + 0.628808 * _sin(slow)
    apart = node - node_s
    a = _sin(tilt_s) * _sin(apart)
    b = _cos(tilt_s) * _sin(tilt) - _sin(tilt_s) * _cos(tilt) * _cos(apart)
    psi, gamma = np.degrees(np.arctan2(a, b)), np.hypot(a, b)
    fixed = 102.8623
    g = apse - node - psi
    own = apse
    for _ in range(3):
        own = apse + 0.37515 * (_sin(2.0 * g) - _sin(2.0 * fixed))
        g = own - node - psi
    e = 0.029092 + 0.00019048 * (_cos(2.0 * g) - _cos(2.0 * fixed))
    q = 2.0 * (saturn - own)
    theta = node_s + np.degrees(
        np.arctan2(_sin(tilt) * _sin(apart), _cos(tilt_s) * _sin(tilt) * _cos(apart) - _sin(tilt_s) * _cos(tilt))
    )
    u = 2.0 * (saturn - theta) + psi
    h = 0.9375 * e**2 * _sin(q) + 0.1875 * gamma**2 * _sin(2.0 * (saturn - theta))
    year = e_s * _sin(anomaly) + 0.75 * e_s**2 * _sin(2.0 * anomaly)
    return (
        261.1582 + 22.57697855 * days + 0.074025 * _sin(slow) - 0.254744 * (year + h),
        own + 0.159215 * _sin(q),
        e * (1.0 + 0.002778797 * _cos(q)),
        20.216193,
        node + 0.031843 * gamma * _sin(u) / _sin(tilt),
        tilt + 0.031843 * gamma * _cos(u),
    )


def _hyperion(jd: Floats) -> Orbit:
    days = jd - 2415020.0
    years, centuries = days / 365.25, days / 36525.0
    eta, zeta = 92.39 + 0.5621071 * days, 148.19 - 19.18 * years
    theta = 184.8 - 35.41 * (jd - 2442000.5) / 365.25
    slow, chi = 42.0 - 0.5118 * (jd - 2411368.0) / 365.25, 94.9 - 2.292 * years
    twice = 8.0 + 24.44 * years
    apse = 69.898 - 18.67088 * years
    phi = 2.0 * (apse - 267.2635 - 1222.1136 * centuries)
    e = 0.103458 - 0.004099 * _cos(eta) - 0.000167 * _cos(zeta + eta) + 0.000235 * _cos(zeta - eta)
    e += 0.02303 * _cos(zeta) - 0.00212 * _cos(2.0 * zeta) + 0.000151 * _cos(3.0 * zeta) + 0.00013 * _cos(phi)
    apse += 0.15648 * _sin(chi) - 0.4457 * _sin(eta) - 0.2657 * _sin(zeta + eta) - 0.3573 * _sin(zeta - eta)
    apse += 1.668 * _sin(2.0 * zeta) - 12.872 * _sin(zeta) - 0.2419 * _sin(3.0 * zeta) - 0.07 * _sin(phi)
    longitude = 177.047 + 16.91993829 * days + 0.15648 * _sin(chi) + 9.142 * _sin(eta) + 0.007 * _sin(2.0 * eta)
    longitude += 0.2275 * _sin(zeta + eta) + 0.2112 * _sin(zeta - eta) - 0.014 * _sin(3.0 * eta) - 0.26 * _sin(zeta)
    longitude += 0.017 * _sin(twice) - 0.0098 * _sin(2.0 * zeta) - 0.013 * _sin(172.0 + twice / 2.0)
    longitude -= 0.0303 * _sin(phi)
    node = 168.6812 + 1.40136 * _cos(chi) + 0.68599 * _sin(slow) - 0.0392 * _sin(twice + 5.0)
    tilt = 27.3347 + 0.6434886 * _cos(chi) + 0.315 * _cos(slow) - 0.018 * _cos(twice + 5.0)
    return (
        longitude,
        apse,
        e,
        24.50601 - 0.08686 * _cos(eta) - 0.00166 * _cos(zeta + eta) + 0.00175 * _cos(zeta - eta),
        node + 0.0366 * _sin(theta - 7.5),
        tilt + 0.018 * _cos(theta),
    )


def _iapetus(jd: Floats) -> Orbit:
    days = jd - 2409786.0
    t, centuries = days / 36525.0, (jd - 2415020.0) / 36525.0
    apse, mean = 352.91 + 11.71 * t, 76.3852 + 4.53795125 * days
    tilt = 18.4602 - 0.9518 * t - 0.072 * t**2 + 0.0054 * t**3
    node = 143.198 - 3.919 * t + 0.116 * t**2 + 0.008 * t**3
    e = 0.028298 + 0.001156 * t
    psi, phi = 4.367 - 0.195 * centuries, 60.47 + 1.521 * centuries
    later = jd - 2411368.0
    titan, titan_apse = 261.1582 + 22.57697855 * later, 276.59 + 0.5118 * later / 365.25
    sun_apse = 91.796 + 0.562 * centuries
    own, g, g1 = mean - apse, apse - node - psi, apse - node - phi
    sun = 267.2635 + 1222.1136 * centuries - sun_apse
    g_sun = sun_apse - 146.819 + 3.198 * centuries
    l_titan, g_titan = titan - titan_apse, titan_apse - 205.055 + 2.091 * centuries
    u1, u2 = 2.0 * (own + g - sun - g_sun), own + g1 - l_titan - g_titan
    u3, u4, u5 = own + 2.0 * (g - sun - g_sun), l_titan + g_titan - g1, 2.0 * (sun + g_sun)
    more = own + g1 + l_titan + g_titan + phi
    swing = 0.08077 * _sin(g1 - g_titan) + 0.02139 * _sin(u5 - 2.0 * g) - 0.00676 * _sin(u3)
    swing += 0.0138 * _sin(own) + 0.01632 * _sin(own + u2) + 0.03547 * _sin(u4)
    longitude = mean - 0.04299 * _sin(u2) - 0.00789 * _sin(u1) - 0.06312 * _sin(sun) - 0.00295 * _sin(2.0 * sun)
    turn = 0.04204 * _sin(u5 + psi) + 0.00235 * _sin(more) + 0.00358 * _sin(u2 + phi)
    return (
        longitude - 0.02231 * _sin(u5) + 0.0065 * _sin(u5 + psi),
        apse + swing / e,
        e
        - 0.0014097 * _cos(g1 - g_titan)
        + 0.0003733 * _cos(u5 - 2.0 * g)
        + 0.000118 * _cos(u3)
        + 0.0002408 * _cos(own)
        + 0.0002849 * _cos(own + u2)
        + 0.000619 * _cos(u4),
        58.935028 + 0.004638 * _cos(u1) + 0.058222 * _cos(u2),
        node + turn / _sin(tilt),
        tilt + 0.04204 * _cos(u5 + psi) + 0.00235 * _cos(more) + 0.0036 * _cos(u2 + phi),
    )


OUTER: dict[str, Callable[[Floats], Orbit]] = {
    "Rhea": _rhea,
    "Titan": _titan,
    "Hyperion": _hyperion,
    "Iapetus": _iapetus,
}


def from_saturn(name: str, jd_tdb: Floats) -> Floats:
    """Vectors (N, 3) au, ICRS axes, from Saturn's centre to a moon at Julian dates (N,) TDB."""
    import erfa

    orbit = OUTER[name](jd_tdb) if name in OUTER else _inner(name, jd_tdb)
    longitude, apse, e, axis, node, tilt = (np.broadcast_to(value, jd_tdb.shape) for value in orbit)
    mean = np.radians(longitude - apse)
    anomaly = mean
    for _ in range(8):
        anomaly = mean + e * np.sin(anomaly)
    x, y = axis * (np.cos(anomaly) - e), axis * np.sqrt(1.0 - e * e) * np.sin(anomaly)
    along, across = x * _cos(apse - node) - y * _sin(apse - node), x * _sin(apse - node) + y * _cos(apse - node)
    planes: list[tuple[Angle, Angle]] = [(node, tilt)]
    if name in INNER:
        planes = [(node - EQUATOR_NODE, tilt), (EQUATOR_NODE, EQUATOR_TILT)]
    place = (along, across, np.zeros_like(along))
    for turn, slope in planes:
        a, b, c = place
        b, c = b * _cos(slope) - c * _sin(slope), b * _sin(slope) + c * _cos(slope)
        place = a * _cos(turn) - b * _sin(turn), a * _sin(turn) + b * _cos(turn), c
    return np.asarray(np.stack(place, axis=1) @ erfa.ecm06(JD_B1950, 0.0)) * (SATURN_KM / AU_KM)


def planet_moons(observer: Observer, planet: Body) -> list[Body]:
    """The moons of Jupiter or Saturn that are not behind it; eclipses and the rings are left out."""
    ephemeris, found = shipped_ephemeris(), []
    offset = from_jupiter if planet.name == "Jupiter" else from_saturn
    for name, (radius_km, v, sigma) in MOONS[planet.name].items():

        def where(jd: Floats, name: str = name) -> Floats:
            return ephemeris(planet.name.lower(), jd) + offset(name, jd)

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
            magnitude=v + float(5.0 * np.log10(distance * solar)),
            diameter_arcsec=float(2.0 * np.arcsin(radius_km / AU_KM / distance) * ARCSEC),
            phase=lit_share(angle),
            sigma_arcsec=observer.sigma_arcsec(distance, sigma),
        )
        apart = angle_between(body.vector, planet.vector) * ARCSEC
        if distance < planet.distance_au or apart > planet.diameter_arcsec / 2.0:
            found.append(body)
    return found
