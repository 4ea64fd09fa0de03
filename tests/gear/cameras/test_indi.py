"""INDI's own server and camera simulator, driven through our source."""

import os
import signal
import subprocess
import time

import numpy as np
import pytest

from kochab.core.capture import CaptureSettings
from kochab.core.errors import LineLostError, PortError, RefusedError
from kochab.gear.cameras import list_devices, open_camera
from kochab.gear.cameras.indi import IndiCamera

from .indi_server import ADDRESS, Server, indi_network

pytest.importorskip("indipyclient")


@pytest.fixture(scope="module")
def network():
    with indi_network():
        yield


@pytest.fixture(scope="module")
def shared_server(network, tmp_path_factory):
    server = Server(tmp_path_factory.mktemp("indi"))
    server.start()
    yield server
    server.end()


@pytest.fixture
def server(shared_server):
    if shared_server.process.poll() is not None:
        shared_server.start()
    return shared_server


def taken(camera, limit_s=30.0):
    deadline = time.monotonic() + limit_s
    while time.monotonic() < deadline:
        frame = camera.next_frame(0.2)
        if frame is not None:
            return frame
    raise AssertionError("no frame came")


def until_lost(camera):
    for _ in range(200):
        camera.next_frame(0.1)
    raise AssertionError("the loss was not noticed")


def test_cameras_are_listed(server) -> None:
    (device,) = list_devices("indi", ADDRESS)
    assert device.address == f"{ADDRESS}/CCD Simulator"
    assert device.source == "indi"


def test_a_gain_that_is_told_last_is_waited_for(server, monkeypatch) -> None:
    told, asked = IndiCamera._gain, iter(range(100))
    monkeypatch.setattr(IndiCamera, "_gain", lambda self: told(self) if next(asked) > 3 else None)
    camera = open_camera("indi", ADDRESS, CaptureSettings(gain=70))
    camera.close()


def test_exposure_gain_and_binning_and_frames_one_after_another(server) -> None:
    camera = open_camera("indi", ADDRESS, CaptureSettings(exposure_s=0.3, gain=70, binning=2))
    try:
        assert camera.name == "CCD Simulator"
        assert camera.limits.exposure_s == (0.01, 3600.0)
        assert camera.limits.binning == (1, 4)
        first = taken(camera)
        assert first.pixels.shape == (512, 640)
        assert first.pixels.dtype == np.uint16
        assert first.hint.exposure_s == 0.3
        assert first.header["GAIN"] == 70
        assert first.hint.camera == "CCD Simulator"
        second = taken(camera)
        apart = (second.hint.time_utc - first.hint.time_utc).total_seconds()
        assert 0.3 <= apart < 20
        assert not np.array_equal(first.pixels, second.pixels)
        now = camera.configure(CaptureSettings(binning=1))
        assert now == CaptureSettings(0.3, 70, 1)
        assert taken(camera).pixels.shape == (1024, 1280)
    finally:
        camera.close()


def test_a_long_exposure_gives_nothing_yet_and_can_be_changed_at_once(server) -> None:
    camera = open_camera("indi", f"{ADDRESS}/CCD Simulator", CaptureSettings(exposure_s=600.0))
    try:
        assert camera.next_frame(0.3) is None
        assert camera.next_frame(0.0) is None
        camera.configure(CaptureSettings(exposure_s=0.1))
        assert taken(camera).hint.exposure_s == 0.1
    finally:
        camera.close()


def test_compressed_pictures_are_the_same(server) -> None:
    camera = open_camera("indi", ADDRESS, CaptureSettings(exposure_s=0.2, binning=2))
    try:
        taken(camera)
        for switch in ("INDI_ENABLED", "INDI_DISABLED"):
            wish = f"CCD Simulator.CCD_COMPRESSION.{switch}=On"
            subprocess.run(["indi_setprop", wish], check=True, timeout=120)
            taken(camera)
            frame = taken(camera)
            assert frame.pixels.shape == (512, 640)
            assert frame.pixels.dtype == np.uint16
            assert frame.header.get("ZIMAGE", False) is (switch == "INDI_ENABLED")
        assert camera.complaints() == ()
    finally:
        camera.close()


def test_what_is_out_of_range_is_refused_and_nothing_changes(server) -> None:
    camera = open_camera("indi", ADDRESS, CaptureSettings(exposure_s=0.2, binning=1))
    try:
        for bad, said in (
            (CaptureSettings(exposure_s=1e6), "exposure of 1e.06 s is not within 0.01 to 3600 s"),
            (CaptureSettings(binning=9), "binning of 9 is not within 1 to 4"),
        ):
            with pytest.raises(RefusedError, match=said):
                camera.configure(bad)
        assert camera.configure(CaptureSettings()).exposure_s == 0.2
        taken(camera)
    finally:
        camera.close()


def test_a_camera_that_is_not_there_is_named_with_those_that_are(server) -> None:
    with pytest.raises(PortError, match="no camera Toupcam; there is CCD Simulator"):
        open_camera("indi", f"{ADDRESS}/Toupcam")


def test_another_program_disconnects_the_camera(server) -> None:
    camera = open_camera("indi", ADDRESS, CaptureSettings(exposure_s=0.2))
    try:
        taken(camera)
        subprocess.run(["indi_setprop", "CCD Simulator.CONNECTION.DISCONNECT=On"], check=True, timeout=120)
        with pytest.raises(LineLostError, match=r"Lost CCD Simulator .*disconnected"):
            until_lost(camera)
    finally:
        camera.close()


def test_the_driver_dies(server) -> None:
    camera = open_camera("indi", ADDRESS, CaptureSettings(exposure_s=5.0))
    try:
        assert camera.next_frame(0.2) is None
        os.kill(server.driver(), signal.SIGKILL)
        with pytest.raises(LineLostError, match="Lost CCD Simulator"):
            until_lost(camera)
    finally:
        camera.close()


def test_the_server_goes_in_the_middle_of_an_exposure(server) -> None:
    camera = open_camera("indi", ADDRESS, CaptureSettings(exposure_s=60.0))
    try:
        assert camera.next_frame(0.2) is None
        server.end()
        with pytest.raises(LineLostError, match=r"disconnected\. Check its computer"):
            until_lost(camera)
    finally:
        camera.close()
    with pytest.raises(PortError, match="Start indiserver there"):
        open_camera("indi", ADDRESS)
    assert list_devices("indi") == []


def test_a_picture_that_never_comes_is_a_lost_line(server, monkeypatch) -> None:
    monkeypatch.setattr("kochab.gear.cameras.server_camera.DOWNLOAD_S", 0.5)
    camera = open_camera("indi", ADDRESS, CaptureSettings(exposure_s=0.5))
    os.kill(server.driver(), signal.SIGSTOP)  # hangs, as a driver whose cable was pulled
    try:
        with pytest.raises(LineLostError, match="sent no image"):
            until_lost(camera)
    finally:
        os.kill(server.driver(), signal.SIGCONT)
        camera.close()


def test_the_simulators_sky_is_solved_where_it_says_it_points(shared_server, tmp_path) -> None:
    """From INDI's own picture of the sky over the network to a pointing, live."""
    from kochab.core.attitude import unit_vectors
    from kochab.core.solution import Solution
    from kochab.solver import SolveOptions
    from kochab.solver.tracker import Tracker
    from kochab.workflows.live.capture import Capture
    from kochab.workflows.live.solve import live_solve
    from kochab.workflows.live.update import LiveUpdate

    shared_server.end()
    server = Server(tmp_path, stars=True)
    server.start()
    try:
        open_camera("indi", ADDRESS).close()  # connects it
        for wish in ("SCOPE_INFO.FOCAL_LENGTH;APERTURE=50;25", "EQUATORIAL_PE.RA_PE;DEC_PE=5.6;-1.2"):
            subprocess.run(["indi_setprop", f"CCD Simulator.{wish}"], check=True, timeout=120)
        capture = Capture(lambda: open_camera("indi", ADDRESS, CaptureSettings(exposure_s=0.5)))
        # Its stars are single pixels, which only this detector does not take for hot ones.
        engine = Tracker(options=SolveOptions(detector="peaks"))
        live = live_solve(capture, engine, frames=3)
        results = [step.result for step in live if isinstance(step, LiveUpdate)]
    finally:
        server.end()
    solution = results[-1]
    assert isinstance(solution, Solution)
    ra, dec = (float(v) for v in (tmp_path / "asked").read_text().split())
    apart = np.linalg.norm(solution.centre_vector - unit_vectors(ra, dec))
    assert np.degrees(apart) * 3600 < 30.0  # a pixel is 21 arcsec
    assert solution.camera.scale_arcsec_px == pytest.approx(21.45, rel=0.002)
    assert not solution.camera.mirrored


def test_absent_it_says_how_to_get_it(monkeypatch) -> None:
    monkeypatch.setattr("kochab.gear.servers.indi_link.find_spec", lambda name: None)
    assert "pip install 'kochab-astro[indi]'" in IndiCamera.missing()
    with pytest.raises(PortError, match="kochab"):
        open_camera("indi", ADDRESS)
