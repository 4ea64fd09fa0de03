"""A fresh frame was begun after it was asked for; an old one never passes for it."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from kochab.core.capture import CameraSource
from kochab.core.errors import NoAnswerError
from kochab.core.frame import Frame, Hint
from kochab.core.progress import run
from kochab.core.solution import NoSolution
from kochab.workflows.fresh_frame import CameraFrames, _began_after, fresh_frame, lost_in_space

NOW = datetime(2026, 1, 15, 22, 0, tzinfo=UTC)


class Camera(CameraSource):
    """Gives frames by name at set moments of its own clock; None is a slice without one."""

    name = "scripted"

    def __init__(self, frames, clock=True):
        self.coming = list(frames)
        self.time = NOW
        if clock:
            self.now_utc = lambda: self.time

    def next_frame(self, timeout_s):
        self.time += timedelta(seconds=1.0)
        return self.coming.pop(0) if self.coming else None


def frame(name, middle_s=None, exposure_s=2.0, **hint):
    when = None if middle_s is None else NOW + timedelta(seconds=middle_s)
    return Frame(np.zeros((40, 60), np.uint16), path=name, hint=Hint(time_utc=when, exposure_s=exposure_s, **hint))


def test_what_was_waiting_or_begun_before_is_left() -> None:
    camera = Camera([frame("waiting", -5.0), frame("begun before", 0.5), frame("fresh", 1.6)])
    camera.time += timedelta(seconds=3.0)
    camera.now_utc = iter([NOW, NOW + timedelta(seconds=3), NOW + timedelta(seconds=5)]).__next__
    assert run(fresh_frame(camera)).path == "fresh"


def test_without_times_the_second_to_arrive_was_begun_after() -> None:
    camera = Camera([frame("waiting"), frame("doubtful"), None, frame("second")])
    assert run(fresh_frame(camera)).path == "second"


def test_a_camera_whose_clock_is_an_hour_off_still_serves() -> None:
    for wrong_s in (3600.0, -3600.0):
        camera = Camera([None, frame("doubtful", wrong_s), frame("second", wrong_s + 3.0)])
        assert run(fresh_frame(camera)).path == "second"


def test_a_camera_that_gives_nothing_is_given_up_in_a_sentence() -> None:
    with pytest.raises(NoAnswerError, match="Is it exposing"):
        run(fresh_frame(Camera([]), patience_s=0.0))


def test_the_place_in_the_header_is_not_believed() -> None:
    told = frame("x", centre_deg=(10.0, 20.0, 5.0), scale_arcsec_px=(6.0, 7.0))
    left = lost_in_space(told).hint
    assert left.centre_deg is None
    assert left.scale_arcsec_px == (6.0, 7.0)


def test_the_time_of_the_last_frame_is_told_unless_only_its_file_dates_it() -> None:
    for of_file, told in ((False, NOW + timedelta(seconds=3.0)), (True, None)):
        coming = [frame("waiting"), frame("a", -9.0), frame("b", 3.0, time_of_file=of_file)]
        frames = CameraFrames(Camera(coming))
        assert isinstance(run(frames.solve_now()), NoSolution)
        assert frames.time_utc == told


@pytest.mark.parametrize(
    ("exposure_s", "middle_s", "fresh"),
    [(None, 0.2, True), (None, -0.2, False), (4.0, 2.2, True), (4.0, 1.8, False), (2.0, 61.5, False)],
)
def test_a_frame_is_fresh_that_was_begun_since_and_not_in_the_future(exposure_s, middle_s, fresh):
    """A file's time is mid-exposure; a frame of unknown exposure was a moment."""
    since = datetime(2026, 3, 14, 21, 0, tzinfo=UTC)
    hint = Hint(time_utc=since + timedelta(seconds=middle_s), exposure_s=exposure_s)
    frame = Frame(np.zeros((8, 8), np.uint8), hint=hint)
    assert _began_after(frame, since, since + timedelta(seconds=60.0)) is fresh
    assert not _began_after(replace(frame, hint=Hint(exposure_s=exposure_s)), since, since)
