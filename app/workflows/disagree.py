"""A person asks why the mount says another place than the sky."""

from datetime import datetime

from app.core.errors import DeviceError
from app.core.hint import Site
from app.core.progress import Progress, Task
from app.core.solution import NoSolution, Solution
from app.mounts.beliefs import Beliefs
from app.mounts.guard import Guard
from app.solve.disagreement import Finding, Sighting, investigate
from app.workflows.fresh_frame import SolveNow
from app.workflows.goto_target import answered


def sighted(
    mount: Guard, solution: Solution, time_utc: datetime | None = None, site: Site | None = None
) -> Sighting:
    """A solve beside what the mount says now of its place, time, site and state.

    ``time_utc`` and ``site`` are the computer's, by the guard's clock and site when None.
    """
    now = mount.clock()
    said = answered(mount.position)
    state = answered(mount.state)
    return Sighting(
        solution.ra_dec_deg, said, time_utc or now, site or mount.site, state.pier_side,
        state.aligned, _at(_beliefs(mount), now, time_utc),
    )  # fmt: skip


def why_they_disagree(
    mount: Guard, solve_now: SolveNow, before: tuple[Sighting, ...] = ()
) -> Task[tuple[Finding, tuple[Sighting, ...]] | NoSolution]:
    """Solve a fresh frame and name the cause; earlier sightings of tonight help."""
    yield Progress("solving")
    solved = yield from solve_now()
    if isinstance(solved, NoSolution):
        return solved
    yield Progress("asking the mount", 0.9)
    sightings = (*before, sighted(mount, solved))
    return investigate(sightings), sightings


def _beliefs(mount: Guard) -> Beliefs:
    """Nothing when the mount does not say: it is a witness, not a condition."""
    try:
        return mount.beliefs()
    except DeviceError:
        return Beliefs()


def _at(told: Beliefs, now: datetime, then: datetime | None) -> Beliefs:
    """The mount's clock as it was when the frame was taken."""
    if told.time_utc is None or then is None:
        return told
    return Beliefs(told.site, told.time_utc + (then - now), told.utc_offset_h)
