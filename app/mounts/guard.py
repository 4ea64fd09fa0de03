"""The guard: a mount that moves and syncs only within its limits.

Whoever moves a mount holds it through a :class:`Guard`. It is itself a
:class:`~app.core.mount.Mount`; every motion is planned, judged by :mod:`app.mounts.rules`, written
into a log, and ended when something goes wrong. Time and site are never sent to a mount.
"""

import weakref
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from math import inf
from time import sleep
from types import TracebackType

from app.core.errors import DeviceError, LineLostError, NoAnswerError, RefusedError
from app.core.hint import Site
from app.core.mount import Ability, Direction, Epoch, Mount, MountState, Pointing
from app.core.progress import Task
from app.mounts.arrival import arrival
from app.mounts.beliefs import Beliefs
from app.mounts.epoch import from_mount_epoch, to_mount_epoch
from app.mounts.limits import Limits, SyncEvidence
from app.mounts.motion import Motion, stop_at_exit
from app.mounts.motion_log import MotionLog, utc_now
from app.mounts.planning import here_deg, planned, with_move, with_ways
from app.mounts.preview import Preview, preview_of
from app.mounts.rules import MOTION_RULES, MOVE_RULES, SYNC_RULES, Plan
from app.mounts.sky_frame import apart_deg, wrapped

CANNOT_STOP = "The mount cannot be stopped over its line: cut its power."


class Guard:
    """A :class:`~app.core.mount.Mount` whose motions are watched.

    ``armed`` allows one sync beyond the largest step. ``reopen`` opens the same mount again after
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
    ) -> None:
        self.site = site
        self.limits = limits or Limits()
        self.clock = clock
        self.log = log or MotionLog(clock=clock)
        self.armed = False
        self.stops = 0  # by a person: what was asked for before a Stop is not gone on with
        self.unfinished = False  # a motion was under way when the line broke
        self._reopen = reopen
        self._wait = wait
        self._before_sync: tuple[float, float] | None = None
        self._motion = Motion(mount)
        self._finalizer = weakref.finalize(self, stop_at_exit, self._motion)

    # -- what only asks -------------------------------------------------------------------------

    @property
    def mount(self) -> Mount:
        """The driver behind the guard; only to ask it."""
        return self._motion.mount

    @property
    def name(self) -> str:
        """The driver's."""
        return self.mount.name

    @property
    def epoch(self) -> Epoch:
        """Of every coordinate of the :class:`~app.core.mount.Mount` calls."""
        return self.mount.epoch

    @property
    def lacks(self) -> Mapping[Ability, str]:
        """What the mount cannot do, each with the reason."""
        return self.mount.lacks

    def identify(self) -> str:
        """The mount's own name and version."""
        return self.mount.identify()

    def position(self) -> Pointing:
        """Where it says it points."""
        return self.mount.position()

    def position_icrs(self) -> tuple[float, float]:
        """Where it says it points, ICRS degrees."""
        return from_mount_epoch(self.position(), self.clock())

    def state(self) -> MountState:
        """How it is; a slew that was begun by :meth:`goto` is then known to have ended."""
        state = self.mount.state()
        if state.slewing is False and self._motion.until == inf:
            self._motion.end()
        return state

    def beliefs(self) -> Beliefs:
        """What the mount believes of its place and time; empty when its driver cannot ask."""
        ask: Callable[[], Beliefs] = getattr(self.mount, "beliefs", Beliefs)
        return ask()

    # -- previews -------------------------------------------------------------------------------

    def preview_goto(self, ra_deg: float, dec_deg: float) -> Preview:
        """What a goto to the mount's own coordinates would do; nothing moves."""
        here = self.position()
        plan = with_ways(self._plan("goto", here, (ra_deg, dec_deg)))
        return preview_of(plan, here_deg(here), (ra_deg, dec_deg), MOTION_RULES)

    def preview_sync(
        self,
        ra_deg: float,
        dec_deg: float,
        evidence: SyncEvidence | None = None,
        by_hand: bool = False,
    ) -> Preview:
        """What a sync would do; nothing changes."""
        here = self.position()
        plan = self._plan("sync", here, (ra_deg, dec_deg))
        plan = replace(plan, evidence=evidence, by_hand=by_hand, armed=self.armed)
        return preview_of(plan, here_deg(here), (ra_deg, dec_deg), SYNC_RULES)

    def to_mount(self, ra_deg: float, dec_deg: float) -> tuple[float, float]:
        """ICRS degrees in the mount's epoch, now."""
        return to_mount_epoch(ra_deg, dec_deg, self.epoch, self.clock())

    # -- motions --------------------------------------------------------------------------------

    def goto(self, ra_deg: float, dec_deg: float) -> None:
        """Begin a slew that every rule allows; see :meth:`slew` for one that is watched."""
        self._able(Ability.GOTO)
        self._require(self.preview_goto(ra_deg, dec_deg), confirmed=True)
        self._send(
            "goto",
            inf,
            lambda: self.mount.goto(ra_deg, dec_deg),
            ra_deg=ra_deg,
            dec_deg=dec_deg,
        )

    def slew(self, ra_deg: float, dec_deg: float) -> Task[Pointing]:
        """Go to the mount's own coordinates and stay until it is there.

        The mount is stopped when it takes too long, does not answer, leaves the limits, or when
        the task is cancelled or fails.
        """
        self.goto(ra_deg, dec_deg)
        there = False
        try:
            result = yield from arrival(self, (ra_deg, dec_deg), self._wait)
            there = True
        except LineLostError:
            self.unfinished = True
            raise
        finally:
            if not there:
                self.halt()
        self._motion.end()
        self.log.add("goto", "done")
        return result

    def slew_icrs(self, ra_deg: float, dec_deg: float) -> Task[Pointing]:
        """:meth:`slew` to ICRS degrees."""
        return (yield from self.slew(*self.to_mount(ra_deg, dec_deg)))

    def pulse(self, direction: Direction, milliseconds: int) -> None:
        """Guide for a bounded time."""
        self._able(Ability.PULSE)
        longest = self.limits.longest_pulse_ms
        if not 0 < milliseconds <= longest:
            self._refuse("pulse", f"A pulse of {milliseconds} ms is refused: 1 to {longest} ms.")
        self._bounded("pulse", direction, 0.008, milliseconds / 1000.0)
        self._send(
            "pulse",
            milliseconds / 1000.0 + 0.5,
            lambda: self.mount.pulse(direction, milliseconds),
            direction=str(direction),
            milliseconds=milliseconds,
        )

    def move(self, direction: Direction, rate_deg_s: float, seconds: float) -> None:
        """Move for a bounded time, over a bounded angle."""
        self._able(Ability.MOVE)
        rate = self._true_rate(rate_deg_s)
        limits = self.limits
        if not 0.0 < seconds <= limits.longest_move_s:
            allowed = f"at most {limits.longest_move_s:g} s are allowed."
            self._refuse("move", f"A move of {seconds:g} s is refused: {allowed}")
        if not 0.0 < rate * seconds <= limits.longest_move_deg:
            allowed = f"at most {limits.longest_move_deg:g} deg are allowed."
            self._refuse("move", f"A move of {rate * seconds:.1f} deg is refused: {allowed}")
        self._bounded("move", direction, rate, seconds)
        self._send(
            "move",
            seconds + 2.0,
            lambda: self.mount.move(direction, rate_deg_s, seconds),
            direction=str(direction),
            rate_deg_s=rate,
            seconds=seconds,
        )

    def track(self, on: bool) -> None:
        """Sidereal tracking on or off."""
        self._able(Ability.TRACKING)
        if on and self.state().parked:
            self._refuse("track", "The mount is parked: unpark it before it tracks.")
        self._send("track", 0.0, lambda: self.mount.track(on), on=int(on))

    def stop(self) -> None:
        """A person's Stop: now, ahead of everything, from any thread; tried twice."""
        self.stops += 1
        self.halt()

    def halt(self) -> None:
        """The same for a reason of one's own, such as a slew that failed."""
        self.log.add("stop", "sent")
        try:
            try:
                self.mount.stop()
            except NoAnswerError:
                self.mount.stop()
        except DeviceError as error:
            self.unfinished = self.unfinished or self._motion.possible
            self.log.add("stop", "failed", CANNOT_STOP)
            raise LineLostError(f"{CANNOT_STOP} ({error})") from error
        self._motion.end()

    # -- syncs ----------------------------------------------------------------------------------

    def sync(
        self,
        ra_deg: float,
        dec_deg: float,
        evidence: SyncEvidence | None = None,
        *,
        by_hand: bool = False,
        confirmed: bool = False,
    ) -> None:
        """Sync on two agreeing solves, or ``by_hand`` on a person's word, and read it back.

        Raises
        ------
        RefusedError
            A rule forbids it, it needs a yes (``confirmed``), or the mount did not take it:
            then an offset slew does the same without a sync.

        """
        self._able(Ability.SYNC)
        preview = self.preview_sync(ra_deg, dec_deg, evidence, by_hand)
        self._require(preview, confirmed)
        self._sync(ra_deg, dec_deg)
        shift = (wrapped(preview.from_deg[0] - ra_deg), preview.from_deg[1] - dec_deg)
        self._before_sync = shift
        self.armed = False

    def sync_icrs(
        self,
        ra_deg: float,
        dec_deg: float,
        evidence: SyncEvidence | None = None,
        *,
        by_hand: bool = False,
        confirmed: bool = False,
    ) -> None:
        """:meth:`sync` on ICRS degrees."""
        ra, dec = self.to_mount(ra_deg, dec_deg)
        self.sync(ra, dec, evidence, by_hand=by_hand, confirmed=confirmed)

    @property
    def can_undo(self) -> bool:
        """Whether there is a sync to take back."""
        return self._before_sync is not None

    def undo_sync(self) -> None:
        """Take back the last sync, wherever the mount has gone since."""
        if self._before_sync is None:
            raise RefusedError("There is no sync to take back.")
        here = self.position()
        ra = (here.ra_deg + self._before_sync[0]) % 360.0
        dec = min(90.0, max(-90.0, here.dec_deg + self._before_sync[1]))
        plan = self._plan("sync", here, (ra, dec))
        self._require(
            preview_of(
                replace(plan, by_hand=True, armed=True),
                here_deg(here),
                (ra, dec),
                SYNC_RULES,
            ),
            confirmed=True,
        )
        self._sync(ra, dec)
        self._before_sync = None

    # -- the end of things ----------------------------------------------------------------------

    def reconnect(self) -> None:
        """Open the line again and, first of all, stop what was moving; repeat no motion."""
        if self._reopen is None:
            raise LineLostError("The line to the mount is lost: connect to it again.")
        self.mount.close()
        self._motion.mount = self._reopen()
        if self.unfinished or self._motion.possible:
            self.halt()
            self.unfinished = False

    def close(self) -> None:
        """Stop what moves and give the port back; never raises."""
        if self._motion.possible:
            with suppress(DeviceError):
                self.stop()
        self._finalizer.detach()
        self.mount.close()

    def __enter__(self) -> "Guard":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    # -- inside ---------------------------------------------------------------------------------

    def _plan(self, action: str, here: Pointing, to_deg: tuple[float, float]) -> Plan:
        return planned(action, here, to_deg, self.state(), self.limits, self.clock(), self.site)

    def _bounded(self, action: str, direction: Direction, rate: float, seconds: float) -> None:
        """Judge where a move or pulse ends at the latest."""
        here = self.position()
        plan = with_move(self._plan(action, here, here_deg(here)), direction, rate * seconds)
        preview = preview_of(plan, plan.start_deg, plan.target_deg, MOVE_RULES)
        self._require(preview, confirmed=True)

    def _true_rate(self, rate_deg_s: float) -> float:
        """The rate the mount would really use, when its driver tells its rates."""
        rates: tuple[float, ...] = getattr(self.mount, "rates_deg_s", ())
        return min(rates, key=lambda r: abs(r - rate_deg_s)) if rates else rate_deg_s

    def _able(self, ability: Ability) -> None:
        reason = self.lacks.get(ability)
        if reason is not None:
            raise RefusedError(reason)

    def _require(self, preview: Preview, confirmed: bool) -> None:
        if preview.refusals:
            self._refuse(preview.action, preview.refusals[0])
        if preview.confirmations and not confirmed:
            self._refuse(preview.action, preview.confirmations[0])

    def _refuse(self, action: str, sentence: str) -> None:
        self.log.add(action, "refused", sentence)
        raise RefusedError(sentence)

    def _send(
        self, action: str, lasts_s: float, do: Callable[[], None], **detail: float | str
    ) -> None:
        """Send once. When it is not known what the mount made of it, stop; never repeat."""
        self.log.add(action, "sent", detail=detail)
        if lasts_s:
            self._motion.begin(lasts_s)
        try:
            do()
        except RefusedError as error:
            if lasts_s:
                self._motion.end()
            self.log.add(action, "failed", str(error))
            raise
        except DeviceError as error:
            self.log.add(action, "failed", str(error))
            if lasts_s:
                self.unfinished = True
                self.halt()
                self.unfinished = False
            raise

    def _sync(self, ra_deg: float, dec_deg: float) -> None:
        self._send(
            "sync", 0.0, lambda: self.mount.sync(ra_deg, dec_deg), ra_deg=ra_deg, dec_deg=dec_deg
        )
        here = self.position()
        away = 3600.0 * apart_deg(here_deg(here), (ra_deg, dec_deg))
        if away > self.limits.read_back_arcsec:
            sentence = (
                f"The mount did not take the sync, it still points {away / 60.0:.1f} arcmin from "
                "there: use an offset slew instead."
            )
            self.log.add("sync", "failed", sentence)
            raise RefusedError(sentence)
        self.log.add("sync", "done", detail={"read_back_arcsec": away})
