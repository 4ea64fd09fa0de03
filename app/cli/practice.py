"""``kochab practice``: a simulated telescope to try everything on, until Ctrl-C."""

import argparse
import os
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from app.cli.choices import within
from app.cli.output import to_line
from app.core.errors import UsageError
from app.core.hint import Site

if TYPE_CHECKING:
    from app.simulate.practice import Practice

Say = Callable[[dict[str, Any], str], None]


def add_parser(subparsers: "argparse._SubParsersAction[Any]") -> None:
    """Add ``practice`` to the command line."""
    parser = subparsers.add_parser(
        "practice",
        help="a simulated telescope to practise on",
        description="Simulates sky, camera and mount until Ctrl-C or 'quit', and gives a score."
        " Typed lines turn bolts and axes; 'help' lists them.",
    )
    parser.add_argument("--driver", default="lx200", metavar="NAME", help="the mount's protocol")
    parser.add_argument(
        "--site", type=_site, metavar="LAT,LON[,H]", help="default: where it is midnight now"
    )
    parser.add_argument(
        "--misalign",
        type=_arcmin,
        metavar="ARCMIN",
        help="how far the axis is off (default: 20-90)",
    )
    parser.add_argument(
        "--lost", type=_lost, default=3.0, metavar="DEG", help="how far the pointing is off (3)"
    )
    parser.add_argument(
        "--fov", type=_fov, default=2.4, metavar="DEG", help="how wide the camera sees (2.4)"
    )
    parser.add_argument("--socket", action="store_true", help="TCP instead of a pseudo-terminal")
    parser.add_argument("--folder", metavar="DIR", help="write each frame there as FITS")
    parser.add_argument(
        "--exposure", type=_exposure, default=2.0, metavar="S", help="of those frames (2)"
    )
    parser.add_argument(
        "--rate", type=_rate, default=1.0, metavar="X", help="time runs so many times faster (1)"
    )
    parser.add_argument("--seed", type=_seed, default=0, metavar="N", help="another night (0)")
    parser.add_argument(
        "--faults", action="store_true", help="clouds, wind, a kick, a weak clutch, a bad cable"
    )
    parser.add_argument("--json", action="store_true", help="one JSON object a line")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Practise until Ctrl-C, "quit" or the end of the typed lines' patience; then the score."""
    from app.simulate.practice import practise

    say = _say_json if args.json else _say_text
    practice = practise(
        args.driver, args.seed, args.site, args.misalign, args.lost, args.rate, args.faults,
        args.folder, args.exposure, args.socket or os.name == "nt", args.fov,
    )  # fmt: skip
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
    while not over.wait(0.2):
        practice.rig.happen()
        if practice.trouble:
            say({"error": practice.trouble}, practice.trouble)
            practice.trouble = ""


def _begin_json(practice: "Practice") -> dict[str, Any]:
    site, folder = practice.rig.config.site, practice.config.folder
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
    site, folder = practice.rig.config.site, practice.config.folder
    line = f"--driver {practice.driver} --port {practice.port}"
    place = f"--site={site.latitude_deg:g},{site.longitude_deg:g}"
    now = practice.rig.clock.now_utc().strftime("%Y-%m-%d %H:%M:%S UTC")
    lines = [
        f"A simulated telescope stands at {place[7:]}, where it is {now}.",
        f"Its mount answers at {practice.port} as {practice.driver}. Try, in another window:",
        f"  kochab mount position {line}",
        f"  kochab mount goto M42 {line} {place} --yes --allow-flip",
    ]
    if abs(practice.rig.clock.now_unix() - time.time()) > 60.0:
        lines.insert(1, "It is light there now, so its clock and the computer's do not agree.")
    if folder is not None:
        lines += [
            f"Its camera writes frames into {folder}:",
            f"  kochab live --source folder --address {folder}",
            f"  kochab polar {folder}/FIRST.fits {folder}/SECOND.fits {place}",
        ]
    return "\n".join([*lines, "Type help for what your hands can do here; Ctrl-C ends."])


def _say_json(told: dict[str, Any], text: str) -> None:
    print(to_line(told), flush=True)


def _say_text(told: dict[str, Any], text: str) -> None:
    print(text, flush=True)


def _site(text: str) -> Site:
    try:
        numbers = [float(part) for part in text.split(",")]
        latitude, longitude, height = [*numbers, 0.0][:3] if len(numbers) == 2 else numbers
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' is not LAT,LON or LAT,LON,H") from None
    if not (abs(latitude) <= 89.0 and abs(longitude) <= 360.0 and abs(height) < 9000.0):
        raise argparse.ArgumentTypeError(f"'{text}' is no place to stand: latitude within 89 deg")
    return Site(latitude, longitude, height)


def _arcmin(text: str) -> float:
    return within(text, 0.0, 600.0, "arcmin")


def _lost(text: str) -> float:
    return within(text, 0.0, 90.0, "deg")


def _fov(text: str) -> float:
    return within(text, 0.8, 60.0, "deg")  # narrower, the catalogue has too few stars


def _exposure(text: str) -> float:
    return within(text, 0.001, 600.0, "s")


def _rate(text: str) -> float:
    return within(text, 0.1, 1000.0, "times")


def _seed(text: str) -> int:
    if not text.isdigit() or len(text) > 18:
        raise argparse.ArgumentTypeError(f"{text} is not a whole number, 0 or more")
    return int(text)
