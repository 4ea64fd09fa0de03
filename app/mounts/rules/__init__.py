"""The guard's rules, one risk a file; each looks at a :class:`Plan` and says what it finds."""

from app.mounts.rules.horizon import horizon
from app.mounts.rules.meridian import flip, sync_across_meridian
from app.mounts.rules.past_meridian import past_meridian
from app.mounts.rules.plan import Finding, Plan, Severity
from app.mounts.rules.readiness import readiness
from app.mounts.rules.slew import slew
from app.mounts.rules.sun import sun
from app.mounts.rules.sync import sync

MOTION_RULES = (readiness, slew, horizon, sun, flip)
MOVE_RULES = (readiness, horizon, past_meridian, sun)
SYNC_RULES = (readiness, sync, horizon, sync_across_meridian)

__all__ = ["MOTION_RULES", "MOVE_RULES", "SYNC_RULES", "Finding", "Plan", "Severity"]
