"""One owner of the cameras for the whole window: chosen in one view, used by all, opened once."""

import pytest

from kochab.core.capture import CameraDevice, CaptureSettings
from kochab.core.errors import PortError
from kochab.core.frame import Frame
from kochab.gear.mount_events import FrameTaken
from kochab.gear.session import CameraSelection
from kochab.window.devices.cameras import CameraBox
from kochab.workflows.session.live_stream import StreamRequest
from kochab.workflows.session.mount_camera import MountCamera
from tests.window.fakes import fake_solution
from tests.workflows.live_sources import Clockwork, Told


class Named(Clockwork):
    def __init__(self, settings=None):
        super().__init__(0.02, size=(400, 600))
        self.now = settings or CaptureSettings()

    def configure(self, settings):
        if settings.exposure_s is not None:
            self.now = settings
        return self.now


@pytest.fixture
def made(monkeypatch):
    """Cameras that were opened; nothing of the computer's own is asked."""
    opened = []

    def open_camera(source, address, settings=None):
        opened.append(Named(settings))
        return opened[-1]

    def list_devices(source, address=""):
        if source == "alpaca":
            raise PortError("No Alpaca server answers.")
        return [CameraDevice(source, f"{source}:1/{n}", f"camera {n}") for n in "ab"]

    monkeypatch.setattr("kochab.gear.cameras.open_camera", open_camera)
    monkeypatch.setattr("kochab.gear.cameras.list_devices", list_devices)
    return opened


@pytest.fixture
def commands(make_window, engine, made):
    return make_window(engine)[1]


def view_of(commands, name):
    commands.views.show(name)
    return commands.views.docks[name].view


def pick(box, data):
    index = box.findData(data)
    box.setCurrentIndex(index)
    box.activated.emit(index)


def test_what_live_chooses_the_mount_uses(qtbot, commands):
    live, mount = view_of(commands, "live"), view_of(commands, "mount")
    live.camera.box.source.setCurrentIndex(live.camera.box.source.findData("indi"))
    qtbot.waitUntil(lambda: live.camera.box.found.count() == 2)
    pick(live.camera.box.found, "indi:1/b")
    assert mount.camera.box.selection == CameraSelection("indi", "indi:1/b", 2.0)
    assert mount.control.telescope.camera.selection == mount.camera.box.selection


def test_what_is_being_typed_stays_until_another_camera_is_chosen(commands):
    mount = view_of(commands, "mount")
    pick(mount.camera.box.source, "folder")
    mount.camera.box.address.setText("/data/n")
    mount._show()  # as twice a second while a mount is connected
    assert mount.camera.box.address.text() == "/data/n"
    mount._services.cameras.choose("indi", "indi:1/b")
    mount.camera.box.exposure.setValue(7.0)
    mount._show()
    assert mount.camera.box.selection == CameraSelection("indi", "indi:1/b", 7.0)
    mount.control.use_camera(None)
    assert mount.camera.box.selection is None


def test_the_alignment_uses_it_too_though_its_view_is_made_later(qtbot, commands):
    live = view_of(commands, "live")
    live.camera.box.source.setCurrentIndex(live.camera.box.source.findData("indi"))
    qtbot.waitUntil(lambda: live.camera.box.found.count() == 2)
    pick(live.camera.box.found, "indi:1/b")
    setup = view_of(commands, "polar").setup
    assert setup.frames.camera.kind == "indi"
    assert "indi:1/b" in setup.frames.camera.address.text()
    pick(live.camera.box.found, "indi:1/a")
    assert "indi:1/a" in setup.frames.camera.address.text()
    live._services.cameras.choose("simulated", "rig 1")  # it has a mount of its own
    assert setup.frames.camera.kind == "indi"


def test_a_camera_that_will_not_come_back_is_not_offered_any_more(qtbot, commands):
    live = view_of(commands, "live")
    cameras = live._services.cameras
    cameras.choose("simulated", "rig 1")
    assert live.camera.box.address.text() == "rig 1"
    cameras.forget("simulated", "rig 1")
    assert cameras.choice is None
    qtbot.waitUntil(lambda: live.camera.box.address.text() == "simulated:1/a")


def test_what_the_mount_chooses_live_uses_unless_it_runs(qtbot, commands):
    live, mount = view_of(commands, "live"), view_of(commands, "mount")
    pick(mount.camera.box.source, "webcam")
    qtbot.waitUntil(lambda: mount.camera.box.found.count() == 2)
    pick(mount.camera.box.found, "webcam:1/a")
    assert (live.camera.box.kind, live.camera.box.address.text()) == ("webcam", "webcam:1/a")
    live.run(StreamRequest(Named, "a camera"), lambda: Told(lambda n: fake_solution(600, 400)))
    pick(mount.camera.box.found, "webcam:1/b")
    assert live.camera.box.address.text() == "webcam:1/a"
    live.end()
    qtbot.waitUntil(lambda: live._ending is None)


def test_the_mount_looks_through_a_camera_that_runs_and_it_goes_on(qtbot, commands, made):
    live, mount = view_of(commands, "live"), view_of(commands, "mount")
    cameras = mount._services.cameras
    live.run(
        StreamRequest(lambda: cameras.open("indi", "one"), "a camera"), lambda: Told(lambda n: fake_solution(600, 400))
    )
    qtbot.waitUntil(lambda: len(live.display.moments) > 2, timeout=15_000)
    mount.control.use_camera(CameraSelection("indi", "one"))
    eye = mount.control.telescope.camera
    frame = eye.next_frame(5.0)
    assert isinstance(frame, Frame)
    mount.control.connection.heard.emit(FrameTaken(frame))
    drawn = live.display.queue
    assert live.stream is not None
    assert drawn is not None
    assert len(made) == 1
    live.end()
    qtbot.waitUntil(lambda: live._ending is None)
    assert made[0].closed == 0
    assert eye.next_frame(5.0) is not None
    eye.close()
    assert made[0].closed == 1
    mount.control.connection.heard.emit(FrameTaken(frame))  # now it is shown in its place
    assert commands.session.known.frame is frame


def test_an_exposure_that_another_view_has_set_is_told_and_can_be_changed_for_both(qtbot, commands, made):
    mount = view_of(commands, "mount")
    cameras = mount._services.cameras
    live = cameras.open("indi", "one", CaptureSettings(exposure_s=0.5))
    mount.control.use_camera(CameraSelection("indi", "one", 2.0))
    mount.control.telescope.camera.next_frame(1.0)
    assert live.in_force.exposure_s == 0.5, "not taken away from whoever watches it"
    mount._show()
    assert "at 0.5 s" in mount.camera.box.status.text()
    assert not mount.camera.box.status.isHidden()
    before = mount.control.telescope.camera
    mount.camera.box.exposure.setValue(3.0)
    mount.camera.box.exposure.editingFinished.emit()
    before.close()
    eye = mount.control.telescope.camera
    eye.next_frame(1.0)
    assert live.in_force.exposure_s == 3.0
    mount._show()
    assert mount.camera.box.status.isHidden()
    eye.close()
    live.next_frame(1.0)  # one may be waiting that came for both
    live.next_frame(1.0)
    assert live.in_force.exposure_s == 0.5, "whoever stays has its own again"
    live.close()


def test_an_alignment_has_the_exposure_it_was_begun_with(made, commands):
    cameras = view_of(commands, "mount")._services.cameras
    live = cameras.open("indi", "one", CaptureSettings(exposure_s=0.1))
    eye = MountCamera(CameraSelection("indi", "one", 2.0), cameras.open, insists=True)
    eye.next_frame(1.0)
    assert live.in_force.exposure_s == 2.0
    assert eye.exposure_note == ""
    eye.close()
    live.next_frame(1.0)  # one may be waiting that came for both
    live.next_frame(1.0)
    assert live.in_force.exposure_s == 0.1
    live.close()


def test_a_camera_that_exposes_otherwise_by_itself_says_so(made, commands):
    cameras = view_of(commands, "mount")._services.cameras
    eye = MountCamera(CameraSelection("indi", "one", 2.0), cameras.open)
    assert eye.exposure_note == "", "nothing is known before it is open"
    eye.next_frame(1.0)
    eye.configure(CaptureSettings(exposure_s=1.0))
    assert eye.exposure_note == "The camera uses 1 s exposures."
    eye.close()


def test_the_mount_s_box_lists_what_is_found_and_takes_the_only_one(qtbot):
    box, told, looks = CameraBox(at_once=True), [], []
    qtbot.addWidget(box)
    box.chosen.connect(told.append)
    box.look_wanted.connect(lambda *what: looks.append(what))
    pick(box.source, "indi")
    assert looks == [("indi", "")]
    box.show_found("alpaca", [CameraDevice("alpaca", "x/0", "another kind")])
    assert box.found.count() == 0
    box.show_found("indi", [CameraDevice("indi", "host/Cam", "Cam on host")])
    assert box.found.currentText() == "Cam on host"
    assert told[-1] == CameraSelection("indi", "host/Cam", 2.0)
    box.show_found("indi", [])
    assert not box.found.isEnabled()
    box.show_missed("indi", "No INDI server at pi:7624. Start indiserver there.")
    assert "Start indiserver" in box.status.text()
    box.show_selection(CameraSelection("alpaca", "pi:11111/0"))
    assert looks[-1] == ("alpaca", "pi:11111/0")
    box.show_selection(CameraSelection("alpaca", "pi:11111/1"))
    assert len(looks) == 2
    box.show_selection(CameraSelection("folder", "/tmp"))
    assert box.found.isHidden()
    assert box.look.isHidden()


def test_a_kind_that_cannot_be_asked_says_why_in_the_live_view(qtbot, commands):
    live = view_of(commands, "live")
    live.camera.box.source.setCurrentIndex(live.camera.box.source.findData("alpaca"))
    qtbot.waitUntil(lambda: live.camera.box.status.text() == "No Alpaca server answers.")
