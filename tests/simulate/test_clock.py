"""Simulated time stands still, is stepped, or runs faster; it never runs backwards."""

import threading
import time
from datetime import UTC, datetime

import pytest

from kochab.simulate import night_sky
from kochab.simulate.night_sky import SimulatedClock


def test_at_rate_zero_time_passes_only_when_asked():
    clock = SimulatedClock(1000.0, rate=0.0)
    assert clock.now_unix() == 1000.0
    assert clock.step(2.5) == 1002.5
    clock.sleep(60.0)
    assert clock.now_unix() == 1062.5
    assert clock.now_utc() == datetime(1970, 1, 1, 0, 17, 42, 500000, tzinfo=UTC)


def test_time_runs_as_much_faster_as_asked():
    clock = SimulatedClock(0.0, rate=1000.0)
    before, real = clock.now_unix(), time.monotonic()
    clock.sleep(50.0)
    passed, really = clock.now_unix() - before, time.monotonic() - real
    assert passed >= 50.0
    assert passed <= 1000.0 * really + 1.0


def test_changing_the_rate_keeps_the_time():
    clock = SimulatedClock(500.0, rate=0.0)
    clock.set_rate(100.0)
    assert 500.0 <= clock.now_unix() < 600.0
    clock.set_rate(0.0)
    assert clock.now_unix() == clock.now_unix()


@pytest.mark.parametrize("wrong", [-1.0, -1e-9])
def test_nothing_runs_backwards(wrong):
    clock = SimulatedClock(0.0, rate=0.0)
    for bad in (clock.step, clock.set_rate):
        with pytest.raises(ValueError, match="backwards"):
            bad(wrong)
    with pytest.raises(ValueError, match="backwards"):
        SimulatedClock(0.0, rate=wrong)


def test_steps_from_many_threads_all_count():
    clock = SimulatedClock(0.0, rate=0.0)
    threads = [threading.Thread(target=lambda: [clock.step(1.0) for _ in range(200)]) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert clock.now_unix() == 1600.0


def test_a_stall_of_the_computer_counts_only_so_much(monkeypatch) -> None:
    real = [0.0]
    monkeypatch.setattr(night_sky.time, "monotonic", lambda: real[0])
    clock = SimulatedClock(100.0, rate=2.0)
    clock.most_s = 0.1
    for passed, expected in ((0.05, 100.1), (3.0, 100.3), (0.1, 100.5)):
        real[0] += passed
        assert clock.now_unix() == pytest.approx(expected)
    clock.most_s = float("inf")
    real[0] += 3.0
    assert clock.now_unix() == pytest.approx(106.5)
