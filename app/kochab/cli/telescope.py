"""``kochab telescope``: planetarium programs see where the camera or the mount points, and send it to a target."""

import argparse
import threading
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import replace
from functools import partial
from importlib import import_module
from time import monotonic
from typing import TYPE_CHECKING, Any

from kochab.cli.mount import SWITCHES
from kochab.cli.options import CAMERA, MOUNT, SEARCH, add_options, capture_settings, options_of
from kochab.cli.output import reporting_failures, tell, with_progress
from kochab.core.errors import KochabError, UsageError

if TYPE_CHECKING:
    from kochab.gear.mount_events import MountEvent
    from kochab.gear.mount_line import MakeTask
    from kochab.workflows.telescope.offered import OfferedTelescope

OFFER = "kochab.server.telescope.offer:Offer"  # named, not imported: no face knows another
SOLVE_TIMEOUT_S = 10.0
CLEAR_SHARE = 0.2


def add_parser(subparsers: "argparse._SubParsersAction[Any]") -> None:
    """Add ``telescope`` to the command line."""
    parser = subparsers.add_parser(
        "telescope",
        description="Offers a telescope to SkySafari, Stellarium, KStars and others until Ctrl-C. It points where the"
        " newest solved frame or the mount says. Their gotos set the target; with --yes they move the mount, within"
        " its limits. On this computer only, unless --lan is given.",
    )
    parser.add_argument(
        "--offer",
        action="append",
        default=[],
        metavar="NAME[=PORT]",
        help="only this protocol: lx200 (port 4030), stellarium (10001), alpaca (11111), indi (7624); may be repeated",
    )
    parser.add_argument(
        "--stellarium-remote",
        nargs="?",
        const="",
        metavar="ADDRESS",
        help="turn the view of Stellarium (its plug-in Remote Control, default 127.0.0.1:8090) to where the"
        " telescope points, and push to the object selected there",
    )
    parser.add_argument("--lan", action="store_true", help="to the local network too, unencrypted")
    parser.add_argument("--folder", metavar="DIR", help="the same as --source folder --address DIR")
    parser.add_argument(
        "--encoders",
        metavar="PORT",
        help="box of encoders on the telescope's axes (DSC protocol): a serial port or tcp://HOST:PORT; they show the"
        " way between two solves, which align them",
    )
    parser.add_argument(
        "--gyro",
        metavar="http://HOST:PORT",
        help="a phone on the tube, its gyroscope shown by the app phyphox with remote access on: the same as encoders,"
        " a little less exact",
    )
    parser.add_argument("--target", metavar="NAME", help="what to push the telescope to: after each solve, which way")
    add_options(parser, *CAMERA, *MOUNT, "--profile", "--json", *SEARCH, "--detector")
    parser.add_argument("--fork", action="store_true", help="fork or wedge: no meridian flip needed")
    parser.add_argument("--equatorial", action="store_true", help="AZ-GTi, Celestron fork or unknown board on a wedge")
    for name in ("allow-flip", "trust-mount", "no-site"):
        parser.add_argument(f"--{name}", action="store_true", help=SWITCHES[name])
    parser.add_argument("--yes", action="store_true", help="let these programs move and sync the mount")
    parser.set_defaults(run=reporting_failures(run, 1), timeout=SOLVE_TIMEOUT_S, limits=None)


def run(args: argparse.Namespace) -> int:
    """Offer it until a signal comes, or the mount or the camera is lost."""
    from kochab.workflows.telescope.offered import OfferedTelescope

    if args.folder is not None:
        if args.source or args.address:
            raise UsageError("Give either --folder or --source and --address.")
        args.source, args.address = "folder", args.folder
    if not args.source and not args.port and not args.driver:
        raise UsageError("Give what points: --folder DIR or --source NAME for a camera, --port P for a mount.")
    wanted = dict(_wanted(text) for text in args.offer)
    say = partial(_say, as_json=args.json)
    mount = _CliMount(args, say) if args.port or args.driver else None
    telescope = OfferedTelescope(say, mount, args.yes, site=args.site)
    if args.target is not None:
        from kochab.workflows.goto_target import parse_target

        telescope.target = parse_target(args.target, telescope.now(), args.site)
    if mount is not None:
        mount.telescope = telescope
    if args.encoders is not None and args.gyro is not None:
        raise UsageError("Give either --encoders or --gyro.")
    if (aid := args.encoders or args.gyro) is not None:
        if not args.source:
            raise UsageError(
                "Encoders and gyroscopes are aligned by solved frames: give --folder DIR or --source NAME too."
            )
        from kochab.workflows.telescope.gyro_aid import PHONE, pointing_aid

        address = PHONE + aid.removeprefix(PHONE) if args.gyro else aid
        telescope.aid = pointing_aid(address, say, telescope.now, args.site)
    camera = _Camera(args, telescope) if args.source else None
    module, _, name = OFFER.partition(":")
    offer = getattr(import_module(module), name)(telescope, wanted, args.lan, args.stellarium_remote)
    try:
        tell({"event": "ready", "host": offer.host, "ports": offer.ports}, "\n".join(offer.lines), args.json)
        if camera is not None:
            camera.start()
        return _until_over(mount, camera)
    except KeyboardInterrupt:
        return 0
    finally:
        offer.stop()
        if camera is not None:
            camera.stop()
        if telescope.aid is not None:
            telescope.aid.stop()


def _wanted(text: str) -> tuple[str, int | None]:
    name, equals, port = text.partition("=")
    if equals and not (port.isdecimal() and len(port) < 6 and int(port) <= 65535):
        raise UsageError(f"--offer {text}: {port} is not a port from 0 to 65535.")
    return name, int(port) if equals else None


def _say(sentence: str, as_json: bool) -> None:
    tell({"event": "said", "text": sentence}, sentence, as_json)


def _until_over(mount: "_CliMount | None", camera: "_Camera | None") -> int:
    """Serve the mount's line in this thread, as its owner, or wait for the camera's end."""
    if mount is None:
        assert camera is not None
        while not camera.over.wait(0.5):
            camera.tell_way_by_aid()
    else:
        mount.serve(lambda: camera is not None and camera.over.is_set())
    if camera is not None and camera.fault is not None:
        raise camera.fault
    return 0


class _CliMount:
    """The mount of the command line behind its guard, and what programs want of it."""

    telescope: "OfferedTelescope"

    def __init__(self, args: argparse.Namespace, say: Callable[[str], None]) -> None:
        from kochab.gear.mount_events import MountSnapshot
        from kochab.gear.mount_line import MountLine
        from kochab.gear.mounts.motion_plan import Limits
        from kochab.gear.session import EPOCH_NAMES, MountSelection, complete, guarded

        epoch = None if args.epoch is None else EPOCH_NAMES[args.epoch]
        given = MountSelection(args.port or "", args.driver or "", args.baud, epoch, equatorial=args.equatorial)
        selection = with_progress("probing", complete(given))
        limits = replace(
            limits := args.limits or Limits(),
            allow_without_site=args.no_site,
            allow_flip=args.allow_flip or limits.allow_flip,
            crosses_meridian=args.fork or limits.crosses_meridian,
        )

        def opened() -> Any:
            guard = guarded(selection, args.site, limits=limits)
            if args.trust_mount:
                guard.clock_and_site.trust()
            return guard

        self._say = say
        self.known = MountSnapshot("connecting", selection.port)
        self._line: MountLine = MountLine(opened, self._hear)
        self._failed: Callable[[str], None] = say

    def order(self, name: str, make: "MakeTask", failed: Callable[[str], None]) -> None:
        """Do this on the guard, unless something is under way."""
        from kochab.gear.actions import MountSituation, reason_against_order

        lacks = None if self.known.connected is None else self.known.connected.lacks
        state = None if self.known.report is None else self.known.report.state
        if why := reason_against_order(name, MountSituation(self.known.phase, lacks, state, self.known.user)):
            return failed(why)
        self.known.busy, self._failed = name, failed
        return self._line.order(name, make)

    @property
    def busy(self) -> bool:
        """Whether an order is under way."""
        return bool(self.known.busy)

    def stop(self) -> None:
        """Stop it now."""
        self._line.stop()

    def serve(self, over: Callable[[], bool]) -> None:
        """Own the line until ``over``; what moves is stopped at the end."""
        with closing(self._line.run()) as steps:
            for _ in steps:
                if over():
                    return

    def _hear(self, event: "MountEvent") -> None:
        from kochab.gear import mount_events as events

        self.known.hear(event)
        match event:
            case events.PositionReport():
                self.telescope.see_mount(event.icrs_deg, bool(event.state.slewing) or event.target_deg is not None)
            case events.Connected():
                self._say(f"{event.name}")
            case events.OrderDone():
                self._say(event.result if isinstance(event.result, str) else event.result.sentence)
            case events.OrderFailed():
                self._failed(event.sentence)
            case events.StopFailed() | events.LimitReached() | events.EpochDoubted():
                self._say(event.sentence)
            case events.LineLost():
                self.telescope.see_mount(None)  # where it is now, nobody knows
                self._say(event.again or event.sentence)


class _Camera:
    """Solves a camera's frames in a thread of its own."""

    def __init__(self, args: argparse.Namespace, telescope: "OfferedTelescope") -> None:
        from kochab.gear.cameras import open_camera
        from kochab.workflows.live.capture import Capture
        from kochab.workflows.live.solve import ProfiledTracker, live_solve

        settings = capture_settings(args)
        capture = Capture(lambda: open_camera(args.source, args.address, settings), reconnect=True)
        self._live = live_solve(capture, ProfiledTracker(args.profile or "", options_of(args, args.detector)))
        self._telescope, self._as_json = telescope, args.json
        self._told, self._told_deg = "", 0.0
        self.over = threading.Event()
        self._ending = threading.Event()
        self.fault: KochabError | None = None
        self._thread = threading.Thread(target=self._run, name="kochab-live", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """End it."""
        self._ending.set()
        with suppress(RuntimeError):  # never started
            self._thread.join(SOLVE_TIMEOUT_S)

    def _run(self) -> None:
        from kochab.workflows.live.solve import WARNING
        from kochab.workflows.live.update import LiveUpdate

        try:
            with closing(self._live):
                for step in self._live:
                    if self._ending.is_set():
                        break
                    if isinstance(step, LiveUpdate):
                        if step.track.solution is not None:
                            self._telescope.see_solution(step.track.solution, step.shot.shutter_s)
                            self._tell_way(step.done_s)
                    elif step.stage == WARNING:
                        self._telescope.say(step.detail)
        except KochabError as error:
            self.fault = error
        finally:
            self.over.set()

    def tell_way_by_aid(self) -> None:
        """Say it between two solves, when the telescope was pushed by a clear part of the way."""
        if self._telescope.aid is not None:
            self._tell_way(monotonic(), CLEAR_SHARE)

    def _tell_way(self, now_s: float, share: float = 0.0) -> None:
        """Say which way to push, when that has changed by a share of the distance."""
        from kochab.workflows.telescope.push_to import push_to

        way = push_to(self._telescope, now_s)
        if way is None or way.words == self._told:
            return
        if not way.there and abs(way.distance_deg - self._told_deg) < share * self._told_deg:
            return
        self._told, self._told_deg = way.words, way.distance_deg
        fields = {
            "distance_deg": way.distance_deg,
            "sigma_deg": way.sigma_deg,
            "right_deg": way.right_deg,
            "up_deg": way.up_deg,
            "there": way.there,
        }
        tell({"event": "push", **fields, "with_site": way.with_site, "text": way.words}, way.words, self._as_json)
