"""A solved frame as polar alignment sees it: an attitude at a moment, and how sure it is."""

from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import Attitude, angle_between
from kochab.core.camera import Camera
from kochab.core.frame import Site
from kochab.core.solution import Matches, Solution
from kochab.polar.horizon import STANDARD_REFRACTION, Horizon, Refraction
from kochab.polar.rotations import ARCSEC, alt_az, best_rotation

GRID = 5  # field points a side
WIDEST_DEG = 20.0  # beyond this much of the field refraction is no longer nearly linear; its middle is used
FLOOR_ARCSEC = 0.7  # no frame is believed to better than this: seeing, and refraction as it really is


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """Where a camera pointed, ICRS, at mid-exposure.

    ``attitude`` carries its covariance; ``field_deg`` is (width, height). ``sweep`` counts the sweeps: frames of one
    sweep differ only by turns about the axis. ``label`` names the frame. ``sky`` (25, 3) are the ICRS unit vectors
    that the frame's field points really show; None when they are those of a camera without distortion. ``camera`` is
    as this frame alone was fitted, ``matches`` are its stars.
    """

    attitude: Attitude
    time_utc: datetime
    field_deg: tuple[float, float] = (2.0, 2.0)
    label: str = ""
    sweep: int = 0
    sky: Floats | None = None
    camera: Camera | None = None
    matches: Matches | None = None

    @classmethod
    def of(cls, solution: Solution, time_utc: datetime, label: str = "", sweep: int = 0) -> "Sighting":
        """The sighting of a solved frame, its attitude that of a plain pinhole about its middle.

        Each fit frees its optical centre and distortion as its own stars ask, so the optical axis of each fit is
        another place in the picture. The same pixels stay the same place: whatever a fit did with its camera cancels,
        for its map from pixels to sky is right. Binned frames share these places, cropped ones do not.

        The covariance is the solver's own at the middle of the frame. Elsewhere it is approximate:
        it leaves out the errors of the distortion, which grow where a part of the field shows no
        stars (the tilts scatter by 1.6 and the roll by 4 of its sigmas with half of it covered).
        """
        field_deg, pixels, _ = _fixed_places(solution.camera)
        number = np.arange(len(solution.stars))
        stars = Matches(number, number, solution.stars_px, solution.star_vectors)
        attitude, sky = in_plain_axes(solution.attitude, solution.camera), solution.sky_at(pixels)
        return cls(attitude, time_utc, field_deg, label, sweep, sky, solution.camera, stars)


@dataclass(frozen=True, slots=True, eq=False)
class LocalAttitude:
    """A camera among the things on the ground.

    ``matrix`` (3, 3) takes camera axes to E, N, U; ``covariance`` (3, 3), rad^2, is of a small
    rotation about the camera's axes. ``matches`` are its stars, their directions in E, N, U as observed, and
    ``camera`` is what they were fitted with.
    """

    matrix: Floats
    covariance: Floats
    time_utc: datetime
    label: str = ""
    sweep: int = 0
    camera: Camera | None = None
    matches: Matches | None = None

    @property
    def boresight(self) -> Floats:
        """Unit vector (3,) in E, N, U."""
        return np.asarray(self.matrix[:, 2])

    @property
    def altitude_deg(self) -> float:
        """How high the camera looks."""
        return float(np.degrees(alt_az(self.boresight)[0]))


def to_local(sighting: Sighting, site: Site, refraction: Refraction = STANDARD_REFRACTION) -> LocalAttitude:
    """The sighting's camera in E, N, U: field points taken to apparent places, then a rotation.

    The rotation is the least-squares one over a grid of the field, which is what the solver would
    have found from stars spread over it.
    """
    points = _field_points(sighting.field_deg)
    icrs = points @ sighting.attitude.matrix if sighting.sky is None else sighting.sky
    horizon, stars = Horizon(site, sighting.time_utc, refraction), sighting.matches
    matrix, covariance = best_rotation(points, horizon.observed(icrs)), covariance_of(sighting.attitude)
    if stars is not None:
        stars = replace(stars, vectors=horizon.observed(stars.vectors))
    named = (sighting.time_utc, sighting.label, sighting.sweep)
    return LocalAttitude(matrix, covariance, *named, sighting.camera, stars)


def covariance_of(attitude: Attitude) -> Floats:
    """The attitude's covariance, with what no solve can know added.

    Raises `ValueError` when the attitude has none, so that the axis would have no uncertainty.
    """
    if attitude.covariance is None:
        raise ValueError("An attitude needs a covariance.")
    return np.asarray(attitude.covariance + np.eye(3) * (FLOOR_ARCSEC * ARCSEC) ** 2)


def in_plain_axes(attitude: Attitude, camera: Camera) -> Attitude:
    """An attitude of ``camera``'s own axes as that of a plain pinhole about the middle of the frame."""
    _, pixels, points = _fixed_places(camera)
    to_plain = best_rotation(camera.unproject(pixels), points)
    covariance = attitude.covariance
    if covariance is not None:
        covariance = to_plain @ covariance @ to_plain.T
    return Attitude(to_plain @ attitude.matrix, covariance)


def plain_focal_px(camera: Camera) -> float:
    """Focal length of a pinhole as wide as the middle half of the frame is on the sky.

    The fitted one depends on what the fit took for distortion; the sky between two pixels does not.
    """
    x, y, quarter = (camera.width - 1) / 2.0, (camera.height - 1) / 2.0, camera.width / 4.0
    left, right = camera.unproject(np.array([[x - quarter, y], [x + quarter, y]]))
    return float(quarter / np.tan(angle_between(left, right) / 2.0))


def _fixed_places(camera: Camera) -> tuple[tuple[float, float], Floats, Floats]:
    """The field, degrees, of that pinhole, places (25, 2), px, all over it, and their directions (25, 3) in it."""
    plain = Camera.centred(camera.width, camera.height, plain_focal_px(camera), camera.mirrored)
    points = _field_points(plain.fov_deg)
    return plain.fov_deg, plain.project(points), points


def _field_points(field_deg: tuple[float, float]) -> Floats:
    """Unit vectors (GRID^2, 3) in camera axes over the field, or over its middle.

    They are the centres of GRID x GRID equal parts, so that their mean is that of stars all over
    the field: a wave that a fit leaves between middle and corners then hardly tilts them.
    """
    half = [np.tan(np.radians(min(max(side, 0.05), WIDEST_DEG) / 2.0)) for side in field_deg]
    steps = (2.0 * np.arange(GRID) + 1.0) / GRID - 1.0
    x, y = np.meshgrid(half[0] * steps, half[1] * steps)
    v = np.stack([x.ravel(), y.ravel(), np.ones(GRID * GRID)], axis=-1)
    return np.asarray(v / np.linalg.norm(v, axis=1, keepdims=True))
