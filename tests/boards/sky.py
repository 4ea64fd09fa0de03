"""Time, hour angle, horizon and Sun of the simulated nights, from ERFA alone."""

from datetime import UTC, datetime, timedelta
from functools import lru_cache
from math import acos, asin, atan2, cos, degrees, radians, sin

import erfa
import numpy as np

TURN_DEG_S = 360.98564736629 / 86400.0  # of the Earth against the equinox, a second of UT1
SIDEREAL_DEG_S = 360.0 / 86164.0905
START = datetime(2026, 1, 15, 22, 0, tzinfo=UTC)  # in the north the Sun is far below the horizon
LATITUDE_DEG, LONGITUDE_DEG = 50.0, 8.0  # of the true site; longitude east


class Night:
    """A clock that begins at ``start`` and runs ``speed`` times as fast as the computer's."""

    def __init__(self, start=START, speed=1.0):
        self.start, self.speed = start, speed
        self._begun = datetime.now(UTC)

    def __call__(self):
        return self.start + self.speed * (datetime.now(UTC) - self._begun)

    def unix(self):
        """Seconds since 1970."""
        return self().timestamp()


class Frozen:
    """A clock that goes on only when it is told to: an hour of mount in a millisecond of test."""

    def __init__(self, start=START):
        self.at = start

    def __call__(self):
        return self.at

    def unix(self):
        """Seconds since 1970."""
        return self.at.timestamp()

    def pass_by(self, seconds):
        """Let time pass."""
        self.at += timedelta(seconds=seconds)


@lru_cache(maxsize=4096)
def _greenwich_deg(minute):
    day = 2440587.5 + minute / 1440.0  # UT1 is taken as UTC: they differ by less than a second
    return degrees(erfa.gst06a(2400000.5, day - 2400000.5, 2400000.5, day - 2400000.5 + 69.184 / 86400.0))


def sidereal_deg(unix, longitude_deg):
    """Apparent sidereal time at a longitude, degrees."""
    minute, seconds = divmod(unix, 60.0)
    return (_greenwich_deg(int(minute)) + TURN_DEG_S * seconds + longitude_deg) % 360.0


@lru_cache(maxsize=4096)
def _sun_deg(quarter):
    """RA and Dec of date of the Sun, degrees, at a quarter of an hour since 1970."""
    tt = 40587.0 + quarter / 96.0 + 69.184 / 86400.0
    earth, _ = erfa.epv00(2400000.5, tt)
    sun = erfa.pnm06a(2400000.5, tt) @ -np.asarray(earth["p"])
    ra, dec = erfa.c2s(sun)
    return degrees(ra) % 360.0, degrees(dec)


def sun_deg(unix):
    """RA and Dec of date of the Sun, degrees."""
    return _sun_deg(int(unix // 900.0))


def altaz_deg(hour_angle_deg, dec_deg, latitude_deg):
    """Altitude and azimuth, north over east, degrees."""
    ha, dec, lat = radians(hour_angle_deg), radians(dec_deg), radians(latitude_deg)
    up = sin(dec) * sin(lat) + cos(dec) * cos(lat) * cos(ha)
    north = sin(dec) * cos(lat) - cos(dec) * sin(lat) * cos(ha)
    return degrees(asin(max(-1.0, min(1.0, up)))), degrees(atan2(-cos(dec) * sin(ha), north)) % 360.0


def apart_deg(one, other):
    """Between two places on a sphere, each longitude and latitude, degrees."""
    (a, b), (c, d) = (map(radians, place) for place in (one, other))
    half = sin((b - d) / 2) ** 2 + cos(b) * cos(d) * sin((a - c) / 2) ** 2
    return degrees(acos(max(-1.0, min(1.0, 1.0 - 2.0 * half))))


def half_turn(angle_deg):
    """The same angle in [-180, 180)."""
    return (angle_deg + 180.0) % 360.0 - 180.0
