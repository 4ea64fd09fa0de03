"""The guard: a mount that moves and syncs only within its limits.

Everything that moves a mount does it through a :class:`Guard`, itself a :class:`~kochab.core.mount.Mount`.
A motion is planned and allowed by its policy, written into its log, supervised while it lasts, and
ended by its emergency stop when something goes wrong. Time and site are sent only when a person asks for it.
"""

import weakref
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from functools import partial
from math import inf
from time import monotonic, sleep
from types import TracebackType
from typing import Generic, NoReturn, Self, TypeVar

from kochab.core.attitude import Degrees, apart_deg, wrapped
from kochab.core.errors import (
    DeviceError,
    LineLostError,
    NoAnswerError,
    NotSentError,
    NotStoppedError,
    RefusedError,
    StoppedError,
)
from kochab.core.frame import Site
from kochab.core.mount import SIDEREAL_DEG_S, Ability, Direction, Epoch, Mount, MountState, Pointing, TrackingRate
from kochab.core.progress import Task
from kochab.gear.journal import MotionLog, utc_now
from kochab.gear.mounts.clock_and_site import ClockAndSite, wall_clock
from kochab.gear.mounts.coordinates import from_mount_epoch, reported_epoch, to_mount_epoch
from kochab.gear.mounts.emergency_stop import MAY_STILL_MOVE, EmergencyStop
from kochab.gear.mounts.last_seen import LastSeen
from kochab.gear.mounts.motion_plan import Limits, Plan, Preview, SyncEvidence
from kochab.gear.mounts.motion_policy import NUDGE_DEG, MotionPolicy, due_side
from kochab.gear.mounts.night_syncs import NightSyncs
from kochab.gear.mounts.slew_supervisor import SlewSupervisor, SupervisedMotion, allowed_region, anywhere, slew_limit_s
from kochab.gear.mounts.standing import LOOKS, Reading, seen_to_stand
from kochab.gear.mounts.sync_needed import SyncNeeded
from kochab.text.translation import tr, tr_noop

UNSTOPPED = tr_noop("KOCHAB CAN'T STOP THIS MOUNT'S TRACKING: stop it by hand.")
DOUBTFUL_SYNC = tr_noop(
    "The mount moved while it was synced, and whether it took the sync is not known: take a new frame. Nothing slews."
)
PATIENCE_S, RETRY_S = 20.0, 1.0  # to open a broken line again, and between two tries
COARSE_READ_BACK_ARCSEC = 240.0
SLEWS_DEG_S = 0.1  # the slowest slew that may run on
FAST_DEG_S = 4.0 * SIDEREAL_DEG_S  # what creeps more slowly shifts a sync by less than it is read back to
FASTER, OVERRUN = 4.0, 1.25  # multiples of the angle asked for: at an unknown rate; the overrun of any move
END_LOST_S = 2.0  # so long a move runs on whose end is lost, until it is seen to and is stopped again

T = TypeVar("T")


def _degrees(place: Pointing) -> Degrees:
    return place.ra_deg, place.dec_deg


def _in_minutes(place: Pointing) -> bool:
    """Whether a place is told in tenths of a minute of RA and whole minutes of declination."""
    return all(abs(units - round(units)) < 1e-5 for units in (place.ra_deg * 40.0, place.dec_deg * 60.0))


class FromDriver(Generic[T]):
    """A part of the :class:`~kochab.core.mount.Mount` protocol that the guard leaves to its driver.

    It is read at each use, because :meth:`Guard.reconnect` replaces the driver.
    """

    def __init__(self, read: Callable[[Mount], T]) -> None:
        self._read = read

    def __get__(self, guard: "Guard", owner: type) -> T:
        return self._read(guard.mount)


class Guard:
    """A mount whose motions are limited, supervised and ended.

    ``allow_large_sync`` allows one sync beyond the largest step. ``reopen`` opens the same mount again after
    the line was lost; see :meth:`reconnect`.
    """

    def __init__(
        self,
        mount: Mount,
        site: Site | None = None,
        limits: Limits | None = None,
        clock: Callable[[], datetime] = utc_now,
        log: MotionLog | None = None,
        reopen: Callable[[], Mount] | None = None,
        wait: Callable[[float], None] = sleep,
        syncs: NightSyncs | None = None,
        needed: SyncNeeded | None = None,
        last_seen: LastSeen | None = None,
    ) -> None:
        self.clock = clock
        self.syncs = syncs or NightSyncs(clock)
        self._before_sync: Degrees = (0.0, 0.0)  # the night's shift by hand, which undo restores
        self.log = log or MotionLog(clock=clock)
        self.allow_large_sync = False
        self.policy = MotionPolicy(site, limits or Limits(), clock, needed)
        self.emergency = EmergencyStop(mount, self.log, clock, wait)
        self.supervisor = SlewSupervisor(self.emergency, self.log, self.policy, last_seen)
        on_trust = partial(_trusted, self.emergency, self.supervisor, self.policy)  # a bound method keeps self alive
        self.clock_and_site = ClockAndSite(self.policy, self.supervisor.restarted, on_trust)
        self.supervisor.watch.on_restart = self.clock_and_site.reconnected
        self.supervisor.watch.sidereal_deg = self.clock_and_site.sidereal_deg
        self._reopen = reopen
        self._finalizer = weakref.finalize(self, self.emergency.at_exit)  # a bound method would keep self alive

    # -- questions ------------------------------------------------------------------------------

    @property
    def site(self) -> Site | None:
        """The site of the mount, for the horizon and the meridian."""
        return self.policy.site

    @site.setter
    def site(self, site: Site | None) -> None:
        self.policy.site = site
        self.clock_and_site.forget()

    @property
    def limits(self) -> Limits:
        """What its motions may do."""
        return self.policy.limits

    @limits.setter
    def limits(self, limits: Limits) -> None:
        self.policy.limits = limits

    @property
    def mount(self) -> Mount:
        """The driver behind the guard; only for questions."""
        return self.emergency.mount

    name = FromDriver(lambda driver: driver.name)
    epoch = FromDriver(lambda driver: driver.epoch)
    lacks = FromDriver(lambda driver: driver.lacks)
    blind_stop = FromDriver(lambda driver: driver.blind_stop)
    ends_alone = FromDriver(lambda driver: driver.ends_alone)
    rates_deg_s = FromDriver(lambda driver: driver.rates_deg_s)
    lag_s = FromDriver(lambda driver: driver.lag_s)
    missed = FromDriver(lambda driver: driver.missed)
    identify = FromDriver(lambda driver: driver.identify)
    altaz_deg = FromDriver(lambda driver: driver.altaz_deg)
    park_altitude_deg = FromDriver(lambda driver: driver.park_altitude_deg)
    site_report = FromDriver(lambda driver: driver.site_report)

    def position(self) -> Pointing:
        """Where it says it points; `StrayedError` when it left its path and was stopped."""
        return self.supervisor.position()

    def position_icrs(self) -> tuple[float, float]:
        """Where it says it points, ICRS degrees."""
        return from_mount_epoch(self.position(), self.clock())

    def state(self) -> MountState:
        """State of the mount; while it moves its position is checked, too."""
        return self.supervisor.state()

    def to_mount(self, ra_deg: float, dec_deg: float) -> tuple[float, float]:
        """ICRS degrees in the mount's epoch, now."""
        return to_mount_epoch(ra_deg, dec_deg, self.epoch, self.clock())

    def rate_deg_s(self, wanted_deg_s: float) -> float:
        """The rate the mount would really use, when its driver reports its rates."""
        return min(self.rates_deg_s, key=lambda r: abs(r - wanted_deg_s), default=wanted_deg_s)

    def epoch_doubt(self) -> str:
        """One sentence when the mount's own altitude and azimuth speak for the other epoch."""
        found = reported_epoch(self.mount)
        if found is None or found is self.epoch:
            return ""
        if found is Epoch.J2000:
            return tr("The mount's altitude and azimuth are of J2000, not of date. Choose J2000 (--epoch J2000).")
        return tr("The mount's altitude and azimuth are of date, not J2000. Choose the epoch date (--epoch date).")

    def clock_doubt(self) -> str:
        """What the mount's own clock and site contradict of the computer's; empty when nothing, or nothing is told."""
        return self.clock_and_site.ask(self.mount)

    def set_clock(self, now: datetime | None = None) -> None:
        """Set the mount's clock to the computer's, only when a person asks for it."""
        self._set(Ability.SET_CLOCK, lambda: self.mount.set_clock(wall_clock(now or self.clock())))

    def set_site(self, site: Site | None = None) -> None:
        """Set the mount's site to the one used here."""
        if (wanted := site or self.site) is None:
            self._refuse("set site", tr("No site set: set your site first."))
        self._set(Ability.SET_SITE, lambda: self.mount.set_site(wanted))

    def _set(self, ability: Ability, do: Callable[[], None]) -> None:
        """A mount whose position has moved with its clock must be synced before it slews."""
        self._require_ability(ability)
        if self._settled_state().slewing or self.emergency.moving:
            self._refuse(str(ability), tr("The mount is moving: stop it first."))
        self.position()  # it may show that the mount was switched off and on
        self.clock_and_site.compare(self.mount)  # with the clock of before, while it can tell of a restart
        self.supervisor.forget()  # a new clock or site may shift the position: no jump
        self.supervisor.undo = None
        before = self.position()
        self._send(str(ability), 0.0, do)
        self.clock_and_site.shifted(before, self.position())
        self.log.add(str(ability), "done", self.policy.slew_block_reason)
        self.clock_and_site.ask(self.mount)
        if ability in self.clock_and_site.wrong:
            self._refuse(str(ability), tr("The mount did not take it. {why}", why=self.policy.clock_conflict))

    # -- syncs: on evidence, read back, and taken back on request -------------------------------

    def preview_sync(
        self, ra_deg: float, dec_deg: float, evidence: SyncEvidence | None = None, by_hand: bool = False
    ) -> Preview:
        """What a sync to the mount's own coordinates would do; nothing changes.

        Parameters
        ----------
        ra_deg, dec_deg : float
            The place, degrees in the mount's epoch.
        evidence : SyncEvidence or None
            The solves that it rests on; None: none.
        by_hand : bool
            Whether it is the user's word.
        """
        self.clock_and_site.compare(self.mount)
        state, shift = self._settled_state(), self.syncs.shift_deg
        return self.policy.sync(
            self.position(), state, (ra_deg, dec_deg), evidence, by_hand, self.allow_large_sync, shift
        )

    def sync(
        self,
        ra_deg: float,
        dec_deg: float,
        evidence: SyncEvidence | None = None,
        *,
        by_hand: bool = False,
        confirmed: bool = False,
    ) -> None:
        """Sync on two agreeing solves, or on the user's word, and read it back.

        Raises `RefusedError` when a rule forbids it, it needs confirmation, or the mount did not take it: then an
        offset slew does the same without a sync.

        Parameters
        ----------
        ra_deg, dec_deg : float
            The place, degrees in the mount's epoch.
        evidence : SyncEvidence or None
            The solves that it rests on; None: none.
        by_hand : bool
            Whether it is the user's word.
        confirmed : bool
            Whether the user has confirmed what the preview asks.
        """
        self._require_ability(Ability.SYNC)
        here = self._require_rest()
        preview = self.preview_sync(ra_deg, dec_deg, evidence, by_hand)
        self._require_allowed(preview, confirmed)
        guessed = self.state().home_confirmed is False  # asked before the sync, which confirms it
        self._sync(here, ra_deg, dec_deg)
        shift = (wrapped(preview.from_deg[0] - ra_deg), preview.from_deg[1] - dec_deg)
        # A guess is nothing to go back to; what called for this sync does so again once it is taken back.
        self.supervisor.undo = None if guessed else (shift, self.policy.slew_block_reason)
        self._before_sync = self.syncs.shift_deg
        if by_hand and not self.allow_large_sync:
            self.syncs.add(-shift[0], -shift[1])
        else:
            self.syncs.settle()
        self.allow_large_sync, self.policy.slew_block_reason = False, ""

    @property
    def can_undo(self) -> bool:
        """Whether there is a sync to take back."""
        return self.supervisor.undo is not None

    def undo_sync(self) -> None:
        """Take back the last sync, wherever the mount has gone since."""
        self.position()  # first: it may show that the mount was switched off and on
        if self.supervisor.undo is None:
            raise RefusedError("No sync to undo.")
        here = self._require_rest()
        shift, slew_block_reason = self.supervisor.undo
        ra = (here.ra_deg + shift[0]) % 360.0
        dec = min(90.0, max(-90.0, here.dec_deg + shift[1]))
        self._require_allowed(
            self.policy.sync(here, self.state(), (ra, dec), by_hand=True, allow_large_sync=True), True
        )
        self._sync(here, ra, dec)
        self.supervisor.undo, self.policy.slew_block_reason = None, slew_block_reason
        self.syncs.keep(self._before_sync)

    def _require_rest(self) -> Pointing:
        """Where the tube stands: a sync while it runs out of a motion would be of another place."""
        here, stands = self._place_of_rest()
        if not stands:
            self._refuse("sync", tr("The telescope is still moving: wait until it stands, then sync."))
        return here

    def _settled_state(self) -> MountState:
        """The state; a mount that does not say whether it moves is looked at twice."""
        state = self.state()
        if state.slewing is None:
            state = replace(state, slewing=not self._place_of_rest(looks=2)[1])
        return state

    def _place_of_rest(self, looks: int = LOOKS) -> tuple[Pointing, bool]:
        """The last position, and whether the tube stands there."""
        seen, stands = seen_to_stand(self._read, self.emergency.wait, looks, slowest_deg_s=FAST_DEG_S, lag_s=self.lag_s)
        return seen[-1].here, stands  # a missed answer raises

    def _read(self) -> Reading:
        asked_s, asked = monotonic(), self.clock()
        return Reading(self.position(), asked_s, asked, answered_s=monotonic())

    def _sync(self, before: Pointing, ra_deg: float, dec_deg: float) -> None:
        self.supervisor.forget()  # the end of a pulse may still be waited for: this is no jump
        silent: NoAnswerError | None = None
        try:
            self._send("sync", 0.0, lambda: self.mount.sync(ra_deg, dec_deg), ra_deg=ra_deg, dec_deg=dec_deg)
        except NoAnswerError as error:  # an old Autostar answers with the next command: its position tells
            silent = error
        except StoppedError:
            raise
        except RefusedError as error:  # a garbled answer to a sync that was taken says the same
            if 3600.0 * apart_deg(_degrees(self.position()), _degrees(before)) > self.limits.read_back_arcsec:
                raise NoAnswerError("{error} {doubt}", error=error, doubt=tr(DOUBTFUL_SYNC)) from error
            raise
        here = self.position()
        away = 3600.0 * apart_deg(_degrees(here), (ra_deg, dec_deg))
        # A StarBook cuts off what it tells, and INDI what it sends: two minutes of Dec and two tenths of RA together.
        coarse = _in_minutes(before) and _in_minutes(here)
        if away > (COARSE_READ_BACK_ARCSEC if coarse else self.limits.read_back_arcsec):
            if silent is not None:
                raise silent
            # Only a position that stands where it stood shows that nothing was taken.
            here, stands = self._place_of_rest()
            if not stands or 3600.0 * apart_deg(_degrees(here), _degrees(before)) > self.limits.read_back_arcsec:
                self.log.add("sync", "failed", tr(DOUBTFUL_SYNC))
                raise NoAnswerError(DOUBTFUL_SYNC)
            sentence = tr("The mount ignored the sync, still off by {away:.1f}′. Slew by the offset.", away=away / 60.0)
            self.log.add("sync", "failed", sentence)
            raise RefusedError(sentence)
        self.log.add("sync", "done", detail={"read_back_arcsec": away})

    # -- motions --------------------------------------------------------------------------------

    def preview_goto(self, ra_deg: float, dec_deg: float) -> Preview:
        """What a goto to the mount's own coordinates would do; nothing moves."""
        return self.policy.goto(*self._look(), (ra_deg, dec_deg))[1]

    def _look(self) -> tuple[Pointing, MountState]:
        """Where and how it is, its clock and site compared; once more when it fell silent meanwhile."""
        for _ in range(2):
            missed = self.missed
            self.clock_and_site.compare(self.mount)
            here, state = self.position(), self._settled_state()
            if missed == self.missed:
                break
        return here, state

    def goto(self, ra_deg: float, dec_deg: float) -> None:
        """Begin a slew that every rule allows; see :meth:`slew` for one that is waited for."""
        self._begin_slew(ra_deg, dec_deg)

    def slew(self, ra_deg: float, dec_deg: float, flip: bool = False) -> Task[Pointing]:
        """Go to the mount's own coordinates and wait until it is there, by a ``flip`` that a person has asked for.

        The mount is stopped when it takes too long, does not answer, leaves its path or the
        limits, or when the task is cancelled or fails.
        """
        stops = self.stops
        plan = self._begin_slew(ra_deg, dec_deg, flip)
        arrival = self.supervisor.arrival((ra_deg, dec_deg), slew_limit_s(plan), stops, due_side(plan, flip))
        return (yield from self._finish("goto", arrival))

    def preview_rest(self, action: str) -> Preview:
        """What ``park`` or ``home`` would do; nothing moves."""
        return self.policy.rest(action, self.position(), self._settled_state(), self.park_altitude_deg())[1]

    def park(self) -> None:
        """Begin to go to the mount's park position; see :meth:`rest` for one that is waited for."""
        self._begin_rest("park", self.stops)

    def go_home(self) -> None:
        """Begin to go to the mount's home."""
        self._begin_rest("home", self.stops)

    def rest(self, action: str) -> Task[None]:
        """``park`` or ``home``, and wait until the mount reports to be there; as careful as :meth:`slew`."""
        stops = self.stops
        if self.state().parked and action == "park":
            return
        self._begin_rest(action, stops)
        yield from self._finish(action, self.supervisor.rest(action, self.limits.slew_timeout_s, stops))
        self.supervisor.watch.came_to_rest()
        if self.policy.restarted:  # it has gone where it believes to rest
            why = self.policy.slew_block_reason
            if action == "park":
                raise RefusedError("The mount says that it is parked. {why}", why=why)
            raise RefusedError("The mount says that it is home. {why}", why=why)

    def unpark(self) -> None:
        """Unpark it, so that it can move again."""
        self._require_ability(Ability.UNPARK)
        self._send("unpark", 0.0, self.mount.unpark)
        if self.state().parked:
            self._refuse("unpark", tr("The mount still reports that it is parked: unpark it on its hand control."))

    def _begin_rest(self, action: str, stops: int) -> None:
        self._require_ability(Ability.PARK if action == "park" else Ability.HOME)
        plan, preview = self.policy.rest(action, self.position(), self._settled_state(), self.park_altitude_deg())
        self._require_allowed(preview, confirmed=True)
        send = self.mount.park if action == "park" else self.mount.go_home
        motion = SupervisedMotion(plan, anywhere())
        self._send(action, self.limits.slew_timeout_s, send, motion, stops, SLEWS_DEG_S)

    def _finish(self, action: str, arrival: Task[T]) -> Task[T]:
        """Wait for the end of a motion, which is stopped when it does not come."""
        ended, restarts = False, self.supervisor.watch.restarts
        try:
            result = yield from arrival
            ended = True
        except LineLostError:  # reconnect() sends its Stop
            self.emergency.unfinished = True
            raise
        except NoAnswerError as error:
            ended = True
            self.halt()
            raise self.supervisor.after_silence(error, restarts) from error
        finally:
            if not ended:
                self.halt()
        self.emergency.end()
        self.emergency.came_to_rest()
        self.log.add(action, "done")
        return result

    def pulse(self, direction: Direction, milliseconds: int) -> None:
        """Guide for a bounded time."""
        self._require_ability(Ability.PULSE)
        stops, longest = self.stops, self.limits.longest_pulse_ms  # before the questions below: a Stop meanwhile wins
        if not 0 < milliseconds <= longest:
            self._refuse("pulse", tr("A guide pulse is out of range: 1 to {most} ms.", most=longest))
        seconds = milliseconds / 1000.0
        self._send(
            "pulse",
            seconds + 0.5,
            lambda: self.mount.pulse(direction, milliseconds),
            self._allowed_move("pulse", direction, 0.008, seconds),  # 1.9 times the sidereal rate
            stops,
            direction=str(direction),
            milliseconds=milliseconds,
        )

    def move(self, direction: Direction, rate_deg_s: float, seconds: float) -> None:
        """Move for a bounded time, over a bounded angle."""
        self._require_ability(Ability.MOVE)
        stops, rate = self.stops, self.rate_deg_s(rate_deg_s)
        longest_s, longest_deg = self.limits.longest_move_s, self.limits.longest_move_deg
        if not 0.0 < seconds <= longest_s:
            self._refuse("move", tr("A move is out of range: at most {most:g} s.", most=longest_s))
        if not 0.0 < rate * seconds <= longest_deg:
            self._refuse("move", tr("A move is out of range: at most {most:g}°.", most=longest_deg))
        self._send(
            "move",
            seconds + 2.0,  # and the time the motors take to stop
            lambda: self.mount.move(direction, rate_deg_s, seconds),
            self._allowed_move("move", direction, rate, seconds),
            stops,
            rate / (2.0 if self.rates_deg_s else FASTER),
            direction=str(direction),
            rate_deg_s=rate,
            seconds=seconds,
        )

    def track(self, rate: TrackingRate) -> None:
        """Track at this rate, or stop tracking."""
        self._require_ability(rate.ability)
        if rate is not TrackingRate.OFF:
            state = self.state()
            if state.parked:
                self._refuse("track", tr("The mount is parked: unpark it before it tracks."))
            if reason := self.policy.tracking(self.position(), state):
                self._refuse("track", reason)
        self._send("track", 0.0, lambda: self.mount.track(rate), rate=str(rate))

    def hold_limits(self) -> str:
        """Stop tracking that has come to a limit, with no motion asked; why, empty while all is well."""
        state = self.state()
        if not state.tracking or state.slewing or state.parked or self.emergency.moving:
            return ""
        reason = self.policy.tracking(self.position(), state)
        if not reason:
            return ""
        try:
            self._require_ability(Ability.TRACKING)
            self.mount.track(TrackingRate.OFF)
            outcome, reason = "done", tr("Kochab stopped the tracking. {reason}", reason=reason)
        except RefusedError:
            outcome, reason = "failed", f"{tr(UNSTOPPED)} {reason}"
        self.log.add("track", outcome, reason)
        return reason

    def tracking_left_s(self) -> float | None:
        """How long it may track on, to a quarter of an hour; None when it does not track, or half a day and more."""
        state, here = self.state(), self.position()
        ends = (900.0 * quarter for quarter in range(1, 49))
        return next((s for s in ends if state.tracking and self.policy.tracking(here, state, s)), None)

    def _begin_slew(self, ra_deg: float, dec_deg: float, flip: bool = False) -> Plan:
        """Send a goto."""
        self._require_ability(Ability.GOTO)
        stops = self.stops  # before the questions, which take seconds: a Stop meanwhile wins
        plan, preview = self.policy.goto(*self._look(), (ra_deg, dec_deg), flip)
        self._require_allowed(preview, confirmed=True)
        motion = SupervisedMotion(plan, allowed_region(plan))
        goto = partial(self.mount.goto, ra_deg, dec_deg)
        self._send("goto", inf, goto, motion, stops, SLEWS_DEG_S, ra_deg=ra_deg, dec_deg=dec_deg)
        return plan

    def _allowed_move(self, action: str, direction: Direction, rate_deg_s: float, seconds: float) -> SupervisedMotion:
        """Check where a move or pulse ends at the latest, also at a rate that is not known; what is then supervised."""
        known = bool(self.rates_deg_s) or action == "pulse"
        if (angle := rate_deg_s * seconds * (1.0 if known else FASTER)) > NUDGE_DEG:
            self.clock_and_site.compare(self.mount)
        state = self._settled_state() if angle > NUDGE_DEG else self.state()
        here = self.position()
        # The mount ends a pulse itself; the bytes that end a move can be lost.
        farthest = max(angle, rate_deg_s * (seconds + END_LOST_S)) if action == "move" else angle
        plan, preview, region = self.policy.move(action, here, state, direction, angle, farthest, OVERRUN)
        self._require_allowed(preview, confirmed=True)
        return SupervisedMotion(plan, region, known)

    # -- stop, reconnect, close -----------------------------------------------------------------

    @property
    def stops(self) -> int:
        """How often the user has stopped everything; see :meth:`check_not_stopped`."""
        return self.emergency.stops

    def stop(self) -> None:
        """The user's Stop: now, ahead of everything, from any thread; tried twice."""
        self.emergency.stop()

    def halt(self) -> None:
        """The same, for the program's own reasons, such as a slew that failed."""
        self.emergency.halt()

    def check_not_stopped(self, stops: int, what: str) -> None:
        """Raise when the motion ``what`` that began at the count ``stops`` was stopped since."""
        self.supervisor.check_not_stopped(stops, what)

    def reconnect(self) -> None:
        """Open the line again and, first of all, stop what was moving; repeat no motion."""
        if self._reopen is None:
            raise LineLostError("Connection to the mount lost. Reconnect.")
        self.supervisor.reconnecting()
        self.clock_and_site.reconnected()
        self.emergency.reconnect(self._reopen)

    def see_stopped(self) -> str:
        """As :meth:`EmergencyStop.see_stopped`."""
        return self.emergency.see_stopped()

    def stop_on_new_line(self, patience_s: float = PATIENCE_S) -> None:
        """The line broke in a motion: open it again, send Stop and see that the mount stands.

        Raises `NotStoppedError` when that could not be done in ``patience_s``, or the mount moves on.
        """
        end = monotonic() + (patience_s if self._reopen is not None else 0.0)
        self.emergency.unfinished = True
        while True:
            try:
                self.reconnect()
                self.emergency.confirm()
                self.position()  # it may show that the mount was switched off and on
                return
            except NotStoppedError:
                raise
            except DeviceError as error:
                if monotonic() >= end:
                    raise NotStoppedError("{may} {error}", may=tr(MAY_STILL_MOVE), error=error) from error
            self.emergency.wait(RETRY_S)

    def close(self) -> None:
        """Stop what moves, see that it stands, and give the port back; never raises, see :meth:`see_stopped`."""
        with suppress(DeviceError):
            try:
                self.see_stopped()
            except NotStoppedError:
                raise
            except LineLostError:
                self.stop_on_new_line()
        self._leave()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if not isinstance(error, LineLostError):  # a lost line answers nothing
                self.see_stopped()
            elif self.emergency.moving:
                with suppress(DeviceError):
                    self.stop()
        finally:
            self._leave()

    def _leave(self) -> None:
        self._finalizer.detach()
        self.mount.close()
        self.supervisor.watch.close(self.mount, self.emergency.unfinished)

    # -- sending --------------------------------------------------------------------------------

    def _require_ability(self, ability: Ability) -> None:
        if ability in self.lacks:
            raise RefusedError(self.lacks[ability])

    def _require_allowed(self, preview: Preview, confirmed: bool) -> None:
        if preview.refusals:
            self._refuse(preview.action, preview.refusals[0])
        if preview.confirmations and not confirmed:
            self._refuse(preview.action, preview.confirmations[0])

    def _refuse(self, action: str, sentence: str) -> NoReturn:
        self.log.add(action, "refused", sentence)
        raise RefusedError(sentence)

    def _send(
        self,
        action: str,
        lasts_s: float,
        do: Callable[[], None],
        motion: SupervisedMotion | None = None,
        stops: int | None = None,
        slowest_deg_s: float = 0.0,
        **detail: float | str,
    ) -> None:
        """Send once, not after a Stop since the count ``stops``; stop when the reply does not show what it does."""
        missed, unseen = self.missed, self.emergency.unseen
        self.log.add(action, "sent", detail=detail)
        if action != "sync":  # a sync moves nothing, so an earlier Stop still needs its check
            self.emergency.expect_motion()
        if lasts_s:
            self.supervisor.begin(motion)  # before the bytes: from now on every position is checked against it
            self.emergency.begin(lasts_s, slowest_deg_s)
        try:
            if stops is not None:  # the questions before it took time, in which a Stop may have come
                self.check_not_stopped(stops, action)
            do()
        except RefusedError as error:
            if lasts_s:
                self.emergency.end()
                if isinstance(error, NotSentError) and not unseen:  # the session's end has nothing to see
                    self.emergency.came_to_rest()
            self.log.add(action, "failed", str(error))
            if missed != self.missed:  # meanwhile it may have been switched off and on: the next program must know
                with suppress(NoAnswerError):
                    self.position()
            raise
        except DeviceError as error:  # no answer: the motion may have begun all the same
            try:
                if lasts_s:
                    self.emergency.finish()
            finally:  # afterwards: a slow disk must not delay a Stop
                self.log.add(action, "failed", str(error))
            raise


def _trusted(emergency: EmergencyStop, supervisor: SlewSupervisor, policy: MotionPolicy) -> None:
    """A person says that the mount is right; behind a server, after a restart, it is told time and place again.

    A server tells them as it connects, and not a mount that woke up since: an M-Uno, which keeps no clock, then takes
    the sidereal time for 0 h, and looks right at its home alone.
    """
    supervisor.watch.trust()
    mount = emergency.mount
    if not (policy.restarted and mount.lag_s):
        return
    supervisor.forget()  # the position may shift: no jump
    if policy.site is not None and Ability.SET_SITE not in mount.lacks:
        mount.set_site(policy.site)
    if Ability.SET_CLOCK not in mount.lacks:
        mount.set_clock(wall_clock(policy.clock()))
