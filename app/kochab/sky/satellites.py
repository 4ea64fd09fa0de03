"""Satellites of the two-line elements that people bring: where they pass a frame while it is exposed."""

import csv
from collections.abc import Iterator, Sequence
from datetime import datetime
from typing import Any

import numpy as np

from kochab.core.arrays import Bools, Floats
from kochab.core.attitude import radec_deg, unit
from kochab.core.errors import CatalogueError
from kochab.core.frame import Site
from kochab.core.progress import Progress, Task
from kochab.core.values import frozen
from kochab.parsing.text_input import parse_json
from kochab.sky.apparent import JD_UNIX, of_date_matrix, without_aberration
from kochab.sky.ephemeris import shipped_ephemeris
from kochab.sky.solar_system import AU_KM, Body, BodyKind, Observer
from kochab.text.translation import tr, tr_n

STEP_S, SLACK_RAD, MANY, TRAIL = 2.0, 0.005, 200, 200
"""Seconds from one place to the next when passes are looked for, what a path bends meanwhile, satellites at a time, and
the pieces of a trail."""

EPOCH_KM, KM_PER_DAY, DRAG_SHARE, CLOCK_S = 1.0, 1.0, 0.25, 0.5
"""1 sigma: at the elements' date and a day later (Kelso 2007, AAS 07-127: GPS satellites), the share of what drag does
that the weather in space leaves open, and of the frame's clock. Of 30 derelict Iridium satellites, 780 to 250 km high,
21 are within it after 18 days of January 2025 and all within twice as much; backwards in time all 30 are."""

MOST_ARCSEC, STALE_DAYS = 7200.0, 10.0
"""A place less certain is not told; elements older than that are."""


@frozen(eq=False)
class Satellites:
    """Satellites (N,); ``orbits`` are ``sgp4``'s Satrec."""

    names: Sequence[str]
    orbits: Sequence[Any]

    def days(self, time_utc: datetime) -> Floats:
        """Days (N,) from the elements' dates to a time."""
        dates = np.array([orbit.jdsatepoch + orbit.jdsatepochF for orbit in self.orbits])
        return np.asarray(JD_UNIX + time_utc.timestamp() / 86400.0 - dates)

    def sigma_km(self, time_utc: datetime) -> Floats:
        """1 sigma (N,) along the orbits at a time."""
        days, rate = self.days(time_utc), 1440.0**2 / (2.0 * np.pi)  # of rad/min^2 in turns/day^2
        drag_km = np.array(
            [abs(orbit.ndot) * rate * 2.0 * np.pi * orbit.a * orbit.radiusearthkm for orbit in self.orbits]
        )
        return np.asarray(np.sqrt(EPOCH_KM**2 + (KM_PER_DAY * days) ** 2 + (DRAG_SHARE * drag_km * days**2) ** 2))

    def warning(self, time_utc: datetime, site: Site | None) -> str:
        """Why places are missing or bad, in a sentence; else empty."""
        if site is None:
            return tr("Satellites are left out: their places need your site.")
        days = round(float(np.median(np.abs(self.days(time_utc)))))
        sentence = tr_n(
            "The satellites' elements are {n} day from the frame's date: get those of that day.",
            "The satellites' elements are {n} days from the frame's date: get those of that day.",
            days,
        )
        return sentence if days > STALE_DAYS else ""

    def near(self, observer: Observer, centre: Floats, radius_rad: float, faintest: float) -> Task[list[Body]]:
        """The sunlit ones that pass near a direction during the exposure, of any magnitude.

        Parameters
        ----------
        observer : Observer
            Where and when; without a site none is found.
        centre : Floats
            ICRS unit vector (3,).
        radius_rad : float
            How near, radians.
        faintest : float
            Not used: satellites leave a trail of any magnitude.
        """
        found: list[Body] = []
        if observer.site is None:
            return found
        half = observer.exposure_s / 2.0
        seconds = np.linspace(-half, half, 2 + int(observer.exposure_s / STEP_S)) if half else np.zeros(1)
        sigma_km = self.sigma_km(observer.time_utc)
        for first in range(0, len(self.orbits), MANY):
            yield Progress("Looking for satellites", first / len(self.orbits))
            places, _ = topocentric_km(self.orbits[first : first + MANY], observer, seconds)
            steps = _passing(unit(places), centre, radius_rad + SLACK_RAD)
            for k in np.flatnonzero(steps.any(axis=1)).tolist():
                near = np.flatnonzero(steps[k])
                span = float(seconds[near[0]]), float(seconds[min(near[-1] + 1, len(seconds) - 1)])
                body = self._body(first + k, observer, centre, radius_rad, span, float(sigma_km[first + k]))
                if body is not None:
                    found.append(body)
        return found

    def body(self, row: int, observer: Observer) -> Task[Body | None]:
        """A satellite at mid-exposure, anywhere; None in the Earth's shadow, with old elements or no site."""
        yield Progress("Looking for satellites")
        if observer.site is None:
            return None
        sigma_km = float(self.sigma_km(observer.time_utc)[row])
        return self._body(row, observer, np.array([0.0, 0.0, 1.0]), np.pi, (0.0, 0.0), sigma_km)

    def _body(
        self,
        k: int,
        observer: Observer,
        centre: Floats,
        radius_rad: float,
        span_s: tuple[float, float],
        sigma_km: float,
    ) -> Body | None:
        """One that may pass between two times, s from mid-exposure; None when it does not, or in the dark."""
        begin, end = span_s
        seconds = np.linspace(begin, end, 8 * int((end - begin) / STEP_S + 1.0) + 1 if end > begin else 1)
        ways = unit(topocentric_km(self.orbits[k : k + 1], observer, seconds)[0])
        steps = np.flatnonzero(_passing(ways, centre, radius_rad)[0])
        if not len(steps):
            return None
        if len(seconds) > 1:
            # finely over the pass alone: the search's steps are too coarse to draw
            seconds = np.linspace(seconds[steps[0]], seconds[steps[-1] + 1], TRAIL + 1)
        (places,), (speed_km_s,) = topocentric_km(self.orbits[k : k + 1], observer, seconds)
        lit = np.flatnonzero(_sunlit(places, observer))
        if not len(lit):
            return None
        trail = [radec_deg(vector) for vector in without_aberration(unit(places[lit]), observer.time_utc)]
        # nearest to mid-exposure; while it is lit, as the rest leaves no light in the frame
        middle = int(np.argmin(np.abs(seconds[lit])))
        ra, dec = trail[middle]
        km = float(np.linalg.norm(places[lit[middle]]))
        sigma = float(np.degrees(np.hypot(sigma_km, CLOCK_S * speed_km_s[lit[middle]]) / km)) * 3600.0
        # not <=, so that NaN is refused too
        if not sigma <= MOST_ARCSEC:
            return None
        kind, moved = BodyKind.SPACECRAFT, tuple(trail) if len(trail) > 1 else ()
        return Body(self.names[k], kind, ra, dec, km / AU_KM, np.nan, 0.0, np.nan, sigma, moved)


def topocentric_km(orbits: Sequence[Any], observer: Observer, seconds: Floats) -> tuple[Floats, Floats]:
    """Geometric vectors (S, N, 3), km on ICRS axes, from the site, and speeds (S, N) km/s; NaN where there is none.

    ``seconds`` (N,) are from the observer's time. From TEME, SGP4's equator and mean equinox of date, by Greenwich mean
    sidereal time of 1982 (Vallado et al. 2006, AIAA 2006-6753); UT1 is taken for UTC, polar motion left out.
    """
    import erfa
    from sgp4.api import SatrecArray

    assert observer.site is not None
    date = JD_UNIX + observer.time_utc.timestamp() / 86400.0
    # day and fraction apart: one float of a Julian date resolves only 40 microseconds
    whole = np.full(len(seconds), np.floor(date) + 0.5)
    part = date - whole + seconds / 86400.0
    failed, places, velocities = SatrecArray(list(orbits)).sgp4(whole, part)
    places = np.where(failed[:, :, None] == 0, places, np.nan)
    apparent = erfa.gst06a(whole, part, whole, observer.jd_tdb[0] - whole + seconds / 86400.0)
    site = observer.site
    # ellipsoid 1 is WGS 84
    ground = erfa.gd2gc(1, np.radians(site.longitude_deg), np.radians(site.latitude_deg), site.height_m) / 1e3
    here = _turned(np.broadcast_to(ground, (len(seconds), 3)), apparent)
    there = _turned(places, apparent - erfa.gmst82(whole, part))
    return (there - here) @ of_date_matrix(observer.time_utc), np.linalg.norm(velocities, axis=2)


def _turned(vectors: Floats, angle: Floats) -> Floats:
    """Vectors (..., N, 3) turned about the pole by angles (N,), to the east."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    cos, sin = np.cos(angle), np.sin(angle)
    return np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=-1)


def _passing(ways: Floats, centre: Floats, radius_rad: float) -> Bools:
    """Which steps (S, N - 1) between directions (S, N, 3) come within a radius of the centre; (S, 1) when N is 1."""
    # a single moment is a step of no length
    last = ways[:, 1:] if ways.shape[1] > 1 else ways
    begin = ways[:, : last.shape[1]]
    along = last - begin
    # the nearest point of each chord, not its ends: a satellite crosses a small field between two steps
    share = np.sum((centre - begin) * along, axis=2) / np.maximum(np.sum(along**2, axis=2), 1e-30)
    nearest = begin + np.clip(share, 0.0, 1.0)[:, :, None] * along
    return np.asarray(np.linalg.norm(nearest - centre, axis=2) <= 2.0 * np.sin(min(radius_rad, np.pi) / 2.0))


def _sunlit(places: Floats, observer: Observer) -> Bools:
    """Which places (N, 3), km from the site on ICRS axes, are above its horizon and out of the Earth's shadow."""
    ephemeris = shipped_ephemeris()
    earth = ephemeris("earth", observer.jd_tdb)
    site = (observer.place - earth)[0] * AU_KM
    from_earth, sunward = places + site, unit((ephemeris("sun", observer.jd_tdb) - earth)[0])
    along = from_earth @ sunward
    aside = np.linalg.norm(from_earth - along[:, None] * sunward, axis=1)
    return np.asarray((places @ site > 0.0) & ((along > 0.0) | (aside > np.linalg.norm(site))))


# -- Elements in files -------------------------------------------------------------------------


def are_satellites(text: str) -> bool:
    """Whether a file's text is of two-line elements, or of the same as JSON or CSV (CCSDS OMM)."""
    return "MEAN_MOTION" in text[:2000] or any(line[:2] == "1 " and len(line) > 63 for line in text.split("\n", 8))


def read_satellites(name: str, text: str) -> Satellites:
    """The satellites of the text of the file called ``name``; CatalogueError, the bad line named, when one is bad."""
    found: dict[tuple[str, int], Any] = {}
    where = "line 1"
    try:
        for where, called, given in _elements(text):  # noqa: B007
            orbit = _orbit(given)
            found[called or f"NORAD {orbit.satnum}", orbit.satnum] = orbit  # rocket bodies share their names
    except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError):
        raise CatalogueError(
            "Can't read {name}: {where} has no usable elements of a satellite.", name=name, where=where
        ) from None
    if not found:
        raise CatalogueError("Can't read {name}: it has no orbital elements.", name=name)
    return Satellites([called for called, _ in found], list(found.values()))


def _elements(text: str) -> Iterator[tuple[str, str, Any]]:
    """Where each satellite's elements stand in a file, its name, and its two lines or fields."""
    if text.lstrip()[:1] in "[{":
        read = parse_json(text)
        for k, fields in enumerate(read if isinstance(read, list) else [read], 1):
            yield f"entry {k}", str(fields.get("OBJECT_NAME", "")), fields
        return
    lines = [line.rstrip() for line in text.splitlines()]
    if "MEAN_MOTION" in lines[0]:
        for number, fields in enumerate(csv.DictReader(lines), 2):
            yield f"line {number}", fields.get("OBJECT_NAME") or "", fields
        return
    called, first = "", ""
    for number, line in enumerate(lines, 1):
        if first:
            yield f"line {number - 1}", called, (first, line)
            called, first = "", ""
        elif line[:2] == "1 ":
            first = line
        elif line and not line.startswith("#"):
            called = line.removeprefix("0 ").strip()
    if first:
        yield f"line {len(lines)}", called, (first, "")


def _orbit(given: Any) -> Any:
    """``sgp4``'s Satrec of two lines or of fields; ValueError or KeyError when they are none."""
    from sgp4 import omm
    from sgp4.api import Satrec
    from sgp4.io import verify_checksum

    if isinstance(given, tuple):
        verify_checksum(*given)
        if given[1][:2] != "2 " or len(given[1]) < 63:
            raise ValueError
        orbit = Satrec.twoline2rv(*given)
    else:
        orbit = Satrec()
        omm.initialize(orbit, {key: str(value) for key, value in given.items()})
    # the dates are 1941 to 2105; sgp4 at the elements' own date shows orbits that it cannot carry at all
    date = orbit.jdsatepoch, orbit.jdsatepochF
    if orbit.error or not 2.43e6 < sum(date) < 2.49e6 or not np.isfinite(orbit.a * orbit.ndot) or orbit.sgp4(*date)[0]:
        raise ValueError
    return orbit
