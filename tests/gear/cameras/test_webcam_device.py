"""The way of a video device through FFmpeg, with FFmpeg's own virtual device in place of a webcam.

``lavfi`` is an input device as ``v4l2``, ``dshow`` and ``avfoundation`` are: raw video in a pixel
format of its own, opened by name, decoded and converted by the same code. What it has not got is
the kernel's side: negotiated sizes, and exposure and gain.
"""

import sys

import numpy as np
import pytest

from kochab.core.errors import LineLostError, PortError
from kochab.gear.cameras import open_camera, uvc

from .test_webcam import taken, until_lost

av = pytest.importorskip("av")
ABSENT = {"color", "testsrc", "geq", "realtime"} - set(av.filter.filters_available)
pytestmark = pytest.mark.skipif(
    bool(ABSENT), reason=f"this FFmpeg has no virtual camera: no {', '.join(sorted(ABSENT))}"
)

ORANGE = "color=c=0xC08040:size=160x120:rate=60,realtime"
BARS = "testsrc=size=320x240:rate=60,realtime"


@pytest.fixture(autouse=True)
def device(monkeypatch):
    monkeypatch.setitem(uvc._DRIVERS, sys.platform, "lavfi")
    if sys.platform == "win32":  # whose own device calls a camera video=NAME
        monkeypatch.setattr(uvc, "_target", lambda address: (address, "lavfi"))


@pytest.fixture
def opened():
    cameras = []

    def open_it(address):
        cameras.append(open_camera("webcam", address))
        return cameras[-1]

    yield open_it
    for camera in cameras:
        camera.close()


@pytest.mark.parametrize("kind", ["yuyv422", "uyvy422", "nv12", "yuvj420p", "bgr24"])
def test_colours_of_the_formats_webcams_send(opened, kind) -> None:
    frame = taken(opened(f"{ORANGE},format={kind}"))
    assert frame.colour.shape == (120, 160, 3)
    assert np.median(frame.colour, axis=(0, 1)) == pytest.approx([0xC0, 0x80, 0x40], abs=4)
    assert frame.pixels.dtype == np.uint16
    assert np.median(frame.pixels) == pytest.approx(0xC0 + 2 * 0x80 + 0x40, abs=12)
    assert frame.saturation == 1020.0


@pytest.mark.parametrize(("kind", "dtype", "full"), [("gray", np.uint8, 255.0), ("gray16le", np.uint16, 65535.0)])
def test_grey_formats_stay_grey_and_whole(opened, kind, dtype, full) -> None:
    frame = taken(opened(f"{BARS},format={kind}"))
    assert frame.colour is None
    assert frame.pixels.dtype == dtype
    assert frame.saturation == full
    assert frame.pixels.max() > 0.9 * full


def test_each_frame_is_newer(opened) -> None:
    camera = opened(BARS)
    frames = [taken(camera) for _ in range(5)]
    moments = [frame.hint.time_utc for frame in frames]
    assert moments == sorted(set(moments))


def test_rows_come_from_the_top_and_columns_from_the_left(opened) -> None:
    ramp = "color=black:size=160x120:rate=30,format=gray,geq=lum='{}',realtime"
    y, x = np.indices((120, 160))
    assert np.array_equal(taken(opened(ramp.format("Y"))).pixels, y)
    assert np.array_equal(taken(opened(ramp.format("X"))).pixels, x)


def test_a_device_that_is_pulled_is_told(opened) -> None:
    camera = opened("testsrc=size=160x120:rate=30:duration=0.3,realtime")
    taken(camera)
    with pytest.raises(LineLostError, match="stopped sending frames"):
        until_lost(camera)


def test_a_device_that_cannot_be_opened_is_one_sentence() -> None:
    with pytest.raises(PortError, match="cannot be opened as a video camera"):
        open_camera("webcam", "nosuchdevice")
