"""A folder of frames measured in this process, one frame a step: what a face shows of the night as it grows."""

from collections.abc import Sequence
from pathlib import Path

from kochab.core.errors import FrameError, UsageError
from kochab.core.frame import Site
from kochab.core.progress import PREPARING, Progress, Task
from kochab.frames import frames_of
from kochab.sky.elements import kept_elements
from kochab.solver import SolveOptions
from kochab.text.translation import tr
from kochab.workflows.night.earlier import Compared, compared_with_earlier
from kochab.workflows.night.frame import NightFrame, measure_frame
from kochab.workflows.night.guiding import guiding_of
from kochab.workflows.night.summary import Night, night_of


def measure_folder(
    folder: Path, options: SolveOptions, site: Site | None, into: list[NightFrame]
) -> Task[tuple[Night, list[Compared]]]:
    """Measure every frame of a folder; the night, and how it compares with earlier ones.

    Raises UsageError for a folder without frames.

    Parameters
    ----------
    folder : Path
        Where the frames are.
    options : SolveOptions
        How they are solved.
    site : Site or None
        Where they were taken; None for what the headers say.
    into : list of NightFrame
        Grows by each frame, so that a night that is given up is not lost.
    """
    files = frames_in(folder)
    more = kept_elements()
    for k, file in enumerate(files):
        here = Progress("night", k / len(files), tr("Frame {k} of {n}", k=k + 1, n=len(files)))
        yield here
        try:
            into.append((yield from _as_one(measure_frame(str(file), options, site, more), here)))
        except FrameError as error:
            into.append(NightFrame(str(file), error=str(error)))
    night = night_of(into, len(files), guiding_of([folder]))
    if not night.frames:
        raise UsageError("{folder} has calibration frames alone.", folder=folder.name)
    return night, compared_with_earlier(night)


def frames_in(folder: Path) -> list[Path]:
    """The frames in a folder, by name; UsageError where it has none or cannot be read."""
    try:
        found = frames_of(folder)
    except OSError as error:
        raise UsageError("{folder} cannot be read: {why}.", folder=folder, why=error.strerror or error) from error
    if not found:
        raise UsageError("{folder} is a folder without frames.", folder=folder)
    return found


def half_done(into: Sequence[NightFrame], folder: Path) -> Night | None:
    """The night as far as it was measured; None while nothing is."""
    night = night_of(into, asked=len(frames_in(folder)))
    return night if night.frames else None


def _as_one(task: Task[NightFrame], here: Progress) -> Task[NightFrame]:
    """The same telling the place of the frame among all in place of its own steps, but for an index that is made."""
    while True:
        try:
            step = next(task)
        except StopIteration as end:
            measured: NightFrame = end.value
            return measured
        if step.stage == PREPARING and step.fraction is not None:
            text = tr("Building the small-field index: {share:.0f} %", share=100 * step.fraction)
            yield Progress(here.stage, here.fraction, text)
        else:
            yield here
