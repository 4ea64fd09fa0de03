"""Frames far apart, as of long exposures: tracking at any cadence whose motion can be foreseen."""

import numpy as np
import pytest

import kochab.solver.tracker as track
from kochab.attitude.filter import begin, predicted, updated
from kochab.core.attitude import Attitude, attitude_from, small_rotation
from kochab.core.mount import SIDEREAL_DEG_S
from kochab.core.progress import run
from kochab.solver.track_prediction import predicted_attitudes
from kochab.solver.tracker import SAME_MOTION_S, Tracker, filter_after_blind_solve

from .stream import ARCSEC, Stream, wide_camera


def on_the_ground(stream: Stream) -> tuple[float, float, float]:
    """The rates, deg/s, of a camera that stands still while the sky goes by."""
    x, y, z = SIDEREAL_DEG_S * stream.matrix[:, 2]
    return float(x), float(y), float(z)


@pytest.mark.parametrize("dt_s", [2.0, 5.0, 60.0])
@pytest.mark.parametrize("ground", [False, True])
def test_the_second_frame_is_tracked_however_late_it_comes(dt_s, ground, monkeypatch) -> None:
    stream, tracker = Stream(wide_camera(fov_deg=3.0), dt_s=dt_s), Tracker()
    assert run(tracker.update(stream.step())).mode == "lost"
    monkeypatch.setattr(track, "examine_frame", None)  # nothing is solved blind any more
    for _ in range(4):
        rate = on_the_ground(stream) if ground else (0.0, 0.0, 0.0)
        update = run(tracker.update(stream.step(rate)))
        assert update.mode == "tracking"
    assert np.abs(stream.error_arcsec(update))[:2].max() < 5 * max(update.sigma_arcsec[:2]) + 0.5
    assert np.allclose(update.rates_deg_s, rate, atol=1.0 / 3600.0)


def test_a_motion_that_is_neither_is_learned_from_two_blind_frames() -> None:
    stream, tracker = Stream(wide_camera(fov_deg=3.0), dt_s=20.0), Tracker()
    rate = (0.0, 60.0 / 3600.0, 0.0)  # 71 px between frames, beyond any window
    updates = [run(tracker.update(stream.step(rate))) for _ in range(5)]
    assert [u.mode for u in updates] == ["lost", "lost", "tracking", "tracking", "tracking"]
    assert max(updates[1].rates_sigma_deg_s) > 0.03  # two pointings do not make a velocity
    assert updates[-1].rates_deg_s == pytest.approx(rate, abs=1.0 / 3600.0)


def test_a_mount_that_stopped_is_found_where_it_was() -> None:
    stream, tracker = Stream(wide_camera(fov_deg=3.0), dt_s=2.0), Tracker()
    for rate in (0.0, 0.0, 0.01, 0.01, 0.01):
        run(tracker.update(stream.step((0.0, rate, 0.0))))
    update = run(tracker.update(stream.step()))
    assert update.mode == "tracking"
    assert np.abs(stream.error_arcsec(update))[:2].max() < 2.0


def test_a_certain_prediction_is_looked_at_in_small_windows_and_first() -> None:
    camera, attitude = wide_camera(), attitude_with_sigma()
    state = begin(attitude, 0.0)
    for k in range(1, 6):
        state = updated(predicted(state, 0.1 * k), attitude)
    first, *others = predicted_attitudes(state, 0.6, camera, 2.8)
    assert first.half < 16
    assert [other.half for other in others] == [32]  # a tenth of a second: sky is ground


def test_an_uncertain_prediction_grows_its_windows_and_adds_sky_and_ground() -> None:
    camera, attitude = wide_camera(fov_deg=3.0), attitude_with_sigma()
    state = begin(attitude, 0.0)
    found = list(predicted_attitudes(state, 60.0, camera, 2.8))
    assert [place.half for place in found] == [64, 64]
    turned = found[1].ahead.matrix @ state.matrix.T
    assert np.degrees(np.arccos((np.trace(turned) - 1) / 2)) == pytest.approx(SIDEREAL_DEG_S * 60, rel=1e-6)


def test_of_a_jump_between_late_frames_no_velocity_is_made() -> None:
    before = begin(attitude_with_sigma(), 0.0)
    later = 10.0 * SAME_MOTION_S
    jump = attitude_with_sigma(small_rotation(np.radians([3.0, 0.0, 0.0])) @ before.matrix)
    assert not filter_after_blind_solve(before, jump, later, True).rates_rad_s.any()
    slow = attitude_with_sigma(small_rotation(np.array([-900.0, 0.0, 0.0]) * ARCSEC) @ before.matrix)
    state = filter_after_blind_solve(before, slow, later, True)
    assert state.rates_rad_s / ARCSEC == pytest.approx([30.0, 0.0, 0.0], abs=1e-6)
    assert max(state.rates_sigma_deg_s) * 3600 == pytest.approx(120.0)


def attitude_with_sigma(matrix=None) -> Attitude:
    matrix = attitude_from(84.0, -2.0, 25.0).matrix if matrix is None else matrix
    return Attitude(matrix, np.eye(3) * (2.0 * ARCSEC) ** 2)
