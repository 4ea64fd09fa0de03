"""The axis of two or more attitudes with its covariance, and what moved when they share none.

The model of attitude k is Rot(a, theta_k) R_0, with theta_0 = 0. Unknown are the axis a (two numbers), the turns (N -
1) and the reference attitude R_0 (three). The residual is the rotation vector from the measured to the modelled
attitude in that camera's own axes, weighted with the inverse of its covariance, so that a poor roll counts little.
Three equations a frame leave 2 N - 4 degrees of freedom: none for two frames.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import ARCSEC, cross_product, rotation_vector, rotation_vectors, small_rotation
from kochab.core.values import frozen
from kochab.polar.rotations import about, about_each, tangents
from kochab.polar.seen_axis import CONE_RAD, UNKNOWNS, Cause, MovementFit, fit_with_movement
from kochab.polar.sighting import LocalAttitude

# -- The axis from two attitudes: the axis of the rotation between them ------------------------


def axis_of_two(first: Floats, second: Floats) -> tuple[Floats, float]:
    """Axis (3,) in E, N, U and turn, radians in [0, pi], between two attitudes (3, 3).

    Both take camera axes to E, N, U. The turn is right-handed about the axis; which end of the
    line points to the pole is not decided here. NaN when nothing turned.
    """
    vector = rotation_vector(second @ first.T)
    turn = float(np.linalg.norm(vector))
    if turn < 1e-12:
        return np.full(3, np.nan), 0.0
    return vector / turn, turn


def chance_of(chi2: float, freedom: float) -> float:
    """Probability of so large a chi-square by noise alone; 1 without degrees of freedom."""
    if freedom <= 0:
        return 1.0
    from scipy.special import chdtrc  # scipy.stats takes two seconds to load

    return float(chdtrc(freedom, chi2))


# -- Several frames of one place count as one, which is surer ------------------------------------

SHARED = 0.05  # of the variance of a frame, which others of the same stars have as well


def merge_frames_of_one_place(attitudes: Sequence[LocalAttitude], pole: Floats, clock: float) -> list[LocalAttitude]:
    """Of each place one attitude at its last frame's time, as all its frames tell it.

    Between them the mount either tracked, ``clock`` radians a second about ``pole`` (3,), or stood; where neither
    explains them, the last is taken alone.
    """
    places: dict[tuple[int, int], list[LocalAttitude]] = {}
    for number, one in enumerate(attitudes):
        places.setdefault((one.sweep, -1 - number if one.place is None else one.place), []).append(one)
    return [_as_one(frames, pole, clock) for frames in places.values()]


def _as_one(frames: Sequence[LocalAttitude], pole: Floats, clock: float) -> LocalAttitude:
    last, count, found = frames[-1], len(frames), []
    if count == 1:
        return last
    inverse = np.linalg.inv(last.covariance)
    # Each frame carried to the time of the last, as if the mount tracked and as if it stood; the better guess counts.
    for rate in (clock, 0.0):
        turns = [rate * (last.time_utc - f.time_utc).total_seconds() for f in frames]
        carried = np.stack([about(pole, turn) @ f.matrix for turn, f in zip(turns, frames, strict=True)])
        gaps = rotation_vectors(last.matrix.T @ carried)
        mean = gaps.mean(axis=0)
        found.append((float(np.einsum("ki,ij,kj->", gaps - mean, inverse, gaps - mean)), mean))
    chi2, mean = min(found, key=lambda one: one[0])
    if chance_of(chi2, 3.0 * (count - 1)) < UNLIKELY:
        return last
    covariance = last.covariance * (1.0 / count + SHARED)
    return replace(last, matrix=last.matrix @ small_rotation(mean), covariance=covariance)


STEPS = 20
SMALLEST_STEP_RAD = 1e-10


@frozen(eq=False)
class AxisFit:
    """An axis and what it was fitted with.

    ``axis`` (3,) in E, N, U points to the elevated pole's side. ``turns_rad`` (N,) are right-handed about it, from
    the first frame. ``reference`` (3, 3) is the first attitude as fitted. ``residuals`` (N, 3) rad about each
    camera's axes; ``weighted`` (N, 3) the same in sigmas. ``covariance`` (2, 2) rad^2 is of the axis along (altitude,
    azimuth on the sky). ``camera_covariance`` (3, 3) rad^2 is of the axis as the camera sees it, R_0^T a. ``joint``
    (N + 4, N + 4) rad^2 is of the axis, the reference's rotation in E, N, U and the turns but the first, by the frames'
    own errors alone. ``moved`` counts the movements that were fitted as well.
    """

    axis: Floats
    turns_rad: Floats
    reference: Floats
    residuals: Floats
    weighted: Floats
    covariance: Floats
    camera_covariance: Floats
    joint: Floats
    moved: int = 0

    @property
    def chi2(self) -> float:
        """Sum of squared weighted residuals."""
        return float(np.sum(np.square(self.weighted)))

    @property
    def freedom(self) -> int:
        """Degrees of freedom, 2 N - 4, less one a movement."""
        return 2 * len(self.turns_rad) - 4 - self.moved

    @property
    def chance(self) -> float:
        """Probability of so large a chi-square by noise alone."""
        return chance_of(self.chi2, self.freedom)

    @property
    def turn_rad(self) -> float:
        """The smallest arc that holds all turns."""
        full = 2.0 * np.pi
        around = np.sort(self.turns_rad % full)
        gaps = np.diff(np.append(around, around[0] + full))
        return float(full - gaps.max())


def fit_axis(attitudes: Sequence[LocalAttitude], towards: Floats) -> AxisFit:
    """The axis that two or more attitudes of one sweep turned about, in any order; the mount may have tracked between.

    ``towards`` (3,), the elevated pole in E, N, U, decides which end of the axis is meant, and nothing else.

    Raises `ValueError` when there are fewer than two attitudes, or no two of them differ.
    """
    if len(attitudes) < 2:
        raise ValueError("An axis needs two attitudes or more.")
    measured = np.stack([a.matrix for a in attitudes])
    whiten = np.stack([np.linalg.inv(np.linalg.cholesky(a.covariance)) for a in attitudes])
    axis = _first_axis(measured, towards)
    turns = np.array([_turn_about(axis, m @ measured[0].T) for m in measured])
    reference = measured[0]
    for _ in range(STEPS):
        # whiten is L^-1 of each covariance L L^T: whitened residuals have unit variance, for plain least squares
        residual, jacobian = _linear(axis, turns, reference, measured, whiten)
        step = _least_squares(residual, jacobian.reshape(len(turns), 3, -1))
        axis, turns, reference = _moved(axis, turns, reference, step)
        if np.abs(step).max() < SMALLEST_STEP_RAD:
            break
    return _conclude(axis, turns, reference, measured, whiten)


def foreseen_covariance(axis: Floats, turns_rad: Floats, reference: Floats, covariance: Floats) -> Floats:
    """Covariance (2, 2) that frames yet to be taken would give, all with the same errors.

    Parameters
    ----------
    axis : Floats
        The mount's axis, unit vector (3,).
    turns_rad : Floats
        Turns about it (N,) at which frames would be taken, radians.
    reference : Floats
        Attitude (3, 3) at turn 0, in the axes of ``axis``.
    covariance : Floats
        That of each frame's rotation (3, 3), rad^2.
    """
    measured = about_each(axis, turns_rad) @ reference
    whiten = np.repeat(np.linalg.inv(np.linalg.cholesky(covariance))[None], len(turns_rad), axis=0)
    return _conclude(axis, np.asarray(turns_rad), reference, measured, whiten).covariance


def _first_axis(measured: Floats, towards: Floats) -> Floats:
    """The axis of the pair that turned most, with the first or the last."""
    best, most = np.full(3, np.nan), 0.0
    for first in (measured[0], measured[-1]):
        for second in measured:
            axis, turn = axis_of_two(first, second)
            if turn > most:
                best, most = axis, turn
    if most < 1e-9:
        raise ValueError("The attitudes are all the same.")
    return best if best @ towards > 0 else -best


def _turn_about(axis: Floats, matrix: Floats) -> float:
    """The turn about ``axis`` that comes nearest to a rotation (3, 3), in (-pi, pi].

    With Rodrigues' Rot(a, t) = cos t I + sin t [a]x + (1 - cos t) a a^T the trace of Rot(a, t)^T M is largest at
    tan t = a . s / (tr M - a^T M a), s the vector of M's skew part.
    """
    skew = np.array([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]])
    return float(np.arctan2(axis @ skew, np.trace(matrix) - axis @ matrix @ axis))


def _linear(axis: Floats, turns: Floats, reference: Floats, measured: Floats, whiten: Floats) -> tuple[Floats, Floats]:
    """Weighted residuals (N, 3) and their Jacobian (3 N, N + 4).

    Columns: the axis along altitude and azimuth, the reference's rotation vector in E, N, U, the turns but the first.
    With the model Q_k = Rot(a, t_k) R_0, the measured M_k and L_k^-1 of its covariance L_k L_k^T::

        r_k = L_k^-1 log(M_k^T Q_k)
        dr_k = L_k^-1 Q_k^T [(1 - Rot_k)(a x da) + Rot_k drho + a dt_k]

    to first order in r_k, where log is the rotation vector.
    """
    count = len(turns)
    # Moving the axis by t is a rotation Q about axis x t, and Q Rot Q^T differs from Rot by (1 - Rot)(axis x t).
    upward, clockwise = tangents(axis)
    basis = np.stack([clockwise, -upward], axis=1)
    turned = about_each(axis, turns)
    model = turned @ reference
    gaps = rotation_vectors(np.swapaxes(measured, 1, 2) @ model)
    residual = np.einsum("kij,kj->ki", whiten, gaps)
    into_camera = whiten @ np.swapaxes(model, 1, 2)
    jacobian = np.zeros((count, 3, count + 4))
    jacobian[:, :, :2] = into_camera @ (basis - turned @ basis)
    jacobian[:, :, 2:5] = into_camera @ turned
    later = np.arange(1, count)
    jacobian[later, :, 4 + later] = into_camera[1:] @ axis
    return residual, jacobian.reshape(3 * count, count + 4)


def _least_squares(residual: Floats, jacobian: Floats) -> Floats:
    """The step (N + 4,) of least squares; a turn stands in its own frame's rows alone, and is eliminated there.

    With b_k the column of turn k and P_k = 1 - b_k b_k^T / b_k^T b_k, what the turns cannot take up is left for the
    five others; then each turn takes up the rest::

        min |P_k (J_k x + r_k)|^2,    t_k = -b_k^T (r_k + J_k x) / b_k^T b_k

    as separable problems are solved (Golub and Pereyra 1973, SIAM J. Numer. Anal. 10, 413).
    """
    later = np.arange(1, len(residual))
    own = np.zeros_like(residual)
    own[1:] = jacobian[later, :, 4 + later]
    square = np.maximum(np.einsum("ki,ki->k", own, own), np.finfo(np.float64).tiny)
    across = np.eye(3) - own[:, :, None] * own[:, None, :] / square[:, None, None]
    common = jacobian[:, :, :5]
    rows, aim = (across @ common).reshape(-1, 5), -(across @ residual[..., None]).ravel()
    step = np.asarray(np.linalg.lstsq(rows, aim, rcond=None)[0], dtype=np.float64)
    turns = -np.einsum("ki,ki->k", own, residual + common @ step) / square
    return np.append(step, turns[1:])


def _moved(axis: Floats, turns: Floats, reference: Floats, step: Floats) -> tuple[Floats, Floats, Floats]:
    upward, clockwise = tangents(axis)
    moved = axis + step[0] * upward + step[1] * clockwise
    turned = turns + np.concatenate([[0.0], step[5:]])
    return moved / np.linalg.norm(moved), turned, small_rotation(step[2:5]) @ reference


def _conclude(axis: Floats, turns: Floats, reference: Floats, measured: Floats, whiten: Floats) -> AxisFit:
    weighted, jacobian = _linear(axis, turns, reference, measured, whiten)
    # (J^T J)^-1 of whitened residuals is the covariance of what was fitted.
    inverse: Floats = np.asarray(np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-14, hermitian=True), dtype=np.float64)
    seen = _camera_slopes(axis, reference, len(inverse))
    return AxisFit(
        axis=axis,
        turns_rad=turns,
        reference=reference,
        residuals=np.asarray(np.linalg.solve(whiten, weighted[..., None])[..., 0], dtype=np.float64),
        weighted=weighted,
        covariance=inverse[:2, :2],
        camera_covariance=seen @ inverse @ seen.T,
        joint=inverse,
    )


def camera_slopes(fit: AxisFit) -> Floats:
    """How the axis in the camera, R_0^T a, moves (3, N + 4) with all that was fitted, in the order of ``joint``."""
    return _camera_slopes(fit.axis, fit.reference, len(fit.joint))


def _camera_slopes(axis: Floats, reference: Floats, count: int) -> Floats:
    # R_0^T a moves with the axis, and against the reference's own rotation.
    seen = np.zeros((3, count))
    seen[:, :2] = reference.T @ np.stack(tangents(axis), axis=1)
    seen[:, 2:5] = reference.T @ cross_product(axis, np.eye(3)).T
    return seen


def moved_by(fit: AxisFit, step: Floats, joint: Floats) -> AxisFit:
    """The fit with all its unknowns moved by a step (N + 4,), and their covariance after it (N + 4, N + 4), rad^2."""
    axis, turns, reference = _moved(fit.axis, fit.turns_rad, fit.reference, step)
    seen = _camera_slopes(axis, reference, len(joint))
    return replace(
        fit,
        axis=axis,
        turns_rad=turns,
        reference=reference,
        covariance=joint[:2, :2],
        camera_covariance=seen @ joint @ seen.T,
        joint=joint,
    )


# -- What moved between the frames, when they do not share one axis ----------------------------
# Frames of one sweep may only differ by turns about one axis. When chi-square says that they do
# not, one more thing is supposed to have moved between two frames (`kochab.polar.seen_axis`), and each supposition is
# weighed by its evidence. What the frames can tell is named. Allowed for is only what leaves the axis on the ground
# where it was, and only where five frames or more can contradict it: three fit a kicked tripod to a hair as well.

UNLIKELY = 1e-3  # chi-squares less probable than this are not noise
LEAST_ARCSEC = 30.0  # less is flexure or wind, and no axis that was left unlocked
ENOUGH_FRAMES = 5  # of which one supposition may be told from the others
PLAUSIBLE, SUDDEN, SURE = 0.1, 0.5, 0.7  # odds of a cause named among others, of anything named, of what is allowed for
COMMON = {Cause.DECLINATION: 0.4, Cause.CAMERA: 0.2, Cause.TUBE: 0.1, Cause.MOUNT: 0.2, Cause.FRAME: 0.1}
FARTHEST_RAD = np.radians(5.0)  # what moved further was turned: no clutch slips so far, and no tripod stands after it
ON_THE_MOUNT = (Cause.DECLINATION, Cause.CAMERA, Cause.TUBE)


@frozen(eq=False)
class Movement:
    """``what`` moved by ``angle_arcsec`` between the frames labelled ``before`` and ``after``, or something else did.

    ``causes`` are all that the frames leave open; ``turned`` is further than anything slips, as in a flip. ``fit``
    knows of the movement: its reference and camera are those of the later frames, and its covariances count what is
    not known of the angle and which of the movements it was.
    """

    what: Cause
    before: str
    after: str
    angle_arcsec: float
    sigma_arcsec: float
    fit: AxisFit
    likely: bool = True
    causes: tuple[Cause, ...] = ()
    turned: bool = False

    @property
    def explains(self) -> bool:
        """Whether nothing is left that noise does not do and nothing else is likelier, so that the fit may be used."""
        return self.likely and self.fit.chance > UNLIKELY


def find_movement(attitudes: Sequence[LocalAttitude], fit: AxisFit, towards: Floats) -> Movement | None:
    """The movement that best explains a poor fit of three or more frames; None when none does."""
    if len(attitudes) < 3 or fit.chance > UNLIKELY:
        return None
    movement_fits = fit_with_movement(attitudes, towards)
    sudden = _sudden(movement_fits)
    best = movement_fits[int(np.argmax([g.evidence for g in sudden]))]
    if abs(best.angle_rad) <= max(3.0 * best.sigma_rad.max(), LEAST_ARCSEC * ARCSEC):
        return None
    models = [*sudden, *_gradual(attitudes, fit)]
    among_all, odds = _odds(models)[: len(sudden)], _odds(sudden)
    if among_all.sum() < SUDDEN:
        return None
    causes = _left_open(movement_fits, odds, best, len(attitudes))
    turned = abs(best.angle_rad) > FARTHEST_RAD and best.cause in ON_THE_MOUNT
    sure = float(among_all[[s.cause in ON_THE_MOUNT for s in movement_fits]].sum()) > SURE
    gaps = [s.after for s, odd in zip(movement_fits, odds, strict=True) if odd > PLAUSIBLE]
    names = [a.label or f"frame {k + 1}" for k, a in enumerate(attitudes)]
    one = best.cause is Cause.FRAME and causes == (Cause.FRAME,)
    return Movement(
        best.looks_like,
        names[best.after if one else min(gaps)],
        names[best.after if one else min(max(gaps) + 1, len(names) - 1)],
        best.angle_rad / ARCSEC,
        float(best.sigma_rad.max()) / ARCSEC,
        _widened(fitted := _knowing(attitudes, best, towards), _second_moment(fitted, models)),
        likely=sure and best.cause in ON_THE_MOUNT and len(attitudes) >= ENOUGH_FRAMES,
        turned=turned,
        causes=causes,
    )


def _left_open(movement_fits: Sequence[MovementFit], odds: Floats, best: MovementFit, frames: int) -> tuple[Cause, ...]:
    """The causes that the frames do not rule out; of few frames always those that look alike in them."""
    share = {c: float(odds[[s.looks_like is c for s in movement_fits]].sum()) for c in Cause}
    open_ = {cause for cause in Cause if share[cause] > PLAUSIBLE} | {best.looks_like}
    if frames < ENOUGH_FRAMES and abs(best.angle_rad) < FARTHEST_RAD:
        open_ |= {Cause.DECLINATION, Cause.MOUNT}
    return tuple(cause for cause in Cause if cause in open_)


def _knowing(attitudes: Sequence[LocalAttitude], best: MovementFit, towards: Floats) -> AxisFit:
    """The fit with the earlier frames taken to where the later ones stand, and the covariances of all unknowns.

    The earlier frames are turned, not the later ones: the live phase goes on with the camera as it stands in the end.
    """

    def taken(number: int, one: LocalAttitude) -> LocalAttitude:
        if (number != best.after) if best.cause is Cause.FRAME else (number > best.after):
            return one
        matrix = best.undo @ one.matrix if best.cause is Cause.MOUNT else one.matrix @ best.undo
        return replace(one, matrix=matrix)

    fit = fit_axis([taken(number, one) for number, one in enumerate(attitudes)], towards)
    known = {"covariance": best.covariance, "camera_covariance": best.camera_covariance}
    return replace(fit, **known, moved=UNKNOWNS[best.cause])


# -- What moves all the time: a tripod that sinks, a camera that creeps, a bearing that wobbles ----
# The first two are a rotation that grows with time, in E, N, U or in the camera, three numbers with a prior; the
# axis is the one at the last frame. The axis that each gives is weighed by its evidence (the likelihood, integrated
# over its numbers) and by how common it is. What the frames cannot tell from a still mount keeps that weight.

GRADUAL_SIGMA, WOBBLE_SIGMA = 60.0 * ARCSEC, 30.0 * ARCSEC
SMALL_ARCSEC, SIZES = 60.0, 4.0
SCATTERS_ARCSEC = (10.0, 30.0, 90.0)
WOBBLES = (2, 4)  # times a turn; once a turn is no wobble, but where camera or axis stands
STILL, GROWS, WOBBLES_SO, SCATTERS = 0.4, 0.18, 0.1, 0.015  # how common: nothing, each that grows, wobbles, scatters


@frozen(eq=False)
class Gradual:
    """An axis (3,) with its covariance (2, 2) by what moves all the time, and the logarithm of its evidence."""

    axis: Floats
    covariance: Floats
    evidence: float


def average_over_fault_models(attitudes: Sequence[LocalAttitude], fit: AxisFit, towards: Floats) -> AxisFit:
    """The fit of frames that share no axis, its axis and ellipse those of whatever may have moved."""
    models = [*_gradual(attitudes, fit), *_sudden(fit_with_movement(attitudes, towards))]
    mean = np.einsum("k,ki->i", _odds(models), np.stack([g.axis for g in models]))
    moved = replace(fit, axis=mean / np.linalg.norm(mean))
    return _widened(moved, _second_moment(moved, models))


def _sudden(movement_fits: Sequence[MovementFit]) -> list["Gradual"]:
    """Sudden movements among the models, together as common as one that grows.

    Of a movement by x with one sigma s the evidence is exp(-chi^2 / 2), times Occam's factor s / (|x| + 1 arcmin) for
    each of its numbers (MacKay 2003, chapter 28), times how common it is, over the gaps where it may have been.
    """
    gaps = len({s.after for s in movement_fits})
    found = []
    for s in movement_fits:  # as common at every size, from about an arcminute to degrees
        # Occam: the width of the likelihood over that of a prior that falls as one over the size, each of its unknowns
        width = s.sigma_rad / (abs(s.angle_rad) + SMALL_ARCSEC * ARCSEC)
        far = s.cause is Cause.MOUNT and abs(s.angle_rad) > FARTHEST_RAD
        known = np.isfinite(width).all() and width.min() > 0.0 and not far
        if s.looks_like is not s.cause:  # of all ways few look like that; half of such tubes and cameras are parallel
            width = np.array([width.max(), 0.5 * min(1.0, np.pi / (2.0 * CONE_RAD) * width.min())])
        prior = float(np.log(width).sum() - np.log(SIZES)) if known else -np.inf
        common = float(np.log(GROWS * COMMON[s.looks_like] / gaps))
        found.append(Gradual(s.axis, s.covariance, prior + common - 0.5 * s.chi2))
    return found


def undetected_creep_covariance(attitudes: Sequence[LocalAttitude], fit: AxisFit) -> Floats:
    """Covariance (2, 2), rad^2, that comes on top where frames share an axis but can't show whether it moved."""
    still = Gradual(fit.axis, fit.covariance, -0.5 * fit.chi2 + float(np.log(STILL)))
    return _second_moment(fit, [*_gradual(attitudes, fit), still]) - fit.covariance


def _odds(models: Sequence[Gradual]) -> Floats:
    """Probability of each model among them, p_k = E_k / sum E (MacKay 2003, Information Theory, chapter 28)."""
    odds = np.exp(np.array([g.evidence for g in models]) - max(g.evidence for g in models))
    return np.asarray(odds / odds.sum())


def _second_moment(fit: AxisFit, models: Sequence[Gradual]) -> Floats:
    """The second moment (2, 2) of what the models say of the axis, about the fit's own: sum p_k (d_k d_k^T + C_k)."""
    apart = np.stack([_offset(fit, g.axis) for g in models])
    each = np.einsum("ki,kj->kij", apart, apart) + np.stack([g.covariance for g in models])
    return np.asarray(np.einsum("k,kij->ij", _odds(models), each))


def _gradual(attitudes: Sequence[LocalAttitude], fit: AxisFit) -> list[Gradual]:
    """The axis by each fault that goes on all the time, and its evidence by Laplace's approximation.

    The fault's numbers x have the prior N(0, 1). With H the normal matrix of fit and fault, H_0 that of the fit alone
    and p how common the fault is (MacKay 2003, Information Theory, chapters 27 and 28)::

        log E = -(chi^2 + |x|^2) / 2 - log(det H / det H_0) / 2 + log p
    """
    measured = np.stack([a.matrix for a in attitudes])
    whiten = np.stack([np.linalg.inv(np.linalg.cholesky(a.covariance)) for a in attitudes])
    residual, jacobian = _linear(fit.axis, fit.turns_rad, fit.reference, measured, whiten)
    upward, clockwise = tangents(fit.axis)
    _, before = np.linalg.slogdet(jacobian.T @ jacobian)
    found = []
    # One linear step from the fit, for each fault; rows of a unit matrix are the prior of its numbers, one sigma each.
    for common, slopes in _slopes(attitudes, fit, measured):
        count = slopes.shape[-1]
        rows = np.block(
            [[jacobian, (whiten @ slopes).reshape(-1, count)], [np.zeros((count, len(jacobian.T))), np.eye(count)]]
        )
        aim = -np.append(residual.ravel(), np.zeros(count))
        step = np.asarray(np.linalg.lstsq(rows, aim, rcond=None)[0], dtype=np.float64)
        _, after = np.linalg.slogdet(rows.T @ rows)
        axis = fit.axis + step[0] * upward + step[1] * clockwise
        # The still model's determinant is taken off, so that its evidence is -chi2 / 2 alone.
        evidence = -0.5 * (float(np.sum(np.square(rows @ step - aim))) + after - before) + np.log(common)
        found.append(Gradual(axis / np.linalg.norm(axis), np.linalg.inv(rows.T @ rows)[:2, :2], evidence))
    return [*found, *(_scattered(attitudes, fit, whiten, before, scatter * ARCSEC) for scatter in SCATTERS_ARCSEC)]


def _slopes(attitudes: Sequence[LocalAttitude], fit: AxisFit, measured: Floats) -> Iterator[tuple[float, Floats]]:
    """For each fault its prior, and how one sigma of its numbers turns each camera about its own axes (N, 3, M)."""
    since = np.array([(a.time_utc - attitudes[0].time_utc).total_seconds() for a in attitudes])
    since = since if np.ptp(since) > 0.0 else np.arange(len(since), dtype=np.float64)  # without times, even steps
    # -1 at the first frame and 0 at the last: the axis found is the one at the end, which the bolts will turn
    share = ((since - since.max()) / np.ptp(since))[:, None, None]
    into_camera = np.swapaxes(measured, 1, 2)
    yield GROWS, GRADUAL_SIGMA * share * into_camera  # a tripod sinks, in E, N, U
    yield GROWS, GRADUAL_SIGMA * share * np.eye(3)  # a camera creeps, in its own axes
    across = np.stack(tangents(fit.axis), axis=1)
    for times in WOBBLES:
        yield WOBBLES_SO, WOBBLE_SIGMA * into_camera @ about_each(fit.axis, times * fit.turns_rad) @ across


def _scattered(
    attitudes: Sequence[LocalAttitude], fit: AxisFit, whiten: Floats, before: float, scatter: float
) -> Gradual:
    """Each frame is off by ``scatter``, radians, on its own, as a wobbling bearing leaves it.

    Its evidence has the likelihood's normalization besides, -sum log(det C'_k / det C_k) / 2, C'_k the wider ones.
    """
    wider = [replace(a, covariance=a.covariance + np.eye(3) * scatter**2) for a in attitudes]
    found = fit_axis(wider, fit.axis)
    less = np.stack([np.linalg.inv(np.linalg.cholesky(a.covariance)) for a in wider])
    measured = np.stack([a.matrix for a in attitudes])
    _, jacobian = _linear(found.axis, found.turns_rad, found.reference, measured, less)
    _, after = np.linalg.slogdet(jacobian.T @ jacobian)
    # Wider errors fit anything: the normalization of the likelihood makes them pay for it.
    spread = 2.0 * float(np.sum(np.linalg.slogdet(whiten)[1] - np.linalg.slogdet(less)[1]))
    evidence = -0.5 * (found.chi2 + after - before + spread) + np.log(SCATTERS)
    return Gradual(found.axis, found.covariance, evidence)


def _offset(fit: AxisFit, axis: Floats) -> Floats:
    """How far another axis (3,) is along (altitude, azimuth on the sky)."""
    return np.stack(tangents(fit.axis)) @ (axis - fit.axis)


def _widened(fit: AxisFit, more: Floats) -> AxisFit:
    """The fit with more covariance (2, 2) of its axis, in the camera as well."""
    into_camera = fit.reference.T @ np.stack(tangents(fit.axis), axis=1)
    in_camera = fit.camera_covariance + into_camera @ more @ into_camera.T
    return replace(fit, covariance=fit.covariance + more, camera_covariance=in_camera)
