"""Section 7.1 of "Lost in space" for robotic telescopes: the four detectors.

The thesis' thirty photographs are not published; the frames are those of
:mod:`app.bench.detectors`, in the same shares of plain, elongated and noisy ones. "True stars" are
those the eye sees: a signal-to-noise ratio of 100, which gives the thesis' shares of perfect frames
(with 50 it is 50 % where the thesis has 80, with 30 it is 30 %). What falls on a fainter one is not
false.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.bench.detectors import KINDS, Kind, compare, make_frame, stars_of
from app.bench.papers_row import row, share_error, timed
from app.core.frame import Frame
from app.detect import make_detector

Floats = NDArray[np.float64]
FRAMES = 30
VISIBLE_SNR = 100.0
PAPER = {
    # least TPR, least PPV, error in x, error in y, share of frames with TPR 1 and with PPV 1
    "gaussian": (0.17, None, 0.3185, 0.3094, None, None),
    "peaks": (0.35, None, 0.841, 0.818, None, 75.0),
    "contours": (None, 0.10, 1.69, 1.64, 46.0, None),
    "thesis": (None, None, None, None, 80.0, 86.0),
}
WHAT = (
    ("least true positive rate", "", 0.15), ("least positive predictive value", "", 0.15),
    ("mean error in x", "px", 0.1), ("mean error in y", "px", 0.1),
    ("frames with every star found", "%", None), ("frames without a false star", "%", None),
)  # fmt: skip
DRAWN = "on drawn frames without lens distortion, which the photographs have"


def rows(quick: bool) -> list[dict[str, Any]]:
    """The four detectors' rows, and the seconds of table 7.3."""
    pictures = frames(1 if quick else None)
    make_detector("gaussian").detect(Frame(np.eye(64)))  # imports are not timed
    default, default_s = measured("auto", pictures)
    out = []
    for name, paper in PAPER.items():
        ours, seconds = measured(name, pictures)
        for k, (what, unit, error) in enumerate(WHAT):
            if paper[k] is None:
                continue
            room = share_error(paper[k] or 0.0, len(pictures), FRAMES) if error is None else error
            out.append(
                row("7.1", f"{name}: {what}", unit=unit, paper=paper[k], ours=ours[k],
                    default=default[k], error=room, better="less" if unit == "px" else "more",
                    note=f"{len(pictures)} frames; {DRAWN}")
            )  # fmt: skip
        if name == "thesis":
            out.append(
                row("7.3", "time, centroiding", unit="s", paper=1.03, ours=seconds,
                    default=default_s, better="less", note="1224 x 816 px")
            )  # fmt: skip
    return out


def frames(most: int | None) -> list[tuple[Frame, Floats, Floats]]:
    """Frames with the places (N, 2) px and signal-to-noise ratios (N,) of their stars."""
    out = []
    for kind in map(_calibrated, KINDS):
        count = kind.frames if most is None else min(most, kind.frames)
        for seed in range(1, count + 1):
            frame, xy = make_frame(kind, seed)
            out.append((frame, xy, stars_of(seed)[1]))
    return out


def _calibrated(kind: Kind) -> Kind:
    """The kind without hot pixels, but for the one frame that is noisy in the thesis too."""
    return kind if kind.frames == 1 else replace(kind, sky=replace(kind.sky, hot_per_mp=0.0))


def measured(
    name: str, pictures: list[tuple[Frame, Floats, Floats]]
) -> tuple[tuple[float, ...], float]:
    """The six measures of ``WHAT`` and the mean processor seconds a frame."""
    detector = make_detector(name)
    rates, errors, spent = [], [], 0.0
    for frame, xy, snr in pictures:
        found, seconds = timed(lambda: detector.detect(frame))  # noqa: B023
        spent += seconds
        (_, predictive), off = compare(found.xy, xy)
        visible = snr >= VISIBLE_SNR
        seen = np.isfinite(off[visible, 0])
        rates.append((float(seen.mean()) if len(seen) else 1.0, predictive))
        errors.append(off[visible & np.isfinite(off[:, 0])])
    tpr, ppv = np.array(rates).T
    ex, ey = np.concatenate(errors).mean(axis=0)
    perfect = 100.0 * float((tpr == 1.0).mean()), 100.0 * float((ppv == 1.0).mean())
    least = float(tpr.min()), float(ppv.min())
    return (*least, float(ex), float(ey), *perfect), spent / len(pictures)
