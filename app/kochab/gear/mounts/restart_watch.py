"""Was the mount switched off and on? One that was says that it is at home, wherever its tube is."""

from collections.abc import Callable
from dataclasses import replace
from datetime import datetime

from kochab.core.attitude import Degrees, apart_deg, wrapped
from kochab.core.mount import SIDEREAL_DEG_S, Mount, MountState, Pointing
from kochab.core.values import frozen
from kochab.gear.journal import MotionLog
from kochab.gear.mounts.coordinates import of_date
from kochab.gear.mounts.last_seen import LastSeen, Place
from kochab.gear.mounts.motion_policy import HOME_DEG, MotionPolicy
from kochab.text.translation import tr, tr_noop

AT_POLE_DEG = 0.1  # nearer to it a right ascension may be reckoned from angles of no size
UNORDERED_DEG = 2.0  # how far a mount that nobody ordered to move may be found from where it was, beside tracking
CURE = tr_noop(
    "Sync first, on a solved frame. If the sync is refused, switch the mount off, put the tube at its home, switch it"
    " on there, and say that the mount is right (--trust-mount)."
)
WOKE_UP = tr_noop("Mount was restarted (switched off and on): it jumped {:.0f}° to its home.")
SILENT = tr_noop(
    "Mount did not answer for a while, then jumped {:.0f}° to its home or park position. Was it switched off and on?"
)
ASTRAY = tr_noop("Mount jumped {:.0f}° to its home or park position, off its path. Was it switched off and on?")


ELSEWHERE = tr_noop(
    "Mount did not answer for a while, and now reports a place {:.0f}° from where it was. Was it switched off and on?"
)


BETWEEN = tr_noop(
    "Mount is at its home or park position, {:.0f}° from where Kochab saw it last, and Kochab did not send it there."
    " Was it switched off and on?"
)


SHORT = tr_noop("Mount stopped at its home or park position instead of where it was sent. Was it switched off and on?")


TURNED = tr_noop(
    "The mount says that it is at the pole as before, but its RA axis is not where Kochab saw it last, and Kochab did"
    " not turn it: it may have been switched off and on since."
)


@frozen
class Look:
    """A place of date that the mount reported, and when, by both clocks; how it was then.

    ``ordered``: a motion that somebody had ordered was under way.
    """

    place_deg: Degrees
    at_s: float
    at: datetime
    ordered: bool
    state: MountState

    @property
    def beside_pole(self) -> bool:
        """Where nearly every mount takes itself to be when it wakes up."""
        return 90.0 - abs(self.place_deg[1]) < HOME_DEG

    @property
    def at_pole(self) -> bool:
        """Whether its right ascension may be anything, so that only its word of its home tells of its RA axis."""
        return 90.0 - abs(self.place_deg[1]) < AT_POLE_DEG

    @property
    def at_rest(self) -> bool:
        """Whether it says that it is at home or parked."""
        return bool(self.state.at_home or self.state.parked)

    def since_s(self, before: "Look") -> float:
        """Seconds since an earlier look, by whichever clock advanced more: one of them may be simulated."""
        return max(0.0, self.at_s - before.at_s, (self.at - before.at).total_seconds())

    def same_rest(self, before: "Look") -> bool:
        """Whether it stands where it stood, at home, parked or beside the pole, so that a restart would do no harm."""
        reach_deg = drift_deg(self.since_s(before))
        if before.ordered or apart_deg(self.place_deg, before.place_deg) > reach_deg:
            return False
        turned_deg = abs(wrapped(self.place_deg[0] - before.place_deg[0]))  # beside the pole RA tells of a lost axis
        return before.at_rest or (before.beside_pole and turned_deg <= reach_deg)


def drift_deg(passed_s: float) -> float:
    """How far a mount that nobody ordered to move may have gone: tracking or standing, and nudged a little by hand."""
    return UNORDERED_DEG + 2.0 * SIDEREAL_DEG_S * passed_s


def turned_aside_deg(before_deg: float | None, now_deg: float | None, passed_s: float) -> float:
    """How far the RA axis is from where standing or tracking would have left it; 0.0 where that cannot be told.

    Hour angles, degrees. A mount that does not tell its own clock and site tells no hour angle, and one that woke up
    within the angle that the sky has turned since looks like one that tracked.
    """
    if before_deg is None or now_deg is None:
        return 0.0
    turned_deg = (now_deg - before_deg) % 360.0
    beyond_deg = turned_deg - SIDEREAL_DEG_S * passed_s
    return max(0.0, min(beyond_deg, 360.0 - turned_deg))


def under_way_s(before: Look, ended: tuple[float, datetime] | None, passed_s: float) -> float:
    """How long the motion that the last look saw went on; all the time since, where its end is not known."""
    if ended is None or ended[0] < before.at_s:
        return passed_s
    return min(passed_s, max(ended[0] - before.at_s, (ended[1] - before.at).total_seconds()))


class RestartWatch:
    """Compares what the mount says with what it said before, and forbids slews until a sync after a restart.

    Between two programs it cannot tell a mount that stood at the very pole, does not say whether that was its home, and
    woke up there with its RA axis turned: neither its place nor its word is another then.

    ``reach_deg`` tells how far a mount that was ordered to move may go in so many seconds. Where it was ``last_seen``
    by another program is compared with the first place that this one reads.
    """

    def __init__(
        self,
        mount: Mount,
        policy: MotionPolicy,
        log: MotionLog,
        reach_deg: Callable[[float], float],
        last_seen: LastSeen | None = None,
    ) -> None:
        self.restarts = 0  # how many were found
        self.state = MountState()  # as it was last told
        self.on_restart: Callable[[], None] = lambda: None  # its clock and site may be others now
        self.sidereal_deg: Callable[[Mount], float | None] = lambda _: None  # by the mount's own clock and site
        self._policy, self._log, self._reach_deg = policy, log, reach_deg
        self._seen: Look | None = None
        self._missed: int | None = mount.missed  # None: the line was opened again
        self._last_seen = last_seen
        self._compares_last = last_seen is not None
        self._place: Place | None = None  # the last one to keep

    def forget(self) -> None:
        """Compare no more: the mount's coordinates are about to change."""
        self._seen = None

    def trust(self) -> None:
        """A person says that the mount is right, wherever it was seen before."""
        self._compares_last = False

    def came_to_rest(self) -> None:
        """It has come where it was sent, home or to its park position, and may be silent there."""
        if self._place is not None:
            self._keep(replace(self._place, sent_there=True), last=True)

    def close(self, mount: Mount, lost: bool = False) -> None:
        """The session ends, its line may be ``lost``: what was seen last is kept for the next."""
        if self._place is not None:
            self._keep(replace(self._place, in_silence=lost or self.silent(mount)), last=True)

    def _keep(self, place: Place, last: bool = False, under_way: bool = False) -> None:
        self._place = place
        if self._last_seen is not None:
            self._last_seen.keep(place, last, under_way)

    def reconnecting(self) -> None:
        """The line was lost: meanwhile it may have been without power."""
        self._missed = None

    def silent(self, mount: Mount) -> bool:
        """Whether it has missed an answer since it was last seen."""
        return mount.missed != self._missed

    def see(
        self,
        mount: Mount,
        here: Pointing,
        asked_s: float,
        ordered: bool,
        strayed: bool = False,
        off_its_way: bool = False,
        ended: tuple[float, datetime] | None = None,
    ) -> None:
        """Compare a place with the one before; after a silence the state is asked for, too.

        Raises as :meth:`Mount.state`.

        Parameters
        ----------
        mount : Mount
            Asked for its state.
        here : Pointing
            Where it says it is.
        asked_s : float
            When that was asked, `monotonic`.
        ordered : bool
            Whether a motion is under way that was ordered.
        strayed : bool
            Whether it was stopped because the motion that was ordered does not lead there.
        off_its_way : bool
            Whether the last motion does not lead there, whenever that was.
        ended : tuple[float, datetime] or None
            When the last motion ended, by `monotonic` and by the clock; None: not since the start.
        """
        now, missed, before = self._policy.clock(), mount.missed, self._seen
        silent = self.silent(mount)
        if before is not None and (silent or strayed):
            self.state = mount.state()
        look = Look(of_date(here, now), asked_s, now, ordered or self.state.slewing is True, self.state)
        if before is not None:
            doubt = SILENT if silent else ASTRAY if strayed else ""
            self._compare(before, look, doubt, off_its_way or strayed, ended)
        elif self._compares_last:
            look = self._compare_last(mount, look)
        self._seen, self._missed = look, missed
        sent_there = self._place is not None and self._place.sent_there and look.at_rest
        hour_angle = None if look.ordered else self._hour_angle_deg(mount, look)
        place = Place(*look.place_deg, look.at.timestamp(), look.at_rest, sent_there, hour_angle)
        self._keep(place, under_way=look.ordered)

    def _hour_angle_deg(self, mount: Mount, look: Look) -> float | None:
        """Of a mount beside the pole, where the sky tells nothing of its RA axis; None elsewhere, or not told."""
        sidereal_deg = self.sidereal_deg(mount) if look.beside_pole and not look.at_pole else None
        return None if sidereal_deg is None else (sidereal_deg - look.place_deg[0]) % 360.0

    def _compare_last(self, mount: Mount, look: Look) -> Look:
        """The first look of a session, with its state, beside what another program saw."""
        self._compares_last = False
        self.state = mount.state()  # so that what is kept of this session knows whether it was at home
        look = replace(look, state=self.state)
        kept = self._last_seen.read() if self._last_seen else None
        if kept is None:
            return look
        rested = MountState(at_home=kept.at_rest)
        before = Look(kept.deg, look.at_s - max(0.0, (look.at - kept.at).total_seconds()), kept.at, False, rested)
        rests = look.beside_pole or look.at_rest
        known = kept.sent_there or self.state.home_confirmed is False  # which forbids a slew by itself
        # An evening begins at the pole, where another clock is another right ascension, and the same hour angle.
        same = look.same_rest(before) or (look.beside_pole and before.beside_pole)
        turned_deg = turned_aside_deg(kept.hour_angle_deg, self._hour_angle_deg(mount, look), look.since_s(before))
        # Neither standing nor tracking leads to the very pole.
        came_there = look.at_pole and (kept.hour_angle_deg is not None or (look.at_rest and not kept.at_rest))
        if same and (turned_deg > UNORDERED_DEG or came_there) and not (known or self._policy.slew_block_reason):
            self.found(tr(TURNED))
            return look
        moved_deg = apart_deg(before.place_deg, look.place_deg)
        if kept.in_silence and moved_deg > drift_deg(look.since_s(before)) and not self._policy.slew_block_reason:
            self.found(tr(ELSEWHERE).format(moved_deg))
            return look
        if rests and not same and not known and not self._policy.slew_block_reason:
            self.found(tr(BETWEEN).format(apart_deg(before.place_deg, look.place_deg)))
        return look

    def _compare(
        self, before: Look, look: Look, doubt: str, off_its_way: bool, ended: tuple[float, datetime] | None
    ) -> None:
        moved_deg, passed_s = apart_deg(before.place_deg, look.place_deg), look.since_s(before)
        unordered = moved_deg > drift_deg(passed_s)
        jumped = unordered
        if before.ordered or look.ordered:
            jumped = moved_deg > self._reach_deg(passed_s if look.ordered else under_way_s(before, ended, passed_s))
        if look.beside_pole and jumped:
            self.found(tr(WOKE_UP).format(moved_deg))
        elif doubt and (look.beside_pole or look.at_rest) and not look.same_rest(before):
            self.found(tr(doubt).format(moved_deg))
        elif doubt == SILENT and (jumped or (off_its_way and unordered)):  # a StarBook wakes up in the west
            self.found(tr(ELSEWHERE).format(moved_deg))

    def stopped_short(self, start_deg: Degrees) -> None:
        """A slew from ``start_deg`` (of date) ended elsewhere by itself, and nobody pressed Stop.

        A cut so short that no answer was missed, told so seldom that the motors could have gone home meanwhile, shows
        in nothing else. A mount that never left its home is not meant.
        """
        look = self._seen
        if look is None or apart_deg(start_deg, look.place_deg) <= UNORDERED_DEG:
            return
        if look.beside_pole or look.at_rest or self.state.at_home or self.state.parked:
            self.found(tr(SHORT))

    def found(self, sentence: str) -> None:
        """It was, or may have been, restarted: no slew before a sync."""
        self.restarts += 1
        self.on_restart()
        self._policy.slew_block_reason, self._policy.restarted = f"{sentence} {tr(CURE)}", True
        self._log.add("position", "failed", self._policy.slew_block_reason)
