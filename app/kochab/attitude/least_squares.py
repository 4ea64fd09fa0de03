"""Least squares of attitude, camera and the distortion terms that the stars support."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Floats, Indices
from kochab.core.attitude import small_rotation
from kochab.core.camera import Camera
from kochab.core.solution import Matches
from kochab.core.values import frozen

# -- Least squares of one step: normal equations with the columns scaled to one length ---------

RIDGE = 1e-13
"""Added to the scaled diagonal: columns that are one and the same share what they explain."""


@frozen(eq=False)
class Normal:
    """The derivatives ``rows`` (K, N) of N residuals by K parameters, and what they make.

    ``scale`` (K,) are the rows' lengths and ``matrix`` (K, K) the normal matrix of rows of length
    one.
    """

    rows: Floats
    scale: Floats
    matrix: Floats

    @classmethod
    def of(cls, rows: Floats) -> "Normal":
        """Of derivatives (K, N), each parameter's in a row."""
        matrix = rows @ rows.T
        scale = np.sqrt(matrix.diagonal())
        scale[scale == 0.0] = 1.0  # a parameter that moves no star
        matrix /= scale
        matrix /= scale[:, None]
        matrix.ravel()[:: len(matrix) + 1] += RIDGE
        return cls(rows, scale, matrix)

    def only(self, free: Indices) -> "Normal":
        """The same with no other parameters than ``free``."""
        matrix = self.matrix.take(free, axis=0).take(free, axis=1)
        return Normal(self.rows.take(free, axis=0), self.scale.take(free), matrix)

    def step(self, residual: Floats, damping: float = 0.0) -> Floats:
        """The step (K,) of least squares of residuals (N,)."""
        matrix = self.matrix
        if damping:
            matrix = matrix.copy()
            matrix.ravel()[:: len(matrix) + 1] += damping
        return np.asarray(np.linalg.solve(matrix, (self.rows @ residual) / self.scale) / self.scale)

    def held_out(self, residual: Floats) -> float:
        """Sum of squares left of residuals (N,) when each is predicted by a step made without it.

        The sum of squares of Allen (1974, Technometrics 16, 125): a residual grows by what its own
        leverage had taken off it.
        """
        rows = self.rows / self.scale[:, None]
        leverage = (rows * np.linalg.solve(self.matrix, rows)).sum(axis=0)
        # At least 0.05: a star that alone determines a term would divide by zero.
        left = (residual - self.step(residual) @ self.rows) / np.maximum(1.0 - leverage, 0.05)
        return float(left @ left)

    def inverse(self) -> Floats:
        """The inverse (K, K) of the normal matrix."""
        return np.asarray(np.linalg.inv(self.matrix) / self.scale / self.scale[:, None])


def chance(before: float, after: float, freedom: int) -> float:
    """Probability, at most, that a useless term lowers the sum of squares this much."""
    if freedom <= 0 or before <= 0:
        return 1.0
    ratio = max(after / before, 1e-30)
    return float(min(ratio, 1.0) ** (freedom / 2.0))


# -- How pixels move when the attitude or the camera changes a little --------------------------

PARAMETERS = ("rx", "ry", "rz", "log_focal", "cx", "cy", "k1", "k2", "p1", "p2")
"""Columns of the Jacobian: a rotation about the camera axes (rad), ln focal length, the rest."""


def project_with_jacobian(camera: Camera, vectors: Floats) -> tuple[Floats, Floats]:
    """Pixels (N, 2) of camera-axes vectors (N, 3) and their derivatives (N, 2, 10).

    Those behind the camera are far outside, finite. The derivatives are by :data:`PARAMETERS`, at no
    change; in memory a parameter's lie together. The model is that of ``kochab.core.camera`` (Brown
    1966, Photogramm. Eng. 32, 444).
    """
    flat = camera.ahead(vectors)
    u, v = flat
    square = flat * flat
    uu, vv = square
    uv, r2 = u * v, uu + vv
    jacobian = np.empty((len(PARAMETERS), 2, len(u)))
    turn = jacobian[:3]
    camera.turn(flat, turn[:2])
    turn[2, 0], turn[2, 1] = -v, u
    bent = flat
    if camera.distorted:
        bent = camera.bent(flat.T).T
        by_u, by_v, cross = camera.bending(u, v)
        across, down = by_u * turn[:, 0] + cross * turn[:, 1], by_v * turn[:, 1]
        turn[:, 1] = down + cross * turn[:, 0]
        turn[:, 0] = across
    jacobian[3], jacobian[4:6] = bent, 0.0
    # k1 moves a point by r2 along its radius, k2 by r2 squared.
    np.multiply(flat, r2, out=jacobian[6])
    np.multiply(jacobian[6], r2, out=jacobian[7])
    jacobian[8, 0] = jacobian[9, 1] = 2.0 * uv
    jacobian[8, 1], jacobian[9, 0] = r2 + 2.0 * square[::-1]
    shape = camera.focal_xy_px[:, None]
    jacobian *= shape
    jacobian[4, 0] = jacobian[5, 1] = 1.0
    pixels = shape * bent + np.array([[camera.cx], [camera.cy]])
    return pixels.T, jacobian.T


def moved(camera: Camera, matrix: Floats, step: Floats) -> tuple[Camera, Floats]:
    """The camera and the attitude matrix (3, 3) after a ``step`` (10,) of the parameters."""
    x, y, z, focal, cx, cy, k1, k2, p1, p2 = step.tolist()
    c = camera
    after = type(c)(
        c.width,
        c.height,
        # A step may change the focal length by a factor of e at most: far from the minimum steps run away.
        c.focal_px * math.exp(min(max(focal, -1.0), 1.0)),
        c.cx + cx,
        c.cy + cy,
        c.k1 + k1,
        c.k2 + k2,
        c.p1 + p1,
        c.p2 + p2,
        c.mirrored,
        c.aspect,
    )
    return after, small_rotation(np.array([x, y, z])) @ matrix


def sane(camera: Camera) -> bool:
    """Whether the distortion keeps the frame in one piece.

    Along each ray from the principal point to a corner the recorded radius must grow, and no point
    of it may be moved by more than two fifths of its radius.
    """
    if not camera.distorted:
        return True
    w, h = camera.width - 1.0, camera.height - 1.0
    corners = np.array([[0, 0], [w, 0], [w, h], [0, h]])
    ray = (corners - [camera.cx, camera.cy]) / camera.focal_xy_px
    # A corner may lie beyond a lens's circle, where nothing is seen.
    ray = ray * np.minimum(1.0, camera.circle_rad / np.hypot(*ray.T))[:, None]
    ray = ray * np.linspace(0.05, 1.0, 24)[:, None, None]
    u, v = ray[..., 0], ray[..., 1]
    r2 = u * u + v * v
    shift = r2 * (camera.k1 + camera.k2 * r2)
    # 3: the most that p1 (r2 + 2 v2) or its twin is, in units of p1 r2.
    tangential = 3.0 * (abs(camera.p1) + abs(camera.p2)) * np.sqrt(r2)
    grows = 1.0 + r2 * (3.0 * camera.k1 + 5.0 * camera.k2 * r2) > 0.2
    return bool(np.all(grows) and np.all(np.abs(shift) + tangential < 0.4))


FOCAL = PARAMETERS.index("log_focal")
STEPS = 8
FAR = 2.0
"""When a step makes the sum of squares so many times smaller, the derivatives are made anew."""


@frozen(eq=False)
class FitState:
    """One point of the descent.

    ``plain`` has the terms of the distortion that stand while they are not fitted. ``weight`` (M,)
    are the matches' by their errors, ``match_probability`` (M,) the probability that each is right and
    ``outlier_fraction`` the fraction of wrong ones. ``focal_prior`` is a prior log focal length and the weight of a
    step of it, px.
    ``largest`` is the largest sigma of one coordinate that may be, px. ``cropped``: the axis may be a side away.
    """

    camera: Camera
    matrix: Floats
    matches: Matches
    weight: Floats
    inliers: NDArray[np.bool_]
    plain: Camera
    match_probability: Floats
    focal_prior: tuple[float, float] | None = None
    outlier_fraction: float = 0.0
    largest: float = math.inf
    cropped: bool = False

    def residuals(self) -> Floats:
        """Recorded minus computed pixels (M, 2) of every match."""
        vectors = self.matches.vectors @ self.matrix.T
        return self.matches.xy - self.camera.recorded(self.camera.ahead(vectors).T)

    def slopes(self) -> tuple[Floats, Floats]:
        """Residuals (2, M) px and their derivatives (10, 2, M), of every match."""
        pixels, jacobian = project_with_jacobian(self.camera, self.matches.vectors @ self.matrix.T)
        return self.matches.xy.T - pixels.T, jacobian.T

    @property
    def counts(self) -> Floats:
        """How much each match counts (M,): outliers do not."""
        return np.asarray(self.weight * np.sqrt(self.match_probability) * self.inliers)

    def flat(self, residual: Floats, counts: Floats) -> Floats:
        """Residuals (2, M) times ``counts``, (2 M,), and then what the belief is off by."""
        left = (residual * counts).ravel()
        if self.focal_prior is None:
            return left
        believed, weight = self.focal_prior
        return np.append(left, (believed - np.log(self.camera.focal_px)) * weight)

    def normal(self, jacobian: Floats, counts: Floats) -> Normal:
        """The normal equations of derivatives (10, 2, M) times ``counts``, and of the belief."""
        rows = (jacobian * counts).reshape(len(PARAMETERS), -1)
        if self.focal_prior is not None:
            column = np.zeros((len(PARAMETERS), 1))
            column[FOCAL] = self.focal_prior[1]
            rows = np.concatenate([rows, column], axis=1)
        return Normal.of(rows)

    def linear(self) -> tuple[Floats, Normal]:
        """The weighted residuals here and their normal equations."""
        residual, jacobian = self.slopes()
        counts = self.counts
        return self.flat(residual, counts), self.normal(jacobian, counts)

    def weighted(self) -> Floats:
        """The weighted residuals alone."""
        return self.flat(self.residuals().T, self.counts)

    def moved(self, free: Indices, change: Floats) -> "FitState":
        """The state after a ``change`` of the ``free`` parameters."""
        step = np.zeros(len(PARAMETERS))
        step[free] = change
        camera, matrix = moved(self.camera, self.matrix, step)
        return replace(self, camera=camera, matrix=matrix)

    def descend(self, free: Indices) -> "FitState":
        """The state at the least squares over the ``free`` parameters.

        Levenberg-Marquardt; the derivatives are kept as long as the steps are small.
        """
        state, damping, fresh = self, 0.0, True
        # Undamped at first: near the minimum Gauss-Newton needs no damping.
        residual, everything = state.linear()
        normal = everything.only(free)
        cost = float(residual @ residual)
        for _ in range(STEPS):
            tried = state.moved(free, normal.step(residual, damping))
            left = tried.weighted()
            cost_tried = float(left @ left)
            # "not <=" also refuses a step to NaN.
            if not cost_tried <= cost * (1.0 + 1e-9):
                if fresh:
                    damping = max(10.0 * damping, 1e-3)
                    continue
                normal, fresh = state.linear()[1].only(free), True
                continue
            gain, far = cost - cost_tried, cost > FAR * cost_tried
            state, residual, cost, damping = tried, left, cost_tried, damping / 10.0
            if gain <= 1e-6 * cost + 1e-18 * len(residual):
                break
            if far:
                normal = state.linear()[1].only(free)
            fresh = far
        return state


# -- Which distortion terms the stars support --------------------------------------------------

Terms = tuple[str, ...]
LADDER: tuple[tuple[Terms, int], ...] = (
    (("k1",), 8),
    (("k1", "k2"), 14),  # they may hide each other
    (("k2",), 14),
    (("cx", "cy"), 14),  # every lens has an axis beside the middle; where it bends, that looks like p1 and p2
    (("k1",), 14),  # an axis far off the middle had hidden them
    (("k2",), 14),
    (("p1", "p2"), 18),
)
"""Terms tried one after the other, with the fewest stars that may support them."""
LARGEST_CHANCE = 1e-4
"""A term stays when chance alone would improve the fit as much with less than this probability."""
K1 = PARAMETERS.index("k1")


def columns(names: tuple[str, ...]) -> Indices:
    """Where parameters stand in :data:`PARAMETERS`."""
    return np.array([PARAMETERS.index(name) for name in names], dtype=np.intp)


def supported_terms(state: FitState, base: Indices, *, final: bool = True) -> tuple[Indices, FitState]:
    """``base`` and the terms that the inliers support, and the state at their optimum.

    Terms are tested to first order at the state, by residuals and then by those of stars that are
    held out where the fit is ``final``; the last ones are dropped again when they lead to an
    impossible camera.
    """
    residual, normal = state.linear()
    given = np.array([getattr(state.camera, t) - getattr(state.plain, t) for t in PARAMETERS[4:]])
    # Each term is judged against no distortion at all, or one already set could not be dropped.
    residual = residual + given @ normal.rows[4:]  # as if no term were set
    count, chosen = int(state.inliers.sum()), [base]
    pulls, square = (normal.rows @ residual) / normal.scale, float(residual @ residual)

    def remainder(free: Indices) -> float:
        """Sum of squares left after a linear step of these terms."""
        gradient = pulls.take(free)
        step = np.linalg.solve(normal.matrix.take(free, axis=0).take(free, axis=1), gradient)
        return max(square - float(step @ gradient), 1e-12 * square)

    now, held_out = remainder(base), None
    for names, fewest in LADDER:
        new = columns(names)
        known = chosen[-1].tolist()
        if count < fewest or any(k in known for k in new.tolist()) or (names == ("k2",) and K1 not in known):
            continue
        more = np.sort(np.append(chosen[-1], new))
        then = remainder(more)
        if chance(now, then, 2 * count - len(more)) >= LARGEST_CHANCE:
            continue
        # residuals fall with any term; those of stars that had no part in the fit only with a right one
        if final:
            before = held_out if held_out is not None else normal.only(chosen[-1]).held_out(residual)
            after = normal.only(more).held_out(residual)
            if chance(before, after, 2 * count - len(more)) >= LARGEST_CHANCE:
                continue
            held_out = after
        chosen.append(more)
        now = then
    # From the richest camera down to the first that is possible.
    for free in reversed(chosen[1:]):
        tried = _plain_but(state, free).descend(free)
        if sane(tried.camera) and centre_plausible(tried.camera, state.cropped):
            return free, tried
    return base, _plain_but(state, base).descend(base) if given.any() else state


def distortion_supported(state: FitState, free: Indices) -> bool:
    """Whether the stars support a distortion that was given and not fitted."""
    if state.plain == undistorted(state.plain):
        return True
    bent, flat = state.weighted(), without_distortion(state).descend(free).weighted()
    freedom = 2 * int(state.inliers.sum()) - len(free) - 1
    return chance(float(flat @ flat), float(bent @ bent), freedom) < LARGEST_CHANCE


def without_distortion(state: FitState) -> FitState:
    """The same without any distortion."""
    return replace(state, camera=undistorted(state.camera), plain=undistorted(state.plain))


def undistorted(camera: Camera) -> Camera:
    """The same camera without distortion, its axis in the frame's middle."""
    plain = type(camera).centred(camera.width, camera.height, camera.focal_px, camera.mirrored)
    return replace(plain, aspect=camera.aspect)


def _plain_but(state: FitState, free: Indices) -> FitState:
    """The state with the terms of the ladder that are not ``free`` as they were given."""
    names = [t for k, t in enumerate(PARAMETERS) if k >= 4 and k not in free]
    given = {name: getattr(state.plain, name) for name in names}
    return replace(state, camera=replace(state.camera, **given))


def off_axis(matches: Matches, camera: Camera, matrix: Floats) -> tuple[Camera, Floats]:
    """A camera without distortion whose axis is where the matches put it, and its attitude (3, 3): a first guess."""
    everyone = np.ones(len(matches))
    plain = undistorted(camera)
    state = FitState(plain, matrix, matches, everyone, everyone > 0.0, plain, everyone)
    state = state.descend(columns(("rx", "ry", "rz", "log_focal"))).descend(
        columns(("rx", "ry", "rz", "log_focal", "cx", "cy"))
    )
    return state.camera, state.matrix


def centre_plausible(camera: Camera, cropped: bool = False) -> bool:
    """Whether the principal point is inside the middle half of the frame; of a wide one, often a crop, two thirds.

    Of a frame that is tried as a ``cropped`` part of a larger one it may be a side away.
    """
    share = 1.0 if cropped else 1 / 3 if max(camera.width, camera.height) > camera.focal_px else 1 / 4
    middle_x, middle_y = (camera.width - 1) / 2, (camera.height - 1) / 2
    return abs(camera.cx - middle_x) < camera.width * share and abs(camera.cy - middle_y) < camera.height * share
