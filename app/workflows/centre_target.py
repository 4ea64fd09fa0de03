"""Go to a target and look; correct what the sky says is left; until it is centred or cannot be."""

import time

from app.core.attitude import apart_deg
from app.core.errors import NoAnswerError, RefusedError, StoppedError
from app.core.mount import Ability, Direction, Pointing
from app.core.progress import Progress, Task
from app.core.solution import NoSolution, Solution
from app.mounts.guard import Guard
from app.mounts.limits import SyncEvidence
from app.mounts.rules.meridian import ACROSS
from app.workflows.centre_target_course import Course, How, Sight
from app.workflows.centre_target_end import Centring, End, arcsec, verdict_on
from app.workflows.fresh_frame import SolveNow
from app.workflows.goto_target import Target, Wait, answered, settled
from app.workflows.nudge import nudge
from app.workflows.sync_mount import agreeing_solves, hold_guard

__all__ = ["Centring", "End", "centre_target"]

TOLERANCE_ARCSEC, TRIES = 60.0, 5
LOOKS = 3  # frames without a solution before it is given up
AGAIN_S, SOON_S = 2.0, 0.5
TROUBLES = 3  # answers of the mount missed, or orders refused by it, in a row
SAYINGS, SAME_DEG = 4, 0.02
NEAR_DEG = 0.5
DOUBTFUL = (
    "The stars of the frames fit none of the sky well, {:.3g} px on average: nothing is moved by"
    " that. Take longer exposures, or look at a frame."
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
    """Slew, settle, solve, correct, until the frame's middle is on ``target``.

    The first large error is corrected by a sync on two agreeing solves and a goto; where the mount
    or the guard takes no sync, and for smaller errors, by an offset goto; for the smallest by
    guide pulses. ``confirmed`` is the yes that the guard asks for before a large sync. Cancelling
    at any yield, and every exception, stops the mount.

    Raises
    ------
    StoppedError
        A person said Stop.
    app.core.errors.DeviceError
        The mount or the camera does not answer any more; one sentence.

    """
    work = _Centring(mount, solve_now, target, tolerance_arcsec, tries, wait)
    work.may_sync, work.confirmed = may_sync and Ability.SYNC not in mount.lacks, confirmed
    ended = False
    try:
        result = yield from work.go()
        ended = True
    finally:
        if not ended:
            mount.halt()
    return result


class _Centring:
    """One centring under way."""

    def __init__(
        self, mount: Guard, solve_now: SolveNow, target: Target, tolerance_arcsec: float,
        tries: int, wait: Wait,
    ) -> None:  # fmt: skip
        self.mount, self.solve_now, self.target = mount, solve_now, target
        self.tolerance, self.tries, self.wait = tolerance_arcsec, tries, wait
        self.may_sync, self.confirmed, self.synced = True, False, False
        self.corrections: list[str] = []
        self.notes: list[str] = []
        self.course = Course(self.there(), tolerance_arcsec)
        self.stops, self.troubles, self.failures = mount.stops, 0, 0
        self.solution: Solution | None = None

    def there(self) -> tuple[float, float]:
        """The target in the mount's own coordinates, now."""
        return self.mount.to_mount(self.target.ra_deg, self.target.dec_deg)

    def go(self) -> Task[Centring]:
        """The first slew, then looks and corrections in turn."""
        yield Progress("goto", None, self.target.name)
        if not (yield from self.begun()):
            return self.refused()
        while True:
            yield from settled(self.mount, self.wait)
            found = yield from self.look()
            if isinstance(found, NoSolution):
                return self.ended(
                    End.NO_SOLUTION, f"{found.reason[:1].upper()}{found.reason[1:]}: {found.advice}"
                )
            if not self.good(found):
                return self.ended(End.NO_SOLUTION, DOUBTFUL.format(found.rms_px))
            end = self.judged(found)
            if end is not None:
                return end
            if not (yield from self.tried(self.correct(found))):
                return self.refused()

    def begun(self) -> Task[bool]:
        """The first slew; the guard, which may have been misled by a bad line, is asked twice."""
        state = answered(self.mount.state)
        if state.slewing:
            yield from settled(self.mount, self.wait)
        elif state.tracking is not False and self.near():
            return True  # it was centred before: what was learned then is not thrown away
        for _ in range(TROUBLES):
            sent = len(self.mount.log.sent())
            if (yield from self.tried(self.slew(self.there()))):
                if len(self.mount.log.sent()) > sent:
                    return True
            elif len(self.mount.log.sent()) > sent:
                return False
            self.wait(SOON_S)
        return False

    def near(self) -> bool:
        """Whether the mount says that it points nearly there already."""
        said = self.said()
        return apart_deg((said.ra_deg, said.dec_deg), self.there()) < NEAR_DEG

    def look(self) -> Task[Solution | NoSolution]:
        """Solve a fresh frame; another when the first has no solution."""
        for more in range(LOOKS - 1, -1, -1):
            yield Progress("looking", None, self.target.name)
            found = yield from self.solve_now()
            if not more or (isinstance(found, Solution) and self.good(found)):
                break
            reason = found.reason if isinstance(found, NoSolution) else "a doubtful solution"
            yield Progress("looking", None, f"{reason}, taking another frame")
            self.wait(AGAIN_S)
        return found

    def good(self, solution: Solution) -> bool:
        """Whether the guard would believe it."""
        limits = self.mount.limits
        return (
            solution.rms_px <= limits.worst_rms_px
            and solution.log10_false_alarm <= limits.worst_log10_false_alarm
        )

    def judged(self, solution: Solution) -> Centring | None:
        """The end, if this is one."""
        self.solution, course = solution, self.course
        course.target = self.there()
        course.add(self.sight(solution), len(self.corrections))
        verdict = verdict_on(course, self.target.name, len(self.corrections), self.tries)
        return None if verdict is None else self.ended(*verdict)

    def sight(self, solution: Solution) -> Sight:
        """The mount's word beside the sky's."""
        said = self.said()
        return Sight((said.ra_deg, said.dec_deg), self.mount.to_mount(*solution.ra_dec_deg))

    def said(self) -> Pointing:
        """What the mount says twice: a spoilt line may bring a place of long ago."""
        before = answered(self.mount.position)
        for _ in range(SAYINGS):
            said = answered(self.mount.position)
            if apart_deg((before.ra_deg, before.dec_deg), (said.ra_deg, said.dec_deg)) < SAME_DEG:
                return said
            before = said
        raise NoAnswerError("The mount says another place each time it is asked.")

    def correct(self, solution: Solution) -> Task[None]:
        """One correction by the way that fits."""
        course = self.course
        how = course.how(self.may_sync and not self.synced)
        synced = False
        if how is How.SYNC:
            synced = yield from self.sync(solution)
            how = How.SYNC if synced else How.GOTO
        self.synced = self.synced or synced
        yield Progress("correcting", None, f"{arcsec(course.error_arcsec)} off: {how}")
        yield from self.move(how, synced)
        self.corrections.append(str(how))
        yield Progress("corrected", None, str(how))

    def move(self, how: How, synced: bool) -> Task[None]:
        """The motion of one correction."""
        if how is How.FINE:
            yield from self.fine()
            return
        for there in self.course.command(synced, how is How.APPROACH):
            yield from self.slew(there)

    def sync(self, solution: Solution) -> Task[bool]:
        """Sync on a second solve that agrees; False when an offset goto has to do instead."""
        found = yield from agreeing_solves(self.mount, self.solve_now, solution)
        if isinstance(found, NoSolution):
            self.notes.append(f"No sync, a second frame has no solution: {found.reason}.")
            return False
        self.solution = found[1]
        self.course.last = self.sight(found[1])
        evidence, there = SyncEvidence.of(*found), self.course.last.sky
        preview = answered(lambda: self.mount.preview_sync(*there, evidence))
        if preview.refusals == (ACROSS,):
            self.notes.append(f"No sync, an offset goto instead: {ACROSS}")
            return False
        hold_guard(self.mount, preview, self.confirmed)
        try:
            self.mount.sync(*there, evidence, confirmed=self.confirmed)
        except StoppedError:
            raise
        except RefusedError as error:
            if self.changed():  # not refused but spoilt: look again before anything moves
                raise
            self.may_sync = False
            self.notes.append(f"No sync, an offset goto instead: {error}")
            return False
        return True

    def changed(self) -> bool:
        """Whether the mount says another place than at the last look."""
        assert self.course.last is not None
        said = self.said()
        return apart_deg(self.course.last.said, (said.ra_deg, said.dec_deg)) > SAME_DEG

    def fine(self) -> Task[None]:
        """Small moves on both axes."""
        east, north = self.course.fine()
        for amount, ways in (
            (east, (Direction.EAST, Direction.WEST)),
            (north, (Direction.NORTH, Direction.SOUTH)),
        ):
            self.hold()
            yield from nudge(self.mount, ways[amount < 0.0], abs(amount), self.wait)

    def slew(self, there: tuple[float, float]) -> Task[Pointing]:
        """A watched slew, unless a person has said Stop."""
        self.hold()
        return (yield from self.mount.slew(*there))

    def hold(self) -> None:
        """Nothing more moves after a person's Stop."""
        if self.mount.stops != self.stops:
            raise StoppedError("The centring was stopped.")

    def tried(self, motion: "Task[None] | Task[Pointing]") -> Task[bool]:
        """Do it; what the mount refused or lost is not repeated but looked at, a few times.

        False when the guard forbids it or the mount will not for a second time.
        """
        try:
            yield from motion
            self.troubles = 0
            return True
        except StoppedError:
            raise
        except (RefusedError, NoAnswerError) as error:
            self.hold()
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
        return self.ended(End.REFUSED, self.notes[-1])

    def ended(self, end: End, sentence: str) -> Centring:
        """The result with what led to it."""
        return Centring(
            end, sentence, tuple(self.course.errors_arcsec), tuple(self.corrections), self.synced,
            self.solution, tuple(self.notes),
        )  # fmt: skip
