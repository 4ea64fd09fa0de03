"""What every camera source keeps to, whatever is behind it: run over all that are registered."""

import threading
from contextlib import contextmanager
from datetime import timedelta

import numpy as np
import pytest

from kochab.core.capture import CameraDevice, CaptureLimits, CaptureSettings
from kochab.core.errors import DeviceError, LineLostError, RefusedError, UsageError
from kochab.core.frame import Frame
from kochab.gear.cameras import SOURCES, list_devices, missing, open_camera
from kochab.gear.cameras.shared_cameras import Share, SharedCameras

QUICK = CaptureSettings(exposure_s=0.1)
NO_EXPOSURE = ("folder", "webcam")  # sources whose frames another program exposes, or the device by itself
NOT_LISTED = ("webcam",)  # sources that a person gives an address, which is no device of this computer


@contextmanager
def folder(tmp_path):
    from kochab.frames.fits_write import write_fits

    path, stop = tmp_path / "pictures", threading.Event()
    path.mkdir()

    def write():
        number = 0
        while not stop.wait(0.1) and path.exists():
            number += 1
            try:
                write_fits(Frame(np.full((20, 30), number, np.uint16)), path / f"{number}.fits")
            except OSError:
                return

    writer = threading.Thread(target=write)
    writer.start()

    def unplug():
        path.rename(tmp_path / "taken away")

    try:
        yield str(path), unplug
    finally:
        stop.set()
        writer.join()


@contextmanager
def indi(tmp_path):
    from .indi_server import ADDRESS, Server, indi_network

    with indi_network():
        server = Server(tmp_path)
        server.start()
        try:
            yield ADDRESS, server.end
        finally:
            server.end()


@contextmanager
def alpaca(tmp_path):
    from .alpaca_server import AlpacaCameraSimulator, AlpacaServer

    device = AlpacaCameraSimulator()
    server = AlpacaServer(device)
    try:
        yield server.address, lambda: setattr(device, "unplugged", True)
    finally:
        server.stop()


@contextmanager
def webcam(tmp_path):
    from .mjpeg_server import NetworkCamera

    pytest.importorskip("av")
    camera = NetworkCamera()
    try:
        yield camera.url, camera.unplugged.set
    finally:
        camera.stop()


@contextmanager
def simulated(tmp_path):
    yield "new", None


STANDS = {f.__name__: f for f in (folder, indi, alpaca, webcam, simulated)}


@pytest.fixture(params=list(SOURCES))
def stand(request, tmp_path):
    """(name, address, unplug) of something real of this kind; unplug None: the camera's own."""
    name = request.param
    assert name in STANDS, f"a source called {name} needs a stand for these tests"
    with STANDS[name](tmp_path) as (address, unplug):
        yield name, address, unplug


@pytest.fixture(params=["alone", "shared"])
def camera(request, stand):
    name, address, _ = stand
    settings = CaptureSettings() if name in NO_EXPOSURE else QUICK
    opened = open_camera if request.param == "alone" else SharedCameras().open
    camera = opened(name, address, settings)
    yield camera
    camera.close()


def taken(camera, tries=300):
    for _ in range(tries):
        frame = camera.next_frame(0.2)
        if frame is not None:
            return frame
    raise AssertionError("no frame came")


def until_lost(camera):
    for _ in range(300):
        camera.next_frame(0.1)
    raise AssertionError("the loss was not noticed")


def is_sentence(error):
    return "\n" not in str(error) and str(error).endswith((".", "?"))


def test_one_after_another_until_it_is_unplugged(stand, camera) -> None:
    assert camera.name
    assert isinstance(camera.limits, CaptureLimits)
    assert isinstance(camera.configure(CaptureSettings()), CaptureSettings)
    frames = [taken(camera), taken(camera)]
    for frame in frames:
        assert frame.pixels.ndim == 2
        assert frame.pixels.flags.c_contiguous
        assert frame.pixels.dtype.isnative
        assert frame.pixels.dtype.kind in "uif"
        assert frame.colour is None or frame.colour.shape == (*frame.pixels.shape, 3)
    first, second = (f.hint.time_utc for f in frames)
    if first is not None and second is not None:
        assert second.utcoffset() == timedelta(0)
        assert second > first
    _, _, unplug = stand
    device = camera._source if isinstance(camera, Share) else camera
    (unplug or device.close)()
    with pytest.raises(LineLostError) as caught:
        until_lost(camera)
    assert is_sentence(caught.value)
    with pytest.raises(DeviceError):
        camera.next_frame(0.1)  # it stays lost
    camera.close()
    camera.close()


def test_a_wish_is_granted_within_the_limits_or_refused_with_a_sentence(camera) -> None:
    for what, bad in (("exposure_s", 1e7), ("gain", 1e7), ("binning", 1000)):
        before = camera.configure(CaptureSettings())
        try:
            now = camera.configure(CaptureSettings(**{what: bad}))
        except RefusedError as refusal:
            assert is_sentence(refusal)  # noqa: PT017
            assert camera.configure(CaptureSettings()) == before
        else:
            bounds, value = getattr(camera.limits, what), getattr(now, what)
            assert value is None or (bounds is not None and value <= bounds[1])
    if camera.limits.exposure_s is not None:
        camera.configure(QUICK)
    taken(camera)


def test_its_devices_can_be_asked_for(stand) -> None:
    name, address, _ = stand
    devices = list_devices(name, address)
    assert all(isinstance(d, CameraDevice) and d.source == name and d.description for d in devices)
    if name not in NOT_LISTED:
        assert devices


@pytest.mark.parametrize("name", list(SOURCES))
def test_what_is_absent_is_said_before_anything_is_opened(name, monkeypatch) -> None:
    told = missing(name)
    assert told is None or "pip install" in told
    monkeypatch.setattr(SOURCES.load(name), "missing", classmethod(lambda cls: "Buy one."))
    for ask in (open_camera, list_devices):
        with pytest.raises(DeviceError, match="Buy one"):
            ask(name, "")


def test_an_unknown_source_lists_the_known() -> None:
    with pytest.raises(UsageError, match=r"'periscope'; choose one of .*folder"):
        open_camera("periscope", "")
