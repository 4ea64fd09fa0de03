"""What is known of a camera and its lens, from every frame it ever solved.

Autonomous calibration, named as future work in the thesis "Lost in space for robotic telescopes"
(2018), section 10.2: no chessboard, the stars themselves. Focal length, principal point and
distortion are one vector of seven; each frame says something of some of them, and how sure it is.
What a frame says is kept as information (the inverse of a covariance), which adds up: a direction
in which a frame says nothing, such as the principal point of a narrow field, adds nothing.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.attitude.projection import PARAMETERS, moved, project_with_jacobian
from app.attitude.wahba import small_rotation
from app.core.attitude import Attitude
from app.core.camera import Camera
from app.core.hint import Hint

Floats = NDArray[np.float64]

TERMS = PARAMETERS[3:]
MEMORY_FRAMES = 400  # older frames fade, as the lens cools and errors are not all random
LEAST_CHANCE = 1e-6  # a frame this unlikely contradicts
NOTICED_PX = 0.5  # and it has to matter
FOCAL_FLOOR, CENTRE_FLOOR_PX = 1e-4, 0.3  # what refraction and temperature may do unnoticed
KNOWN_SCALE = 1.01


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """A camera with its uncertainty, after ``frames`` frames.

    ``information`` (7, 7) is of :data:`TERMS`: ln focal length, cx, cy px, k1, k2, p1, p2.
    """

    name: str
    camera: Camera
    information: Floats
    frames: int = 0

    @property
    def covariance(self) -> Floats:
        """Of :data:`TERMS` (7, 7)."""
        return np.asarray(np.linalg.inv(self.information), dtype=np.float64)

    @property
    def sigma(self) -> dict[str, float]:
        """One-sigma error of every term, by the camera's own names; ``focal_px`` in px."""
        values = dict(zip(TERMS, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))
        return {"focal_px": values.pop("log_focal") * self.camera.focal_px, **values}

    @property
    def hint(self) -> Hint:
        """The scale as a solver may be told it."""
        focal = self.sigma["focal_px"] / self.camera.focal_px
        factor = max(KNOWN_SCALE, 1.0 + 5.0 * focal)
        scale = self.camera.scale_arcsec_px
        return Hint(scale_arcsec_px=(scale / factor, scale * factor), source="profile")

    def suits(self, camera: Camera) -> bool:
        """Whether a camera's frames are of this one's size and parity."""
        mine, other = self.camera, camera
        return (mine.width, mine.height, mine.mirrored) == (
            other.width, other.height, other.mirrored,
        )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """What one frame says: ``information`` (7, 7) and its product with the change it wants (7,).

    The change is against the profile's camera. ``chance`` is how likely so large a change is if the
    profile is right; ``shift_px`` how far it moves the stars of this frame after the best turn.
    """

    information: Floats
    vector: Floats
    chance: float
    shift_px: float
    focal_px: float

    @property
    def contradicts(self) -> bool:
        """Whether the frame says that the profile is wrong."""
        return self.chance < LEAST_CHANCE and self.shift_px > NOTICED_PX


def new_profile(name: str, camera: Camera) -> Profile:
    """A profile that knows nothing yet: the first frame's camera, and wide bounds around it."""
    radius = float(np.hypot(camera.width, camera.height)) / 2.0 / camera.focal_px
    side = float(max(camera.width, camera.height))
    loose = np.array([
        0.05, 0.05 * side, 0.05 * side,
        0.1 / radius**2, 0.1 / radius**4, 0.01 / radius, 0.01 / radius,
    ])  # fmt: skip
    return Profile(name, camera, np.diag(loose**-2.0))


def evidence(
    profile: Profile, xy: Floats, vectors: Floats, attitude: Attitude, sigma_px: float
) -> Evidence:
    """What M stars at ``xy`` (M, 2) px, ICRS ``vectors`` (M, 3), say of a profile's camera.

    ``attitude`` is near the frame's; ``sigma_px`` the error of a star's place along one coordinate,
    as its own frame's fit shows it.
    """
    residual, jacobian = _at_best_turn(profile.camera, xy, vectors, attitude.matrix)
    weight = 1.0 / max(sigma_px, 0.02) ** 2
    turn, terms = jacobian[:, :3], jacobian[:, 3:]
    shared = np.linalg.solve(turn.T @ turn, turn.T @ terms)
    free = terms - turn @ shared  # what no turn of the camera can do
    information = weight * (free.T @ free)
    vector = weight * (free.T @ residual)
    change = np.linalg.solve(information + profile.information * 1e-3, vector)
    moves = (free @ change).reshape(-1, 2)
    return Evidence(
        information, vector, _chance(profile, information, vector),
        float(np.sqrt(np.mean(np.sum(moves**2, axis=1)))),
        profile.camera.focal_px * float(np.exp(np.clip(change[0], -1.0, 1.0))),
    )  # fmt: skip


def absorbed(profile: Profile, told: Evidence) -> Profile:
    """The profile with one more frame: the mean of both, each weighted by its information."""
    keep = 1.0 - 1.0 / MEMORY_FRAMES if profile.frames >= MEMORY_FRAMES else 1.0
    information = keep * profile.information + told.information
    change = np.zeros(len(PARAMETERS))
    change[3:] = np.linalg.solve(information, told.vector)
    camera, _ = moved(profile.camera, np.eye(3), change)
    return replace(profile, camera=camera, information=information, frames=profile.frames + 1)


def doubt(profile: Profile, told: Evidence) -> str:
    """One sentence for a frame that contradicts, "" for one that agrees."""
    if not told.contradicts:
        return ""
    sigma = profile.sigma["focal_px"]
    return (
        f"Your camera profile is off: this frame says a focal length of {told.focal_px:.1f} px, "
        f"the profile {profile.camera.focal_px:.1f} +- {sigma:.1f} px; stars would be "
        f"{told.shift_px:.1f} px from their places."
    )


def _at_best_turn(
    camera: Camera, xy: Floats, vectors: Floats, matrix: Floats
) -> tuple[Floats, Floats]:
    """Residuals (2 M,) px and slopes (2 M, 10) where turning alone can do no more."""
    for _ in range(4):
        seen, slope = project_with_jacobian(camera, vectors @ matrix.T)
        residual, flat = (xy - seen).ravel(), slope.reshape(-1, len(PARAMETERS))
        turn = flat[:, :3]
        step = np.asarray(np.linalg.solve(turn.T @ turn, turn.T @ residual), dtype=np.float64)
        if float(np.abs(step).max()) < 1e-10:
            break
        matrix = small_rotation(step) @ matrix
    return residual, flat


def _chance(profile: Profile, information: Floats, vector: Floats) -> float:
    """How likely ``vector`` is when the profile's camera is right within its own uncertainty."""
    from scipy.stats import chi2

    floor = np.zeros(len(TERMS))
    floor[:3] = FOCAL_FLOOR**2, CENTRE_FLOOR_PX**2, CENTRE_FLOOR_PX**2
    spread = profile.covariance + np.diag(floor)
    covariance = information + information @ spread @ information
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    values, axes = np.linalg.eigh(covariance / np.outer(scale, scale))
    solid = values > 1e-9 * values[-1]
    along = (axes.T @ (vector / scale))[solid]
    return float(chi2.sf(float(np.sum(along**2 / values[solid])), int(solid.sum())))
