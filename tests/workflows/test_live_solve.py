"""Continuous solving: newest first, honest ages, an immediate end, and what happens when unplugged."""

import threading
import time
from datetime import UTC, datetime, timedelta
from itertools import islice

import pytest

from kochab.core.capture import CaptureSettings
from kochab.core.errors import LineLostError, PortError
from kochab.core.frame import Hint
from kochab.core.progress import Progress, run
from kochab.core.solution import NoSolution
from kochab.workflows.live.capture import Capture
from kochab.workflows.live.solve import live_solve
from kochab.workflows.live.update import LiveUpdate

from .live_sources import Clockwork, Told, posted, refusal, solution


def updates(live):
    return (step for step in live if isinstance(step, LiveUpdate))


def test_under_a_slow_solver_the_newest_is_next_and_nothing_queues() -> None:
    source, engine = Clockwork(every_s=0.005), Told(slow_s=0.1)
    capture = Capture(lambda: source)
    told = []
    run(posted(live_solve(capture, engine, frames=8), told.append))
    assert len(told) == len(engine.seen) == 8
    assert engine.seen == sorted(set(engine.seen))
    steps = [b - a for a, b in zip(engine.seen, engine.seen[1:], strict=False)]
    assert max(steps) > 3  # some were overtaken
    box = capture.mailbox
    assert box.put_count - box.taken - box.dropped in (0, 1)  # at most one waits
    assert told[-1].dropped > 8
    assert told[-1].frames_hz > 2 * told[-1].solved_hz


def test_all_calls_to_the_camera_come_from_one_thread_that_is_not_ours() -> None:
    source = Clockwork(every_s=0.001)
    run(posted(live_solve(Capture(lambda: source), Told(), frames=3), lambda u: None))
    assert len(source.threads) == 1
    assert threading.get_ident() not in source.threads
    assert source.closed == 1


def test_closing_the_generator_stops_at_once_and_gives_the_camera_back() -> None:
    source = Clockwork(every_s=0.01)
    capture = Capture(lambda: source)
    live = live_solve(capture, Told())
    next(updates(live))
    live.close()
    assert source.closed == 1
    assert not capture.running
    given = source.given
    time.sleep(0.05)
    assert source.given == given


def test_every_step_can_be_the_last() -> None:
    for steps in range(1, 12):
        source = Clockwork(every_s=0.001)
        task = posted(live_solve(Capture(lambda s=source: s), Told()), lambda u: None)
        for _ in islice(task, steps):
            pass
        task.close()
        assert source.closed == (steps > 1)  # the first step opens nothing yet


def test_while_no_frame_comes_there_is_a_chance_to_stop() -> None:
    source = Clockwork(every_s=100.0)
    source.next_frame = lambda timeout_s: time.sleep(timeout_s)
    live = live_solve(Capture(lambda: source), Told())
    steps = list(islice(live, 5))
    live.close()
    assert all(isinstance(step, Progress) for step in steps)
    assert steps[-1].stage == "wait for a frame"
    assert source.closed == 1


def test_unplugged_in_the_middle_is_one_sentence_after_the_last_frame() -> None:
    source = Clockwork(every_s=0.02, frames=4)
    told = []
    with pytest.raises(LineLostError, match="unplugged"):
        run(posted(live_solve(Capture(lambda: source), Told()), told.append))
    assert told[-1].shot.number == 4
    assert source.closed == 1


def test_a_lost_camera_can_be_waited_for(monkeypatch) -> None:
    monkeypatch.setattr("kochab.workflows.live.capture.RETRY_S", 0.01)
    cameras = []

    def opened():
        if len(cameras) in (1, 2):  # lost, and not back at once
            cameras.append(None)
            raise PortError("There is no camera.")
        cameras.append(Clockwork(every_s=0.02, frames=3))
        return cameras[-1]

    capture = Capture(opened, reconnect=True)
    live, told, said = live_solve(capture, Told()), [], []
    for step in live:
        if isinstance(step, LiveUpdate):
            told.append(step.shot.number)
            said += step.warnings
            if len(told) == 5:
                break
        elif step.stage == "warning":
            said.append(step.detail)
    live.close()
    assert told == sorted(set(told))  # numbers go on after the loss
    assert any("unplugged. Kochab reconnects as soon as it is back" in s for s in said)
    assert all(c is None or c.closed == 1 for c in cameras)
    with pytest.raises(PortError):  # but one that never was there is told at once
        run(posted(live_solve(Capture(absent, reconnect=True), Told()), lambda u: None))


def absent():
    raise PortError("There is no camera.")


def test_a_camera_that_cannot_be_opened_and_a_fault_of_ours_both_come_through() -> None:
    with pytest.raises(PortError, match="no camera"):
        run(posted(live_solve(Capture(absent), Told()), lambda u: None))
    source = Clockwork()
    source.next_frame = None
    with pytest.raises(TypeError):
        run(posted(live_solve(Capture(lambda: source), Told()), lambda u: None))
    assert source.closed == 1


def test_a_fault_in_the_solver_gives_the_camera_back() -> None:
    source = Clockwork()
    with pytest.raises(ZeroDivisionError):
        run(posted(live_solve(Capture(lambda: source), Told(lambda n: 1 // 0)), lambda u: None))
    assert source.closed == 1


def test_a_lost_frame_keeps_the_last_pointing_marked_old() -> None:
    engine = Told(lambda n: solution() if n < 3 else refusal(), slow_s=0.02)
    source = Clockwork(every_s=0.02)
    live = live_solve(Capture(lambda: source), engine, frames=6)
    told = list(updates(live))
    assert not told[0].is_old
    assert isinstance(told[-1].result, NoSolution)
    assert told[-1].mode == "lost"
    last = told[-1]
    assert last.is_old
    assert last.drift is None
    assert last.last_good.number < 3
    assert last.last_good.age_s(time.monotonic()) > last.age_s(time.monotonic()) > 0
    now = last.done_s
    assert last.last_good.age_s(now + 60) == pytest.approx(last.last_good.age_s(now) + 60)


def test_nothing_is_old_before_the_first_pointing() -> None:
    live = live_solve(Capture(Clockwork), Told(lambda n: refusal()), frames=1)
    update = next(updates(live))
    assert update.last_good is None
    assert not update.is_old
    live.close()


@pytest.mark.parametrize(
    ("hint", "low_s", "high_s"),
    [
        (lambda now: Hint(time_utc=now - timedelta(hours=3)), 10800, 10860),  # an old file
        (lambda now: Hint(exposure_s=30.0), 15.0, 60.0),
        (lambda now: Hint(), 0.0, 45.0),
    ],
)
def test_the_age_is_since_mid_exposure(hint, low_s, high_s) -> None:
    source = Clockwork(hint=hint(datetime.now(UTC)))
    live = live_solve(Capture(lambda: source), Told())
    update = next(updates(live))
    live.close()
    assert low_s <= update.age_s(time.monotonic()) < high_s
    assert update.latency_ms < 45e3


def test_a_frame_from_the_future_is_told_as_a_wrong_clock() -> None:
    ahead = Hint(time_utc=datetime.now(UTC) + timedelta(hours=1), exposure_s=2.0)
    live = live_solve(Capture(lambda: Clockwork(hint=ahead)), Told())
    update = next(updates(live))
    live.close()
    assert any("in the future" in w and "clock" in w for w in update.warnings)
    assert 1.0 <= update.age_s(time.monotonic()) < 60.0


def test_a_simulated_clock_is_the_sources_own() -> None:
    source = Clockwork(hint=Hint(time_utc=datetime(2031, 1, 1, tzinfo=UTC)))
    source.now_utc = lambda: datetime(2031, 1, 1, 0, 0, 2, tzinfo=UTC)
    live = live_solve(Capture(lambda: source), Told())
    update = next(updates(live))
    live.close()
    assert update.warnings == ()
    assert 2.0 <= update.age_s(time.monotonic()) < 60.0


def test_the_camera_can_be_set_while_it_runs_and_a_refusal_is_a_warning() -> None:
    source = Clockwork(every_s=0.01)
    capture = Capture(lambda: source)
    live = live_solve(capture, Told())
    next(updates(live))
    assert capture.limits.exposure_s == (0.001, 30.0)
    assert capture.in_force.exposure_s == 1.0
    capture.configure(CaptureSettings(exposure_s=5.0))
    while capture.in_force.exposure_s != 5.0:
        next(live)
    capture.configure(CaptureSettings(exposure_s=100.0))
    assert "at most 30 s" in told_at_last(live)
    assert capture.in_force.exposure_s == 5.0
    live.close()


def told_at_last(live):
    """The first warning, whichever way it comes, or nothing."""
    for step in islice(live, 500):
        if isinstance(step, LiveUpdate) and step.warnings:
            return step.warnings[0]
        if isinstance(step, Progress) and step.stage == "warning":
            return step.detail
    return ""


def test_a_refusal_outlives_the_frame_that_was_overtaken() -> None:
    capture = Capture(lambda: Clockwork(every_s=0.005))
    live = live_solve(capture, Told())
    next(updates(live))
    capture.configure(CaptureSettings(exposure_s=100.0))
    dropped = capture.mailbox.dropped
    while capture.mailbox.dropped < dropped + 5:
        time.sleep(0.01)
    assert "at most 30 s" in told_at_last(live)
    live.close()


def test_what_a_camera_tells_between_frames_is_told() -> None:
    source = Clockwork()
    source.next_frame = lambda timeout_s: time.sleep(0.01)
    source.complaints = lambda: ("File skipped: it is broken.",)
    live = live_solve(Capture(lambda: source), Told())
    said = next(s for s in live if isinstance(s, Progress) and s.stage == "warning")
    live.close()
    assert "broken" in said.detail
