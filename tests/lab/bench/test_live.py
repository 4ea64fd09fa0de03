import numpy as np
import pytest

from kochab.core.mount import Direction
from kochab.core.progress import run
from kochab.lab.bench import live_stream
from kochab.lab.bench.live import at_frame_rate, goals, measure, resident_mb, soak
from kochab.lab.bench.live_stream import average_rows, make_ring, off_arcsec, slew, slew_rig, true_rates
from kochab.solver.tracker import Tracker


@pytest.fixture(scope="module")
def ring():
    return make_ring(640, 480, count=5, swing_deg=0.05)


def test_the_ring_goes_forth_and_back_and_is_what_it_says(ring) -> None:
    truths = [truth for _, _, truth in ring.stream(10, 10.0)]
    assert np.array_equal(truths[0], truths[8])
    assert np.array_equal(truths[3], truths[5])
    frame, moment, truth = next(ring.stream(1, 10.0))
    solved = run(Tracker().update(frame, moment)).solution
    axis = ring.camera.unproject(np.array([[319.5, 239.5]]))[0] @ truth
    assert np.degrees(np.arccos(min(1.0, axis @ solved.centre_vector))) * 3600 < 3.0
    assert off_arcsec(truth, truth) == pytest.approx([0, 0, 0])


def test_every_frame_but_the_first_is_timed(ring) -> None:
    row = measure(ring, 12, "small")
    assert row["frames"] == 12
    assert row["tracked"] == 1.0
    assert 0 < row["median_ms"] <= row["p95_ms"] <= row["worst_ms"]
    assert row["frames_s"] > 0


def test_paced_and_soaked(ring, monkeypatch) -> None:
    monkeypatch.setattr("kochab.lab.bench.live.make_ring", lambda *_: ring)
    slow = at_frame_rate(ring, 0.5, 10.0)
    assert slow["frames"] == 5
    assert slow["cores"] > 0
    long = soak(40, lambda _: None)
    assert long["frames"] == 40
    assert long["tracked"] > 0.9
    assert abs(long["growth_mb"]) < 50
    assert resident_mb() > 20


def test_a_commanded_path_is_followed(monkeypatch) -> None:
    legs = (("tracking", None, 0.0, 0.6), ("1 deg/s", Direction.NORTH, 1.0, 1.5))
    monkeypatch.setattr(live_stream, "LEGS", legs)
    still, fast = slew(7, 10.0, lambda _: None)
    assert still["frames"] == 6
    assert fast["fastest_deg_s"] == pytest.approx(1.0, abs=0.1)
    assert fast["tracked"] > 0.7
    assert still["pointing_rms_arcsec"] < 3
    assert fast["pointing_rms_arcsec"] < 10


def test_true_rates_are_those_of_the_path() -> None:
    rig = slew_rig(3)
    rig.mount.move(Direction.NORTH, 0.5)
    rig.clock.sleep(2.0)
    rates = true_rates(rig, rig.clock.now_unix()) / 3600.0
    assert np.linalg.norm(rates[:2]) == pytest.approx(0.5, abs=0.05)


def test_averages_fall_as_predicted() -> None:
    rows = average_rows(40, 5)
    one, four = rows[0], rows[1]
    assert four["pointing_rms_arcsec"] < 0.75 * one["pointing_rms_arcsec"]
    assert one["predicted_arcsec"] == pytest.approx(one["pointing_rms_arcsec"], rel=0.8)
    assert four["predicted_arcsec"] == pytest.approx(one["predicted_arcsec"] / 2, rel=0.1)


def test_goals_say_what_was_not_measured() -> None:
    speed = {"frames_s": 100.0, "tracked": 1.0, "p95_ms": 10.0}
    rows = {"1.2 MP": speed, "paced": {"cores": 0.1}, "soak": {"growth_mb": 1.0, "frames": 3000}}
    slews = [{"what": "slew: 1 deg/s", "tracked": 0.9}, {"what": "slew: at rest", "tracked": 0.0}]
    averages = [{"pointing_rms_arcsec": 1.0, "predicted_arcsec": 1.0}]
    found = {g.name: g.met for g in goals(rows, slews, averages)}
    assert found["1.2 MP with the window drawing, frames a second"] is None
    assert found["hours of stream for that"] is None
    assert found["slews, share of frames tracked"] is True
    rows["soak"]["frames"], rows["1.2 MP window"] = 72_000, {"drawn_s": 31.0}
    found = {g.name: g.met for g in goals(rows, slews, averages)}
    assert found["1.2 MP with the window drawing, frames a second"] is True
    assert found["hours of stream for that"] is True
