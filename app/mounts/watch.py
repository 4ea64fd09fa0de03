"""A motion under way: each place read back is held against what was judged before it began."""

from dataclasses import replace
from datetime import datetime
from time import monotonic

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import separation_deg, unit_vectors
from app.core.mount import PierSide, Pointing
from app.mounts.epoch import from_mount_epoch, to_mount_epoch
from app.mounts.rules.horizon import horizon
from app.mounts.rules.plan import Plan, Severity
from app.mounts.rules.sun import sun

Floats = NDArray[np.float64]
RULES = (horizon, sun)
ASIDE_DEG = 5.0  # beside its room: the play of gears, and an approach from one side
FASTEST_DEG_S = 20.0  # no mount slews faster
THERE_DEG = 0.5
LOOK_S = 1.5  # whoever asks only how a moving mount is asks where it is, too, so often


class Watch:
    """What is watched of one motion.

    Parameters
    ----------
    plan : Plan
        As it was judged, with its ways.
    room : (N, 3) float64
        Unit vectors of date: where the telescope may be seen on its way.

    """

    def __init__(self, plan: Plan, room: Floats) -> None:
        self.plan = plan
        self._room = room
        self._here, self._at = plan.start, plan.time_utc
        self._looked = monotonic()

    @property
    def due(self) -> bool:
        """Whether nobody has looked for a while."""
        return monotonic() - self._looked >= LOOK_S

    def finding(self, said: Pointing, now_utc: datetime) -> str | None:
        """What is wrong with a place that the mount says now; None when nothing is."""
        here = unit_vectors(*_of_date(said, now_utc))
        passed_s = self._passed_s(now_utc)
        found = self._jump(here, passed_s) or self._aside(here) or self._limit(here, now_utc)
        if found is None:
            self._here, self._at, self._looked = here, now_utc, monotonic()
        return found

    def side_finding(self, side: PierSide | None) -> str | None:
        """What is wrong with the side of the pier that the mount tells."""
        before, limits = self.plan.state.pier_side, self.plan.limits
        if limits.allow_flip or limits.crosses_meridian or before is None or side in (None, before):
            return None
        return f"it began to change from the {before} to the {side} side of its pier"

    def _passed_s(self, now_utc: datetime) -> float:
        """Seconds since the last look, by the clock that ran more: one of them may be simulated."""
        return max(monotonic() - self._looked, (now_utc - self._at).total_seconds())

    def _jump(self, here: Floats, passed_s: float) -> str | None:
        moved = separation_deg(self._here, here)
        if moved <= FASTEST_DEG_S * passed_s + ASIDE_DEG:
            return None
        if separation_deg(here, self.plan.target) < THERE_DEG:
            return None
        return f"its position jumped by {moved:.0f} deg, as no motor turns"

    def _aside(self, here: Floats) -> str | None:
        nearest = float(np.degrees(np.arccos(np.clip((self._room @ here).max(), -1.0, 1.0))))
        if nearest <= ASIDE_DEG:
            return None
        return f"it went the wrong way, {nearest:.0f} deg beside what was asked of it"

    def _limit(self, here: Floats, now_utc: datetime) -> str | None:
        plan = replace(self.plan, paths=(np.atleast_2d(here),), time_utc=now_utc)
        for rule in RULES:
            for finding in rule(plan):
                if finding.severity is Severity.REFUSE:
                    return finding.sentence[:1].lower() + finding.sentence[1:].rstrip(".")
        return None


def _of_date(said: Pointing, time_utc: datetime) -> tuple[float, float]:
    from app.core.mount import Epoch

    return to_mount_epoch(*from_mount_epoch(said, time_utc), Epoch.DATE, time_utc)
