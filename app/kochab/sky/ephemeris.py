"""Where the Sun, the Moon and the planets are: Chebyshev series of an excerpt of JPL's DE421, 1899 to 2052."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np

from kochab.core.arrays import Array, Floats
from kochab.core.errors import CatalogueError
from kochab.core.values import frozen
from kochab.folders import data_folder
from kochab.sky.catalogue_file import Container

EARTH_MOON_RATIO = 81.3005690699153
"""Mass of the Earth over that of the Moon, DE421."""

GM = {  # au^3/day^2: the Sun, and the planets with their moons
    "sun": 2.959122082855911e-04,
    "mercury": 4.912547451450812e-11,
    "venus": 7.243452486162703e-10,
    "earth_moon": 8.997011346712499e-10,
    "mars": 9.549535105779258e-11,
    "jupiter": 2.825345909524226e-07,
    "saturn": 8.459715185680659e-08,
    "uranus": 1.292024916781969e-08,
    "neptune": 1.524358900784276e-08,
}


@frozen(eq=False)
class Series:
    """Chebyshev series, one per interval of ``days`` from ``start_jd``: ``coefficients`` (N, 3, K) of ``unit`` au."""

    start_jd: float
    days: float
    coefficients: Array
    unit: float = 1.0

    def at(self, jd_tdb: Floats) -> Floats:
        """Positions (M, 3), au on ICRS axes, at Julian dates (M,) within the series."""
        along = (jd_tdb - self.start_jd) / self.days
        interval = np.clip(along.astype(np.int64), 0, len(self.coefficients) - 1)
        degrees = np.arange(self.coefficients.shape[2])
        # T_k(x) = cos(k arccos x)
        values = np.cos(degrees * np.arccos(np.clip(2.0 * (along - interval) - 1.0, -1.0, 1.0))[:, None])
        return np.asarray(np.einsum("mk,mak->ma", values, self.coefficients[interval]) * self.unit)


class Ephemeris:
    """Barycentric places of the bodies of ``series``, which has the Moon's from the Earth's centre."""

    def __init__(self, series: Mapping[str, Series]) -> None:
        self.series = series
        sun = series["sun"]
        self.first_jd = sun.start_jd
        self.last_jd = sun.start_jd + sun.days * len(sun.coefficients)

    def __call__(self, body: str, jd_tdb: Floats) -> Floats:
        """Place (M, 3) of a body at Julian dates (M,) TDB: au from the Solar System's barycentre, ICRS axes.

        A planet with moons is their centre of mass, up to 0.1 arcsec from its disc; ``earth`` is without the Moon.
        """
        if body in ("earth", "moon"):
            # the Moon is at barycentre + (1 - share) of the Earth-Moon vector, the Earth at - share of it
            share = 1.0 / (1.0 + EARTH_MOON_RATIO) - (body == "moon")
            return self.series["earth_moon"].at(jd_tdb) - share * self.series["moon"].at(jd_tdb)
        return self.series[body].at(jd_tdb)


def read_ephemeris(path: Path) -> Ephemeris:
    """Open an excerpt; CatalogueError when it is missing or damaged."""
    file = Container(path)
    try:
        series = {
            body: Series(file.facts["start_jd"], days, file.column(body).reshape(-1, 3, terms), unit)
            for body, (days, terms, unit) in file.facts["series"].items()
        }
        return Ephemeris(series)
    except (KeyError, TypeError, ValueError):
        raise CatalogueError("The ephemeris {path} is damaged.", path=path) from None


@cache
def shipped_ephemeris() -> Ephemeris:
    """The excerpt that comes with Kochab."""
    return read_ephemeris(data_folder("catalogs") / "ephemeris.kcat")
