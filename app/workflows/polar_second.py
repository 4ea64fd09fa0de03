"""The second sweep: the same axis at another declination, which shows how the tube bends."""

from dataclasses import replace

from app.core.mount import Direction
from app.core.progress import Task
from app.polar.findings import Kind
from app.polar.measure import together
from app.polar.second import SecondSweep, plan_second
from app.workflows.polar_measure import Measured, Sweep, optics_of, sweep_from
from app.workflows.polar_sources import SightingSource
from app.workflows.polar_turners import Turner
from app.workflows.polar_update import PolarControls, PolarUpdate
from app.workflows.polar_watch import Watch


def second_sweep(
    source: SightingSource,
    turner: Turner,
    first: Measured,
    sweep: Sweep | None = None,
    controls: PolarControls | None = None,
) -> Task[Measured]:
    """Turn the declination axis, sweep again, and measure from all frames of both sweeps.

    Nobody may touch the bolts between the two. ``first`` comes back as it is, and words say why,
    when no other declination would help from there.

    Raises
    ------
    app.workflows.polar_watch.NotMeasuredError
        Frames stop coming or have no answer, or the second axis cannot be had from them.

    """
    sweep, controls = sweep or Sweep(), controls or PolarControls()
    measurement = first.measurement
    last = measurement.attitudes[-1]
    frames = max(sweep.frames, sweep.most_frames)
    turn = sweep.turn_deg or max(sweep.most_deg, measurement.turn_deg)
    plan = plan_second(measurement, optics_of(last), frames, turn)
    if plan is None:
        yield PolarUpdate("turn", 1.0, HELPLESS, measurement=measurement, findings=first.findings)
        return first
    yield PolarUpdate("turn", 0.0, _announced(plan), measurement=measurement)
    watch = Watch(source, measurement.settings, controls)
    if plan.back_deg:
        yield from turner.turn(_back(first.way.direction), plan.back_deg)
        last = yield from watch.still(last, plan.back_deg if turner.by_hand else 0.0)
    yield from turner.turn_declination(plan.direction, plan.degrees)
    begin = yield from watch.still(last, plan.degrees if turner.by_hand else 0.0)
    again = replace(sweep, frames=frames, backwards=None)
    second = yield from sweep_from(begin, plan.way, watch, turner, again, measurement.before)
    both = together(measurement, second.measurement)
    slips = [f for f in second.findings if f.kind is Kind.SLIPPING]
    return replace(second, measurement=both, findings=(*slips, *both.findings))


HELPLESS = (
    "No other declination shows more of how the tube bends: it would be too low there, or bending"
    " hardly shifts the axis from here."
)


def _back(direction: Direction) -> Direction:
    return Direction.EAST if direction is Direction.WEST else Direction.WEST


def _announced(plan: SecondSweep) -> str:
    back = f"RA {plan.back_deg:.0f} deg back, then " if plan.back_deg else ""
    return (
        f"A second sweep shows how the tube bends. Leave the bolts alone. Next: {back}the"
        f" declination axis {plan.degrees:.0f} deg to the {plan.direction}, to about"
        f" {plan.declination_deg:+.0f} deg; then the axis will be known to"
        f' {plan.foreseen_arcsec:.0f}", bending and all.'
    )
