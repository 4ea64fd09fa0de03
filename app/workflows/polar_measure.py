"""The measuring phase: frames while the RA axis turns, until the axis is known well enough."""

from dataclasses import dataclass, replace

import numpy as np

from app.core.attitude import angle_between
from app.core.mount import Direction
from app.core.progress import Task
from app.polar.bending import UNKNOWN, Droop
from app.polar.findings import Finding
from app.polar.measure import Measurement, NoAxis, Settings, measure_local
from app.polar.path import Way, best_way, way
from app.polar.plan import Optics, more_turn_deg, turn_needed_deg, weighted_arcsec
from app.polar.poles import pole_direction
from app.polar.rotations import ARCSEC
from app.polar.sighting import LocalAttitude
from app.polar.slip import slipping
from app.workflows.polar_sources import SightingSource
from app.workflows.polar_turners import Turner
from app.workflows.polar_update import PolarControls, PolarUpdate
from app.workflows.polar_watch import NotMeasuredError, Watch, turned_deg


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """A measurement, the way its sweep went, and what was noticed beside it."""

    measurement: Measurement
    way: Way
    findings: tuple[Finding, ...]


def measure_axis(
    source: SightingSource,
    turner: Turner,
    settings: Settings,
    sweep: Sweep | None = None,
    controls: PolarControls | None = None,
    before: Droop = UNKNOWN,
) -> Task[Measured]:
    """Take frames while ``turner`` turns the axis, and measure it.

    ``before`` is what is known of the tube's droop.

    Raises
    ------
    NotMeasuredError
        Frames stop coming or have no answer, or the axis cannot be had from them.

    """
    sweep, controls = sweep or Sweep(), controls or PolarControls()
    watch = Watch(source, settings, controls)
    yield PolarUpdate("measure", 0.0, "The first frame.")
    seen = [(yield from watch.still())]
    path = plan_way(seen[0], settings, sweep)
    sweep = replace(sweep, frames=frames_needed(seen[0], settings, sweep, path))
    return (yield from sweep_from(seen[0], path, watch, turner, sweep, before))


def sweep_from(
    first: LocalAttitude, path: Way, watch: Watch, turner: Turner, sweep: Sweep,
    before: Droop = UNKNOWN,
) -> Task[Measured]:  # fmt: skip
    """The rest of a sweep of ``sweep.frames``, whose first frame is taken already."""
    seen, settings, controls = [first], watch.settings, watch.controls
    step = path.turn_deg / (sweep.frames - 1)
    slips: list[Finding] = []
    result: Measurement | NoAxis = NoAxis("no axis yet", "Turn the RA axis.")
    while len(seen) < sweep.frames:
        yield PolarUpdate(
            "turn", len(seen) / sweep.frames, _announced(path, step), frames=len(seen)
        )
        yield from turner.turn(path.direction, step)
        now = yield from watch.still(seen[-1], step if turner.by_hand else 0.0)
        asked = turner.told_deg
        if asked is not None and (slip := slipping(asked, turned_deg(seen[-1], now))):
            slips.append(slip)
        seen.append(now)
        result = measure_local(seen, settings, before)
        yield _told(result, seen, slips, sweep)
        if controls.take_enough() and isinstance(result, Measurement):
            break
    if isinstance(result, NoAxis):
        raise NotMeasuredError(f"{result.reason[0].upper()}{result.reason[1:]}. {result.advice}")
    return Measured(result, path, (*slips[:1], *result.findings))


def optics_of(attitude: LocalAttitude) -> Optics:
    """What a frame's own covariance says of the optics."""
    x, y, roll = np.sqrt(np.diag(attitude.covariance)) / ARCSEC
    return Optics(float(np.sqrt((x * x + y * y) / 2.0)), float(roll))


def plan_way(first: LocalAttitude, settings: Settings, sweep: Sweep) -> Way:
    """How far and which way to turn, from the first frame."""
    rho = _from_pole_deg(first, settings)
    wanted = sweep.turn_deg
    if wanted is None:
        needed = turn_needed_deg(optics_of(first), rho, sweep.goal_arcsec, sweep.frames)
        wanted = float(np.clip(needed or sweep.most_deg, sweep.least_deg, sweep.most_deg))
    if sweep.backwards is None:
        return best_way(first.boresight, settings, wanted)
    back = Direction.EAST if sweep.backwards is Direction.WEST else Direction.WEST
    return way(first.boresight, settings, back, wanted)


def foreseen_arcsec(first: LocalAttitude, settings: Settings, sweep: Sweep) -> float:
    """How surely a sweep from here would find the axis, both directions; infinite when too low."""
    path = plan_way(first, settings, sweep)
    if not path.good:
        return float("inf")
    frames = frames_needed(first, settings, sweep, path)
    rho = _from_pole_deg(first, settings)
    return weighted_arcsec(optics_of(first), rho, path.turn_deg, frames)


def frames_needed(first: LocalAttitude, settings: Settings, sweep: Sweep, path: Way) -> int:
    """As few frames, of those allowed, as reach the goal; the most allowed when none do."""
    optics, rho = optics_of(first), _from_pole_deg(first, settings)
    for count in range(sweep.frames, sweep.most_frames):
        if weighted_arcsec(optics, rho, path.turn_deg, count) <= sweep.goal_arcsec:
            return count
    return max(sweep.frames, sweep.most_frames)


def _from_pole_deg(first: LocalAttitude, settings: Settings) -> float:
    pole = pole_direction(settings.site, settings.pole, settings.air)
    return float(np.degrees(angle_between(first.boresight, pole)))


def _announced(path: Way, step: float) -> str:
    told = f"Next: {step:.0f} deg to the {path.direction}"
    if path.good:
        return f"{told}."
    return f"{told}; it comes down to {path.lowest_deg:.0f} deg: another part of the sky is better."


def _told(
    result: Measurement | NoAxis, seen: list[LocalAttitude], slips: list[Finding], sweep: Sweep
) -> PolarUpdate:
    fraction = len(seen) / sweep.frames
    if isinstance(result, NoAxis):
        return PolarUpdate("measure", fraction, result.reason, frames=len(seen))
    optics = optics_of(seen[0])
    more = more_turn_deg(optics, result.rho_deg, result.fit.turns_rad, sweep.goal_arcsec)
    sure = f'The axis is known to {result.error.uncertainty_arcsec:.0f}"'
    if more:
        sure += f'; turn {more:.0f} deg more for {sweep.goal_arcsec:.0f}"'
    return PolarUpdate(
        "measure", fraction, f"{sure}.", measurement=result,
        findings=(*slips, *result.findings), more_turn_deg=more, frames=len(seen),
    )  # fmt: skip
