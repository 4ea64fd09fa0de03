from dataclasses import replace

import numpy as np
import pytest

from kochab.core.camera import Camera
from kochab.core.progress import run
from kochab.solver.camera_profile import Profile, new_profile
from kochab.solver.tracker import Tracker

from .stream import Stream, wide_camera

LENS = wide_camera(cx=330.0, cy=232.0, k1=-0.12)


def follow(tracker: Tracker, stream: Stream, count: int):
    return [run(tracker.update(stream.step((0.05, 0.3, 0.0)))) for _ in range(count)]


def corner_error_px(camera: Camera, truth: Camera) -> float:
    """How far apart two cameras put the corners once the turn between them is taken out."""
    edge = np.array([[0, 0], [639, 0], [0, 479], [639, 479], [320, 0], [0, 240]], dtype=float)
    seen, real = camera.unproject(edge), truth.unproject(edge)
    u, _, vt = np.linalg.svd(seen.T @ real)
    turned = real @ (u @ vt).T
    return float(np.abs(camera.project(turned) - edge).max())


def calibrated(every, profile=None):
    tracker = Tracker(profile=profile)
    tracker.calibrate_every = every
    return tracker


def test_the_camera_becomes_better_over_frames() -> None:
    stream, tracker = Stream(LENS), calibrated(2)
    first = follow(tracker, stream, 1)[0]
    follow(tracker, stream, 40)
    assert tracker.profile.frames > 15
    now = corner_error_px(tracker.camera, LENS)
    assert now < 0.1
    assert now < corner_error_px(first.solution.camera, LENS) + 0.02
    for name, sigma in tracker.profile.sigma.items():
        assert abs(getattr(tracker.profile.camera, name) - getattr(LENS, name)) < 5 * sigma, name


def test_a_profile_of_another_focal_length_is_doubted_and_then_replaced() -> None:
    stream = Stream(LENS)
    tracker = calibrated(1)
    follow(tracker, stream, 12)
    kept: Profile = tracker.profile
    wrong = replace(kept, camera=replace(kept.camera, focal_px=kept.camera.focal_px * 1.004))
    again = calibrated(1, wrong)
    updates = follow(again, stream, 6)
    assert all(u.solution is not None for u in updates)
    assert "profile is off" in updates[0].doubt
    assert updates[0].doubt in updates[0].solution.warnings
    assert (updates[-1].doubt, updates[-1].solution.warnings) == ("", ())
    assert abs(again.profile.camera.focal_px / LENS.focal_px - 1) < 1e-3


def test_another_lens_is_solved_with_the_third_frame() -> None:
    tracker, stream, other = Tracker(), Stream(LENS), Stream(wide_camera(fov_deg=11.0))
    assert follow(tracker, stream, 3)[-1].mode == "tracking"
    other.number = stream.number
    updates = follow(tracker, other, 4)
    assert [u.solution is not None for u in updates] == [False, False, True, True]
    assert updates[-1].solution.camera.fov_deg[0] == pytest.approx(11.0, rel=1e-3)


def test_a_profile_of_another_size_is_left_alone() -> None:
    stream = Stream(LENS)
    tracker = Tracker(profile=new_profile("other", Camera.centred(100, 100, 500.0)))
    assert follow(tracker, stream, 1)[0].solution is not None
    assert tracker.profile.camera.width == 640


def test_without_calibration_the_first_frame_decides() -> None:
    stream = Stream(LENS)
    tracker = calibrated(0)
    follow(tracker, stream, 1)
    before = tracker.camera
    follow(tracker, stream, 5)
    assert tracker.camera == before
