"""Every frame of a stream to a pointing and a rate: lost in space once, then tracking.

The first frame is solved blind. From then on the filter (:mod:`kochab.attitude.filter`: an error-state
Kalman filter of attitude and angular velocity) says where the camera points at the next frame's
time, and only small windows around the stars expected there are read
(:mod:`kochab.solver.track_windows`). When what they hold is no better than chance
(:mod:`kochab.solver.track_windows`), the same frame is solved blind.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from time import perf_counter
from typing import TYPE_CHECKING, Literal

import numpy as np

from kochab.attitude.filter import ARCSEC, FilterState, MotionModel, begin, predicted, rotation_vector, updated
from kochab.core.arrays import Floats
from kochab.core.attitude import Attitude
from kochab.core.camera import Camera
from kochab.core.frame import Frame, Hint
from kochab.core.progress import Progress, Task
from kochab.core.solution import NamedStar, NoSolution, Solution
from kochab.solver import SolveOptions
from kochab.solver.camera_profile import Profile, TrackedCamera, turn_between
from kochab.solver.pipeline import Examined, examine_frame, merged_hint, year_of
from kochab.solver.track_prediction import Expected, Neighbourhood, places
from kochab.solver.track_windows import Tracked, TrackedStarImage, WindowSearch, WindowSearchResult, WindowStars

if TYPE_CHECKING:
    from kochab.sky import Catalogue


# -- What may be chosen about following one camera ---------------------------------------------


@dataclass(frozen=True, slots=True)
class TrackOptions:
    """Choices for a stream: how a lost frame is solved, how the camera is believed to move.

    ``stars`` are looked for at most, in windows of up to ``half_px`` to each side, and of up to
    ``far_px`` when the prediction is less certain than that. A pointing that is ``memory_s`` old is
    no prediction any more. Every ``calibrate_every`` frames the camera's profile is improved by
    what the stars say; 0 leaves it at what the first frame said.
    """

    solve: SolveOptions = field(default_factory=SolveOptions)
    motion: MotionModel = field(default_factory=MotionModel)
    stars: int = 40
    half_px: int = 32
    far_px: int = 64
    memory_s: float = 900.0
    calibrate_every: int = 10


# -- What the tracker tells of one frame -------------------------------------------------------

Mode = Literal["lost", "tracking"]


@dataclass(frozen=True, slots=True, eq=False)
class TrackUpdate:
    """What one frame told. Everything in it belongs to ``time_utc``, the frame's own moment.

    ``solution`` is what this frame's stars say alone, None when there is none and ``reason`` says
    why. ``mode`` tells how it was found. ``filtered`` is the attitude after all frames so far, of
    the solution's camera, and :attr:`filtered_centre` where that points; its ``sigma_arcsec`` are
    smaller than the solution's. ``rates_deg_s`` are the camera's angular velocities against the
    stars about its own x, y and z (x right, y down, z out), and
    ``rates_sigma_deg_s`` their errors. All three are None when this frame has no answer: nothing
    old is ever told as new. ``expected`` stars were looked for and ``matched`` found.
    ``doubt`` is the sentence of a frame that contradicts the camera's profile, also among its warnings.
    """

    time_utc: datetime
    mode: Mode
    solution: Solution | None
    reason: NoSolution | None
    filtered: Attitude | None = None
    rates_deg_s: tuple[float, float, float] | None = None
    rates_sigma_deg_s: tuple[float, float, float] | None = None
    expected: int = 0
    matched: int = 0
    manoeuvre: bool = False
    doubt: str = ""

    @property
    def filtered_centre(self) -> Attitude | None:
        """The filter's attitude at the frame's middle, as :attr:`Solution.centre_attitude`."""
        if self.filtered is None or self.solution is None:
            return None
        return replace(self.solution, attitude=self.filtered).centre_attitude

    @property
    def sigma_arcsec(self) -> tuple[float, float, float] | None:
        """One-sigma errors of ``filtered`` along x, along y, and of roll."""
        return None if self.filtered is None else self.filtered.sigma_arcsec


# -- A tracked frame in the words of ``core``: the same ``Solution`` as one solved blind -------


def tracked_solution(
    found: Tracked,
    camera: Camera,
    sky: Neighbourhood,
    stars: Expected,
    seen: WindowStars,
    elapsed_ms: Mapping[str, float],
    warnings: tuple[str, ...] = (),
) -> Solution:
    """The solution of a frame from its windows, its stars brightest first."""
    estimate = found.estimate
    window = estimate.star
    number = stars.number[window]
    vectors = sky.vectors[number]
    ra = np.degrees(np.arctan2(vectors[:, 1], vectors[:, 0])) % 360.0
    dec = np.degrees(np.arcsin(np.clip(vectors[:, 2], -1.0, 1.0)))
    residual = np.hypot(*estimate.residuals_px.T)
    columns = zip(
        seen.xy[window].tolist(),
        number.tolist(),
        sky.mag[number].tolist(),
        ra.tolist(),
        dec.tolist(),
        residual.tolist(),
        strict=True,
    )
    named = tuple(NamedStar(x, y, *sky.label(n), mag, a, d, r) for (x, y), n, mag, a, d, r in columns)
    rms = float(np.sqrt(np.mean(residual**2)))
    return Solution(
        camera,
        estimate.attitude,
        named,
        rms,
        found.log10_false_alarm,
        "predict",
        int(seen.found.sum()),
        dict(elapsed_ms),
        warnings,
    )


# -- What a frame that was solved blind does to the filter of a stream -------------------------

SAME_MOTION_S = 3.0


def filter_after_blind_solve(
    before: FilterState | None, attitude: Attitude, time_s: float, motion: MotionModel, was_lost: bool
) -> FilterState:
    """The filter after an attitude that no prediction led to.

    A jump says nothing of the velocity, as far as one frame can tell, and no more does a frame long
    after the last: the filter begins anew. What it would have taken is a first guess of the
    velocity, though, if a camera may turn so fast, and no more certain than any.
    """
    if before is None:
        return begin(attitude, time_s, motion)
    ahead = predicted(before, time_s, motion)
    after = updated(ahead, attitude, motion)
    if ahead.step_s <= SAME_MOTION_S and (was_lost or not after.contradicted):
        return after
    anew = begin(attitude, time_s, motion)
    turned = rotation_vector(attitude.matrix @ before.matrix.T)
    rates = -turned / max(ahead.step_s, 1e-3)
    if float(np.linalg.norm(rates)) > motion.rate_sigma_arcsec_s * ARCSEC:
        return anew
    return replace(anew, rates_rad_s=rates)


def in_axes_of(state: FilterState, before: Camera | None, after: Camera | None) -> FilterState:
    """The same state in the axes of another model of the camera."""
    if before is None or after is None or before == after:
        return state
    turn = turn_between(before, after)
    both = np.kron(np.eye(2), turn)
    return replace(
        state,
        matrix=turn @ state.matrix,
        rates_rad_s=turn @ state.rates_rad_s,
        covariance=both @ state.covariance @ both.T,
    )


BLEND_FWHM = 2.5
PATIENCE = 10  # frames without an answer until the scale of the frames before is doubted
KNOWN_SCALE = 1.03  # the scale of the frame before is good to so much


class Tracker:
    """Follows one camera. Not safe for several threads at once.

    ``catalogue`` is the shipped one unless given. ``profile`` is what is known of the camera from
    earlier frames (:mod:`kochab.solver.camera_profile` recalls it); :attr:`profile` is what is known by
    now, for whoever wants to keep it.
    """

    def __init__(
        self, catalogue: "Catalogue | None" = None, options: TrackOptions | None = None, profile: Profile | None = None
    ) -> None:
        from kochab.sky import open_catalogue

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
        self.state: FilterState | None = None
        self._calibration.camera = None
        self._tracked_frames = 0
        self._doubt = ""
        self._sky: Neighbourhood | None = None
        self._faintest = 0.0
        self._image = TrackedStarImage()
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
        sky, result = self._find_stars(frame, moment)
        if sky is None or result is None:
            return None
        stars, seen, found, place = result.stars, result.seen, result.found, result.place
        total = 1e3 * (perf_counter() - clock)
        spent = {"read": 0.0, "detect": total, "identify": 0.0, "attitude": 0.0, "total": total}
        solution = tracked_solution(found, self.camera, sky, stars, seen, spent, frame.warnings)
        self._image.learn(seen, place, self.camera, frame.hint.exposure_s)
        self._calibrate(result, sky.vectors[stars.number])
        self._failures = 0
        state = updated(place.ahead, solution.attitude, self.options.motion)
        return self._update(solution, moment, "tracking", state, len(stars.number))

    def _find_stars(self, frame: Frame, moment: datetime) -> tuple[Neighbourhood | None, WindowSearchResult | None]:
        """What is seen at the likeliest place that holds anything, and the sky around it."""
        assert self.state is not None
        assert self.camera is not None
        options, looking, sky = self.options, None, None
        for place in places(
            self.state,
            moment.timestamp(),
            options.motion,
            self.camera,
            self._image.fwhm_px,
            (options.half_px, options.far_px),
        ):
            sky = self._neighbourhood(place.ahead.attitude, moment)
            if looking is None:
                looking = WindowSearch(frame, self.camera, self._image, options.stars)
            result = looking.at(place, sky)
            if result is not None:
                return sky, result
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
            before = in_axes_of(before, camera, solution.camera)
        state = filter_after_blind_solve(
            before, solution.attitude, moment.timestamp(), self.options.motion, self._was_lost
        )
        return self._update(solution, moment, "lost", state, 0)

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
        self._doubt = self._calibration.begin(solution, frame.hint.camera)
        self._faintest = float(np.percentile([star.mag for star in solution.stars], 90))
        self._image = TrackedStarImage.of(examined.detections, frame, solution.stars_px)
        self._sky = None
        return solution

    def _calibrate(self, result: WindowSearchResult, vectors: Floats) -> None:
        """Improve the camera now and then; a frame that contradicts its profile says so."""
        self._tracked_frames += 1
        self._doubt = ""
        every = self.options.calibrate_every
        if every == 0 or self._tracked_frames % every:
            return
        estimate = result.found.estimate
        window = estimate.star
        self._doubt = self._calibration.learn(
            result.seen.xy[window], vectors[window], estimate.attitude, estimate.sigma_px
        )

    def _update(
        self, solution: Solution, moment: datetime, mode: Mode, state: FilterState, expected: int
    ) -> TrackUpdate:
        """Keep the filter's new state and tell it."""
        self._was_lost = mode == "lost"
        if self._doubt:
            solution = replace(solution, warnings=(*solution.warnings, self._doubt))
        self.state = in_axes_of(state, solution.camera, self.camera)
        return TrackUpdate(
            moment,
            mode,
            solution,
            None,
            state.attitude,
            state.rates_deg_s,
            state.rates_sigma_deg_s,
            expected,
            len(solution.stars),
            state.contradicted,
            self._doubt,
        )

    def _neighbourhood(self, attitude: Attitude, moment: datetime) -> Neighbourhood:
        assert self.camera is not None
        if self._sky is None or not self._sky.covers(self.camera, attitude):
            blend = BLEND_FWHM * self._image.fwhm_px
            self._sky = Neighbourhood(self.catalogue, self.camera, attitude, year_of(moment), self._faintest, blend)
        return self._sky
