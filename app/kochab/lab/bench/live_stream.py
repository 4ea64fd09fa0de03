"""The streams of the live bench: a camera that swings, and the slew test of the 2018 thesis (section 10.1).

The pointing follows a cosine, so that the frames of half a swing, shown forth and back, are every
moment's frame. Rendering would cost more than what is measured here.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import partial
from typing import Any

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import ARCSEC, Attitude, attitude_from, rotation_vector, small_rotation
from kochab.core.camera import Camera
from kochab.core.frame import Frame, Hint
from kochab.core.mount import Direction
from kochab.core.progress import run
from kochab.core.values import frozen
from kochab.lab.bench import summary
from kochab.lab.estimators import average
from kochab.simulate.camera import CameraConfig
from kochab.simulate.mechanics.axis import GearErrors
from kochab.simulate.mechanics.geometry import MountConfig
from kochab.simulate.night_sky import WeatherConfig
from kochab.simulate.rig import PracticeRig, RigConfig
from kochab.simulate.star_images import RenderedStar, Sensor, Sky, render
from kochab.sky import open_catalogue
from kochab.solver.tracker import Tracker

START = datetime(2026, 3, 1, 21, 0, tzinfo=UTC)
YEAR = 2026.16
SIZES = {"1.2 MP": (1280, 960), "2 MP": (1920, 1080), "6 MP": (3000, 2000)}
EXPOSURE_S = 0.02
SWING_DEG = 0.4
SCALE_ARCSEC_PX = 30.0


@frozen(eq=False)
class Ring:
    """Frames of half a swing and where each truly points, ``matrices`` (N, 3, 3)."""

    camera: Camera
    frames: list[Frame]
    matrices: Floats

    def stream(self, count: int, fps: float) -> Iterator[tuple[Frame, datetime, Floats]]:
        """``count`` frames with their times and true attitudes."""
        # Forth and back without the two end frames twice.
        period = 2 * (len(self.frames) - 1)
        for k in range(count):
            at = k % period
            at = min(at, period - at)
            yield self.frames[at], START + timedelta(seconds=k / fps), self.matrices[at]


def make_ring(
    width: int, height: int, count: int = 31, seed: int = 1, swing_deg: float = SWING_DEG, bayer: str | None = None
) -> Ring:
    """Frames of a rich field at 30 arcsec a pixel, 20 ms each, with hot pixels.

    ``bayer`` is the pattern of a colour camera.

    Parameters
    ----------
    width, height : int
        Size of a frame, px.
    count : int
        How many frames.
    seed : int
        Draws their noise.
    swing_deg : float
        How far the camera swings.
    bayer : str or None
        Pattern of a colour camera; None: a grey one.
    """
    camera = Camera.centred(width, height, float(1.0 / np.radians(SCALE_ARCSEC_PX / 3600.0)))
    middle = attitude_from(305.0, 40.0, 12.0).matrix
    phase = np.pi * np.arange(count) / max(1, count - 1)
    axis = np.radians(swing_deg) / 2.0 * np.array([0.6, 0.8, 0.3])
    matrices = np.array([small_rotation(np.cos(p) * axis) @ middle for p in phase])
    frames = [star_frame(camera, m, seed + k, bayer=bayer) for k, m in enumerate(matrices)]
    return Ring(camera, frames, matrices)


def star_frame(camera: Camera, matrix: Floats, seed: int, bayer: str | None = None) -> Frame:
    """One frame of the sky.

    Parameters
    ----------
    camera : Camera
        Projects the stars.
    matrix : Floats
        Rotation (3, 3), ICRS to camera axes.
    seed : int
        Draws the noise.
    bayer : str or None
        Pattern of a colour camera; None: a grey one.
    """
    catalogue = open_catalogue()
    half = float(np.arctan(np.hypot(camera.width, camera.height) / 2.0 / camera.focal_px))
    rows = catalogue.brightest(matrix[2], half, 1500, YEAR)
    xy = camera.project(catalogue.vectors(rows, YEAR) @ matrix.T)
    flux = 4000.0 * 10.0 ** (-0.4 * (catalogue.mag(rows) - 8.0))
    seen = np.isfinite(xy).all(axis=1)
    sky, image = Sky(level_e=80.0, hot_per_mp=20.0), RenderedStar(2.6)
    frame = render(camera.width, camera.height, xy[seen], flux[seen], image, sky, Sensor(bayer=bayer), seed=seed)
    return replace(frame, hint=Hint(exposure_s=EXPOSURE_S))


def off_arcsec(matrix: Floats, truth: Floats) -> Floats:
    """The rotation (3,), arcsec, from one attitude to another."""
    return rotation_vector(truth @ matrix.T) / ARCSEC


# -- The slew test that the thesis of 2018 (section 10.1) asked for, and averages -----------------
# A simulated mount with backlash, periodic error, a wrong axis and wind follows a commanded path;
# the tracker gets nothing but frames. Its pointing is compared with where the rig really points.

LEGS: tuple[tuple[str, Direction | None, float, float], ...] = (
    ("tracking the sky", None, 0.0, 4.0),
    ("0.05 deg/s", Direction.EAST, 0.05, 4.0),
    ("0.5 deg/s", Direction.NORTH, 0.5, 4.0),
    ("2 deg/s", Direction.WEST, 2.0, 4.0),
    ("at rest again", None, 0.0, 3.0),
)
"""What the hand controller commands: the name, direction, deg/s, seconds."""


def slew_rig(seed: int) -> PracticeRig:
    """A wide finder camera on a mount with backlash and periodic error."""
    gear = GearErrors(periodic_arcsec=15.0, backlash_deg=60.0 / 3600.0)
    return PracticeRig(
        RigConfig(
            seed=seed,
            start_deg=(-20.0, 30.0),
            mount=MountConfig(misalignment_arcmin=(20.0, -30.0), hour_gear=gear, dec_gear=gear),
            camera=CameraConfig(fov_deg=10.0, zero_point_e_s=2e8, cheap=True),
            weather=WeatherConfig(wind_arcsec=2.0),
        )
    )


def slew(seed: int, fps: float, report: Callable[[str], None]) -> list[dict[str, Any]]:
    """A row for every leg: RMS error of pointing and of rate, against the truth."""
    rig, tracker, rows = slew_rig(seed), Tracker(), []
    exposure = 0.5 / fps
    for name, direction, rate, seconds in LEGS:
        report(f"  {name}")
        rig.mount.halt()
        if direction is not None:
            rig.mount.move(direction, rate)
        frames = []
        for _ in range(round(seconds * fps)):
            frames.append(_step(rig, tracker, exposure))
            rig.clock.sleep(1.0 / fps - exposure)
        numbers = summary(frames, frames=("tracked", len), tracked=("tracked", np.mean))
        after = frames[2:]  # the first hold the jolt of its beginning
        numbers |= summary(
            after, fastest_deg_s=("turning_deg_s", partial(np.nanmax, initial=0.0)), pointing_rms_arcsec=("off", _rms)
        )
        numbers |= summary(after, rate_rms_arcsec_s=("rate_off", _rms), roll_rate_rms_arcsec_s=("roll_off", _rms))
        rows.append({"what": f"slew: {name}"} | numbers)
    return rows


def _step(rig: PracticeRig, tracker: Tracker, exposure_s: float) -> dict[str, Any]:
    """What one frame gave: how far pointing and rates are off, arcsec, NaN where there are none."""
    frame = rig.frame(exposure_s)
    middle = rig.clock.now_unix() - exposure_s / 2.0
    update = run(tracker.update(frame, datetime.fromtimestamp(middle, UTC)))
    off, rate_off, true = np.full(2, np.nan), np.full(3, np.nan), np.full(3, np.nan)
    if update.filtered_centre is not None:
        truth, true = rig.truth(middle).attitude.matrix, true_rates(rig, middle)
        off = (truth @ update.filtered_centre.boresight)[:2] / ARCSEC
        if update.mode == "tracking" and update.rates_deg_s is not None:
            rate_off = np.array(update.rates_deg_s) * 3600.0 - true
    return {
        "tracked": update.mode == "tracking",
        "turning_deg_s": np.linalg.norm(true[:2]) / 3600.0,
        "off": np.linalg.norm(off),
        "rate_off": np.linalg.norm(rate_off[:2]) / np.sqrt(2.0),  # of one axis
        "roll_off": rate_off[2],
    }


def _rms(off: Floats) -> float:
    seen = off[np.isfinite(off)]
    return float(np.sqrt(np.mean(seen**2))) if len(seen) else np.nan


def true_rates(rig: PracticeRig, unix_s: float, span_s: float = 0.02) -> Floats:
    """The camera's angular velocity (3,) against the stars, arcsec/s, about its own axes."""
    before = rig.truth(unix_s - span_s / 2).attitude.matrix
    after = rig.truth(unix_s + span_s / 2).attitude.matrix
    return -rotation_vector(after @ before.T) / span_s / ARCSEC


def average_rows(frames: int, seed: int) -> list[dict[str, Any]]:
    """Averages of N tracked pointings of a camera at rest: what is left, and what was promised."""
    ring = make_ring(1280, 960, count=2, seed=seed, swing_deg=0.0)
    # one model of the camera throughout, so that all attitudes are of the same axes
    tracker, single = Tracker(), []
    tracker.calibrate_every = 0
    for k, (_, moment, truth) in enumerate(ring.stream(frames + 1, 10.0)):
        frame = star_frame(ring.camera, truth, seed + 100 + k)
        update = run(tracker.update(frame, moment))
        if update.mode == "tracking" and update.solution is not None:
            attitude = update.solution.attitude
            assert attitude.covariance is not None
            single.append(Attitude(attitude.matrix, attitude.covariance - tracker.shared))
    middle = average(single).matrix  # what is the same in all frames is no noise
    rows = []
    for n in (1, 4, 16, 64):
        if 4 * n > len(single):
            continue
        means = [average(single[begin : begin + n]) for begin in range(0, len(single) - n + 1, n)]
        left = [off_arcsec(mean.matrix, middle)[:2] for mean in means]
        promised = [mean.sigma_arcsec[:2] for mean in means]
        row: dict[str, Any] = {"what": f"averages of {n}", "frames": len(means) * n}
        row["pointing_rms_arcsec"] = float(np.sqrt(np.mean(np.square(left))))
        rows.append(row | {"predicted_arcsec": float(np.sqrt(np.mean(np.square(promised))))})
    return rows
