"""The telescope that planetarium programs see: where it points, and what becomes of their orders.

It points where the newest solved frame says, or the mount. A goto goes to the mount through its guard, as everybody's
does; without a mount, or without leave to move it, it is the target that a person pushes the telescope to.
"""

import threading
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from datetime import datetime
from functools import partial
from time import monotonic
from typing import Any, Protocol

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import Degrees, apart_deg, radec_deg, unit_vectors
from kochab.core.errors import RefusedError
from kochab.core.frame import Site
from kochab.core.progress import Progress, Task
from kochab.core.solution import Solution
from kochab.core.values import frozen
from kochab.gear.journal import utc_now
from kochab.gear.mount_line import MakeTask
from kochab.gear.mounts.guard import Guard
from kochab.text.angle_text import angle_text
from kochab.text.translation import tr, tr_noop
from kochab.workflows.goto_target import Target, aimed, goto_target, target_at
from kochab.workflows.sync_mount import SyncDone
from kochab.workflows.telescope.aid import PointingAid

NEWEST_S = 15.0
"""A solved frame older than this gives way to what a connected mount says."""
PAST_S = 300.0
"""Where it pointed so long ago is no word of where it points: the sky has turned by more than a degree since."""
LOOKS_AWAY_DEG = 25.0
"""No camera on a telescope looks further from its eyepiece: such a sync is of another place."""
AGAIN_S, MOST_SENTENCES = 5.0, 20
"""No sentence is repeated within so many seconds, and no more than so many are said in them."""
NO_FRAME = tr_noop("No frame was solved in the last {age:g} s: Kochab cannot tell what the eyepiece shows.")
NOT_ALLOWED = tr_noop("Target set: push the telescope there. Kochab may not move the mount for other programs.")


class MountOrders(Protocol):
    """The way to a connected mount's line."""

    @property
    def busy(self) -> bool:
        """Whether an order is under way: until its end another is refused."""

    def order(self, name: str, make: MakeTask, failed: Callable[[str], None]) -> None:
        """Do this on the guard, by any thread's wish.

        ``failed`` takes the sentence when it cannot be now or came to nothing, and another order may follow.
        """

    def stop(self) -> None:
        """Stop the mount now; never waits."""


@frozen
class Seen:
    """Where it points, ICRS degrees, seen ``at_s`` of :func:`time.monotonic`, and whether it slews there."""

    icrs_deg: Degrees
    at_s: float
    slewing: bool = False
    sigma_deg: float = 0.0
    """1 sigma by encoders or a gyroscope; 0 of a solve or a mount, whose own error is no matter to who pushes."""
    felt_s: float = 0.0
    """Seconds from the last solved frame to this position by encoders or a gyroscope; 0 without them."""

    @property
    def past(self) -> bool:
        """Whether that is too long ago to be told as where it points; a protocol without a word for it tells it."""
        return monotonic() - self.at_s > PAST_S


class OfferedTelescope:
    """What programs see and order, from any thread.

    Parameters
    ----------
    tell : Callable[[str], None]
        Takes each sentence for the person, in any thread.
    mount : MountOrders or None
        Where gotos and syncs go; None: there is no mount.
    may_move : bool
        Whether other programs may move and sync the mount.
    now : Callable[[], datetime]
        The time, UTC, that coordinates of date are of.
    site : Site or None
        Where it stands; None: not known.
    """

    def __init__(
        self,
        tell: Callable[[str], None],
        mount: MountOrders | None = None,
        may_move: bool = False,
        now: Callable[[], datetime] = utc_now,
        site: Site | None = None,
    ) -> None:
        self._tell, self.mount, self.may_move, self.now = tell, mount, may_move, now
        self.site = site
        self.target: Target | None = None
        self.aid: PointingAid[Any] | None = None
        """Encoders or a gyroscope, which tell where it points between two solves."""
        self.programs: dict[str, int] = {}
        """Who is connected, and over how many lines."""
        self._lock = threading.Lock()
        self._last_told_s: dict[str, float] = {}
        self._solved: tuple[Solution, float] | None = None
        self._mount_seen: Seen | None = None
        self._goes = False
        self._eyepiece: Floats = np.array([0.0, 0.0, 1.0])  # in the axes of the frame's centre

    # -- What is seen ------------------------------------------------------------------------------

    def see_solution(self, solution: Solution, at_s: float | None = None) -> None:
        """Take a solved frame that was exposed at ``at_s`` of :func:`time.monotonic`."""
        self._solved = solution, monotonic() if at_s is None else at_s
        if self.aid is not None:
            self.aid.see(*self._solved)

    def see_mount(self, icrs_deg: Degrees | None, slewing: bool = False) -> None:
        """Take what the mount says, ICRS degrees; None when it is gone."""
        self._mount_seen = None if icrs_deg is None else Seen(icrs_deg, monotonic(), slewing)

    @property
    def seen(self) -> Seen | None:
        """The newest pointing of the eyepiece; None before the first."""
        solved, mount = self._solved, self._mount_seen
        busy = self._goes or (self.mount is not None and self.mount.busy)
        slewing = busy or (mount is not None and mount.slewing)
        if solved is not None and (mount is None or monotonic() - solved[1] < NEWEST_S):
            solution, at_s = solved
            by = None if self.aid is None else self.aid.pointing(self._eyepiece)
            if by is not None:
                return Seen(by.icrs_deg, by.at_s, slewing, by.sigma_deg, max(0.0, by.at_s - at_s))
            return Seen(radec_deg(self._eyepiece @ solution.centre_attitude.matrix), at_s, slewing)
        return mount and replace(mount, slewing=slewing)

    # -- What programs order -----------------------------------------------------------------------

    def goto(self, place_deg: Degrees, who: str) -> "Future[str]":
        """Go to ICRS degrees for ``who``; the result is why not, empty when it was begun or a person pushes."""
        target = target_at(*place_deg)
        self.target = target
        if self.mount is None or not self.may_move:
            sentence = tr("{who} set a target: {name}.", who=who, name=target.name)
            self.say(sentence if self.mount is None else f"{sentence} {tr(NOT_ALLOWED)}")
            return _answered("")
        self.say(tr("{who}: go to {name}.", who=who, name=target.name))
        return self._order("goto", partial(self._go, target), who)

    def sync(self, place_deg: Degrees, who: str) -> "Future[str]":
        """``who`` says that the eyepiece shows ICRS degrees; the result is why that is not taken, empty when it is."""
        if self.mount is not None:
            if not self.may_move:
                return self._refused(tr("Kochab may not sync the mount for other programs."), who)
            self.say(tr("{who}: sync on {name}.", who=who, name=target_at(*place_deg).name))
            return self._order("accept_sync", partial(_sync, place_deg), who)
        solved = self._solved
        if solved is None or monotonic() - solved[1] > NEWEST_S:
            return self._refused(tr(NO_FRAME, age=NEWEST_S), who)
        attitude = solved[0].centre_attitude
        away = apart_deg(attitude.ra_dec_deg, place_deg)
        if away > LOOKS_AWAY_DEG:
            angle = angle_text(away)
            return self._refused(
                tr("The camera looks {angle} away from there: no eyepiece is so far off.", angle=angle), who
            )
        self._eyepiece = attitude.matrix @ unit_vectors(*place_deg)
        self.say(tr("{who} aligned: the eyepiece looks {angle} beside the camera.", who=who, angle=angle_text(away)))
        return _answered("")

    def stop(self, who: str) -> None:
        """Stop the mount for ``who``, who may always do that."""
        if self.mount is not None:
            self.mount.stop()
            self.say(tr("{who} stopped the mount.", who=who))

    def _go(self, target: Target, verdict: "Future[str]", guard: Guard) -> Task[str]:
        """Slew as :func:`goto_target` does; what the guard says of it comes first, for who must answer at once."""
        yield Progress("goto", 0.0, target.name)
        try:
            with _deciding(verdict):
                preview = guard.preview_goto(*aimed(guard, target))
                for against in (*preview.refusals, *preview.confirmations):
                    raise RefusedError("{against}", against=against)
                self._goes = True  # before the program hears that it begins: it asks at once
            yield from goto_target(guard, target)
        finally:
            self._goes = False
        return tr("The mount reports that it reached {name}.", name=target.name)

    def _order(
        self, name: str, make: Callable[["Future[str]", Guard], Task[str | SyncDone]], who: str
    ) -> "Future[str]":
        verdict: Future[str] = Future()
        assert self.mount is not None
        self.mount.order(name, partial(make, verdict), partial(self._failed, verdict, who))
        verdict.add_done_callback(partial(self._given_up, who))
        return verdict  # what came of it is told by the mount's line

    def _given_up(self, who: str, verdict: "Future[str]") -> None:
        if verdict.cancelled():
            self.say(tr("{who}: no answer from the mount in time; nothing moves.", who=who))

    def _failed(self, verdict: "Future[str]", who: str, why: str) -> None:
        if not verdict.cancelled():
            self.say(f"{who}: {why}")
        if verdict.running() or (not verdict.done() and verdict.set_running_or_notify_cancel()):
            verdict.set_result(why)

    def _refused(self, why: str, who: str) -> "Future[str]":
        self.say(f"{who}: {why}")
        return _answered(why)

    # -- Who is there, and what of it is said ---------------------------------------------------------

    def join(self, who: str) -> None:
        """A program has connected."""
        with self._lock:
            self.programs[who] = self.programs.get(who, 0) + 1
        self.say(tr("{who} connected.", who=who))

    def leave(self, who: str, why: str = "") -> None:
        """It is gone; ``why`` when Kochab closed the line."""
        with self._lock:
            left = self.programs.pop(who, 1) - 1
            if left > 0:
                self.programs[who] = left
        self.say(f"{who}: {why}" if why else tr("{who} disconnected.", who=who))

    def say(self, sentence: str) -> None:
        """Tell the person, but not the same again and again, and no more than can be read."""
        with self._lock:
            now = monotonic()
            self._last_told_s = {text: at for text, at in self._last_told_s.items() if now - at < AGAIN_S}
            if sentence in self._last_told_s or len(self._last_told_s) >= MOST_SENTENCES:
                return
            self._last_told_s[sentence] = now
        self._tell(sentence)

    @property
    def connected_text(self) -> str:
        """Who is connected, in words."""
        with self._lock:
            names = sorted(self.programs)
        return tr("Connected: {names}.", names=", ".join(names)) if names else tr("No program connected.")


def _answered(why: str) -> "Future[str]":
    future: Future[str] = Future()
    future.set_result(why)
    return future


# -- Orders in the thread of the mount's line, with a verdict before anything moves ---------------


def _sync(place_deg: Degrees, verdict: "Future[str]", guard: Guard) -> Task[SyncDone]:
    """Sync on a person's word, as far as the guard allows without asking again."""
    yield Progress("sync")
    with _deciding(verdict):
        guard.sync(*guard.to_mount(*place_deg), by_hand=True)
    return SyncDone(True, False, tr("Synced. Undo takes it back."))


class _deciding:  # noqa: N801 (reads as a statement)
    """Answers ``verdict`` when the block ends well; one that nobody waits for any more lets nothing begin.

    When it ends otherwise the order fails, and its end answers: a program that tries again at once is not told "busy".
    """

    def __init__(self, verdict: "Future[str]") -> None:
        self._verdict = verdict

    def __enter__(self) -> None:
        if not self._verdict.set_running_or_notify_cancel():
            raise RefusedError("The program no longer waits for it.")

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self._verdict.set_result("")
