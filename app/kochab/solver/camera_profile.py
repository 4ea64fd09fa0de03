"""What the solved frames of a camera and lens say of them, kept on disk from night to night.

Autonomous calibration, named as future work in the thesis "Lost in space for robotic telescopes"
(2018), section 10.2: no chessboard, the stars themselves. Focal length, principal point and
distortion are one vector of seven; each frame says something of some of them, and how sure it is.
What a frame says is kept as information (the inverse of a covariance), which adds up: a direction
in which a frame says nothing, such as the principal point of a narrow field, adds nothing.
"""

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.linalg import LinAlgError

from kochab.attitude import FLOOR_PX, wahba
from kochab.attitude.least_squares import PARAMETERS, moved, project_with_jacobian
from kochab.core.arrays import Floats
from kochab.core.attitude import Attitude
from kochab.core.camera import PROJECTIONS, Camera
from kochab.core.errors import KochabError
from kochab.core.frame import Hint
from kochab.core.solution import Solution
from kochab.core.values import frozen
from kochab.folders import config_folder, file_stem
from kochab.frames.atomic_file import write_atomically
from kochab.identification.predictional_estimate import differential
from kochab.parsing.text_input import read_json
from kochab.text.translation import tr

TERMS = PARAMETERS[3:]
MEMORY_FRAMES = 400  # older frames fade, as the lens cools and errors are not all random
LEAST_CHANCE = 1e-6  # a frame this unlikely contradicts
NOTICED_PX = 0.5  # and it must move the stars by so much (RMS) to matter
FOCAL_FLOOR, CENTRE_FLOOR_PX = 1e-4, 0.3  # what refraction and temperature may do unnoticed
KNOWN_SCALE = 1.01


@frozen(eq=False)
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
        return (mine.width, mine.height, mine.mirrored) == (other.width, other.height, other.mirrored)


@frozen(eq=False)
class CameraEvidence:
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
    # a twentieth of focal length and side; at the corner a tenth by k1 and k2, a hundredth by p1 and p2
    loose = np.array([0.05, 0.05 * side, 0.05 * side, 0.1 / radius**2, 0.1 / radius**4, 0.01 / radius, 0.01 / radius])
    return Profile(name, camera, np.diag(loose**-2.0))


def evidence(profile: Profile, xy: Floats, vectors: Floats, attitude: Attitude, sigma_px: float) -> CameraEvidence:
    """What the stars of a frame say of a profile's camera.

    Parameters
    ----------
    profile : Profile
        The camera as known, and how well.
    xy : Floats
        Places of the stars (M, 2), px.
    vectors : Floats
        The same stars' ICRS unit vectors (M, 3).
    attitude : Attitude
        Near the frame's.
    sigma_px : float
        Error of a star's place along one coordinate, as its own frame's fit shows it.
    """
    matrix, _ = differential(profile.camera, attitude.matrix, xy, vectors, np.ones(len(xy)), steps=4)
    seen, slope = project_with_jacobian(profile.camera, vectors @ matrix.T)
    residual, jacobian = (xy - seen).ravel(), slope.reshape(-1, len(PARAMETERS))
    weight = 1.0 / max(sigma_px, 0.02) ** 2
    turn, terms = jacobian[:, :3], jacobian[:, 3:]
    shared = np.linalg.solve(turn.T @ turn, turn.T @ terms)
    free = terms - turn @ shared  # what no turn of the camera can do
    information = weight * (free.T @ free)
    vector = weight * (free.T @ residual)
    # a thousandth of what is known holds still what this frame says nothing of
    change = np.linalg.solve(information + profile.information * 1e-3, vector)
    moves = (free @ change).reshape(-1, 2)
    return CameraEvidence(
        information,
        vector,
        _chance(profile, information, vector),
        float(np.sqrt(np.mean(np.sum(moves**2, axis=1)))),
        profile.camera.focal_px * float(np.exp(np.clip(change[0], -1.0, 1.0))),
    )


def updated_profile(profile: Profile, new: CameraEvidence) -> Profile:
    """The profile with one more frame: the mean of both, each weighted by its information."""
    keep = 1.0 - 1.0 / MEMORY_FRAMES if profile.frames >= MEMORY_FRAMES else 1.0
    information = keep * profile.information + new.information
    change = np.zeros(len(PARAMETERS))
    # at its own camera the profile pulls nowhere: its part of the sum is zero
    change[3:] = np.linalg.solve(information, new.vector)
    camera, _ = moved(profile.camera, np.eye(3), change)
    return replace(profile, camera=camera, information=information, frames=profile.frames + 1)


def doubt(profile: Profile, new: CameraEvidence) -> str:
    """One sentence for a frame that contradicts, "" for one that agrees."""
    if not new.contradicts:
        return ""
    sigma = profile.sigma["focal_px"]
    return tr(
        "Your camera profile is off: focal length {here:.1f} px in this frame, {known:.1f} ± {sigma:.1f} px in the"
        " profile; stars would be {shift:.1f} px off.",
        here=new.focal_px,
        known=profile.camera.focal_px,
        sigma=sigma,
        shift=new.shift_px,
    )


def _chance(profile: Profile, information: Floats, vector: Floats) -> float:
    """How likely ``vector`` is when the profile's camera is right within its own uncertainty."""
    from scipy.special import chdtrc  # scipy.stats takes two seconds to load

    floor = np.zeros(len(TERMS))
    floor[:3] = FOCAL_FLOOR**2, CENTRE_FLOOR_PX**2, CENTRE_FLOOR_PX**2
    spread = profile.covariance + np.diag(floor)
    # of the vector, when its noise and the profile's own error are as they say
    covariance = information + information @ spread @ information
    # on one scale, as pixels and k2 lie decades apart; then only directions that the frame says anything of
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    values, axes = np.linalg.eigh(covariance / np.outer(scale, scale))
    solid = values > 1e-9 * values[-1]
    along = (axes.T @ (vector / scale))[solid]
    return float(chdtrc(int(solid.sum()), float(np.sum(along**2 / values[solid]))))


# -- Camera profiles on disk: one JSON file for each camera, lens and size of frame ------------

PROFILE_FORMAT = 1
_DAMAGED = (OSError, ValueError, LookupError, TypeError, AttributeError, ArithmeticError, LinAlgError)
"""What comes of reading a file that holds other things than it should."""


def profile_folder() -> Path:
    """Where profiles lie: below ``KOCHAB_CONFIG``, or in the user's own configuration."""
    return config_folder() / "cameras"


def profile_path(name: str, width: int, height: int, folder: Path | None = None) -> Path:
    """The file of a camera of that name with frames of that size.

    Parameters
    ----------
    name : str
        What the person calls the camera.
    width, height : int
        Size of its frames, px.
    folder : Path or None
        Where profiles lie; None: among the person's settings.
    """
    plain, mark = file_stem(name, "camera")
    return (folder or profile_folder()) / f"{plain}-{width}x{height}-{mark}.json"


def save_profile(profile: Profile, folder: Path | None = None) -> Path:
    """Write a profile, whole or not at all.

    Raises
    ------
    KochabError
        It cannot be written.

    """
    camera = profile.camera
    path = profile_path(profile.name, camera.width, camera.height, folder)
    content: dict[str, Any] = {
        "format": PROFILE_FORMAT,
        "name": profile.name,
        "frames": profile.frames,
        "projection": camera.projection,
        "camera": asdict(camera),
        "sigma": profile.sigma,
        "terms": list(TERMS),
        "information": profile.information.tolist(),
    }
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, json.dumps(content, indent=1))
    except OSError as error:
        raise KochabError(
            "The camera profile cannot be saved in {parent}: {strerror}.", parent=path.parent, strerror=error.strerror
        ) from error
    return path


def load_profile(name: str, width: int, height: int, folder: Path | None = None) -> Profile | None:
    """The profile kept for a camera, or None when there is none.

    Parameters
    ----------
    name : str
        What the person calls the camera.
    width, height : int
        Size of its frames, px.
    folder : Path or None
        Where profiles lie; None: among the person's settings.

    Raises
    ------
    KochabError
        There is a file, and it cannot be read as one.
    """
    path = profile_path(name, width, height, folder)
    if not path.exists():
        return None
    try:
        content = read_json(path)
        information = np.array(content["information"], dtype=np.float64)
        camera = PROJECTIONS[content.get("projection", Camera.projection)](**content["camera"])
        profile = Profile(name, camera, information, int(content["frames"]))
        if content["terms"] != list(TERMS) or information.shape != (len(TERMS), len(TERMS)):
            raise ValueError("other terms")
        if (camera.width, camera.height) != (width, height) or content["name"] != name:
            raise ValueError("another camera")
        # raises unless every direction has some information, and none a negative one
        np.linalg.cholesky(information)
        numbers = [*asdict(camera).values(), *profile.sigma.values()]
        if not np.isfinite(numbers).all() or camera.focal_px <= 0.0 or profile.frames < 0:
            raise ValueError("numbers that no camera has")
        return profile
    except _DAMAGED as error:
        raise KochabError("{path} is not a camera profile; delete it to start a new one.", path=path) from error


# -- The tracker's camera: better with every frame, and doubted when a frame contradicts it ----

FEWEST = 8  # stars, so that a frame has something to say beside the pointing
MOST_CONTRADICTIONS = 3  # in a row, then the profile starts anew


class TrackedCamera:
    """Holds the profile that frames are read with and that they improve.

    ``profile`` is what was kept from earlier nights, None when nothing is known; ``camera`` is what
    the next frame is to be read with, None before the first.
    """

    def __init__(self, profile: Profile | None = None) -> None:
        self.profile = profile
        self.camera: Camera | None = None
        self.contradicted = 0

    def begin(self, solution: Solution, name: str) -> str:
        """Take a camera from a frame solved as a whole; a doubt about the profile, or ""."""
        if self.profile is None or not self.profile.suits(solution.camera):
            self.profile = new_profile(name or "camera", solution.camera)
            self.contradicted = 0
        # the RMS is of lengths, the sigma of one coordinate
        sigma = solution.rms_px / float(np.sqrt(2.0))
        sentence = self.learn(solution.stars_px, solution.star_vectors, solution.attitude, sigma)
        # a frame that contradicts the profile tracks with what it was solved with
        self.camera = solution.camera if sentence else self.profile.camera
        return sentence

    def learn(self, xy: Floats, vectors: Floats, attitude: Attitude, sigma_px: float) -> str:
        """Improve the profile by M stars of a frame; returns a doubt about it, or "".

        Parameters
        ----------
        xy : Floats
            Places of the stars (M, 2), px.
        vectors : Floats
            The same stars' ICRS unit vectors (M, 3).
        attitude : Attitude
            Near the frame's.
        sigma_px : float
            Error of a star's place along one coordinate.
        """
        assert self.profile is not None
        if len(xy) < FEWEST:
            return ""
        new = evidence(self.profile, xy, vectors, attitude, max(sigma_px, FLOOR_PX))
        sentence = doubt(self.profile, new)
        if not sentence:
            self.contradicted = 0
            self.profile = updated_profile(self.profile, new)
            self.camera = self.profile.camera
            return ""
        self.contradicted += 1
        if self.contradicted >= MOST_CONTRADICTIONS:
            fresh = new_profile(self.profile.name, self.camera or self.profile.camera)
            self.profile = updated_profile(fresh, evidence(fresh, xy, vectors, attitude, sigma_px))
            self.camera, self.contradicted = self.profile.camera, 0
        return sentence


def turn_between(before: Camera, after: Camera) -> Floats:
    """The rotation (3, 3) from the axes of one camera model to those of another.

    Two models of one lens may differ in their principal point, and then in where their axes are,
    though they put the same stars on the same pixels.
    """
    x, y = np.meshgrid(np.linspace(0, before.width - 1.0, 5), np.linspace(0, before.height - 1.0, 5))
    grid = np.stack([x.ravel(), y.ravel()], axis=1)
    return wahba(after.unproject(grid), before.unproject(grid)).matrix
