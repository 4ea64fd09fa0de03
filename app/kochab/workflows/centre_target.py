"""Centre a target: goto, solve, correct, until it is centred or cannot be."""

import time
from dataclasses import field
from enum import StrEnum

from kochab.core.attitude import Degrees, apart_deg
from kochab.core.errors import NoAnswerError, RefusedError, StoppedError
from kochab.core.mount import Ability, Direction, Pointing
from kochab.core.progress import Progress, Task
from kochab.core.solution import NoSolution, Solution, SolveNow, no_solution_text
from kochab.core.values import frozen, mutable
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import SyncEvidence
from kochab.gear.mounts.motion_policy import ACROSS
from kochab.text.angle_text import angle_text
from kochab.text.translation import tr, tr_noop
from kochab.workflows.centring_corrections import Correction, Course, MountAndSky
from kochab.workflows.goto_target import Target, Wait, apart, parse_target, settled, with_retries
from kochab.workflows.nudge import nudge
from kochab.workflows.sync_mount import agreeing_solves, require_allowed


class CentringEnd(StrEnum):
    """How a centring ended."""

    CENTRED = "centred"
    NOT_CONVERGING = "not converging"
    SLIPPING = "slipping"
    REFUSED = "refused"
    NO_SOLUTION = "no solution"


@frozen
class Centring:
    """How it ended, in one sentence too, and its course.

    ``errors_arcsec`` are the errors solved, one before each correction and one at the end; ``corrections`` how these
    were made; what the mount refused or lost is in ``notes``. ``synced``: the mount was synced on the way.
    ``to_confirm``: it waits for a yes to a large sync.
    """

    end: CentringEnd
    sentence: str
    errors_arcsec: tuple[float, ...] = ()
    corrections: tuple[str, ...] = ()
    synced: bool = False
    solution: Solution | None = None
    notes: tuple[str, ...] = ()
    to_confirm: bool = False

    @property
    def centred(self) -> bool:
        """Whether the target is within the tolerance."""
        return self.end is CentringEnd.CENTRED


def end_of(course: Course, name: str, made: int, tries: int) -> tuple[CentringEnd, str] | None:
    """The end after the last frame and its sentence; None when another correction is worthwhile.

    Parameters
    ----------
    course : Course
        The errors so far.
    name : str
        The target's.
    made : int
        How many corrections were made.
    tries : int
        How many may be.
    """
    error, left = course.error_arcsec, angle_text(course.error_arcsec / 3600.0)
    if error <= course.tolerance_arcsec:
        return CentringEnd.CENTRED, tr("{name} is centred to {left}.", name=name, left=left)
    if course.slips > 1:
        return CentringEnd.SLIPPING, (
            tr(
                "Still {left} off: the telescope stops short of its target. Check the clutches, the cables "
                "and the balance.",
                left=left,
            )
        )
    if course.no_better:
        return CentringEnd.NOT_CONVERGING, (
            tr("Still {left} off: the corrections don't help. Check the clutches, the balance and the wind.", left=left)
        )
    if made >= tries:
        wanted = angle_text(course.tolerance_arcsec / 3600.0)
        return CentringEnd.NOT_CONVERGING, tr(
            "Still {left} off after {tries} corrections; {wanted} wanted.", left=left, tries=tries, wanted=wanted
        )
    return None


TOLERANCE_ARCSEC, TRIES = 60.0, 5
FRAMES = 3  # without a solution, before giving up
AGAIN_S, SOON_S = 2.0, 0.5
TROUBLES = 3  # lost replies, or commands refused by the mount, in a row
READINGS, SAME_DEG = 4, 0.02
NEAR_DEG = 0.5
DOUBTFUL = tr_noop(
    "Poor solution: residual {:.3g} px. Kochab did not move the mount. Take longer exposures, or check a frame."
)


def centre_target(
    mount: Guard,
    solve_now: SolveNow,
    target: Target,
    tolerance_arcsec: float = TOLERANCE_ARCSEC,
    tries: int = TRIES,
    *,
    may_sync: bool = True,
    confirmed: bool = False,
    wait: Wait = time.sleep,
) -> Task[Centring]:
    """Slew, settle, solve, correct, until the frame's centre is on ``target``.

    The first large error is corrected by a sync on two agreeing solves and a goto; where the mount or the guard rejects
    the sync, and for smaller errors, by an offset goto; for the smallest by guide pulses. Cancelling at any yield, and
    every exception, stops the mount.

    Raises `StoppedError` when a person pressed Stop, and `DeviceError` when the mount or the camera no longer replies.

    Parameters
    ----------
    mount : Guard
        Behind its guard.
    solve_now : SolveNow
        Takes a frame and solves it.
    target : Target
        Where to.
    tolerance_arcsec : float
        Largest distance at which it is centred.
    tries : int
        Corrections at most.
    may_sync : bool
        Whether a sync may correct the first error.
    confirmed : bool
        The yes that the guard requires before a large sync.
    wait : Wait
        Waits so many seconds.
    """
    may_sync = may_sync and Ability.SYNC not in mount.lacks
    work = _Centring(mount, solve_now, target, tolerance_arcsec, tries, wait, may_sync, confirmed)
    ended = False
    try:
        result = yield from work.go()
        ended = True
    finally:
        if not ended:  # a cancel closes the generator here: nothing moves on unwatched
            mount.halt()
    return result


def centre_typed(mount: Guard, solve_now: SolveNow, text: str, tolerance_arcsec: float) -> Task[Centring]:
    """Centre a name or coordinates as a person typed them.

    A sync so large that the guard wants a yes is not done on the way: it belongs into the preview.

    Parameters
    ----------
    mount : Guard
        Behind its guard.
    solve_now : SolveNow
        Takes a frame and solves it.
    text : str
        What was typed.
    tolerance_arcsec : float
        Largest distance at which it is centred.
    """
    yield Progress("centre", None, text)
    target = parse_target(text, mount.clock(), mount.site)
    return (yield from centre_target(mount, solve_now, target, tolerance_arcsec))


@mutable
class _Centring:
    """One centring in progress."""

    mount: Guard
    solve_now: SolveNow
    target: Target
    tolerance_arcsec: float
    tries: int
    wait: Wait
    may_sync: bool
    confirmed: bool
    synced: bool = False
    to_confirm: bool = False
    corrections: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    solution: Solution | None = None
    troubles: int = 0
    failures: int = 0
    course: Course = field(init=False)
    stops: int = field(init=False)

    def __post_init__(self) -> None:
        self.course = Course(self.there(), self.tolerance_arcsec)
        self.stops = self.mount.stops  # a Stop pressed from here on ends it

    def there(self) -> tuple[float, float]:
        """The target in the mount's own coordinates, now."""
        return self.mount.to_mount(self.target.ra_deg, self.target.dec_deg)

    def go(self) -> Task[Centring]:
        """The first slew, then frames and corrections in turn."""
        yield Progress("goto", None, self.target.name)
        if not (yield from self.first_slew()):
            return self.refused()
        while True:
            yield from settled(self.mount, self.wait)
            found = yield from self.solve()
            if isinstance(found, NoSolution):
                return self.ended(CentringEnd.NO_SOLUTION, no_solution_text(found))
            if not self.is_good(found):
                return self.ended(CentringEnd.NO_SOLUTION, tr(DOUBTFUL).format(found.rms_px))
            end = self.end_after(found)
            if end is not None:
                return end
            if not (yield from self.tried(self.correct(found))):
                return self.refused()

    def first_slew(self) -> Task[bool]:
        """The first slew; tried again, since a garbled reply may have misled the guard."""
        state = with_retries(self.mount.state)
        if state.slewing:
            yield from settled(self.mount, self.wait)
        elif state.tracking is not False and apart_deg(self.reported(), self.there()) < NEAR_DEG:
            return True  # near the target already, from a centring before: keep the sync made then
        for _ in range(TROUBLES):
            sent = len(self.mount.log.sent())
            if (yield from self.tried(self.slew(self.there()))):
                # `tried` is True after a lost reply as well: only the log shows that the mount was asked to go.
                if len(self.mount.log.sent()) > sent:
                    return True
            elif len(self.mount.log.sent()) > sent:
                return False
            self.wait(SOON_S)
        return False

    def solve(self) -> Task[Solution | NoSolution]:
        """Solve a fresh frame; another when the first has no solution."""
        for more in range(FRAMES - 1, -1, -1):
            yield Progress("solving", None, self.target.name)
            found = yield from self.solve_now()
            if not more or (isinstance(found, Solution) and self.is_good(found)):
                break
            reason = tr(found.reason) if isinstance(found, NoSolution) else tr("poor solution")
            yield Progress("solving", None, tr("{reason}, taking another frame", reason=reason))
            self.wait(AGAIN_S)
        return found

    def is_good(self, solution: Solution) -> bool:
        """Whether the guard would accept a sync on it."""
        limits = self.mount.limits
        return solution.rms_px <= limits.worst_rms_px and solution.log10_false_alarm <= limits.worst_log10_false_alarm

    def end_after(self, solution: Solution) -> Centring | None:
        """The end, if this frame is the last one."""
        self.solution, course = solution, self.course
        course.target = self.there()
        course.add(self.sight(solution), len(self.corrections))
        end = end_of(course, self.target.name, len(self.corrections), self.tries)
        return None if end is None else self.ended(*end)

    def sight(self, solution: Solution) -> MountAndSky:
        """The reported position beside the solved one."""
        return MountAndSky(self.reported(), self.mount.to_mount(*solution.ra_dec_deg))

    def reported(self) -> Degrees:
        """The position, when two readings agree: a garbled reply may bring an old one."""
        before = with_retries(self.mount.position)
        for _ in range(READINGS):
            here = with_retries(self.mount.position)
            if apart(before, here) < SAME_DEG:
                return here.ra_deg, here.dec_deg
            before = here
        raise NoAnswerError("The mount's reported position keeps changing.")

    def correct(self, solution: Solution) -> Task[None]:
        """One correction of the kind that fits."""
        course = self.course
        how = course.how(self.may_sync and not self.synced)
        synced = False
        if how is Correction.SYNC:
            synced = yield from self.sync(solution)
            how = Correction.SYNC if synced else Correction.GOTO
        self.synced = self.synced or synced
        yield Progress("correcting", None, f"{angle_text(course.error_arcsec / 3600.0)} off: {how}")
        yield from self.move(how, synced)
        self.corrections.append(str(how))
        yield Progress("corrected", None, str(how))

    def move(self, how: Correction, synced: bool) -> Task[None]:
        """The motion of one correction."""
        if how is Correction.FINE:
            yield from self.fine()
            return
        for there in self.course.command(synced, how is Correction.APPROACH):
            yield from self.slew(there)

    def sync(self, solution: Solution) -> Task[bool]:
        """Sync on a second solve that agrees; False when it has to be an offset goto instead."""
        found = yield from agreeing_solves(self.mount, self.solve_now, solution)
        if isinstance(found, NoSolution):
            self.notes.append(tr("No sync: no solution for a second frame ({reason}).", reason=tr(found.reason)))
            return False
        self.solution = found[1]
        self.course.last = self.sight(found[1])  # the sync and the goto behind it go by the second solve
        evidence, there = SyncEvidence.of(*found), self.course.last.sky
        preview = with_retries(lambda: self.mount.preview_sync(*there, evidence))
        # Across the meridian a sync is refused, but the offset goto needs none.
        if preview.refusals == (tr(ACROSS),):
            self.notes.append(tr("Offset goto instead of a sync: {across}", across=tr(ACROSS)))
            return False
        self.to_confirm = not preview.refusals and bool(preview.confirmations)
        require_allowed(self.mount, preview, self.confirmed)
        try:
            self.mount.sync(*there, evidence, confirmed=self.confirmed)
        except StoppedError:
            raise
        except RefusedError as error:
            if self.changed():  # not refused but garbled: solve again before anything moves
                raise
            self.may_sync = False  # a mount that rejected one is not asked again
            self.notes.append(tr("Offset goto instead of a sync: {error}", error=error))
            return False
        return True

    def changed(self) -> bool:
        """Whether the mount reports another position than at the last frame."""
        assert self.course.last is not None
        return apart_deg(self.course.last.reported, self.reported()) > SAME_DEG

    def fine(self) -> Task[None]:
        """Small moves on both axes."""
        east, north = self.course.fine()
        for amount, ways in ((east, (Direction.EAST, Direction.WEST)), (north, (Direction.NORTH, Direction.SOUTH))):
            self.check_not_stopped()
            yield from nudge(self.mount, ways[amount < 0.0], abs(amount), self.wait)

    def slew(self, there: tuple[float, float]) -> Task[Pointing]:
        """A supervised slew, unless a person pressed Stop."""
        self.check_not_stopped()
        return (yield from self.mount.slew(*there))

    def check_not_stopped(self) -> None:
        """Nothing moves any more after a person's Stop."""
        if self.mount.stops != self.stops:
            raise StoppedError("Centring stopped.")

    def tried(self, motion: "Task[None] | Task[Pointing]") -> Task[bool]:
        """Do it; what the mount refused or lost is not repeated, but another frame taken, a few times.

        False when the guard forbids it or the mount will not for a second time.
        """
        try:
            yield from motion
            self.troubles = 0
            return True
        except StoppedError:
            raise
        except (RefusedError, NoAnswerError) as error:
            self.check_not_stopped()
            self.notes.append(str(error))
            self.troubles += 1
            self.failures += 1
            if isinstance(error, RefusedError) and self.troubles > 1:
                return False
            if self.troubles >= TROUBLES or self.failures > 2 * TROUBLES:
                raise
            return True

    def refused(self) -> Centring:
        """The end by a refusal."""
        return self.ended(CentringEnd.REFUSED, self.notes[-1])

    def ended(self, end: CentringEnd, sentence: str) -> Centring:
        """The result with what led to it."""
        errors_arcsec, corrections = tuple(self.course.errors_arcsec), tuple(self.corrections)
        notes, asks = tuple(self.notes), self.to_confirm and end is CentringEnd.REFUSED
        return Centring(end, sentence, errors_arcsec, corrections, self.synced, self.solution, notes, asks)
