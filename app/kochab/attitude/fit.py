"""Matches to attitude and camera: a robust fit that adds only distortion terms that the stars support."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kochab.attitude import FLOOR_PX
from kochab.attitude.least_squares import (
    FOCAL,
    PARAMETERS,
    FitState,
    Normal,
    centre_plausible,
    columns,
    distortion_supported,
    project_with_jacobian,
    supported_terms,
    undistorted,
    without_distortion,
)
from kochab.core.arrays import Floats, Indices, Ints
from kochab.core.attitude import Attitude
from kochab.core.camera import Camera
from kochab.core.robust import mad_sigma, median
from kochab.core.solution import Matches
from kochab.core.values import frozen


@frozen
class FocalPrior:
    """A focal length, px, and the one-sigma error of its logarithm: a Gaussian prior of a fit."""

    focal_px: float
    sigma: float

    @classmethod
    def of_range(cls, shortest_px: float, longest_px: float) -> "FocalPrior":
        """From the range it is in, half of which is taken for one sigma."""
        return cls(math.sqrt(shortest_px * longest_px), math.log(longest_px / shortest_px) / 2.0)


# -- Weights: the probability that each match is right, by a mixture model ---------------------
# Residuals of right matches are normal in each coordinate; those of wrong ones (blends, mismatches,
# hot pixels) are uniform within REACH_SIGMA. The fraction of wrong ones is learnt from the residuals by
# expectation maximisation (Dempster, Laird and Rubin 1977, J. R. Stat. Soc. B 39, 1).

REACH_SIGMA = 6.0
"""Wrong matches are spread over this radius; those beyond have no weight."""
PRIOR_COUNTS = (1.0, 10.0)
"""Wrong and right matches assumed beforehand, counted as so many stars seen."""
# Gauss-Laguerre: the expectation over r^2 / 2 sigma^2, which has an exponential law, is a weighted sum.
# From the Jacobi matrix (Golub & Welsch 1969): to import numpy.polynomial for it takes as long as to fit a frame.
_row = np.arange(40)
_NODES, _vectors = np.linalg.eigh(np.diag(2.0 * _row + 1.0) + np.diag(_row[1:], 1) + np.diag(_row[1:], -1))
_WEIGHTS = _vectors[0] ** 2


def match_probability(scaled: Floats, outlier_fraction: float) -> tuple[Floats, float]:
    """The probability (M,) that each match is right, and the fraction of wrong ones, estimated anew.

    Parameters
    ----------
    scaled : (M,)
        Lengths of the residuals, in sigmas of one coordinate.
    outlier_fraction : float
        Of the matches within :data:`REACH_SIGMA` those that are wrong, as estimated so far.

    """
    right = _right(scaled**2 / 2.0, outlier_fraction)
    near = scaled <= REACH_SIGMA
    wrong = PRIOR_COUNTS[0] + float((1.0 - right[near]).sum())
    return right, wrong / (sum(PRIOR_COUNTS) + float(near.sum()))


def corrections(outlier_fraction: float) -> tuple[float, float]:
    """What the weights do to right stars: of the mean square, and of the fit's covariance.

    The weighted mean square of normal residuals falls short of their variance by the first factor.
    The second is the covariance of the weighted fit over ``variance / sum(weights J^T J)`` (Huber
    1981, Robust Statistics, section 7.6). Both are 1 without weights.
    """
    half = _NODES  # r^2 / 2 sigma^2 of two normal coordinates has an exponential law
    weight = _right(half, outlier_fraction)
    mean = float(_WEIGHTS @ weight)
    square = float(_WEIGHTS @ (weight * half))
    slope = -weight * (1.0 - weight)  # by half
    bread = mean + float(_WEIGHTS @ (slope * half))
    meat = float(_WEIGHTS @ (weight**2 * half))
    return square / mean, meat * mean / bread**2


def _right(half: Floats, outlier_fraction: float) -> Floats:
    normal = (1.0 - outlier_fraction) * np.exp(-half) / 2.0
    return np.asarray(normal / (normal + outlier_fraction / REACH_SIGMA**2))


FEWEST_FOR_FOCAL = 4  # two would fit it exactly; four leave residuals to judge it by
ENOUGH_TO_START_PLAIN = 18
"""From so many stars on, every term of the distortion has to earn its place anew."""
CLIP_SIGMA = 3.7  # 0.1 % of right matches lie beyond: two coordinates have a Rayleigh law
FEWEST_TO_DOUBT = 6
"""Among fewer matches an outlier cannot be told from the others."""
SHORTER = (0.0, 1e-6, 1e-3, 0.1)
"""Dampings of the reweighted steps, the next tried when one leads uphill."""
REWEIGHTED_ROUNDS = 10
SETTLED = 0.01
"""Weights that change by less in a round have settled."""
CONTRADICTED_SIGMA = 4.0
"""A prior this far from what the stars say is wrong and left out."""
TELLS_NOTHING = 10.0
"""A prior this many times less certain than the stars changes nothing and is left out."""


@frozen(eq=False)
class Fit:
    """A camera and an attitude that agree with ``M`` matches.

    ``residuals_px`` (M, 2) are recorded minus computed pixels, of all matches; ``inliers`` (M,)
    tells which are near enough to be matches; ``rms_px`` is the root mean square length of their
    residuals. ``terms`` are the parameters that were fitted. The attitude's covariance is that of
    the rotation as seen in the middle of the frame, where a shift of the principal point and a
    turn are one thing.
    """

    camera: Camera
    attitude: Attitude
    residuals_px: Floats
    rms_px: float
    inliers: NDArray[np.bool_]
    terms: tuple[str, ...]


def refine(
    matches: Matches,
    camera: Camera,
    attitude: Attitude,
    sigma_px: Floats | float | None = None,
    *,
    distortion: bool = True,
    rounds: int = 4,
    focal: FocalPrior | None = None,
    worst_px: float | None = None,
    floor_px: float = 0.0,
    principal_point_sigma: float = 0.0,
) -> Fit:
    """Fit rotation, focal length and whatever else the matches support.

    Parameters
    ----------
    matches : Matches
        M >= 2 pairs; wrong ones are left out as long as they are the minority.
    camera, attitude
        A first guess, good to a few pixels.
    sigma_px : (M,) or float, optional
        Centroid errors a coordinate; only their ratios matter, the level comes from the residuals.
    distortion : bool
        Whether terms beyond rotation and focal length may be tried at all.
    rounds : int
        How often at most outliers are looked for. With one round they are left out or not, and
        the attitude has no covariance; with more each match is weighted in the end by the
        probability that it is right.
    focal : FocalPrior, optional
        Counts by its sigma, unless the stars contradict it by more than four sigma.
    worst_px : float, optional
        Largest centroid error to accept, three sigma of a coordinate, however many stars show a
        larger one.
    floor_px : float, optional
        What the places are believed to be no better than, however small the residuals are.
    principal_point_sigma : float
        How far the lens's axis lies from the middle, one sigma along x and y, over the frame's
        larger side: counts in the covariance of a fit in which no star shows it.

    Returns
    -------
    Fit

    Raises
    ------
    ValueError
        Fewer than two matches.

    Notes
    -----
    Levenberg-Marquardt steps. A term, or pair of terms, is added when the sum of squares falls
    from R0 to R1 with ``(R1 / R0)^(dof / 2) < 1e-4``: for two terms this is exactly the tail of
    the F distribution, for one an upper bound of it.

    """
    if len(matches) < 2:
        raise ValueError("A fit needs two matches or more.")
    count = len(matches)
    sigma = np.broadcast_to(1.0 if sigma_px is None else sigma_px, count)
    # The principal point goes too: told by fewer stars, its error would be in the centre and in no sigma.
    plain = undistorted(camera) if distortion and count >= ENOUGH_TO_START_PLAIN else camera
    everyone = np.ones(count, dtype=np.bool_)
    given = FitState(
        camera,
        attitude.matrix,
        matches,
        median(sigma) / sigma,
        everyone,
        plain,
        np.ones(count),
        largest=math.inf if worst_px is None else worst_px / 3.0,
        cropped=not centre_plausible(camera),
    )
    base = columns(("rx", "ry", "rz") + ("log_focal",) * (count >= FEWEST_FOR_FOCAL))
    free, state = _without_outliers(
        replace(given, camera=plain, cropped=given.cropped and plain is camera).descend(base), base, distortion, rounds
    )
    # A principal point far off, as in a crop, is out of reach from the middle: no fit is worse than what was given.
    if plain is not camera and _typical(state) > _typical(given):
        free, state = _without_outliers(given.descend(base), base, distortion, rounds)
    # A distortion that was given, as by a camera profile, has to agree with these stars too.
    if distortion and rounds > 1 and not distortion_supported(state, free):
        free, state = _without_outliers(without_distortion(state).descend(base), base, distortion, rounds)
    if focal is not None and count >= FEWEST_FOR_FOCAL:
        pulled = _with_focal_prior(state, focal, free)
        if pulled is not state:
            free, state = _without_outliers(pulled.descend(free), base, distortion, rounds)
    if rounds > 1:
        state = _reweighted(state, free)
    return _fit_of(state, free, max(floor_px, FLOOR_PX) if rounds > 1 else None, principal_point_sigma)


def _typical(state: FitState) -> float:
    """Median length of all residuals, px, those of outliers too."""
    return median(np.hypot(*state.residuals().T))


def _without_outliers(state: FitState, base: Indices, distortion: bool, rounds: int) -> tuple[Indices, FitState]:
    """The terms that the stars support and the state without outliers, found in turns."""
    free = base
    for _ in range(rounds):
        before = free
        if distortion:
            free, state = supported_terms(state, base, final=rounds > 1)
        keep = _inliers(state, len(free))
        if np.array_equal(keep, state.inliers) and np.array_equal(free, before):
            break  # terms were tested to first order where they stand
        state = replace(state, inliers=keep)
        tried = state.descend(free)
        # one whose axis runs away from the frame stays where it was, and its terms are chosen anew
        state = tried if centre_plausible(tried.camera, state.cropped) else state
    return free, state


def _inliers(state: FitState, parameters: int) -> NDArray[np.bool_]:
    """Which matches are within the clip, seen from the spread of all of them."""
    scaled = state.residuals() * state.weight[:, None]
    if len(scaled) < FEWEST_TO_DOUBT:
        return np.ones(len(scaled), dtype=np.bool_)
    limit = CLIP_SIGMA * min(_spread(scaled, parameters), state.largest)
    keep = np.square(scaled).sum(axis=1) <= limit * limit
    # When the clip would drop the majority, the spread was wrong and not the stars.
    return keep if 2 * int(keep.sum()) > len(keep) else state.inliers


def _with_focal_prior(state: FitState, focal: FocalPrior, free: Indices) -> FitState:
    """The state with a prior of the focal length; itself when that tells nothing or is wrong."""
    flat, normal = state.linear()
    freedom = 2 * int(state.inliers.sum()) - len(free)
    level = max(float(flat @ flat) / max(freedom, 1), FLOOR_PX**2)
    at = int(np.flatnonzero(free == FOCAL)[0])
    # The error of the logarithm that the stars alone leave, against which the prior is weighed.
    own = float(np.sqrt(normal.only(free).inverse()[at, at] * level))
    believed = math.log(focal.focal_px)
    off = abs(believed - math.log(state.camera.focal_px))
    if focal.sigma > TELLS_NOTHING * own:
        return state
    if off > CONTRADICTED_SIGMA * math.hypot(own, focal.sigma):
        return state
    return replace(state, focal_prior=(believed, math.sqrt(level) / max(focal.sigma, 1e-9)))


def _reweighted(state: FitState, free: Indices) -> FitState:
    """The state in which each match weighs by the probability that it is right.

    Itself when there are too few matches to tell, or no majority to be trusted.
    """
    before, outlier_fraction, level, right = state, PRIOR_COUNTS[0] / sum(PRIOR_COUNTS), 0.0, state.match_probability
    left, jacobian = state.slopes()
    for _ in range(REWEIGHTED_ROUNDS if len(state.matches) >= FEWEST_TO_DOUBT else 0):
        scaled = left.T * state.weight[:, None]
        length2 = np.square(scaled).sum(axis=1)
        first = level == 0.0
        level = _spread(scaled, len(free)) if first else _level(length2, right, outlier_fraction, len(free))
        level = min(level, state.largest)
        right, outlier_fraction = match_probability(np.sqrt(length2) / level, outlier_fraction)
        if 2 * int((right > 0.5).sum()) <= len(right):
            return before
        tried, left, jacobian = _downhill_step(state, free, left, jacobian, state.weight * np.sqrt(right))
        done = tried is state or float(np.abs(right - state.match_probability).max()) < SETTLED
        state = replace(tried, match_probability=right, outlier_fraction=outlier_fraction)
        if done:
            break
    return replace(state, inliers=state.match_probability > 1e-4)


def _downhill_step(
    state: FitState, free: Indices, left: Floats, jacobian: Floats, counts: Floats
) -> tuple[FitState, Floats, Floats]:
    """The state after a step that makes nothing worse, or itself; its residuals, the derivatives.

    The derivatives are kept while their steps lead downhill: a centre and a distortion that are
    hardly told apart else run away. Then they are made anew, and the steps shorter.
    """
    flat = state.flat(left, counts)
    # Rounding at the minimum must not count as uphill.
    cost = float(flat @ flat) * (1.0 + 1e-9)
    normal = state.normal(jacobian, counts).only(free)
    for number, damping in enumerate((0.0, *SHORTER)):
        if number == 1:
            _, jacobian = state.slopes()
            normal = state.normal(jacobian, counts).only(free)
        tried = state.moved(free, normal.step(flat, damping))
        there = tried.residuals().T
        then = tried.flat(there, counts)
        if float(then @ then) <= cost:
            return tried, there, jacobian
    return state, left, jacobian


def _fit_of(state: FitState, free: Indices, floor_px: float | None, principal_point_sigma: float) -> Fit:
    residual = state.residuals()
    inliers = _inliers(state, len(free)) if state.outlier_fraction > 0.0 else state.inliers
    length2 = np.square(residual[inliers]).sum(axis=1)
    return Fit(
        state.camera,
        Attitude(state.matrix, None if floor_px is None else _covariance(state, free, floor_px, principal_point_sigma)),
        residual,
        math.sqrt(float(length2.sum()) / max(len(length2), 1)),
        inliers,
        tuple(PARAMETERS[i] for i in free),
    )


# -- Uncertainty: noise, as the residuals show it, and what the camera model leaves unexplained ----
# The noise of M stars averages out as they say when it is each star's own. What a lens does that the model
# lacks does not: neighbours are off together. So the frame is cut into blocks, each is left out in turn, and
# how far the answer moves is the variance of all that differs from block to block (the delete-a-group
# jackknife: Shao and Tu 1995, section 2.3; blocks, as the errors are correlated: Kuensch 1989, Ann. Stat. 17).
# Nine blocks tell a variance to a half, so theirs counts with what the residuals say, as so many degrees of freedom.

BLOCKS = 3  # to a side of the frame
FEWEST_BLOCKS = 6
FEWEST_FOR_BLOCKS = 16
SURELY_OFF = 3.0
"""The optical axis is off-centre when x^2 and y^2 together exceed their variances by this factor; 5 % do by chance."""
RESIDUALS_COUNT = 6.0
"""Degrees of freedom with which the residuals' variance is believed; the blocks have one less than blocks."""


def _covariance(state: FitState, free: Indices, floor_px: float, principal_point_sigma: float = 0.0) -> Floats:
    """Of the small rotation (3, 3), rad^2."""
    flat, normal = state.linear()
    short, wider = corrections(state.outlier_fraction) if state.outlier_fraction > 0.0 else (1.0, 1.0)
    # A match that is half believed is half a measurement; a prior is one more.
    freedom = 2.0 * float(state.match_probability[state.inliers].sum()) - len(free) + (state.focal_prior is not None)
    variance = float(flat @ flat) / short / freedom if freedom > 0 else 1.0
    # Few residuals tell their own level badly: errors over it follow Student's law, of this variance.
    student = 1.0 + 2.0 / max(freedom - 2.0, 1.0)
    fitted = normal.only(free)
    to_rotation = as_rotation(state.camera)[:, free]
    spread = to_rotation @ fitted.inverse() @ to_rotation.T * (wider * max(student * variance, floor_px**2))
    excess = _excess_of_blocks(state, fitted, flat, to_rotation, np.diag(spread))
    tilt = _tilt(
        state, free, flat, normal, variance, principal_point_sigma * max(state.camera.width, state.camera.height)
    )
    # what is left at the middle is the middle's own error, however well the whole is fitted
    left = _misfit_px2(state, len(free), variance) / state.camera.focal_px**2
    return np.asarray(spread * np.sqrt(excess[:, None] * excess) + tilt @ tilt.T + np.diag([left, left, 0.0]))


def _misfit_px2(state: FitState, parameters: int, variance: float) -> float:
    """Variance of a coordinate of the middle by what the model leaves there, px^2; 0 where nothing is seen of it.

    How far the blocks' mean residuals differ by more than noise is its size anywhere in the frame (DerSimonian and
    Laird 1986, Controlled Clin. Trials 7, 177); the stars of the middle block narrow down how much of it is there.
    """
    counts, cell = np.square(state.counts), _blocks(state)
    weight, *pulls = (np.bincount(cell, counts * r, BLOCKS**2) for r in (1.0, *state.residuals().T))
    full = weight > 0.0
    freedom = 2.0 * int(full.sum()) - parameters
    if int((counts > 0.0).sum()) < FEWEST_FOR_BLOCKS or freedom <= 0.0:
        return 0.0
    mean2 = np.square([pull[full] / weight[full] for pull in pulls]).sum(axis=0)
    seen = float((weight[full] * mean2).sum()) / variance
    total = float(weight.sum())
    each = 2.0 * (total - float(np.square(weight).sum()) / total) / variance
    anywhere = max(0.0, seen - freedom - math.sqrt(2.0 * freedom)) / max(each, 1e-300)
    middle = BLOCKS**2 // 2
    if anywhere == 0.0 or not full[middle]:
        return anywhere
    share = anywhere / (anywhere + variance / float(weight[middle]))
    here = float(np.mean([(pull[middle] / weight[middle]) ** 2 for pull in pulls]))
    return anywhere * (1.0 - share) + share**2 * here


def _blocks(state: FitState) -> Ints:
    """Which block of the frame each match lies in (M,)."""
    size = np.array([state.camera.width, state.camera.height])
    return np.asarray(np.clip(state.matches.xy * BLOCKS // size, 0, BLOCKS - 1).astype(np.int64) @ [1, BLOCKS])


def _tilt(
    state: FitState, free: Indices, flat: Floats, normal: Normal, variance: float, principal_point_sigma_px: float
) -> Floats:
    """Turns (3, 2) rad of the attitude by an optical axis one sigma off the middle, where it is not fitted.

    The stars narrow down how far it may be; the rest is counted (Schmidt 1966, Adv. Control Syst. 3, 293).
    """
    if not principal_point_sigma_px or state.plain.distorted or np.isin(columns(("cx", "cy", "p1", "p2")), free).any():
        return np.zeros((3, 2))
    axis = columns(("cx", "cy"))
    turns, fitted, with_axis = as_rotation(state.camera), normal.only(free), normal.only(np.append(free, axis))
    open_px2, seen = variance * with_axis.inverse().diagonal()[-2:], with_axis.step(flat)[-2:]
    # A crop's axis is far off: where the stars surely say so, it is as far as they say.
    shown = float((np.square(seen) - SURELY_OFF * open_px2).mean())
    prior = min(max(principal_point_sigma_px**2, shown), max(state.camera.width, state.camera.height) ** 2)
    # Prior variance over the sum of it and of what the stars leave open: 1 where they tell nothing.
    share = prior / (prior + open_px2)
    off = np.sqrt(prior * (1.0 - share) + np.square(share * seen))
    return np.asarray(
        np.stack([turns[:, free] @ fitted.step(normal.rows[p]) - turns[:, p] for p in axis], axis=1) * off
    )


def _excess_of_blocks(state: FitState, fitted: Normal, flat: Floats, to_rotation: Floats, variance: Floats) -> Floats:
    """By how much the blocks' variance of the rotation (3,) exceeds ``variance`` (3,), at least 1."""
    plain = np.ones(3)
    counted = np.flatnonzero(state.counts > 0.0)
    if len(counted) < FEWEST_FOR_BLOCKS:
        return plain
    cell = _blocks(state)
    # Only blocks with stars that count can be left out.
    names = sorted(set(cell[counted].tolist()))
    if len(names) < FEWEST_BLOCKS:
        return plain
    rows, twice = fitted.rows / fitted.scale[:, None], np.concatenate([cell, cell])
    parts = [np.flatnonzero(twice == name) for name in names]
    without = np.stack([fitted.matrix - rows[:, part] @ rows[:, part].T for part in parts])
    pulls = np.stack([rows[:, part] @ flat[part] for part in parts])
    without += 1e-9 * np.eye(len(rows))  # a term that one block alone had told
    turns = (np.linalg.solve(without, pulls[:, :, None])[:, :, 0] / fitted.scale) @ to_rotation.T
    between = (len(names) - 1.0) / len(names) * np.square(turns - turns.mean(axis=0)).sum(axis=0)
    ratio = between / np.maximum(variance, 1e-300)
    # Nine blocks tell each axis badly: x and y, alike for a lens, share their excess; roll keeps its own.
    ratio[:2] = ratio[:2].mean()
    freedom = len(names) - 1.0
    return np.asarray(np.maximum(1.0, (freedom * ratio + RESIDUALS_COUNT) / (freedom + RESIDUALS_COUNT)))


def _spread(scaled: Floats, parameters: int) -> float:
    """Sigma of one coordinate from residuals (M, 2), by their median; at least the floor."""
    # The fitted parameters have shrunk the residuals: fewer are free than there are.
    freedom = max(scaled.size - parameters, 1) / scaled.size
    return max(mad_sigma(scaled, 0.0) / math.sqrt(freedom), FLOOR_PX)


def _level(length2: Floats, right: Floats, outlier_fraction: float, parameters: int) -> float:
    """Sigma of one coordinate from squared residuals (M,) that are ``right`` (M,) so far."""
    square = float(right @ length2) / corrections(outlier_fraction)[0]
    freedom = max(2.0 * float(right.sum()) - parameters, 1.0)
    return max(math.sqrt(square / freedom), FLOOR_PX)


def as_rotation(camera: Camera) -> Floats:
    """(3, 10): the rotation that moves the middle of the frame as each parameter does."""
    middle = np.array([[(camera.width - 1) / 2, (camera.height - 1) / 2]])
    _, jacobian = project_with_jacobian(camera, camera.unproject(middle))
    turn = np.zeros((3, len(PARAMETERS)))
    turn[:2] = np.linalg.solve(jacobian[0][:, :2], jacobian[0])
    turn[2, 2] = 1.0
    return turn
