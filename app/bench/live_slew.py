"""The slew test that the thesis of 2018 (section 10.1) asked for, and averages against promises.

A simulated mount with backlash, periodic error, a wrong axis and wind follows a commanded path;
the tracker is told nothing but frames. What it says is compared with where the rig really points.
"""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.attitude.averages import Averages
from app.attitude.filter import rotation_vector
from app.bench.live_stream import make_ring, off_arcsec, star_frame
from app.core.mount import Direction
from app.core.progress import run
from app.simulate.camera import CameraConfig
from app.simulate.mechanics.axis import AxisWear
from app.simulate.mechanics.mount import MountConfig
from app.simulate.rig import PracticeRig, RigConfig
from app.simulate.weather import WeatherConfig
from app.solve.track import Tracker, TrackOptions

Floats = NDArray[np.float64]
ARCSEC = float(np.degrees(3600.0))

LEGS: tuple[tuple[str, Direction | None, float, float], ...] = (
    ("tracking the sky", None, 0.0, 4.0),
    ("0.05 deg/s", Direction.EAST, 0.05, 4.0),
    ("0.5 deg/s", Direction.NORTH, 0.5, 4.0),
    ("2 deg/s", Direction.WEST, 2.0, 4.0),
    ("at rest again", None, 0.0, 3.0),
)
"""What the hand controller commands: the name, direction, deg/s, seconds."""


@dataclass(slots=True)
class _Leg:
    """What one leg gave; the first frames hold the jolt of its beginning and do not count."""

    off: list[Floats]
    rate_off: list[Floats]
    tracked: int = 0
    count: int = 0
    fastest: float = 0.0


def slew_rig(seed: int) -> PracticeRig:
    """A wide finder camera on a worn mount."""
    wear = AxisWear(periodic_arcsec=15.0, backlash_deg=60.0 / 3600.0)
    return PracticeRig(RigConfig(
        seed=seed, start_deg=(-20.0, 30.0),
        mount=MountConfig(misalignment_arcmin=(20.0, -30.0), hour_wear=wear, dec_wear=wear),
        camera=CameraConfig(fov_deg=10.0, zero_point_e_s=2e8, cheap=True),
        weather=WeatherConfig(wind_arcsec=2.0),
    ))  # fmt: skip


def slew(seed: int, fps: float, report: Callable[[str], None]) -> list[dict[str, Any]]:
    """A row for every leg: RMS error of pointing and of rate, against the truth."""
    rig, tracker, rows = slew_rig(seed), Tracker(), []
    exposure = 0.5 / fps
    for name, direction, rate, seconds in LEGS:
        report(f"  {name}")
        rig.mount.halt()
        if direction is not None:
            rig.mount.move(direction, rate)
        leg = _Leg([], [])
        for _ in range(round(seconds * fps)):
            _step(rig, tracker, exposure, leg)
            rig.clock.sleep(1.0 / fps - exposure)
        rows.append(_row(name, leg))
    return rows


def _step(rig: PracticeRig, tracker: Tracker, exposure_s: float, leg: _Leg) -> None:
    frame = rig.frame(exposure_s)
    middle = rig.clock.now_unix() - exposure_s / 2.0
    update = run(tracker.update(frame, datetime.fromtimestamp(middle, UTC)))
    leg.count += 1
    leg.tracked += update.mode == "tracking"
    if update.filtered is None or update.filtered_centre is None or leg.count < 3:
        return
    truth = rig.truth(middle).attitude.matrix
    leg.off.append((truth @ update.filtered_centre)[:2] * ARCSEC)
    true = true_rates(rig, middle)
    leg.fastest = max(leg.fastest, float(np.linalg.norm(true[:2])) / 3600.0)
    if update.mode == "tracking" and update.rates_deg_s is not None:
        leg.rate_off.append(np.array(update.rates_deg_s) * 3600.0 - true)


def true_rates(rig: PracticeRig, unix_s: float, span_s: float = 0.02) -> Floats:
    """The camera's angular velocity (3,) against the stars, arcsec/s, about its own axes."""
    before = rig.truth(unix_s - span_s / 2).attitude.matrix
    after = rig.truth(unix_s + span_s / 2).attitude.matrix
    return -rotation_vector(after @ before.T) / span_s * ARCSEC


def _row(name: str, leg: _Leg) -> dict[str, Any]:
    off, rate = np.array(leg.off), np.array(leg.rate_off)
    return {
        "what": f"slew: {name}", "frames": leg.count, "tracked": leg.tracked / leg.count,
        "fastest_deg_s": leg.fastest,
        "pointing_rms_arcsec": float(np.sqrt(np.mean(np.sum(off**2, axis=1)))),
        "rate_rms_arcsec_s": float(np.sqrt(np.mean(rate[:, :2] ** 2))) if len(rate) else np.nan,
        "roll_rate_rms_arcsec_s": float(np.sqrt(np.mean(rate[:, 2] ** 2))) if len(rate) else np.nan,
    }  # fmt: skip


def average_rows(frames: int, seed: int) -> list[dict[str, Any]]:
    """Averages of N tracked pointings of a camera at rest: what is left, and what was promised."""
    ring = make_ring(1280, 960, count=2, seed=seed, swing_deg=0.0)
    # one model of the camera throughout, so that all attitudes are of the same axes
    tracker, single = Tracker(options=TrackOptions(calibrate_every=0)), []
    for k, (_, moment, truth) in enumerate(ring.stream(frames + 1, 10.0)):
        frame = star_frame(ring.camera, truth, seed + 100 + k)
        update = run(tracker.update(frame, moment))
        if update.mode == "tracking" and update.solution is not None:
            single.append(update.solution.attitude)
    rows = []
    mean_all = Averages()
    for attitude in single:
        mean_all.add(attitude, 0.0)
    middle = mean_all.mean().matrix  # what is the same in all frames is no noise
    for n in (1, 4, 16, 64):
        if 4 * n > len(single):
            continue
        left, promised = [], []
        for begin in range(0, len(single) - n + 1, n):
            part = Averages()
            for attitude in single[begin : begin + n]:
                part.add(attitude, 0.0)
            left.append(off_arcsec(part.mean().matrix, middle)[:2])
            promised.append(part.mean().sigma_arcsec[:2])
        rows.append({
            "what": f"averages of {n}", "frames": len(left) * n,
            "pointing_rms_arcsec": float(np.sqrt(np.mean(np.square(left)))),
            "predicted_arcsec": float(np.sqrt(np.mean(np.square(promised)))),
        })  # fmt: skip
    return rows
