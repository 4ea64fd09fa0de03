"""Every frame of a stream to a pointing and a rate: lost in space once, then tracking.

The first frame is solved blind. From then on the filter (:mod:`kochab.attitude.filter`: an error-state
Kalman filter of attitude and angular velocity) says where the camera points at the next frame's
time, and only small windows around the stars expected there are read
(:mod:`kochab.solver.track_windows`). When what they hold is no better than chance
(:mod:`kochab.solver.track_windows`), the same frame is solved blind.
"""

from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime
from time import perf_counter
from typing import Literal

import numpy as np

from kochab.attitude.filter import RATE_SIGMA_RAD_S, FilterState, begin, predicted, updated
from kochab.attitude.fit import as_rotation
from kochab.attitude.least_squares import PARAMETERS, project_with_jacobian
from kochab.core.arrays import Floats
from kochab.core.attitude import Attitude, rotation_vector
from kochab.core.camera import Camera
from kochab.core.frame import Frame, Hint
from kochab.core.progress import Progress, Task
from kochab.core.solution import NoSolution, Solution
from kochab.core.values import frozen
from kochab.solver import SolveOptions
from kochab.solver.camera_profile import Profile, TrackedCamera, turn_between
from kochab.solver.matches import named_stars, zonal_covariance
from kochab.solver.pipeline import Examined, examine_frame, merged_hint, year_of
from kochab.solver.track_prediction import Neighbourhood, predicted_attitudes
from kochab.solver.track_windows import TrackedStarImage, WindowSearch, WindowSearchResult

# -- What the tracker tells of one frame -------------------------------------------------------

Mode = Literal["lost", "tracking"]


@frozen(eq=False)
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


# -- What a frame that was solved blind does to the filter of a stream -------------------------

SAME_MOTION_S = 3.0


def filter_after_blind_solve(
    before: FilterState | None, attitude: Attitude, time_s: float, was_lost: bool
) -> FilterState:
    """The filter after an attitude that no prediction led to.

    A jump says nothing of the velocity, as far as one frame can tell, and no more does a frame long
    after the last: the filter begins anew. What it would have taken is a first guess of the
    velocity, though, if a camera may turn so fast, and no more certain than any.

    Parameters
    ----------
    before : FilterState or None
        The filter until then; None: none.
    attitude : Attitude
        As solved.
    time_s : float
        When the frame was taken, on the filter's clock.
    was_lost : bool
        Whether earlier frames were not found.
    """
    if before is None:
        return begin(attitude, time_s)
    ahead = predicted(before, time_s)
    after = updated(ahead, attitude)
    if ahead.step_s <= SAME_MOTION_S and (was_lost or not after.contradicted):
        return after
    anew = begin(attitude, time_s)
    turned = rotation_vector(attitude.matrix @ before.matrix.T)
    # M(t + dt) = exp(-[w] dt) M(t)
    rates = -turned / max(ahead.step_s, 1e-3)
    if float(np.linalg.norm(rates)) > RATE_SIGMA_RAD_S:
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
MEMORY_S = 900.0  # a pointing so old is no prediction any more
MOST_STARS = 40  # looked for in a frame
PATIENCE = 2  # frames without an answer until the scale of the frames before is doubted: a cloud, or another lens
KNOWN_SCALE = 1.03  # the scale of the frame before is good to so much


class Tracker:
    """Follows one camera. Not safe for several threads at once.

    ``options`` are those of a solve of a lost frame. ``profile`` is what is known of the camera from
    earlier frames (:mod:`kochab.solver.camera_profile` recalls it); :attr:`profile` is what is known by
    now, for whoever wants to keep it.
    """

    calibrate_every = 10
    """After so many frames the camera is improved by what the stars say; 0 leaves it as the first frame said."""

    def __init__(self, options: SolveOptions | None = None, profile: Profile | None = None) -> None:
        from kochab.sky import open_catalogue

        self.catalogue = open_catalogue()
        self.options = options or SolveOptions()
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
        self.shared: Floats = np.zeros((3, 3))  # covariance of what all frames are off by together

    @property
    def camera(self) -> Camera | None:
        """What the next frame is read with; None before the first solution."""
        return self._calibration.camera

    def update(self, frame: Frame, time_utc: datetime | None = None) -> Task[TrackUpdate]:
        """Take one frame in, newer than the last.

        ``time_utc`` is its mid-exposure; by default what the frame says of itself, else now.
        """
        moment = time_utc or frame.hint.time_utc or datetime.now(UTC)
        if not self._fits(frame, moment.timestamp()):
            self.forget()
        if self.state is not None:
            yield Progress("track", 0.0)
            clock = perf_counter()
            result = self._find_stars(frame, moment)
            if result is not None:
                return self._tracked(frame, moment, result, 1e3 * (perf_counter() - clock))
        return (yield from self._lost(frame, moment))

    def _fits(self, frame: Frame, now_s: float) -> bool:
        """Whether what is known can be of use for this frame."""
        if self.state is None or self.camera is None:
            return True
        same = (frame.width, frame.height) == (self.camera.width, self.camera.height)
        # a clock may be set back a little: the filter then stays where it is
        return same and -1.0 < now_s - self.state.time_s < MEMORY_S

    def _find_stars(self, frame: Frame, moment: datetime) -> WindowSearchResult | None:
        """What is seen in windows around the stars expected, at the likeliest place that holds anything."""
        assert self.state is not None
        assert self.camera is not None
        looking = WindowSearch(frame, self.camera, self._image, MOST_STARS)
        for place in predicted_attitudes(self.state, moment.timestamp(), self.camera, self._image.fwhm_px):
            result = looking.at(place, self._neighbourhood(place.ahead.attitude, moment))
            if result is not None:
                return result
        return None

    def _tracked(self, frame: Frame, moment: datetime, result: WindowSearchResult, total_ms: float) -> TrackUpdate:
        """What the stars found in their windows say."""
        assert self.camera is not None
        spent = {"read": 0.0, "detect": total_ms, "identify": 0.0, "attitude": 0.0, "total": total_ms}
        assert self.profile is not None
        solution = tracked_solution(result, self.camera, spent, frame.warnings)
        own, self.shared = uncertainty(result, self.camera, self.profile.covariance, year_of(moment))
        solution = replace(solution, attitude=replace(solution.attitude, covariance=own + self.shared))
        self._image.learn(result.seen, result.place, self.camera, frame.hint.exposure_s)
        self._calibrate(result)
        self._failures = 0
        # without what the frames share, which the filter would average away
        state = updated(result.place.ahead, replace(solution.attitude, covariance=own))
        return self._update(solution, moment, "tracking", state, len(result.stars.number))

    def _lost(self, frame: Frame, moment: datetime) -> Task[TrackUpdate]:
        """The frame solved blind, or nearly so when the scale is known."""
        options, before, camera = self.options, self.state, self.camera
        known = self._known_scale(frame)
        if known is not None:
            sure = camera is not None and self._failures < PATIENCE
            hint = merged_hint(known, options.hint)
            # while the scale is believed, a frame of clouds costs one search instead of two
            blind = options.blind_after_hint and not sure
            options = replace(options, blind_after_hint=blind, hint=hint, fov_deg=None)
        examined = yield from examine_frame(frame, options)
        if isinstance(examined.result, NoSolution):
            self._failures += 1
            return TrackUpdate(moment, "lost", None, examined.result)
        solution = self._begin_again(examined, frame)
        self._failures = 0
        if before is not None:
            # the new fit may have its axes elsewhere in the same lens
            before = in_axes_of(before, camera, solution.camera)
        state = filter_after_blind_solve(before, solution.attitude, moment.timestamp(), self._was_lost)
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

    def _calibrate(self, result: WindowSearchResult) -> None:
        """Improve the camera now and then; a frame that contradicts its profile says so."""
        self._tracked_frames += 1
        self._doubt = ""
        if self.calibrate_every and self._tracked_frames % self.calibrate_every == 0:
            estimate, (xy, vectors) = result.found.estimate, result.matched
            self._doubt = self._calibration.learn(xy, vectors, estimate.attitude, estimate.sigma_px)

    def _update(
        self, solution: Solution, moment: datetime, mode: Mode, state: FilterState, expected: int
    ) -> TrackUpdate:
        """Keep the filter's new state and tell it."""
        self._was_lost = mode == "lost"
        if self._doubt:
            solution = replace(solution, warnings=(*solution.warnings, self._doubt))
        # a calibration may just have moved the axes of the camera that the next frame is read with
        self.state = in_axes_of(state, solution.camera, self.camera)
        return TrackUpdate(
            moment,
            mode,
            solution,
            None,
            Attitude(state.matrix, state.covariance[:3, :3] + self.shared),
            state.rates_deg_s,
            state.rates_sigma_deg_s,
            expected,
            len(solution.stars),
            self._doubt,
        )

    def _neighbourhood(self, attitude: Attitude, moment: datetime) -> Neighbourhood:
        assert self.camera is not None
        if self._sky is None or not self._sky.covers(self.camera, attitude):
            blend = BLEND_FWHM * self._image.fwhm_px
            self._sky = Neighbourhood(self.catalogue, self.camera, attitude, year_of(moment), self._faintest, blend)
        return self._sky


# The same stars bring the catalogue's errors to every frame, and the same camera brings its own: they are in what
# a frame and the filter say, but the filter must not take them for noise, which it averages out.


def uncertainty(result: WindowSearchResult, camera: Camera, terms: Floats, year: float) -> tuple[Floats, Floats]:
    """Covariances (3, 3), rad^2, of a frame's pointing: of what is its own, and of what others share.

    Parameters
    ----------
    result : WindowSearchResult
        What the windows showed and the pointing that they agree on.
    camera : Camera
        Its model.
    terms : Floats
        Covariance (7, 7) of the camera's: `Profile.covariance`.
    year : float
        Julian year, to which the catalogue's zonal errors have grown.
    """
    estimate, (_, vectors) = result.found.estimate, result.matched
    assert estimate.attitude.covariance is not None
    weight = 1.0 / result.seen.sigma_px[estimate.star]
    place = weight * camera.focal_px * result.sky.sigma_rad[result.stars.number[estimate.star]]
    share = float(np.square(weight * place).sum() / np.square(weight).sum())
    _, slope = project_with_jacobian(camera, vectors @ estimate.attitude.matrix.T)
    rows = (slope * weight[:, None, None]).reshape(-1, len(PARAMETERS))
    to_rotation = as_rotation(camera)
    # weighted as the pointing itself was
    taken = np.linalg.lstsq(rows[:, :3], rows[:, 3:], rcond=None)[0]  # the turn that hides an error of a term
    lens = to_rotation[:, 3:] - to_rotation[:, :3] @ taken
    covariance = estimate.attitude.covariance
    return (1.0 - share) * covariance, share * covariance + lens @ terms @ lens.T + zonal_covariance(year)


def tracked_solution(
    result: WindowSearchResult, camera: Camera, elapsed_ms: Mapping[str, float], warnings: tuple[str, ...] = ()
) -> Solution:
    """The solution of a frame from its windows, its stars brightest first.

    Parameters
    ----------
    result : WindowSearchResult
        What the windows showed and the pointing that they agree on.
    camera : Camera
        Its model.
    elapsed_ms : Mapping[str, float]
        Time of each stage.
    warnings : tuple[str, ...]
        What the person should know.
    """
    found, sky, (xy, vectors) = result.found, result.sky, result.matched
    number, residuals = result.stars.number[found.estimate.star], found.estimate.residuals_px
    stars = named_stars(xy, map(sky.label, number.tolist()), sky.mag[number], vectors, residuals)
    return Solution(
        camera,
        found.estimate.attitude,
        stars,
        float(np.sqrt(np.mean(np.sum(residuals**2, axis=1)))),
        found.log10_false_alarm,
        "predict",
        int(result.seen.found.sum()),
        elapsed_ms,
        warnings,
    )
