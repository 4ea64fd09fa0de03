"""The camera of "Lost in space" for robotic telescopes, section 6.1.1, from star frames alone.

The thesis calibrates with a checkerboard and leaves the distortion (equations 8.1 and 8.2) to
future work, 10.2 "autonomous calibration". Here single star frames through a camera like its own
are solved by the default method, and the camera that comes with the answer is compared with the
true one. The errors are root mean squares; one frame is used at a time.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.bench.papers_row import row
from app.core.attitude import attitude_from, radec_deg
from app.core.camera import Camera
from app.core.detections import Detections
from app.core.progress import run
from app.core.solution import Solution
from app.sky import open_catalogue
from app.solve.options import SolveOptions
from app.solve.solver import solve_detections

Floats = NDArray[np.float64]
TRUE = Camera(1200, 630, 1322.0, 585.9, 305.2, k1=-0.12, k2=0.05, p1=6e-4, p2=-4e-4)
PAPER = {"focal_px": 4.3278, "cx": 6.5192, "cy": 4.9683}
NAMES = {
    "focal_px": ("focal length", "px"), "cx": ("principal point in x", "px"),
    "cy": ("principal point in y", "px"), "k1": ("k1", ""), "k2": ("k2", ""), "p1": ("p1", ""),
    "p2": ("p2", ""),
}  # fmt: skip
STARS, NOISE_PX = 400, 0.2
FRAMES, QUICK = 12, 3


def rows(quick: bool, seed: int) -> list[dict[str, Any]]:
    """The root mean square error of every term of the camera."""
    rng = np.random.default_rng(seed)
    found = [_solved(rng) for _ in range(QUICK if quick else FRAMES)]
    cameras = [camera for camera in found if camera is not None]
    note = f"{len(cameras)} of {len(found)} frames solved, one at a time; {STARS} stars"
    out = []
    for key, (what, unit) in NAMES.items():
        off = [getattr(camera, key) - getattr(TRUE, key) for camera in cameras]
        error = float(np.sqrt(np.mean(np.square(off)))) if off else float("nan")
        out.append(
            row("6.1.1", f"calibration: error of {what}", unit=unit, paper=PAPER.get(key),
                ours=error, better="less",
                note=note if key in PAPER else f"true value {getattr(TRUE, key):g}; {note}")
        )  # fmt: skip
    worst = [_worst_px(camera) for camera in cameras]
    out.append(
        row("8.2.2", "calibration: error of a place after correction, worst corner", unit="px",
            paper=None, ours=float(np.mean(worst)) if worst else None, note=note)
    )  # fmt: skip
    return out


def _solved(rng: np.random.Generator) -> Camera | None:
    """The camera found in one frame of a random place."""
    catalogue = open_catalogue()
    z = rng.normal(size=3)
    attitude = attitude_from(
        *radec_deg(z / np.linalg.norm(z)), float(rng.uniform(-180.0, 180.0))
    )  # fmt: skip
    rows = catalogue.brightest(attitude.boresight, float(np.radians(33.0)), 4 * STARS)
    xy = TRUE.project(catalogue.vectors(rows) @ attitude.matrix.T)
    size = np.array([TRUE.width, TRUE.height])
    inside = ((xy > -0.5) & (xy < size - 0.5)).all(axis=1)
    xy = xy[inside][:STARS]
    xy = xy + rng.normal(0.0, NOISE_PX, xy.shape)
    listed = Detections.from_list(np.clip(xy, 0.0, size - 1.0), TRUE.width, TRUE.height)
    answer = run(solve_detections(listed, SolveOptions(fov_deg=TRUE.fov_deg[0])))
    return answer.camera if isinstance(answer, Solution) else None


def _worst_px(camera: Camera) -> float:
    """The largest disagreement over the frame, after the rotation between the two is taken out."""
    from app.attitude.wahba import wahba

    x, y = np.meshgrid(np.linspace(0, TRUE.width - 1, 25), np.linspace(0, TRUE.height - 1, 15))
    grid = np.stack([x.ravel(), y.ravel()], axis=1)
    true, seen = TRUE.unproject(grid), camera.unproject(grid)
    turned = true @ wahba(seen, true).matrix.T
    return float(np.linalg.norm(camera.project(turned) - grid, axis=1).max())
