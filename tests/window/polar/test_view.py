"""Polar alignment as a person does it: on the practice telescope, from files, and when it fails."""

import threading
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from PySide6.QtCore import QEventLoop, Qt, QTimer
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractSpinBox,
    QApplication,
    QComboBox,
    QLineEdit,
    QListWidget,
    QPlainTextEdit,
)

from kochab.core.capture import CameraSource
from kochab.core.errors import KochabError, LineLostError, NoAnswerError, UsageError
from kochab.core.frame import Site
from kochab.core.mount import Ability, Direction
from kochab.core.progress import run
from kochab.frames.fits_write import write_fits
from kochab.gear.session import CameraSelection
from kochab.polar.bolts import HAND_ARCSEC, Base
from kochab.polar.error import Knob
from kochab.polar.measure import PolarFinding, PolarFindingKind
from kochab.polar.pole import Pole
from kochab.polar.report import History
from kochab.polar.tutor import Instruction, TutorStep
from kochab.simulate.practice import PracticeNight
from kochab.simulate.rig import PracticeRig, RigConfig, misaligned, through, tonight
from kochab.window.polar.alignment_run import PracticeAdjuster
from kochab.window.polar.bolts_view import KEYS, MOTORS
from kochab.window.polar.history import writing
from kochab.workflows.polar.measure import MountTurner
from kochab.workflows.polar.update import PolarButton, PolarControls, TurnInstruction
from kochab.workflows.session.alignment import (
    AlignmentRequest,
    AlignmentTools,
    AxisTurnedBy,
    FrameSource,
    alignment_task,
    mount_turner,
)
from kochab.workflows.session.alignment_state import AlignmentState
from tests.window.polar.test_night import entry
from tests.window.polar_cases import adjusting
from tests.window.test_night import assert_red

LIMIT_S = 200
SITE = Site(47.0, 8.0, 450.0)
MOST_CLICKS = 12  # the first is Begin
QUICK = 12.0  # simulated seconds a second: a frame of each that passes is solved, in waits as well


class Nights:
    """Practice nights of a mount without wear: what it measures is then all there is."""

    def __init__(self, rate=QUICK):
        self.rate = rate
        self.made = []

    def __call__(self, fov_deg):
        rig = through(misaligned(tonight(3, SITE), 40.0), fov_deg)
        camera = replace(rig.camera, width=640, height=480, cheap=True)  # frames are most of a run's work
        rig = replace(rig, camera=camera)
        started = PracticeNight(replace(rig, rate=self.rate))
        self.made.append(started)
        return started

    @property
    def true_arcsec(self):
        return self.made[-1].rig.truth().axis_error().total_arcsec


def drive(view, each=lambda: None, limit_s=LIMIT_S):
    """Run the event loop until the alignment is over, looking now and then."""
    loop, timer, end = QEventLoop(), QTimer(), QTimer()
    timer.setInterval(10)
    timer.timeout.connect(lambda: (each(), view.buttons.start.isHidden() or loop.quit()))
    end.setSingleShot(True)
    end.timeout.connect(loop.quit)
    timer.start()
    end.start(1000 * limit_s)
    loop.exec()
    timer.stop()
    assert not view.buttons.start.isHidden(), f"not over: {view.alignment.state.stage}, {view.alignment.state.words}"


def test_a_whole_alignment_by_hand_on_the_practice_telescope(qtbot, polar):
    """Measure, turn the bolts as told, measure again: the axis really stands at the pole."""
    nights = Nights()
    _, view = polar(nights)
    view.setup.frames.exposure.setValue(1.0)
    view.setup.axis.hand.setCurrentText(AxisTurnedBy.PERSON)
    stages, words, obeyed, answers, pictures, clicks = [], [], [], [], [], []
    view.buttons.start.setFocus()
    view.begin()
    assert view.window().focusWidget() is view.room.frame, "Space opened the big digits"

    def person():
        state = view.alignment.state
        if not stages or stages[-1] != state.stage:
            stages.append(state.stage)
        asked = state.turn_instruction or state.instruction
        if state.hand_needed and not any(asked is one for one in obeyed):  # equal asks recur
            obeyed.append(asked)
            words.append(view.alignment.state.words)
            assert view.buttons.turn_for_me.isVisible()
            clicks.extend([asked] * view.buttons.turn_for_me.isEnabled())
            view.buttons.turn_for_me.click()
            answers.append((view.message.text(), view.buttons.turn_for_me.isEnabled()))
            pictures.append(view.room.frame.picture)

    drive(view, person)
    assert view.alignment.state.stage == "done", view.message.text()
    assert "within your 30″" in view.message.text()
    assert set(answers) == {("Turned; taking a frame (1 s).", False)}, "heard at once, and not to be pressed again yet"
    assert any(picture is not None for picture in pictures), "the live frame is the room"
    assert view.room.frame.picture is None, "and gone with the practice"
    assert nights.true_arcsec < 30.0
    assert 1 + len(clicks) <= MOST_CLICKS, "the hand goes on at a bolt by itself"
    assert view.alignment.state.error.total_arcsec == pytest.approx(nights.true_arcsec, abs=15.0)
    assert stages.count("adjust") >= 1
    assert stages[-2:] != ["adjust", "done"]  # it measured once more by itself
    assert any("Rotate RA about" in told for told in words)
    assert any(told.endswith(" turn clockwise, then wait.") for told in words)
    assert len(view.alignment.state.measured) >= 2
    # What is kept of it.
    history = view.history.history
    assert history.entries[0].kind == history.entries[-1].kind == "measured"
    assert "from the pole" in view.history.summary.text()
    assert "turn clockwise, then wait." in view.history.lines.toPlainText()
    assert view.history.chart.series
    # The practice telescope is gone with it.
    assert view.alignment.adjuster is None


def test_practice_hands_go_on_at_a_bolt_until_it_is_good_or_comes_back():
    done = []
    hands = PracticeAdjuster(SimpleNamespace(do=done.append))

    def asked(knob, turns, **more):
        return AlignmentState("adjust", instruction=Instruction(TutorStep.TURN, "", knob, turns, **more))

    assert not hands.goes_on(asked(Knob.ALTITUDE, 0.25)), "a person lays the hand on it first"
    hands.turn(asked(Knob.ALTITUDE, 0.25))
    assert hands.goes_on(asked(Knob.ALTITUDE, 1.0))
    assert not hands.goes_on(asked(Knob.ALTITUDE, -0.5)), "comes back"
    assert not hands.goes_on(asked(Knob.AZIMUTH, 0.25)), "the other bolt"
    assert not hands.goes_on(asked(Knob.ALTITUDE, 1.0, stray=True)), "something went wrong: a person looks first"
    assert not hands.goes_on(AlignmentState("adjust")), "nothing is asked for"
    hands.turn(AlignmentState("turn", turn_instruction=TurnInstruction("turn", None, "", Direction.WEST, 60.0)))
    assert not hands.goes_on(asked(Knob.ALTITUDE, 1.0)), "the hand was at the RA axis"
    assert len(done) == 2


@pytest.mark.parametrize("hand", [AxisTurnedBy.PERSON, AxisTurnedBy.MOUNT])
def test_run_sounds_and_phone_page_end_with_the_practice(qtbot, polar, hand):
    _, view = polar(Nights())
    view.phone._host = "127.0.0.1"
    view.setup.frames.exposure.setValue(1.0)
    view.setup.axis.hand.setCurrentText(hand)
    mount = view._services.mount
    mount.practise()
    qtbot.waitUntil(lambda: mount.practice is not None, timeout=LIMIT_S * 1000)
    view.buttons.sound.click()
    view.phone.switch.setChecked(True)
    qtbot.waitUntil(lambda: bool(view.phone.url.text()), timeout=LIMIT_S * 1000)
    view.begin()
    assert view.alignment.state.running, view.message.text()
    mount.disconnect_mount()
    drive(view)
    assert view.alignment.state.stage == "ended"
    assert not view.cues.on
    assert not view.buttons.sound.isChecked()
    qtbot.waitUntil(lambda: not view.phone.page.url, timeout=LIMIT_S * 1000)
    qtbot.waitUntil(lambda: mount.known.phase == "off", timeout=LIMIT_S * 1000)


def test_a_run_from_files_goes_on_when_the_mount_goes(qtbot, polar, frames):
    _, view = polar(Nights())
    view._services.mount.practise()
    qtbot.waitUntil(lambda: view._services.mount.practice is not None, timeout=LIMIT_S * 1000)
    view.buttons.sound.click()
    choose_files(view, frames)
    view.begin()
    view._services.mount.disconnect_mount()
    drive(view)
    assert view.alignment.state.stage == "done", view.message.text()
    assert view.cues.on
    qtbot.waitUntil(lambda: view._services.mount.known.phase == "off", timeout=LIMIT_S * 1000)


def test_a_second_sweep_is_at_another_declination(qtbot, polar):
    """Pressed while it measures: the first sweep ends, then hands are told to turn declination."""
    nights = Nights()
    _, view = polar(nights)
    view.setup.frames.exposure.setValue(1.0)
    view.window().setUpdatesEnabled(False)  # drawn in the alignment by hand: half of all the work
    view.begin()
    assert view.buttons.second.isVisible()
    assert view.page.flexure.isEnabled()
    view.buttons.second.trigger()
    assert "another declination" in view.message.text()
    assert view.alignment.controls.pressed(PolarButton.SECOND_SWEEP)
    obeyed, ways, decs = [], [], []

    def person():
        asked = view.alignment.state.turn_instruction
        if view.alignment.state.hand_needed and asked is not None and not any(asked is o for o in obeyed):
            obeyed.append(asked)
            ways.append(asked.direction)
            decs.append(nights.made[-1].rig.truth().ra_dec_deg[1])
            view.buttons.turn_for_me.click()
        if view.alignment.state.stage == "adjust":
            view.buttons.cancel.trigger()

    drive(view, person)
    across = [w for w in ways if w in (Direction.NORTH, Direction.SOUTH)]
    assert len(across) == 1
    moved_deg = decs[-1] - decs[0]
    assert abs(moved_deg) > 5.0, "it really is another declination"
    assert (moved_deg > 0.0) == (across[0] is Direction.NORTH)
    assert ways[-1] in (Direction.EAST, Direction.WEST)
    assert len(view.alignment.state.measured) == 1, "from both sweeps"


def taken(folder, dec_deg):
    """Three frames of a perfect mount that stands 20 arcmin too high, 40 deg apart in all."""
    base = RigConfig(seed=5, site=SITE, start_deg=(-40.0, dec_deg))
    mount = replace(base.mount, misalignment_arcmin=(20.0, 0.0))
    rig = PracticeRig(through(replace(base, mount=mount), 4.0))
    paths = []
    for number in range(3):
        path = folder / f"dec{dec_deg:.0f}-{number}.fits"
        write_fits(rig.frame(1.0), path)
        paths.append(path)
        rig.mount.turn_by_hand(20.0)
        rig.wait_until_still(1.0)
    return paths


@pytest.fixture(scope="module")
def frames(tmp_path_factory):
    return taken(tmp_path_factory.mktemp("frames"), 45.0)


@pytest.fixture(scope="module")
def second_sweep(tmp_path_factory):
    return taken(tmp_path_factory.mktemp("second"), 15.0)


def choose_files(view, files):
    view.setup.frames.source.setCurrentText(FrameSource.FILES)
    view.setup.frames.files.add(files)


def test_a_window_that_closes_while_motors_turn_leaves_the_systems_dialogs(polar):
    """Its Stop key no longer listens; the window itself is deleted some time later."""
    native = Qt.ApplicationAttribute.AA_DontUseNativeDialogs
    commands, view = polar()
    assert not QApplication.testAttribute(native)
    view._key.listen(True)
    assert QApplication.testAttribute(native)
    commands.window.close()
    assert not QApplication.testAttribute(native)


def test_files_are_measured(polar, frames):
    _, view = polar()
    choose_files(view, [*frames, frames[0]])
    assert view.setup.frames.files.count() == 3  # each once
    view.buttons.start.click()
    drive(view)
    assert view.alignment.state.stage == "done", view.message.text()
    assert view.alignment.state.error.altitude_arcsec == pytest.approx(1200.0, abs=20.0)
    card = view.room.knobs[Knob.ALTITUDE]
    assert card.value.text() in ("▼ 19.9′", "▼ 20.0′", "▼ 20.1′")
    assert card.way.text() == "lower the axis"
    assert "Refracted pole" in view.page.pole.text()
    assert view.alignment.state.findings
    assert "⚠ " in view.history.notes.text()


def test_the_report_is_kept_as_a_page_and_as_a_pdf(qtbot, polar, frames, tmp_path):
    _, view = polar()
    choose_files(view, frames[:2])
    view.begin()
    drive(view)
    page, paper = tmp_path / "report.html", tmp_path / "report.pdf"
    view.history.write(page)
    qtbot.waitUntil(lambda: page.with_suffix(".json").exists(), timeout=10_000)
    assert "<svg" in page.read_text("utf-8")
    with qtbot.waitSignal(view._services.jobs.run(writing(paper, view.history.history), "pdf").finished):
        pass
    assert paper.read_bytes()[:5] == b"%PDF-"
    assert paper.stat().st_size > 10_000  # with its drawings
    (tmp_path / "mine.json").write_text("mine")
    with pytest.raises(KochabError, match=r"mine.json already exists"):
        run(writing(tmp_path / "mine.html", view.history.history))
    with pytest.raises(KochabError, match=r"Can't write report\.pdf"):
        run(writing(tmp_path / "absent" / "report.pdf", view.history.history))


def test_a_second_sweep_answers_for_flexure(polar, frames, second_sweep):
    _, view = polar()
    choose_files(view, frames)
    view.setup.aim.imaging.setText("50 mm")
    view.begin()
    assert "as in 600 mm, 3.76 µm, 300 s" in view.message.text()
    view.setup.aim.imaging.setText("50 mm, 9 µm, 2 s")
    view.begin()
    drive(view)
    (guided, allows), (_, alone) = view.page.enough.rows
    assert guided.text() == "50 mm, 2 s, guided"
    assert [each.text().endswith(": yes, already") for each in (allows, alone)] == [True, True]
    spoilt = replace(view.alignment.state, findings=(PolarFinding(PolarFindingKind.FAR, "Far.", spoils=True),))
    view.page.show_state(spoilt)
    assert ":" not in allows.text(), "no advice from a spoilt measurement"
    view.page.show_state(view.alignment.state)
    assert "Flexure not measured" in view.history.notes.text()
    view.setup.frames.files.add(second_sweep, 1)
    assert "second sweep" in view.setup.frames.files.item(3).text()
    view.begin()
    drive(view)
    assert view.alignment.state.stage == "done", view.message.text()
    assert "Flexure not measured" not in view.history.notes.text()
    assert view.alignment.state.error.altitude_arcsec == pytest.approx(1200.0, abs=20.0)


def test_the_other_pole_moves_the_error_by_the_refraction(polar, frames):
    _, view = polar()
    choose_files(view, frames)
    view.setup.aim.pole.setCurrentIndex(1)
    assert view.setup.aim.chosen_pole is Pole.TRUE
    view.begin()
    drive(view)
    # At 47 deg the air lifts the pole by about 52 arcsec.
    assert view.alignment.state.error.altitude_arcsec == pytest.approx(1252.0, abs=25.0)


def test_one_file_is_not_enough(polar, frames):
    _, view = polar()
    choose_files(view, frames[:1])
    view.begin()
    drive(view)
    assert "needs two frames" in view.message.text()
    assert view.message.property("role") == "wrong"


def test_a_site_that_is_none_is_said_before_anything_starts(polar):
    _, view = polar(Nights())
    view.setup.frames.source.setCurrentText(FrameSource.CAMERA)
    view.setup.aim.site.setText("nowhere")
    view.begin()
    assert "is not a site" in view.message.text()
    assert view.alignment.job is None


def test_a_camera_that_is_not_there_is_one_sentence(polar, tmp_path):
    _, view = polar()
    view.setup.frames.source.setCurrentText(FrameSource.CAMERA)
    view.setup.frames.camera.source.setCurrentIndex(view.setup.frames.camera.source.findData("folder"))
    view.setup.frames.camera.address.setText(str(tmp_path / "absent"))
    view.begin()
    drive(view)
    assert view.message.property("role") == "wrong"
    assert view.alignment.state.stage == "ended"
    assert "absent" in view.message.text()


def test_the_mount_is_asked_for_only_when_it_is_known(polar, tmp_path):
    _, view = polar()
    view.setup.frames.source.setCurrentText(FrameSource.CAMERA)
    view.setup.frames.camera.source.setCurrentIndex(view.setup.frames.camera.source.findData("folder"))
    view.setup.frames.camera.address.setText(str(tmp_path))
    view.setup.aim.site.setText("47, 8")
    view.setup.axis.hand.setCurrentText(AxisTurnedBy.MOUNT)
    assert "No mount set up" in view.setup.axis.mount.text()
    view.begin()
    drive(view)
    assert "Connect it once in the Mount view" in view.message.text()


def test_practice_hands_rotate_ra_once_however_long_the_frame_takes(polar):
    """After eight seconds the button could be pressed again, and RA was rotated by twice as much."""
    _, view = polar()
    asked = TurnInstruction("turn", None, "Rotate RA.", Direction.WEST, 60.0)
    view.alignment.state = AlignmentState("turn", turn_instruction=asked)
    view.alignment.adjuster = PracticeAdjuster(SimpleNamespace(do=lambda _: None))
    view.turn_practice()
    view._answered_s -= 3600.0
    view._enable(True)
    view._show()
    assert not view.buttons.turn_for_me.isEnabled()
    view.alignment.adjuster = None  # a person may have forgotten it
    view._show()
    assert view.buttons.done.isEnabled()
    view.alignment.state = AlignmentState()
    view._enable(False)


def test_cancel_ends_it_and_another_can_begin(qtbot, polar):
    nights = Nights()
    _, view = polar(nights)
    view.begin()
    qtbot.waitUntil(lambda: view.alignment.state.stage in ("measure", "turn"), timeout=30_000)
    view.buttons.cancel.trigger()
    drive(view)
    assert view.alignment.state.stage == "ended"
    assert view.message.text() == "Cancelled. Nothing measured."
    view.begin()
    qtbot.waitUntil(lambda: view.alignment.adjuster is not None, timeout=30_000)
    view.buttons.cancel.trigger()
    drive(view)
    assert len(nights.made) == 2


def test_a_fault_of_the_practice_telescope_is_one_sentence(polar):
    def broken(fov_deg):
        raise KochabError("The practice telescope cannot be started.")

    _, view = polar(broken)
    view.begin()
    drive(view)
    assert view.message.text() == "The practice telescope cannot be started."


def test_without_a_simulated_sky_practice_is_not_offered(polar):
    _, view = polar(None)
    texts = [view.setup.frames.source.itemText(i) for i in range(view.setup.frames.source.count())]
    assert texts == [FrameSource.CAMERA, FrameSource.FILES]


def test_what_was_chosen_is_there_again(polar, frames):
    _, view = polar()
    choose_files(view, frames[:1])
    view.setup.aim.pole.setCurrentIndex(2)
    view.setup.aim.goal.setValue(60)
    view.begin()
    drive(view)
    _, again = polar()
    assert again.setup.frames.chosen is FrameSource.FILES
    assert again.setup.aim.chosen_pole is Pole.HALF_WAY
    assert again.setup.aim.goal.value() == 60


def test_space_presses_done_when_something_is_to_be_turned(qtbot, polar):
    commands, view = polar(Nights())
    commands.window.activateWindow()
    view.begin()
    qtbot.waitUntil(lambda: view.alignment.state.hand_needed, timeout=60_000)
    view.buttons.turn_for_me.setFocus()
    pressed = []
    view.buttons.turn_for_me.clicked.connect(lambda: pressed.append(1))
    qtbot.keyClick(view.buttons.turn_for_me, Qt.Key.Key_Space)
    assert pressed
    assert "taking a frame" in view.message.text()
    view.buttons.cancel.trigger()
    drive(view)


def test_f7_shows_the_bolts_over_the_whole_screen(qtbot, polar):
    commands, view = polar()
    view.alignment.state = adjusting(-900.0, 100.0)
    commands.window.activateWindow()
    qtbot.waitUntil(commands.window.isActiveWindow)
    view.buttons.start.setFocus()
    qtbot.keyClick(view.buttons.start, Qt.Key.Key_F7)
    qtbot.waitUntil(view.bolts.isFullScreen)
    assert view.bolts.digits() == "15.0′"
    qtbot.keyClick(view.bolts, Qt.Key.Key_S)
    assert view.cues.on
    assert "sounds" in view.bolts.sounding
    qtbot.keyClick(view.bolts, Qt.Key.Key_N, Qt.KeyboardModifier.ControlModifier)
    assert commands.actions["night"].isChecked(), "red light without leaving the bolts"
    qtbot.keyClick(view.bolts, Qt.Key.Key_N, Qt.KeyboardModifier.ControlModifier)
    qtbot.keyClick(view.bolts, Qt.Key.Key_Escape)
    assert not view.bolts.isVisible()


def test_every_control_can_be_reached_and_says_what_it_is(polar):
    _, view = polar(Nights())
    kinds = (QAbstractButton, QComboBox, QLineEdit, QListWidget, QAbstractSpinBox, QPlainTextEdit)
    for widget in [w for inside in (view, view.room) for k in kinds for w in inside.findChildren(k)]:
        if widget.objectName().startswith("qt_") or isinstance(widget.parent(), QComboBox | QAbstractSpinBox):
            continue
        name = widget.accessibleName() or getattr(widget, "text", str)()
        assert name, widget.metaObject().className()
        if not widget.inherits("QScrollBar"):
            assert widget.focusPolicy() & Qt.FocusPolicy.TabFocus, name


def test_red_light_alone_at_night(qtbot, polar, frames):
    commands, view = polar(Nights())
    commands.actions["night"].trigger()
    qtbot.waitUntil(lambda: commands.appearance.settled)
    choose_files(view, frames[:2])
    for index in range(view.tabs.count()):
        view.tabs.setCurrentIndex(index)
        assert_red(commands.window)
    view.begin()
    drive(view)
    for index in (1, 2):
        view.tabs.setCurrentIndex(index)
        assert_red(commands.window)
    view.alignment.state = adjusting(-900.0, 100.0)
    view._show()
    view.tabs.setCurrentIndex(1)
    assert_red(commands.window)
    view.phone._host = "127.0.0.1"
    view.phone.switch.setChecked(True)
    qtbot.waitUntil(lambda: bool(view.phone.code.rows), timeout=15_000)
    view.tabs.setCurrentIndex(3)
    assert_red(commands.window)


# The mount that turns.


class StubGuard:
    """What a guard is asked here: its rates, and to stop."""

    def __init__(self, rates=(), lacks=None):
        self.mount = self
        self.rates_deg_s = rates
        self.lacks = lacks or {}
        self.stopped = threading.Event()

    def stop(self):
        self.stopped.set()
        raise NoAnswerError("The mount is silent.")


def test_the_mounts_own_rate_is_used():
    assert isinstance(mount_turner(StubGuard((0.004, 0.5, 3.0)), None), MountTurner)
    assert mount_turner(StubGuard((0.004, 0.5, 3.0)), None)._rate == 3.0


@pytest.mark.parametrize(
    ("guard", "words"),
    [
        (StubGuard((0.004, 0.06)), "no rate fast enough"),
        (StubGuard(lacks={Ability.MOVE: "It has no motion keys."}), "no motion keys"),
    ],
)
def test_a_mount_that_cannot_turn_leaves_it_to_the_hand(guard, words):
    with pytest.raises(KochabError, match=words):
        mount_turner(guard, None)


@pytest.mark.parametrize("ending", ["cancel", "close"])
def test_the_mount_turns_itself_and_stands_still_when_it_is_given_up(qtbot, polar, ending):
    nights = Nights(rate=1.0)  # motions are timed by the wall
    commands, view = polar(nights)
    view.setup.axis.hand.setCurrentText(AxisTurnedBy.MOUNT)
    view.setup.frames.exposure.setValue(0.5)
    view.begin()
    qtbot.waitUntil(lambda: "The mount turns" in view.alignment.state.words, timeout=60_000)
    assert "Keep clear" in view.alignment.state.words
    assert view.buttons.turn_for_me.isHidden() or not view.buttons.turn_for_me.isEnabled()
    mount = nights.made[-1].rig.mount
    qtbot.waitUntil(lambda: mount.slewing, timeout=20_000)
    if ending == "cancel":
        view.buttons.cancel.trigger()
        drive(view)
    else:
        commands.window.close()
    first = mount.axes_deg()
    qtbot.wait(700)
    second = mount.axes_deg()
    assert not mount.slewing
    # It may track, 15 arcsec a second, and no more.
    assert abs(second[0] - first[0]) < 0.02


class Unplugged(CameraSource):
    """A camera whose cable is pulled after it was opened."""

    name = "unplugged"

    def next_frame(self, timeout_s):
        raise LineLostError("The camera was unplugged.")

    def close(self):
        pass


def test_a_camera_that_goes_is_not_taken_for_the_mounts_line():
    tools = AlignmentTools(
        PolarControls(), lambda step: None, lambda history: None, open_camera=lambda *wish: Unplugged()
    )
    wish = AlignmentRequest(FrameSource.CAMERA, site=SITE, camera=CameraSelection("folder", "somewhere"))
    with pytest.raises(NoAnswerError, match="unplugged"):
        run(alignment_task(wish, tools))


def test_a_site_is_filled_in_once_and_stays_empty_when_it_is_cleared(polar, settings):
    _, view = polar()
    settings.keep_site(Site(48.0, 11.0))
    view.setup.refresh()
    assert view.setup.aim.site.text().startswith("48, 11")
    view.setup.aim.site.clear()
    view.setup.refresh()  # as twice a second while a mount is connected
    assert view.setup.aim.site.text() == ""
    settings.keep_site(SITE)
    view.setup.refresh()
    assert view.setup.request().site == SITE


def test_wishes_are_understood(polar):
    _, view = polar()
    view.setup.aim.site.setText("-35.2, 149.1, 600")
    view.setup.aim.fov.setText("2,4")
    wish = view.setup.request()
    assert wish.site == Site(-35.2, 149.1, 600.0)
    assert wish.fov_deg == 2.4
    assert wish.turn_deg is None
    assert "south pole" in view.setup.aim.pole_name.text()
    view.setup.aim.fov.setText("wide")
    with pytest.raises(UsageError, match="field of view"):
        view.setup.request()


@pytest.mark.parametrize(("spoils", "word"), [(False, "Done."), (True, "Not to be trusted")])
def test_a_spoilt_measurement_does_not_end_in_green(polar, spoils, word):
    _, view = polar()
    finding = PolarFinding(PolarFindingKind.DISAGREE, "Something slipped.", spoils=spoils)
    view.alignment.state = replace(adjusting(300.0, 20.0), findings=(finding,))
    view.alignment._succeeded(History(entries=[entry(0, 300.0, "measured")]))
    assert view.message.text().startswith(word)
    assert view.message.property("role") == ("wrong" if spoils else "good")


def test_an_empty_night_says_so(polar):
    _, view = polar()
    assert not view.history.save.isEnabled()
    view.history.keep(History())
    assert "No alignment measured" in view.history.summary.text()
    assert view.page.target.reach_arcsec > 300.0
    assert np.isfinite(AlignmentState().fraction or 0.0)


def test_nobody_turns_the_practice_telescope_and_its_drift_tells(qtbot, polar):
    nights = Nights(rate=30.0)
    _, view = polar(nights)
    view.setup.frames.exposure.setValue(1.0)
    view.setup.axis.hand.setCurrentText(AxisTurnedBy.NOBODY)
    assert "touch nothing" in view.setup.advice.text()
    for hidden in (view.setup.axis.turn, view.setup.axis.second, view.setup.aim.goal):
        assert not view.setup.form.isRowVisible(hidden)
    assert view.setup.form.isRowVisible(view.setup.frames.guided)
    view.begin()
    qtbot.waitUntil(lambda: view.alignment.state.drift is not None and view.alignment.state.drift.minutes > 4.0)
    assert view.alignment.state.running
    assert view.buttons.done.isHidden()
    assert not view.buttons.second.isVisible()
    assert view.buttons.turn_for_me.isHidden()
    assert "of drift" in view.alignment.state.detail
    view.buttons.use_frames.trigger()
    drive(view)
    assert view.alignment.state.stage == "done", view.message.text()
    error, true = view.alignment.state.error, nights.made[-1].rig.truth().axis_error()
    for knob, really in ((Knob.ALTITUDE, true.altitude_arcsec), (Knob.AZIMUTH, true.azimuth_arcsec)):
        assert abs(error.knob_arcsec(knob) - really) < 4.0 * error.with_systematics.knob_sigma_arcsec(knob) + 60.0


@pytest.mark.parametrize(("base", "words"), [(Base.HEAD, "Pan the head"), (Base.PLATFORM, "Foot on the pole’s side")])
def test_what_has_no_bolts_is_asked_for_as_hands_move_it(qtbot, polar, base, words):
    nights = Nights()
    _, view = polar(nights)
    view.setup.frames.exposure.setValue(1.0)
    view.setup.axis.hand.setCurrentText(AxisTurnedBy.PERSON)
    view.setup.axis.base.setCurrentText(base)
    obeyed = []
    view.window().setUpdatesEnabled(False)  # drawn in the alignment by hand: half of all the work
    view.begin()

    def person():
        asked = view.alignment.state.turn_instruction or view.alignment.state.instruction
        if view.alignment.state.hand_needed and not any(asked is one for one in obeyed):
            obeyed.append(asked)
            view.buttons.turn_for_me.click()

    drive(view, person)
    assert view.alignment.state.stage == "done", view.message.text()
    told = [one.words for one in obeyed if isinstance(one, Instruction)]
    assert any(words in one for one in told)
    assert not any("bolt" in one for one in told)
    assert nights.true_arcsec < HAND_ARCSEC


def test_motors_turn_the_practice_telescopes_bolts_and_nobody_is_asked(qtbot, polar):
    nights = Nights()
    _, view = polar(nights)
    view.setup.frames.exposure.setValue(1.0)
    view.setup.axis.hand.setCurrentText(AxisTurnedBy.PERSON)
    view.setup.axis.motors.setChecked(True)
    assert not view.setup.form.isRowVisible(view.setup.axis.motor_port)  # the practice telescope's own
    asked, words = [], set()
    view.window().setUpdatesEnabled(False)  # drawn in the alignment by hand: half of all the work
    view.begin()

    def person():
        state = view.alignment.state
        words.add(state.words)
        if state.hand_needed and not any(state.turn_instruction is one for one in asked):
            asked.append(state.turn_instruction)
            view.buttons.turn_for_me.click()

    drive(view, person)
    assert view.alignment.state.stage == "done", view.message.text()
    assert None not in asked, "RA has no motor here, the bolts have"
    assert any("motor moves" in told for told in words)
    assert nights.true_arcsec < 60.0  # its tube bends by up to half of that, by when on the way it is seen


def test_escape_stops_motors_at_the_bolts_without_a_mount(qtbot, polar):
    _, view = polar(Nights())
    view.setup.axis.hand.setCurrentText(AxisTurnedBy.PERSON)
    view.setup.axis.motors.setChecked(True)
    view.begin()
    qtbot.waitUntil(lambda: view.alignment.state.running and view.alignment.state.stage != "opening")
    view.show_bolts()
    assert view.bolts.face.keys == MOTORS
    qtbot.keyClick(view.bolts, Qt.Key.Key_Escape)
    drive(view)
    assert view.alignment.state.stage == "ended"
    assert "Cancelled" in view.alignment.state.words
    assert view.bolts.face.keys == KEYS, "none runs any more"


def test_the_port_of_motors_is_asked_for(polar):
    _, view = polar(Nights())
    view.setup.frames.source.setCurrentIndex(view.setup.frames.source.findData(FrameSource.CAMERA))
    view.setup.axis.motors.setChecked(True)
    assert view.setup.form.isRowVisible(view.setup.axis.motor_port)
    with pytest.raises(UsageError, match="port of the motorised adjusters"):
        view.setup.request()
    view.setup.axis.motor_port.setText("tcp://127.0.0.1:9")
    assert view.setup.request().adjusters == "tcp://127.0.0.1:9"
    view.setup.axis.motors.setChecked(False)
    assert view.setup.request().adjusters == ""
