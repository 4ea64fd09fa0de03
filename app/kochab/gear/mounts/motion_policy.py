"""The rules of motion: what a plan must satisfy before a byte is sent, one function a risk."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import datetime
from itertools import combinations
from math import copysign

import numpy as np

from kochab.core.arrays import Bools, Floats
from kochab.core.attitude import Degrees, radec_deg, separation_deg, unit_vectors, wrapped
from kochab.core.frame import Site
from kochab.core.mount import CONFIRM_HOME, SIDEREAL_DEG_S, Direction, Epoch, MountState, PierSide, Pointing
from kochab.gear.mounts.coordinates import from_mount_epoch, of_date, to_mount_epoch
from kochab.gear.mounts.motion_plan import (
    Limits,
    Plan,
    Preview,
    RuleFinding,
    SyncEvidence,
    by_axes,
    confirm,
    great_circle,
    over_the_pole,
    preview_of,
    refuse,
    turned,
    warn,
)
from kochab.gear.mounts.sync_needed import SyncNeeded
from kochab.sky.horizon import altitude_deg, horizon_frame, sidereal_deg, sun_vector
from kochab.text.translation import tr, tr_noop

Findings = Iterator[RuleFinding]
AHEAD_S = 60.0  # tracking ends so long before its limit
HOME_DEG, NOISE_DEG, TURNED_DEG = 2.0, 0.3, 20.0  # distances from the pole; hour angle from ±90
PARKED_DEG = 1.0  # as exactly as a mount parks
NUDGE_DEG = 5.0  # the longest move while the mount's clock or site is in doubt
NUDGED_DEG = 3.0 * NUDGE_DEG  # how far from its home a mount that was restarted may have been nudged since


def readiness(plan: Plan) -> Findings:
    """Refuse when the mount is parked, moves already, is not aligned, or its home is not confirmed."""
    if plan.state.parked:
        yield refuse("The mount is parked: unpark it before a {action}.", action=tr(plan.action))
    if plan.state.slewing:
        yield refuse("The mount is slewing. Wait, or stop it before a {action}.", action=tr(plan.action))
    if plan.state.aligned is False:  # None where the mount does not report it
        yield refuse("The mount is not aligned: do its alignment on the hand control first.")
    if plan.state.home_confirmed is False and plan.action == "goto":
        yield refuse(CONFIRM_HOME)
    if plan.state.home_confirmed is False and plan.action == "sync" and plan.by_hand:
        yield refuse(
            "The mount's home is not confirmed: only a solved frame can do that, or you when you connect (--home now)."
        )


def agreement(plan: Plan) -> Findings:
    """Refuse all but a nudge while clock or site of the mount contradict the computer's, see `clock_and_site`."""
    if plan.block_reason and (plan.action in ("goto", "sync") or max(plan.distance_deg, plan.turn_deg) > NUDGE_DEG):
        yield refuse(plan.block_reason)


def slew_length(plan: Plan) -> Findings:
    """Refuse a slew beyond the cap: a longer one is a mistake."""
    cap = 180.0 if plan.from_home else plan.limits.longest_slew_deg  # the first slew may go to whatever is up
    if not plan.distance_deg <= cap:  # refuses NaN, too
        yield refuse(
            "The slew of {distance:.1f} deg is longer than the {cap:g} allowed.", distance=plan.distance_deg, cap=cap
        )


# -- Pier, tripod and ground: altitude and hour angle along the whole path ---------------------

SLACK_DEG = 0.05  # less than tracking turns in AHEAD_S, 0.25: else it would go on past a limit


def horizon(plan: Plan) -> Findings:
    """Refuse a target or a path outside the altitudes and hour angles allowed.

    A telescope that is too low already may go up, never further down.
    """
    if plan.site is None:
        if plan.limits.allow_without_site or plan.action == "pulse":
            yield warn("No site set: the horizon limit is off.")
        else:
            yield refuse("No site set, so no horizon limit. Set the site before a {action}.", action=tr(plan.action))
        return
    if plan.action != "sync":
        yield from _altitudes(plan, plan.site)
        yield from _hour_angles(plan)
        return
    target = float(altitude_deg(np.atleast_2d(plan.target), plan.site, plan.time_utc)[0])
    if not target >= 0.0:  # refuses NaN, too
        yield refuse(
            "The sync is refused: that place is {target:.1f} deg below the horizon; check the site, the "
            "time and the solve.",
            target=-target,
        )


TOO_LOW = {  # by whether it is below the horizon, and whether it never rises high enough
    (False, False): tr_noop(
        "The target is {target:.1f}° high, the limit is {low:.3g}°. It rises above the limit in {hours:.1f} h."
    ),
    (False, True): tr_noop(
        "The target is {target:.1f}° high, the limit is {low:.3g}°. It never rises above the limit here."
    ),
    (True, False): tr_noop(
        "The target is {target:.1f}° below the horizon, the limit is {low:.3g}°."
        " It rises above the limit in {hours:.1f} h."
    ),
    (True, True): tr_noop(
        "The target is {target:.1f}° below the horizon, the limit is {low:.3g}°. It never rises above the limit here."
    ),
}
HOURS = tuple(minutes / 60.0 for minutes in range(5, 24 * 60, 5))
"""When a target that is too low now is looked for again."""


def _later_above(seen: Callable[[Floats], tuple[Floats, Floats]], target: Floats) -> Bools:
    """Whether a direction of date (3,) is above the lowest allowed at each of `HOURS`, as the sky turns."""
    turned = np.radians(SIDEREAL_DEG_S * 3600.0 * np.array(HOURS))
    x, y, z = target
    later = [x * np.cos(turned) + y * np.sin(turned), y * np.cos(turned) - x * np.sin(turned), z + 0.0 * turned]
    altitudes, floors = seen(np.stack(later, axis=1))
    return np.asarray(altitudes >= floors)


def _altitudes(plan: Plan, site: Site) -> Findings:
    level, high = horizon_frame(site, sidereal_deg(site, plan.time_utc)), plan.limits.highest_altitude_deg

    def seen(vectors: Floats) -> tuple[Floats, Floats]:
        """Altitudes, and the lowest allowed there."""
        south, east, up = (vectors @ level).T
        floors = plan.limits.floors_deg(np.degrees(np.arctan2(east, -south)))
        return np.degrees(np.arcsin(np.clip(up, -1.0, 1.0))), floors

    (start, target), (start_low, low) = (pair.tolist() for pair in seen(np.stack([plan.start, plan.target])))
    leaving = plan.action in ("move", "pulse", "track", "park", "home")  # these may return towards the allowed range
    if target < low and not (leaving and target >= start):
        if plan.action != "goto":
            yield refuse("The target is {target:.1f}° high, the limit is {low:.3g}°.", target=target, low=low)
            return
        rises = next((hours for hours, up in zip(HOURS, _later_above(seen, plan.target), strict=True) if up), None)
        yield refuse(TOO_LOW[target < 0.0, rises is None], target=abs(target), low=low, hours=rises)
        return
    if target > high and not (leaving and target <= start):
        yield refuse("The target is {target:.1f}° high, above the upper limit of {high:g}°.", target=target, high=high)
        return
    for path in plan.paths:
        along, floors = seen(path)
        worst, top = int(np.argmin(along - floors)), float(along.max())
        if along[worst] - floors[worst] < min(0.0, start - start_low) - SLACK_DEG:  # if it is too low already, no lower
            yield refuse(
                "The path would dip to {along:.1f}°, the limit is {floors:.3g}°.",
                along=along[worst],
                floors=floors[worst],
            )
            return
        if top > max(high, start) + SLACK_DEG:
            yield refuse("The path would rise to {top:.1f}°, the limit is {high:g}°.", top=top, high=high)
            return


def _hour_angles(plan: Plan) -> Findings:
    east, west = plan.limits.hour_angle_deg
    ends = plan.hour_angles_deg()
    if ends is None or (east <= -180.0 and west >= 180.0):
        return
    along, start = plan.path_hour_angles_deg(), ends[0]
    lowest, highest = float(along.min()), float(along.max())
    too_far_east = lowest < min(east, start) - SLACK_DEG
    if too_far_east or highest > max(west, start) + SLACK_DEG:
        yield refuse(
            "The path reaches hour angle {lowest:+.1f} h, the limits are {east:+.1f} to {west:+.1f} h.",
            lowest=(lowest if too_far_east else highest) / 15,
            east=east / 15,
            west=west / 15,
        )


def sun(plan: Plan) -> Findings:
    """Refuse a path through the cone about the Sun; without a site the Sun is taken to be up.

    A telescope that is inside the cone already may leave it, but not come nearer.
    """
    towards = sun_vector(plan.time_utc)
    if plan.site is not None:
        height = float(altitude_deg(np.atleast_2d(towards), plan.site, plan.time_utc)[0])
        if height <= plan.limits.sun_up_deg:
            return
    cone = plan.limits.sun_cone_deg
    start = separation_deg(plan.start, towards)
    target = separation_deg(plan.target, towards)
    leaving = plan.action in ("move", "pulse", "park", "home") and target >= start
    if target < cone and not leaving:
        yield refuse("The target is {target:.0f} deg from the Sun, nearer than {cone:g} deg.", target=target, cone=cone)
        return
    for path in plan.paths:
        nearest = float(np.degrees(np.arccos(np.clip(path @ towards, -1.0, 1.0))).min())
        if nearest < min(cone, start) - SLACK_DEG:
            yield refuse(
                "The path passes {nearest:.0f} deg from the Sun, nearer than {cone:g}.", nearest=nearest, cone=cone
            )
            return


# -- The meridian: where a German mount changes the side of its pier ---------------------------

ACROSS = tr_noop(
    "The sync would move the mount across the meridian, to the other pier side. Slew away from the "
    "meridian first. For a fork or wedge, set Meridian (--fork)."
)


def crosses(plan: Plan) -> bool:
    """Whether start and target lie on different sides of the meridian."""
    ends = plan.hour_angles_deg()
    return ends is not None and (ends[0] < 0.0) != (ends[1] < 0.0)  # the lower meridian counts too


def flip(plan: Plan) -> Findings:
    """Refuse a slew across the meridian unless the user has allowed the flip."""
    if plan.limits.crosses_meridian or not crosses(plan):
        return
    if plan.limits.allow_flip:
        yield warn("The mount will flip to the other side of its pier: watch the cables.")
    elif plan.state.pier_side is None:  # it may be a fork, which does not flip
        yield warn("The path crosses the meridian: a German mount would flip there.")
    else:
        yield refuse(
            "The path crosses the meridian and would flip the mount from the {pier} side of its "
            "pier. Choose a target on this side, or allow the flip (Meridian in the Mount view, or "
            "--allow-flip). For a fork or wedge, use --fork.",
            pier=plan.state.pier_side,
        )


def sync_across_meridian(plan: Plan) -> Findings:
    """Refuse a sync across the meridian: the mount would believe in the other pier side."""
    if not plan.limits.crosses_meridian and crosses(plan):
        yield refuse(ACROSS)
    if abs(plan.target_deg[1]) > plan.limits.near_pole_deg:
        yield warn(
            "At declination {target:+.1f}° a sync hardly corrects right ascension. Sync again farther from the pole.",
            target=plan.target_deg[1],
        )


def due_side(plan: Plan, flip: bool = False) -> PierSide | None:
    """The side of the pier on which the ``flip`` asked for ends, or one that is due; None where either will do.

    A mount that begins on a wrong side, as it says, may name its sides the other way round.
    """
    ends, limit = plan.hour_angles_deg(), plan.limits.past_meridian_deg
    if ends is None or plan.state.pier_side is None or plan.limits.crosses_meridian or plan.from_home:
        return None
    before, after = (PierSide.WEST if hour_angle < 0.0 else PierSide.EAST for hour_angle in ends)
    doubtful = plan.state.pier_side is not before and abs(ends[0]) > limit
    beside_pole = abs(plan.target_deg[1]) > plan.limits.near_pole_deg
    due = plan.limits.allow_flip and crosses(plan) and abs(ends[1]) > limit and not doubtful and not beside_pole
    return after if flip or due else None


EAST_MOST_DEG = -270.0  # hour angles count on from here: at the lower meridian, -180, is no jump
MOVE_ADVICE = tr_noop("Start farther from the meridian, or move the other way.")
PAST_ADVICE = {"track": tr_noop("Flip the mount (Flip in the Mount view, or kochab mount flip).")}


def past_meridian(plan: Plan) -> Findings:
    """Refuse a move that carries the telescope too far past the meridian on its side of the pier.

    A move never flips a German mount: it runs into its pier. Only where the mount reports the
    side: west of the pier it looks at the eastern sky. What is too far already may come back, and
    a mount that reports no side may be a fork.
    """
    side, limit = plan.state.pier_side, plan.limits.past_meridian_deg
    decs_deg = np.degrees(np.arcsin(np.concatenate(plan.paths)[:, 2]))
    turns_dec = float(abs(decs_deg - plan.start_deg[1]).max()) > SLACK_DEG  # over the pole it may end as it began
    if plan.limits.crosses_meridian or side is None or plan.site is None or turns_dec:
        return
    along = np.degrees(np.unwrap(np.radians(plan.path_hour_angles_deg())))
    past = along if side is PierSide.WEST else -along  # degrees past the meridian; the east side is the mirror image
    past -= 360.0 * np.floor((past[0] - EAST_MOST_DEG) / 360.0)  # begins in [-270, 90)
    start = max(float(past[0]), float(-180.0 - past[0]))
    worst = max(float(past.max()), float(-180.0 - past.min()))  # the upper, the lower meridian
    if not worst <= max(limit, start) + SLACK_DEG:
        yield refuse(
            "The {action} would take the telescope {worst:.0f}° past the meridian on the {side} side of "
            "the pier, where it may hit the pier (limit {limit:g}°). {get} For a fork or wedge, set "
            "Meridian in the Mount view (--fork).",
            action=tr(plan.action),
            worst=worst,
            side=tr(side),
            limit=limit,
            get=tr(PAST_ADVICE.get(plan.action, MOVE_ADVICE)),
        )


# -- A sync on a wrong solution: its size, two solves that agree, and their residuals ----------


def sync_step(plan: Plan) -> Findings:
    """Refuse beyond the largest step; ask beyond the smaller one."""
    limits, step = plan.limits, plan.distance_deg
    # Measured from the place that it would report without the syncs by hand before.
    unsynced = unit_vectors(plan.start_deg[0] - plan.by_hand_deg[0], plan.start_deg[1] - plan.by_hand_deg[1])
    total = separation_deg(unsynced, plan.target) if plan.by_hand else step
    guessed = plan.state.home_confirmed is False  # a step from a guessed position proves nothing
    turn, beside_deg = wrapped(plan.target_deg[0] - plan.start_deg[0]), 90.0 - abs(plan.target_deg[1])
    near_pole = abs(turn) > limits.confirm_sync_deg and beside_deg < 90.0 - limits.near_pole_deg
    # Switched on with its tube anywhere a mount reports its home: a sync would tell it the place, not the pier side.
    nearest_deg = NUDGED_DEG if plan.restarted else HOME_DEG
    at_home = 90.0 - abs(plan.start_deg[1]) < nearest_deg and plan.has_sides
    if at_home and step > limits.confirm_sync_deg and not guessed:
        yield refuse(
            "Mount thinks it is at home, {step:.0f}° from where it points. A sync can't set the pier side: switch it"
            " off, put the tube at its home position and switch it on again.",
            step=step,
        )
    elif (near_pole or beside_deg < NOISE_DEG) and not guessed:  # a tiny step here may shift RA by any angle
        yield refuse(
            "So near the pole this sync would shift right ascension by {turn:+.0f}° everywhere. Slew to "
            "a star farther from the pole and sync there.",
            turn=turn,
        )
    elif step > limits.refuse_sync_deg and not plan.allow_large_sync and not guessed:
        yield refuse(
            "The sync would shift the mount by {step:.1f}°, more than {refuse:g}°. If you are sure, allow it (--arm).",
            step=step,
            refuse=limits.refuse_sync_deg,
        )
    elif total > limits.refuse_sync_deg and not plan.allow_large_sync and not guessed:
        yield refuse(
            "With this night's syncs by hand the mount would be shifted by {total:.1f}°, more than {refuse:g}°. Sync"
            " on two solved frames; or, if you are sure, allow it (--arm).",
            total=total,
            refuse=limits.refuse_sync_deg,
        )
    elif step > limits.confirm_sync_deg:
        yield confirm("The sync would shift the mount by {step:.1f} deg: confirm it.", step=step)
    elif total > limits.confirm_sync_deg:
        yield confirm(
            "With this night's syncs by hand the mount would be shifted by {total:.1f}°: confirm it.", total=total
        )


def sync_evidence(plan: Plan) -> Findings:
    """Refuse a sync that no two good solves agree on; a value that is not a number fails."""
    e, limits = plan.evidence, plan.limits
    if plan.by_hand:
        return
    if e is None or len(e.centres_deg) < 2:
        count = 0 if e is None else len(e.centres_deg)
        yield refuse("A sync needs two solves that agree, not {count}. Take another frame.", count=count)
        return
    if not len(e.centres_deg) == len(e.rms_px) == len(e.log10_false_alarm):
        yield refuse("The solves for the sync are incomplete. Solve again.")
        return
    allowed = limits.solves_agree_arcsec
    centres = [unit_vectors(*centre) for centre in e.centres_deg]
    target = unit_vectors(*plan.target_icrs_deg)
    # np.max and np.min keep a NaN; Python's max() and min() may lose one that does not come first.
    apart = float(np.max([separation_deg(a, b) for a, b in combinations(centres, 2)])) * 3600.0
    away = float(np.min([separation_deg(target, centre) for centre in centres])) * 3600.0
    if not apart <= allowed:
        yield refuse(
            "The solves differ by {apart:.0f}″ (limit {allowed:g}″). Wait, then solve again.",
            apart=apart,
            allowed=allowed,
        )
    elif not away <= allowed:
        yield refuse("The sync is {away:.0f}″ from the solved position. Solve again.", away=away)
    rms_px, false_alarm = float(np.max(e.rms_px)), float(np.max(e.log10_false_alarm))
    if not rms_px <= limits.worst_rms_px:
        yield refuse(
            "The solve's residual is {rms:.1f} px (limit {worst:g} px).", rms=rms_px, worst=limits.worst_rms_px
        )
    if not false_alarm <= limits.worst_log10_false_alarm:
        yield refuse(
            "Possible chance match: 10^{false:.0f} (limit 10^{worst:g}). Solve a better frame.",
            false=false_alarm,
            worst=limits.worst_log10_false_alarm,
        )


def unchecked_path(plan: Plan) -> Findings:
    """Warn that nobody can check the mount's path. Refuse to park below the horizon, or by a lost position."""
    low, limit = plan.park_altitude_deg, plan.limits.lowest_altitude_deg
    yield warn("Kochab can't check the mount's path in advance: watch the telescope.")
    if plan.action != "park":
        return
    if plan.block_reason:  # a wrong clock alone leads no mount astray on its way to rest
        yield refuse(plan.block_reason)
    if low is None:
        yield warn(
            "The mount does not report its park position. If Kochab stops it at the horizon limit ({limit:g}°), lower"
            " the limit.",
            limit=limit,
        )
    elif low < -PARKED_DEG:
        yield refuse("The mount's park position is {low:.0f}° below the horizon: set another in its driver.", low=-low)
    elif low - PARKED_DEG in (limit, *(altitude for _, altitude in plan.limits.horizon_deg)):  # what it has lowered
        yield warn("The mount parks {low:.1f}° high: until then that is the horizon limit.", low=low)


REST_RULES = (readiness, unchecked_path, horizon, sun)
MOTION_RULES = (readiness, agreement, slew_length, horizon, sun, flip)
MOVE_RULES = (readiness, agreement, horizon, past_meridian, sun)  # no flip rule: moving one axis never flips
TRACKING_RULES = (horizon, past_meridian)
SYNC_RULES = (readiness, agreement, sync_step, sync_evidence, horizon, sync_across_meridian)


class MotionPolicy:
    """Plans motions and syncs and checks the rules; positions in the mount's own epoch.

    ``clock_conflict`` says how the mount's clock and site contradict this computer's; ``slew_block_reason`` why no slew
    is allowed before a sync, which ``needed`` keeps for other programs. Both are sentences, empty when there is none.
    """

    def __init__(
        self, site: Site | None, limits: Limits, clock: Callable[[], datetime], needed: SyncNeeded | None = None
    ) -> None:
        self.site, self.limits, self.clock, self._needed = site, limits, clock, needed
        self.clock_conflict = ""
        self.reports_side = False  # of its pier: then it has one, whatever a person says of a fork
        self._slew_block_reason = "" if needed is None else needed.read()
        self.restarted = bool(self._slew_block_reason)  # and not synced since, as far as another program has left word

    @property
    def slew_block_reason(self) -> str:
        """Why a slew needs a sync first; empty when it does not."""
        return self._slew_block_reason

    @slew_block_reason.setter
    def slew_block_reason(self, sentence: str) -> None:
        if self._needed is not None and sentence != self._slew_block_reason:
            self._needed.keep(sentence)
        self._slew_block_reason = sentence
        self.restarted &= bool(sentence)

    def goto(self, here: Pointing, state: MountState, to_deg: Degrees, flip: bool = False) -> tuple[Plan, Preview]:
        """A slew, and its preview by the rules.

        Parameters
        ----------
        here : Pointing
            Where the mount is.
        state : MountState
            What it reports.
        to_deg : Degrees
            RA and Dec, degrees, in the epoch of ``here``.
        flip : bool
            Whether a person has asked for the other side of the pier.
        """
        plan = leaving_home(self.plan("goto", here, state, to_deg))
        if flip:
            plan = replace(plan, limits=replace(plan.limits, allow_flip=True))
        plan = with_paths(plan, flip)
        return plan, preview_of(plan, (here.ra_deg, here.dec_deg), to_deg, MOTION_RULES)

    def asks_flip(self, here: Pointing, state: MountState, to_deg: Degrees) -> bool:
        """Whether nothing but a meridian flip stands against this slew."""
        return not self.goto(here, state, to_deg)[1].allowed and self.goto(here, state, to_deg, flip=True)[1].allowed

    def rest(
        self, action: str, here: Pointing, state: MountState, park_altitude_deg: float | None = None
    ) -> tuple[Plan, Preview]:
        """The way to the mount's park position or home, where the counterweight is down: on no wrong side.

        A park position that is lower than the horizon limit is that limit on the way to it. The likeliest way home is
        checked: a mount that falls silent on it is seen again too late.

        Parameters
        ----------
        action : str
            "park" or "home".
        here : Pointing
            Where the mount is.
        state : MountState
            What it reports.
        park_altitude_deg : float or None
            Altitude of the park position; None: not known.
        """
        place, low = (here.ra_deg, here.dec_deg), park_altitude_deg if action == "park" else None
        free = replace(self.limits, allow_flip=True, hour_angle_deg=(-180.0, 180.0))  # its own way may flip it
        if low is not None:
            lowest = low - PARKED_DEG
            drawn = tuple((azimuth, min(altitude, lowest)) for azimuth, altitude in free.horizon_deg)
            free = replace(free, lowest_altitude_deg=min(free.lowest_altitude_deg, lowest), horizon_deg=drawn)
        plan = replace(
            self.plan(action, here, state, place),
            limits=free,
            park_altitude_deg=low,
            block_reason=self.slew_block_reason,
        )
        if action == "home":
            plan = replace(plan, paths=paths_home(plan))
        return plan, preview_of(plan, place, place, REST_RULES)

    def move(
        self,
        action: str,
        here: Pointing,
        state: MountState,
        direction: Direction,
        angle_deg: float,
        farthest_deg: float,
        overrun: float,
    ) -> tuple[Plan, Preview, Floats]:
        """A move or pulse, its preview, and the region where it may be seen.

        Parameters
        ----------
        action : str
            "move" or "pulse".
        here : Pointing
            Where the mount is.
        state : MountState
            What it reports.
        direction : Direction
            The way it moves.
        angle_deg : float
            How far.
        farthest_deg : float
            How far at the most, when the bytes that end it are lost: there, too, it must be within the limits.
        overrun : float
            How many times as far as ``angle_deg`` it may be seen.
        """
        still = self.plan(action, here, state, (here.ra_deg, here.dec_deg))
        plan = with_move(still, direction, angle_deg)
        preview = preview_of(plan, plan.start_deg, plan.target_deg, MOVE_RULES)
        if not preview.refusals:
            far = with_move(still, direction, farthest_deg)
            preview = preview_of(far, far.start_deg, far.target_deg, MOVE_RULES)
        (region,) = with_move(plan, direction, overrun * angle_deg).paths
        return plan, preview, region

    def tracking(self, here: Pointing, state: MountState, seconds: float = AHEAD_S) -> str:
        """Why it must not track on for so long, on its way to the west; empty when it may, or nothing is known."""
        if self.site is None or state.home_confirmed is False:  # the place is a guess
            return ""
        still = leaving_home(self.plan("track", here, state, (here.ra_deg, here.dec_deg)))
        plan = with_move(still, Direction.WEST, seconds * SIDEREAL_DEG_S)
        return next(iter(preview_of(plan, plan.start_deg, plan.target_deg, TRACKING_RULES).refusals), "")

    def sync(
        self,
        here: Pointing,
        state: MountState,
        to_deg: Degrees,
        evidence: SyncEvidence | None = None,
        by_hand: bool = False,
        allow_large_sync: bool = False,
        by_hand_deg: Degrees = (0.0, 0.0),
    ) -> Preview:
        """What a sync would do.

        Parameters
        ----------
        here : Pointing
            Where the mount says it is.
        state : MountState
            What it reports.
        to_deg : Degrees
            RA and Dec, degrees, in the epoch of ``here``.
        evidence : SyncEvidence or None
            The solves that it rests on; None: none.
        by_hand : bool
            Whether it is the user's word.
        allow_large_sync : bool
            Whether it may be larger than the limits allow.
        by_hand_deg : Degrees
            By how much others by hand have shifted both coordinates already.
        """
        plan = self.plan("sync", here, state, to_deg)
        plan = replace(
            plan, evidence=evidence, by_hand=by_hand, allow_large_sync=allow_large_sync, by_hand_deg=by_hand_deg
        )
        return preview_of(plan, (here.ra_deg, here.dec_deg), to_deg, SYNC_RULES)

    def altaz_deg(self, here: Pointing) -> Degrees | None:
        """Altitude, and azimuth from north over east, degrees, by the site and the clock; None without a site."""
        if self.site is None:
            return None
        now = self.clock()
        south, east, up = unit_vectors(*of_date(here, now)) @ horizon_frame(self.site, sidereal_deg(self.site, now))
        return float(np.degrees(np.arcsin(np.clip(up, -1.0, 1.0)))), float(np.degrees(np.arctan2(east, -south)) % 360.0)

    def plan(self, action: str, here: Pointing, state: MountState, to_deg: Degrees) -> Plan:
        """A motion to a place, without its paths yet.

        Parameters
        ----------
        action : str
            What is asked for.
        here : Pointing
            Where the mount is.
        state : MountState
            What it reports.
        to_deg : Degrees
            RA and Dec, degrees, in the epoch of ``here``.
        """
        now = self.clock()
        target_icrs = from_mount_epoch(Pointing(*to_deg, here.epoch), now)
        return Plan(
            start_deg=of_date(here, now),
            target_deg=to_mount_epoch(*target_icrs, Epoch.DATE, now),
            target_icrs_deg=target_icrs,
            state=state,
            limits=self.limits,
            time_utc=now,
            site=self.site,
            action=action,
            restarted=self.restarted,
            has_sides=not self.limits.crosses_meridian or self.reports_side or state.pier_side is not None,
            block_reason=self.clock_conflict or ("" if action == "sync" else self.slew_block_reason),
        )


def leaving_home(plan: Plan) -> Plan:
    """A slew from home, where a German mount has no side yet, with the hour angle at which it leaves the pole.

    Beside the pole with the counterweight down the reported hour angle and side are rounding noise.
    """
    ends, beside_deg = plan.hour_angles_deg(), 90.0 - abs(plan.start_deg[1])
    if ends is None or beside_deg > HOME_DEG:
        return plan
    if beside_deg > NOISE_DEG and abs(abs(ends[0]) - 90.0) > TURNED_DEG:  # tracking, beside the pole
        return plan
    if plan.limits.crosses_meridian:  # a fork's hour angle is real at the pole, too
        return replace(plan, from_home=True)
    ra_deg = (plan.start_deg[0] + ends[0] - copysign(90.0, ends[1])) % 360.0  # hour angle ±90, on the target's side
    state = replace(plan.state, pier_side=None)
    return replace(plan, start_deg=(ra_deg, plan.start_deg[1]), state=state, from_home=True)


def with_paths(plan: Plan, flip: bool = False) -> Plan:
    """The paths a slew may take; over the pole where a ``flip`` is asked for, or due and allowed or not told.

    So, too, where a person says that it is a fork and the mount names a side of its pier: it may flip unasked.
    """
    start, target, limits = plan.start_deg, plan.target_deg, plan.limits
    paths = [great_circle(start, target), by_axes(start, target)]
    due = crosses(plan) and (limits.allow_flip or limits.crosses_meridian or plan.state.pier_side is None)
    if plan.site is not None and (flip or due) and not (plan.never_flips or plan.from_home):
        paths.append(over_the_pole(start, target, plan.site.latitude_deg >= 0.0))
    return replace(plan, paths=tuple(paths))


def paths_home(plan: Plan) -> tuple[Floats, ...]:
    """The likeliest path home: a German mount's, to the pole with its counterweight down; empty where none is known."""
    ends = plan.hour_angles_deg()
    if plan.site is None or ends is None or plan.never_flips or plan.state.alt_azimuth:
        return ()
    east = ends[0] < 0.0 if plan.state.pier_side is None else plan.state.pier_side is PierSide.WEST
    down_deg = -90.0 if east else 90.0  # the hour angle at which its tube leaves the pole
    pole_deg = copysign(90.0, plan.site.latitude_deg)
    return (turned(plan.start_deg, wrapped(ends[0] - down_deg), pole_deg - plan.start_deg[1]),)


def with_move(plan: Plan, direction: Direction, angle_deg: float) -> Plan:
    """A turn of one axis by so much, its end the target."""
    turn_deg = angle_deg if direction in (Direction.EAST, Direction.NORTH) else -angle_deg
    path = turned(plan.start_deg, *((0.0, turn_deg) if direction.in_dec else (turn_deg, 0.0)))
    return replace(plan, target_deg=radec_deg(path[-1]), paths=(path,), turn_deg=angle_deg)
