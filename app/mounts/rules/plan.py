"""What is about to be done, in the words the rules need."""

from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import separation_deg, unit_vectors
from app.core.hint import Site
from app.core.mount import MountState
from app.mounts.limits import Limits, SyncEvidence
from app.mounts.sky_frame import hour_angle_deg, sidereal_deg

Floats = NDArray[np.float64]


class Severity(StrEnum):
    """What a finding does: it forbids, asks for a yes, or only tells."""

    REFUSE = "refuse"
    CONFIRM = "confirm"
    WARN = "warn"


@dataclass(frozen=True, slots=True)
class Finding:
    """One sentence of one rule."""

    severity: Severity
    sentence: str


@dataclass(frozen=True, slots=True)
class Plan:
    """A motion or a sync from where the mount believes to be to a target; degrees of date.

    ``paths`` are arrays (N, 3) of unit vectors of date: ways the telescope may take.
    ``target_icrs_deg`` is the target as solves know it.
    """

    start_deg: tuple[float, float]
    target_deg: tuple[float, float]
    target_icrs_deg: tuple[float, float]
    state: MountState
    limits: Limits
    time_utc: datetime
    site: Site | None = None
    paths: tuple[Floats, ...] = ()
    evidence: SyncEvidence | None = None
    by_hand: bool = False
    armed: bool = False
    action: str = "goto"

    @property
    def start(self) -> Floats:
        """Unit vector (3,) of date."""
        return unit_vectors(*self.start_deg)

    @property
    def target(self) -> Floats:
        """Unit vector (3,) of date."""
        return unit_vectors(*self.target_deg)

    @property
    def distance_deg(self) -> float:
        """From start to target."""
        return separation_deg(self.start, self.target)

    def hour_angles_deg(self) -> tuple[float, float] | None:
        """Of start and target; None without a site."""
        if self.site is None:
            return None
        start, target = (
            hour_angle_deg(ra, self.site, self.time_utc)
            for ra in (self.start_deg[0], self.target_deg[0])
        )
        return start, target

    def path_hour_angles_deg(self) -> Floats:
        """Hour angles of every point of every path (with a site)."""
        if self.site is None:
            return np.zeros(0)
        points = np.concatenate([*self.paths, np.atleast_2d(self.target)])
        ra_deg = np.degrees(np.arctan2(points[:, 1], points[:, 0]))
        turned = sidereal_deg(self.site, self.time_utc) - ra_deg
        return np.asarray((turned + 180.0) % 360.0 - 180.0)


def refuse(sentence: str) -> Finding:
    """A finding that forbids."""
    return Finding(Severity.REFUSE, sentence)


def confirm(sentence: str) -> Finding:
    """A finding that asks for a yes."""
    return Finding(Severity.CONFIRM, sentence)


def warn(sentence: str) -> Finding:
    """A finding that tells."""
    return Finding(Severity.WARN, sentence)
