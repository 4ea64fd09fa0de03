"""A person aligns the mount's axis: measure, turn the bolts, measure again until it is good."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from app.core.progress import Task
from app.polar.bending import UNKNOWN
from app.polar.history import History
from app.polar.measure import Measurement, Settings, together
from app.polar.tutor import BoltTutor
from app.polar.words import angle_in_words, split_in_words, total_in_words
from app.workflows.polar_adjust import End, adjust
from app.workflows.polar_measure import Measured, Sweep, measure_axis
from app.workflows.polar_second import second_sweep
from app.workflows.polar_sources import SightingSource
from app.workflows.polar_turners import Turner
from app.workflows.polar_update import PolarControls, PolarUpdate

MOST_ROUNDS = 6


@dataclass(frozen=True, slots=True)
class AlignOptions:
    """When it is good: the total and ``sure`` of its sigmas are within ``goal_arcsec``.

    ``sweep`` is how to measure. With ``second_sweep`` one at another declination follows the first,
    before any bolt is turned, and shows how the tube bends; without it only when a person asks.
    """

    goal_arcsec: float = 30.0
    sure: float = 3.0
    sweep: Sweep = field(default_factory=Sweep)
    second_sweep: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """How it ended: the last measurement, the bolts' moves, and everything that happened."""

    last: Measurement
    good: bool
    rounds: int
    moves: int
    history: History


def align(
    source: SightingSource,
    turner: Turner,
    settings: Settings,
    options: AlignOptions | None = None,
    controls: PolarControls | None = None,
    tutor: BoltTutor | None = None,
    keep: Callable[[History], None] = lambda history: None,
) -> Task[Alignment]:
    """Measure, adjust and measure again, by itself, until the error is small or cannot be told.

    Parameters
    ----------
    source, turner
        Who gives solved frames, and who turns the RA axis between them.
    keep
        Called with the history after every measurement, so that nothing is lost.

    Raises
    ------
    app.workflows.polar_watch.NotMeasuredError
        A measurement could not be brought to its end.
    app.core.errors.DeviceError
        The camera or the mount failed, or the guard refused.

    """
    options, controls = options or AlignOptions(), controls or PolarControls()
    tutor, history = tutor or BoltTutor(), History()
    sweep, rounds, droop = options.sweep, 0, UNKNOWN
    wanted = options.second_sweep
    before: Measurement | None = None
    while True:
        rounds += 1
        measured = yield from measure_axis(source, turner, settings, sweep, controls, droop)
        if before is not None:
            both = together(before, measured.measurement)
            measured = replace(measured, measurement=both, findings=both.findings)
        history.measured(measured.measurement)
        keep(history)
        if controls.take_second_sweep() or wanted:
            both_sweeps = yield from second_sweep(source, turner, measured, sweep, controls)
            wanted, droop = False, both_sweeps.measurement.droop
            if both_sweeps is not measured:
                measured = both_sweeps
                history.measured(measured.measurement)
                keep(history)
        error = measured.measurement.error
        good = _good(measured, options)
        if good or rounds == MOST_ROUNDS:
            yield _done(measured, good, tutor.moves)
            return Alignment(measured.measurement, good, rounds, tutor.moves, history)
        sweep = replace(sweep, backwards=measured.way.direction, turn_deg=measured.way.turn_deg)
        likely = error.total_arcsec + error.sigma_total_arcsec <= options.goal_arcsec
        if likely and before is None:  # only not sure: a second sweep costs no move of a bolt
            before = measured.measurement
            doubt = _once_more(measured, tutor.moves)
            history.told(before.time_utc, error, doubt.detail)
            yield doubt
            continue
        adjusted = yield from adjust(source, measured.measurement, tutor, controls, history)
        quiet = adjusted.end is End.THERE and not adjusted.turned
        before = measured.measurement if quiet else None  # no bolt was turned: both count


def _good(measured: Measured, options: AlignOptions) -> bool:
    """Whether the total and some of its sigmas are within the goal, or no more can be told."""
    error = measured.measurement.error
    reach = error.total_arcsec + options.sure * error.sigma_total_arcsec
    return reach <= options.goal_arcsec or error.below_uncertainty


def _once_more(measured: Measured, moves: int) -> PolarUpdate:
    error = measured.measurement.error
    told = (
        f"{angle_in_words(error.total_arcsec)} is within the goal, but with noise of"
        f" {angle_in_words(error.sigma_total_arcsec)} not surely: leave the bolts alone, it is"
        " measured once more."
    )
    return PolarUpdate(
        "measure", None, told, measurement=measured.measurement, findings=measured.findings,
        moves=moves,
    )  # fmt: skip


def _done(measured: Measured, good: bool, moves: int) -> PolarUpdate:
    error = measured.measurement.error
    told = f"The axis is {total_in_words(error)} from the pole"
    told += "." if good else ": that is not yet good, begin again when the cause is found."
    split = split_in_words(error)
    told += f" {split[0].upper()}{split[1:]}"
    one = len(measured.measurement.looks) == 1 and measured.measurement.before == UNKNOWN
    told += "; a second sweep at another declination shows it." if one else "."
    return PolarUpdate(
        "done", 1.0, told, measurement=measured.measurement, findings=measured.findings,
        moves=moves,
    )  # fmt: skip
