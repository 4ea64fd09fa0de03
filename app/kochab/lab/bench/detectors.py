"""``kochab bench detectors``: every registered detector on the same rendered frames.

The measures and the kinds of frames are those of "Lost in space" for robotic telescopes (thesis, 2018), sections
6.2.3 and 7.1: thirty frames, about 60 % of plain stars, most of the rest clipped and elongated, one very noisy with
blurred stars. Its frames are photographs that are not published, so these are rendered, in the same shares. Their
stars go down to a signal-to-noise of 10, so that rates are lower than the thesis' wherever faint stars count.
"""

from collections.abc import Iterable
from dataclasses import field
from functools import partial
from typing import Any

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.frame import Frame
from kochab.core.pairing import mutual_nearest
from kochab.core.values import frozen
from kochab.detection import DETECTORS, Detector
from kochab.lab.bench import BenchResult, Goal, Report, Row, timed
from kochab.simulate.star_images import FWHM_PER_SIGMA, RenderedStar, Sensor, Sky, render

SIZE = (1224, 816)  # px
STARS = 80
FEWEST_COMMON = 20
"""Stars found by both, below which two mean errors are not compared."""
FAINTEST_SNR = 10.0
CLIPPED = ("gaussian", "peaks", "contours")
"""Measured again with thresholds above the background's noise, which the thesis does not take."""

PAPER_ERROR_PX = {"gaussian": 0.314, "peaks": 0.830, "contours": 1.665}
"""Means of the thesis' average errors in x and in y (7.1.2 to 7.1.4)."""


@frozen
class FrameKind:
    """Frames of one kind: how many, their stars, their sky and sensor."""

    name: str
    frames: int
    image: RenderedStar
    sky: Sky = field(default_factory=lambda: Sky(400.0, hot_per_mp=10.0))
    sensor: Sensor = field(default_factory=Sensor)


KINDS = (
    FrameKind("plain", 18, RenderedStar(3.5)),
    FrameKind("elongated", 11, RenderedStar(3.5, trail_px=(7.0, 4.0)), sensor=Sensor(saturation=6000.0)),
    FrameKind("blurred", 1, RenderedStar(9.0), Sky(4000.0, (1500.0, 800.0), hot_per_mp=300.0)),
)


def run(quick: bool, report: Report) -> BenchResult:
    """One row a kind of frame and detector; with ``quick`` at most two frames a kind."""
    rows: list[Row] = []
    DETECTORS.make("gaussian").detect(Frame(np.eye(64)))  # imports are not timed
    for kind in KINDS:
        count = min(kind.frames, 2) if quick else kind.frames
        report(f"{count} frames of {kind.name} stars, seeds 1 to {count} ...")
        pictures = [make_frame(kind, seed) for seed in range(1, count + 1)]
        rows += measure(kind.name, pictures)
    return BenchResult("detectors", rows, goals(rows))


def make_frame(kind: FrameKind, seed: int) -> tuple[Frame, Floats]:
    """A frame and the places (N, 2) px of its stars, N(>F) ~ 1 / F above ``FAINTEST_SNR``."""
    xy, snr = stars_of(seed)
    sigma = kind.image.fwhm_px / FWHM_PER_SIGMA
    # A trail of length l adds l^2 / 12, a uniform distribution's variance, along its direction.
    longer = np.hypot(sigma, np.hypot(*kind.image.trail_px) / np.sqrt(12.0))
    noise = np.sqrt(kind.sky.level_e + kind.sensor.read_noise_e**2)
    faintest = FAINTEST_SNR * noise * np.sqrt(4.0 * np.pi * sigma * longer)
    flux = np.minimum(faintest * snr / FAINTEST_SNR, 3e6)
    return render(*SIZE, xy, flux, kind.image, kind.sky, kind.sensor, seed), xy


def stars_of(seed: int) -> tuple[Floats, Floats]:
    """Places (N, 2) px and signal-to-noise ratios (N,) of the stars of a frame."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(15.0, np.array(SIZE) - 16.0, (STARS, 2))
    return xy, FAINTEST_SNR / rng.uniform(0.0, 1.0, STARS)


def measure(kind: str, pictures: list[tuple[Frame, Floats]]) -> list[dict[str, Any]]:
    """A row a detector: means of equations 7.1 and 7.2, centroid errors, and processor time.

    ``error_px`` is the mean error along an axis of the stars it found, ``auto_error_px`` that of
    the default detector on those of them that it found too: the easy ones have smaller errors.
    """
    rows, errors = [], {}
    makers = {name: DETECTORS.make(name) for name in DETECTORS}
    makers |= {f"{name}, clipped": DETECTORS.make(name, clipped=True) for name in CLIPPED}
    for name, detector in makers.items():
        found, seconds = detect_all(detector, (frame for frame, _ in pictures))
        rates, parts = zip(*(compare(one, xy) for one, (_, xy) in zip(found, pictures, strict=True)), strict=True)
        tpr, ppv = np.array(rates).T
        errors[name] = np.concatenate(parts)
        same = np.isfinite(errors[name]) & np.isfinite(errors["auto"])
        rows.append(
            {
                "kind": kind,
                "detector": name,
                "frames": len(pictures),
                "tpr": float(tpr.mean()),
                "ppv": float(ppv.mean()),
                "tpr_worst": float(tpr.min()),
                "ppv_worst": float(ppv.min()),
                "common": int(same.sum()) // 2,
                "error_px": _mean(errors[name][same]),
                "auto_error_px": _mean(errors["auto"][same]),
                "paper_error_px": PAPER_ERROR_PX.get(name),
                "cpu_ms": 1e3 * seconds,
            }
        )
    return rows


def detect_all(detector: Detector, frames: Iterable[Frame]) -> tuple[list[Floats], float]:
    """The places (M, 2) px that are found on each frame, and the mean processor seconds a frame."""
    runs = [timed(partial(detector.detect, frame)) for frame in frames]
    return [found.xy for found, _ in runs], float(np.mean([seconds for _, seconds in runs]))


def compare(found: Floats, xy: Floats, radius_px: float = 4.0) -> tuple[tuple[float, float], Floats]:
    """True positive rate and positive predictive value, and errors (N, 2) px of N stars.

    Each star takes the nearest detection within ``radius_px`` and each detection one star, so that a star found twice
    is one true and one false positive. Errors of stars not found are NaN. Where nothing is found nothing is false.
    """
    errors = np.full((len(xy), 2), np.nan)
    if not len(found):
        return (0.0, 1.0), errors
    mine, star = mutual_nearest(found, xy, radius_px)
    errors[star] = np.abs(found[mine] - xy[star])
    return (len(mine) / len(xy), len(mine) / len(found)), errors


def goals(rows: list[Row]) -> list[Goal]:
    """The default detector against the best of all others, kind by kind."""
    made = []
    for kind in dict.fromkeys(row["kind"] for row in rows):
        of_kind = [row for row in rows if row["kind"] == kind]
        ours = next(row for row in of_kind if row["detector"] == "auto")
        others = [row for row in of_kind if row["detector"] != "auto"]
        for key, what in (("tpr", "TPR"), ("ppv", "PPV")):
            best = max(row[key] for row in others)
            made.append(Goal.at_least(f"{kind}: {what}, at least the best other's", ours[key], best))
        ratios = [r["auto_error_px"] / r["error_px"] for r in others if r["common"] >= FEWEST_COMMON]
        worst = max(ratios) if ratios else None
        made.append(Goal.at_most(f"{kind}: error / another's on the same stars", worst, 1.0))
    return made


def _mean(errors: Floats) -> float:
    return float(errors.mean()) if errors.size else float("nan")
