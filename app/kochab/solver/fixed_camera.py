"""A camera that stands still, such as an all-sky or a meteor camera: azimuth and altitude of each of its pixels.

Stars of solved frames become directions in east, north, up at their moments, refraction included, and one camera and
one attitude are fitted to all of them together (Borovicka, Spurny and Keclikova 1995, A&AS 112, 173, for such cameras;
the terms here are those of :mod:`kochab.core.camera`). The calibration is kept by name, below the user's settings.
"""

import json
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, astuple
from pathlib import Path
from typing import Any

import numpy as np

from kochab.attitude import wahba
from kochab.attitude.fit import Fit, refine
from kochab.attitude.least_squares import PARAMETERS, project_with_jacobian
from kochab.core.arrays import Floats
from kochab.core.attitude import ARCSEC, Attitude, unit_vectors
from kochab.core.camera import PROJECTIONS, Camera
from kochab.core.errors import KochabError, UsageError
from kochab.core.frame import Site
from kochab.core.progress import Progress, Task
from kochab.core.robust import median
from kochab.core.solution import Matches, Solution
from kochab.core.values import frozen
from kochab.folders import config_folder, file_stem
from kochab.frames.atomic_file import write_atomically
from kochab.parsing.text_input import read_json
from kochab.sky.horizon import Horizon

FORMAT = 1
FEWEST_STARS = 20
MOVED_PX, MOVED = 1.0, 3.0
"""A frame whose stars stand so far, and so many times its own RMS, from where all frames have them was moved."""
BELOW_DEG, BELOW_SHARE = -0.5, 0.1
"""Where this share of a frame's stars is so far below the horizon, its time or the site is wrong."""
AIR_SHARE, AIR_RAD, LOWEST_RAD = 0.05, 58.3 * ARCSEC, np.radians(87.0)
"""The weather changes refraction, 58.3 arcsec times the tangent of the zenith distance, by so much, one sigma."""
CELLS = 6  # a side, in which residuals are averaged: what is left there is no noise
ROWS = 16  # of a frame at once: the camera's reach is reckoned for each lot, and more at once outgrow the cache


@frozen(eq=False)
class StarsOfFrame:
    """Stars of one solved frame: ``xy`` (M, 2) px, and where they stood, ``directions`` (M, 3) in east, north, up.

    ``rms_px`` is what the frame's own solution leaves.
    """

    file: str
    xy: Floats
    directions: Floats
    camera: Camera
    rms_px: float

    @classmethod
    def of(cls, file: str, solution: Solution, horizon: Horizon) -> "StarsOfFrame":
        """Of a solution; UsageError where its stars stand below the horizon.

        Parameters
        ----------
        file : str
            What the frame is called.
        solution : Solution
            Where it points.
        horizon : Horizon
            Where and when it was taken.
        """
        directions = horizon.observed(solution.star_vectors)
        low = azimuth_altitude_deg(directions)[1] < BELOW_DEG
        if low.mean() > BELOW_SHARE:
            raise UsageError(
                "{file}: {n} of {all} stars stand below the horizon: its time or the site is wrong.",
                file=file,
                n=int(low.sum()),
                all=len(low),
            )
        return cls(file, solution.stars_px, directions, solution.camera, solution.rms_px)


@frozen(eq=False)
class FixedCamera:
    """A camera on the ground: ``attitude`` takes east, north, up (refracted) to its axes.

    ``covariance`` (K, K) is of ``terms``, names of :data:`~kochab.attitude.least_squares.PARAMETERS`; ``model_px`` is
    what the model leaves beyond noise, one sigma a coordinate. ``limit_mag`` is the faintest V that is seen for sure on
    a clear night, at the zenith, ``seen`` the share of brighter stars seen above ``horizon_deg`` (B, 2): azimuths, and
    the lowest altitudes that trees and houses leave free; all three are empty before they are measured.
    """

    name: str
    site: Site
    camera: Camera
    attitude: Attitude
    terms: tuple[str, ...]
    covariance: Floats
    rms_px: float
    model_px: float
    stars: int
    frames: int
    limit_mag: float | None = None
    seen: float | None = None
    horizon_deg: Floats | None = None

    def directions(self, pixels: Floats) -> Floats:
        """Directions (N, 3) in east, north, up of pixels (N, 2); NaN beside the lens's circle."""
        xy = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
        rays = self.camera.unproject(xy)
        far = _off_axis_rad(rays) > self.camera.reach_rad
        # beyond the circle, where a polynomial turns back, a pixel has no ray that leads to it
        far |= ~(np.hypot(*(self.camera.project(rays) - xy).T) < 0.5)
        return np.where(far[:, None], np.nan, rays @ self.attitude.matrix)

    def pixels(self, directions: Floats) -> Floats:
        """Pixels (N, 2) of directions (N, 3) in east, north, up; NaN where the camera does not see."""
        rays = np.asarray(directions, dtype=np.float64).reshape(-1, 3) @ self.attitude.matrix.T
        xy = self.camera.project(rays)
        far = _off_axis_rad(rays) > self.camera.reach_rad
        size = np.array([self.camera.width, self.camera.height])
        with np.errstate(invalid="ignore"):
            outside = far | ~((xy > -0.5) & (xy < size - 0.5)).all(axis=1)
        return np.where(outside[:, None], np.nan, xy)

    @property
    def middle(self) -> Floats:
        """The middle of the frame (1, 2), px."""
        return np.array([[(self.camera.width - 1) / 2.0, (self.camera.height - 1) / 2.0]])

    def altaz_deg(self, pixels: Floats) -> tuple[Floats, Floats, Floats]:
        """Azimuth from north through east, altitude and one sigma a coordinate (N,), degrees, of pixels (N, 2)."""
        directions = self.directions(pixels)
        azimuth, altitude = azimuth_altitude_deg(directions)
        return azimuth, altitude, self._sigma_deg(directions)

    def _sigma_deg(self, directions: Floats) -> Floats:
        sigma = np.full(len(directions), np.nan)
        there = np.isfinite(directions[:, 0])
        if there.any():
            _, slopes = project_with_jacobian(self.camera, directions[there] @ self.attitude.matrix.T)
            by_turn = slopes[:, :, :2]  # px a radian of a turn about x and y
            own = slopes[:, :, [PARAMETERS.index(name) for name in self.terms]]
            spread = own @ self.covariance @ np.swapaxes(own, 1, 2) + self.model_px**2 * np.eye(2)
            inverse = np.linalg.inv(by_turn)
            on_sky = inverse @ spread @ np.swapaxes(inverse, 1, 2)
            zenith_distance = np.arccos(np.clip(directions[there, 2], -1.0, 1.0))
            air = AIR_SHARE * AIR_RAD * np.tan(np.minimum(zenith_distance, LOWEST_RAD))
            sigma[there] = np.degrees(np.sqrt(np.trace(on_sky, axis1=1, axis2=2) / 2.0 + air**2))
        return sigma

    def free_from_deg(self, azimuths_deg: Floats) -> Floats:
        """The lowest free altitude (N,), degrees, at azimuths (N,); 0 where nothing was measured."""
        if self.horizon_deg is None:
            return np.zeros(len(azimuths_deg))
        return np.interp(azimuths_deg, self.horizon_deg[:, 0], self.horizon_deg[:, 1], period=360.0)

    def sky(self) -> Task[Floats]:
        """How high above the free horizon each pixel (H, W) looks, degrees; NaN beside the lens's circle."""
        height, width = self.camera.height, self.camera.width
        out = np.empty((height, width))
        for y in range(0, height, ROWS):
            if y % 64 == 0:
                yield Progress("mask", y / height)
            below, across = np.mgrid[y : min(y + ROWS, height), :width].reshape(2, -1)
            azimuth, altitude = azimuth_altitude_deg(self.directions(np.column_stack([across, below])))
            out[y : y + ROWS] = (altitude - self.free_from_deg(azimuth)).reshape(-1, width)
        return out


def _off_axis_rad(rays: Floats) -> Floats:
    return np.asarray(np.arctan2(np.hypot(rays[:, 0], rays[:, 1]), rays[:, 2]))


def azimuth_altitude_deg(directions: Floats) -> tuple[Floats, Floats]:
    """Azimuth from north through east and altitude (N,), degrees, of directions (N, 3) in east, north, up."""
    east, north, up = directions.T
    return np.degrees(np.arctan2(east, north)) % 360.0, np.degrees(np.arcsin(np.clip(up, -1.0, 1.0)))


def directions_of(azimuth_deg: Floats, altitude_deg: Floats) -> Floats:
    """Directions (N, 3) in east, north, up of azimuths and altitudes (N,), degrees."""
    return unit_vectors(90.0 - np.asarray(azimuth_deg), altitude_deg)  # angles from east through north


def calibrated(name: str, site: Site, frames: Sequence[StarsOfFrame]) -> FixedCamera:
    """One camera and one attitude of all frames' stars.

    Parameters
    ----------
    name : str
        What the camera is called.
    site : Site
        Where it stands.
    frames : Sequence[StarsOfFrame]
        Stars of frames of one size, taken while nobody moved the camera.

    Raises
    ------
    UsageError
        Too few stars, frames of several sizes, or a frame that was taken when the camera stood elsewhere.

    Notes
    -----
    A clock that is wrong by one second turns the sky by up to 15 arcsec, and no frame can tell it from a camera that
    stands turned; that is in no sigma.
    """
    sizes = {(one.camera.width, one.camera.height) for one in frames}
    if len(sizes) > 1:
        raise UsageError("The frames have different sizes: they are not of one camera as it stands.")
    xy = np.concatenate([one.xy for one in frames])
    if len(xy) < FEWEST_STARS:
        raise UsageError(
            "{n} stars are too few to calibrate a camera; {least} are needed.", n=len(xy), least=FEWEST_STARS
        )
    directions = np.concatenate([one.directions for one in frames])
    rows = np.arange(len(xy))
    matches = Matches(rows, rows, xy, directions)
    fits = [_fit(matches, one) for one in {one.camera.projection: one.camera for one in frames}.values()]
    fit = min(fits, key=lambda each: (-int(each.inliers.sum() / len(xy) * 20.0), each.rms_px))
    _refuse_moved(frames, fit)
    terms = tuple(term for term in fit.terms if term in PARAMETERS)
    columns = [PARAMETERS.index(term) for term in terms]
    _, slopes = project_with_jacobian(fit.camera, directions[fit.inliers] @ fit.attitude.matrix.T)
    slope = slopes[:, :, columns].reshape(-1, len(columns))
    variance = fit.rms_px**2 / 2.0 * slope.shape[0] / max(slope.shape[0] - len(columns), 1)
    return FixedCamera(
        name,
        site,
        fit.camera,
        Attitude(fit.attitude.matrix),
        terms,
        np.asarray(variance * np.linalg.inv(slope.T @ slope), dtype=np.float64),
        fit.rms_px,
        _beyond_noise_px(xy[fit.inliers], fit.residuals_px[fit.inliers], fit.camera),
        int(fit.inliers.sum()),
        len(frames),
    )


def _fit(matches: Matches, camera: Camera) -> Fit:
    start = wahba(camera.unproject(matches.xy), matches.vectors)
    return refine(matches, camera, start)


def _refuse_moved(frames: Sequence[StarsOfFrame], fit: Fit) -> None:
    """Raise UsageError for the frame whose stars stand apart from what all frames together say."""
    start, worst = 0, (1.0, "", 0.0)
    for one in frames:
        shift = median(np.hypot(*fit.residuals_px[start : start + len(one.xy)].T))
        start += len(one.xy)
        worst = max(worst, (shift / max(MOVED_PX, MOVED * one.rms_px), one.file, shift))
    if worst[1]:
        raise UsageError(
            "{file}: its stars stand {shift:.1f} px from where one camera that stands still has them. It was moved, or"
            " a time is wrong.",
            file=worst[1],
            shift=worst[2],
        )


def _beyond_noise_px(xy: Floats, residuals: Floats, camera: Camera) -> float:
    """Systematic part of the residuals (M, 2), px, one sigma a coordinate: what neighbouring stars (M, 2) share."""
    cell = (xy / (camera.width, camera.height) * CELLS).clip(0, CELLS - 1).astype(int) @ (CELLS, 1)
    square, noise, n = 0.0, 0.0, 0
    for k in np.unique(cell):
        own = residuals[cell == k]
        if len(own) >= 4:
            square += float((own.mean(axis=0) ** 2).sum())
            noise += float(own.var(axis=0, ddof=1).sum() / len(own))
            n += 2
    return float(np.sqrt(max(square - noise, 0.0) / n)) if n else 0.0


# -- Kept by name -------------------------------------------------------------------------------

LARGEST = 1e6
"""No length, px, and no term of a lens is as large."""
_DAMAGED = (OSError, ValueError, LookupError, TypeError, AttributeError, ArithmeticError)


def fixed_camera_folder() -> Path:
    """Where calibrations lie."""
    return config_folder() / "fixed-cameras"


def fixed_camera_path(name: str) -> Path:
    """The file of the camera of that name."""
    return fixed_camera_folder() / f"{'-'.join(file_stem(name, 'camera'))}.json"


def save_fixed_camera(camera: FixedCamera) -> Path:
    """Write a calibration, whole or not at all; KochabError when it cannot be."""
    path = fixed_camera_path(camera.name)
    content: dict[str, Any] = {
        "format": FORMAT,
        "name": camera.name,
        "site": list(astuple(camera.site)),
        "projection": camera.camera.projection,
        "camera": asdict(camera.camera),
        "enu_to_camera": camera.attitude.matrix.tolist(),
        "terms": list(camera.terms),
        "covariance": camera.covariance.tolist(),
        "rms_px": camera.rms_px,
        "model_px": camera.model_px,
        "stars": camera.stars,
        "frames": camera.frames,
        "limit_mag": camera.limit_mag,
        "seen": camera.seen,
        "horizon_deg": None if camera.horizon_deg is None else camera.horizon_deg.tolist(),
    }
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, json.dumps(content, indent=1))
    except OSError as error:
        raise KochabError(
            "The calibration cannot be saved in {parent}: {strerror}.", parent=path.parent, strerror=error.strerror
        ) from error
    return path


def load_fixed_camera(name: str) -> FixedCamera:
    """The calibration of that name; UsageError when there is none, KochabError when its file is damaged."""
    path = fixed_camera_path(name)
    if not path.exists():
        names = ", ".join(camera.name for camera in fixed_cameras())
        if names:
            raise UsageError("There is no calibration “{name}”; there are: {names}.", name=name, names=names)
        raise UsageError("There is no calibration “{name}” yet: kochab station calibrate makes one.", name=name)
    return _read(path)


def fixed_cameras() -> list[FixedCamera]:
    """All calibrated cameras that can be read, by name."""
    cameras = []
    for path in fixed_camera_folder().glob("*.json"):
        with suppress(KochabError):
            cameras.append(_read(path))
    return sorted(cameras, key=lambda camera: camera.name)


def _read(path: Path) -> FixedCamera:
    try:
        content = read_json(path)
        terms = tuple(str(term) for term in content["terms"])
        limit, seen = (content[key] if content[key] is None else float(content[key]) for key in ("limit_mag", "seen"))
        matrix, covariance = (np.array(content[key], dtype=np.float64) for key in ("enu_to_camera", "covariance"))
        camera = FixedCamera(
            name=str(content["name"]),
            site=Site(*map(float, content["site"])),
            camera=PROJECTIONS[content["projection"]](**content["camera"]),
            attitude=Attitude(matrix),
            terms=terms,
            covariance=covariance,
            rms_px=float(content["rms_px"]),
            model_px=float(content["model_px"]),
            stars=int(content["stars"]),
            frames=int(content["frames"]),
            limit_mag=limit,
            seen=seen,
            horizon_deg=None if content["horizon_deg"] is None else np.array(content["horizon_deg"], dtype=np.float64),
        )
        if not _is_sound(camera) or fixed_camera_path(camera.name) != path:
            raise ValueError("numbers that no camera has, or another's name")
        return camera
    except _DAMAGED as error:
        raise KochabError("{path} is not a calibration; delete it to start anew.", path=path) from error


def _is_sound(camera: FixedCamera) -> bool:
    """Whether the numbers of a calibration are possible."""
    lens, count = camera.camera, len(camera.terms)
    np.linalg.cholesky(camera.covariance)  # raises unless it is a covariance
    horizon = np.zeros((2, 2)) if camera.horizon_deg is None else camera.horizon_deg
    numbers = [*asdict(lens).values(), camera.rms_px, camera.model_px, camera.limit_mag or 0.0, camera.seen or 0.5]
    return bool(
        camera.covariance.shape == (count, count)
        and set(camera.terms) <= set(PARAMETERS)
        and np.abs(camera.attitude.matrix @ camera.attitude.matrix.T - np.eye(3)).max() < 1e-6
        and np.linalg.det(camera.attitude.matrix) > 0.0
        and (np.abs(numbers) < LARGEST).all()
        and min(lens.width, lens.height) >= 2
        and min(lens.focal_px, lens.aspect) > 0.0
        and min(camera.rms_px, camera.model_px) >= 0.0
        and abs(camera.site.latitude_deg) <= 90.0
        and abs(camera.site.longitude_deg) <= 360.0
        and (camera.seen is None or 0.0 < camera.seen <= 1.0)
        and horizon.shape[1:] == (2,)
        and len(horizon) > 0
        and (np.abs(horizon) <= 360.0).all()
    )
