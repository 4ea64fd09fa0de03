"""The measuring phase: frames while the RA axis turns, by the mount or by hand; a second sweep."""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import numpy as np

from kochab.core.attitude import ARCSEC, angle_between, wrapped
from kochab.core.capture import CameraSource
from kochab.core.errors import RefusedError
from kochab.core.mount import Direction, Mount
from kochab.core.progress import Progress, Task
from kochab.core.values import frozen
from kochab.polar.drift import Drift, measure_drift, stretches_of
from kochab.polar.error import angle_in_words
from kochab.polar.flexure import UNKNOWN, Droop
from kochab.polar.measure import (
    Measurement,
    MeasureSettings,
    NoAxis,
    PolarFinding,
    PolarFindingKind,
    combine_measurements,
    measure_local,
    slipping,
)
from kochab.polar.plan import (
    BACK_DEG,
    Optics,
    SecondSweep,
    SweepPath,
    best_path,
    from_start_deg,
    more_turn_deg,
    plan_second,
    sweep_path,
    turn_needed_deg,
    weighted_arcsec,
)
from kochab.polar.pole import pole_direction
from kochab.polar.sighting import LocalAttitude, Sighting
from kochab.text.translation import tr, tr_n, tr_noop
from kochab.workflows.polar.sources import NotMeasuredError, RestWatch, SightingSource, turned_deg
from kochab.workflows.polar.update import PolarButton, PolarControls, PolarUpdate, TurnInstruction

# -- Who turns the RA axis between the frames: the mount within its guard, or a hand -----------

RATE_DEG_S = 2.0
LONGEST_MOTION_S = 20.0  # longer turns are several motions, each within the guard's limit
NEAR_ENOUGH_DEG = 1.0
SETTLE_S = 2.0
TRAILED_S = 1.0  # patience for the frame that was exposed while the mount turned
SLOW = 6.0  # times longer than expected is given up
MOST_MOTIONS = 24


class Turner(Protocol):
    """Turns one axis at a time. ``by_hand`` tells that nothing is known of how far they went."""

    by_hand: bool

    def turn(self, direction: Direction, degrees: float) -> Task[float | None]:
        """Turn RA east or west, or the declination axis north or south; how far the mount says that it turned.

        Returns when the axis is at rest, or at once, with None, when a person does it.
        """


class HandTurner:
    """Asks a person to turn; the frames themselves show when it was done."""

    by_hand = True

    def turn(self, direction: Direction, degrees: float) -> Task[float | None]:
        """Ask for it."""
        text = tr("Rotate RA about {degrees:.0f}° {direction}, then lock the clutch. Continues by itself.")
        if direction.in_dec:
            text = tr(
                "Rotate declination about {degrees:.0f}° {direction}, then lock it. Don't touch RA or the bolts."
                " Continues by itself."
            )
        words = text.format(degrees=degrees, direction=tr(direction))
        yield TurnInstruction("turn", None, words, direction, degrees)
        return None


class MountTurner:
    """Moves a mount that is given already guarded: every refusal comes from there.

    Few mounts say how fast their fast is, so it goes by the reported position: one bounded motion,
    a position, and the next. The next frame of ``camera`` is dropped after a turn: it is trailed.
    ``sleep`` and ``now`` are the wall's unless a test has its own.
    """

    by_hand = False

    def __init__(
        self,
        mount: Mount,
        rate_deg_s: float = RATE_DEG_S,
        sleep: Callable[[float], None] = time.sleep,
        now: Callable[[], float] = time.monotonic,
        camera: CameraSource | None = None,
    ) -> None:
        self._mount, self._camera = mount, camera
        self._rate = self._seen_deg_s = rate_deg_s
        self._sleep, self._now = sleep, now

    def turn(self, direction: Direction, degrees: float) -> Task[float | None]:
        """Several bounded motions, each waited for; stopped whenever this is given up."""
        begun = self._axis_deg(direction)
        turned, motions = 0.0, 0
        try:
            while degrees - turned > NEAR_ENOUGH_DEG and motions < MOST_MOTIONS:
                motions += 1
                left = degrees - turned
                yield Progress(
                    "turn", turned / degrees, tr("{left:.0f}° {direction}", left=left, direction=tr(direction))
                )
                seconds = min(left / self._seen_deg_s, LONGEST_MOTION_S)
                self._mount.move(direction, self._rate, seconds)
                yield from self._wait(seconds)
                turned = self._moved_on(turned, self._axis_deg(direction) - begun, seconds)
        finally:
            self._mount.stop()  # on a cancel and on every error too
        self._sleep(SETTLE_S)
        if self._camera is not None:
            yield Progress("settle")
            self._camera.next_frame(TRAILED_S)
        return turned

    def _axis_deg(self, direction: Direction) -> float:
        """The reported coordinate of the axis that a direction turns."""
        here = self._mount.position()
        return here.dec_deg if direction.in_dec else here.ra_deg

    def _moved_on(self, before: float, moved_deg: float, seconds: float) -> float:
        """How far it has turned in all, as it reports; its rate is learned from that."""
        turned = abs(wrapped(moved_deg))  # RA may pass from 360° to 0°
        step = turned - before
        if step <= 0.02 * self._seen_deg_s * seconds:  # next to nothing of what was expected
            raise RefusedError("The mount reports that it has not moved. Is it parked, or at a limit?")
        self._seen_deg_s = step / seconds
        return turned

    def _wait(self, seconds: float) -> Task[None]:
        begun = self._now()
        while self._now() - begun < seconds or self._mount.state().slewing:
            if self._now() - begun > SLOW * seconds + 10.0:
                raise RefusedError("The mount still reports that it is moving. Kochab stopped it.")
            yield Progress("turn")
            self._sleep(0.1)


@frozen
class Sweep:
    """How a measurement is to be taken. ``goal_arcsec`` is for its uncertainty, both directions.

    ``turn_deg`` None plans the turn from the first frame's own errors, and the number of frames
    from ``frames`` to ``most_frames`` when no turn is enough. ``backwards`` is the direction of a
    sweep before: this one goes the other way and ends where that began.
    """

    turn_deg: float | None = None
    frames: int = 5
    most_frames: int = 5
    goal_arcsec: float = 10.0
    least_deg: float = 30.0
    most_deg: float = 90.0
    backwards: Direction | None = None


@frozen(eq=False)
class Measured:
    """A measurement, the path of its sweep, all findings, and how far along the path RA stands in the end."""

    measurement: Measurement
    path: SweepPath
    findings: tuple[PolarFinding, ...]
    went_deg: float = 0.0

    @property
    def ahead(self) -> tuple[Direction, float]:
        """The direction of the sweep that the next one goes against, and how far: the longer way along this path."""
        left = self.path.turn_deg - self.went_deg
        direction = self.path.direction if self.went_deg >= left else _opposite(self.path.direction)
        return direction, max(self.went_deg, left)


def measure_axis(
    source: SightingSource,
    turner: Turner,
    settings: MeasureSettings,
    sweep: Sweep | None = None,
    controls: PolarControls | None = None,
    before: Droop = UNKNOWN,
    confirmed: Callable[[Measurement], object] = lambda found: None,
) -> Task[Measured]:
    """Take frames while ``turner`` turns the axis, and measure it.

    Raises NotMeasuredError when frames stop coming or have no solution, or they give no axis.

    Parameters
    ----------
    source : SightingSource
        Gives solved frames.
    turner : Turner
        Turns the RA axis.
    settings : MeasureSettings
        Site, pole and refraction.
    sweep : Sweep or None
        How far and how many frames; None for the usual.
    controls : PolarControls or None
        What the person presses; None: nothing.
    before : Droop
        What is known of the tube's droop.
    confirmed : Callable[[Measurement], object]
        A hand is asked for no more frames once it gives anything for a measurement: an earlier one agrees with it.
    """
    sweep, controls = sweep or Sweep(), controls or PolarControls()
    watch = RestWatch(source, settings, controls)
    yield PolarUpdate("measure", 0.0, tr("Taking the first frame."))
    first = yield from watch.still()
    if turner.by_hand:  # to whom a long turn is no more work than a short one
        sweep = replace(sweep, least_deg=max(sweep.least_deg, HAND_DEG))
    path = plan_path(first, settings, sweep)
    sweep = replace(sweep, frames=frames_needed(first, settings, sweep, path, HAND_FRAMES if turner.by_hand else 1))
    enough = (lambda found: _far(found) or bool(confirmed(found))) if turner.by_hand else None
    return (yield from sweep_from(first, path, watch, turner, sweep, before, enough))


def sweep_from(
    first: LocalAttitude,
    path: SweepPath,
    watch: RestWatch,
    turner: Turner,
    sweep: Sweep,
    before: Droop = UNKNOWN,
    enough: Callable[[Measurement], bool] | None = None,
) -> Task[Measured]:
    """The rest of a sweep, at whose first place a frame is taken already.

    A hand makes the whole turn at once, and goes back in steps where more places are needed; several frames of each
    cost it nothing.

    Parameters
    ----------
    first : LocalAttitude
        The attitude at the first place.
    path : SweepPath
        Where the turn leads.
    watch : RestWatch
        Waits for frames of a mount at rest.
    turner : Turner
        Turns the RA axis.
    sweep : Sweep
        How many places.
    before : Droop
        What is known of the tube's droop.
    enough : Callable[[Measurement], bool] or None
        Whether a measurement needs no more places; None: all are taken.
    """
    settings, controls, each = watch.settings, watch.controls, HAND_FRAMES if turner.by_hand else 1
    seen, places = (yield from watch.rest(first, 0, each)), 1
    steps = _hand_turns(path, sweep.frames) if turner.by_hand else _even_turns(path, sweep.frames)
    slips: list[PolarFinding] = []
    result: Measurement | NoAxis = NoAxis(tr("no axis yet"), tr("Rotate RA."))
    while places < sweep.frames:
        way, step = steps[places - 1]
        yield PolarUpdate("turn", places / sweep.frames, _next_turn(path, way, step))
        now, reported = yield from _turned(watch, turner, way, step, seen[-1])
        if reported is not None and (slip := slipping(reported, turned_deg(seen[-1], now))):
            slips.append(slip)
        seen += yield from watch.rest(now, places, each)
        places += 1
        result = measure_local(seen, settings, before)
        yield _measured_so_far(result, seen[0], slips, sweep, places)
        if isinstance(result, Measurement) and _ends(result, controls, enough):
            break
    if isinstance(result, NoAxis):
        raise NotMeasuredError(result.sentence)
    went = sum(step if way is path.direction else -step for way, step in steps[: places - 1])
    return Measured(result, path, (*slips[:1], *result.findings), went)


def _ends(found: Measurement, controls: PolarControls, enough: Callable[[Measurement], bool] | None) -> bool:
    """Whether there are enough frames: two alone are enough only where an earlier sweep agrees."""
    return (found.checked and controls.take(PolarButton.ENOUGH)) or bool(enough and enough(found))


def _turned(
    watch: RestWatch, turner: Turner, way: Direction, degrees: float, last: LocalAttitude
) -> Task[tuple[LocalAttitude, float | None]]:
    """The first attitude at rest after a turn, and how far the mount says that it turned."""
    watch.controls.take(PolarButton.TURNED)  # pressed before it was asked for: it confirms nothing
    reported = yield from turner.turn(way, degrees)
    return (yield from watch.still(last, degrees if turner.by_hand else 0.0)), reported


# Least turn by hand, frames at each stop, and sigmas beyond which the bolts come before more frames
HAND_DEG, HAND_FRAMES, FAR_SIGMAS = 60.0, 4, 12.0


def _even_turns(path: SweepPath, frames: int) -> list[tuple[Direction, float]]:
    """The turns between frames, all alike."""
    return [(path.direction, path.turn_deg / (frames - 1))] * (frames - 1)


def _hand_turns(path: SweepPath, frames: int) -> list[tuple[Direction, float]]:
    """All the way, then back in steps: two frames tell most, and the last is where the first was."""
    back = frames - 2
    return [(path.direction, path.turn_deg), *[(_opposite(path.direction), path.turn_deg / max(back, 1))] * back]


def _far(found: Measurement) -> bool:
    """Whether bolts are to be turned before more frames are of any use."""
    return (
        found.checked
        and not found.spoilt
        and found.error.total_arcsec > FAR_SIGMAS * found.error.with_systematics.uncertainty_arcsec
    )


def optics_of(attitude: LocalAttitude, frames: int = 1) -> Optics:
    """The errors of a frame by its own covariance, or of the mean of so many ``frames`` taken at one place."""
    x, y, roll = np.sqrt(np.diag(attitude.covariance) / frames) / ARCSEC
    return Optics(float(np.sqrt((x * x + y * y) / 2.0)), float(roll))  # the root mean square of both tilts


def plan_path(first: LocalAttitude, settings: MeasureSettings, sweep: Sweep) -> SweepPath:
    """How far and in which direction to turn, from the first frame."""
    rho = _from_pole_deg(first, settings)
    wanted = sweep.turn_deg
    if wanted is None:
        needed = turn_needed_deg(optics_of(first), rho, sweep.goal_arcsec, sweep.frames)
        wanted = float(np.clip(needed or sweep.most_deg, sweep.least_deg, sweep.most_deg))
    if sweep.backwards is None:
        return best_path(first.boresight, settings, wanted)
    return sweep_path(first.boresight, settings, _opposite(sweep.backwards), wanted)


def foreseen_arcsec(first: LocalAttitude, settings: MeasureSettings, sweep: Sweep) -> float:
    """How surely a sweep from here would find the axis, both directions; infinite when too low."""
    path = plan_path(first, settings, sweep)
    if not path.good:
        return float("inf")
    frames = frames_needed(first, settings, sweep, path)
    return weighted_arcsec(optics_of(first), _from_pole_deg(first, settings), path.turn_deg, frames)


def frames_needed(first: LocalAttitude, settings: MeasureSettings, sweep: Sweep, path: SweepPath, each: int = 1) -> int:
    """The fewest places that reach the goal; the most allowed when none do.

    Parameters
    ----------
    first : LocalAttitude
        The attitude at the first place.
    settings : MeasureSettings
        Site, pole and refraction.
    sweep : Sweep
        Goal, fewest and most places.
    path : SweepPath
        How far RA turns.
    each : int
        Frames at every place.
    """
    optics, rho = optics_of(first, each), _from_pole_deg(first, settings)
    for count in range(sweep.frames, sweep.most_frames):
        if weighted_arcsec(optics, rho, path.turn_deg, count) <= sweep.goal_arcsec:
            return count
    return max(sweep.frames, sweep.most_frames)


def _from_pole_deg(first: LocalAttitude, settings: MeasureSettings) -> float:
    pole = pole_direction(settings.site, settings.pole, settings.refraction)
    return float(np.degrees(angle_between(first.boresight, pole)))


def _next_turn(path: SweepPath, way: Direction, step: float) -> str:
    text = (
        tr("Next: {step:.0f}° {direction}.")
        if path.good
        else tr("Next: {step:.0f}° {direction}, down to {low:.0f}° altitude. Another part of the sky is better.")
    )
    return text.format(step=step, direction=tr(way), low=path.lowest_deg)


def _measured_so_far(
    result: Measurement | NoAxis, first: LocalAttitude, slips: list[PolarFinding], sweep: Sweep, places: int
) -> PolarUpdate:
    fraction = places / sweep.frames
    if isinstance(result, NoAxis):
        return PolarUpdate("measure", fraction, result.reason)
    more = more_turn_deg(optics_of(first), result.rho_deg, result.fit.turns_rad, sweep.goal_arcsec)
    words = tr("Uncertainty {angle}.", angle=angle_in_words(result.error.uncertainty_arcsec))
    if more:
        more_words = tr("Rotate {more:.0f}° more for {goal:.0f}″.", more=more, goal=sweep.goal_arcsec)
        words = " ".join((words, more_words))
    found = (*slips, *result.findings)
    return PolarUpdate("measure", fraction, words, result, findings=found, more_turn_deg=more)


def back_at_start(
    source: SightingSource, turner: Turner, first: Measured, controls: PolarControls | None = None
) -> Task[Measured]:
    """Turn RA back to where the sweep began, and measure with one more frame from there: it shows what crept.

    ``first`` comes back as it is where RA is there already.

    Raises NotMeasuredError when frames stop coming or have no solution.

    Parameters
    ----------
    source : SightingSource
        Gives solved frames.
    turner : Turner
        Turns the RA axis.
    first : Measured
        The sweep; it comes back as it is where RA is at its start already.
    controls : PolarControls or None
        What the person presses; None: nothing.
    """
    measurement, way = first.measurement, _opposite(first.path.direction)
    if (turn := from_start_deg(measurement)) < BACK_DEG:
        return first
    words = tr("Back to the start of RA, for one more frame to check for creep.")
    yield PolarUpdate("turn", 0.0, words, measurement, findings=first.findings)
    watch = RestWatch(source, measurement.settings, controls or PolarControls())
    last, _ = yield from _turned(watch, turner, way, turn, measurement.attitudes[-1])
    seen = [*measurement.attitudes, replace(last, sweep=measurement.attitudes[-1].sweep)]
    result = measure_local(seen, measurement.settings, measurement.before)
    if isinstance(result, NoAxis):
        return first
    slips = [f for f in first.findings if f.kind is PolarFindingKind.SLIPPING]
    return Measured(result, first.path, (*slips, *result.findings))


# -- The second sweep: the same axis at another declination, which measures flexure ------------


def second_sweep(
    source: SightingSource,
    turner: Turner,
    first: Measured,
    sweep: Sweep | None = None,
    controls: PolarControls | None = None,
) -> Task[Measured]:
    """Turn the declination axis, sweep again, and measure from all frames of both sweeps.

    Nobody may touch the bolts between the two.

    Raises NotMeasuredError when frames stop coming or have no solution, or the second sweep gives no axis.

    Parameters
    ----------
    source : SightingSource
        Gives solved frames.
    turner : Turner
        Turns both axes.
    first : Measured
        The first sweep; it comes back as it is, and an update says why, when no other declination would help.
    sweep : Sweep or None
        How far and how many frames; None for the usual.
    controls : PolarControls or None
        What the person presses; None: nothing.
    """
    sweep, controls = sweep or Sweep(), controls or PolarControls()
    measurement = first.measurement
    last = measurement.attitudes[-1]
    frames = max(sweep.frames, sweep.most_frames)
    turn = sweep.turn_deg or max(sweep.most_deg, measurement.turn_deg)
    plan = plan_second(measurement, optics_of(last), frames, turn)
    if plan is None:
        yield PolarUpdate("turn", 1.0, tr(NO_SECOND_SWEEP), measurement=measurement, findings=first.findings)
        return first
    yield PolarUpdate("turn", 0.0, _second_sweep_ahead(plan), measurement=measurement)
    watch = RestWatch(source, measurement.settings, controls)
    if plan.back_deg:
        last, _ = yield from _turned(watch, turner, _opposite(first.path.direction), plan.back_deg, last)
    begin, _ = yield from _turned(watch, turner, plan.direction, plan.degrees, last)
    again = replace(sweep, frames=frames, backwards=None)
    second = yield from sweep_from(begin, plan.path, watch, turner, again, measurement.before)
    both = combine_measurements(measurement, second.measurement)
    slips = [f for f in second.findings if f.kind is PolarFindingKind.SLIPPING]
    return replace(second, measurement=both, findings=(*slips, *both.findings))


NO_SECOND_SWEEP = tr_noop(
    "Can't measure flexure from here: other declinations are too low, or flexure hardly shifts the axis."
)


def _opposite(direction: Direction) -> Direction:
    return Direction.EAST if direction is Direction.WEST else Direction.WEST


def _second_sweep_ahead(plan: SecondSweep) -> str:
    text = (
        tr(
            "Second sweep to measure flexure. Don't touch the bolts. Next: RA {back:.0f}° back, then declination "
            "{degrees:.0f}° {direction}, to about {declination:+.0f}°. Expected uncertainty: {angle}, flexure included."
        )
        if plan.back_deg
        else tr(
            "Second sweep to measure flexure. Don't touch the bolts. Next: declination {degrees:.0f}° {direction}, "
            "to about {declination:+.0f}°. Expected uncertainty: {angle}, flexure included."
        )
    )
    return text.format(
        back=plan.back_deg,
        degrees=plan.degrees,
        direction=tr(plan.direction),
        declination=plan.declination_deg,
        angle=angle_in_words(plan.foreseen_arcsec),
    )


# -- Nobody turns the axis: the mount tracks one place, and the drift shows it -----------------

MOST_POINTS, LOOK_S = 240, 5.0
"""Frames that are kept of a long drift, and seconds from one look at the axis to the next."""


def measure_drifting(
    source: SightingSource, settings: MeasureSettings, controls: PolarControls, guided: bool | None = None
) -> Task[Drift]:
    """Take frames of a mount that tracks until the axis is known to 30 arcsec, or somebody says that it is enough.

    Raises NotMeasuredError when frames stop coming or have no solution, and when nothing tracks.

    Parameters
    ----------
    source : SightingSource
        Gives solved frames.
    settings : MeasureSettings
        Site, pole and refraction.
    controls : PolarControls
        What the person presses.
    guided : bool or None
        Whether a guider holds the stars; None judges by how they wander.
    """
    watch, looked = RestWatch(source, settings, controls), -LOOK_S
    seen: list[Sighting] = []
    yield PolarUpdate("measure", 0.0, tr("Nobody turns the axis: the mount tracks one place."))
    while True:
        seen.append((yield from watch.sighting()))
        if len(seen) > MOST_POINTS:
            seen = [*seen[:-1:2], seen[-1]]  # every other one: the whole span, in bounded memory
        enough, span = controls.take(PolarButton.ENOUGH), (seen[-1].time_utc - seen[0].time_utc).total_seconds()
        if not enough and span - looked < LOOK_S:
            continue
        looked = span
        result = measure_drift(stretches_of(seen, settings, guided), settings)
        if isinstance(result, Drift):
            yield drifted(result)
            if enough or result.minutes_more == 0.0:
                return result
        elif result.kind is PolarFindingKind.FIXED_TRIPOD:
            raise NotMeasuredError("The camera stands still while the sky turns. Turn the mount’s tracking on.")
        elif enough:
            raise NotMeasuredError(result.sentence)
        else:
            yield PolarUpdate("measure", None, tr("{seconds:.0f} s: a first result after a minute.", seconds=span))


def drifted(drift: Drift) -> PolarUpdate:
    """What the drift shows so far."""
    share = None if drift.minutes_more is None else drift.minutes / (drift.minutes + drift.minutes_more)
    sentence = tr_n(
        "{angle} after {n} minute of drift.",
        "{angle} after {n} minutes of drift.",
        round(drift.minutes),
        angle=drift.words[:1].upper() + drift.words[1:],
    )
    return PolarUpdate("measure", share, sentence, drift=drift, findings=drift.findings)
