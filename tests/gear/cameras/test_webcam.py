"""Video cameras through FFmpeg. No webcam is at hand where this was written: a network camera
stands in for the stream, and a made-up driver for exposure and gain."""

import threading
import time
from datetime import UTC, datetime

import numpy as np
import pytest

from kochab.core.capture import CaptureLimits, CaptureSettings
from kochab.core.errors import LineLostError, PortError, RefusedError
from kochab.gear.cameras import list_devices, open_camera
from kochab.gear.cameras.uvc import Controls, Webcam, _samples

from .mjpeg_server import NetworkCamera

av = pytest.importorskip("av")


@pytest.fixture
def network_camera():
    camera = NetworkCamera()
    yield camera
    camera.stop()


@pytest.fixture
def camera(network_camera):
    camera = open_camera("webcam", network_camera.url)
    yield camera
    camera.close()


def taken(camera):
    for _ in range(100):
        frame = camera.next_frame(0.2)
        if frame is not None:
            return frame
    raise AssertionError("no frame came")


def until_lost(camera):
    for _ in range(200):
        camera.next_frame(0.1)
    raise AssertionError("the loss was not noticed")


def test_pictures_come_and_the_newest_is_next(network_camera, camera) -> None:
    first = taken(camera)
    assert first.pixels.shape == (120, 160)
    sent = network_camera.sent
    while network_camera.sent < sent + 15:
        time.sleep(0.01)
    before = datetime.now(UTC)
    second = taken(camera)
    # At 15 pictures later the value has grown by nearly 15, not by one.
    assert second.pixels.mean() - first.pixels.mean() > 8
    assert abs((second.hint.time_utc - before).total_seconds()) < 10
    assert second.hint.exposure_s is None


def test_colour_is_kept_and_its_luminance_is_that_of_files(network_camera) -> None:
    from kochab.frames.samples import luminance

    network_camera.colour = True
    camera = open_camera("webcam", network_camera.url)
    frame = taken(camera)
    camera.close()
    assert frame.colour.shape == (120, 160, 3)
    r, g, b = (frame.colour[..., k].mean() for k in range(3))
    assert r > g > b
    assert np.array_equal(frame.pixels, luminance(frame.colour))
    assert frame.saturation == 1020


def test_a_closed_camera_has_been_given_back(network_camera) -> None:
    """Its reader is over with it when ``close`` returns: a device can be opened once at a time."""
    before = {*threading.enumerate()}
    camera = open_camera("webcam", network_camera.url)
    taken(camera)
    camera.close()
    assert [thread.name for thread in {*threading.enumerate()} - before if thread.name == "kochab-webcam"] == []


def test_unplugged_in_the_middle(network_camera, camera) -> None:
    taken(camera)
    network_camera.unplugged.set()
    with pytest.raises(LineLostError, match=r"stopped sending frames: .*\. Check its cable"):
        until_lost(camera)


def test_silent_in_the_middle(network_camera, camera, monkeypatch) -> None:
    taken(camera)
    network_camera.silent.set()
    monkeypatch.setattr("kochab.gear.cameras.uvc.SILENCE_S", 0.5)
    with pytest.raises(LineLostError, match="stopped sending frames"):
        until_lost(camera)


def test_a_stream_cannot_be_set(camera) -> None:
    assert camera.limits == CaptureLimits()
    assert camera.configure(CaptureSettings()) == CaptureSettings()
    with pytest.raises(RefusedError, match="exposure of this camera cannot be set"):
        camera.configure(CaptureSettings(exposure_s=1.0))


def test_what_cannot_be_opened_is_said(tmp_path) -> None:
    for address in ("/dev/video97", "97", "http://127.0.0.1:9/video", str(tmp_path)):
        with pytest.raises(PortError) as caught:
            open_camera("webcam", address)
        assert "\n" not in str(caught.value)
    text = tmp_path / "a.mp4"
    text.write_text("no film")
    with pytest.raises(PortError, match="cannot be opened as a video camera"):
        open_camera("webcam", str(text))


def test_a_film_is_read_to_its_end(tmp_path) -> None:
    path = tmp_path / "film.avi"
    with av.open(str(path), "w") as film:
        stream = film.add_stream("mjpeg", rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuvj420p"
        for k in range(5):
            grey = np.full((48, 64, 3), 40 * k, np.uint8)
            film.mux(stream.encode(av.VideoFrame.from_ndarray(grey, format="rgb24")))
        film.mux(stream.encode(None))
    camera = open_camera("webcam", str(path))
    assert taken(camera).pixels.shape == (48, 64)
    with pytest.raises(LineLostError, match="its stream ended"):
        until_lost(camera)
    camera.close()


def test_deep_grey_and_mosaics_stay_as_they_are() -> None:
    deep = np.arange(64 * 48, dtype=np.uint16).reshape(48, 64) * 20
    samples, bayer = _samples(av.VideoFrame.from_ndarray(deep, format="gray16le"))
    assert np.array_equal(samples, deep)
    assert bayer is None
    flat = (deep >> 8).astype(np.uint8)
    samples, bayer = _samples(av.VideoFrame.from_ndarray(flat, format="gray"))
    assert np.array_equal(samples, flat)
    samples, bayer = _samples(av.VideoFrame.from_ndarray(flat, format="bayer_grbg8"))
    assert np.array_equal(samples, flat)
    assert bayer == "GRBG"


class Control:
    """A made-up V4L2 control: whole numbers within bounds."""

    def __init__(self, value, minimum, maximum, broken=False):
        self._value, self.minimum, self.maximum, self.broken = value, minimum, maximum, broken

    @property
    def value(self):
        return self._value

    @value.setter
    def value(self, value):
        if self.broken:
            raise OSError(5, "Input/output error")
        assert isinstance(value, int)
        self._value = min(max(value, self.minimum), self.maximum)


def test_exposure_and_gain_in_the_drivers_units() -> None:
    known = {"EXPOSURE_AUTO": Control(3, 0, 3), "EXPOSURE_ABSOLUTE": Control(156, 3, 20470), "GAIN": Control(0, 0, 255)}
    controls = Controls(known)
    assert controls.limits.exposure_s == pytest.approx((3e-4, 2.047))
    assert controls.limits.gain == (0, 255)
    assert controls.exposure_s is None  # automatic: nobody knows
    assert controls.apply(CaptureSettings(0.5, 40)) == CaptureSettings(0.5, 40)
    assert known["EXPOSURE_AUTO"].value == 1
    assert known["EXPOSURE_ABSOLUTE"].value == 5000
    assert controls.exposure_s == 0.5
    known["GAIN"].broken = True
    with pytest.raises(RefusedError, match="does not take this setting"):
        controls.apply(CaptureSettings(gain=3))


def test_absent_it_says_how_to_get_it(monkeypatch) -> None:
    monkeypatch.setattr("kochab.gear.cameras.uvc.find_spec", lambda name: None)
    assert "pip install 'kochab-astro[webcam]'" in Webcam.missing()
    with pytest.raises(PortError, match="kochab"):
        list_devices("webcam")
