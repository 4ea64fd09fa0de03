"""Images that were resized: pixels that are not square, seen in the stars and fitted.

A stretched image agrees with the sky along a line or in a corner, and a fit of square pixels to that part is turned by
as much as the image is stretched: several degrees. So a fit that is poor is tried with any linear map from where it
puts the stars to where they are seen. Where that map is longer along the rows than along the columns, or shorter, the
stars are put where square pixels would have them, fitted again, and the camera keeps the ratio.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from kochab.attitude import wahba
from kochab.attitude.fit import Fit
from kochab.core.arrays import Floats, Ints
from kochab.core.attitude import Attitude
from kochab.core.camera import Camera
from kochab.core.frame import Detections
from kochab.core.pairing import mutual_nearest
from kochab.core.progress import Progress, Task
from kochab.core.solution import Identification, Matches, NoSolution, Reason, StarCatalogue
from kochab.core.values import frozen
from kochab.identification.verification import ACCEPT_LOG10
from kochab.solver.matches import field_centre, fitted_anew, has_diverged
from kochab.solver.window_ladder import MOST_WINDOWS
from kochab.text.translation import tr

POOR_FIT = 0.0005
"""Residuals of this RMS, over the frame's larger side, may have a cause that the camera model lacks."""
POORER_FIT = 0.0015
"""And of this one surely; if it has few stars, it may have turned along a line of them."""
SAME_PLACE = 0.002
"""Matches this close, over the larger side, tell which of two models is right."""
START = 0.009
"""So close are stars paired with places at first."""
STRETCH_ROUNDS, FEWEST_TO_STRETCH = 8, 10
LEAST_STRETCH, OBLIQUE = 0.003, 0.25
"""Less of a stretch is none; and this part of it may be along another direction than rows and columns."""
CLOSER, SURE, KEPT = 2, 8, 0.5
"""Square pixels are improved on when twice as many stars and eight lie as close as the new fit's usually do, and half
stay: of nine stars in whole pixels, seven lay so close by a ratio that was none."""
ASPECT_ROUNDS, SETTLED = 4, 2e-5
BESIDE = 1.04
"""Patterns tolerate a stretch by this factor: the true ratio may differ as much from the one they were found with."""
HIDDEN = 0.005
"""Where the residuals leave room for no larger stretch than this, no ratio is tried; and a smaller one is a lens's."""


@frozen(eq=False)
class Stretch:
    """A linear map (2, 2) of places by square pixels to where stars are seen, and the stars that agree with it.

    ``sure``: at least twice as many agree as without it.
    """

    linear: Floats
    matches: Matches
    sure: bool

    @property
    def share(self) -> float:
        """By what share the image is longer one way than across."""
        longer, shorter = np.linalg.svd(self.linear, compute_uv=False)
        return float(longer / shorter - 1.0)

    @property
    def aspect(self) -> float | None:
        """How many times longer it is along the rows than along the columns; None for another direction, and none."""
        across, down = np.hypot(*self.linear)
        aspect = float(across / down)
        shear = abs(float(self.linear[:, 0] @ self.linear[:, 1])) / float(across * down)
        change = abs(np.log(aspect))
        return aspect if change > LEAST_STRETCH and shear < OBLIQUE * change else None


def stretch(
    detections: Detections, matches: Matches, fit: Fit, catalogue: StarCatalogue, year: float
) -> Stretch | None:
    """How a poorly fitted frame is stretched; None when that is not why, or the fit is good.

    Parameters
    ----------
    detections : Detections
        All of the frame.
    matches : Matches
        Those that agree with a part of the sky.
    fit : Fit
        Of square pixels to them.
    catalogue : StarCatalogue
        Where stars are looked up.
    year : float
        Epoch of their places, Julian year.
    """
    camera = fit.camera
    side = float(max(camera.width, camera.height))
    if fit.rms_px < POOR_FIT * side or len(matches) < FEWEST_TO_STRETCH:
        return None
    centre, radius = field_centre(camera, fit.attitude)
    rows = catalogue.brightest(centre, min(radius, np.pi / 2), 2 * len(detections), year)
    vectors = catalogue.vectors(rows, year)
    rays = vectors @ fit.attitude.matrix.T
    before = len(mutual_nearest(detections.xy, camera.project(rays), SAME_PLACE * side)[0])
    found = None
    for plain, attitude in _unbent(matches, fit):
        seen, place = matches.xy, plain.project(matches.vectors @ attitude.matrix.T)
        expected = plain.project(vectors @ attitude.matrix.T)
        linear, (i, j) = _stretched_to(detections.xy, expected, seen, place, side)
        if len(i) >= FEWEST_TO_STRETCH:
            stars = Matches(i.astype(np.int64), rows[j], detections.xy[i], vectors[j])
            other = Stretch(linear, stars, len(stars) >= 2 * before)
            if other.sure:
                return other
            found = found or other
    return found


def _unbent(matches: Matches, fit: Fit) -> Iterator[tuple[Camera, Attitude]]:
    """The camera without the distortion that may have bent to the stretch, then with its optical axis unmoved too."""
    camera = fit.camera
    yield replace(camera, k1=0.0, k2=0.0, p1=0.0, p2=0.0), fit.attitude
    if has_diverged(camera):
        return
    centred = type(camera).centred(camera.width, camera.height, camera.focal_px, camera.mirrored)
    yield centred, wahba(centred.unproject(matches.xy), matches.vectors)


def _stretched_to(
    xy: Floats, expected: Floats, seen: Floats, place: Floats, side: float
) -> tuple[Floats, tuple[Ints, Ints]]:
    """The map (2, 2) of expected places (N, 2) to stars (M, 2), and the pairs that agree with it: few are none."""
    tolerance, linear, moved = START * side, np.eye(3)[:, :2], expected
    for _ in range(STRETCH_ROUNDS):
        if len(seen) < FEWEST_TO_STRETCH:
            return linear[:2], (np.zeros(0, np.int64), np.zeros(0, np.int64))
        linear = _linear(place, seen)
        moved = expected @ linear[:2] + linear[2]
        i, j = mutual_nearest(xy, moved, tolerance)
        seen, place = xy[i], expected[j]
        tolerance = max(0.8 * tolerance, SAME_PLACE * side)
    return linear[:2], mutual_nearest(xy, moved, SAME_PLACE * side)


Grow = Callable[[Detections, Identification], tuple[Matches, Fit]]
"""Makes matches and fit of all stars and those identified."""


def fitted(
    grow: Grow, detections: Detections, found: Identification, catalogue: StarCatalogue, year: float
) -> tuple[Matches, Fit, Stretch | None]:
    """Matches and fit as ``grow`` makes them by square pixels, or with the aspect ratio that the stars support.

    The stretch is None, unless the frame is stretched in a direction that no camera has: then the fit is turned.

    Parameters
    ----------
    grow : Grow
        Grows and fits by square pixels.
    detections : Detections
        All of the frame.
    found : Identification
        How its stars were identified; its camera may have an aspect ratio, near the frame's.
    catalogue : StarCatalogue
        Where stars are looked up.
    year : float
        Epoch of their places, Julian year.
    """
    aspect = found.camera.aspect
    square, start = _square(detections, found, aspect)
    matches, fit = grow(square, start)
    left = stretch(square, matches, fit, catalogue, year)
    ratio = None
    for more, places in _trials(left, start, found, matches, fit, detections):
        again, other, tried = _settled(grow, detections, replace(found, matches=places), more)
        close, before = (_closer(each, other.rms_px) for each in (other, fit))
        shown = abs(math.log(tried)) > HIDDEN
        if shown and len(again) >= KEPT * len(matches) and close >= CLOSER * before + SURE:
            matches, fit, ratio = again, other, tried
            if fit.rms_px < POOR_FIT * max(detections.width, detections.height):
                break
    if ratio is not None:
        return *_as_recorded(matches, fit, detections, ratio), None
    if aspect != 1.0:  # near enough to be seen by, but one of a few that were tried
        again, other, ratio = _settled_best(grow, detections, replace(found, matches=_recorded(matches, detections)))
        poor = other.rms_px > POORER_FIT * max(detections.width, detections.height)
        stretched = Stretch(np.diag([ratio, 1.0]), again, sure=True) if poor else None
        return *_as_recorded(again, other, detections, ratio), stretched
    return matches, fit, left if left is not None and left.sure else None


def _closer(fit: Fit, than_px: float) -> int:
    """How many stars lie so close to their places."""
    return int((np.hypot(*fit.residuals_px.T) <= than_px).sum())


def _hidden_stretch(matches: Matches, fit: Fit) -> float:
    """The stretch that would make all residuals of a fit: scale and turn have taken up what they can of it.

    Stars that spread by sx and sy are left with s sx sy / sqrt(sx^2 + sy^2) by a stretch s, RMS.
    """
    x, y = matches.xy.std(axis=0).tolist()
    return float(fit.rms_px * math.hypot(x, y) / max(x * y, 1e-9))


def _trials(
    left: Stretch | None,
    start: Identification,
    found: Identification,
    matches: Matches,
    fit: Fit,
    detections: Detections,
) -> Iterator[tuple[float, Matches]]:
    """Ratios to try and the stars to begin with: what is left to be seen, and of a poor fit to few stars any."""
    aspect, side = found.camera.aspect, max(detections.width, detections.height)
    if left is not None and left.aspect is not None:
        yield aspect * left.aspect, _recorded(left.matches, detections)
    if fit.rms_px > POOR_FIT * side:
        # a lens tilted by 13 deg looks like 3 % of a stretch: what the stars say before any lens is fitted
        c = start.camera
        plain = fitted_anew(start.matches, type(c).centred(c.width, c.height, c.focal_px, c.mirrored))
        ratio = _ratio(start.matches, plain)
        if abs(math.log(ratio)) > LEAST_STRETCH:
            yield aspect * ratio, found.matches
    few = len(detections) / max(int(fit.inliers.sum()), 1)
    tried = few > 4.0 or (few > 2.0 and fit.rms_px > POORER_FIT * side)
    if aspect == 1.0 and tried and _hidden_stretch(matches, fit) > HIDDEN:
        yield from ((ratio, found.matches) for ratio in ASPECTS)


def _settled(grow: Grow, detections: Detections, found: Identification, aspect: float) -> tuple[Matches, Fit, float]:
    """Matches and fit in square pixels, and the aspect ratio refined until no stretch is left."""
    for _ in range(ASPECT_ROUNDS):
        square, start = _square(detections, found, aspect)
        matches, fit = grow(square, start)
        if len(matches) < FEWEST_TO_STRETCH:
            break
        ratio = _ratio(matches, fit)
        aspect *= ratio
        found = replace(found, matches=_recorded(matches, detections))
        if abs(ratio - 1.0) < SETTLED:
            break
    return matches, fit, aspect


def _settled_best(grow: Grow, detections: Detections, found: Identification) -> tuple[Matches, Fit, float]:
    """The same from the ratio that the stars were found with, and from its neighbours while the fit is poor."""
    side, best = max(detections.width, detections.height), None
    for beside in (1.0, BESIDE, 1.0 / BESIDE):
        trial = _settled(grow, detections, found, found.camera.aspect * beside)
        if best is None or len(trial[0]) > len(best[0]):
            best = trial
        if best[1].rms_px < POOR_FIT * side:
            break
    assert best is not None
    return best


def _ratio(matches: Matches, fit: Fit) -> float:
    """How much the image is stretched along rows relative to columns: 1 for square pixels and a diverged fit."""
    if has_diverged(fit.camera):
        return 1.0
    left = _linear(fit.camera.project(matches.vectors @ fit.attitude.matrix.T), matches.xy)
    across, down = np.hypot(*left[:2])
    return float(across / down)


def _square(detections: Detections, found: Identification, aspect: float) -> tuple[Detections, Identification]:
    """All stars and those identified, in a frame whose pixels are square."""
    if aspect == 1.0 == found.camera.aspect:
        return detections, found
    square = resized(detections, 1.0 / aspect)
    matches = replace(found.matches, xy=square.xy[found.matches.detection])
    lens = type(found.camera).centred(square.width, square.height, found.camera.focal_px, found.camera.mirrored)
    first = fitted_anew(matches, lens)
    return square, replace(found, matches=matches, camera=first.camera, attitude=first.attitude)


def _recorded(matches: Matches, detections: Detections) -> Matches:
    return replace(matches, xy=detections.xy[matches.detection])


def resized(detections: Detections, share: float) -> Detections:
    """The stars of the same image made ``share`` times as wide."""
    xy = detections.xy.copy()
    xy[:, 0] = (xy[:, 0] + 0.5) * share - 0.5
    return replace(detections, xy=xy, width=max(2, round(detections.width * share)))


def _as_recorded(matches: Matches, fit: Fit, detections: Detections, aspect: float) -> tuple[Matches, Fit]:
    """The same in the pixels of the stretched frame."""
    camera = replace(
        fit.camera, width=detections.width, cx=(fit.camera.cx + 0.5) * aspect - 0.5, aspect=fit.camera.aspect * aspect
    )
    residuals = fit.residuals_px * (aspect, 1.0)
    rms = float(np.sqrt(np.mean(np.square(residuals).sum(axis=1))))
    return _recorded(matches, detections), replace(fit, camera=camera, residuals_px=residuals, rms_px=rms)


def _linear(place: Floats, seen: Floats) -> Floats:
    """The map (3, 2), its shift last, of places (N, 2) to where they are seen (N, 2)."""
    design = np.column_stack([place, np.ones(len(place))])
    return np.asarray(np.linalg.lstsq(design, seen, rcond=None)[0], dtype=np.float64)


# -- More of a stretch than patterns bear ------------------------------------------------------

ASPECTS = (1.06, 1.0 / 1.06, 1.125, 1.0 / 1.125, 1.19, 1.0 / 1.19)
"""A pattern bears 4 % of a stretch: these reach from 3 to 23 %, as between frames of 5:4, 4:3, 3:2 and 16:9."""
QUICKEST = 3
"""The last of the windows' stages finds 3 of 96 more, at three times the cost."""


def search_stretched(detections: Detections, year: float) -> Task[Identification | NoSolution]:
    """What patterns find when the frame is stretched back by one ratio after another; the camera has the ratio.

    Parameters
    ----------
    detections : Detections
        All of the frame, brightest first.
    year : float
        The Julian year in which stars are placed.
    """
    from kochab.identification.index import shipped
    from kochab.identification.patterns import Patterns
    from kochab.solver.window_ladder import STAGES

    method = Patterns(shipped(), STAGES[:QUICKEST])
    for asked, aspect in enumerate(ASPECTS, 1):
        yield Progress("identify", 0.7, tr("stretched images"))
        found = yield from method.identify(resized(detections, 1.0 / aspect), None, year)
        if not isinstance(found, Identification):
            continue
        # Chance counts the windows of the frame that were asked before.
        found = replace(found, log10_false_alarm=found.log10_false_alarm + math.log10(MOST_WINDOWS + asked))
        if found.log10_false_alarm <= ACCEPT_LOG10:
            c = found.camera
            camera = replace(c, width=detections.width, cx=(c.cx + 0.5) * aspect - 0.5, aspect=aspect)
            return replace(found, camera=camera, matches=_recorded(found.matches, detections))
    # as one that tried nothing, so that the refusal of the whole frame's search stands
    return NoSolution(Reason.NO_PATTERN_AGREED, "", "nothing")
