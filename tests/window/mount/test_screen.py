"""The whole way on a virtual screen: practice, connect over the line, solve, sync, M 42 centred."""

import json
import subprocess
import sys

import numpy as np
from PIL import Image

from tests.window.test_screen import REPOSITORY, environment, screen

__all__ = ["environment", "screen"]  # fixtures


def test_a_practice_night_ends_with_m_42_in_the_middle(environment, tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "tests.window.practice_on_screen", str(tmp_path), "--plain"],
        cwd=REPOSITORY,
        env=environment,
        capture_output=True,
        text=True,
        timeout=280,
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    told = json.loads(done.stdout.splitlines()[-1])
    assert told["platform"] == "xcb"
    assert "mount is off by 3.00°" in told["off_at_first"]
    assert told["said"].startswith("M 42 is centred to ")
    assert told["away_arcsec"] < 60.0, "the telescope truly points there"
    day, night = (np.asarray(Image.open(tmp_path / n).convert("RGB")) for n in ("mount.png", "mount-night.png"))
    assert day.shape == (860, 1360, 3)
    assert not night[..., 1:].any()
    assert night[..., 0].max() == 255
