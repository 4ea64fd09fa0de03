"""One measurement from frames on disk."""

from typing import Any

from app.core.errors import KochabError, UsageError
from app.core.progress import Progress, Task
from app.core.solution import NoSolution
from app.polar.history import History
from app.polar.measure import Measurement, NoAxis, Settings, measure
from app.polar.plan import more_turn_deg
from app.polar.words import total_in_words
from app.solve.options import SolveOptions
from app.ui.polar.tools import Tools
from app.ui.polar.wish import AlignWish
from app.workflows.polar_measure import optics_of
from app.workflows.polar_sources import sightings_of, site_of, solve_polar_file
from app.workflows.polar_update import PolarUpdate


def measure_files(wish: AlignWish, tools: Tools) -> Task[History]:
    """Solve every file, then measure.

    Raises
    ------
    KochabError
        One sentence with what to do.

    """
    if len(wish.files) < 2:
        raise UsageError("Polar alignment needs two frames or more: add another.")
    solved = yield from _solved(wish)
    sweeps = [0] * len(wish.files) + [1] * len(wish.check)
    try:
        site = site_of(solved, wish.site)
    except UsageError as error:
        raise UsageError(str(error).replace("give --site", "fill in “Your site”")) from None
    result = measure(sightings_of(solved, sweeps), Settings(site, wish.pole))
    if isinstance(result, NoAxis):
        raise KochabError(f"{result.reason[0].upper()}{result.reason[1:]}. {result.advice}")
    history = History()
    history.measured(result)
    tools.keep(history)
    yield _told(result, wish, len(solved))
    return history


def _solved(wish: AlignWish) -> Task[list[Any]]:
    options = SolveOptions(fov_deg=wish.fov_deg)
    files, solved = (*wish.files, *wish.check), []
    for number, path in enumerate(files):
        told_of = f"{path.name}, {number + 1} of {len(files)}"
        yield PolarUpdate("measure", number / len(files), told_of, frames=number)
        one = yield from _quietly(solve_polar_file(path, options))
        if isinstance(one.result, NoSolution):
            raise KochabError(
                f"{path.name} has no solution, {one.result.reason}: {one.result.advice}"
            )
        solved.append(one)
    return solved


def _told(result: Measurement, wish: AlignWish, frames: int) -> PolarUpdate:
    axis = result.error
    more = more_turn_deg(
        optics_of(result.attitudes[0]), result.rho_deg, result.fit.turns_rad, wish.goal_arcsec
    )
    return PolarUpdate(
        "done", 1.0,
        f"The axis is {total_in_words(axis)} from the pole.",
        measurement=result, findings=result.findings, more_turn_deg=more, frames=frames,
    )  # fmt: skip


def _quietly(task: Task[Any]) -> Task[Any]:
    """Its steps as cancel points only: what they say is of one frame, not of the alignment."""
    while True:
        try:
            next(task)
        except StopIteration as end:
            return end.value
        yield Progress("solve")
