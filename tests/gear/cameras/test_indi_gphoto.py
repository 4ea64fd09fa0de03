"""A DSLR through INDI's own gPhoto driver: in simulation its shutter gives a picture, and Kochab solves it.

The driver turns the camera's JPEG into FITS, or sends the file as it is; both are solved like the file itself.
"""

import shutil

import pytest

from kochab.core.attitude import apart_deg
from kochab.core.capture import CaptureSettings
from kochab.core.errors import RefusedError
from kochab.core.progress import run
from kochab.core.solution import Solution
from kochab.gear.cameras import list_devices, open_camera
from kochab.workflows.live.capture import Capture
from kochab.workflows.live.solve import ProfiledTracker, live_solve
from kochab.workflows.live.update import LiveUpdate
from kochab.workflows.solve_frame import solve_file
from tests.gear.mounts.indi_server import indi_server

pytest.importorskip("indipyclient")
DSLR = "GPhoto CCD"
ADDRESS = f"localhost:7624/{DSLR}"


@pytest.fixture
def server(tmp_path):
    """INDI's server with the gPhoto driver in simulation; skipped where it is not installed."""
    if shutil.which("indi_gphoto_ccd") is None:
        pytest.skip("indi_gphoto_ccd is not there: apt-get install indi-gphoto")
    with indi_server(tmp_path, "indi_gphoto_ccd") as started:
        started.set(f"{DSLR}.SIMULATION.ENABLE=On", f"{DSLR}.CONNECTION.CONNECT=On")
        yield started


def exposing(camera):
    for _ in range(100):
        camera.next_frame(0.2)


def test_a_camera_whose_pixels_are_not_known_says_so(server) -> None:
    camera = open_camera("indi", ADDRESS, CaptureSettings(exposure_s=1.0))
    try:
        with pytest.raises(RefusedError, match=r"refused to expose .*CCD Information"):
            exposing(camera)
    finally:
        camera.close()


@pytest.mark.parametrize("transfer", ["FORMAT_FITS", "FORMAT_NATIVE"])
def test_a_picture_comes_through_gphotos_driver_and_is_solved(server, repository, transfer) -> None:
    photograph = repository / "resources" / "samples" / "big-dipper.jpg"
    expected = run(solve_file(photograph)).result
    # The driver crops to the camera's size, which a person enters.
    size = f"{expected.camera.width};{expected.camera.height}"
    pixels = "CCD_MAX_X;CCD_MAX_Y;CCD_PIXEL_SIZE;CCD_PIXEL_SIZE_X;CCD_PIXEL_SIZE_Y;CCD_BITSPERPIXEL"
    server.set(f"{DSLR}.CCD_INFO.{pixels}={size};5.7;5.7;5.7;8")
    server.set(f"{DSLR}.CCD_UPLOAD_FILE.PATH={photograph}", f"{DSLR}.CCD_TRANSFER_FORMAT.{transfer}=On")
    assert [device.address for device in list_devices("indi", "localhost:7624")] == [ADDRESS]
    capture = Capture(lambda: open_camera("indi", ADDRESS, CaptureSettings(exposure_s=1.0)))
    steps = live_solve(capture, ProfiledTracker(), frames=2)
    solved = [step.result for step in steps if isinstance(step, LiveUpdate)]
    assert len(solved) == 2
    for solution in solved:
        assert isinstance(solution, Solution)
        assert apart_deg(solution.ra_dec_deg, expected.ra_dec_deg) < 0.02
        assert solution.camera.fov_deg[0] == pytest.approx(expected.camera.fov_deg[0], rel=0.002)
