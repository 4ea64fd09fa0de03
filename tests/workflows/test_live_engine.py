"""A camera is known better the next night."""

import numpy as np
import pytest

from kochab.core.errors import KochabError
from kochab.core.progress import run
from kochab.solver import SolveOptions
from kochab.solver.camera_profile import profile_path
from kochab.solver.tracker import Tracker
from kochab.workflows.live.solve import ProfiledTracker

from .live_sky import CAMERA, sky_frame

OPTIONS = SolveOptions(fov_deg=12.0)


@pytest.fixture(autouse=True)
def often(monkeypatch):
    """Every second frame improves the camera."""
    monkeypatch.setattr(Tracker, "calibrate_every", 2)


def night(folder, frames, start_s=0.0, name="guide scope"):
    engine = ProfiledTracker(name, OPTIONS, folder)
    for k in range(frames):
        frame = sky_frame(seconds=start_s + k, seed=int(start_s) + k)
        update = run(engine.update(frame, frame.hint.time_utc))
        assert update.solution is not None
    return engine


def test_what_was_learned_is_kept_and_recalled(tmp_path) -> None:
    first = night(tmp_path, 5)
    path = first.keep()
    assert path == profile_path("guide scope", 800, 600, tmp_path)
    second = night(tmp_path, 5, start_s=3600.0)
    assert second.profile.frames > first.profile.frames
    assert second.profile.sigma["focal_px"] < first.profile.sigma["focal_px"]
    pull = (second.profile.camera.focal_px - CAMERA.focal_px) / second.profile.sigma["focal_px"]
    assert abs(pull) < 5
    assert night(tmp_path, 1, name="another lens").profile.frames <= 1


def test_nothing_is_kept_of_nothing(tmp_path) -> None:
    engine = ProfiledTracker("guide scope", OPTIONS, tmp_path)
    assert engine.profile is None
    assert engine.keep() is None
    dark = sky_frame()
    dark.pixels[:] = np.random.default_rng(1).normal(500, 5, dark.pixels.shape)
    assert run(engine.update(dark)).solution is None
    assert engine.keep() is None
    assert list(tmp_path.iterdir()) == []


def test_a_spoilt_profile_is_one_sentence(tmp_path) -> None:
    path = profile_path("guide scope", 800, 600, tmp_path)
    path.write_text("{")
    with pytest.raises(KochabError, match="delete it to start a new one"):
        night(tmp_path, 1)
