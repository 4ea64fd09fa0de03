"""Asteroids and comets in a frame: carried from the table's dates to the frame's, the planets' pull counted."""

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import field
from datetime import datetime
from functools import cache, lru_cache
from pathlib import Path

import numpy as np

from kochab.core.arrays import Bools, Floats, Indices
from kochab.core.attitude import radec_deg, unit
from kochab.core.errors import CatalogueError
from kochab.core.frame import Site
from kochab.core.progress import Task
from kochab.core.values import mutable
from kochab.folders import data_folder
from kochab.sky.catalogue_file import Container, write_container
from kochab.sky.ephemeris import shipped_ephemeris
from kochab.sky.orbits import carried, days_since_perihelion, period_years, two_body
from kochab.sky.planet_moons import MOONS, planet_moons
from kochab.sky.solar_system import (
    RADIUS_KM,
    Body,
    BodyKind,
    Moving,
    Observer,
    covers,
    lit_share,
    major_bodies,
    observer_at,
)

ASTEROID_SIGMA_ARCSEC, ASTEROID_PER_YEAR2 = 1.0, 0.008
"""1 sigma of asteroids while their orbits were fitted, and its growth with the square of years: others pull them, whose
masses are left out. Juno is 4 arcsec off in 2005, 8 in 1990, 153 in 1900, Vesta 5, 3 and 12 (Swiss Ephemeris)."""
NUMBERED, OTHERS = (20.0, 10.0), (100.0, 50.0)
"""1 sigma of comets, arcsec while their orbits were fitted and a year later, when they have a number and when not.

Against the Minor Planet Center's elements of 2022-08-24: of 229 numbered comets 86 % are within it and 94 % within
three times as much, of 138 others 91 and 96 %; the rest broke up, or was seen for some weeks. Neither the age of the
elements nor a perihelion in between shows. Of 18 numbered ones, against elements of 2026-01-03, 16 and 17 are. From
three years on it grows with the square of time, as what the jets do."""

MOST_ARCSEC = 600.0
"""A comet less certain is not told, nor is a fragment of one; of a numbered comet A is what remained."""
FRAGMENT = re.compile(r"^\D.*-A(?=[ (]|$)|-([B-Z]|[A-Z]{2})(?=[ /(]|$)")
LOST = frozenset(
    [
        "255P/Levy",
        "332P/Ikeya-Murakami",
        "P/2009 Y2 (Kowalski)",
        "P/2010 T2 (PANSTARRS)",
        "P/2011 NO1 (Elenin)",
        "P/2019 A8 (PANSTARRS)",
        "C/2019 J2 (Palomar)",
        "C/2019 Y1 (ATLAS)",
        "C/2020 F8 (SWAN)",
        "C/2020 H4 (Leonard)",
        "C/2021 T2 (Fuls)",
    ]
)
"""The Minor Planet Center had them more than 600 arcsec from where the shipped orbits have them: nobody knows."""
ENCOUNTERS = {"99942 Apophis": 2462239.5}
"""2029-04-13, when it passes within the Moon's distance: where it is later, no orbit of before can say."""
SOLVED_JD = 2459914.5
"""2022-12-01, when the shipped orbits were fitted."""
RETURNS_JD = 2447892.5
"""1990: a comet whose elements are older has not been seen on a later return."""

STRAY_DEG_PER_YEAR = 0.5
"""How far a body may stray from a two-body orbit: this times years to the power of 1.5; 99.9 % do less."""
KEPT_NIGHTS = 3
"""The atlas has tonight, the image the night of a frame: by turns, each would be carried again, for 0.2 s."""
MOONS_WITHIN_RAD = math.radians(0.25)
"""Of their planet: Callisto and Iapetus come to 0.18 deg from the Earth."""

CALLED: tuple[Callable[[str], str], ...] = (
    str,
    lambda name: name.partition("/")[2],
    lambda name: name.partition(" ")[2],
    lambda name: name.partition(" (")[0],
    lambda name: name.partition(" (")[2].rstrip(")"),
    lambda name: name.partition(" ")[0] * name[0].isdigit(),
    lambda name: name.partition("/")[0] * name[0].isdigit(),
)
"""By what of its name a body may be called: all, what follows a comet's type or a number, what precedes brackets or
stands in them, its number alone."""


@lru_cache(maxsize=4)
def _rows_called(names: tuple[str, ...]) -> dict[str, int]:
    """The row of every name, case folded; the fuller ways to call a body come first, then the earlier row."""
    found: dict[str, int] = {}
    for called in CALLED:
        for row, name in enumerate(names):
            key = called(name).casefold()
            if not key.isdigit() or name.startswith(f"{key} "):  # 1 is 1 Ceres, not 9P/Tempel 1
                found.setdefault(key, row)
    found.pop("", None)
    return found


USUAL_K1, LEAST_K1 = 10.0, 2.0  # of comets: magnitudes a factor of ten in the distance from the Sun


@mutable(eq=False)
class SmallBodies:
    """Asteroids and comets (N,), each with its state at a date of its own.

    ``state`` (N, 6) heliocentric au and au/day on ICRS axes at ``epoch_jd`` (N,) TDB; ``magnitude`` (N,) is H, or M1 of
    a comet; ``slope`` (N,) is G, or -K1 of a comet, NaN where that is not known. ``solved_jd`` is when the orbits were
    fitted, 0 at those dates. ``recent`` (N, 6) are the bodies' states at ``recent_jd``, carried there once for all, NaN
    where they were not: a comet of 1986 is forty years nearer to a night of today.
    """

    names: Sequence[str]
    state: Floats
    epoch_jd: Floats
    magnitude: Floats
    slope: Floats
    solved_jd: float = 0.0
    recent: Floats | None = None
    recent_jd: float = 0.0
    _carried: dict[int, dict[int, Floats]] = field(default_factory=dict, init=False)

    @property
    def comet(self) -> Bools:
        """Which are comets, (N,)."""
        return np.isnan(self.slope) | (self.slope <= -LEAST_K1)

    @property
    def _once(self) -> Bools:
        """Which come once in a life, (N,): their orbits are fitted to all that was seen since the perihelion."""
        return period_years(self.state) > 150.0

    def sigma_arcsec(self, jd_tdb: float) -> Floats:
        """1 sigma (N,) of places at a date, seen from 1 au or farther."""
        fitted = np.maximum(self.epoch_jd, self.solved_jd)
        # after the fit, or before the elements' date and the perihelion; between them the orbit was observed
        fitted = np.where(self.epoch_jd < RETURNS_JD, self.epoch_jd, fitted)
        seen = self.epoch_jd - np.where(self._once, np.maximum(days_since_perihelion(self.state), 0.0), 0.0)
        years = np.maximum(0.0, np.maximum(jd_tdb - fitted, seen - jd_tdb)) / 365.25
        known = np.array([name[:1].isdigit() for name in self.names], dtype=np.bool_)[:, None]
        first, yearly = np.where(known, NUMBERED, OTHERS).T
        comets = np.hypot(first, yearly * years * np.maximum(1.0, years / 3.0))
        asteroids = np.hypot(
            ASTEROID_SIGMA_ARCSEC, ASTEROID_PER_YEAR2 * ((jd_tdb - (self.solved_jd or self.epoch_jd)) / 365.25) ** 2
        )
        return np.where(self.comet, comets, asteroids)

    def nearest(self, jd_tdb: float) -> tuple[Floats, Floats]:
        """The states (N, 6) that are nearest in time to a date, and when they were so, (N,)."""
        if self.recent is None:
            return self.state, self.epoch_jd
        closer = np.abs(jd_tdb - self.recent_jd) < np.abs(jd_tdb - self.epoch_jd)
        closer &= np.isfinite(self.recent[:, 0])
        return np.where(closer[:, None], self.recent, self.state), np.where(closer, self.recent_jd, self.epoch_jd)

    def on_night(self, rows: Indices, jd_tdb: float) -> Task[tuple[Floats, float]]:
        """States (M, 6) of ``rows`` at a date within half a day of ``jd_tdb``, and that date; a few nights are kept."""
        night = round(jd_tdb)
        if (known := self._carried.get(night)) is None:  # other threads replace the nights: this one keeps its own
            others = list(self._carried.items())[1 - KEPT_NIGHTS :]
            self._carried = {**dict(others), night: (known := {})}
        new = np.array([row for row in rows.tolist() if row not in known], dtype=np.intp)
        begun, since_jd = self.nearest(float(night))
        for some in (new[self.comet[new]], new[~self.comet[new]]):  # a comet at its perihelion takes small steps
            states = yield from carried(begun[some], since_jd[some], float(night), shipped_ephemeris())
            known.update(zip(some.tolist(), states, strict=True))
        return np.array([known[row] for row in rows.tolist()]).reshape(-1, 6), float(night)

    def near(self, observer: Observer, centre: Floats, radius_rad: float, faintest: float) -> Task[list[Body]]:
        """The bodies as :func:`bodies_near` has them: only those that may be in the field are carried.

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
        ephemeris, jd = shipped_ephemeris(), float(observer.jd_tdb[0])
        sun = ephemeris("sun", observer.jd_tdb)
        # all bodies first, cheaply, by two-body orbits; only those that may be in the field are integrated
        begun, since_jd = self.nearest(jd)
        heliocentric = two_body(begun, jd - since_jd)[:, :3]
        vectors = heliocentric + sun - observer.place
        years = np.abs(jd - since_jd) / 365.25
        stray = np.radians(0.2 + STRAY_DEG_PER_YEAR * years**1.5) * np.maximum(
            1.0, 1.5 / np.linalg.norm(vectors, axis=1)
        )
        reach = np.cos(np.minimum(np.pi, radius_rad + stray))
        bright = magnitudes(self, vectors, heliocentric)[0] < faintest + 0.5 + np.minimum(stray, 2.0)
        rows = np.flatnonzero((unit(vectors) @ centre >= reach) & bright & (self.sigma_arcsec(jd) <= MOST_ARCSEC))
        known = [_known(self.names[row], bool(self.comet[row]), jd) for row in rows.tolist()]
        rows = rows[np.array(known, dtype=np.bool_)]
        if not len(rows):
            return []
        seen = yield from _seen(self, rows, observer)
        return [
            body
            for body in seen
            if body.vector @ centre >= np.cos(min(np.pi, radius_rad)) and body.magnitude <= faintest
        ]

    def body(self, row: int, observer: Observer) -> Task[Body | None]:
        """One of them, wherever it is; None when nobody knows it after an encounter."""
        if _past_encounter(self.names[row], float(observer.jd_tdb[0])):
            return None
        (body,) = yield from _seen(self, np.array([row], dtype=np.intp), observer)
        return body

    def warning(self, time_utc: datetime, site: Site | None) -> str:
        """Nothing: each body's sigma tells how old its elements are."""
        return ""

    def write(self, path: Path) -> None:
        """Write them as :func:`read_small_bodies` takes them."""
        text = np.frombuffer("\n".join(self.names).encode("utf-8"), np.uint8)
        numbers = {"state": self.state.ravel(), "epoch_jd": self.epoch_jd}
        magnitudes = {"magnitude": self.magnitude.astype("<f4"), "slope": self.slope.astype("<f4")}
        recent = {} if self.recent is None else {"recent": self.recent[self.comet].ravel()}
        facts = {"kind": "small bodies", "recent_jd": self.recent_jd}
        write_container(path, facts, {**numbers, **magnitudes, **recent, "names": text})


def _known(name: str, comet: bool, jd_tdb: float) -> bool:
    """Whether somebody knows where a body is at a date."""
    if comet:
        return name not in LOST and not FRAGMENT.search(name)
    return not _past_encounter(name, jd_tdb)


def _past_encounter(name: str, jd_tdb: float) -> bool:
    """Whether a body has come so close to the Earth that its elements no longer hold."""
    return jd_tdb >= ENCOUNTERS.get(name, np.inf)


def read_small_bodies(path: Path) -> SmallBodies:
    """Read a table; CatalogueError when it is missing or damaged."""
    file = Container(path)
    try:
        names = bytes(file.column("names")).decode("utf-8").split("\n")
        state = file.column("state").reshape(len(names), 6)
        epoch, magnitude, slope = (file.column(key).astype(np.float64) for key in ("epoch_jd", "magnitude", "slope"))
        if {len(epoch), len(magnitude), len(slope)} != {len(names)}:
            raise ValueError
        table = SmallBodies(names, state, epoch, magnitude, slope, SOLVED_JD)
        if "recent" in file:
            table.recent, table.recent_jd = np.full_like(state, np.nan), float(file.facts["recent_jd"])
            table.recent[table.comet] = file.column("recent").reshape(-1, 6)
    except (ValueError, KeyError):
        raise CatalogueError("The table of asteroids and comets {path} is damaged.", path=path) from None
    return table


@cache
def shipped_small_bodies() -> SmallBodies:
    """The asteroids and comets that come with Kochab."""
    return read_small_bodies(data_folder("catalogs") / "small_bodies.kcat")


def bodies_near(
    time_utc: datetime,
    site: Site | None,
    centre: Floats,
    radius_rad: float,
    faintest: float,
    more: Sequence[Moving] = (),
    exposure_s: float = 0.0,
) -> Task[list[Body]]:
    """All bodies of the Solar System near a direction, brightest first.

    The Sun, the Moon, the planets and satellites count whatever their magnitude. None at a date that the ephemeris does
    not cover.

    Parameters
    ----------
    time_utc : datetime
        When.
    site : Site or None
        Where the observer stands; None: the Earth's centre.
    centre : Floats
        ICRS unit vector (3,).
    radius_rad : float
        How near, radians.
    faintest : float
        Faintest magnitude of asteroids, comets and planets' moons.
    more : Sequence[Moving]
        Tables of bodies that come before the shipped one's.
    exposure_s : float
        How long: satellites leave trails.
    """
    if not covers(time_utc):
        return []
    observer = observer_at(time_utc, site, exposure_s)
    everything = major_bodies(observer)
    moons_reach = float(np.cos(min(np.pi, radius_rad + MOONS_WITHIN_RAD)))
    for planet in [body for body in everything if body.name in MOONS and body.vector @ centre >= moons_reach]:
        everything += [moon for moon in planet_moons(observer, planet) if moon.magnitude <= faintest]
    found = [
        body
        for body in everything
        if body.vector @ centre >= np.cos(min(np.pi, radius_rad + np.radians(body.sigma_arcsec / 3600.0)))
    ]
    for table in (*more, shipped_small_bodies()):
        known = {body.name for body in found}
        others = yield from table.near(observer, centre, radius_rad, faintest)
        found += [body for body in others if body.name not in known]
    return sorted(found, key=lambda body: np.nan_to_num(body.magnitude, nan=np.inf))


def body_called(text: str, time_utc: datetime, site: Site | None, more: Sequence[Moving] = ()) -> Task[Body | None]:
    """A body of the Solar System by its name, wherever it is; None when there is none of that name.

    ``"Vesta"`` is 4 Vesta, ``"Halley"`` 1P/Halley, ``"C/2023 A3"`` the comet with its finder, ``"ISS"`` ISS (ZARYA).

    Parameters
    ----------
    text : str
        The name, in any case.
    time_utc : datetime
        When.
    site : Site or None
        Where the observer stands; None: the Earth's centre.
    more : Sequence[Moving]
        Tables of bodies that come before the shipped ones.
    """
    if not covers(time_utc):
        return None
    observer, wanted = observer_at(time_utc, site), text.casefold().strip()
    if wanted in RADIUS_KM:
        return major_bodies(observer, wanted)[0]
    for planet, moons in MOONS.items():
        if moon := next((name for name in moons if name.casefold() == wanted), None):
            return planet_moons(observer, major_bodies(observer, planet.casefold())[0], moon)[0]
    for table in (*more, shipped_small_bodies()):
        row = _rows_called(tuple(table.names)).get(wanted)
        if row is not None and (body := (yield from table.body(row, observer))) is not None:
            return body
    return None


def _seen(table: SmallBodies, rows: Indices, observer: Observer) -> Task[list[Body]]:
    """The bodies of ``rows``, carried to the observer's night."""
    ephemeris = shipped_ephemeris()
    states, night = yield from table.on_night(rows, float(observer.jd_tdb[0]))
    vectors, light_jd = observer.sees(lambda at: two_body(states, at - night)[:, :3] + ephemeris("sun", at))
    from_sun = observer.place + vectors - ephemeris("sun", light_jd)
    names = [table.names[row] for row in rows.tolist()]
    some = SmallBodies(names, states, table.epoch_jd[rows], table.magnitude[rows], table.slope[rows], table.solved_jd)
    magnitude, angle = magnitudes(some, vectors, from_sun)
    sigma = some.sigma_arcsec(float(observer.jd_tdb[0]))
    return [_body(some, k, vectors[k], magnitude[k], angle[k], sigma[k], observer) for k in range(len(names))]


def _body(
    table: SmallBodies, k: int, vector: Floats, magnitude: float, angle: float, own: float, observer: Observer
) -> Body:
    ra, dec = radec_deg(vector)
    distance = float(np.linalg.norm(vector))
    sigma = observer.sigma_arcsec(distance, float(own) / min(1.0, distance))
    kind = BodyKind.COMET if table.comet[k] else BodyKind.ASTEROID
    return Body(table.names[k], kind, ra, dec, distance, float(magnitude), 0.0, lit_share(float(angle)), sigma)


def magnitudes(table: SmallBodies, from_observer: Floats, from_sun: Floats) -> tuple[Floats, Floats]:
    """V (N,) and phase angles (N,) in degrees: the IAU's H, G system; M1 + 5 log D + K1 log r of a comet.

    Bowell et al. 1989, *Asteroids II*, 524.
    """
    distance, solar = np.linalg.norm(from_observer, axis=1), np.linalg.norm(from_sun, axis=1)
    angle = np.arccos(np.clip(np.einsum("na,na->n", unit(from_observer), unit(from_sun)), -1.0, 1.0))
    # the tangent grows without bound at 180 deg
    bend = np.tan(np.minimum(angle, np.radians(170.0)) / 2.0)
    slope = np.where(table.comet, 0.15, table.slope)
    dimmed = (1.0 - slope) * np.exp(-3.33 * bend**0.63) + slope * np.exp(-1.87 * bend**1.22)
    asteroid = 5.0 * np.log10(solar) - 2.5 * np.log10(dimmed)
    brightens = np.where(np.isnan(table.slope), USUAL_K1, -table.slope)
    beyond = np.where(table.comet, brightens * np.log10(solar), asteroid)
    return table.magnitude + 5.0 * np.log10(distance) + beyond, np.degrees(angle)
