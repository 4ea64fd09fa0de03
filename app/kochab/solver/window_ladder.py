"""When the whole frame finds no pattern: windows of it, two that agree, and one camera for all their stars.

Captions, roofs, streaks and trees fill the list of a frame's brightest detections, and strong distortion bends its
patterns; a window of half the frame has its own brightest stars and hardly any distortion. The middle is asked first,
then where most stars are, then above what a roof may hide. What a window finds is believed when another agrees, or when
chance is out of the question; then :func:`kochab.solver.matches.extend` grows it star by star over the whole frame.
"""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from kochab.core.arrays import Floats, Ints
from kochab.core.attitude import angle_between
from kochab.core.camera import Camera, FisheyeCamera
from kochab.core.frame import Detections
from kochab.core.progress import Progress, Task
from kochab.core.solution import Identification, Matches, NoSolution, Reason
from kochab.core.values import frozen
from kochab.identification.index import shipped
from kochab.identification.patterns import WIDE, Patterns, SearchStage
from kochab.identification.verification import ACCEPT_LOG10
from kochab.solver.matches import fitted_anew
from kochab.text.translation import tr

MIDDLE, REST = (0.5, 0.7, 0.35, 0.25), 0.5
"""Sides of the windows over the frame's: four in the middle, eight at the edges."""
ALONG = 0.6
"""Part of the frame above roofs and trees, or beside them."""
FEWEST_IN_WINDOW = 8
MOST_AT_EDGES = 3
"""So many windows at the edges are asked, those with most stars."""
MOST_WINDOWS = len(MIDDLE) + MOST_AT_EDGES + 2
"""So many are asked of a frame: beside these the part above a roof, and what lies opposite many lights."""
STAGES = (
    SearchStage(10, 5, 0.9, 0.003, 30, volume=1, max_verified=4, spread=1.6),
    SearchStage(14, 5, 0.9, 0.010, 40, focal=WIDE[:4], max_verified=8),
    SearchStage(18, 6, 0.9, 0.003, 40, volume=1, max_verified=8),
    SearchStage(24, 6, 1.0, 0.012, 50, focal=WIDE[:5], spread=3.0, max_verified=40),
)
"""The first of the whole frame's stages: nine of ten windows that find something find it in these. No window is asked
for a small field, and none is wider than 62 deg without being bent."""
BEYOND_DOUBT_LOG10 = -7.0
"""A window alone is believed at this bound."""
LENS = 1.6
"""Focal lengths of two windows of one frame differ by no more: to the edge of a fisheye lens and back."""
TURN_DEG = 15.0
"""And what one window says of the direction to the other's middle is no farther off."""
MISFIT = 0.004
"""Residuals of this RMS, over the frame's larger side, are another lens than the camera model's."""


@frozen(eq=False)
class _Window:
    """Part of a frame: its middle (2,) px in the frame, and the detections within, by number and in its own pixels."""

    middle: Floats
    numbers: Ints
    detections: Detections


def climb(detections: Detections, year: float) -> Task[Identification | NoSolution]:
    """What windows of the frame find together, the camera and the attitude the whole frame's.

    Parameters
    ----------
    detections : Detections
        Those of the whole frame, brightest first.
    year : float
        The Julian year in which stars are placed.

    Returns
    -------
    Identification or NoSolution
        The bound counts every window asked. A refusal that measured ``part_ra_deg`` and ``part_dec_deg`` knows where a
        window points, and no camera for the whole.

    """
    method = Patterns(shipped(), STAGES)
    found: list[tuple[_Window, Identification]] = []
    sure: Identification | None = None  # and yet no lens holds it and the rest
    asked = 0
    for window in _windows(detections):
        yield Progress("identify", 0.6, tr("windows of the frame"))
        asked += 1
        answer = yield from method.identify(window.detections, None, year)
        if not isinstance(answer, Identification):
            continue
        answer = replace(answer, log10_false_alarm=answer.log10_false_alarm + math.log10(asked))
        if answer.log10_false_alarm > ACCEPT_LOG10:
            continue
        found.append((window, answer))
        agreeing = [one for one in found if one[1] is answer or _agree(one, (window, answer))]
        if len(agreeing) > 1 or answer.log10_false_alarm <= BEYOND_DOUBT_LOG10:
            joined, sure = _joined(detections, agreeing), answer
            if joined is not None:
                return joined
    if sure is None:
        # as one that tried nothing, so that the refusal of the whole frame's search stands
        return NoSolution(Reason.NO_PATTERN_AGREED, "", "nothing")
    ra, dec = sure.attitude.ra_dec_deg
    advice = tr(
        "A part of the frame is at RA {ra:.2f}, Dec {dec:+.2f} deg, but no lens explains the whole: crop that part.",
        ra=ra,
        dec=dec,
    )
    matched = tr("{matches} stars matched in a part of the frame", matches=len(sure.matches))
    return NoSolution(Reason.DISTORTION_TOO_STRONG, advice, matched, measured={"part_ra_deg": ra, "part_dec_deg": dec})


def _windows(detections: Detections) -> Iterator[_Window]:
    """The middle in four sizes, the fullest at the edges, what is above a roof, and what lies opposite many lights."""
    size = np.array([detections.width, detections.height], dtype=np.float64)
    middle = (size - 1.0) / 2.0
    yield from filter(_enough, (_window(detections, middle, size * share) for share in MIDDLE))
    steps = [np.array([x, y]) for x in (-1, 0, 1) for y in (-1, 0, 1) if (x, y) != (0, 0)]
    around = [_window(detections, middle + step * size * (1.0 - REST) / 2.0, size * REST) for step in steps]
    fullest = sorted(filter(_enough, around), key=lambda w: -len(w.numbers))
    yield from fullest[:MOST_AT_EDGES]
    right, below = np.count_nonzero(detections.xy > middle, axis=0) - len(detections) / 2.0
    emptier = (-np.sign(right), 0.0) if abs(right) > abs(below) else (0.0, -np.sign(below))
    for side in dict.fromkeys([(0.0, -1.0), (float(emptier[0]), float(emptier[1]))]):
        share = 1.0 - (1.0 - ALONG) * np.abs(side)
        window = _window(detections, middle + np.array(side) * size * (1.0 - ALONG) / 2.0, size * share)
        if _enough(window) and any(side):
            yield window


def _enough(window: _Window) -> bool:
    return len(window.numbers) >= FEWEST_IN_WINDOW


def _window(detections: Detections, middle: Floats, size: Floats) -> _Window:
    """The detections in a window of ``size`` (2,) px, in which its ``middle`` (2,) is the middle."""
    inside = (np.abs(detections.xy - middle) < size / 2.0).all(axis=1)
    numbers = np.flatnonzero(inside).astype(np.int64)
    width, height = (int(s) for s in size)
    own = detections.take(numbers)
    xy = own.xy - middle + (np.array([width, height]) - 1.0) / 2.0
    return _Window(middle, numbers, replace(own, width=width, height=height, xy=xy))


def _agree(one: tuple[_Window, Identification], other: tuple[_Window, Identification]) -> bool:
    """Whether two windows may be parts of one frame behind any lens.

    The first looks at the other's middle where the other looks: by the angle between them to a third, by its direction
    within 15 deg. Two wrong answers agree so once in thousands.
    """
    (window, first), (beside, second) = one, other
    if first.camera.mirrored != second.camera.mirrored:
        return False
    if not 1.0 / LENS < first.camera.focal_px / second.camera.focal_px < LENS:
        return False
    step = beside.middle - window.middle
    away_rad = float(np.hypot(*step)) / math.sqrt(first.camera.focal_px * second.camera.focal_px)
    apart_rad = float(angle_between(first.attitude.boresight, second.attitude.boresight))
    slack_rad = math.radians(TURN_DEG) * max(away_rad, 0.05)
    if abs(apart_rad - away_rad) > max(away_rad / 3.0, slack_rad):
        return False
    # the rotation from one to the other is about an axis across the step, and turns the frame by little
    turn = second.attitude.matrix @ first.attitude.matrix.T
    seen = turn @ np.array([0.0, 0.0, 1.0])  # the first's middle, from the other
    sign = -1.0 if first.camera.mirrored else 1.0
    towards = np.array([-sign * step[0], -step[1]])
    if away_rad < 0.05:
        return apart_rad < 0.1
    cosine = float(seen[:2] @ towards) / max(float(np.hypot(*seen[:2]) * np.hypot(*towards)), 1e-12)
    return cosine > math.cos(math.radians(TURN_DEG))


def _joined(detections: Detections, agreeing: list[tuple[_Window, Identification]]) -> Identification | None:
    """One camera and attitude for the stars of all, or None where no camera of the model holds them."""
    numbers = np.concatenate([w.numbers[a.matches.detection] for w, a in agreeing])
    stars = np.concatenate([a.matches.star for _, a in agreeing])
    vectors = np.concatenate([a.matches.vectors for _, a in agreeing])
    _, first = np.unique(numbers, return_index=True)
    matches = Matches(numbers[first], stars[first], detections.xy[numbers[first]], vectors[first])
    best = min((a for _, a in agreeing), key=lambda a: a.log10_false_alarm)
    width, height = detections.width, detections.height
    for lens in (Camera, FisheyeCamera):
        fit = fitted_anew(matches, lens.centred(width, height, best.camera.focal_px, best.camera.mirrored))
        if fit.rms_px <= MISFIT * max(width, height) and 3 * int(fit.inliers.sum()) >= 2 * len(matches):
            kept = matches.take(fit.inliers)
            return Identification(kept, fit.camera, fit.attitude, best.log10_false_alarm, "patterns", best.candidates)
    return None
