"""The Live view in the window, over the simulated sky and over cameras that misbehave."""

import json
import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import Qt, QTimer
from PySide6.QtWidgets import QInputDialog, QLabel

from kochab.core.capture import CameraDevice, CaptureLimits
from kochab.core.errors import LineLostError, PortError
from kochab.core.frame import Frame, Hint
from kochab.core.solution import NoSolution, Reason
from kochab.frames.fits_write import write_fits
from kochab.gear.session import CameraSelection
from kochab.solver.camera_profile import new_profile
from kochab.window.live import frame_display
from kochab.window.live.camera_panel import CameraPanel
from kochab.window.live.status_text import NOTHING
from kochab.window.live.view import LiveView
from kochab.workflows.session.live_stream import StreamRequest
from kochab.workflows.session.wiring import Wiring
from tests.window.fakes import FakeEngine, fake_solution, star_field
from tests.window.test_night import assert_red
from tests.workflows.live_sources import CAMERA, Clockwork, Told, refusal

FIELD = star_field().pixels


class Stars(Clockwork):
    """The same stars again and again, the frame's number in its first pixel."""

    def next_frame(self, timeout_s):
        frame = super().next_frame(timeout_s)
        pixels = FIELD.copy()
        pixels[0, 0] = self.given
        hint = Hint(exposure_s=self.settings.exposure_s)
        return None if frame is None else Frame(pixels, hint=hint)


class Stuck(Stars):
    """A driver that does not come back for a while."""

    def next_frame(self, timeout_s):
        if self.given >= 3:
            time.sleep(1.0)
            return None
        return super().next_frame(timeout_s)


def answer(number):
    return fake_solution(600, 400)


@pytest.fixture
def live(qtbot, make_window, engine):
    """The view of a new window, and the window's commands."""
    _, commands = make_window(engine)
    commands.views.show("live")
    view = commands.views.docks["live"].view
    qtbot.waitUntil(lambda: not view._services.cameras.looking and not view.camera.box.status.text())
    return view, commands


def run(view, source, solver=None, **more):
    view.run(StreamRequest(lambda: source, "a camera", **more), lambda: solver or Told(answer))


def wait_drawn(qtbot, view, count=3):
    qtbot.waitUntil(lambda: len(view.display.moments) >= count, timeout=15_000)


def wait_idle(qtbot, view):
    qtbot.waitUntil(lambda: view.stream is None and view._ending is None, timeout=15_000)


def test_a_folder_without_an_address_is_one_sentence_and_live_starts_afterwards(qtbot, live, tmp_path):
    """The window hung: an empty address is the folder of the program, with all below it."""
    view, _ = live
    view.camera.box.show_selection(CameraSelection("folder", ""))
    view.start.click()
    qtbot.waitUntil(lambda: "folder" in view.message.text().lower())
    wait_idle(qtbot, view)
    assert view.start.isVisible()
    view.camera.box.show_selection(CameraSelection("folder", str(tmp_path)))
    view.start.click()
    qtbot.waitUntil(lambda: view.stream is not None)
    view.end()
    wait_idle(qtbot, view)


def test_the_card_names_the_field_of_a_running_camera(qtbot, live):
    """It went back to "Solved" with every frame, each of which had another solution by the time it had a name."""
    view, commands = live
    run(view, Stars())
    title = commands.window.workspace.card.title
    qtbot.waitUntil(lambda: title.text() == "Orion's Belt in Orion")
    commands.session.solved.emit(fake_solution(600, 400))
    assert title.text() == "Orion's Belt in Orion"
    view.end()
    wait_idle(qtbot, view)


# a camera that works --------------------------------------------------------------------------------
def test_the_simulated_sky_is_found_tracked_and_shown(qtbot, live):
    view, commands = live
    assert view.camera.box.kind == "simulated"
    assert view.camera.box.address.text()
    view.camera.fields.exposure.setValue(0.4)
    qtbot.mouseClick(view.start, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: view.title.text() == "Tracking", timeout=60_000)
    assert commands.window.workspace.view.picture.width == 1280
    assert len(view.stream.latest.result.stars) > 5
    qtbot.waitUntil(lambda: commands.session.known.last_good is not None, timeout=10_000)
    assert view.pointing.ra.text().endswith("s")
    assert "″" in view.pointing.values["Uncertainty"].text()
    assert view.pointing.chart.trail.here is not None
    assert "0.4 s" in view.camera.fields.in_force.text()
    assert view.camera.fields.binning.isHidden()  # it cannot be set
    assert not view.camera.levels.isHidden()
    view.end()
    wait_idle(qtbot, view)


def test_every_frame_carries_its_own_marks(qtbot, live):
    view, commands = live
    seen = []
    view.display.drawn.connect(
        lambda ready: seen.append((ready, commands.session.known.frame, commands.session.known.result))
    )
    run(view, Stars(0.03))
    wait_drawn(qtbot, view, 8)
    for ready, frame, result in seen:
        assert frame is ready.frame
        if ready.update is not None:
            assert ready.update.shot.frame is frame
            assert result is ready.update.result
    assert sum(ready.update is not None for ready, _, _ in seen) >= 4
    assert view.display.latency_ms > 0


def test_names_stay_until_the_next_frame_is_solved(qtbot, live):
    """They went out with every frame that took longer to solve than to show."""
    view, commands = live
    run(view, Stars(0.03))
    qtbot.waitUntil(lambda: view.display.shown is not None and view.display.shown.result is not None)
    shown, session = view.display.shown, commands.session
    view.end()
    wait_idle(qtbot, view)
    overlay = commands.window.workspace.view.marks.__self__
    session.begin_stream("a camera")
    assert overlay.solution is None
    seen = []
    failed = NoSolution(Reason.TOO_FEW_STARS, "Expose longer.")
    for result in (None, shown.result, None, failed, None):
        session.stream(shown.frame, shown.picture, result)
        seen.append(overlay.solution)
    assert seen == [None, shown.result, shown.result, None, None]
    session.begin_stream("another")
    assert overlay.solution is None


def test_a_fast_camera_is_drawn_thirty_times_a_second_and_not_more(qtbot, live, monkeypatch):
    """Half a second in place of a thirtieth, which a busy machine takes to draw without being told to wait."""
    assert 1.0 / 34.0 < frame_display.SHORTEST_S < 1.0 / 29.0
    monkeypatch.setattr(frame_display, "SHORTEST_S", 0.5)
    view, _ = live
    run(view, Stars(0.05))
    wait_drawn(qtbot, view, 6)
    gaps = np.diff(view.display.moments)
    assert np.median(gaps) >= 0.45
    view.write()
    assert "drawn" in view.pointing.values["Frame rate"].toolTip()


def test_a_camera_faster_than_the_drawing_leaves_the_window_answering(qtbot, live, monkeypatch):
    """No timer ticked, no key was heard, while frames came faster than they were drawn."""
    view, commands = live
    picture, ticks, source = commands.presenter.panes.view, [], Stars(0.01)
    draw = picture.repaint

    def draw_slowly():
        draw()
        time.sleep(0.04)
        if len(view.display.moments) >= 10:
            source.frames = 0  # else a window that cannot answer would never hear of its end

    monkeypatch.setattr(picture, "repaint", draw_slowly)
    timer = QTimer()
    timer.timeout.connect(lambda: ticks.append(time.monotonic()))
    timer.start(10)
    run(view, source)
    wait_drawn(qtbot, view, 10)
    first, last = view.display.moments[0], view.display.moments[9]
    assert sum(first < tick < last for tick in ticks) >= 8


def test_a_slow_camera_leaves_the_window_answering(qtbot, live):
    view, _ = live
    ticks = []
    timer = QTimer()
    timer.timeout.connect(lambda: ticks.append(time.monotonic()))
    timer.start(10)
    seen = []

    class Slow(Told):
        """Works on two frames until the window has ticked ten times, or has shown that it cannot."""

        def update(self, frame, time_utc=None):
            before, end = len(ticks), time.monotonic() + 10.0
            while len(seen) < 2 and len(ticks) < before + 10 and time.monotonic() < end:
                time.sleep(0.02)
            if len(seen) < 2:
                seen.append(len(ticks) - before)
            return (yield from super().update(frame, time_utc))

    run(view, Stars(0.4), Slow(lambda n: refusal()))
    wait_drawn(qtbot, view, 2)
    qtbot.waitUntil(lambda: len(seen) > 1, timeout=15_000)
    assert min(seen) >= 10
    qtbot.waitUntil(lambda: "no stars visible" in view.title.text(), timeout=15_000)
    assert "Wait for the clouds" in view.text.text()


def test_a_watched_folder_is_a_camera_and_a_frame_without_answer_says_why(qtbot, live, tmp_path):
    view, commands = live
    view.camera.box.source.setCurrentIndex(view.camera.box.source.findData("folder"))
    view.camera.box.address.setText(str(tmp_path))
    qtbot.mouseClick(view.start, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: "Waiting" in view.title.text(), timeout=20_000)
    write_fits(Frame(np.full((300, 400), 1000, np.uint16)), tmp_path / "one.fits")
    qtbot.waitUntil(lambda: "No solution" in view.title.text(), timeout=20_000)
    assert view.text.text()
    qtbot.waitUntil(lambda: commands.session.known.frame is not None, timeout=20_000)  # rendered in a thread
    assert commands.session.known.frame.width == 400
    view.end()
    wait_idle(qtbot, view)


# stopping ------------------------------------------------------------------------------------------
def test_stop_is_immediate_though_the_driver_is_not(qtbot, live):
    view, commands = live
    source = Stuck(0.02)
    run(view, source)
    wait_drawn(qtbot, view, 1)
    qtbot.waitUntil(lambda: source.given >= 3)
    begun = time.monotonic()
    view.end()
    assert time.monotonic() - begun < 0.5  # the driver sleeps for a whole second
    drawn = len(view.display.moments)
    assert view.stop.isHidden()
    wait_idle(qtbot, view)
    assert source.closed == 1
    assert len(view.display.moments) == drawn
    assert commands.session.known.frame is not None
    assert view.start.isEnabled()


def test_the_last_frame_stays_as_an_opened_one(qtbot, live):
    view, commands = live
    run(view, Stars(0.03))
    wait_drawn(qtbot, view, 5)
    with qtbot.waitSignal(commands.session.pictured, timeout=10_000):
        view.end()
    wait_idle(qtbot, view)
    assert commands.session.known.name == "a camera"
    assert commands.session.known.result is not None
    assert commands.actions["solve"].isEnabled()


def test_it_can_be_started_again(qtbot, live):
    view, _ = live
    for _ in range(2):
        source = Stars(0.03)
        run(view, source)
        wait_drawn(qtbot, view)
        view.end()
        wait_idle(qtbot, view)
        assert source.closed == 1


def test_opening_a_file_ends_it(qtbot, live, a_file):
    view, commands = live
    run(view, Stars(0.03))
    wait_drawn(qtbot, view)
    with qtbot.waitSignal(commands.session.solved, timeout=10_000):
        commands.files.open(a_file)
    wait_idle(qtbot, view)
    assert commands.session.known.path == a_file
    assert "another frame" in view.message.text()


def test_closing_the_window_gives_the_camera_back(qtbot, live):
    view, commands = live
    source = Stars(0.03)
    run(view, source)
    wait_drawn(qtbot, view)
    commands.window.close()
    assert source.closed == 1


# what goes wrong -----------------------------------------------------------------------------------
def test_an_unplugged_camera_is_one_sentence_and_its_pointing_old(qtbot, live):
    view, _ = live
    source = Stars(0.05)
    run(view, source)
    wait_drawn(qtbot, view)
    qtbot.waitUntil(lambda: view.pointing.ra.text() != NOTHING, timeout=10_000)
    source.frames = 0
    wait_idle(qtbot, view)
    assert view.message.text() == "The camera was unplugged."
    assert view.message.property("role") == "wrong"
    assert view.pointing.old.isVisibleTo(view.pointing)
    assert view.start.isVisibleTo(view)


def test_a_camera_that_cannot_be_opened_is_one_sentence(qtbot, live):
    view, commands = live

    def refuse():
        raise PortError("The camera is in use by another program.")

    view.run(StreamRequest(refuse, "a camera"), lambda: Told(answer))
    wait_idle(qtbot, view)
    assert view.message.text() == "The camera is in use by another program."
    assert commands.session.known.frame is None


def test_a_lost_camera_is_waited_for_when_that_is_wished(qtbot, live, monkeypatch):
    monkeypatch.setattr("kochab.workflows.live.capture.RETRY_S", 0.2)
    view, _ = live
    cameras, said = [Stars(0.03, frames=5), Stars(0.03)], threading.Event()

    def open_camera():
        if len(cameras) == 1:
            said.wait(15)
        return cameras.pop(0)

    view.run(StreamRequest(open_camera, "a camera", again=True), lambda: Told(answer))
    qtbot.waitUntil(lambda: "reconnects" in view.message.text(), timeout=10_000)
    said.set()
    qtbot.waitUntil(lambda: not cameras and view.title.text() == "Tracking", timeout=10_000)


def test_an_answer_grows_old_on_the_screen_by_itself(qtbot, live):
    view, _ = live
    silent = threading.Event()

    class Silent(Stars):
        def next_frame(self, timeout_s):
            if not silent.is_set():
                return super().next_frame(timeout_s)
            time.sleep(timeout_s)
            return None

    source = Silent(0.02)
    source.settings = replace(source.settings, exposure_s=0.01)
    run(view, source)
    # No frame is missing until it is silent, however late a busy machine draws the first ones.
    qtbot.waitUntil(lambda: view.title.text() == "Tracking" and not view.pointing.old.isVisibleTo(view.pointing))
    silent.set()
    qtbot.waitUntil(lambda: view.pointing.old.isVisibleTo(view.pointing), timeout=10_000)
    assert "Last solved" in view.pointing.old.text()
    qtbot.waitUntil(lambda: view.title.text() == "No new frames")  # the last may have come after the last solved
    assert view.window().windowTitle() == "Live: No new frames, OLD pointing, a camera – Kochab"
    assert view.window().bar.doing.text() == "Live: No new frames, OLD pointing"
    view.end()
    wait_idle(qtbot, view)
    assert view.window().windowTitle() == "a camera – Kochab"
    assert view.pointing.values["Uncertainty"].text() == NOTHING


def test_a_fault_in_the_solver_is_a_sentence_too(qtbot, live):
    view, _ = live

    class Broken(Told):
        def update(self, frame, time_utc=None):
            raise LineLostError("The line broke.")
            yield

    run(view, Stars(0.03), Broken())
    wait_idle(qtbot, view)
    assert view.message.text() == "The line broke."


@pytest.mark.parametrize(("address", "says"), [("", "Choose the folder"), ("/nowhere", "does not exist")])
def test_a_folder_that_is_not_there_is_a_sentence_and_the_window_goes_on(qtbot, live, address, says):
    view, commands = live
    box = view.camera.box
    box.source.setCurrentIndex(box.source.findData("folder"))
    box.address.setText(address)
    ticks, timer = [], QTimer()
    timer.timeout.connect(lambda: ticks.append(time.monotonic()))
    timer.start(10)
    qtbot.mouseClick(view.start, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: says in view.message.text())
    wait_idle(qtbot, view)
    qtbot.wait(300)
    assert np.diff(ticks).max() < 1.0
    assert commands.window.windowTitle().startswith("Live: stopped")
    assert says in commands.window.workspace.card.text.text()


# choosing ------------------------------------------------------------------------------------------
def test_an_absent_extra_says_how_to_get_it(qtbot, live, monkeypatch):
    view, _ = live
    sentence = "INDI cameras need one more package: pip install kochab-astro[indi]"
    monkeypatch.setattr("kochab.gear.cameras.indi.IndiCamera.missing", classmethod(lambda _: sentence))
    view.camera.box.source.setCurrentIndex(view.camera.box.source.findData("indi"))
    qtbot.waitUntil(lambda: view.camera.box.status.text() == sentence, timeout=10_000)
    qtbot.mouseClick(view.start, Qt.MouseButton.LeftButton)
    wait_idle(qtbot, view)
    assert view.message.text() == sentence


def test_what_is_found_fills_the_address(qtbot):
    panel = CameraPanel()
    qtbot.addWidget(panel)
    panel.box.source.setCurrentIndex(panel.box.source.findData("webcam"))
    panel.box.show_found(
        "webcam", [CameraDevice("webcam", "/dev/video0", "A webcam"), CameraDevice("webcam", "/dev/video2", "Another")]
    )
    assert panel.box.selection.address == "/dev/video0"
    panel.box.found.setCurrentIndex(1)
    panel.box.found.activated.emit(1)
    assert panel.box.selection.address == "/dev/video2"
    panel.box.show_found("webcam", [])
    assert "address" in panel.box.status.text()


def test_settings_reach_the_camera_once_they_settle(qtbot, live):
    view, _ = live
    source = Stars(0.03)
    run(view, source)
    wait_drawn(qtbot, view)
    for value in (0.1, 0.2, 0.25):
        view.camera.fields.exposure.setValue(value)
    qtbot.waitUntil(lambda: source.settings.exposure_s == 0.25, timeout=10_000)
    qtbot.waitUntil(lambda: "0.25 s" in view.camera.fields.in_force.text(), timeout=10_000)
    assert view.camera.fields.exposure.maximum() == source.limits.exposure_s[1]
    assert view.camera.fields.gain.isHidden()
    assert "cannot set gain" in view.camera.fields.in_force.text()


def test_limits_that_are_not_known_leave_everything_to_be_wished_for(qtbot):
    panel = CameraPanel()
    qtbot.addWidget(panel)
    panel.fields.show_limits(CaptureLimits(), panel.fields.settings())
    assert panel.fields.exposure.isHidden()
    assert panel.levels.isHidden()  # nothing has been measured
    panel.set_running(False)
    assert panel.fields.exposure.isEnabled()
    assert not panel.fields.exposure.isHidden()


def test_choices_are_kept_for_the_next_start(qtbot, make_window, engine, tmp_path):
    window, commands = make_window(engine)
    commands.views.show("live")
    view = commands.views.docks["live"].view
    view.camera.box.source.setCurrentIndex(view.camera.box.source.findData("folder"))
    view.camera.box.address.setText(str(tmp_path))
    view.camera.lens.setText("guide scope")
    view.camera.fields.exposure.setValue(2.5)
    view.camera.reconnect.setChecked(True)
    window.close()
    _, commands = make_window(engine)
    commands.views.show("live")
    kept = commands.views.docks["live"].view.camera
    assert (kept.box.kind, kept.box.address.text(), kept.lens.text()) == ("folder", str(tmp_path), "guide scope")
    assert kept.reconnect.isChecked()
    assert kept.fields.settings().exposure_s == 2.5
    assert kept.fields.settings().gain is None


@pytest.mark.parametrize("kept", ["{", "[]", '{"exposure": "x", "where": 3, "source": "none"}'])
def test_damaged_settings_read_as_none(make_window, engine, settings, kept):
    settings.keep("live", kept)
    _, commands = make_window(engine)
    commands.views.show("live")
    assert commands.views.docks["live"].view.camera.box.kind == "simulated"


# recording, looks ----------------------------------------------------------------------------------
def test_recording_is_switched_on_and_off_while_it_runs(qtbot, make_window, engine, tmp_path):
    _, commands = make_window(engine)
    wiring = Wiring(to_record=lambda update: {"solved": True})
    view = LiveView(replace(commands.services, wiring=wiring))
    qtbot.addWidget(view)
    view.record.use_folder(tmp_path / "nights")
    run(view, Stars(0.05))
    view.record.switch.setChecked(True)
    qtbot.waitUntil(lambda: "Recording" in view.record.status.text(), timeout=10_000)
    view.record.switch.setChecked(False)
    qtbot.waitUntil(lambda: "were recorded into" in view.message.text(), timeout=10_000)
    (folder,) = (tmp_path / "nights").iterdir()
    assert json.loads((folder / "session.json").read_text())["frames"] >= 1
    view.end()
    wait_idle(qtbot, view)


def test_without_what_writes_recordings_the_switch_says_so(live):
    view, _ = live
    assert not view.record.switch.isEnabled()
    assert "not available" in view.record.status.text()


@pytest.mark.parametrize("tab", [0, 1])
def test_it_is_red_at_night(qtbot, live, tab):
    view, commands = live
    commands.actions["night"].trigger()
    qtbot.waitUntil(lambda: commands.appearance.settled)
    run(view, Stars(0.05))
    wait_drawn(qtbot, view, 4)
    view.tabs.setCurrentIndex(tab)
    view.write()
    qtbot.wait(50)
    assert_red(commands.window)
    view.pointing.old.setVisible(True)
    view.pointing.doubt.setText("Your camera profile is off.")
    view.pointing.doubt.setVisible(True)
    view.end()
    assert_red(commands.window)
    commands.appearance.use_theme("dark")


def test_a_stretch_that_is_moved_shows_in_the_next_frame(qtbot, make_window):
    _, commands = make_window(FakeEngine())
    commands.views.show("live")
    view = commands.views.docks["live"].view
    run(view, Stars(0.2))  # whose darkest pixel rises by one a frame
    wait_drawn(qtbot, view, 3)
    strip = commands.window.workspace.strip
    dark = _mean(commands)
    strip.bright.setValue(1000)
    qtbot.waitUntil(lambda: _mean(commands) > dark + 20, timeout=5000)
    assert not strip.auto.isChecked()


def test_the_sliders_follow_the_automatic_stretch_from_frame_to_frame(qtbot, make_window):
    """They stood where the first frame had them: moving one made a sky black that had changed since."""
    _, commands = make_window(FakeEngine())
    commands.views.show("live")
    view, source = commands.views.docks["live"].view, Stars(0.03)
    run(view, source)
    wait_drawn(qtbot, view, 3)
    strip = commands.window.workspace.strip
    first = strip.black.value()
    source.given = 500  # the darkest pixel's value: the range of values begins there, not at 1
    qtbot.waitUntil(lambda: strip.black.value() < first - 20)
    assert strip.auto.isChecked()
    assert strip.stretch == view.display.shown.picture.auto
    dark = _mean(commands)
    strip.bright.setValue(1000)
    qtbot.waitUntil(lambda: _mean(commands) > dark + 20)


def _mean(commands):
    return float((commands.window.workspace.view.picture.memory & 0xFF).mean())


def test_a_lens_without_a_name_is_saved_from_the_pointing_page(qtbot, live):
    """It said only that the lens was to be named, while the field for the name is locked during a stream."""
    view, _ = live
    solver = Told(answer)
    solver.name, solver.profile = "", replace(new_profile("", CAMERA), frames=3)
    run(view, Stars(0.05), solver)
    qtbot.waitUntil(lambda: view.pointing.save.isVisible())
    view.pointing.save.click()
    dialog = view.findChild(QInputDialog)
    dialog.setTextValue(" guide scope ")
    dialog.accept()
    qtbot.waitUntil(lambda: solver.name == "guide scope")
    assert view.camera.lens.text() == "guide scope"
    view.write()
    assert not view.pointing.save.isVisible()
    view.end()
    wait_idle(qtbot, view)


def test_rates_have_no_rows_before_they_are_measured(qtbot, live):
    view, _ = live
    run(view, Stars(0.05))
    qtbot.waitUntil(lambda: view.pointing.values["Frame rate"].isVisible())
    assert view.pointing.values["Rates"].text() == NOTHING
    assert not view.pointing.values["Rates"].isVisible()
    assert "Rates" not in [name.text() for name in view.pointing.findChildren(QLabel) if name.isVisible()]
    view.end()
    wait_idle(qtbot, view)
