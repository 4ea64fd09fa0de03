"""One look at a frame where a prediction puts the stars: what is there, and what it matches."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.core.camera import Camera
from app.core.detections import Detections
from app.core.frame import Frame
from app.detect.moments import FWHM_PER_SIGMA, PIXEL_VARIANCE
from app.solve.track_match import Tracked, match
from app.solve.track_places import Place
from app.solve.track_sky import Expected, Neighbourhood
from app.solve.track_windows import Seen, look

Floats = NDArray[np.float64]

FEWEST_EXPECTED = 5
ENOUGH, ROUGH_PX, SECOND_LOOK_PX = 0.7, 0.5, 8
JUDGED, MOSTLY = 40, 0.5  # stars that tell whether they are sharp, and their share
SHARP_PX2 = 0.36 - PIXEL_VARIANCE


@dataclass(frozen=True, slots=True, eq=False)
class Sighted:
    """The prediction looked at, the stars expected, what was seen, and what that matches."""

    place: Place
    stars: Expected
    seen: Seen
    found: Tracked

    @property
    def poor(self) -> bool:
        """Whether a second look may be worth it."""
        estimate = self.found.estimate
        few = len(estimate.seen) < ENOUGH * len(self.stars.number)
        return few or estimate.sigma_px > ROUGH_PX

    def bettered(self, again: "Sighted | None") -> "Sighted":
        """A second look if it is better. The first one's bound stands: it had no help."""
        if again is None:
            return self
        mine, its = self.found.estimate, again.found.estimate
        sharper = its.sigma_px < mine.sigma_px and 2 * len(its.seen) > len(mine.seen)
        if len(its.seen) <= len(mine.seen) and not sharper:
            return self
        alarm = self.found.log10_false_alarm
        return Sighted(self.place, again.stars, again.seen, Tracked(its, alarm))


class Looking:
    """Looks at one frame; ``looks`` counts how often, since each look is a chance of error."""

    def __init__(self, frame: Frame, camera: Camera, image: "StarImage", stars: int) -> None:
        self._frame, self._camera = frame, camera
        self._image, self._stars = image, stars
        self.looks = 0

    def at(self, place: Place, sky: Neighbourhood) -> Sighted | None:
        """What is seen at a prediction, looked at again where that may help."""
        sighted = self._once(place, sky)
        if sighted is None:  # perhaps the stars are smeared by a motion nobody expected
            sighted = self._once(place, sky, adapt=True)
        if sighted is None or not sighted.poor:
            return sighted
        # Many were beyond their windows, or smeared: now it is known where.
        return sighted.bettered(self._once(place, sky, sighted, adapt=True))

    def _once(
        self, place: Place, sky: Neighbourhood, before: Sighted | None = None, *,
        adapt: bool = False,
    ) -> Sighted | None:  # fmt: skip
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
        vectors = sky.vectors[stars.number]
        found = match(
            self._camera, matrix, vectors, stars.xy, seen, half, roll_px, looks=self.looks
        )
        return None if found is None else Sighted(place, stars, seen, found)


class StarImage:
    """The image of a star at rest, which follows focus and seeing; ``size_px2`` second moment.

    ``sharp`` stars are as small as a pixel: what else looks so, the match has to tell.
    """

    def __init__(self, size_px2: float = 1.5, *, sharp: bool = False) -> None:
        self.size_px2, self.sharp = size_px2, sharp

    @classmethod
    def of(cls, detections: Detections, frame: Frame, xy: Floats) -> "StarImage":
        """That of the brightest unsaturated stars of a frame, whose stars are at ``xy`` (N, 2)."""
        image = cls._of(detections)
        if len(xy) < FEWEST_EXPECTED:
            return image
        seen = look(frame, xy[:JUDGED], SECOND_LOOK_PX, image.size_px2 * np.eye(2))
        if seen.found.mean() >= MOSTLY:
            return image
        sharp = cls(SHARP_PX2, sharp=True)
        again = look(frame, xy[:JUDGED], SECOND_LOOK_PX, SHARP_PX2 * np.eye(2), sharp=True)
        return sharp if again.found.mean() > max(MOSTLY, seen.found.mean()) else image

    @classmethod
    def _of(cls, detections: Detections) -> "StarImage":
        fwhm = detections.fwhm_px[~detections.saturated][:40]
        fwhm = fwhm[np.isfinite(fwhm)]
        middle = float(np.median(fwhm)) if len(fwhm) else 2.8
        return cls(max((middle / FWHM_PER_SIGMA) ** 2, 0.36 - PIXEL_VARIANCE))

    @property
    def fwhm_px(self) -> float:
        """Full width at half maximum."""
        return FWHM_PER_SIGMA * float(np.sqrt(self.size_px2))

    def during(self, place: Place, camera: Camera, exposure_s: float | None) -> Floats:
        """Second moments (2, 2), px^2: the round image, smeared along the predicted motion."""
        image = self.size_px2 * np.eye(2)
        trail = _trail_px(place, camera, exposure_s)
        if float(np.hypot(*trail)) > 1.0:
            image = image + np.outer(trail, trail) / 12.0
        return np.asarray(image)

    def learn(self, seen: Seen, place: Place, camera: Camera, exposure_s: float | None) -> None:
        """Follow what was seen, slowly, while nothing trails."""
        xx, yy, _ = seen.moments
        still = float(np.hypot(*_trail_px(place, camera, exposure_s))) < 1.0
        if still and not self.sharp and np.isfinite(xx * yy) and xx > 0 and yy > 0:
            size = float(np.sqrt(xx * yy))
            self.size_px2 += 0.1 * float(np.clip(size / self.size_px2 - 1.0, -0.5, 0.5))


def _trail_px(place: Place, camera: Camera, exposure_s: float | None) -> Floats:
    """How far (2,) a star in the middle of the frame moves while it is exposed."""
    x, y, _ = place.ahead.rates_rad_s * (exposure_s or 0.0) * camera.focal_px
    sign = -1.0 if camera.mirrored else 1.0
    return np.array([-sign * y, x])
