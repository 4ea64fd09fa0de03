"""Matches to attitude and camera: a robust fit that adds a term only when the stars ask for it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.attitude.belief import FocalBelief
from app.attitude.normal import chance, inverse, remainder, solve
from app.attitude.projection import PARAMETERS, moved, project_with_jacobian, sane
from app.attitude.trust import BELIEF, corrections, trust
from app.core.attitude import Attitude
from app.core.camera import Camera
from app.core.solution import Matches

Floats = NDArray[np.float64]

FEWEST_FOR_FOCAL = 4
FOCAL = PARAMETERS.index("log_focal")
LADDER: tuple[tuple[tuple[str, ...], int], ...] = (
    (("k1",), 8),
    (("k2",), 14),
    (("cx", "cy"), 14),
    (("p1", "p2"), 18),
)
"""Terms tried one after the other, each with the fewest stars that may speak for it."""

ENOUGH_TO_START_PLAIN = 18
"""From so many stars on, every term of the distortion has to earn its place anew."""

LARGEST_CHANCE = 1e-4
"""A term stays when chance alone would improve the fit as much with less than this probability."""

CLIP_SIGMA = 3.7
FLOOR_PX = 0.02
"""No set of centroids is believed to be better than this, whatever the residuals say."""
FEWEST_TO_DOUBT = 6
"""Among fewer matches none can be told to be the wrong one."""
SOFT_ROUNDS = 10
SETTLED = 0.01
"""Trust that changes by less in a round has settled."""
CONTRADICTED_SIGMA = 4.0
"""A belief so far from what the stars say is none."""
TELLS_NOTHING = 10.0
"""A belief so many times less certain than the stars changes nothing and is left out."""


@dataclass(frozen=True, slots=True, eq=False)
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
    focal: FocalBelief | None = None,
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
        How often at most the outliers are looked for anew; with one round they are left out or
        not, with more each match weighs in the end as much as it is to be trusted.
    focal : FocalBelief, optional
        What is believed of the focal length. It has its say in the measure of its sigma, unless
        the stars contradict it by more than four sigma.

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
    if distortion and count >= ENOUGH_TO_START_PLAIN:
        camera = straightened(camera)
    everyone = np.ones(count, dtype=np.bool_)
    state = _State(
        camera, attitude.matrix, matches, np.median(sigma) / sigma, everyone, camera, np.ones(count)
    )
    base = _columns(("rx", "ry", "rz") + ("log_focal",) * (count >= FEWEST_FOR_FOCAL))
    free, state = _settled(state.descend(base), base, distortion, rounds)
    if distortion and rounds > 1 and not state.earned(free):
        bare = state.straight()
        free, state = _settled(bare.descend(base), base, distortion, rounds)
    if focal is not None and count >= FEWEST_FOR_FOCAL:
        pulled = state.believing(focal, free)
        if pulled is not state:
            free, state = _settled(pulled.descend(free), base, distortion, rounds)
    if rounds > 1:
        state = state.softened(free)
    return state.conclude(free)


def straightened(camera: Camera) -> Camera:
    """The same camera without distortion."""
    return replace(camera, k1=0.0, k2=0.0, p1=0.0, p2=0.0)


def _settled(
    state: "_State", base: NDArray[np.intp], distortion: bool, rounds: int
) -> tuple[NDArray[np.intp], "_State"]:
    """The terms that are asked for and the state without outliers, each seen from the other."""
    free = base
    for _ in range(rounds):
        if distortion:
            free, state = state.supported(base)
        keep = state.agreeing(len(free))
        if np.array_equal(keep, state.inliers):
            break
        state = replace(state, inliers=keep).descend(free)
    return free, state


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    """One point of the descent.

    ``weight`` (M,) are the matches' by their errors, ``trust`` (M,) how far they count at all.
    ``pull`` is a believed log focal length and how much a step of it weighs, px.
    """

    camera: Camera
    matrix: Floats
    matches: Matches
    weight: Floats
    inliers: NDArray[np.bool_]
    plain: Camera
    trust: Floats
    pull: tuple[float, float] | None = None
    share: float = 0.0

    def linear(self, every: bool = False) -> tuple[Floats, Floats]:
        """Residuals (M, 2) px and Jacobian (M, 2, 10), of the inliers or of every match."""
        chosen = slice(None) if every else self.inliers
        vectors = self.matches.vectors[chosen] @ self.matrix.T
        vectors[:, 2] = np.maximum(vectors[:, 2], 1e-3)  # behind the camera: far outside, finite
        pixels, jacobian = project_with_jacobian(self.camera, vectors)
        return self.matches.xy[chosen] - pixels, jacobian

    def weighted(self) -> tuple[Floats, Floats]:
        """The same of the inliers, (2 M,) and (2 M, 10), each over its sigma; then the belief."""
        return self._flat(*self.linear(), (self.weight * np.sqrt(self.trust))[self.inliers])

    def _flat(self, residual: Floats, jacobian: Floats, w: Floats) -> tuple[Floats, Floats]:
        flat = (jacobian * w[:, None, None]).reshape(-1, len(PARAMETERS))
        left = (residual * w[:, None]).ravel()
        if self.pull is None:
            return left, flat
        row = np.zeros((1, len(PARAMETERS)))
        row[0, FOCAL] = self.pull[1]
        off = (self.pull[0] - np.log(self.camera.focal_px)) * self.pull[1]
        return np.append(left, off), np.concatenate([flat, row])

    def descend(self, free: NDArray[np.intp], steps: int = 8) -> "_State":
        """The state at the least squares over the ``free`` parameters."""
        state, damping = self, 0.0
        residual, jacobian = state.weighted()
        cost = float(residual @ residual)
        for _ in range(steps):
            step = np.zeros(len(PARAMETERS))
            step[free] = solve(jacobian[:, free], residual, damping)
            camera, matrix = moved(state.camera, state.matrix, step)
            tried = replace(state, camera=camera, matrix=matrix)
            residual_tried, jacobian_tried = tried.weighted()
            cost_tried = float(residual_tried @ residual_tried)
            if not cost_tried <= cost * (1.0 + 1e-9):
                damping = max(10.0 * damping, 1e-3)
                continue
            gain, state, damping = cost - cost_tried, tried, damping / 10.0
            residual, jacobian, cost = residual_tried, jacobian_tried, cost_tried
            if gain <= 1e-6 * cost + 1e-18 * len(residual):
                break
        return state

    def supported(self, base: NDArray[np.intp]) -> tuple[NDArray[np.intp], "_State"]:
        """``base`` and the terms that the inliers ask for, and the state at their optimum.

        Terms are judged to first order from where the state is; the last ones are given up again
        when the camera they lead to is none.
        """
        residual, jacobian = self.weighted()
        given = [getattr(self.camera, t) - getattr(self.plain, t) for t in PARAMETERS[4:]]
        residual = residual + jacobian[:, 4:] @ np.array(given)  # as if no term were set
        count, chosen = len(residual) // 2, [base]
        now = remainder(jacobian[:, base], residual)
        for names, fewest in LADDER:
            if count < fewest or (names == ("k2",) and PARAMETERS.index("k1") not in chosen[-1]):
                continue
            columns = np.union1d(chosen[-1], _columns(names))
            then = remainder(jacobian[:, columns], residual)
            if chance(now, then, len(residual) - len(columns)) < LARGEST_CHANCE:
                chosen.append(columns)
                now = then
        for columns in reversed(chosen[1:]):
            tried = self.plain_but(columns).descend(columns)
            if sane(tried.camera) and tried.centre_plausible():
                return columns, tried
        return base, self if not any(given) else self.plain_but(base).descend(base)

    def plain_but(self, free: NDArray[np.intp]) -> "_State":
        """The state with the terms of the ladder that are not ``free`` as they were given."""
        names = [t for t in PARAMETERS[4:] if PARAMETERS.index(t) not in free]
        given = {name: getattr(self.plain, name) for name in names}
        return replace(self, camera=replace(self.camera, **given))

    def centre_plausible(self) -> bool:
        """Whether the principal point is inside the frame's middle half."""
        c = self.camera
        middle_x, middle_y = (c.width - 1) / 2, (c.height - 1) / 2
        return abs(c.cx - middle_x) < c.width / 4 and abs(c.cy - middle_y) < c.height / 4

    def agreeing(self, parameters: int) -> NDArray[np.bool_]:
        """Which matches are within the clip, seen from the spread of all of them."""
        residual, _ = self.linear(every=True)
        if len(residual) < FEWEST_TO_DOUBT:
            return np.ones(len(residual), dtype=np.bool_)
        scaled = residual * self.weight[:, None]
        keep = np.hypot(*scaled.T) <= CLIP_SIGMA * _spread(scaled, parameters)
        return keep if keep.sum() > len(keep) / 2 else self.inliers

    def earned(self, free: NDArray[np.intp]) -> bool:
        """Whether a distortion that was given, and not fitted, is one that the stars ask for."""
        if not self.plain.distorted:
            return True
        bent, _ = self.weighted()
        flat, _ = self.straight().descend(free).weighted()
        freedom = len(flat) - len(free) - 1
        return chance(float(flat @ flat), float(bent @ bent), freedom) < LARGEST_CHANCE

    def straight(self) -> "_State":
        """The same without any distortion."""
        return replace(self, camera=straightened(self.camera), plain=straightened(self.plain))

    def believing(self, focal: FocalBelief, free: NDArray[np.intp]) -> "_State":
        """The state that is pulled towards a belief, itself when that tells nothing or is wrong."""
        flat, jacobian = self.weighted()
        level = max(float(flat @ flat) / max(len(flat) - len(free), 1), FLOOR_PX**2)
        at = int(np.flatnonzero(free == FOCAL)[0])
        own = float(np.sqrt(inverse(jacobian[:, free])[at, at] * level))
        believed = float(np.log(focal.focal_px))
        off = abs(believed - float(np.log(self.camera.focal_px)))
        if focal.sigma > TELLS_NOTHING * own:
            return self
        if off > CONTRADICTED_SIGMA * float(np.hypot(own, focal.sigma)):
            return self
        return replace(self, pull=(believed, float(np.sqrt(level)) / max(focal.sigma, 1e-9)))

    def softened(self, free: NDArray[np.intp]) -> "_State":
        """The state at which each match weighs as much as it is to be trusted.

        Itself when there are too few matches to tell, or no majority to be trusted.
        """
        state, share, level, right = self, BELIEF[0] / sum(BELIEF), 0.0, self.trust
        for _ in range(SOFT_ROUNDS if len(self.matches) >= FEWEST_TO_DOUBT else 0):
            residual, jacobian = state.linear(every=True)
            scaled = residual * state.weight[:, None]
            first = level == 0.0
            level = _spread(scaled, len(free)) if first else _level(scaled, right, share, len(free))
            right, share = trust(np.hypot(*scaled.T) / level, share)
            if (right > 0.5).sum() <= len(right) / 2:
                return self
            left, flat = state._flat(residual, jacobian, state.weight * np.sqrt(right))
            step = np.zeros(len(PARAMETERS))
            step[free] = solve(flat[:, free], left)
            camera, matrix = moved(state.camera, state.matrix, step)
            done = np.abs(right - state.trust).max() < SETTLED
            state = replace(state, camera=camera, matrix=matrix, trust=right, share=share)
            if done:
                break
        return replace(state, inliers=state.trust > 1e-4)

    def conclude(self, free: NDArray[np.intp]) -> Fit:
        """The fit with its covariance."""
        flat, jacobian = self.weighted()
        short, wider = corrections(self.share) if self.share > 0.0 else (1.0, 1.0)
        freedom = 2.0 * float(self.trust[self.inliers].sum()) - len(free) + (self.pull is not None)
        variance = float(flat @ flat) / short / freedom if freedom > 0 else 1.0
        spread = inverse(jacobian[:, free]) * wider * max(variance, FLOOR_PX**2)
        to_rotation = _as_rotation(self.camera)[:, free]
        covariance = to_rotation @ spread @ to_rotation.T
        residual, _ = self.linear(every=True)
        inliers = self.agreeing(len(free)) if self.share > 0.0 else self.inliers
        length2 = np.sum(np.square(residual[inliers]), axis=1)
        return Fit(
            self.camera,
            Attitude(self.matrix, covariance),
            residual,
            float(np.sqrt(np.mean(length2))),
            inliers,
            tuple(PARAMETERS[i] for i in free),
        )


def _columns(names: tuple[str, ...]) -> NDArray[np.intp]:
    return np.array([PARAMETERS.index(name) for name in names], dtype=np.intp)


def _spread(scaled: Floats, parameters: int) -> float:
    """Sigma of one coordinate from residuals (M, 2), by their median; at least the floor."""
    freedom = max(scaled.size - parameters, 1) / scaled.size
    return max(1.4826 * float(np.median(np.abs(scaled))) / float(np.sqrt(freedom)), FLOOR_PX)


def _level(scaled: Floats, right: Floats, share: float, parameters: int) -> float:
    """Sigma of one coordinate from residuals (M, 2) that are ``right`` (M,) so far."""
    square = float(right @ np.square(scaled).sum(axis=1)) / corrections(share)[0]
    freedom = max(2.0 * float(right.sum()) - parameters, 1.0)
    return max(float(np.sqrt(square / freedom)), FLOOR_PX)


def _as_rotation(camera: Camera) -> Floats:
    """(3, 10): the rotation that moves the middle of the frame as each parameter does."""
    middle = np.array([[(camera.width - 1) / 2, (camera.height - 1) / 2]])
    _, jacobian = project_with_jacobian(camera, camera.unproject(middle))
    shift = jacobian[0].copy()
    shift[:, 2] = 0.0
    turn = np.zeros((3, len(PARAMETERS)))
    turn[:2] = np.linalg.solve(jacobian[0][:, :2], shift)
    turn[2, 2] = 1.0
    return turn
