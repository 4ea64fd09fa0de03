"""``kochab detect FILE``: the stars of a frame, without naming them."""

import argparse
import json
import time
from typing import Any

from app.cli.choices import add_detector
from app.cli.settings import OF_DETECTOR, add_settings, detector_settings_of
from app.core.detections import Detections
from app.core.errors import KochabError
from app.detect import DETECTORS, make_detector
from app.solve.pick import known


def add_parser(subparsers: "argparse._SubParsersAction[Any]") -> None:
    """Add ``detect`` to the command line."""
    parser = subparsers.add_parser(
        "detect",
        help="find the stars of a frame",
        description="Places are in pixels, x right, y down, (0, 0) the centre of the first pixel;"
        " angles in degrees from x towards y. Exit code: 0 done, with stars or without, 2 unusable"
        " input.",
    )
    parser.add_argument("file", metavar="FILE", help="a picture of the night sky")
    add_detector(parser)
    add_settings(parser, OF_DETECTOR)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Print the detections; 2 when the file cannot be read."""
    from app.frames import read_frame

    known(DETECTORS, args.detector, "detector")
    options = detector_settings_of(args.settings, args.detector)
    try:
        started = time.perf_counter()
        frame = read_frame(args.file)
        read = time.perf_counter()
        detections = make_detector(args.detector, **options).detect(frame)
        done = time.perf_counter()
    except KochabError as error:
        if not args.json:
            raise
        print(json.dumps({"file": args.file, "error": str(error)}))
        return 2
    if args.json:
        elapsed = {"read": 1e3 * (read - started), "detect": 1e3 * (done - read)}
        told = {**as_json(detections), "warnings": list(frame.warnings), "elapsed_ms": elapsed}
        print(json.dumps({"file": args.file, **told}))
    else:
        print("\n".join([as_text(detections), *(f"note: {text}" for text in frame.warnings)]))
    return 0


def as_json(detections: Detections) -> dict[str, Any]:
    """The stable JSON form of a list of stars."""
    return {
        "width": detections.width,
        "height": detections.height,
        "background": _number(detections.background),
        "noise": _number(detections.noise),
        "detections": len(detections),
        "stars": [
            {
                "x": round(float(detections.xy[i, 0]), 4),
                "y": round(float(detections.xy[i, 1]), 4),
                "flux": _number(detections.flux[i]),
                "snr": _number(detections.snr[i]),
                "fwhm_px": _number(detections.fwhm_px[i]),
                "elongation": _number(detections.elongation[i]),
                "angle_deg": _number(detections.angle_rad[i] * 57.29577951308232),
                "saturated": bool(detections.saturated[i]),
                "blended": bool(detections.blended[i]),
            }
            for i in range(len(detections))
        ],
    }


def as_text(detections: Detections) -> str:
    """A table with a line of totals."""
    lines = [
        f"{len(detections)} stars in {detections.width} x {detections.height}, "
        f"background {detections.background:.5g}, noise {detections.noise:.4g}",
        f"{'x':>9} {'y':>9} {'flux':>11} {'SNR':>8} {'FWHM':>6} {'long':>5} {'angle':>6}",
    ]
    for star in as_json(detections)["stars"]:
        marks = " saturated" * star["saturated"] + " blended" * star["blended"]
        lines.append(
            f"{star['x']:9.2f} {star['y']:9.2f} {star['flux'] or 0:11.5g} {star['snr'] or 0:8.1f} "
            f"{star['fwhm_px'] or 0:6.2f} {star['elongation'] or 0:5.2f} "
            f"{star['angle_deg'] or 0:6.1f}{marks}"
        )
    return "\n".join(lines)


def _number(value: Any) -> float | None:
    number = float(value)
    return round(number, 5) if abs(number) < float("inf") else None
