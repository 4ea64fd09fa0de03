"""Frames of the camera on the mount: shown, solved, refused, lost; and who may offer practice."""

import re
from datetime import UTC, datetime
from types import SimpleNamespace

import pytest

from kochab.core.capture import CameraSource, CaptureLimits
from kochab.core.errors import LineLostError, NoAnswerError, PortError
from kochab.core.frame import Detections
from kochab.core.progress import run
from kochab.core.solution import NoSolution, Solution
from kochab.gear.mount_events import FrameTaken, SolvedPosition
from kochab.gear.session import CameraSelection
from kochab.workflows.fresh_frame import fresh_frame
from kochab.workflows.session import mount_camera as eyes
from kochab.workflows.session.mount_camera import MountCamera, frame_solver
from kochab.workflows.solve_frame import SolvedFrame
from tests.window.fakes import fake_solution, no_solution, star_field
from tests.window.mount_bench import connected

WISH = CameraSelection("folder", "somewhere", 1.0)
NOWHERE = Detections.from_list([(1.0, 1.0)], 600, 400)


class FakeCamera(CameraSource):
    """Gives a frame at every call until its cable is pulled."""

    name = "fake"
    limits = CaptureLimits()

    def __init__(self):
        self.pulled, self.closed, self.given = False, 0, 0

    def configure(self, settings):
        return settings

    def next_frame(self, timeout_s):
        if self.pulled:
            raise LineLostError("The camera was unplugged.")
        self.given += 1
        return star_field(seed=self.given)

    def close(self):
        self.closed += 1


@pytest.fixture
def camera(monkeypatch):
    made = FakeCamera()
    monkeypatch.setattr("kochab.gear.cameras.open_camera", lambda *wish: made)
    return made


@pytest.fixture
def answers(monkeypatch):
    """What the solver says, one after the other, without solving."""
    said = []

    def solve(frame, options):
        yield from ()
        return SolvedFrame("", frame, NOWHERE, said.pop(0))

    monkeypatch.setattr(eyes, "solve_open_frame", solve)
    return said


def test_a_lost_camera_is_not_taken_for_the_mount_s_line(camera):
    eye = MountCamera(WISH)
    run(fresh_frame(eye, 5.0))
    camera.pulled = True
    with pytest.raises(NoAnswerError, match="unplugged"):
        run(fresh_frame(eye, 5.0))
    assert camera.closed == 1
    camera.pulled = False
    assert run(fresh_frame(eye, 5.0)) is not None, "it opens again by itself"
    eye.close()
    eye.close()
    assert camera.closed == 2


def test_a_camera_that_cannot_be_opened_says_so():
    with pytest.raises(PortError):
        run(fresh_frame(MountCamera(CameraSelection("folder", "/no/such/folder"))))


@pytest.mark.parametrize("result", [fake_solution(600, 400), no_solution()])
def test_what_is_seen_is_told_with_what_the_mount_said(camera, answers, result):
    answers.append(result)
    told = []
    guard = SimpleNamespace(position_icrs=lambda: (1.0, 2.0), clock=lambda: datetime.now(UTC))
    assert run(frame_solver(MountCamera(WISH), guard, told.append)()) is result
    shown, *place, seen = told
    assert isinstance(shown, FrameTaken)
    assert isinstance(seen, SolvedFrame)
    assert seen.frame is shown.frame
    assert seen.frame.hint.centre_deg is None, "a mount's word must not lead the solver"
    if isinstance(result, Solution):
        assert isinstance(place[0], SolvedPosition)
        assert place[0].mount_deg == (1.0, 2.0)
    else:
        assert not place


def test_a_frame_is_taken_shown_and_compared(qtbot, opened, camera, answers):
    window, commands = opened
    with connected(qtbot, commands) as mount:
        mount.control.use_camera(WISH)
        assert mount.view.buttons.take.explanation.reason == ""
        answers.extend([no_solution(), fake_solution(600, 400)])
        mount.view.buttons.take.click()
        qtbot.waitUntil(lambda: any("trailed" in s for s in mount.said), timeout=15_000)
        assert mount.control.known.sight is None
        assert commands.session.known.name == "Camera frame 1"
        assert isinstance(commands.session.known.result, NoSolution)
        assert window.windowTitle().startswith("Camera frame 1")
        mount.view.buttons.take.click()
        qtbot.waitUntil(lambda: any("Solved" in s for s in mount.said), timeout=15_000)
        assert mount.view.pointing.ra.text().startswith("05h 36m"), "where the sky says"
        assert re.search(r"mount is off by [\d.]+° \(", mount.view.pointing.offset.text())
        assert not mount.control.known.moved_since
        camera.pulled = True
        mount.view.buttons.take.click()
        qtbot.waitUntil(lambda: any("unplugged" in s for s in mount.said), timeout=15_000)
        assert mount.control.known.phase == "on"


def test_after_a_move_the_sight_is_old_until_a_frame_is_taken_by_itself(qtbot, opened, camera, answers):
    _, commands = opened
    with connected(qtbot, commands, "onstep") as mount:
        mount.control.use_camera(WISH)
        mount.view.after.setChecked(False)
        answers.extend([fake_solution(600, 400)] * 2)
        mount.view.buttons.take.click()
        qtbot.waitUntil(lambda: mount.control.known.sight is not None, timeout=15_000)
        qtbot.waitUntil(lambda: not mount.control.known.busy, timeout=15_000)
        mount.view.pad.step.setCurrentText("10″")
        north = next(iter(mount.view.pad.buttons.values()))
        north.click()
        qtbot.waitUntil(lambda: any("Nudged" in s for s in mount.said), timeout=30_000)
        assert mount.control.known.moved_since
        assert "OLD: solved" in mount.view.pointing.offset.text()
        mount.view.after.setChecked(True)
        north.click()
        qtbot.waitUntil(lambda: not answers, timeout=30_000)
        qtbot.waitUntil(lambda: not mount.control.known.moved_since, timeout=15_000)


def test_an_answer_to_another_frame_is_dropped(qtbot, opened):
    _, commands = opened
    session = commands.session
    first, second = star_field(seed=3), star_field(seed=4)
    session.show(first, "one")
    session.show(second, "two")
    session.answer(SolvedFrame("", first, NOWHERE, fake_solution(600, 400)))
    assert session.known.result is None
    with qtbot.waitSignal(session.solved, timeout=5_000):
        session.answer(SolvedFrame("", second, NOWHERE, fake_solution(600, 400)))
    assert session.known.last_good_from == "two"
    qtbot.waitUntil(lambda: not session.busy, timeout=10_000)
    assert session.known.picture is not None


def test_practice_is_offered_only_where_there_is_a_simulated_telescope(qtbot, make_window, engine):
    window, commands = make_window(engine)
    assert window.welcome.practice.isHidden()
    assert not window.menus.practice.isVisible()
    commands.views.practise()
    view = commands.views.docks["mount"].view
    assert "No simulated telescope" in view.message.text()
    assert not view.connect_box.practice_button.isVisible()
    assert not view.stop.isVisible()
