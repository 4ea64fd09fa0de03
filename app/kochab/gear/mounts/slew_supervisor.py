"""Slew supervision: each position read back is compared with the plan until the motion has ended."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from time import monotonic
from typing import NoReturn

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import Degrees, apart_deg, radec_deg, separation_deg, unit_vectors, wrapped
from kochab.core.errors import LineLostError, NoAnswerError, NotStoppedError, RefusedError, StoppedError, StrayedError
from kochab.core.mount import MountState, PierSide, Pointing
from kochab.core.progress import Progress, Task
from kochab.gear.journal import MotionLog
from kochab.gear.mounts.coordinates import of_date
from kochab.gear.mounts.emergency_stop import MAY_STILL_MOVE, EmergencyStop
from kochab.gear.mounts.last_seen import LastSeen
from kochab.gear.mounts.motion_plan import Aim, Plan, Severity
from kochab.gear.mounts.motion_policy import MotionPolicy, crosses, horizon, sun
from kochab.gear.mounts.restart_watch import RestartWatch
from kochab.gear.mounts.standing import Reading
from kochab.sky.horizon import horizon_frame, sidereal_deg
from kochab.text.translation import tr, tr_noop

RULES = (horizon, sun)
ASIDE_DEG = 5.0  # beside its region: backlash, and an approach from one side
FASTEST_DEG_S = 20.0  # no mount slews faster
THERE_DEG = 0.5  # this near the target no position counts as a jump
BRAKES_S = 1.0  # from a place seen to a standstill: two looks, a Stop, and half the time that motors take to brake
LOOK_S = 1.5  # how old the position of a moving mount may be before state() asks for it
POLL_S = 0.2  # between two looks at a slew
NOT_PARKED = tr_noop("The mount stopped before it was parked.")
NOT_HOME = tr_noop("The mount stopped before it was at home.")
MUTE = tr_noop("The mount does not answer. IF IT GOES WHERE IT MUST NOT, CUT ITS POWER.")
MUTED = tr_noop("The mount fell silent on its way and answers no more: it may have lost its power.")
SLEPT_S = 10.0  # a wait that overran by this much means that the computer slept
SLEPT = tr_noop(
    "The computer stood still for {:.0f} s while the mount moved, and Kochab stopped it: see where it points."
)
STANDS_S = 60.0  # of a mount that says it moves; the longest that one settles
STANDS = tr_noop(
    "The mount says that it moves, but it has stood still for {:.0f} s, and Kochab stopped it: see whether its axes are"
    " free, then try again."
)
MISSES = 3  # positions that may be missed in a row during a slew; as often it may say that it is parked
FAR_DEG, IDLE = 0.5, 8  # beyond FAR_DEG an idle mount may not have begun yet: it gets IDLE looks
STILL_DEG = 0.01  # from one look to the next, on the way to park or home
GRID_DEG = 2.0  # well below ASIDE_DEG: no place between two grid points is aside
FOLLOWED_DEG = 30.0  # a mount may have tracked this far past the meridian without a flip


def reach_deg(passed_s: float) -> float:
    """How far a mount that was ordered to move may have gone."""
    return FASTEST_DEG_S * passed_s + ASIDE_DEG


class SupervisedMotion:
    """One motion under way: what the mount reports is compared with its ``plan``, which was allowed, with its paths.

    ``region`` (N, 3) are unit vectors of date: where the telescope may be seen on its way. As fast as it was seen to
    go, a slew must also be able to brake within the limits, and a move at an unknown rate to keep them until the next
    look.
    """

    def __init__(self, plan: Plan, region: Floats, rate_known: bool = True) -> None:
        self.plan = plan
        self._region = region
        self._ahead_s = LOOK_S if not rate_known else BRAKES_S if plan.action == "goto" else 0.0
        self._here, self._at = plan.start, plan.time_utc
        self._looked = monotonic()

    @property
    def due(self) -> bool:
        """Whether the last position is older than `LOOK_S`."""
        return monotonic() - self._looked >= LOOK_S

    def finding(self, reported: Pointing, now_utc: datetime, asked_s: float) -> str | None:
        """What is wrong with the position asked for at ``asked_s`` (`monotonic`); None when nothing is."""
        here = unit_vectors(*of_date(reported, now_utc))
        # By whichever clock advanced more: one of them may be simulated.
        passed_s = max(monotonic() - self._looked, (now_utc - self._at).total_seconds())
        found = self._jump(here, passed_s) or self._aside(here) or self._limit(here, now_utc)
        found = found or self._ahead(here, self._ahead_s / max(passed_s, POLL_S), now_utc)
        if found is None:  # never compare the next position with a wrong one
            self._here, self._at, self._looked = here, now_utc, asked_s
        return found

    def side_finding(self, side: PierSide | None) -> str | None:
        """What is wrong with the reported side of the pier; None when nothing is."""
        before, limits = self.plan.state.pier_side, self.plan.limits
        if limits.allow_flip or limits.crosses_meridian or before is None or side in (None, before):
            return None
        return tr(
            "it began to change from the {before} to the {side} side of its pier", before=tr(before), side=tr(side)
        )

    def aside(self, reported: Pointing, now_utc: datetime) -> bool:
        """Whether no way of this motion leads by this place."""
        return bool(self._aside(unit_vectors(*of_date(reported, now_utc))))

    def _jump(self, here: Floats, passed_s: float) -> str | None:
        moved = separation_deg(self._here, here)
        there = separation_deg(here, self.plan.target) < THERE_DEG
        if there or moved <= reach_deg(passed_s):
            return None
        return tr("its position jumped by {moved:.0f} deg, faster than any motor", moved=moved)

    def _aside(self, here: Floats) -> str | None:
        nearest = float(np.degrees(np.arccos(np.clip((self._region @ here).max(), -1.0, 1.0))))
        if nearest <= ASIDE_DEG:
            return None
        return tr("it went the wrong way, {nearest:.0f} deg off its path", nearest=nearest)

    def _ahead(self, here: Floats, times: float, now_utc: datetime) -> str | None:
        """What is wrong with where it will be, so many ``times`` as far on as since the last look, its target at most.

        Straight on, or by either kind of axes, of which each ends at its target: only when every one is wrong.
        """
        if not times:
            return None
        places = [here + (here - self._here) * times]
        if self.plan.action == "goto":
            step, left = separation_deg(self._here, here) * times, separation_deg(here, self.plan.target)
            places = [here + (here - self._here) * times * min(1.0, left / max(step, 1e-9))]
            axes = [np.eye(3)]
            if self.plan.site is not None:
                axes.append(horizon_frame(self.plan.site, sidereal_deg(self.plan.site, now_utc)))
            places += [self._by_axes(here, times, level) for level in axes]
        findings = [self._limit(place, now_utc) for place in places]
        return findings[0] if all(findings) else None

    def _by_axes(self, here: Floats, times: float, level: Floats) -> Floats:
        """Unit vector (3,) of the place ahead when it turns about these axes (3, 3), as :meth:`_ahead`."""
        before, now, end = (radec_deg(place @ level) for place in (self._here, here, self.plan.target))
        ahead = []
        for was, at, goal in zip(before, now, end, strict=True):
            step, left = wrapped(at - was) * times, wrapped(goal - at)
            ahead.append(at + (left if step * left > 0.0 and abs(step) > abs(left) else step))
        return np.asarray(unit_vectors(*ahead) @ level.T)

    def _limit(self, here: Floats, now_utc: datetime) -> str | None:
        # The rules that allowed the plan, applied to this one place at the present time.
        plan = replace(self.plan, paths=(np.atleast_2d(here / np.linalg.norm(here)),), time_utc=now_utc)
        for rule in RULES:
            for finding in rule(plan):
                if finding.severity is Severity.REFUSE:
                    return finding.sentence[:1].lower() + finding.sentence[1:].rstrip(".")  # follows a colon
        return None


class SlewSupervisor:
    """Reads the mount's state and position for its guard, and stops a motion that goes wrong."""

    def __init__(
        self, emergency: EmergencyStop, log: MotionLog, policy: MotionPolicy, last_seen: LastSeen | None = None
    ) -> None:
        self.strayed = ""  # why the last motion was stopped on its way
        self.aim: Aim | None = None  # of a pointing model; dropped when the mount's coordinates change
        self.undo: tuple[Degrees, str] | None = (
            None  # the shift that takes the last sync back, and `slew_block_reason` before
        )
        self._emergency, self._log, self._clock, self._policy = emergency, log, policy.clock, policy
        self._motion: SupervisedMotion | None = None
        self._slewed = 0.0  # when a motion began, or the mount did last not say that it no longer slews
        self.watch = RestartWatch(emergency.mount, policy, log, reach_deg, last_seen)

    @property
    def target_icrs_deg(self) -> Degrees | None:
        """Where a slew under way goes, ICRS degrees; None where nothing slews to a place of the sky."""
        motion = self._motion if self._emergency.moving else None
        return None if motion is None or motion.plan.action != "goto" else motion.plan.target_icrs_deg

    def begin(self, motion: SupervisedMotion | None) -> None:
        """A motion begins; a new one replaces what was supervised before."""
        self.strayed, self._motion, self._slewed = "", motion, monotonic()

    def forget(self) -> None:
        """Compare no more: the mount's coordinates are about to change by a sync."""
        self._motion = self.aim = None
        self.watch.forget()

    def reconnecting(self) -> None:
        """What stood when the line was lost stands there still, or was switched off and on meanwhile."""
        self.aim = self.undo = None
        self.watch.reconnecting()

    def restarted(self, sentence: str) -> None:
        """It was switched off and on: no slew before a sync, and no sync of before is taken back."""
        self.watch.found(sentence)
        self.undo = None

    def position(self) -> Pointing:
        """Where the mount says it points; one that leaves its path is stopped.

        Raises `StrayedError` when it was under way and twice reported a place where it must not be, and
        `NotStoppedError` when its driver could not end a move; Stop was sent then.
        """
        mount, motion = self._emergency.mount, self._motion if self._emergency.moving else None
        asked_s = monotonic()  # a busy computer may read the answer long after the mount was there
        try:
            here = mount.position()
            if motion is not None and motion.finding(here, self._clock(), asked_s):
                asked_s = monotonic()
                here = mount.position()  # a late answer may bring an old position
                if found := motion.finding(here, self._clock(), asked_s):
                    self._stop(found, lambda: self._see(here, asked_s, strayed=True))
        except NotStoppedError:  # its driver could not end a move
            self._emergency.finish()
            raise
        except LineLostError:
            self.watch.reconnecting()
            raise
        self._see(here, asked_s)
        return here

    def _see(self, here: Pointing, asked_s: float, strayed: bool = False) -> None:
        """Forbid slews after a restart: a mount switched on anywhere assumes that it is at home."""
        found = self.watch.restarts
        emergency = self._emergency
        off_its_way = self._motion is not None and self._motion.aside(here, self._clock())
        self.watch.see(emergency.mount, here, asked_s, emergency.moving, strayed, off_its_way, emergency.ended)
        if self.watch.restarts != found:
            self.undo = None

    def state(self) -> MountState:
        """How the mount is, and while it moves where it is, too: see :meth:`position`."""
        state = self._state()
        motion = self._motion if self._emergency.moving else None
        if motion is not None and motion.side_finding(state.pier_side):
            # Ask twice, as for a position: one late answer must not end a slew.
            state = self._state()
            found = motion.side_finding(state.pier_side)
            if found:
                self._stop(tr("{found}: allow the flip (Meridian, or --allow-flip), and watch the cables", found=found))
        due = motion is not None and motion.due
        if (due or self.watch.silent(self._emergency.mount)) and not state.parked:  # some are silent once parked
            self.position()
        return state

    def check_not_stopped(self, stops: int, what: str) -> None:
        """Raise when the motion ``what`` that began at the count ``stops`` was stopped since."""
        if self._emergency.stops != stops:
            raise StrayedError(self.strayed) if self.strayed else StoppedError("The {what} was stopped.", what=tr(what))

    def pause(self, wait: Callable[[float], None], seconds: float) -> None:
        """Wait; `StoppedError` after a computer's sleep, which one of its clocks did not count."""
        begun, at = monotonic(), self._clock()
        wait(seconds)
        slept_s = max(monotonic() - begun, (self._clock() - at).total_seconds()) - seconds
        if slept_s > SLEPT_S:
            self._log.add("wait", "failed", sentence := tr(SLEPT).format(slept_s))
            raise StoppedError(sentence)

    def arrival(self, target_deg: Degrees, limit_s: float, stops: int, side: PierSide | None = None) -> Task[Pointing]:
        """Yield the distance left until the mount reports that it no longer slews.

        Raises `NoAnswerError` when it took too long or missed too many answers in a row, and `RefusedError` when it was
        stopped, or stands still somewhere else.

        Parameters
        ----------
        target_deg : Degrees
            Where it is to arrive, RA and Dec, degrees in the mount's epoch.
        limit_s : float
            The longest it may take.
        stops : int
            Count of Stops when the slew was decided: a later one ends it.
        side : PierSide or None
            Of the pier on which it is to arrive; None: either.
        """
        first = left = None
        idle, restarts = 0, self.watch.restarts
        looks = self._looks("slew", limit_s, stops)
        while True:
            detail = "" if left is None else tr("{left:.1f} deg to go", left=left)
            done = None if not first or left is None else min(1.0, max(0.0, 1.0 - left / first))
            yield Progress("slewing", done, detail)
            state, here = next(looks)
            if here is None:
                yield Progress("slewing", done, "" if state.parked else tr(MUTE))
                continue
            slewing = state.slewing
            before, left = left, apart_deg((here.ra_deg, here.dec_deg), target_deg)
            first = first or left
            unmoved = before is not None and abs(before - left) < 1e-3  # 3.6 arcsec
            # A mount that does not report slewing counts as idle while its position stands still.
            idle = idle + 1 if slewing is False or (slewing is None and unmoved) else 0
            if idle and left < FAR_DEG and side in (None, state.pier_side):
                return here
            if idle >= IDLE and left < FAR_DEG:
                raise RefusedError(
                    "THE MOUNT DID NOT FLIP: it is still {pier} of its pier and may hit it. Slew it away "
                    "from the meridian, or flip it with its hand control.",
                    pier=tr(state.pier_side or ""),
                )
            if idle >= IDLE:
                if self._motion is not None:
                    self.watch.stopped_short(self._motion.plan.start_deg)
                self._require_no_restart(restarts)
                why = f": {tr(state.fault)}" if state.fault else ""
                raise RefusedError("The mount stopped {left:.1f} deg from its target{why}.", left=left, why=why)

    def rest(self, action: str, limit_s: float, stops: int) -> Task[None]:
        """Yield until the mount reports to be parked or at home, or where it does not report it stands still.

        Raises as :meth:`arrival`.
        """
        at: Degrees | None = None
        before, idle, restarts = at, 0, self.watch.restarts
        looks = self._looks(action, limit_s, stops)
        doing = tr_noop("parking") if action == "park" else tr_noop("going home")
        while True:
            yield Progress(doing)
            state, here = next(looks)
            there = state.parked if action == "park" else state.at_home
            if there and not state.slewing:
                before, at = at, self._parked_at(restarts) if here is None else (here.ra_deg, here.dec_deg)
                if at is None or (before is not None and apart_deg(before, at) < STILL_DEG):
                    return
                continue
            if here is None:
                yield Progress(doing, detail="" if state.parked else tr(MUTE))
                continue
            before, at = at, (here.ra_deg, here.dec_deg)
            still = before is not None and apart_deg(before, at) < STILL_DEG
            idle = idle + 1 if still and not state.slewing else 0
            if idle >= IDLE and there is None:  # not reported: standing still has to do
                return
            if idle >= IDLE:
                early = tr(NOT_PARKED) if action == "park" else tr(NOT_HOME)
                # Once its power is known to have failed, that is likeliest what ended this motion as well.
                why = f" {self._policy.slew_block_reason}" if self._policy.restarted else ""
                raise RefusedError("{early}{why}", early=early, why=why)

    def after_silence(self, error: NoAnswerError, restarts: int) -> NoAnswerError:
        """Why a motion ended in ``error``, asked once its Stop has gone out: a mount that is back tells of its restart.

        ``restarts`` is their count as the motion began. One that is still silent may be without power: then, too, it
        needs a sync.
        """
        try:
            self.position()
        except NoAnswerError:
            self.restarted(tr(MUTED))
            return NoAnswerError("{may} {why}", may=tr(MAY_STILL_MOVE), why=self._policy.slew_block_reason)
        if self.watch.restarts != restarts or self._policy.restarted:
            return NoAnswerError(self._policy.slew_block_reason)
        return NoAnswerError("{error} It answers again: check its power and its cable.", error=error)

    def _parked_at(self, restarts: int) -> Degrees | None:
        """Where it is that says it is parked; None where it is silent then, as an Autostar is.

        A server's word of a mount that does not answer it is not the mount's: that raises `NoAnswerError`.
        Raises `RefusedError` when it cannot have come there, because it was restarted since the count ``restarts``.
        """
        asked_s = monotonic()
        try:
            here = self._emergency.mount.position()
        except NoAnswerError:
            if self._emergency.mount.lag_s:
                raise
            return None
        self._see(here, asked_s)
        self._require_no_restart(restarts)
        return here.ra_deg, here.dec_deg

    def _require_no_restart(self, restarts: int) -> None:
        if self.watch.restarts != restarts:
            raise RefusedError(self._policy.slew_block_reason)

    def _looks(self, what: str, limit_s: float, stops: int) -> Iterator[tuple[MountState, Pointing | None]]:
        """State and position again and again, no position when the answer was missed or the mount is parked."""
        end, restarts = monotonic() + limit_s, self.watch.restarts
        misses, state, stood = 0, MountState(), None
        while True:
            self.pause(self._emergency.wait, POLL_S)
            self.check_not_stopped(stops, what)
            if monotonic() > end:
                raise NoAnswerError(
                    "The {what} did not end within {limit:.0f} s and was stopped.", what=tr(what), limit=limit_s
                )
            try:
                state = self.state()
                here = None if state.parked else self.position()  # a parked Autostar is silent
            except NoAnswerError:
                misses += 1
                if misses >= MISSES:
                    raise
                here = None
            else:
                misses = misses + 1 if state.parked and what != "park" else 0
                if misses >= MISSES:
                    self._parked_at(restarts)
                    raise RefusedError("The mount was parked on its way. Unpark it, then try again.")
            self._require_no_restart(restarts)
            stood = self._stood(stood, here, state)
            yield state, here

    def _stood(self, since: Reading | None, here: Pointing | None, state: MountState) -> Reading | None:
        """Since when a mount that says it moves has stood; `RefusedError` when that is too long."""
        if here is None or not state.slewing:
            return None
        now = Reading(here, monotonic(), self._clock())
        if since is None or not now.agrees(since):
            return now
        if now.asked_s - since.asked_s > STANDS_S:
            raise RefusedError(tr(STANDS).format(STANDS_S))
        return since

    def _state(self) -> MountState:
        self.watch.state = state = self._emergency.mount.state()
        self._policy.reports_side |= state.pier_side is not None
        if state.slewing is not False:
            self._slewed = monotonic()
        # All but a goto end by their time limit. A goto may begin late, or pause, and is supervised all the same.
        elif self._emergency.endless and monotonic() - self._slewed > IDLE * POLL_S:
            self._emergency.end()
        return state

    def _stop(self, found: str, see: Callable[[], None] = lambda: None) -> NoReturn:
        """Stop it for what was ``found``, and ``see`` where that is, once the Stop has gone out."""
        resting = self._motion is not None and self._motion.plan.action in ("park", "home")
        text = (
            tr("Kochab stopped the mount on its way to rest: {found}.")
            if resting
            else tr("Kochab stopped the slew: {found}.")
        )
        self.strayed, restarts = text.format(found=found), self.watch.restarts
        self._emergency.stops += 1
        try:
            self._emergency.halt()
            with suppress(NoAnswerError):
                see()
            if self.watch.restarts != restarts:
                self.strayed = f"{self.strayed} {self._policy.slew_block_reason}"
        finally:  # afterwards: a slow disk must not delay a Stop
            self._log.add("stray", "failed", self.strayed)
        raise StrayedError(self.strayed)


# -- The allowed region of a motion: every place where the telescope may be seen on its way ----
# A slew's two axes need not keep step, so the region is wider than the planned paths: all between
# start and target by right ascension and declination, the same by azimuth and altitude, and
# everything about the pole for a mount that may change the side of its pier.


def allowed_region(plan: Plan) -> Floats:
    """Unit vectors of date (N, 3), a few degrees from one to the next."""
    start, target = plan.start_deg, plan.target_deg
    regions = [*plan.paths, _between(start, target)]
    if plan.site is not None:
        level = horizon_frame(plan.site, sidereal_deg(plan.site, plan.time_utc))
        here, there = (radec_deg(v @ level) for v in (plan.start, plan.target))
        # An alt-azimuth mount may go either way round in azimuth.
        regions.append(_between(here, there, both_ways=plan.limits.crosses_meridian) @ level.T)
    if may_flip(plan):
        # A flip goes over the pole, wherever the other axis is then.
        north = plan.site is None or plan.site.latitude_deg >= 0.0
        decs = (start[1], target[1])
        regions.append(_grid(0.0, 360.0, *((min(decs), 90.0) if north else (-90.0, max(decs)))))
    return np.concatenate(regions)


def anywhere() -> Floats:
    """Every place: only the mount knows its way to its park position or home."""
    return _grid(0.0, 360.0, -90.0, 90.0)


def may_flip(plan: Plan) -> bool:
    """Whether nothing forbids that the mount changes the side of its pier on its way."""
    if plan.limits.allow_flip:
        return True
    if plan.never_flips or not (plan.limits.crosses_meridian or plan.state.pier_side is None):
        return False
    ends = plan.hour_angles_deg()
    return ends is None or crosses(plan) or 0.0 <= ends[0] < FOLLOWED_DEG  # past the meridian any slew may flip it


def slew_limit_s(plan: Plan) -> float:
    """In how many seconds a slew must have ended: its longer axis at the slowest rate."""
    (ra, dec), (to_ra, to_dec), limits = plan.start_deg, plan.target_deg, plan.limits
    # A flip may turn the RA axis by half a turn, however near the target is.
    turn_deg = 180.0 if may_flip(plan) else max(abs(wrapped(to_ra - ra)), abs(to_dec - dec))
    return min(limits.slew_timeout_s, limits.slew_start_s + turn_deg / limits.slowest_slew_deg_s)


def _between(start: Degrees, target: Degrees, both_ways: bool = False) -> Floats:
    """All places between two longitudes, the short way round or both, and two latitudes."""
    turn = 360.0 if both_ways else wrapped(target[0] - start[0])
    return _grid(start[0], start[0] + turn, start[1], target[1])


def _grid(west_deg: float, east_deg: float, low_deg: float, high_deg: float) -> Floats:
    longitudes, latitudes = (
        np.linspace(a, b, max(2, int(np.ceil(abs(b - a) / GRID_DEG)) + 1))
        for a, b in ((west_deg, east_deg), (low_deg, high_deg))
    )
    grid = np.meshgrid(longitudes, latitudes)
    return unit_vectors(grid[0].ravel(), grid[1].ravel())
