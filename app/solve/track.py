"""Lost in space once, then tracking: every frame of a stream to a pointing and a rate.

The first frame is solved blind. From then on the filter (:mod:`app.attitude.filter`: an error-state
Kalman filter of attitude and angular velocity) says where the camera points at the next frame's
time, and only small windows around the stars expected there are read
(:mod:`app.solve.track_windows`). When what they hold is no better than chance
(:mod:`app.solve.track_match`), the same frame is solved blind.
"""

from dataclasses import replace
from datetime import UTC, datetime
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from app.attitude.filter import State, predicted, updated
from app.core.attitude import Attitude
from app.core.camera import Camera
from app.core.frame import Frame
from app.core.hint import Hint
from app.core.progress import Progress, Task
from app.core.solution import NoSolution, Solution
from app.solve.profiles import Profile
from app.solve.solver import Examined, examine_frame, merged_hint, year_of
from app.solve.track_answer import tracked_solution
from app.solve.track_camera import TrackedCamera
from app.solve.track_look import Looking, Sighted, StarImage
from app.solve.track_motion import found_again, seen_by
from app.solve.track_options import TrackOptions
from app.solve.track_places import places
from app.solve.track_sky import Neighbourhood
from app.solve.track_update import Mode, TrackUpdate

if TYPE_CHECKING:
    from app.sky import Catalogue

__all__ = ["Mode", "TrackOptions", "TrackUpdate", "Tracker"]

Floats = NDArray[np.float64]

BLEND_FWHM = 2.5
PATIENCE = 10  # frames without an answer until the scale of the frames before is doubted
KNOWN_SCALE = 1.03  # the scale of the frame before is good to so much


class Tracker:
    """Follows one camera. Not safe for several threads at once.

    ``catalogue`` is the shipped one unless given. ``profile`` is what is known of the camera from
    earlier frames (:mod:`app.solve.profiles_kept` recalls it); :attr:`profile` is what is known by
    now, for whoever wants to keep it.
    """

    def __init__(
        self, catalogue: "Catalogue | None" = None, options: TrackOptions | None = None,
        profile: Profile | None = None,
    ) -> None:  # fmt: skip
        from app.sky import open_catalogue

        self.catalogue = catalogue or open_catalogue()
        self.options = options or TrackOptions()
        self._calibration = TrackedCamera(profile)
        self.forget()

    @property
    def profile(self) -> Profile | None:
        """What is known of the camera by now."""
        return self._calibration.profile

    def forget(self) -> None:
        """Be lost: the next frame is solved blind."""
        self.state: State | None = None
        self._calibration.camera = None
        self._tracked_frames = 0
        self._sky: Neighbourhood | None = None
        self._faintest = 0.0
        self._image = StarImage()
        self._was_lost = True
        self._failures = 0

    @property
    def camera(self) -> Camera | None:
        """What the next frame is read with; None before the first solution."""
        return self._calibration.camera

    def update(self, frame: Frame, time_utc: datetime | None = None) -> Task[TrackUpdate]:
        """Take one frame in, newer than the last.

        ``time_utc`` is its mid-exposure; by default what the frame says of itself, else now.
        """
        moment = time_utc or frame.hint.time_utc or datetime.now(UTC)
        now = moment.timestamp()
        if not self._fits(frame, now):
            self.forget()
        if self.state is not None:
            yield Progress("track", 0.0)
            update = self._tracked(frame, moment)
            if update is not None:
                return update
        return (yield from self._lost(frame, moment))

    def prediction(self, time_utc: datetime) -> Attitude | None:
        """Where the camera is believed to point at a moment, with its growing covariance."""
        if self.state is None:
            return None
        return predicted(self.state, time_utc.timestamp(), self.options.motion).attitude

    def _fits(self, frame: Frame, now_s: float) -> bool:
        """Whether what is known can be of use for this frame."""
        if self.state is None or self.camera is None:
            return True
        same = (frame.width, frame.height) == (self.camera.width, self.camera.height)
        return same and -1.0 < now_s - self.state.time_s < self.options.memory_s

    def _tracked(self, frame: Frame, moment: datetime) -> TrackUpdate | None:
        """The answer from windows around the expected stars; None when there is none."""
        assert self.camera is not None
        clock = perf_counter()
        sky, sighted = self._sight(frame, moment)
        if sky is None or sighted is None:
            return None
        stars, seen, found, place = sighted.stars, sighted.seen, sighted.found, sighted.place
        total = 1e3 * (perf_counter() - clock)
        spent = {"read": 0.0, "detect": total, "identify": 0.0, "attitude": 0.0, "total": total}
        solution = tracked_solution(found, self.camera, sky, stars, seen, spent, frame.warnings)
        self._image.learn(seen, place, self.camera, frame.hint.exposure_s)
        solution = self._calibrated(solution, sighted, sky.vectors[stars.number])
        self._failures = 0
        state = updated(place.ahead, solution.attitude, self.options.motion)
        return self._told(solution, moment, "tracking", state, len(stars.number))

    def _sight(self, frame: Frame, moment: datetime) -> tuple[Neighbourhood | None, Sighted | None]:
        """What is seen at the likeliest place that holds anything, and the sky around it."""
        assert self.state is not None
        assert self.camera is not None
        options, looking, sky = self.options, None, None
        for place in places(
            self.state, moment.timestamp(), options.motion, self.camera, self._image.fwhm_px,
            (options.half_px, options.far_px),
        ):  # fmt: skip
            sky = self._neighbourhood(place.ahead.attitude, moment)
            if looking is None:
                looking = Looking(frame, self.camera, self._image, options.stars)
            sighted = looking.at(place, sky)
            if sighted is not None:
                return sky, sighted
        return sky, None

    def _lost(self, frame: Frame, moment: datetime) -> Task[TrackUpdate]:
        """The frame solved blind, or nearly so when the scale is known."""
        options, before = self.options.solve, self.state
        known = self._known_scale(frame)
        if known is not None:
            sure = self.camera is not None and self._failures < PATIENCE
            options = replace(options, blind_after_hint=options.blind_after_hint and not sure)
            options = replace(options, hint=merged_hint(known, options.hint), fov_deg=None)
        examined = yield from examine_frame(frame, options)
        if isinstance(examined.result, NoSolution):
            self._failures += 1
            return TrackUpdate(moment, "lost", None, examined.result)
        camera = self.camera
        solution = self._begin_again(examined, frame)
        self._failures = 0
        if before is not None:
            before = seen_by(before, camera, solution.camera)
        state = found_again(
            before, solution.attitude, moment.timestamp(), self.options.motion, self._was_lost
        )
        return self._told(solution, moment, "lost", state, 0)

    def _known_scale(self, frame: Frame) -> Hint | None:
        """What the frames before, or the profile, say of the scale."""
        if self.camera is not None:
            scale = self.camera.scale_arcsec_px
            return Hint(scale_arcsec_px=(scale / KNOWN_SCALE, scale * KNOWN_SCALE))
        lens = self.profile
        if lens is None or not lens.frames:
            return None
        same = (lens.camera.width, lens.camera.height) == (frame.width, frame.height)
        return lens.hint if same else None

    def _begin_again(self, examined: Examined, frame: Frame) -> Solution:
        """Learn camera, star image and limit of detection from a frame solved as a whole."""
        assert isinstance(examined.result, Solution)
        solution = examined.result
        sentence = self._calibration.begin(solution, frame.hint.camera)
        self._faintest = float(np.percentile([star.mag for star in solution.stars], 90))
        xy = np.array([(star.x, star.y) for star in solution.stars]).reshape(-1, 2)
        self._image = StarImage.of(examined.detections, frame, xy)
        self._sky = None
        return _warned(solution, sentence)

    def _calibrated(self, solution: Solution, sighted: Sighted, vectors: Floats) -> Solution:
        """Improve the camera now and then; a frame that contradicts its profile says so."""
        self._tracked_frames += 1
        every = self.options.calibrate_every
        if every == 0 or self._tracked_frames % every:
            return solution
        estimate = sighted.found.estimate
        window = estimate.star
        sentence = self._calibration.learn(
            sighted.seen.xy[window], vectors[window], estimate.attitude, estimate.sigma_px
        )
        return _warned(solution, sentence)

    def _told(
        self, solution: Solution, moment: datetime, mode: Mode, state: State, expected: int
    ) -> TrackUpdate:
        """Keep the filter's new state and tell it."""
        self._was_lost = mode == "lost"
        self.state = seen_by(state, solution.camera, self.camera)
        return TrackUpdate(
            moment, mode, solution, None, state.attitude, state.rates_deg_s,
            state.rates_sigma_deg_s, expected, len(solution.stars), state.contradicted,
        )  # fmt: skip

    def _neighbourhood(self, attitude: Attitude, moment: datetime) -> Neighbourhood:
        assert self.camera is not None
        if self._sky is None or not self._sky.covers(self.camera, attitude):
            blend = BLEND_FWHM * self._image.fwhm_px
            self._sky = Neighbourhood(
                self.catalogue, self.camera, attitude, year_of(moment), self._faintest, blend
            )
        return self._sky


def _warned(solution: Solution, sentence: str) -> Solution:
    return replace(solution, warnings=(*solution.warnings, sentence)) if sentence else solution
