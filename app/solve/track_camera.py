"""The tracker's camera: better with every frame, and doubted when a frame contradicts it."""

import numpy as np
from numpy.typing import NDArray

from app.attitude.measured import FLOOR_PX
from app.attitude.wahba import wahba
from app.core.attitude import Attitude, unit_vectors
from app.core.camera import Camera
from app.core.solution import Solution
from app.solve.profiles import Profile, absorbed, doubt, evidence, new_profile

Floats = NDArray[np.float64]

FEWEST = 8  # stars, so that a frame has something to say beside the pointing
STUBBORN = 3  # so many contradicting frames in a row, and the profile begins anew


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
        xy = np.array([(star.x, star.y) for star in solution.stars]).reshape(-1, 2)
        places = np.array([(star.ra_deg, star.dec_deg) for star in solution.stars]).reshape(-1, 2)
        vectors = unit_vectors(places[:, 0], places[:, 1])
        sigma = solution.rms_px / float(np.sqrt(2.0))
        sentence = self.learn(xy, vectors, solution.attitude, sigma)
        self.camera = solution.camera if sentence else self.profile.camera
        return sentence

    def learn(self, xy: Floats, vectors: Floats, attitude: Attitude, sigma_px: float) -> str:
        """Improve the profile by M stars of a frame; returns a doubt about it, or ""."""
        assert self.profile is not None
        if len(xy) < FEWEST:
            return ""
        told = evidence(self.profile, xy, vectors, attitude, max(sigma_px, FLOOR_PX))
        sentence = doubt(self.profile, told)
        if not sentence:
            self.contradicted = 0
            self.profile = absorbed(self.profile, told)
            self.camera = self.profile.camera
            return ""
        self.contradicted += 1
        if self.contradicted >= STUBBORN:
            fresh = new_profile(self.profile.name, self.camera or self.profile.camera)
            self.profile = absorbed(fresh, evidence(fresh, xy, vectors, attitude, sigma_px))
            self.camera, self.contradicted = self.profile.camera, 0
        return sentence


def turn_between(before: Camera, after: Camera) -> Floats:
    """The rotation (3, 3) from the axes of one camera model to those of another.

    Two models of one lens may differ in their principal point, and then in where their axes are,
    though they put the same stars on the same pixels.
    """
    if before == after:
        return np.eye(3)
    x, y = np.meshgrid(
        np.linspace(0, before.width - 1.0, 5), np.linspace(0, before.height - 1.0, 5)
    )
    grid = np.stack([x.ravel(), y.ravel()], axis=1)
    return wahba(after.unproject(grid), before.unproject(grid)).matrix
