"""The options that commands share: search, methods and their settings, files."""

import argparse
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from glob import glob
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kochab.core.errors import UsageError

if TYPE_CHECKING:  # what loads numpy is imported when it is used: --help is quick
    from datetime import datetime

    from kochab.core.capture import CaptureSettings
    from kochab.core.frame import Site
    from kochab.core.registry import Registry
    from kochab.solver import SolveOptions

Place = tuple[float, float, float]  # RA, Dec and radius, degrees


def number_above_zero(text: str) -> float:
    """An argument that must be a positive number."""
    value = number(text)
    if not value > 0:
        raise argparse.ArgumentTypeError(f"{text} is not more than zero")
    return value


def between(low: float, high: float, unit: str) -> Callable[[str], float]:
    """What reads an argument that must be a number from ``low`` to ``high``."""

    def read(text: str) -> float:
        value = number(text)
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text} is not between {low:g} and {high:g} {unit}")
        return value

    return read


def whole(low: int, high: int | None = None, what: str = "count") -> Callable[[str], int]:
    """What reads an argument that must be a whole number from ``low`` to ``high``, None without an end."""

    def read(text: str) -> int:
        # isdecimal, not int(): " 5", "+5" and "1_000" are no counts that a person means to type.
        if not text.isdecimal() or int(text) < low or (high is not None and int(text) > high):
            bounds = f", {low} or more" if high is None else f" from {low} to {high}"
            raise argparse.ArgumentTypeError(f"{text} is not a {what}{bounds}")
        return int(text)

    return read


def _near(text: str) -> Place:
    parts = text.split(",")
    if len(parts) != 3:
        raise argparse.ArgumentTypeError(f"{text} is not RA,DEC,RADIUS in degrees")
    ra, dec, radius = (number(part) for part in parts)
    if not -360 <= ra <= 720 or not -90 <= dec <= 90 or not 0 < radius <= 180:
        raise argparse.ArgumentTypeError(f"{text} is not a place on the sky and a radius, degrees")
    return ra % 360.0, dec, radius


def number(text: str) -> float:
    """An argument that must be a finite number."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text} is not a number")
    return value


def site(text: str) -> "Site":
    """An argument that must be a place on the Earth."""
    from kochab.parsing.angles import parse_site

    try:
        return parse_site(text)
    except UsageError:
        raise argparse.ArgumentTypeError(f"{text} is not LAT,LON or LAT,LON,HEIGHT in degrees and metres") from None


class _ListSettings(argparse.Action):
    """Print the list and leave, as ``--help`` does."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: object,
        option_string: str | None = None,
    ) -> None:
        """Do it."""
        print(everything())
        parser.exit()


# The options that several commands take. What one of them says in other words it changes when it adds it.


def valued(metavar: str, text: str, kind: Callable[[str], Any] = str, **more: Any) -> dict[str, Any]:
    """What ``add_argument`` needs for an option with a value that ``kind`` reads.

    Parameters
    ----------
    metavar : str
        How the help names the value.
    text : str
        What the help says of the option.
    kind : Callable[[str], Any]
        Reads the value; what it raises is the option's error.
    **more : Any
        Further arguments of ``add_argument``.
    """
    return {"metavar": metavar, "help": text, "type": kind, **more}


OPTIONS: dict[str, dict[str, Any]] = {
    "--json": {"action": "store_true", "help": "print JSON, one object a line"},
    "--overwrite": {"action": "store_true", "help": "replace existing files, never an input"},
    "--profile": valued("NAME", "equipment profile, see kochab profile"),
    "--source": valued("NAME", "kind of camera: folder, indi, alpaca, webcam, ..."),
    "--address": valued("WHERE", "folder, host:port/camera or device", default=""),
    "--exposure": valued("S", "seconds", number_above_zero),
    "--gain": valued("G", "in the camera's units", number),
    "--binning": valued("N", "pixels a side", whole(1, 256)),
    "--port": valued("P", "/dev/ttyUSB0, COM3, tcp://HOST:PORT, udp://HOST:11880 or SERVER:PORT/DEVICE"),
    "--driver": valued("NAME", "the mount's protocol (default: detected)"),
    "--baud": valued("N", "baud rate (default: the driver's)", whole(300, 4_000_000, "baud rate")),
    "--epoch": {"choices": ["J2000", "date"], "help": "equinox of the mount's coordinates"},
    "--site": valued("LAT,LON[,H]", "degrees, east positive, metres", site),
    # No more than a flat picture can show.
    "--fov": valued("DEG", "width of the frame in degrees, good to a tenth", between(0.001, 170.0, "deg")),
    "--scale": valued(
        "ARCSEC_PX", "pixel scale, good to a tenth (--fov takes precedence)", between(0.001, 36000.0, "arcsec a pixel")
    ),
    "--near": valued("RA,DEC,RADIUS", "search here first, in degrees", _near),
    "--method": valued(
        "NAME",
        "how stars are identified, see --methods (default: %(default)s, which needs no hint)",
        default="patterns",
    ),
    "--attitude": valued("NAME", "attitude estimator (default: fitted together with the camera)"),
    "--set": {
        "action": "append",
        "default": [],
        "dest": "settings",
        "metavar": "NAME=VALUE",
        "help": "an option of the method; prefix detector. or attitude. for those of the other two; may be repeated",
    },
    "--methods": {
        "action": _ListSettings,
        "nargs": 0,
        "help": "list methods, detectors and attitudes with their options, units, ranges and papers",
    },
    "--timeout": valued("S", "time limit per frame, seconds (default: %(default)g)", number_above_zero, default=30.0),
    "--detector": valued("NAME", "how stars are detected, see --methods (default: %(default)s)", default="auto"),
    "--frame": valued("N", "frame of a video (SER, AVI), from 1 (default: the first)", whole(1, what="frame")),
    "--workers": valued(
        "N", "files solved at the same time, 1 to 256 (default: %(default)s)", whole(1, 256), default=1
    ),
    "--wcs": {"action": "store_true", "help": "write FILE.wcs beside each solved file"},
    "--name-wcs": {"action": "store_true", "help": "the same as NAME.wcs, without the file's ending (astrometry.net)"},
    "--strict": {"action": "store_true", "help": "a solution outside --near counts as not solved"},
}
CAMERA_SETTINGS = ("--exposure", "--gain", "--binning")
CAMERA = ("--source", "--address", *CAMERA_SETTINGS)
MOUNT = ("--port", "--driver", "--baud", "--epoch", "--site")
SEARCH = ("--fov", "--scale", "--near", "--method", "--attitude", "--set", "--methods", "--timeout")
BATCH = ("--json", *SEARCH, "--profile", "--workers", "--wcs", "--name-wcs", "--overwrite", "--strict")


def add_options(parser: argparse.ArgumentParser, *names: str, **changes: Any) -> None:
    """Add some of :data:`OPTIONS`, each with these ``changes``."""
    for name in names:
        parser.add_argument(name, **OPTIONS[name] | changes)


# ``--set NAME=VALUE`` and ``--methods``: the options of methods, detectors and attitudes.

KINDS = ("method", "detector", "attitude")
DEFAULTS = ("patterns", "auto")
NEEDS = (
    "Every method but patterns needs the scale, from --fov, --scale or the frame's header;"
    " predict also needs the position."
)


def settings_of(
    settings: Sequence[str], method: str, detector: str, attitude: str | None
) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
    """What ``--set`` says of the method, of the detector and of the attitude.

    Raises UsageError when there is no such option, or it cannot have that value.

    Parameters
    ----------
    settings : Sequence[str]
        Every ``NAME=VALUE`` given, with or without ``method.``, ``detector.`` or ``attitude.`` before the name.
    method : str
        Name of the identification method.
    detector : str
        Name of the detector.
    attitude : str or None
        Name of the estimator; None when none was chosen, and then no option of one may be set.
    """
    given: dict[str, dict[str, str]] = {kind: {} for kind in KINDS}
    for text in settings:
        name, equals, value = text.partition("=")
        kind, dot, option = name.strip().partition(".")
        if not equals or not (option if dot else kind):
            raise UsageError(f"--set {text} is not NAME=VALUE.")
        # A name with another prefix is an option of the method, so that its complaint names the whole word.
        if dot and kind in given:
            given[kind][option] = value
        else:
            given["method"][name.strip()] = value
    names = {"method": method, "detector": detector, "attitude": attitude}
    if given["attitude"] and attitude is None:
        raise UsageError("--set attitude.NAME needs --attitude.")
    made = [_checked(kind, names[kind], given[kind]) for kind in KINDS]
    return made[0], made[1], made[2]


def detector_settings_of(settings: Sequence[str], detector: str) -> dict[str, Any]:
    """What ``--set`` says of the detector where there is nothing else to set.

    Raises UsageError when there is no such option, or it cannot have that value.
    """
    named = (text if text.startswith("detector.") else f"detector.{text}" for text in settings)
    return settings_of(list(named), "", detector, None)[1]


def _checked(kind: str, name: str | None, given: Mapping[str, str]) -> dict[str, Any]:
    from kochab.core.registry import checked

    if not given or name is None:
        return {}
    try:
        return checked(_registry(kind).load(name), given)
    except UsageError as error:
        raise UsageError(f"{kind.capitalize()} {name}: {error}") from error


def _registry(kind: str) -> "Registry[Any]":
    from kochab.attitude import ESTIMATORS
    from kochab.detection import DETECTORS
    from kochab.identification import IDENTIFIERS

    registries: dict[str, Registry[Any]] = {"method": IDENTIFIERS, "detector": DETECTORS, "attitude": ESTIMATORS}
    return registries[kind]


def everything() -> str:
    """All registered methods, detectors and attitudes, with what can be set about each."""
    from kochab.core.registry import options_of

    lines = [NEEDS]
    for kind in KINDS:
        prefix = "" if kind == "method" else f"{kind}."
        for name, found in _registry(kind).loaded().items():
            remark = "the default" if name in DEFAULTS else getattr(found, "paper", "")
            lines.append(f"--{kind} {name}{f'   ({remark})' if remark else ''}")
            for option in options_of(found):
                absent = f": {option.none}" if option.none else ""
                what = f"{option.text} [{option.range_text}{absent}]"
                lines.append(f"    {prefix}{option.name}={option.value_text}   {what}")
    return "\n".join(lines)


def time_utc(text: str) -> "datetime":
    """The time that an argument gives, in UTC; UsageError where it is none."""
    from kochab.frames.hints import aware_utc

    if (time := aware_utc(text)) is None:
        raise UsageError(f"{text} is not a time; give it as 2026-11-24T21:30.")
    return time


def capture_settings(args: argparse.Namespace) -> "CaptureSettings":
    """What the arguments set on the camera."""
    from kochab.core.capture import CaptureSettings

    return CaptureSettings(args.exposure, args.gain, args.binning)


def options_of(args: argparse.Namespace, detector: str = "auto") -> "SolveOptions":
    """The options a person asked for; what they said of the sky is a hint and no more.

    Raises UsageError when there is no such method, detector or attitude, or none with such an option.
    """
    from kochab.attitude import ESTIMATORS
    from kochab.core.frame import Hint
    from kochab.detection import DETECTORS
    from kochab.identification import IDENTIFIERS
    from kochab.solver import SolveOptions

    IDENTIFIERS.check(args.method)
    DETECTORS.check(detector)
    if args.attitude is not None:
        ESTIMATORS.check(args.attitude)
    of_method, of_detector, of_attitude = settings_of(args.settings, args.method, detector, args.attitude)
    hint = Hint(scale_arcsec_px=scale_range(args.scale), centre_deg=args.near, source="command line")
    return SolveOptions(
        method=args.method,
        method_options=of_method,
        detector=detector,
        detector_options=of_detector,
        attitude=args.attitude,
        attitude_options=of_attitude,
        hint=hint if hint.helps else None,
        fov_deg=args.fov,
        timeout_s=args.timeout,
    )


def scale_range(scale: float | None) -> tuple[float, float] | None:
    """A pixel scale as a hint takes it: good to a tenth."""
    return None if scale is None else (scale / 1.1, scale * 1.1)


def bound_of(args: argparse.Namespace) -> Place | None:
    """RA, Dec and radius, degrees, that ``--strict`` demands of the answer, or None.

    Raises UsageError when ``--strict`` comes without ``--near``.
    """
    if not args.strict:
        return None
    if args.near is None:
        raise UsageError("--strict needs --near RA,DEC,RADIUS.")
    near: Place = args.near
    return near


# Names of files as people type them where the shell leaves patterns alone, as Windows' does.


def named(given: Iterable[str]) -> list[str]:
    """The files meant, patterns such as ``*.fits`` filled in; one that fits none stays as it is.

    Raises UsageError when a name is empty.
    """
    return [name for text in given for name in _filled_in(text)]


def _filled_in(text: str) -> list[str]:
    if not text.strip():  # a script's empty variable, not the folder we stand in
        raise UsageError("A file's name is empty.")
    # A file may really be called "M42[1].fits": what exists is no pattern.
    if not set(text) & set("*?[") or Path(text).exists():
        return [text]
    return sorted(glob(text)) or [text]
