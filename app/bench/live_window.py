"""The same stream with the real window drawing, in a process of its own.

The window is above this room and is only known by the name of the module to run.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import app
from app.bench.live_stream import EXPOSURE_S, Ring

MODULE = "app.ui.live.measure"
FPS = 32.0  # a little more than is asked for: a camera of 30 could at best reach the goal


def window_row(ring: Ring, what: str, seconds: float) -> dict[str, Any]:
    """A row of frames drawn and tracked a second and of milliseconds, mid-exposure to overlay.

    Without a screen Qt draws into memory, which ``platform`` tells. A window that does not run is
    told in ``trouble``.
    """
    with tempfile.TemporaryDirectory(prefix="kochab-bench-") as folder:
        np.save(Path(folder, "frames.npy"), np.array([frame.pixels for frame in ring.frames]))
        about = {
            "fps": FPS, "seconds": seconds, "exposure_s": EXPOSURE_S,
            "bayer": ring.frames[0].bayer,
        }  # fmt: skip
        Path(folder, "about.json").write_text(json.dumps(about), "utf-8")
        row = {"what": f"{what} in the window at {FPS:g} frames a second"}
        return row | _run(folder, seconds)


def _run(folder: str, seconds: float) -> dict[str, Any]:
    environment = dict(os.environ)
    screen = any(environment.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
    if sys.platform.startswith("linux") and not screen:
        environment.setdefault("QT_QPA_PLATFORM", "offscreen")
    try:
        done = subprocess.run(
            [sys.executable, "-m", MODULE, folder], cwd=Path(app.__file__).parent.parent,
            env=environment, capture_output=True, text=True, timeout=120.0 + seconds,
        )  # fmt: skip
        told: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    except (OSError, ValueError, IndexError, subprocess.TimeoutExpired) as error:
        return {"trouble": type(error).__name__}
    return told
