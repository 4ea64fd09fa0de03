"""The live phase: where the axis is now, from one attitude, while the bolts are turned.

The bolts and the RA axis can only do R_now = Rz(-dAz) R_h(dAlt) Rot(a, theta) R_ref, and since Rot(a, theta) leaves a
alone, the axis is now at R_now c, with c = R_ref^T a the axis as the camera sees it: no assumption about tracking,
levelness or the order of the bolts. theta is what is left for tracking, periodic error and slipping.

Roll is the weak part of an attitude, and a wrong roll moves R_now c. When theta is known better
from the clock (either the mount tracks or it stands still) it is put in as a measurement of 20
arcsec. Such a prior is badly wrong when something slipped or was turned, so it is
dropped where the attitude alone puts theta more than three sigmas away.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import ARCSEC, cross_matrix, cross_product, rotation_vector, small_rotation
from kochab.core.mount import SIDEREAL_RAD_S
from kochab.core.values import frozen
from kochab.polar.camera_axis import CameraAxis, camera_axis_of
from kochab.polar.error import PolarError, angle_in_words, finer_in_words
from kochab.polar.measure import Measurement, PolarFinding, PolarFindingKind
from kochab.polar.pole import tracking_rad_s
from kochab.polar.rotations import about, alt_az, tangents, wrapped_rad
from kochab.polar.sighting import LocalAttitude, seen_by
from kochab.text.translation import tr

# -- What moved between two live frames: a bolt, the RA axis, or the declination axis ----------
# Any small rotation can be made of two bolts and a turn about RA, so one movement of the
# declination axis always passes for all three at once. It is recognised by being simple: the whole
# change is a turn about the one line across boresight and polar axis, while neither the bolts with
# RA as the clock says, nor RA alone, explain it. Where that line lies in the plane of the two
# bolts - on the meridian, and everywhere from the Earth's equator - nothing sets them apart.

CLOCK_SIGMA_RAD = 20.0 * ARCSEC
LEAST_RAD = 60.0 * ARCSEC
REFUTED, BELIEVED = 20.0, 9.0  # chi-squares, one or two degrees of freedom: too large for noise, and well within it


@frozen(eq=False)
class Moment:
    """A live frame: its turn about RA, with the variance and slope of that, and its axis (3,)."""

    attitude: LocalAttitude
    theta_rad: float
    slope: Floats
    axis: Floats

    @property
    def covariance(self) -> Floats:
        """Covariance (3, 3), rad^2, of a small rotation in E, N, U."""
        matrix = self.attitude.matrix
        return np.asarray(matrix @ self.attitude.covariance @ matrix.T)


def declination_moved(before: Moment, now: Moment, turns_rad: Sequence[float]) -> float | None:
    """By how much, radians, the declination axis moved between two frames; None: it did not.

    ``turns_rad`` are the turns about RA that a clock allows: standing still, tracking or both.
    """
    if any(_bolts_did_it(before, now, turn) for turn in turns_rad) or _axis_stood(before, now):
        return None
    found = [angle for turn in turns_rad if (angle := _declination(before, now, turn)) is not None]
    return max(found, key=abs, default=None)


def _bolts_did_it(before: Moment, now: Moment, turn_rad: float) -> bool:
    """Whether RA turned as the clock says, so that bolts explain the rest, or nothing moved."""
    left = wrapped_rad(now.theta_rad - before.theta_rad - turn_rad)
    variance = sum(m.slope @ m.attitude.covariance @ m.slope for m in (before, now))
    return bool(left**2 <= REFUTED * (variance + CLOCK_SIGMA_RAD**2))


def _axis_stood(before: Moment, now: Moment) -> bool:
    """Whether the polar axis is where it was, as when only RA turned, however far."""
    shift = cross_product(before.axis, now.axis)
    return bool(shift @ np.linalg.solve(before.covariance + now.covariance, shift) <= REFUTED)


def _declination(before: Moment, now: Moment, turn_rad: float) -> float | None:
    """The turn about the declination axis alone that makes the one frame of the other."""
    turned = about(before.axis, turn_rad) @ before.attitude.matrix
    moved = rotation_vector(now.attitude.matrix @ turned.T)
    across = cross_product(turned[:, 2], before.axis)
    length = float(np.linalg.norm(across))
    if length < 0.05:  # the camera looks along the polar axis
        return None
    across /= length
    angle = float(moved @ across)
    covariance = before.covariance + now.covariance
    covariance = covariance + CLOCK_SIGMA_RAD**2 * np.outer(before.axis, before.axis)
    inverse = np.linalg.inv(covariance)
    chi2 = moved @ inverse @ moved - (across @ inverse @ moved) ** 2 / (across @ inverse @ across)
    return angle if chi2 <= BELIEVED and abs(angle) > LEAST_RAD else None


PRIOR_SIGMA_RAD = 20.0 * ARCSEC
GATE = 3.0
AMBIGUOUS = 4.0  # one hypothesis must be this many sigmas worse before the other is believed
LARGE_MOVE_DEG = 2.0
SLIPPED_DEG = 0.5


@frozen(eq=False)
class LiveError:
    """The polar error now.

    ``theta_rad`` is how far the RA axis turned since the last measured frame; ``prior`` tells
    which clock's word on it was taken: "tracking", "standing" or "" for none. The error's
    covariance is the sum of ``frame_covariance``, new with each frame, and of the measurement's.
    """

    error: PolarError
    frame_covariance: Floats
    attitude: LocalAttitude
    theta_rad: float
    prior: str
    moved_deg: float
    findings: tuple[PolarFinding, ...] = ()


class LivePhase:
    """Follows the axis after a measurement; one call of :meth:`update` a solved frame."""

    def __init__(self, measurement: Measurement) -> None:
        fit, last = measurement.fit, measurement.last_of_fit
        self._settings = measurement.settings
        self._camera = measurement.camera
        self._start = measurement.error
        self._seen = camera_axis_of(measurement)
        # The last measured attitude as fitted: theta counts from there.
        self._reference = about(fit.axis, float(fit.turns_rad[-1])) @ fit.reference
        self._reference_time = last.time_utc
        self._before = self._moment(last)
        self._clock = ""  # the last one that was believed
        self._declination_rad = 0.0

    @property
    def camera_axis(self) -> CameraAxis | None:
        """Where the camera sees the axis, whatever the bolts do; None once declination was seen to move."""
        return None if self._declination_rad else self._seen

    def update(self, now: LocalAttitude) -> LiveError:
        """The error at a new frame, from its attitude in E, N, U."""
        now = seen_by(self._camera, now)
        matrix, covariance = now.matrix, now.covariance
        theta, slope = self._watch_declination(now)
        sigma2 = float(slope @ covariance @ slope)
        prior, expected = self._clock_says(now, theta, sigma2)
        if prior:
            # A Kalman update by one reading: theta as the clock has it.
            gain = covariance @ slope / (sigma2 + PRIOR_SIGMA_RAD**2)
            matrix = matrix @ small_rotation(gain * (expected - theta))
            covariance = covariance - np.outer(gain, slope @ covariance)
            theta, _ = self._theta(matrix)
            self._clock = prior
        axis = matrix @ self._seen.axis
        # The axis along (altitude, azimuth): by this frame's attitude, and by the axis' place in the camera.
        seen = np.stack(tangents(axis)) @ matrix
        lever = seen @ cross_matrix(self._seen.axis)
        frame = np.asarray(lever @ covariance @ lever.T)
        total = frame + seen @ self._seen.covariance @ seen.T
        error = PolarError(axis, self._start.pole, total, self._start.flexure, self._start.creep)
        moved = float(np.degrees(np.linalg.norm(axis - self._start.axis)))
        return LiveError(error, frame, now, theta, prior, moved, tuple(self._findings(error, moved, theta, now)))

    def _moment(self, now: LocalAttitude) -> Moment:
        return Moment(now, *self._theta(now.matrix), now.matrix @ self._seen.axis)

    def _watch_declination(self, now: LocalAttitude) -> tuple[float, Floats]:
        """The turn and its slope at a frame, once it is compared with the frame before."""
        moment, before = self._moment(now), self._before
        turns = self._clocks((now.time_utc - before.attitude.time_utc).total_seconds())
        known = [turns[self._clock]] if self._clock else list(turns.values())
        self._declination_rad += declination_moved(before, moment, known) or 0.0
        self._before = moment
        return moment.theta_rad, moment.slope

    def _clocks(self, elapsed_s: float) -> dict[str, float]:
        """How far RA turns in a time, radians, when the mount tracks and when it stands."""
        return {"tracking": tracking_rad_s(self._settings.site) * elapsed_s, "standing": 0.0}

    def _theta(self, matrix: Floats) -> tuple[float, Floats]:
        """The turn about the axis since the reference, and its slope (3,) over camera rotations.

        A small rotation ``w`` about the camera's own axes changes theta by slope @ w.
        """
        moved = matrix @ self._seen.axis
        alt0, az0 = alt_az(self._start.axis)
        alt1, az1 = alt_az(moved)
        # The bolts are undone first, azimuth about the vertical and altitude about the level line; what is left is RA.
        lift = about(np.array([np.cos(az0), -np.sin(az0), 0.0]), alt1 - alt0)
        knobs = about(np.array([0.0, 0.0, 1.0]), az0 - az1) @ lift
        left = rotation_vector(knobs.T @ matrix @ self._reference.T)
        across = np.array([np.cos(az1), -np.sin(az1), 0.0])
        basis = np.stack([np.array([0.0, 0.0, 1.0]), across, moved], axis=1)
        return float(left @ self._start.axis), np.linalg.solve(basis, matrix)[2]

    def _clock_says(self, now: LocalAttitude, theta: float, sigma2: float) -> tuple[str, float]:
        """Which prior holds, and the turn it expects; none when both do or neither."""
        expected = self._clocks((now.time_utc - self._reference_time).total_seconds())
        scale = np.sqrt(sigma2 + PRIOR_SIGMA_RAD**2)
        off = {name: abs(wrapped_rad(theta - value)) / scale for name, value in expected.items()}
        near, far = sorted(off, key=lambda name: off[name])
        if off[near] > GATE or off[far] < AMBIGUOUS:
            return "", 0.0
        return near, theta + wrapped_rad(expected[near] - theta)

    def _findings(
        self, error: PolarError, moved_deg: float, theta: float, now: LocalAttitude
    ) -> Iterator[PolarFinding]:
        elapsed = abs((now.time_utc - self._reference_time).total_seconds())
        if self._declination_rad:
            yield PolarFinding(
                PolarFindingKind.DEC_MOVED,
                tr(
                    "Declination moved by {angle}, and the error shown is off by as much. Lock it and measure again.",
                    angle=angle_in_words(self._declination_rad / ARCSEC),
                ),
                spoils=True,
            )
        elif abs(theta) > elapsed * SIDEREAL_RAD_S + np.radians(SLIPPED_DEG):
            yield PolarFinding(
                PolarFindingKind.SLIPPING,
                tr("RA moved {degrees:.1f}°. Lock it; the result stands.", degrees=abs(np.degrees(theta))),
            )
        if moved_deg > LARGE_MOVE_DEG:
            yield PolarFinding(
                PolarFindingKind.REMEASURE,
                tr(
                    "The axis has moved by {moved:.1f}° since it was measured. Measure again before the fine "
                    "adjustment.",
                    moved=moved_deg,
                ),
            )
        if error.below_uncertainty:
            yield PolarFinding(PolarFindingKind.DONE, finer_in_words(error))


# -- The live error while no bolt turns: a mean over frames, started anew at every movement -----

JUMP2 = 16.0  # squared Mahalanobis distance from the mean, two dimensions, beyond which a bolt was turned
FEWEST, ENOUGH = 3, 16  # frames before which nothing is settled, and after which it is in any case
SMALL_ARCSEC, CLEAR = 4.0, 25.0  # a noise so small, or so many times smaller than the error, is settled
MOST = 60  # frames; slow drifts must not be averaged away


@frozen(eq=False)
class SteadyError:
    """The mean of ``frames`` live errors since the last movement.

    ``settled`` when it is good enough to act on: its noise is small beside the error itself, or
    small at all, or will not get much smaller.

    ``noise_arcsec`` is its one-sigma error along altitude and azimuth on the sky without what all
    frames share: how small a movement it can show.
    """

    error: PolarError
    frames: int
    settled: bool
    noise_arcsec: tuple[float, float]


class Steady:
    """Averages live errors; its covariance keeps what all frames share, the measurement's own."""

    def __init__(self) -> None:
        self._kept: list[LiveError] = []
        self.movements = 0

    def update(self, live: LiveError) -> SteadyError:
        """The mean with one more frame, or that frame alone when the axis moved."""
        if self._kept and self._jumped(live):
            self._kept.clear()
            self.movements += 1
        self._kept = [*self._kept[-(MOST - 1) :], live]
        count = len(self._kept)
        alt, az = np.sqrt(np.diag(live.frame_covariance) / count) / ARCSEC
        noise = (float(alt), float(az))
        mean = self._mean()
        size = float(np.hypot(*noise))
        clear = size < max(SMALL_ARCSEC, mean.total_arcsec / CLEAR) or count >= ENOUGH
        return SteadyError(mean, count, count >= FEWEST and clear, noise)

    def forget(self) -> None:
        """Start anew, as after a measurement."""
        self._kept.clear()

    def _mean(self) -> PolarError:
        last, count = self._kept[-1], len(self._kept)
        axis = np.mean([live.error.axis for live in self._kept], axis=0)
        shared = last.error.covariance - last.frame_covariance
        covariance = shared + last.frame_covariance / count
        return replace(last.error, axis=axis / np.linalg.norm(axis), covariance=covariance)

    def _jumped(self, live: LiveError) -> bool:
        mean = self._mean()
        gap = np.stack(tangents(mean.axis)) @ (live.error.axis - mean.axis)
        spread = live.frame_covariance * (1.0 + 1.0 / len(self._kept))
        return float(gap @ np.linalg.solve(spread, gap)) > JUMP2
