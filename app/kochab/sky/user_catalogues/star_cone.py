"""What every catalogue of the user's own gives: the stars of a cone, and how far it reaches."""

import math
from pathlib import Path
from typing import Protocol

import numpy as np

from kochab.core.arrays import Floats, Table
from kochab.core.attitude import unit_vectors
from kochab.core.values import frozen

Version = tuple[int, int]


def version(path: Path) -> Version:
    """What changes when a file does: its size and when it was written; (0, 0) when it is not there."""
    try:
        facts = path.stat()
    except OSError:
        return 0, 0
    return facts.st_size, facts.st_mtime_ns


@frozen
class Cone:
    """A circle on the sky: its axis and half angle, radians, ICRS.

    ``mag_limit`` is the faintest magnitude wanted, None for all; ``year`` the epoch of the places, a Julian year, where
    motions are known.
    """

    ra_rad: float
    dec_rad: float
    radius_rad: float
    mag_limit: float | None = None
    year: float = 2016.0

    @property
    def axis(self) -> Floats:
        """ICRS unit vector (3,)."""
        return unit_vectors(np.degrees(self.ra_rad), np.degrees(self.dec_rad))

    @property
    def area_sr(self) -> float:
        """Steradians."""
        return 2.0 * math.pi * (1.0 - math.cos(self.radius_rad))


@frozen(eq=False)
class StarCone(Table):
    """Stars (N,): ``ra`` and ``dec`` in radians, ICRS, and ``mag``, V or nearly."""

    ra: Floats
    dec: Floats
    mag: Floats

    @property
    def vectors(self) -> Floats:
        """ICRS unit vectors (N, 3)."""
        return unit_vectors(np.degrees(self.ra), np.degrees(self.dec))

    def inside(self, cone: Cone) -> "StarCone":
        """Those of them in a cone, brightest first."""
        # haversines: exact for small cones too
        apart = np.sin((self.dec - cone.dec_rad) / 2.0) ** 2
        apart += np.cos(self.dec) * np.cos(cone.dec_rad) * np.sin((self.ra - cone.ra_rad) / 2.0) ** 2
        within = apart <= np.sin(min(cone.radius_rad, np.pi) / 2.0) ** 2 + 1e-24
        if cone.mag_limit is not None:
            within &= self.mag <= cone.mag_limit
        rows = np.flatnonzero(within)
        return self.take(rows[np.argsort(self.mag[rows], kind="stable")])


ENOUGH = 30
"""Stars that a frame should have to choose from."""


@frozen
class Reach:
    """How far a catalogue reaches: its faintest star, stars a square degree in the median, share of the sky."""

    faintest_mag: float
    density_deg2: float
    sky_share: float

    @property
    def narrowest_deg(self) -> float:
        """The side of the square field that has enough stars in the median."""
        return min(180.0, float((ENOUGH / max(self.density_deg2, 1e-6)) ** 0.5))


class UserCatalogue(Protocol):
    """A catalogue that the user already has."""

    kind: str
    name: str
    path: Path

    def cone(self, cone: Cone) -> StarCone:
        """The stars of a cone, brightest first; CatalogueError, one sentence, where the files are damaged."""
        ...

    def reach(self) -> Reach:
        """How deep it goes and how much of the sky it has."""
        ...
