"""The axis as the camera sees it: one place in the frame that stays while RA turns, and what moved when it does not.

An attitude R takes the camera's c to the axis a on the ground, ``R_k c = a``, whatever the turn: two equations a frame
for four unknowns, which is the fit of :mod:`kochab.polar.axis_fit` with turns and reference left out (the residual
across the axis, weighted with its own covariance, is what is left of chi-square at the best turn). What moves
between two frames moves one side of it alone: declination takes c away from the boresight, a camera in its holder
takes it around, a knock on the tube does both, and a kicked tripod or a turned bolt moves a and leaves c.
"""

import math
from collections.abc import Sequence
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Floats
from kochab.core.attitude import angle_between, cross_product, rotation_vectors
from kochab.core.values import frozen, mutable
from kochab.polar.rotations import about, tangents, wrapped_rad
from kochab.polar.sighting import LocalAttitude


class Cause(StrEnum):
    """What may have moved between two frames, or that one frame alone is wrong."""

    DECLINATION = "declination"
    CAMERA = "camera"
    TUBE = "tube"
    MOUNT = "mount"
    FRAME = "frame"


UNKNOWNS = {Cause.DECLINATION: 1, Cause.CAMERA: 1, Cause.TUBE: 2, Cause.MOUNT: 2, Cause.FRAME: 2}
CONE_RAD = np.radians(
    3.0
)  # declination takes c away from where the tube looks, not to a hair from where the camera does
MOST_CONE_RAD = np.radians(15.0)
STEPS, SMALLEST_RAD = 20, 1e-9
LEAST_SIN = 1e-6  # nearer to the boresight than that the axis has no side


@frozen(eq=False)
class MovementFit:
    """The axis if ``cause`` moved once, after frame ``after`` (counted from 0; of a wrong frame, its own number).

    ``axis`` (3,), E, N, U, and ``covariance`` (2, 2), rad^2, along (altitude, azimuth on the sky) are those of the last
    frame; ``camera_covariance`` (3, 3), rad^2, that of the axis as the later frames' camera sees it. ``angle_rad`` is
    the movement, ``sigma_rad`` what its unknowns are known to, one sigma each (infinite where not at all), and
    ``undo`` (3, 3) takes the earlier frames to the later ones: in the camera, or on the ground for the mount. A knock
    may look like declination, or the camera in its holder, of a tube and a camera that are not quite parallel.
    """

    cause: Cause
    after: int
    axis: Floats
    covariance: Floats
    camera_covariance: Floats
    angle_rad: float
    sigma_rad: Floats
    chi2: float
    undo: Floats
    looks_like: Cause


@mutable(eq=False)
class _State:
    """Axis on the ground, later and earlier; its distance from the boresight and its side in the camera, the same."""

    axes: list[Floats]
    rho: list[float]
    side: list[float]

    def places(self) -> tuple[Floats, Floats, Floats]:
        """Where the camera sees the axis (2, 3), and unit vectors away from the boresight and around it (2, 3)."""
        place, outward, around = np.empty((2, 3)), np.empty((2, 3)), np.empty((2, 3))
        for k, (rho, side) in enumerate(zip(self.rho, self.side, strict=True)):
            x, y, away, near = math.cos(side), math.sin(side), math.sin(rho), math.cos(rho)
            place[k] = away * x, away * y, near
            outward[k] = near * x, near * y, -away
            around[k] = -y, x, 0.0
        return place, outward, around


def fit_with_movement(attitudes: Sequence[LocalAttitude], towards: Floats) -> list[MovementFit]:
    """The best fit of each cause after each frame but the last, and of each frame between others left out."""
    matrices = np.stack([a.matrix for a in attitudes])
    covariances = np.stack([a.covariance for a in attitudes])
    count = len(attitudes)
    number, everywhere = np.arange(count), (Cause.DECLINATION, Cause.CAMERA, Cause.TUBE, Cause.MOUNT)
    splits: list[tuple[tuple[Cause, ...], int, NDArray[np.bool_]]] = [
        (everywhere, after, number <= after) for after in range(count - 1)
    ]
    splits += [((Cause.FRAME,), alone, number == alone) for alone in range(1, count - 1)]
    found = []
    for causes, after, early in splits:
        turns = [_most_turned(side) for side in (matrices[~early], matrices[early])]
        found += [_fitted(cause, after, early, turns, matrices, covariances, towards) for cause in causes]
    return found


def _fitted(
    cause: Cause,
    after: int,
    early: NDArray[np.bool_],
    turns: Sequence[Floats],
    matrices: Floats,
    covariances: Floats,
    towards: Floats,
) -> MovementFit:
    """Gauss-Newton from the side of the gap whose frames turned further."""
    state, which = _start(cause, early, turns, matrices, towards), early.astype(np.intp)
    for _ in range(STEPS):
        residual, jacobian = _linear(cause, state, which, matrices, covariances)
        step = np.asarray(np.linalg.lstsq(jacobian, -residual, rcond=None)[0], dtype=np.float64)
        _move(cause, state, step)
        if np.abs(step).max() < SMALLEST_RAD:
            break
    return _concluded(cause, after, state, which, matrices, covariances)


def _start(
    cause: Cause, early: NDArray[np.bool_], turns: Sequence[Floats], matrices: Floats, towards: Floats
) -> _State:
    sides = [matrices[~early], matrices[early]]
    surer = int(np.linalg.norm(turns[1]) > np.linalg.norm(turns[0])) if cause is not Cause.FRAME else 0
    axis = turns[surer] / max(float(np.linalg.norm(turns[surer])), 1e-12)
    axis = axis if axis @ towards > 0 else -axis
    polar = [_polar((np.swapaxes(side, 1, 2) @ axis).mean(axis=0)) for side in sides]
    state = _State([axis, axis], [p[0] for p in polar], [p[1] for p in polar])
    if cause is Cause.MOUNT:
        other = 1 - surer
        state.rho[other], state.side[other] = polar[surer]
        place = state.places()[0][surer]
        there = (sides[other] @ place).mean(axis=0)
        state.axes[other] = there / np.linalg.norm(there)
    elif cause is Cause.DECLINATION:
        # over the boresight and beyond it is a distance below zero, on the same side
        turned = wrapped_rad(state.side[1 - surer] - state.side[surer])
        if abs(turned) > np.pi / 2.0:
            state.rho[1 - surer] = -state.rho[1 - surer]
        state.side[1 - surer] = state.side[surer]
    elif cause is Cause.CAMERA:
        state.rho[1 - surer] = state.rho[surer]
    return state


def _most_turned(matrices: Floats) -> Floats:
    """The rotation vector (3,) of the largest turn from the first or from the last to another."""
    vectors = np.concatenate([rotation_vectors(matrices @ matrices[k].T) for k in (0, -1)])
    return np.asarray(vectors[np.linalg.norm(vectors, axis=1).argmax()])


def _polar(place: Floats) -> tuple[float, float]:
    return float(np.arctan2(np.hypot(place[0], place[1]), place[2])), float(np.arctan2(place[1], place[0]))


def _linear(
    cause: Cause, state: _State, which: NDArray[np.intp], matrices: Floats, covariances: Floats
) -> tuple[Floats, Floats]:
    """Weighted residuals (2 N,) and Jacobian: axis (2), distance and side in the camera, then what moved."""
    places, outward, around = (each[which] for each in state.places())
    bases = np.array([tangents(axis) for axis in state.axes]).swapaxes(1, 2)
    across = np.stack([outward, around], axis=1)  # (N, 2, 3)
    seen = np.einsum("kji,kj->ki", matrices, np.array(state.axes)[which])
    residual = np.einsum("kij,kj->ki", across, seen - places)
    # a small rotation of the camera, v, moves what it sees by -v x c
    noisy = np.stack([around, -outward], axis=1)  # places x outward, places x around
    whiten = np.linalg.inv(np.linalg.cholesky(noisy @ covariances @ np.swapaxes(noisy, 1, 2)))
    by_axis = across @ np.swapaxes(matrices, 1, 2) @ bases[which]
    by_place = np.zeros((len(which), 2, 2))
    by_place[:, 0, 0] = -1.0
    by_place[:, 1, 1] = -np.sin(np.array(state.rho))[which]
    early = which.astype(np.float64)[:, None, None]
    columns = [by_axis * (1.0 - early) if cause is Cause.MOUNT else by_axis]
    columns += [by_place * (1.0 - early) if cause in (Cause.TUBE, Cause.FRAME) else by_place]
    if cause is Cause.MOUNT:
        columns.append(by_axis * early)
    elif cause is Cause.DECLINATION:
        columns.append(by_place[:, :, :1] * early)
    elif cause is Cause.CAMERA:
        columns.append(by_place[:, :, 1:] * early)
    else:
        columns.append(by_place * early)
    jacobian = whiten @ np.concatenate(columns, axis=2)
    return np.einsum("kij,kj->ki", whiten, residual).ravel(), jacobian.reshape(2 * len(which), -1)


def _move(cause: Cause, state: _State, step: Floats) -> None:
    def moved(axis: Floats, by: Floats) -> Floats:
        upward, clockwise = tangents(axis)
        there = axis + by[0] * upward + by[1] * clockwise
        return np.asarray(there / np.linalg.norm(there))

    more = np.clip(step, -0.5, 0.5)
    state.axes[0] = moved(state.axes[0], more[:2])
    state.axes[1] = moved(state.axes[1], more[4:6]) if cause is Cause.MOUNT else state.axes[0]
    state.rho[0] += float(more[2])
    state.side[0] += float(more[3])
    if cause in (Cause.MOUNT, Cause.CAMERA):
        state.rho[1] += float(more[2])
    if cause in (Cause.MOUNT, Cause.DECLINATION):
        state.side[1] += float(more[3])
    if cause is Cause.DECLINATION:
        state.rho[1] += float(more[2] + more[4])
    elif cause is Cause.CAMERA:
        state.side[1] += float(more[3] + more[4])
    elif cause is not Cause.MOUNT:
        state.rho[1] += float(more[4])
        state.side[1] += float(more[5])


def _concluded(
    cause: Cause, after: int, state: _State, which: NDArray[np.intp], matrices: Floats, covariances: Floats
) -> MovementFit:
    residual, jacobian = _linear(cause, state, which, matrices, covariances)
    whole: Floats = np.asarray(np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-14, hermitian=True), dtype=np.float64)
    places, outward, around = state.places()
    in_camera = np.stack([outward[0], around[0] * np.sin(state.rho[0])], axis=1)
    return MovementFit(
        cause,
        after,
        state.axes[0],
        whole[:2, :2],
        in_camera @ whole[2:4, 2:4] @ in_camera.T,
        *_movement(cause, state, places, whole),
        chi2=float(residual @ residual),
        undo=_undone(cause, state, places),
        looks_like=_looks_like(state) if cause is Cause.TUBE else cause,
    )


def _looks_like(state: _State) -> Cause:
    away, sine = state.rho[1] - state.rho[0], float(np.sin((state.rho[0] + state.rho[1]) / 2.0))
    way = float(np.arctan2(abs(wrapped_rad(state.side[1] - state.side[0]) * sine), abs(away)))
    cone = min(CONE_RAD / max(abs(sine), LEAST_SIN), MOST_CONE_RAD)
    if way < cone:
        return Cause.DECLINATION
    return Cause.CAMERA if way > np.pi / 2.0 - CONE_RAD else Cause.TUBE


def _movement(cause: Cause, state: _State, places: Floats, whole: Floats) -> tuple[float, Floats]:
    """How far it moved, and one sigma of each of its unknowns, radians."""
    sine = max(abs(float(np.sin(state.rho[1]))), LEAST_SIN)
    if cause is Cause.DECLINATION:
        return state.rho[1] - state.rho[0], np.sqrt(whole[4:5, 4])
    if cause is Cause.CAMERA:
        return wrapped_rad(state.side[1] - state.side[0]), np.sqrt(whole[4:5, 4])
    if cause is Cause.MOUNT:
        # of the difference of both axes; their tangents are alike where the movement is small
        spread = whole[4:6, 4:6] + whole[:2, :2] - whole[4:6, :2] - whole[:2, 4:6]
        return angle_between(*state.axes), np.sqrt(np.maximum(np.linalg.eigvalsh(spread), 0.0))
    scale = np.diag([1.0, sine])
    spread = scale @ (whole[4:6, 4:6] + whole[2:4, 2:4] - whole[4:6, 2:4] - whole[2:4, 4:6]) @ scale
    return angle_between(*places), np.sqrt(np.maximum(np.linalg.eigvalsh(spread), 0.0))


def _undone(cause: Cause, state: _State, places: Floats) -> Floats:
    """What the earlier frames have to be turned by: after their camera, or before it for the mount."""
    if cause is Cause.MOUNT:
        return _between(state.axes[1], state.axes[0])
    if cause is Cause.CAMERA:
        turn = state.side[1] - state.side[0]
        cosine, sine = np.cos(turn), np.sin(turn)
        return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return _between(places[0], places[1])


def _between(one: Floats, other: Floats) -> Floats:
    """The shortest rotation (3, 3) that takes a unit vector to another."""
    across = cross_product(one, other)
    length = float(np.linalg.norm(across))
    return about(across / length, angle_between(one, other)) if length > 1e-12 else np.eye(3)
