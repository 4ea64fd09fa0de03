"""One camera for several who want its frames."""

import time
from threading import Event, Thread

import numpy as np
import pytest

from kochab.core.capture import CameraSource, CaptureLimits, CaptureSettings
from kochab.core.errors import LineLostError, PortError, RefusedError
from kochab.core.frame import Frame
from kochab.gear.cameras.shared_cameras import SharedCameras


class Device(CameraSource):
    """Gives a numbered frame every ``every_s``; says when two calls overlap."""

    name = "a device"

    def __init__(self, settings=None, every_s=0.01):
        self.settings = settings or CaptureSettings()
        self.every_s, self.count, self.closed, self.overlaps = every_s, 0, 0, 0
        self.set, self.fault, self._inside = [], None, False

    @property
    def limits(self):
        return CaptureLimits(exposure_s=(0.1, 10.0))

    def configure(self, settings):
        with self:
            if settings != CaptureSettings():
                if settings.gain == 13.0:
                    raise RefusedError("A gain of 13 is not to be had.")
                self.set.append(settings)
                self.settings = settings
            return self.settings

    def next_frame(self, timeout_s):
        with self:
            if self.fault is not None:
                raise self.fault
            if timeout_s < self.every_s:
                time.sleep(timeout_s)
                return None
            time.sleep(self.every_s)
            self.count += 1
            return Frame(np.full((2, 2), self.count, np.uint16))

    def close(self):
        with self:
            self.closed += 1

    def now_utc(self):
        return "midnight"

    def complaints(self):
        return ("a broken file",)

    def __enter__(self):
        self.overlaps += self._inside
        self._inside = True

    def __exit__(self, *_):
        self._inside = False


@pytest.fixture
def opened():
    return []


@pytest.fixture
def cameras(opened):
    def open_device(source, address, settings):
        if source == "none":
            raise PortError("No such camera.")
        opened.append(Device(settings))
        return opened[-1]

    return SharedCameras(open_device)


def number(frame):
    return None if frame is None else int(frame.pixels[0, 0])


def test_a_camera_is_opened_once_and_closed_by_the_last(cameras, opened):
    one, other = cameras.open("indi", "host/Camera"), cameras.open("indi", "host/Camera ")
    assert len(opened) == 1
    one.close()
    one.close()
    assert opened[0].closed == 0
    assert number(other.next_frame(1.0)) == 1
    other.close()
    assert opened[0].closed == 1
    cameras.open("indi", "host/Camera").close()
    cameras.open("indi", "host/Other").close()
    assert [device.closed for device in opened] == [1, 1, 1]


def test_all_are_given_the_same_frames_newest_first_and_calls_never_overlap(cameras, opened):
    stop, given = Event(), {name: [] for name in "abc"}

    def watch(name):
        share = cameras.open("webcam", "0")
        while not stop.is_set():
            frame = share.next_frame(0.1)
            if frame is not None:
                given[name].append(number(frame))
            if name == "c":
                share.configure(CaptureSettings(exposure_s=1.0))
        share.close()

    watchers = [Thread(target=watch, args=(name,)) for name in "abc"]
    for watcher in watchers:
        watcher.start()
    end = time.monotonic() + 90.0
    while min(map(len, given.values())) < 20 and time.monotonic() < end:
        time.sleep(0.01)
    stop.set()
    for watcher in watchers:
        watcher.join(5.0)
    device, *none = opened
    assert none == []
    assert device.overlaps == 0
    assert device.closed == 1
    for numbers in given.values():
        assert len(numbers) >= 20
        assert numbers == sorted(set(numbers))  # none twice, none old
    assert set(given["a"]) & set(given["b"])


def test_a_frame_that_came_for_another_is_had_at_once(cameras):
    busy, idle = cameras.open("webcam", "0"), cameras.open("webcam", "0")
    for _ in range(3):
        busy.next_frame(1.0)
    assert number(idle.next_frame(0.0)) == 3
    assert idle.next_frame(0.0) is None
    assert number(idle.next_frame(1.0)) == 4


def test_settings_are_those_of_the_first_until_somebody_sets_others(cameras, opened):
    first = cameras.open("indi", "a", CaptureSettings(exposure_s=2.0))
    second = cameras.open("indi", "a", CaptureSettings(exposure_s=0.5, gain=7.0))
    assert second.in_force.exposure_s == 2.0
    assert first.configure(CaptureSettings(exposure_s=3.0)).exposure_s == 3.0
    assert second.in_force.exposure_s == 3.0
    first.close()
    second.next_frame(1.0)
    assert opened[0].set == [CaptureSettings(exposure_s=3.0), CaptureSettings(exposure_s=0.5, gain=7.0)]
    with pytest.raises(RefusedError, match="13"):
        second.configure(CaptureSettings(gain=13.0))
    assert number(second.next_frame(1.0)) == 2


def test_a_lost_camera_is_told_to_all_and_can_be_opened_again(cameras, opened):
    shares = [cameras.open("indi", "a") for _ in range(2)]
    opened[0].fault = LineLostError("The cable was pulled.")
    for share in shares:
        with pytest.raises(LineLostError, match="cable"):
            share.next_frame(1.0)
    again = cameras.open("indi", "a")  # though the others have not left yet
    assert number(again.next_frame(1.0)) == 1
    for share in shares:
        share.close()
    assert [device.closed for device in opened] == [1, 0]


def test_one_that_cannot_be_opened_is_tried_anew(cameras):
    for _ in range(2):
        with pytest.raises(PortError, match="No such camera"):
            cameras.open("none", "")


def test_whoever_comes_while_it_is_opened_or_closed_waits(opened):
    opening, may_open, closing, may_close = Event(), Event(), Event(), Event()

    def slow_to_open(*_):
        device = Device()
        opened.append(device)
        opening.set()
        may_open.wait(10.0)
        return device

    cameras, shares = SharedCameras(slow_to_open), []

    def second(step, begun, go_on):
        """Open the camera from another view during ``step``; whether it was open before that ended."""
        first, other = Thread(target=step), Thread(target=lambda: shares.append(cameras.open("indi", "a")))
        first.start()
        begun.wait(10.0)
        other.start()
        other.join(0.3)
        early = len(opened)
        go_on.set()
        first.join(10.0)
        other.join(10.0)
        return early

    assert second(lambda: shares.append(cameras.open("indi", "a")), opening, may_open) == 1
    assert len(opened) == 1
    opened[0].close = lambda: closing.set() or may_close.wait(10.0)
    shares.pop().close()
    assert second(shares.pop().close, closing, may_close) == 1
    assert len(opened) == 2
    assert len(shares) == 1


def test_one_that_fails_once_opened_is_closed(opened):
    class Broken(Device):
        def configure(self, settings):
            raise LineLostError("The cable was pulled.")

    cameras = SharedCameras(lambda *_: opened.append(Broken()) or opened[-1])
    for _ in range(2):
        with pytest.raises(LineLostError, match="cable"):
            cameras.open("indi", "a")
    assert [device.closed for device in opened] == [1, 1]


def test_it_tells_what_the_camera_tells(cameras):
    share = cameras.open("simulated", "new")
    assert share.limits.exposure_s == (0.1, 10.0)
    assert share.name == "a device"
    assert share.now_utc() == "midnight"
    assert share.complaints() == ("a broken file",)


def test_whoever_waits_is_not_kept_from_setting_it(cameras, opened):
    share, other = cameras.open("indi", "a"), cameras.open("indi", "a")
    opened[0].every_s = 1e9  # gives nothing any more
    waiting = Thread(target=share.next_frame, args=(60.0,))
    waiting.start()
    other.configure(CaptureSettings(exposure_s=1.0))
    assert waiting.is_alive()
    opened[0].every_s = 0.01
    waiting.join(10.0)
    assert not waiting.is_alive()
    assert opened[0].overlaps == 0
