"""An Alpaca camera over a real socket, with every way of going away."""

import json
import socket
import struct
import threading
import time
from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from kochab.core.capture import CaptureSettings
from kochab.core.errors import DeviceError, LineLostError, NoAnswerError, PortError, RefusedError
from kochab.gear.cameras import list_devices, open_camera
from kochab.gear.cameras.alpaca import image_of

from .alpaca_server import AlpacaCameraSimulator, AlpacaServer

QUICK = CaptureSettings(exposure_s=0.02)


@pytest.fixture
def device():
    return AlpacaCameraSimulator()


@pytest.fixture
def server(device):
    server = AlpacaServer(device)
    yield server
    server.stop()


@pytest.fixture
def camera(server):
    camera = open_camera("alpaca", server.address, QUICK)
    yield camera
    camera.close()


def test_the_server_answers_the_usual_client_as_ours(server, device) -> None:
    """Alpyca checks our server, so that our client is not held against our own misreading."""
    camera_module = pytest.importorskip("alpaca.camera")
    other = camera_module.Camera(server.address, 0)
    other.Connected = True
    other.StartExposure(0.01, True)
    while not other.ImageReady:
        time.sleep(0.01)
    flat, info = other.ImageArrayRaw, other.ImageArrayInfo
    theirs = np.array(flat).reshape(info.Dimension1, info.Dimension2).T
    ours = open_camera("alpaca", server.address, QUICK)
    assert np.array_equal(taken(ours).pixels, theirs)
    ours.close()
    other.rqs.close()


def taken(camera):
    for _ in range(100):
        frame = camera.next_frame(0.2)
        if frame is not None:
            return frame
    raise AssertionError("no frame came")


def until_lost(camera):
    for _ in range(100):
        camera.next_frame(0.1)
    raise AssertionError("the loss was not noticed")


def expected(width=64, height=40):
    return np.arange(width) + 1000 * np.arange(height)[:, None]


@pytest.mark.parametrize("kind", ["<u2", "<i4", "<i2", "<f8"])
def test_rows_are_rows_whatever_way_they_are_sent(server, device, camera, kind) -> None:
    device.transmitted = np.dtype(kind)
    device.values["maxadu"] = 65535
    frame = taken(camera)
    assert frame.pixels.shape == (40, 64)
    assert frame.saturation == 65535
    if kind != "<i2":  # 16 signed bits cannot hold this picture
        assert np.array_equal(frame.pixels, expected())
    assert frame.pixels.dtype == (np.float32 if kind == "<f8" else np.uint16)


def test_a_server_that_only_knows_json(device, camera) -> None:
    device.image_bytes = False
    assert np.array_equal(taken(camera).pixels, expected())


def test_three_planes_are_colour(device, camera) -> None:
    rng = np.random.default_rng(1)
    device.picture = rng.integers(0, 60000, (64, 40, 3)).astype(np.int32)
    device.values["sensortype"] = 1
    frame = taken(camera)
    assert frame.colour.shape == (40, 64, 3)
    assert np.array_equal(frame.colour, device.picture.swapaxes(0, 1))
    assert frame.bayer is None


@pytest.mark.parametrize(
    ("offsets", "pattern"), [((0, 0), "RGGB"), ((1, 0), "GRBG"), ((0, 1), "GBRG"), ((1, 1), "BGGR")]
)
def test_the_mosaic_follows_the_offsets(server, device, offsets, pattern) -> None:
    device.values |= {"sensortype": 2, "bayeroffsetx": offsets[0], "bayeroffsety": offsets[1]}
    camera = open_camera("alpaca", server.address, QUICK)
    assert taken(camera).bayer == pattern
    camera.configure(CaptureSettings(binning=2))
    assert taken(camera).bayer is None  # binned, the colours are mixed
    camera.close()


def test_a_pattern_that_is_not_read_is_told(server, device) -> None:
    device.values["sensortype"] = 3
    camera = open_camera("alpaca", server.address, QUICK)
    frame = taken(camera)
    assert frame.bayer is None
    assert any("unsupported Bayer pattern" in w for w in frame.warnings)
    camera.close()


def test_settings_and_times(device, camera) -> None:
    now = camera.configure(CaptureSettings(exposure_s=0.05, gain=42, binning=2))
    assert now == CaptureSettings(0.05, 42, 2)
    assert (device.values["numx"], device.values["numy"]) == (32, 20)
    before = datetime.now(UTC)
    frame = taken(camera)
    assert frame.pixels.shape == (20, 32)
    assert frame.hint.exposure_s == 0.05
    assert (frame.hint.time_utc - before).total_seconds() >= 0.024
    assert frame.hint.time_utc <= datetime.now(UTC)
    assert camera.limits.exposure_s == (0.001, 3600.0)
    assert camera.limits.gain == (0, 300)
    assert camera.limits.binning == (1, 4)


def test_a_camera_with_named_gains_and_one_with_none(server, device) -> None:
    del device.values["gainmin"], device.values["gainmax"]
    device.values["gains"] = ["low", "medium", "high"]
    camera = open_camera("alpaca", server.address, QUICK)
    assert camera.limits.gain == (0, 2)
    camera.close()
    del device.values["gains"], device.values["gain"]
    camera = open_camera("alpaca", server.address, QUICK)
    assert camera.limits.gain is None
    with pytest.raises(RefusedError, match="gain of this camera cannot be set"):
        camera.configure(CaptureSettings(gain=1))
    camera.close()


def test_a_long_exposure_gives_nothing_yet_and_can_be_changed_at_once(device, camera) -> None:
    camera.configure(CaptureSettings(exposure_s=600.0))
    assert camera.next_frame(0.1) is None
    aborts = device.aborts
    camera.configure(CaptureSettings(exposure_s=0.02))
    assert device.aborts == aborts + 1
    taken(camera)


@pytest.mark.parametrize(
    "bad", [CaptureSettings(exposure_s=1e6), CaptureSettings(gain=999), CaptureSettings(binning=9)]
)
def test_what_is_out_of_range_is_refused_with_the_range(camera, bad) -> None:
    with pytest.raises(RefusedError, match="is not within"):
        camera.configure(bad)
    taken(camera)


def test_unplugged_from_its_server_in_the_middle(device, camera) -> None:
    taken(camera)
    device.unplugged = True
    with pytest.raises(LineLostError, match="no longer connected to its server: The USB cable"):
        until_lost(camera)


def test_the_camera_reports_a_fault(device, camera) -> None:
    camera.configure(CaptureSettings(exposure_s=60.0))
    device.values["camerastate"] = 5
    with pytest.raises(LineLostError, match="Sim Camera reports a fault"):
        until_lost(camera)


def test_an_exposure_that_fails_is_the_cameras_own_sentence(device, camera) -> None:
    device.fails = "The shutter is stuck"
    with pytest.raises(RefusedError, match="The camera refused: The shutter is stuck"):
        until_lost(camera)


def test_the_server_goes_in_the_middle(server, camera) -> None:
    taken(camera)
    server.stop()
    with pytest.raises(LineLostError, match="Lost the Alpaca server"):
        until_lost(camera)
    camera.close()
    with pytest.raises(PortError, match="No Alpaca server at"):
        open_camera("alpaca", server.address)


def test_a_download_that_hangs_ends(device, camera, monkeypatch) -> None:
    monkeypatch.setattr("kochab.gear.cameras.alpaca.DOWNLOAD_S", 0.3)
    device.hang.clear()
    with pytest.raises(LineLostError, match="Lost the Alpaca server"):
        until_lost(camera)


def test_a_picture_cut_short_is_said(device, camera) -> None:
    device.cut = True
    with pytest.raises(NoAnswerError, match="incomplete image"):
        until_lost(camera)


def test_what_is_not_there_is_named_with_what_is(server) -> None:
    assert [d.address for d in list_devices("alpaca", server.address)] == [f"{server.address}/0"]
    with pytest.raises(PortError, match=r"has no camera 7; there is 0 \(Sim Camera\)"):
        open_camera("alpaca", f"{server.address}/7")
    with pytest.raises(PortError, match="is not a port"):
        open_camera("alpaca", "localhost:camera")


@pytest.mark.parametrize("answer", [b"", b"hello\r\n", b"HTTP/1.1 200 OK\r\n\r\n<html>", b"\xff" * 99])
def test_a_port_where_something_else_listens(answer) -> None:
    with socket.create_server(("127.0.0.1", 0)) as ear:

        def serve():
            line, _ = ear.accept()
            with line:
                line.recv(1000)
                line.sendall(answer)

        threading.Thread(target=serve, daemon=True).start()
        with pytest.raises(DeviceError) as caught:
            open_camera("alpaca", f"127.0.0.1:{ear.getsockname()[1]}")
        assert "\n" not in str(caught.value)


def test_a_server_is_found_by_calling_for_it(server) -> None:
    try:
        ear = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        ear.bind(("127.0.0.1", 32227))
    except OSError:
        pytest.skip("another Alpaca server of this computer listens for calls")

    def answer():
        question, who = ear.recvfrom(100)
        assert question == b"alpacadiscovery1"
        ear.sendto(b"nonsense", who)
        ear.sendto(json.dumps({"AlpacaPort": server.port}).encode(), who)

    with ear:
        caller = threading.Thread(target=answer)
        caller.start()
        found = list_devices("alpaca")
        caller.join(10)
    assert f"{server.address}/0" in [d.address for d in found]


nearly = st.integers(0, 3) | st.floats() | st.none()
likely = st.lists(st.lists(nearly, min_size=2, max_size=2) | nearly, max_size=3).map(
    lambda rows: json.dumps({"Type": 3, "Rank": 2, "Value": rows}).encode()
)


@given(st.binary(max_size=120) | likely, st.sampled_from(["application/imagebytes", "application/json"]))
@example(b'{"Type": 3, "Value": [[1, 2], [3, null]]}', "application/json")
def test_any_answer_is_a_picture_or_a_sentence(data, kind) -> None:
    try:
        rows = image_of(data, kind)
    except DeviceError as error:
        assert str(error).endswith(".")  # noqa: PT017
    else:
        assert rows.size > 0


@given(
    st.lists(st.integers(-1, 8) | st.integers(-(2**31), 2**31 - 1), min_size=11, max_size=11), st.binary(max_size=64)
)
@example([1, 0, 0, 0, 44, 2, 2, 2, 2, 1, 0], bytes(8))
def test_any_header_is_a_picture_or_a_sentence(numbers, rest) -> None:
    try:
        image_of(struct.pack("<11i", *numbers) + rest, "application/imagebytes")
    except DeviceError as error:
        assert str(error).endswith(".")  # noqa: PT017


HOSTILE = (None, "x", [], {}, [[]], 0, -1, 1e999, 10**400, True, "9" * 5000)
PROPERTIES = (
    "sensortype",
    "bayeroffsetx",
    "maxadu",
    "exposuremin",
    "exposuremax",
    "gainmax",
    "gain",
    "maxbinx",
    "binx",
    "cameraxsize",
    "camerastate",
    "imageready",
    "lastexposureduration",
    "lastexposurestarttime",
)


@pytest.mark.parametrize("name", PROPERTIES)
def test_values_that_make_no_sense_are_a_sentence(server, device, name, monkeypatch) -> None:
    monkeypatch.setattr("kochab.gear.cameras.alpaca.DOWNLOAD_S", 0.1)
    truly = device.get
    for value in HOSTILE:
        device.get = lambda asked, value=value: value if asked == name else truly(asked)
        try:
            camera = open_camera("alpaca", server.address, QUICK)
            try:
                camera.next_frame(0.1)
            finally:
                camera.close()
        except DeviceError as error:
            assert str(error).endswith(".")  # noqa: PT017
            assert "\n" not in str(error)  # noqa: PT017


@pytest.mark.parametrize("answer", [b"[]", b"[" * 100_000, b'{"ErrorNumber": null}', b'{"Value": 7}'])
def test_any_json_is_a_sentence(server, device, monkeypatch, answer) -> None:
    monkeypatch.setattr("kochab.gear.servers.alpaca_link.AlpacaLink.fetch", lambda *_: (answer, ""))
    with pytest.raises(DeviceError, match=r"^.*\.$"):
        open_camera("alpaca", server.address, QUICK)


def test_an_answer_without_an_end_is_not_kept(device, camera, monkeypatch) -> None:
    monkeypatch.setattr("kochab.gear.servers.alpaca_link.LARGEST_BYTES", 4000)
    with pytest.raises(NoAnswerError, match="too much data for an image"):
        until_lost(camera)


def test_sides_whose_product_overflows_are_refused() -> None:
    head = struct.pack("<11i", 1, 0, 1, 1, 44, 2, 2, 3, 2**30, 2**30, 16)
    with pytest.raises(NoAnswerError):
        image_of(head, "application/imagebytes")
