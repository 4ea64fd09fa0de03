"""Where a tracked frame points: windows about the expected places, and what their finds agree on.

The Predictional Estimate (:mod:`kochab.identification.predictional_estimate`) over windows
instead of detections. The windows' finds first agree on a common shift, then the rotation is
refined.

How likely is it that chance alone agrees as well? A window's find that is not its star may be
anywhere in the window. So the bound is that of an agreement in :mod:`kochab.identification.verification`
where the stars are one to a window's area, and the three angles fitted to the finds moved them by half
a window at most. Each look at the prediction is a candidate. How dense the stars are elsewhere does
not matter here: each window has one star.
"""

from dataclasses import replace

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.camera import Camera
from kochab.core.frame import Detections, Frame
from kochab.core.values import frozen
from kochab.detection.star_fit import FWHM_PER_SIGMA, PIXEL_VARIANCE
from kochab.detection.windows import WindowStars, look
from kochab.identification.predictional_estimate import Estimate, concluded, differential, expected_px
from kochab.identification.verification import ACCEPT_LOG10, least_likely
from kochab.solver.track_prediction import Expected, Neighbourhood, Prediction

FEWEST = 4
LEAST_SHARE = 0.5  # of the finds that must agree
ROUNDS = 4
CLIP_SIGMA = 3.7
FARTHEST_PX = 3.0  # of a find that agrees, however unsure
WORST_PX = 1.2  # RMS of the residuals; a lens that moved or a wrong match is worse


@frozen(eq=False)
class Tracked:
    """An estimate whose ``star`` numbers the windows, with its false-alarm bound."""

    estimate: Estimate
    log10_false_alarm: float


def match(
    camera: Camera,
    matrix: Floats,
    vectors: Floats,
    places: Floats,
    seen: WindowStars,
    half: int,
    roll_px: float = 0.0,
    looks: int = 1,
) -> Tracked | None:
    """The attitude that W windows agree on, or None when chance could explain it.

    Parameters
    ----------
    camera : Camera
        Its model.
    matrix : Floats
        Predicted rotation (3, 3), ICRS to camera axes.
    vectors : Floats
        The expected stars (W, 3), ICRS unit vectors.
    places : Floats
        Where they were expected with ``matrix`` (W, 2), px.
    seen : WindowStars
        What the windows showed.
    half : int
        The windows' half size, px.
    roll_px : float
        What an error of roll may do at the frame's rim.
    looks : int
        How often the frame was looked at so far.
    """
    finds = np.flatnonzero(seen.found)
    if len(finds) < FEWEST:
        return None
    shift = (seen.xy - places)[finds]
    near = np.square(shift[:, None] - shift).sum(axis=2) <= (2.0 + roll_px) ** 2
    kept = finds[near[near.sum(axis=1).argmax()]]  # around the shift that most others are near to
    for _ in range(ROUNDS):
        if len(kept) < FEWEST:
            return None
        weight = 1.0 / seen.sigma_px[kept]
        matrix, _ = differential(camera, matrix, seen.xy[kept], vectors[kept], weight, steps=1)
        left = seen.xy[finds] - expected_px(camera, matrix, vectors[finds])
        length = np.hypot(*left.T)
        scaled = length / seen.sigma_px[finds]
        core = np.isin(finds, kept)
        clip = CLIP_SIGMA * max(1.0, 1.05 * float(np.median(scaled[core])))
        again = finds[(scaled <= clip) & (length <= FARTHEST_PX)]
        if np.array_equal(again, kept):
            break
        kept = again
    if len(kept) < max(FEWEST, LEAST_SHARE * len(finds)):
        return None
    estimate = concluded(camera, matrix, seen.xy, vectors, kept, kept, seen.sigma_px[kept])
    if estimate.sigma_px > WORST_PX:
        return None
    left = seen.xy[finds] - expected_px(camera, estimate.attitude.matrix, vectors[finds])
    side = 2.0 * half + 1.0
    square = np.sum(left**2, axis=1)
    alarm, _ = least_likely(square, len(finds), 1, side**2, float(half), candidates=looks, free=3)
    return Tracked(estimate, alarm) if alarm <= ACCEPT_LOG10 else None


# One look at a frame where a prediction puts the stars: what is there, and what it matches.

FEWEST_EXPECTED = 5
ENOUGH, ROUGH_PX, SECOND_LOOK_PX = 0.7, 0.5, 8
SHARPNESS_STARS, SHARPNESS_SHARE = 40, 0.5  # stars that tell whether they are sharp, and their share
SHARP_PX2 = 0.36 - PIXEL_VARIANCE


@frozen(eq=False)
class WindowSearchResult:
    """The prediction looked at, the sky there, the stars expected, what was seen, and what that matches."""

    place: Prediction
    sky: Neighbourhood
    stars: Expected
    seen: WindowStars
    found: Tracked

    @property
    def matched(self) -> tuple[Floats, Floats]:
        """Places (M, 2) px and ICRS unit vectors (M, 3) of the stars that agree."""
        window = self.found.estimate.star
        return self.seen.xy[window], self.sky.vectors[self.stars.number[window]]

    @property
    def poor(self) -> bool:
        """Whether a second look may be worth it."""
        estimate = self.found.estimate
        few = len(estimate.seen) < ENOUGH * len(self.stars.number)
        return few or estimate.sigma_px > ROUGH_PX

    def better_of(self, again: "WindowSearchResult | None") -> "WindowSearchResult":
        """A second look if it is better. The first one's bound stands: it had no help."""
        if again is None:
            return self
        mine, its = self.found.estimate, again.found.estimate
        sharper = its.sigma_px < mine.sigma_px and 2 * len(its.seen) > len(mine.seen)
        if len(its.seen) <= len(mine.seen) and not sharper:
            return self
        alarm = self.found.log10_false_alarm
        return replace(again, place=self.place, found=Tracked(its, alarm))


class WindowSearch:
    """Looks at one frame; ``looks`` counts how often, since each look is a chance of error."""

    def __init__(self, frame: Frame, camera: Camera, image: "TrackedStarImage", stars: int) -> None:
        self._frame, self._camera = frame, camera
        self._image, self._stars = image, stars
        self.looks = 0

    def at(self, place: Prediction, sky: Neighbourhood) -> WindowSearchResult | None:
        """What is seen at a prediction, looked at again where that may help."""
        result = self._once(place, sky)
        if result is None:  # perhaps the stars are smeared by a motion nobody expected
            result = self._once(place, sky, adapt=True)
        if result is None or not result.poor:
            return result
        # Many were beyond their windows, or smeared: now it is known where.
        return result.better_of(self._once(place, sky, result, adapt=True))

    def _once(
        self, place: Prediction, sky: Neighbourhood, before: WindowSearchResult | None = None, *, adapt: bool = False
    ) -> WindowSearchResult | None:
        """Look where the prediction, or a look before, puts the stars, and match what is there."""
        matrix, half, roll_px = place.ahead.matrix, place.half, place.roll_px
        if before is not None:
            matrix, half, roll_px = before.found.estimate.attitude.matrix, SECOND_LOOK_PX, 0.0
        stars = sky.expected(self._camera, matrix, self._stars, 4.0)
        if len(stars.number) < FEWEST_EXPECTED:
            return None
        self.looks += 1
        image = self._image.during(place, self._camera, self._frame.hint.exposure_s)
        sharp = self._image.sharp
        seen = look(self._frame, stars.xy, half, image, adapt=adapt and not sharp, sharp=sharp)
        vectors, place_px = sky.vectors[stars.number], self._camera.focal_px * sky.sigma_rad[stars.number]
        seen = replace(seen, sigma_px=np.hypot(seen.sigma_px, place_px))
        found = match(self._camera, matrix, vectors, stars.xy, seen, half, roll_px, looks=self.looks)
        return None if found is None else WindowSearchResult(place, sky, stars, seen, found)


class TrackedStarImage:
    """The image of a star at rest, which follows focus and seeing; ``size_px2`` second moment.

    ``sharp`` stars are as small as a pixel: what else looks so, the match has to tell.
    """

    def __init__(self, size_px2: float = 1.5, *, sharp: bool = False) -> None:
        self.size_px2, self.sharp = size_px2, sharp

    @classmethod
    def of(cls, detections: Detections, frame: Frame, xy: Floats) -> "TrackedStarImage":
        """That of the brightest unsaturated stars of a frame, whose stars are at ``xy`` (N, 2)."""
        image = cls._of(detections)
        if len(xy) < FEWEST_EXPECTED:
            return image
        seen = look(frame, xy[:SHARPNESS_STARS], SECOND_LOOK_PX, image.size_px2 * np.eye(2))
        if seen.found.mean() >= SHARPNESS_SHARE:
            return image
        sharp = cls(SHARP_PX2, sharp=True)
        again = look(frame, xy[:SHARPNESS_STARS], SECOND_LOOK_PX, SHARP_PX2 * np.eye(2), sharp=True)
        return sharp if again.found.mean() > max(SHARPNESS_SHARE, seen.found.mean()) else image

    @classmethod
    def _of(cls, detections: Detections) -> "TrackedStarImage":
        fwhm = detections.fwhm_px[~detections.saturated][:40]
        fwhm = fwhm[np.isfinite(fwhm)]
        middle = float(np.median(fwhm)) if len(fwhm) else 2.8
        return cls(max((middle / FWHM_PER_SIGMA) ** 2, 0.36 - PIXEL_VARIANCE))

    @property
    def fwhm_px(self) -> float:
        """Full width at half maximum."""
        return FWHM_PER_SIGMA * float(np.sqrt(self.size_px2))

    def during(self, place: Prediction, camera: Camera, exposure_s: float | None) -> Floats:
        """Second moments (2, 2), px^2: the round image, smeared along the predicted motion."""
        image = self.size_px2 * np.eye(2)
        trail = _trail_px(place, camera, exposure_s)
        if float(np.hypot(*trail)) > 1.0:
            image = image + np.outer(trail, trail) / 12.0
        return np.asarray(image)

    def learn(self, seen: WindowStars, place: Prediction, camera: Camera, exposure_s: float | None) -> None:
        """Follow what was seen, slowly, while nothing trails.

        Parameters
        ----------
        seen : WindowStars
            What the windows of a frame showed.
        place : Prediction
            The prediction, whose rates tell whether stars trail.
        camera : Camera
            Turns rates into pixels.
        exposure_s : float or None
            How long the frame was exposed; None: not known.
        """
        xx, yy, _ = seen.moments
        still = float(np.hypot(*_trail_px(place, camera, exposure_s))) < 1.0
        if still and not self.sharp and np.isfinite(xx * yy) and xx > 0 and yy > 0:
            size = float(np.sqrt(xx * yy))
            self.size_px2 += 0.1 * float(np.clip(size / self.size_px2 - 1.0, -0.5, 0.5))


def _trail_px(place: Prediction, camera: Camera, exposure_s: float | None) -> Floats:
    """How far (2,) a star in the middle of the frame moves while it is exposed."""
    x, y, _ = place.ahead.rates_rad_s * (exposure_s or 0.0) * camera.focal_px
    sign = -1.0 if camera.mirrored else 1.0
    return np.array([-sign * y, x])
