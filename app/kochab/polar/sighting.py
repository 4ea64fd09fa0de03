"""A solved frame as polar alignment sees it: an attitude at a moment, and how sure it is."""

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from functools import lru_cache

import numpy as np

from kochab.attitude.fit import refine
from kochab.core.arrays import Floats
from kochab.core.attitude import ARCSEC, Attitude, angle_between
from kochab.core.camera import Camera
from kochab.core.frame import Site
from kochab.core.solution import Matches, Solution
from kochab.core.values import frozen
from kochab.polar.rotations import alt_az, best_rotation
from kochab.sky.horizon import STANDARD_REFRACTION, Horizon, Refraction

GRID = 5  # field points a side
WIDEST_DEG = 20.0  # beyond this much of the field refraction is no longer nearly linear; its middle is used
FLOOR_ARCSEC = 0.7  # no frame is believed to better than this: seeing, and refraction as it really is
MOST_KEPT = 512  # a drift looks at all its frames again every five seconds


@frozen(eq=False)
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

        Parameters
        ----------
        solution : Solution
            Of the frame.
        time_utc : datetime
            Mid-exposure.
        label : str
            What the frame is called, as its file's name.
        sweep : int
            Number of the sweep it belongs to.
        """
        field_deg, pixels, _ = _fixed_places(solution.camera)
        number = np.arange(len(solution.stars))
        stars = Matches(number, number, solution.stars_px, solution.star_vectors)
        attitude, sky = in_plain_axes(solution.attitude, solution.camera), solution.sky_at(pixels)
        return cls(attitude, time_utc, field_deg, label, sweep, sky, solution.camera, stars)


@frozen(eq=False)
class LocalAttitude:
    """A camera among the things on the ground.

    ``matrix`` (3, 3) takes camera axes to E, N, U; ``covariance`` (3, 3), rad^2, is of a small
    rotation about the camera's axes. ``matches`` are its stars, their directions in E, N, U as observed, and
    ``camera`` is what they were fitted with. Frames with the same number for a ``place`` were taken without a turn
    of RA between them.
    """

    matrix: Floats
    covariance: Floats
    time_utc: datetime
    label: str = ""
    sweep: int = 0
    camera: Camera | None = None
    matches: Matches | None = None
    place: int | None = None

    @property
    def boresight(self) -> Floats:
        """Unit vector (3,) in E, N, U."""
        return np.asarray(self.matrix[:, 2])

    @property
    def altitude_deg(self) -> float:
        """How high the camera looks."""
        return float(np.degrees(alt_az(self.boresight)[0]))


@lru_cache(maxsize=MOST_KEPT)
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


# -- All frames of an alignment fitted with one camera, so that only their attitudes differ ------
# A frame alone has to find its optical centre, distortion and attitude from its own stars, and bends its camera until
# that looks like the refraction it knows nothing of: low frames of wide fields lose a factor of ten by it. Here stars
# are taken where the air shows them, all frames share one centre and one distortion, and each has its attitude and
# its scale. What is wrong with the camera is then wrong in all frames alike and does not move the axis.

ROUNDS = 2  # the attitudes change with the camera that they were found for
SAME_SCALE = 0.01  # refraction changes a low frame's scale by a tenth of that
CUT_SCALE = 0.03  # distortion makes the middle of a cut-out look longer or shorter by that
LOWEST = np.sin(np.radians(10.0))  # below, two terms of refraction are arcseconds off
FEWEST = 6


def with_one_camera(attitudes: Sequence[LocalAttitude]) -> tuple[list[LocalAttitude], Camera | None]:
    """The same frames fitted with one camera, and that camera; as they are, and None, where they can't share one."""
    frames = list(attitudes)
    camera = frames[0].camera if len(frames) > 1 else None
    if camera is None or not all(_can_share(camera, frame) for frame in frames):
        return frames, None
    for _ in range(ROUNDS):
        # All stars in their own camera's axes (v @ R is R^T v): as if one long frame had them all.
        stars = Matches.joined(
            [replace(m := _high(f.matches), vectors=m.vectors @ f.matrix) for f in frames if f.matches]
        )
        start = Attitude(best_rotation(stars.vectors, camera.unproject(stars.xy)))
        camera = refine(stars, camera, start).camera
        frames = [seen_by(camera, frame) for frame in frames]
    return frames, camera


def seen_by(camera: Camera | None, frame: LocalAttitude) -> LocalAttitude:
    """A frame fitted anew with a camera that is known but for its scale; as it is where it is another camera's."""
    if camera is None or frame.matches is None or not _can_share(camera, frame):
        return frame
    stars = _high(frame.matches)
    start = Attitude(best_rotation(stars.vectors, camera.unproject(stars.xy)))
    found = in_plain_axes(refine(stars, camera, start, distortion=False).attitude, camera)
    return replace(frame, matrix=found.matrix.T, covariance=covariance_of(found))


def _can_share(camera: Camera, frame: LocalAttitude) -> bool:
    other = frame.camera
    if other is None or frame.matches is None or len(frame.matches) < FEWEST:
        return False
    return (other.width, other.height) == (camera.width, camera.height) and same_optics(camera, other)


def same_optics(camera: Camera, other: Camera) -> bool:
    """Whether two frames may be of one camera, binned or not."""
    one, two = (c.width / plain_focal_px(c) for c in (camera, other))
    shapes_alike = abs(other.width * camera.height / (other.height * camera.width) - 1.0) < SAME_SCALE
    return camera.mirrored == other.mirrored and shapes_alike and abs(two / one - 1.0) < SAME_SCALE


def cropped(camera: Camera, other: Camera) -> bool:
    """Whether two frames of different size are as large on the sky a pixel, so that one may be cut out of the other."""
    sizes_differ = (other.width, other.height) != (camera.width, camera.height)
    alike = abs(plain_focal_px(other) / plain_focal_px(camera) - 1.0) < CUT_SCALE
    return sizes_differ and alike and camera.mirrored == other.mirrored


def _high(stars: Matches) -> Matches:
    """Those that stand high enough, or all when these are few."""
    high = stars.take(stars.vectors[:, 2] > LOWEST)
    return high if len(high) >= max(FEWEST, len(stars) // 3) else stars
