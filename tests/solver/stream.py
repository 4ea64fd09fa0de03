"""A moving camera over the shipped catalogue: frames, their times and where it truly points."""

from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from functools import lru_cache

import numpy as np

from kochab.attitude.filter import predicted
from kochab.core.attitude import attitude_from, rotation_vector, small_rotation
from kochab.core.camera import Camera
from kochab.core.frame import Hint
from kochab.simulate.star_images import RenderedStar, Sensor, Sky, render
from kochab.sky import open_catalogue
from kochab.solver.camera_profile import turn_between

START = datetime(2026, 1, 10, 20, 0, tzinfo=UTC)
YEAR = 2026.0
ARCSEC = np.radians(1 / 3600)


def wide_camera(width: int = 640, height: int = 480, fov_deg: float = 12.0, **terms) -> Camera:
    focal = width / 2 / np.tan(np.radians(fov_deg / 2))
    return replace(Camera.centred(width, height, focal), **terms)


@lru_cache(maxsize=4)
def bright_sky(count: int = 30000):
    catalogue = open_catalogue()
    rows = catalogue.brightest(np.array([0.0, 0.0, 1.0]), np.pi, count, YEAR)
    return catalogue.vectors(rows, YEAR), catalogue.mag(rows)


@dataclass
class Stream:
    """``step(rate)`` turns the camera and returns the next frame; ``error(attitude)`` judges."""

    camera: Camera = field(default_factory=wide_camera)
    dt_s: float = 0.1
    exposure_s: float = 0.02
    bayer: str | None = None
    level_e: float = 60.0
    hot_per_mp: float = 0.0
    matrix: np.ndarray = field(default_factory=lambda: attitude_from(84.0, -2.0, 25.0).matrix)
    number: int = 0

    @property
    def moment(self) -> datetime:
        return START + timedelta(seconds=self.number * self.dt_s)

    def step(self, rate_deg_s=(0.0, 0.0, 0.0), *, light: float = 1.0):
        self.number += 1
        rate = np.radians(rate_deg_s)
        self.matrix = small_rotation(-rate * self.dt_s) @ self.matrix
        return self.frame(rate, light)

    def frame(self, rate=(0.0, 0.0, 0.0), light: float = 1.0):
        vectors, mag = bright_sky()
        near = vectors @ self.matrix[2] > np.cos(np.radians(self.camera.fov_deg[0]))
        xy = self.camera.project(vectors[near] @ self.matrix.T)
        flux = light * 8000.0 * 10 ** (-0.4 * (mag[near] - 8.0))
        ok = np.isfinite(xy).all(axis=1)
        sign = -1.0 if self.camera.mirrored else 1.0
        swept = np.array([-sign * rate[1], rate[0]]) * self.exposure_s * self.camera.focal_px
        image = RenderedStar(2.6, trail_px=(float(swept[0]), float(swept[1])))
        sky = Sky(level_e=self.level_e, hot_per_mp=self.hot_per_mp)
        frame = render(
            self.camera.width,
            self.camera.height,
            xy[ok],
            flux[ok],
            image,
            sky,
            Sensor(bayer=self.bayer),
            seed=self.number,
        )
        return replace(frame, hint=Hint(time_utc=self.moment, exposure_s=self.exposure_s))

    def error_arcsec(self, update) -> np.ndarray:
        """How far the filter's frame is off at its middle along x and y, and in roll."""
        own = update.solution.camera
        attitude = turn_between(own, self.camera) @ update.filtered.matrix
        return rotation_vector(self.matrix @ attitude.T) / ARCSEC


def prediction(tracker, time_utc):
    """Where a tracker believes its camera to point at a moment, with its growing covariance; None when lost."""
    return None if tracker.state is None else predicted(tracker.state, time_utc.timestamp()).attitude
