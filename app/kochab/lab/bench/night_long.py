"""How long the whole ``kochab night`` command takes for 24-megapixel frames."""

import subprocess
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from kochab.core.frame import Frame, Hint
from kochab.frames import read_frame
from kochab.frames.fits_write import write_fits
from kochab.lab.bench import Row, children_s
from kochab.lab.bench.serve import KOCHAB, rendered

SIZE = (6000, 4000, 3.3)
"""Width and height in pixels, and width in degrees."""
BEGAN, EVERY_S, EXPOSURE_S, NOISE = datetime(2026, 11, 20, 20, tzinfo=UTC), 40.0, 30.0, 8.0
DRIFT_PX = (2, 1)
"""From frame to frame, across and down."""


def long_night(count: int, workers: int) -> Row:
    """Seconds on the wall and of processor for so many frames, written first: one sky, drifting, each with its noise.

    They are as many as a disk holds (48 MB each); the bench's goal counts on from them.
    """
    with TemporaryDirectory(prefix="kochab-bench-") as name:
        folder = Path(name)
        sky, chance = read_frame(rendered(folder / "sky.fits", *SIZE)), np.random.default_rng(24)
        frames = folder / "frames"
        frames.mkdir()
        for k in range(count):
            moved = np.roll(sky.pixels, (DRIFT_PX[1] * k, DRIFT_PX[0] * k), axis=(0, 1))
            noise = chance.normal(0.0, NOISE, moved.shape).astype(np.float32)
            pixels = np.clip(moved + noise, 0.0, 65535.0).astype(np.uint16)
            hint = Hint(time_utc=BEGAN + timedelta(seconds=EVERY_S * k), exposure_s=EXPOSURE_S, camera="24 MP")
            write_fits(Frame(pixels, hint=hint), frames / f"light_{k:03d}.fits")
        command = [*KOCHAB, "night", str(frames), "--workers", str(workers), "--out", str(folder)]
        began, before = time.perf_counter(), children_s()
        done = subprocess.run(command, capture_output=True, text=True)
        wall_s, cpu_s = time.perf_counter() - began, children_s() - before
    solved = done.returncode == 0 and f"{count} of {count} frames solved" in done.stdout
    spent = {"wall, s": wall_s, "ms a frame": 1e3 * wall_s / count, "processor, s": cpu_s}
    return {"frames": count, "workers": workers, "all solved": solved, **spent}
