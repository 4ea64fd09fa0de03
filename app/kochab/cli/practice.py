"""``kochab practice``: a simulated telescope to try everything on, until Ctrl-C."""

import argparse
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

from kochab.cli.options import add_options, between, site, valued, whole
from kochab.cli.output import tell
from kochab.core.errors import UsageError

if TYPE_CHECKING:
    from kochab.core.frame import Site
    from kochab.gear.session import Practice

PRACTISE = "kochab.simulate.practice:practise"  # named, not imported: no face knows the simulated sky
MIN_FOV_DEG = 0.8  # narrower, the catalogue has too few stars
Say = Callable[[dict[str, Any], str], None]


def add_parser(subparsers: "argparse._SubParsersAction[Any]") -> None:
    """Add ``practice`` to the command line."""
    parser = subparsers.add_parser(
        "practice",
        description="Simulates sky, camera and mount until Ctrl-C or 'quit', then prints a score."
        " Type commands to turn knobs and axes; 'help' lists them.",
    )
    parser.add_argument("--driver", default="lx200", metavar="NAME", help="the mount's protocol")
    parser.add_argument("--site", type=_site, metavar="LAT,LON[,H]", help="default: where it is midnight now")
    for name, metavar, default, kind, text in (
        ("--misalign", "ARCMIN", None, between(0.0, 600.0, "arcmin"), "polar alignment error (default: 20-90)"),
        ("--lost", "DEG", 3.0, between(0.0, 90.0, "deg"), "pointing error (3)"),
        ("--fov", "DEG", 2.4, between(MIN_FOV_DEG, 60.0, "deg"), "field of view (2.4)"),
        ("--exposure", "S", 2.0, between(0.001, 600.0, "s"), "exposure of a frame (2)"),
        ("--rate", "X", 1.0, between(0.1, 1000.0, "times"), "speed of time (1)"),
        ("--seed", "N", 0, whole(0, what="whole number"), "number of the night (0)"),
    ):
        parser.add_argument(name, **valued(metavar, text, kind, default=default))
    parser.add_argument("--socket", action="store_true", help="TCP instead of a pseudo-terminal")
    parser.add_argument("--folder", metavar="DIR", help="save every frame there as FITS")
    parser.add_argument("--faults", action="store_true", help="clouds, wind, a kick, a slipping clutch, a bad cable")
    add_options(parser, "--json")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Practise until Ctrl-C, "quit" or the end of the typed lines' patience; then the score."""
    module, _, name = PRACTISE.partition(":")
    practise: Callable[..., Practice] = getattr(import_module(module), name)
    say: Say = partial(tell, as_json=args.json)
    night = (args.driver, args.seed, args.site, args.misalign, args.lost, args.rate, args.faults)
    practice = practise(*night, args.folder, args.exposure, args.socket, args.fov)
    try:
        say(_begin_json(practice), _begin_text(practice))
        _listen(practice, say)
    except KeyboardInterrupt:
        pass
    finally:
        end = practice.score()
        practice.stop()
    say({"event": "score", **asdict(end)}, end.as_text())
    return 0


def _listen(practice: "Practice", say: Say) -> None:
    """Obey typed lines; with nobody to type, go on until Ctrl-C."""
    over = threading.Event()

    def listen() -> None:
        for line in sys.stdin:
            if line.strip().lower() in ("quit", "exit", "q"):
                over.set()
                return
            try:
                done = practice.do(line)
            except UsageError as error:
                say({"error": str(error)}, str(error))
            else:
                if done:
                    say({"event": "done", "text": done}, done)

    threading.Thread(target=listen, daemon=True).start()
    # The main thread keeps the night going and hears Ctrl-C; reading a line would block both.
    while not over.wait(0.2):
        practice.rig.happen()
        if practice.trouble:
            say({"error": practice.trouble}, practice.trouble)
            practice.trouble = ""


def _begin_json(practice: "Practice") -> dict[str, Any]:
    site, folder = practice.rig.config.site, practice.folder
    return {
        "event": "ready",
        "driver": practice.driver,
        "port": practice.port,
        "site": [site.latitude_deg, site.longitude_deg, site.height_m],
        "time_utc": practice.rig.clock.now_utc().isoformat(timespec="seconds"),
        "folder": None if folder is None else str(folder),
        "seed": practice.rig.config.seed,
    }


def _begin_text(practice: "Practice") -> str:
    site, folder = practice.rig.config.site, practice.folder
    line = f"--driver {practice.driver} --port {practice.port}"
    if practice.driver == "skywatcher":
        line += " --home power-on"
    place = f"--site={site.latitude_deg:g},{site.longitude_deg:g}"
    now = practice.rig.clock.now_utc().strftime("%Y-%m-%d %H:%M:%S UTC")
    lines = [
        f"A simulated telescope at {place[7:]}, where it is {now}.",
        f"Its mount answers at {practice.port} as {practice.driver}. Try, in another window:",
        f"  kochab mount position {line}",
        f"  kochab mount goto M42 {line} {place} --yes --allow-flip",
    ]
    if abs(practice.rig.clock.now_unix() - time.time()) > 60.0:
        lines.insert(1, "It is daylight there, so its clock differs from the computer's.")
    if folder is not None:
        lines += [
            f"Its camera writes frames into {folder}:",
            f"  kochab live --source folder --address {folder}",
            f"  kochab polar {folder}/FIRST.fits {folder}/SECOND.fits {place}",
        ]
    return "\n".join([*lines, "Type help for the knobs and axes you can turn; Ctrl-C ends."])


def _site(text: str) -> "Site":
    place = site(text)
    if abs(place.latitude_deg) > 89.0:
        raise argparse.ArgumentTypeError(f"{text} is too near a pole: latitude within 89 deg")
    return place
