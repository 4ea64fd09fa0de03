"""``kochab night FOLDER``: what a folder of frames says of the night, as one page and one table."""

import argparse
from collections.abc import Callable, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from kochab.cli.batch import outcomes_of, with_file_name
from kochab.cli.options import SEARCH, add_options, options_of
from kochab.cli.output import ProgressLine, tell
from kochab.cli.process import say
from kochab.cli.solve import named_frames, tables_of
from kochab.core.errors import UsageError, printable
from kochab.core.progress import Progress, Task
from kochab.core.values import frozen
from kochab.workflows.solution_json import Json

if TYPE_CHECKING:  # they load numpy, which --help has no need of
    from kochab.core.frame import Site
    from kochab.solver import SolveOptions
    from kochab.workflows.night.chosen_stars import ChosenStar
    from kochab.workflows.night.earlier import Compared
    from kochab.workflows.night.frame import NightFrame
    from kochab.workflows.night.summary import Night


@frozen
class FrameOfNight:
    """One file of the night."""

    file: str


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add ``night`` to the main parser."""
    parser = subparsers.add_parser(
        "night",
        description="Writes NAME-night.html, .csv and .json: focus, tilt, drift, cloud, best and worst frames, with"
        " uncertainties. Ctrl-C stops and writes what is measured. Exit code: 0 done, 1 no frame was solved,"
        " 2 unusable input, 130 stopped.",
    )
    parser.add_argument("frames", nargs="+", metavar="FOLDER", help="a folder of frames, or frames")
    parser.add_argument("--out", type=Path, default=Path(), metavar="DIR", help="where the page goes (default: here)")
    add_options(parser, "--json", "--site", *SEARCH, "--profile", "--workers", "--overwrite")
    about = "elements of satellites (TLE, OMM), asteroids and comets to name what crossed; may be repeated"
    parser.add_argument("--elements", action="append", default=[], metavar="FILE", type=Path, help=about)
    about = "a star to measure in every frame, for a light curve in page and tables; may be repeated"
    parser.add_argument("--star", action="append", default=[], metavar="NAME", help=about)
    about = "also write the light curves in the AAVSO Extended format, for this observer code"
    parser.add_argument("--aavso", metavar="CODE", help=about)
    about = "also write positions of asteroids and comets in the MPC's ADES format, for this observatory code"
    parser.add_argument("--ades", metavar="CODE", help=about)
    parser.add_argument("--observer", metavar="NAME", default="", help="who observed, for --ades")
    about = "for --ades: aperture in metres, design and detector, such as 0.2,reflector,CMOS"
    parser.add_argument("--telescope", metavar="M,DESIGN,DETECTOR", default="", help=about)
    parser.set_defaults(run=run)


@frozen
class Output:
    """A file that the night is written into, its text (nothing is written where it is empty) and what is said then."""

    path: Path
    text_of: "Callable[[Night, Sequence[Compared]], str]"
    empty: str = ""


def run(args: argparse.Namespace) -> int:
    """Measure every frame, write page and tables, print the summary."""
    from kochab.frames.atomic_file import write_atomically
    from kochab.frames.outputs import refuse_overwriting
    from kochab.workflows.night.chosen_stars import chosen_star
    from kochab.workflows.night.earlier import compared_with_earlier
    from kochab.workflows.night.guiding import guiding_of
    from kochab.workflows.night.summary import night_of

    given, files = named_frames(args.frames)
    outputs = _outputs(args, Path(given[0]).resolve().name or "frames")
    chosen = tuple(chosen_star(text) for text in args.star)
    refuse_overwriting([output.path for output in outputs], files, args.overwrite)
    if args.elements:
        tables_of(tuple(args.elements))  # a file that cannot be read is told before anything is measured
    measured: list[NightFrame] = []
    stopped = False
    try:
        elements = tuple(args.elements)
        work = partial(measure_one, options=options_of(args), site=args.site, elements=elements, chosen=chosen)
        _measure(files, work, args.workers, measured)
    except KeyboardInterrupt:
        stopped = True
        if not measured:
            raise
    night = night_of(measured, len(files), guiding_of(filter(Path.is_dir, map(Path, given))))
    if not night.frames:
        raise UsageError(f"{given[0]} has calibration frames alone.")
    earlier = compared_with_earlier(night, whole=not stopped)
    for star in {star.name for star in chosen} - {curve.name for curve in night.light_curves}:
        say(f"{star} was not measured in any frame: it is outside the field or saturated, or the frames have no time.")
    for output in outputs:
        if text := output.text_of(night, earlier):
            write_atomically(output.path, text)
        else:
            say(output.empty)
    page = str(outputs[0].path)
    tell({"night": page, **_summary(night, earlier)}, text_of(night, page, earlier), args.json)
    if stopped:
        return 130
    return int(len(night.unsolved) == len(night.frames))


def _outputs(args: argparse.Namespace, name: str) -> list[Output]:
    """The files to be written, the page first; UsageError for an option that lacks another."""
    from kochab.workflows.night.ades import Observatory, ades_psv
    from kochab.workflows.night.light_curve import aavso_extended, observer_code
    from kochab.workflows.night.page import night_page
    from kochab.workflows.night.table import night_csv, night_json_text

    if not args.out.is_dir():
        raise UsageError(f"{args.out} is not a folder.")
    start = str(args.out / f"{name}-night")
    outputs = [
        Output(Path(f"{start}.html"), lambda night, earlier: night_page(night, name, earlier)),
        Output(Path(f"{start}.csv"), lambda night, _: night_csv(night)),
        Output(Path(f"{start}.json"), night_json_text),
    ]
    if args.aavso is not None:
        observer = observer_code(args.aavso)
        if not args.star:
            raise UsageError("--aavso needs --star NAME.")
        path = Path(f"{start}-aavso.txt")
        outputs.append(Output(path, lambda night, _: aavso_extended(night.light_curves, observer)))
    if args.ades is not None:
        observatory = Observatory.parse(args.ades, args.observer, args.telescope)
        none = "No asteroid or comet was found, so no ADES file was written."
        path = Path(f"{start}.psv")
        outputs.append(Output(path, lambda night, _: ades_psv(night, observatory), none))
    return outputs


def _measure(
    files: list[str], work: "Callable[[FrameOfNight], Task[Json]]", workers: int, into: "list[NightFrame]"
) -> None:
    """Measure the files one after another, each into the list as it is done.

    Parameters
    ----------
    files : list of str
        The frames.
    work : callable
        Measures one.
    workers : int
        Processes at most.
    into : list of NightFrame
        What is done so far, also when it is interrupted.
    """
    from kochab.workflows.night.frame import NightFrame

    line = ProgressLine("night")
    with closing(outcomes_of(work, [FrameOfNight(file) for file in files], workers)) as outcomes:
        for outcome in outcomes:
            line(Progress("measure", len(into) / len(files), f"{len(into) + 1} of {len(files)} frames"))
            if "error" in outcome:
                line.clear()
                say(with_file_name(outcome["file"], outcome["error"]))
                into.append(NightFrame(outcome["file"], error=outcome["error"]))
            else:
                into.append(outcome["frame"])
    line.clear()


def measure_one(
    item: FrameOfNight,
    options: "SolveOptions",
    site: "Site | None",
    elements: tuple[Path, ...] = (),
    chosen: "tuple[ChosenStar, ...]" = (),
) -> Task[Json]:
    """One frame as the batch hands it on.

    Parameters
    ----------
    item : FrameOfNight
        Its file.
    options : SolveOptions
        How it is solved.
    site : Site or None
        Where it was taken; None for what the header says.
    elements : tuple of Path
        Files of elements beside those that the user keeps.
    chosen : tuple of ChosenStar
        Stars to follow.
    """
    from kochab.sky.elements import kept_elements
    from kochab.workflows.night.frame import measure_frame

    more = [*tables_of(elements), *kept_elements()]
    return {"file": item.file, "frame": (yield from measure_frame(item.file, options, site, more, chosen))}


def _summary(night: "Night", earlier: "Sequence[Compared]") -> Json:
    """The JSON without its frames."""
    from kochab.workflows.night.table import night_json

    return {key: value for key, value in night_json(night, earlier).items() if key != "frames"}


def text_of(night: "Night", page: str, earlier: "Sequence[Compared]" = ()) -> str:
    """For a person: a few lines, and where the page is."""
    from kochab.text.angle_text import AngleStyle, radec_text
    from kochab.text.duration_text import duration_text
    from kochab.workflows.night.earlier import QUANTITIES
    from kochab.workflows.night.events import words_of
    from kochab.workflows.night.summary import CLOUD_MAG, NO_TILT, advice_of
    from kochab.workflows.night.tracking import SIDEREAL_ARCSEC_S

    solved = len(night.frames) - len(night.unsolved)
    lines = [f"{solved} of {night.asked} frames solved, {duration_text(3600.0 * night.hours)}"]
    if len(night.frames) < night.asked:
        lines.append(f"stopped after {len(night.frames)} frames")
    if night.fwhm and night.elongation:
        lines.append(f"FWHM     {night.fwhm.text()} px, elongation {night.elongation.text()}")
    if night.focus:
        lines.append(f"focus    {night.focus.text('+')} px an hour")
    if night.shape:
        softer = f"softest {night.shape.softest}" if night.shape.tilt_chance < NO_TILT else "not sure"
        unknown = "unknown: the stars are trailed, the mount did not track"
        lines.append(f"tilt     {unknown if night.untracked else f'{night.shape.tilt.text()} px, {softer}'}")
    if sky := night.usual(night.brightness):
        lines.append(f"sky      {sky.text()} mag/arcsec2 (V)")
    if faintest := night.usual(night.faintest):
        lines.append(f"limit    V {faintest.text()} (signal-to-noise ratio 5)")
    for curve in night.light_curves:
        middle = night.usual([point.mag for point in curve.points])
        mag = f"V {middle.text()}" if middle else "no frame"
        lines.append(f"star     {curve.name}, {mag}, {len(curve.points)} frames, check {curve.check or 'none'}")
    for run in night.guiding:
        axes = f"RA {run.ra_arcsec.text()}, Dec {run.dec_arcsec.text()} arcsec RMS"
        lines.append(f"guiding  {axes} ({run.frames} frames, {duration_text(3600.0 * run.hours)})")
        if run.backlash_arcsec:
            lines.append(f"backlash Dec {run.backlash_arcsec.text()} arcsec, by the guide pulses")
    for held in night.tracking:
        ra, dec = (one.text("+") if one else "unknown" for one in held.drifts)
        drift = f"RA {ra}, Dec {dec} arcsec an hour" if any(held.drifts) else "unknown, the time is too short"
        lines.append(f"drift    {drift} ({len(held.frames)} frames, {duration_text(3600.0 * held.hours)})")
        if worm := held.periodic:
            lines.append(f"worm     {worm.amplitudes[0].text()} arcsec, period {worm.period_s.text()} s")
        if held.rate:
            lines.append(f"rate     {held.rate.text()} arcsec/s (sidereal {SIDEREAL_ARCSEC_S:.3f})")
    lines += [f"{event.time_utc:%H:%M:%S} {event.text}" for event in night.events]
    for k, one in night.crossings:
        if night.frames[k].time_utc is None:  # those with a time stand among the events
            lines.append(f"{Path(night.frames[k].file).name}: {words_of(one)}")
    for thing in night.strangers:
        place = radec_text(thing.sights[0].ra_deg, thing.sights[0].dec_deg, AngleStyle.SEXAGESIMAL)
        lines.append(f"object   {thing.name or thing.kind}, V {thing.mag.text()}, {place}, {len(thing.frames)} frames")
    if night.polar:
        lines.append(f"polar    {night.polar.words} ({night.polar.where})")
    if night.pointing.model:
        lines += [f"pointing {line}" for line in night.pointing.lines()]
    if any(night.lost):
        lines.append(f"cloud    {len(night.clouded)} frames lost more than {CLOUD_MAG:g} mag")
    for other in earlier:
        if other.unusual:
            usual = f"usual {other.usual.text()} ({other.nights} nights)"
            lines.append(f"unusual  {QUANTITIES[other.name]} {other.tonight.text()}, {usual}")
    return "\n  ".join(map(printable, [page, *lines, advice_of(night)]))
