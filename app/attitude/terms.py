"""Which terms of a camera's distortion the stars ask for."""

from dataclasses import replace

import numpy as np

from app.attitude.descent import State
from app.attitude.normal import Indices, chance
from app.attitude.projection import PARAMETERS, sane
from app.core.camera import Camera

LADDER: tuple[tuple[tuple[str, ...], int], ...] = (
    (("k1",), 8),
    (("k2",), 14),
    (("cx", "cy"), 14),
    (("p1", "p2"), 18),
)
"""Terms tried one after the other, each with the fewest stars that may speak for it."""
LARGEST_CHANCE = 1e-4
"""A term stays when chance alone would improve the fit as much with less than this probability."""
K1 = PARAMETERS.index("k1")


def columns(names: tuple[str, ...]) -> Indices:
    """Where parameters stand in :data:`PARAMETERS`."""
    return np.array([PARAMETERS.index(name) for name in names], dtype=np.intp)


def supported(state: State, base: Indices) -> tuple[Indices, State]:
    """``base`` and the terms that the inliers ask for, and the state at their optimum.

    Terms are judged to first order from where the state is; the last ones are given up again
    when the camera they lead to is none.
    """
    residual, normal = state.linear()
    given = np.array([getattr(state.camera, t) - getattr(state.plain, t) for t in PARAMETERS[4:]])
    residual = residual + given @ normal.rows[4:]  # as if no term were set
    count, chosen = int(state.inliers.sum()), [base]
    now = normal.only(base).remainder(residual)
    for names, fewest in LADDER:
        if count < fewest or (names == ("k2",) and K1 not in chosen[-1]):
            continue
        more = np.sort(np.append(chosen[-1], columns(names)))
        then = normal.only(more).remainder(residual)
        if chance(now, then, 2 * count - len(more)) < LARGEST_CHANCE:
            chosen.append(more)
            now = then
    for free in reversed(chosen[1:]):
        tried = _plain_but(state, free).descend(free)
        if sane(tried.camera) and _centre_plausible(tried.camera):
            return free, tried
    return base, _plain_but(state, base).descend(base) if given.any() else state


def earned(state: State, free: Indices) -> bool:
    """Whether a distortion that was given, and not fitted, is one that the stars ask for."""
    if not state.plain.distorted:
        return True
    bent, flat = state.weighted(), straight(state).descend(free).weighted()
    freedom = 2 * int(state.inliers.sum()) - len(free) - 1
    return chance(float(flat @ flat), float(bent @ bent), freedom) < LARGEST_CHANCE


def straight(state: State) -> State:
    """The same without any distortion."""
    return replace(state, camera=straightened(state.camera), plain=straightened(state.plain))


def straightened(camera: Camera) -> Camera:
    """The same camera without distortion."""
    return replace(camera, k1=0.0, k2=0.0, p1=0.0, p2=0.0) if camera.distorted else camera


def _plain_but(state: State, free: Indices) -> State:
    """The state with the terms of the ladder that are not ``free`` as they were given."""
    names = [t for k, t in enumerate(PARAMETERS) if k >= 4 and k not in free]
    given = {name: getattr(state.plain, name) for name in names}
    return replace(state, camera=replace(state.camera, **given))


def _centre_plausible(camera: Camera) -> bool:
    """Whether the principal point is inside the frame's middle half."""
    middle_x, middle_y = (camera.width - 1) / 2, (camera.height - 1) / 2
    return abs(camera.cx - middle_x) < camera.width / 4 and (
        abs(camera.cy - middle_y) < camera.height / 4
    )
