"""Lost in space once, then tracking: every frame of a stream to a pointing and a rate.

The first frame is solved blind. From then on the filter (:mod:`app.attitude.filter`: an error-state
Kalman filter of attitude and angular velocity) says where the camera points at the next frame's
time, and only small windows around the stars expected there are read
(:mod:`app.solve.track_windows`). When what they hold is no better than chance
(:mod:`app.solve.track_match`), the same frame is solved blind.
"""

from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from app.attitude.filter import Motion, State, begin, predicted, updated
from app.core.attitude import Attitude
from app.core.camera import Camera
from app.core.detections import Detections
from app.core.frame import Frame
from app.core.hint import Hint
from app.core.progress import Progress, Task
from app.core.solution import NoSolution, Solution
from app.detect.moments import FWHM_PER_SIGMA, PIXEL_VARIANCE
from app.solve.options import SolveOptions
from app.solve.profiles import Profile
from app.solve.solver import Examined, examine_frame, merged_hint, year_of
from app.solve.track_answer import tracked_solution
from app.solve.track_camera import TrackedCamera, turn_between
from app.solve.track_match import Tracked, match
from app.solve.track_sky import Expected, Neighbourhood
from app.solve.track_update import Mode, TrackUpdate
from app.solve.track_windows import Seen, look

if TYPE_CHECKING:
    from app.sky import Catalogue

__all__ = ["Mode", "TrackOptions", "TrackUpdate", "Tracker"]

Floats = NDArray[np.float64]

FEWEST_EXPECTED = 5
ENOUGH, ROUGH_PX, SECOND_LOOK_PX = 0.7, 0.5, 8
BLEND_FWHM = 2.5
SAME_MOTION_S = 3.0  # after a longer gap the rates begin anew
PATIENCE = 10  # frames without an answer until the scale of the frames before is doubted
KNOWN_SCALE = 1.03  # the scale of the frame before is good to so much


@dataclass(frozen=True, slots=True)
class TrackOptions:
    """Choices for a stream: how a lost frame is solved, how the camera is believed to move.

    ``stars`` are looked for at most, in windows of up to ``half_px`` to each side. A pointing that
    is ``memory_s`` old is no prediction any more. Every ``calibrate_every`` frames the camera's
    profile is improved by what the stars say; 0 leaves it at what the first frame said.
    """

    solve: SolveOptions = field(default_factory=SolveOptions)
    motion: Motion = field(default_factory=Motion)
    stars: int = 40
    half_px: int = 32
    memory_s: float = 30.0
    calibrate_every: int = 10


@dataclass(frozen=True, slots=True, eq=False)
class _Sighted:
    """Stars looked for, what was seen, and what it matches."""

    stars: Expected
    seen: Seen
    found: Tracked

    @property
    def poor(self) -> bool:
        """Whether a second look may be worth it."""
        estimate = self.found.estimate
        few = len(estimate.seen) < ENOUGH * len(self.stars.number)
        return few or estimate.sigma_px > ROUGH_PX

    def bettered(self, again: "_Sighted | None") -> "_Sighted":
        """A second look if it is better. The first one's bound stands: it had no help."""
        if again is None:
            return self
        mine, its = self.found.estimate, again.found.estimate
        sharper = its.sigma_px < mine.sigma_px and 2 * len(its.seen) > len(mine.seen)
        if len(its.seen) <= len(mine.seen) and not sharper:
            return self
        alarm = self.found.log10_false_alarm
        return _Sighted(again.stars, again.seen, Tracked(again.found.estimate, alarm))


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
        self._size_px2 = 1.5  # second moment of the star image
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
        assert self.state is not None
        assert self.camera is not None
        clock = perf_counter()
        ahead = predicted(self.state, moment.timestamp(), self.options.motion)
        half = self._half_px(ahead)
        if half is None:
            return None
        sky = self._neighbourhood(ahead.attitude, moment)
        image = self._star_image(ahead, frame.hint.exposure_s)
        roll_px = self._roll_px(ahead)
        sighted = self._sighted(frame, sky, ahead.matrix, half, image, roll_px)
        if sighted is None:  # perhaps the stars are smeared by a motion nobody expected
            sighted = self._sighted(frame, sky, ahead.matrix, half, image, roll_px, adapt=True)
            if sighted is None:
                return None
        if sighted.poor:  # many were beyond their windows, or smeared: now it is known where
            matrix = sighted.found.estimate.attitude.matrix
            again = self._sighted(frame, sky, matrix, SECOND_LOOK_PX, image, 0.0, adapt=True)
            sighted = sighted.bettered(again)
        stars, seen, found = sighted.stars, sighted.seen, sighted.found
        vectors = sky.vectors[stars.number]
        total = 1e3 * (perf_counter() - clock)
        spent = {"read": 0.0, "detect": total, "identify": 0.0, "attitude": 0.0, "total": total}
        solution = tracked_solution(found, self.camera, sky, stars, seen, spent, frame.warnings)
        self._learn(seen, found, ahead, frame.hint.exposure_s)
        solution = self._calibrated(solution, seen, found, vectors)
        self._failures = 0
        return self._told(solution, moment, "tracking", ahead, len(stars.number))

    def _sighted(
        self, frame: Frame, sky: Neighbourhood, matrix: Floats, half: int, image: Floats,
        roll_px: float, *, adapt: bool = False,
    ) -> "_Sighted | None":  # fmt: skip
        """Look where ``matrix`` puts the stars, and match what is there."""
        assert self.camera is not None
        stars = sky.expected(self.camera, matrix, self.options.stars, 4.0)
        if len(stars.number) < FEWEST_EXPECTED:
            return None
        seen = look(frame, stars.xy, half, image, adapt=adapt)
        found = match(self.camera, matrix, sky.vectors[stars.number], stars.xy, seen, half, roll_px)
        return None if found is None else _Sighted(stars, seen, found)

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
        solution = self._begin_again(examined, frame.hint.camera)
        self._failures = 0
        ahead = None
        if before is not None and moment.timestamp() - before.time_s < SAME_MOTION_S:
            ahead = predicted(before, moment.timestamp(), self.options.motion)
            ahead = _seen_by(ahead, camera, solution.camera)
            if not self._was_lost and contradicts(ahead, solution.attitude, self.options):
                ahead = None  # a jump, as far as one frame can tell: no rate is concluded from it
        return self._told(solution, moment, "lost", ahead, 0)

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

    def _begin_again(self, examined: Examined, name: str) -> Solution:
        """Learn camera, star image and limit of detection from a frame solved as a whole."""
        assert isinstance(examined.result, Solution)
        solution = examined.result
        sentence = self._calibration.begin(solution, name)
        self._faintest = float(np.percentile([star.mag for star in solution.stars], 90))
        self._size_px2 = _star_size(examined.detections)
        self._sky = None
        return _warned(solution, sentence)

    def _calibrated(
        self, solution: Solution, seen: Seen, found: Tracked, vectors: Floats
    ) -> Solution:
        """Improve the camera now and then; a frame that contradicts its profile says so."""
        self._tracked_frames += 1
        every = self.options.calibrate_every
        if every == 0 or self._tracked_frames % every:
            return solution
        window, estimate = found.estimate.star, found.estimate
        sentence = self._calibration.learn(
            seen.xy[window], vectors[window], estimate.attitude, estimate.sigma_px
        )
        return _warned(solution, sentence)

    def _told(
        self, solution: Solution, moment: datetime, mode: Mode, ahead: State | None, expected: int
    ) -> TrackUpdate:
        """Update the filter by a solution, or begin it anew when ``ahead`` is None."""
        motion = self.options.motion
        self._was_lost = mode == "lost"
        if ahead is None:
            self.state = begin(solution.attitude, moment.timestamp(), motion)
        else:
            self.state = updated(ahead, solution.attitude, motion)
        state = self.state
        self.state = _seen_by(state, solution.camera, self.camera)
        return TrackUpdate(
            moment, mode, solution, None, state.attitude, state.rates_deg_s,
            state.rates_sigma_deg_s, expected, len(solution.stars), state.contradicted,
        )  # fmt: skip

    def _half_px(self, ahead: State) -> int | None:
        """Half the side of the windows; None when the stars may be outside any allowed one."""
        assert self.camera is not None
        tilt = float(np.sqrt(np.linalg.eigvalsh(ahead.covariance[:2, :2])[-1]))
        error = 4.0 * float(np.hypot(self.camera.focal_px * tilt, self._roll_px(ahead)))
        if error > self.options.half_px:
            return None
        fwhm = FWHM_PER_SIGMA * float(np.sqrt(self._size_px2))
        return int(np.clip(np.ceil(error + 2.0 * fwhm + 2.0), 8, self.options.half_px))

    def _roll_px(self, ahead: State) -> float:
        """What one sigma of roll moves a star at the frame's corner."""
        assert self.camera is not None
        corner = float(np.hypot(self.camera.width, self.camera.height)) / 2.0
        return corner * float(np.sqrt(ahead.covariance[2, 2]))

    def _neighbourhood(self, attitude: Attitude, moment: datetime) -> Neighbourhood:
        assert self.camera is not None
        if self._sky is None or not self._sky.covers(self.camera, attitude):
            blend = BLEND_FWHM * FWHM_PER_SIGMA * float(np.sqrt(self._size_px2))
            self._sky = Neighbourhood(
                self.catalogue, self.camera, attitude, year_of(moment), self._faintest, blend
            )
        return self._sky

    def _trail_px(self, ahead: State, exposure_s: float | None) -> Floats:
        """How far (2,) a star in the middle of the frame moves while it is exposed."""
        assert self.camera is not None
        x, y, _ = ahead.rates_rad_s * (exposure_s or 0.0) * self.camera.focal_px
        sign = -1.0 if self.camera.mirrored else 1.0
        return np.array([-sign * y, x])

    def _star_image(self, ahead: State, exposure_s: float | None) -> Floats:
        """Second moments (2, 2), px^2: the round image, smeared along the predicted motion."""
        image = self._size_px2 * np.eye(2)
        trail = self._trail_px(ahead, exposure_s)
        if float(np.hypot(*trail)) > 1.0:
            image = image + np.outer(trail, trail) / 12.0
        return np.asarray(image)

    def _learn(self, seen: Seen, found: Tracked, ahead: State, exposure_s: float | None) -> None:
        """Let the star image follow focus and seeing, slowly, while nothing trails."""
        xx, yy, _ = seen.moments
        still = float(np.hypot(*self._trail_px(ahead, exposure_s))) < 1.0
        if still and np.isfinite(xx * yy) and xx > 0 and yy > 0:
            size = float(np.sqrt(xx * yy))
            self._size_px2 += 0.1 * float(np.clip(size / self._size_px2 - 1.0, -0.5, 0.5))


def contradicts(ahead: State, attitude: Attitude, options: TrackOptions) -> bool:
    """Whether an attitude is beyond the gate of the prediction."""
    return updated(ahead, attitude, options.motion).contradicted


def _seen_by(state: State, before: Camera | None, after: Camera | None) -> State:
    """The same state in the axes of another model of the camera."""
    if before is None or after is None or before == after:
        return state
    turn = turn_between(before, after)
    both = np.kron(np.eye(2), turn)
    return replace(
        state, matrix=turn @ state.matrix, rates_rad_s=turn @ state.rates_rad_s,
        covariance=both @ state.covariance @ both.T,
    )  # fmt: skip


def _warned(solution: Solution, sentence: str) -> Solution:
    return replace(solution, warnings=(*solution.warnings, sentence)) if sentence else solution


def _star_size(detections: Detections) -> float:
    """Second moment, px^2, of the brightest unsaturated stars of a frame."""
    fwhm = detections.fwhm_px[~detections.saturated][:40]
    fwhm = fwhm[np.isfinite(fwhm)]
    middle = float(np.median(fwhm)) if len(fwhm) else 2.8
    return max((middle / FWHM_PER_SIGMA) ** 2, 0.36 - PIXEL_VARIANCE)
