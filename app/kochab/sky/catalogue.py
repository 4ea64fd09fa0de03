"""The star catalogue: opened in a millisecond, read only in the zones that a cone touches."""

from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kochab.core.arrays import Floats, Ints
from kochab.core.errors import CatalogueError, UsageError
from kochab.folders import data_folder
from kochab.sky.catalogue_file import (
    BV_LOWEST,
    BV_STEP,
    BV_UNKNOWN,
    EPOCH,
    HIPPARCOS,
    TIER_EDGES_MMAG,
    TURN,
    ZONES,
    Container,
)
from kochab.sky.names import StarNames, position_name

ZONE_RAD = np.radians(0.5)


def slices(
    ra: NDArray[np.uint32], zones: NDArray[np.uint32], centre: Floats, radius: float, tiers: range
) -> tuple[Ints, Ints]:
    """Where rows near the cone begin and end, a line for each of ``tiers``: a superset of those in it, ascending.

    Parameters
    ----------
    ra : NDArray[np.uint32]
        Right ascension (N,) in 1/2**32 turns, ascending within each tier and zone.
    zones : NDArray[np.uint32]
        The first row of each tier and zone.
    centre : Floats
        Axis of the cone, ICRS unit vector (3,).
    radius : float
        Its half angle, radians.
    tiers : range
        Tiers of brightness to look in, 0 the brightest.
    """
    dec0 = float(np.arctan2(centre[2], np.hypot(centre[0], centre[1])))
    ra0 = float(np.arctan2(centre[1], centre[0]))
    edge = 1e-9  # stored positions are rounded to 1.5e-9 rad
    # a superset is enough: Catalogue._inside checks each star exactly
    radius = min(radius + edge, np.pi)
    first = int(np.clip((dec0 - radius + np.pi / 2) / ZONE_RAD, 0, ZONES - 1))
    last = int(np.clip((dec0 + radius + np.pi / 2) / ZONE_RAD, 0, ZONES - 1))
    zone = np.arange(first, last + 1)
    if abs(dec0) + radius >= np.pi / 2 - 1e-6:
        half = np.pi  # a pole is inside, and every right ascension
    else:
        # the widest the circle of the cone gets in right ascension, at sin dec = sin dec0 / cos r
        half = float(np.arcsin(np.sin(radius) / np.cos(dec0))) + 1e-9 + 1e-9 / np.cos(dec0)
    cell = (np.asarray(tiers)[:, None] * ZONES + zone).ravel()
    start, stop = zones[cell].astype(np.int64), zones[cell + 1].astype(np.int64)
    unit = TURN / (2 * np.pi)
    low = int(np.floor((ra0 - half) * unit)) % 2**32 if half < np.pi else 0
    high = int(np.ceil((ra0 + half) * unit)) % 2**32 if half < np.pi else 2**32 - 1
    a = _bisect(ra, start, stop, low, right=False)
    b = _bisect(ra, start, stop, high, right=True)
    # An arc across RA 0 is two pieces: the start of the zone up to high, and low to its end.
    begin, end = (np.stack([start, a], axis=1), np.stack([b, stop], axis=1)) if low > high else (a, b)
    return begin.reshape(len(tiers), -1), end.reshape(len(tiers), -1)


def _rows(begin: Ints, end: Ints) -> Ints:
    """The rows in all slices, in order."""
    length = np.maximum(end - begin, 0).ravel()
    offset = np.cumsum(length) - length
    return np.repeat(begin.ravel() - offset, length) + np.arange(int(length.sum()))


def _bisect(ra: NDArray[np.uint32], start: Ints, stop: Ints, value: int, right: bool) -> Ints:
    """``searchsorted`` in many slices at once: first row >= (or, right, >) the value."""
    low, high = start.copy(), stop.copy()
    last = len(ra) - 1
    # all slices halve together, until the longest is down to one row
    for _ in range(int(np.max(stop - start, initial=0)).bit_length()):
        middle = (low + high) >> 1
        # middle may be one past the last row in a slice that is already done
        here = ra[np.minimum(middle, last)]
        below = (here <= value) if right else (here < value)
        open_ = low < high
        low = np.where(open_ & below, middle + 1, low)
        high = np.where(open_ & ~below, middle, high)
    return low


MAS = np.radians(1.0 / 3.6e6)
MOST_PM_ARCSEC = 1000.0  # a year; Barnard's star moves by 10.4


def open_catalogue(path: str | Path | None = None) -> "Catalogue":
    """The shipped catalogue, or the one at ``path``; memory mapped, so it costs about 1 ms.

    Raises `CatalogueError` with one sentence when the file is missing or damaged.
    """
    return Catalogue(shipped_folder() / "deep.kcat" if path is None else Path(path))


def shipped_folder() -> Path:
    """The folder of the shipped catalogue files."""
    return data_folder("catalogs")


class Catalogue:
    """Stars by row number, 0 to ``len - 1``, sorted by tier of magnitude, zone and RA."""

    def __init__(self, path: Path) -> None:
        self.container = Container(path)
        column = self.container.column
        self._ra, self._dec, self._pm_ra, self._pm_dec = map(column, ("ra", "dec", "pm_ra", "pm_dec"))
        self._mag, self._bv, self._flag, self._zones = map(column, ("mag", "bv", "flag", "zones"))
        self.max_pm_arcsec = self.container.facts.get("max_pm_arcsec", -1.0)
        moves = isinstance(self.max_pm_arcsec, float) and 0.0 <= self.max_pm_arcsec < MOST_PM_ARCSEC
        if not (moves and self._indexed()):
            raise self._damaged()

    def _indexed(self) -> bool:
        """Whether every column has a value for each star, and the zones hold all of them in order."""
        stars = (self._ra, self._dec, self._pm_ra, self._pm_dec, self._mag, self._bv, self._flag)
        if {len(column) for column in stars} != {len(self._ra)} or any(c.dtype.kind not in "iu" for c in stars):
            return False
        if len(self._zones) != (len(TIER_EDGES_MMAG) + 1) * ZONES + 1 or self._zones.dtype.kind not in "iu":
            return False
        # ascending first rows, the last of them the number of stars: otherwise a slice could run out of the columns
        steps = np.diff(self._zones.astype(np.int64), append=len(self._ra))
        return bool((steps >= 0).all()) and int(steps[-1]) == 0

    def __len__(self) -> int:
        return len(self._ra)

    def vectors(self, rows: ArrayLike, year: float = EPOCH) -> Floats:
        """ICRS unit vectors (N, 3) of ``rows`` (N,) with proper motion applied to ``year``."""
        rows = np.asarray(rows, dtype=np.int64)
        ra = self._ra[rows] * (2 * np.pi / TURN)
        dec = self._dec[rows] * (2 * np.pi / TURN)
        sin_ra, cos_ra, sin_dec, cos_dec = np.sin(ra), np.cos(ra), np.sin(dec), np.cos(dec)
        place = np.stack([cos_dec * cos_ra, cos_dec * sin_ra, sin_dec], axis=-1)
        span = (year - EPOCH) * MAS
        # at J2000 the motion is nothing: save the arithmetic
        if span == 0.0:
            return place
        east, north = self._pm_ra[rows] * span, self._pm_dec[rows] * span
        place[..., 0] -= east * sin_ra + north * sin_dec * cos_ra
        place[..., 1] += east * cos_ra - north * sin_dec * sin_ra
        place[..., 2] += north * cos_dec
        # Motion runs along the tangent, so the length has grown by at most (motion)^2 / 2.
        place /= np.sqrt(1.0 + east * east + north * north)[..., None]
        return place

    def mag(self, rows: ArrayLike) -> Floats:
        """V magnitudes (N,) of ``rows`` (N,)."""
        return np.asarray(self._mag[np.asarray(rows, dtype=np.int64)] * 1e-3)

    def bv(self, rows: ArrayLike) -> Floats:
        """Colours B-V (N,) of ``rows`` (N,), NaN where unknown."""
        step = self._bv[np.asarray(rows, dtype=np.int64)]
        return np.where(step == BV_UNKNOWN, np.nan, step * BV_STEP + BV_LOWEST)

    def motions(self, rows: ArrayLike) -> Floats:
        """Proper motions (N, 2), pmRA* and pmDE in mas/yr, of ``rows`` (N,); 0 where unknown."""
        rows = np.asarray(rows, dtype=np.int64)
        return np.stack([self._pm_ra[rows], self._pm_dec[rows]], axis=1).astype(np.float64)

    def flags(self, rows: ArrayLike) -> NDArray[np.uint8]:
        """Flags (N,) of ``rows``, the bits named in `kochab.sky.catalogue_file`."""
        return np.asarray(self._flag[np.asarray(rows, dtype=np.int64)])

    def cone(self, vector: ArrayLike, radius_rad: float, mag_limit: float | None = None, year: float = EPOCH) -> Ints:
        """Rows within a cone, brightest first.

        Parameters
        ----------
        vector : ArrayLike
            Its axis, ICRS unit vector (3,).
        radius_rad : float
            Its half angle, radians.
        mag_limit : float or None
            Keeps V <= limit, and leaves the tiers of fainter stars unread; None for all.
        year : float
            Epoch of the stars' places, Julian year.
        """
        # one tier more than edges: the last holds everything fainter than V 11
        tiers = range(len(TIER_EDGES_MMAG) + 1)
        if mag_limit is not None:
            tiers = range(int(np.searchsorted(TIER_EDGES_MMAG, mag_limit * 1e3, "right")) + 1)
        centre = np.asarray(vector, dtype=np.float64)
        rows = _rows(*self._slices(centre, radius_rad, tiers, year))
        if mag_limit is not None:
            rows = rows[self._mag[rows] <= round(mag_limit * 1e3)]
        return self._sorted(self._inside(rows, centre, radius_rad, year))

    def brightest(self, vector: ArrayLike, radius_rad: float, n: int, year: float = EPOCH) -> Ints:
        """The brightest rows of a cone, brightest first; fewer than ``n`` when it holds fewer.

        Parameters
        ----------
        vector : ArrayLike
            Its axis, ICRS unit vector (3,).
        radius_rad : float
            Its half angle, radians.
        n : int
            How many are wanted.
        year : float
            Epoch of the stars' places, Julian year.
        """
        centre = np.asarray(vector, dtype=np.float64)
        # tiers run from bright to faint, so the first that fill the list hold the brightest
        begin, end = self._slices(centre, radius_rad, range(len(TIER_EDGES_MMAG) + 1), year)
        tier = int(np.maximum(end - begin, 0).sum(axis=1).cumsum().searchsorted(n)) + 1  # fewer hold fewer than n
        found = self._inside(_rows(begin[:tier], end[:tier]), centre, radius_rad, year)
        while len(found) < n and tier < len(begin):
            more = self._inside(_rows(begin[tier], end[tier]), centre, radius_rad, year)
            found, tier = np.concatenate([found, more]), tier + 1
        return self._sorted(found)[:n]

    def _sorted(self, rows: Ints) -> Ints:
        return np.asarray(rows[np.argsort(self._mag[rows], kind="stable")])

    def _slices(self, centre: Floats, radius: float, tiers: range, year: float) -> tuple[Ints, Ints]:
        # rows are indexed at J2000, so widen the search by what the fastest star may have moved
        pad = abs(year - EPOCH) * np.radians(self.max_pm_arcsec / 3600.0)
        return slices(self._ra, self._zones, centre, radius + pad, tiers)

    def _inside(self, rows: Ints, centre: Floats, radius: float, year: float) -> Ints:
        # Chord rather than cosine: exact for small cones too.
        gap = self.vectors(rows, year) - centre
        chord = 2.0 * np.sin(min(radius, np.pi) / 2.0)
        inside = np.einsum("ij,ij->i", gap, gap) <= chord * chord * (1 + 1e-12) + 1e-24
        return np.asarray(rows[inside])

    def labels(self, rows: Ints) -> list[tuple[str, str]]:
        """Identifiers and names of stars (N,): ``[("HIP 91262", "Vega"), ...]``.

        A star that Hipparcos lacks is named by its position, ``("J183656.3+384701", "")``.
        """
        known = self.bright_rows(rows)
        places = map(position_name, self.vectors(rows[known < 0]).tolist())
        return [(next(places), "") if star < 0 else self.names.label(star) for star in known.tolist()]

    def label(self, row: int) -> tuple[str, str]:
        """The same of one star."""
        return self.labels(np.array([row]))[0]

    def bright_rows(self, rows: Ints) -> Ints:
        """Rows (N,) of the bright list to which ``rows`` (N,) point (their brightest components); -1 for none."""
        deep, bright = self.container.column("link_deep"), self.container.column("link_bright")
        known = (self._flag[rows] & HIPPARCOS) != 0
        asked = rows[known].astype(deep.dtype)  # numbers of its own type: the column is not copied
        at = deep.searchsorted(asked)
        if (at >= len(deep)).any() or (deep[at] != asked).any():
            raise self._damaged()
        found = np.full(len(rows), -1, dtype=np.int64)
        found[known] = bright[at]
        return found

    def deep_row(self, bright_row: int) -> int:
        """The row of this list that holds a row of the bright list."""
        at = np.flatnonzero(self.container.column("link_bright") == bright_row)
        row = int(self.container.column("link_deep")[at[0]]) if len(at) else len(self)
        if row >= len(self):
            raise self._damaged()
        return row

    def _damaged(self) -> CatalogueError:
        return CatalogueError("{path} is damaged: its index does not fit its stars.", path=self.container.path)

    def find(self, name: str) -> int:
        """The row of a star.

        Knows HIP, HD, HR and SAO numbers, star names, Bayer and Flamsteed designations. Raises `UsageError` when no
        star is called so; :mod:`kochab.sky.finder` finds whatever else has a name.
        """
        found = self.names.row_called(name)
        if found is None:
            raise UsageError("No star in the catalogue is called {name!r}.", name=name.strip())
        return self.deep_row(found)

    @cached_property
    def names(self) -> StarNames:
        """The bright list and the tables of names, opened when first asked for."""
        return StarNames(shipped_folder())
