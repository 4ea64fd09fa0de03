"""The options that ``solve`` and ``identify`` share."""

import argparse
import math

from app.cli.settings import add_settings, settings_of
from app.core.hint import Hint
from app.solve.options import SolveOptions
from app.solve.pick import known


def add_choices(parser: argparse.ArgumentParser) -> None:
    """Add the options that steer a search and its output."""
    parser.add_argument("--json", action="store_true", help="one JSON object a line a file")
    add_search(parser)
    parser.add_argument(
        "--workers", type=whole_number, default=1, metavar="N",
        help="files at the same time, 1 to 256 (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument("--wcs", action="store_true", help="write FILE.wcs beside each solved file")


def add_search(parser: argparse.ArgumentParser) -> None:
    """Add the options that steer a search alone."""
    parser.add_argument(
        "--fov", type=field_deg, metavar="DEG",
        help="the frame's width in degrees, as you believe it, good to a tenth",
    )  # fmt: skip
    parser.add_argument(
        "--scale", type=_scale, metavar="ARCSEC_PX",
        help="the pixel scale, as you believe it, good to a tenth (--fov goes before it)",
    )  # fmt: skip
    parser.add_argument(
        "--near", type=_near, metavar="RA,DEC,RADIUS", help="where it points, in degrees"
    )
    parser.add_argument(
        "--method", default="patterns", metavar="NAME",
        help="how stars are named, see --methods (default: %(default)s, which needs no hint)",
    )  # fmt: skip
    parser.add_argument(
        "--attitude",
        metavar="NAME",
        help="report the attitude of this estimator (default: fitted together with the camera)",
    )
    add_settings(parser)
    parser.add_argument(
        "--timeout", type=number_above_zero, default=30.0, metavar="S",
        help="longest search a frame, seconds (default: %(default)g)",
    )  # fmt: skip


def add_detector(parser: argparse.ArgumentParser) -> None:
    """Add the choice of a detector."""
    parser.add_argument(
        "--detector", default="auto", metavar="NAME",
        help="how stars are found, see --methods (default: %(default)s)",
    )  # fmt: skip


def options_of(args: argparse.Namespace, detector: str = "auto") -> SolveOptions:
    """The options a person asked for; what they said of the sky is a hint and no more.

    Raises
    ------
    UsageError
        There is no such method, detector or attitude, or none with such an option.

    """
    from app.attitude import ESTIMATORS
    from app.detect import DETECTORS
    from app.identify import IDENTIFIERS

    known(IDENTIFIERS, args.method, "method")
    known(DETECTORS, detector, "detector")
    if args.attitude is not None:
        known(ESTIMATORS, args.attitude, "attitude")
    of_method, of_detector, of_attitude = settings_of(
        args.settings, args.method, detector, args.attitude
    )
    scale = None if args.scale is None else (args.scale / 1.1, args.scale * 1.1)
    hint = Hint(scale_arcsec_px=scale, centre_deg=args.near, source="command line")
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


def number_above_zero(text: str) -> float:
    """An argument that must be a positive number."""
    value = number(text)
    if not value > 0:
        raise argparse.ArgumentTypeError(f"{text} is not more than zero")
    return value


def within(text: str, low: float, high: float, unit: str) -> float:
    """An argument that must be a number from ``low`` to ``high``."""
    value = number(text)
    if not low <= value <= high:
        raise argparse.ArgumentTypeError(f"{text} is not between {low:g} and {high:g} {unit}")
    return value


def field_deg(text: str) -> float:
    """An argument that must be the width of a flat picture."""
    return within(text, 0.001, 170.0, "deg")


def _scale(text: str) -> float:
    return within(text, 0.001, 36000.0, "arcsec a pixel")


def whole_number(text: str) -> int:
    """An argument that must be a small count."""
    if not text.isdigit() or not 1 <= int(text) <= 256:
        raise argparse.ArgumentTypeError(f"{text} is not a count from 1 to 256")
    return int(text)


def _near(text: str) -> tuple[float, float, float]:
    parts = text.split(",")
    if len(parts) != 3:
        raise argparse.ArgumentTypeError(f"{text} is not RA,DEC,RADIUS in degrees")
    ra, dec, radius = (number(part) for part in parts)
    if not -360 <= ra <= 360 or not -90 <= dec <= 90 or not 0 < radius <= 180:
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
