"""``kochab mount model``: a pointing model from frames in several places; and ``spiral``: search around a place."""

import argparse
from pathlib import Path
from typing import Any

from kochab.cli.mount import NOTHING_SENT, add_camera, add_line_options, guarded_mount, mount_frames
from kochab.cli.mount.status import where
from kochab.cli.options import between, whole
from kochab.cli.output import tell, with_progress
from kochab.core.errors import NoAnswerError, RefusedError
from kochab.core.solution import NoSolution
from kochab.workflows.solution_json import Json


def add_model(actions: "argparse._SubParsersAction[Any]", name: str, text: str) -> None:
    """Add ``model``."""
    parser = actions.add_parser(
        name,
        help=text,
        description="Solves a frame where the mount points now and adds it to FILE; from four places on tells the "
        "model. Nothing moves. Then: kochab mount goto NAME --model FILE. A sync ends the model: begin a new FILE.",
    )
    parser.add_argument(
        "file", type=Path, metavar="FILE", help="the sightings so far (JSON); made when it is not there"
    )
    add_line_options(parser, run_model)
    add_camera(parser, files=True)


def run_model(args: argparse.Namespace) -> int:
    """Add a sighting, and tell the model."""
    from kochab.pointing.pointing_model import fit_model
    from kochab.workflows.pointing_model import load_sightings, model_json, save_sightings
    from kochab.workflows.recover_mount import sighted

    sightings = load_sightings(args.file)
    with mount_frames(args) as seeing, guarded_mount(args) as guard:
        solved = with_progress("model", seeing.solve_now())
        if isinstance(solved, NoSolution):
            raise NoAnswerError(f"The frame has no solution, {solved.reason}: {solved.advice}")
        taken = seeing.time_utc if args.frames else None
        sightings.append(sighted(guard, solved, taken, args.site or seeing.site))
        save_sightings(args.file, sightings)
        fields: Json = {"action": "model", "sightings": len(sightings), "model": None, **where(args, guard)}
    try:
        model = fit_model(sightings)
        lines = model.lines()
        fields["model"] = model_json(model)
    except RefusedError as error:
        lines = [str(error)]
    tell(fields, "\n".join(lines), args.json)
    return 0


def add_spiral(actions: "argparse._SubParsersAction[Any]", name: str, text: str) -> None:
    """Add ``spiral``."""
    parser = actions.add_parser(
        name, help=text, description="Ends where the last step was; Ctrl-C stops the mount where it is."
    )
    add_line_options(parser, run_spiral, ("yes", "no-site", "allow-flip", "trust-mount"))
    parser.add_argument(
        "--step",
        type=between(0.5, 120.0, "arcmin"),
        required=True,
        metavar="ARCMIN",
        help="two thirds of your field of view",
    )
    parser.add_argument("--turns", type=whole(1, 5), default=2, metavar="N", help="rings of the spiral (2)")
    parser.add_argument("--pause", type=between(0.0, 600.0, "s"), default=5.0, metavar="S", help="at each place (5)")


def run_spiral(args: argparse.Namespace) -> int:
    """Search, or say how far it would go."""
    from kochab.workflows.spiral_search import spiral_search, square_spiral

    steps = square_spiral(args.turns)
    reach = args.turns * args.step
    fields: Json = {"action": "spiral", "done": bool(args.yes), "places": len(steps), "reach_arcmin": reach}
    text = f"{len(steps)} places, up to {reach:g}′ east, west, north and south of here"
    with guarded_mount(args) as guard:
        if args.yes:
            with_progress("spiral", spiral_search(guard, args.step / 60.0, args.turns, args.pause))
        fields |= where(args, guard)
    tell(fields, text if args.yes else f"{text}\n  {NOTHING_SENT}", args.json)
    return 0
