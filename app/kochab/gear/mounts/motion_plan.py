"""A motion before it begins: limits, plan, the paths the telescope may take, and the preview."""

from collections.abc import Callable, Iterable
from datetime import datetime
from enum import StrEnum
from math import cos, radians

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import Degrees, angle_between, separation_deg, unit_vectors, wrapped
from kochab.core.frame import Site
from kochab.core.mount import MountState
from kochab.core.solution import Solution
from kochab.core.values import frozen
from kochab.sky.horizon import hour_angle_deg, sidereal_deg
from kochab.text.translation import tr

# -- What a guarded mount may do, and the evidence a sync must bring ---------------------------


Horizon = tuple[tuple[float, float], ...]


@frozen
class Limits:
    """The guard's numbers. A fork or alt-azimuth mount ``crosses_meridian`` without a flip.

    Hour angles are not limited by themselves: a German mount chooses the side of its pier in a slew, so the same hour
    angle may be safe on one side and not on the other, and a fork reaches them all. What does not flip, a move of the
    axis, is kept near the meridian where the mount reports its side.
    """

    lowest_altitude_deg: float = 5.0
    horizon_deg: Horizon = ()  # obstacles above it: azimuth and altitude, sorted by azimuth
    highest_altitude_deg: float = 90.0
    hour_angle_deg: tuple[float, float] = (-180.0, 180.0)  # only its owner knows where the pier is
    past_meridian_deg: float = 15.0  # for a move of the axis, which never flips
    allow_without_site: bool = False

    longest_slew_deg: float = 120.0
    slew_timeout_s: float = 240.0
    slew_start_s: float = 30.0  # a slew takes no longer than this and its angle at the slowest rate
    slowest_slew_deg_s: float = 0.25
    allow_flip: bool = False
    crosses_meridian: bool = False

    longest_move_s: float = 60.0
    longest_move_deg: float = 95.0
    longest_pulse_ms: int = 5000

    sun_cone_deg: float = 30.0
    sun_up_deg: float = -10.0  # altitude of the Sun from which the cone holds

    confirm_sync_deg: float = 5.0
    refuse_sync_deg: float = 20.0  # unless armed
    solves_agree_arcsec: float = 120.0
    worst_rms_px: float = 2.0
    worst_log10_false_alarm: float = -5.0  # as the solver; two that agree make it 10^-10
    read_back_arcsec: float = 120.0  # the coarsest mounts round to 90
    near_pole_deg: float = 85.0  # declination

    def floors_deg(self, azimuths_deg: Floats) -> Floats:
        """The lowest altitudes allowed at these azimuths (N,), north over east, between the points of the horizon."""
        low = np.full(len(azimuths_deg), self.lowest_altitude_deg)
        if not self.horizon_deg:
            return low
        azimuths, altitudes = zip(*self.horizon_deg, strict=True)
        # The period interpolates through north, from the last point to the first.
        return np.asarray(np.maximum(low, np.interp(azimuths_deg, azimuths, altitudes, period=360.0)))


@frozen
class SyncEvidence:
    """The results of independent solves: one entry a solve in every tuple, centres in ICRS degrees."""

    centres_deg: tuple[tuple[float, float], ...]
    rms_px: tuple[float, ...]
    log10_false_alarm: tuple[float, ...]

    @classmethod
    def of(cls, *solutions: Solution) -> "SyncEvidence":
        """The evidence of solved frames, each of another exposure."""
        return cls(
            tuple(s.ra_dec_deg for s in solutions),
            tuple(s.rms_px for s in solutions),
            tuple(s.log10_false_alarm for s in solutions),
        )


class Severity(StrEnum):
    """Whether a finding forbids, asks for confirmation, or only informs."""

    REFUSE = "refuse"
    CONFIRM = "confirm"
    WARN = "warn"


@frozen
class RuleFinding:
    """One sentence of one rule."""

    severity: Severity
    sentence: str


@frozen
class Plan:
    """A motion or a sync from the reported position to a target; degrees of date.

    ``paths`` are arrays (N, 3) of unit vectors of date: paths the telescope may take.
    ``target_icrs_deg`` is the target as solves know it. ``from_home``: see `motion_policy.leaving_home`.
    ``block_reason`` is why the mount's clock, site or pointing must not be relied upon. ``by_hand_deg`` is what this
    night's syncs by hand have shifted it by. ``has_sides``: it has told of a side of its pier, or is not said to be a
    fork. ``restarted``: it was switched off and on, and not synced since. ``turn_deg`` is how far one
    axis turns, which beside the pole is little on the sky.
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
    allow_large_sync: bool = False
    action: str = "goto"
    from_home: bool = False
    block_reason: str = ""
    by_hand_deg: Degrees = (0.0, 0.0)
    park_altitude_deg: float | None = None
    has_sides: bool = True
    restarted: bool = False
    turn_deg: float = 0.0

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

    @property
    def never_flips(self) -> bool:
        """Whether it is said to be a fork or an alt-azimuth mount, and does not belie that by naming a pier's side."""
        return self.limits.crosses_meridian and (not self.has_sides or self.state.alt_azimuth is True)

    def hour_angles_deg(self) -> tuple[float, float] | None:
        """Of start and target; None without a site."""
        if self.site is None:
            return None
        start, target = (hour_angle_deg(ra, self.site, self.time_utc) for ra, _ in (self.start_deg, self.target_deg))
        return start, target

    def path_hour_angles_deg(self) -> Floats:
        """Hour angles of every point of every path (with a site)."""
        if self.site is None:
            return np.zeros(0)
        points = np.concatenate([*self.paths, np.atleast_2d(self.target)])
        ra_deg = np.degrees(np.arctan2(points[:, 1], points[:, 0]))
        hour_angles = sidereal_deg(self.site, self.time_utc) - ra_deg
        return wrapped(hour_angles)


def refuse(text: str, /, **values: object) -> RuleFinding:
    """A motion is forbidden; ``text`` and ``values`` as for :func:`kochab.text.translation.tr`."""
    return RuleFinding(Severity.REFUSE, tr(text, **values))


def confirm(text: str, /, **values: object) -> RuleFinding:
    """A motion needs a person's yes."""
    return RuleFinding(Severity.CONFIRM, tr(text, **values))


def warn(text: str, /, **values: object) -> RuleFinding:
    """A person should know this before the motion."""
    return RuleFinding(Severity.WARN, tr(text, **values))


Rule = Callable[[Plan], Iterable[RuleFinding]]


@frozen
class Preview:
    """A motion or sync that has not been done; positions in the mount's own epoch, degrees.

    ``offset_deg`` is the angle on the sky, ``east_deg`` and ``north_deg`` its parts (east already
    times the cosine of the declination).
    """

    action: str
    from_deg: tuple[float, float]
    to_deg: tuple[float, float]
    offset_deg: float
    east_deg: float
    north_deg: float
    refusals: tuple[str, ...] = ()
    confirmations: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def allowed(self) -> bool:
        """Whether it may be done, perhaps after confirmation."""
        return not self.refusals


def preview_of(
    plan: Plan, from_deg: tuple[float, float], to_deg: tuple[float, float], rules: Iterable[Rule]
) -> Preview:
    """The preview of a plan by all rules; each finding once.

    Parameters
    ----------
    plan : Plan
        The motion.
    from_deg, to_deg : tuple[float, float]
        RA and Dec, degrees, in one epoch: where it begins and where it leads.
    rules : Iterable[Rule]
        What may refuse it, warn, or ask for a confirmation.
    """
    found = [finding for rule in rules for finding in rule(plan)]

    def of(severity: Severity) -> tuple[str, ...]:
        return tuple(dict.fromkeys(f.sentence for f in found if f.severity is severity))

    return Preview(
        action=plan.action,
        from_deg=from_deg,
        to_deg=to_deg,
        offset_deg=plan.distance_deg,
        east_deg=wrapped(to_deg[0] - from_deg[0]) * cos(radians(to_deg[1])),
        north_deg=to_deg[1] - from_deg[1],
        refusals=of(Severity.REFUSE),
        confirmations=of(Severity.CONFIRM),
        warnings=of(Severity.WARN),
    )


# -- The paths a telescope may take from here to there -----------------------------------------
# The mount's own path is not known: an equatorial one turns both axes at one speed until each
# arrives, a fork in altitude and azimuth follows roughly a great circle, and a German mount that
# changes sides goes over the pole. A slew is allowed when all of them are.

Aim = Callable[[Degrees, datetime], Degrees]
"""Where a mount is sent so that it points at a place, both in its own coordinates."""
STEP_DEG = 1.0


def great_circle(start_deg: Degrees, target_deg: Degrees) -> Floats:
    """Unit vectors (N, 3) along the shortest path, both ends included."""
    a, b = unit_vectors(*start_deg), unit_vectors(*target_deg)
    angle = angle_between(a, b)
    # The interpolation divides by the sine of the angle; between opposite points there is no shortest path.
    if angle < 1e-9 or np.pi - angle < 1e-6:
        return np.stack([a, b])
    t = np.linspace(0.0, angle, _count(np.degrees(angle)))[:, None]
    return np.asarray((np.sin(angle - t) * a + np.sin(t) * b) / np.sin(angle))


def by_axes(start_deg: Degrees, target_deg: Degrees) -> Floats:
    """Unit vectors (N, 3) when both equatorial axes turn at one speed until each arrives."""
    return turned(start_deg, wrapped(target_deg[0] - start_deg[0]), target_deg[1] - start_deg[1])


def over_the_pole(start_deg: Degrees, target_deg: Degrees, north: bool) -> Floats:
    """Unit vectors (N, 3) of a flip: the declination axis turns through the pole."""
    # From the other side of the pier the same place has the RA axis turned by 180 deg and Dec taken past the pole.
    pole = 180.0 if north else -180.0
    ra_turn_deg = wrapped(target_deg[0] + 180.0 - start_deg[0])
    return turned(start_deg, ra_turn_deg, pole - target_deg[1] - start_deg[1])


def turned(start_deg: Degrees, ra_turn_deg: float, dec_turn_deg: float) -> Floats:
    """Unit vectors (N, 3) of a move of the axes by so much."""
    # t is the angle turned so far; the axis with the shorter way waits at its end for the other.
    longest = max(abs(ra_turn_deg), abs(dec_turn_deg))
    t = np.linspace(0.0, longest, _count(longest))
    ra = start_deg[0] + np.clip(ra_turn_deg, -t, t)
    dec = start_deg[1] + np.clip(dec_turn_deg, -t, t)
    return unit_vectors(ra, dec)  # past the pole the vectors are right as they are


def _count(angle_deg: float) -> int:
    return max(2, int(np.ceil(angle_deg / STEP_DEG)) + 1)
