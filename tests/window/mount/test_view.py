"""The Mount view over a simulated telescope: what is shown, asked for, refused, lost and stopped."""

import threading
from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest
import shiboken6
from PySide6.QtCore import QPoint, QPointF, Qt, QTimer
from PySide6.QtGui import QColor, QWheelEvent
from PySide6.QtWidgets import (
    QAbstractButton,
    QApplication,
    QComboBox,
    QDialog,
    QDoubleSpinBox,
    QFileDialog,
    QLineEdit,
    QWidget,
)

from kochab.core.attitude import apart_deg
from kochab.core.mount import Ability, Direction, Epoch, TrackingRate
from kochab.core.progress import Progress
from kochab.gear import actions as why
from kochab.gear.profiles import current_profile
from kochab.window.devices.mount_status import MountStatus, StopKey, mount_status_text
from kochab.window.dialogs import ask_frames
from kochab.window.mount.pointing import Offset, OffsetArrow, SyncDialog
from kochab.window.shell.views import VIEWS
from kochab.window.themes import theme_colours
from kochab.window.widgets import field_value
from tests.gear.mounts.bench import SITE, place, simulated
from tests.window.fakes import fake_solution
from tests.window.mount_bench import connected
from tests.window.test_night import assert_red

NEAR_ORION = (86.0, -1.5)  # of date, near the fake engine's answer and above the bench's horizon


def at_rest(mount):
    return not mount.control.known.busy and not mount.telescope.slewing


def test_before_a_mount_is_connected_everything_says_why(qtbot, opened):
    _, commands = opened
    commands.views.show("mount")
    view = commands.views.docks["mount"].view
    assert view.connection.isVisible()
    assert not view.moving.isVisible()
    assert not view.stop.isVisible()
    goto = view.go.goto
    assert (goto.explanation.reason, goto.toolTip()) == (why.CONNECT, why.CONNECT)
    view.go.goto.explanation.allows()  # as when it is pressed
    assert view.why.isVisible()
    assert view.why.text() == why.CONNECT
    qtbot.keyClick(view.connect_box.connect_button, Qt.Key.Key_Space)
    assert "Choose a port" in view.message.text()


def test_a_port_that_is_not_there_is_one_sentence_with_advice(qtbot, opened, tmp_path):
    _, commands = opened
    commands.views.show("mount")
    view = commands.views.docks["mount"].view
    view.connect_box.set_port(str(tmp_path / "ttyNOT"))
    view.connect_box.connect_button.click()
    qtbot.waitUntil(lambda: "ttyNOT" in view.message.text(), timeout=10_000)
    assert view.control.known.phase == "off"
    assert view.connection.isVisible()


@pytest.mark.parametrize("driver", ["lx200", "onstep", "nexstar", "synscan", "ioptron"])
def test_where_the_mount_says_it_is_and_how(qtbot, unpainted, driver):
    _, commands = unpainted
    with connected(qtbot, commands, driver) as mount:
        icrs = mount.control.known.report.icrs_deg
        of_date = mount.opening.guard.to_mount(*icrs)
        assert apart_deg(of_date, mount.bench.start) < 0.5  # SynScan's are of J2000
        assert mount.view.pointing.ra.text()[2] == "h"
        assert "idle" in mount.view.pointing.state.text() or "racking" in (mount.view.pointing.state.text())
        assert mount.view.pointing.offset.text() == "as the mount reports, not solved yet"
        assert mount.view.stop.isVisible()
        assert mount.view.buttons.take.explanation.reason == why.Need.CAMERA.value
        assert mount.view.buttons.rests["park"].explanation.reason == mount.opening.guard.lacks.get(Ability.PARK, "")
        for i, rate in enumerate(TrackingRate):
            item, reason = mount.view.tracking.model().item(i), mount.opening.guard.lacks.get(rate.ability, "")
            assert (item.isEnabled(), item.toolTip()) == (not reason, reason)


def test_it_parks_unparks_goes_home_and_tracks_the_moon(qtbot, unpainted):
    _, commands = unpainted
    with connected(qtbot, commands, "onstep") as mount:
        view, telescope = mount.view, mount.telescope
        assert view.buttons.rests["unpark"].explanation.reason == why.Need.IS_PARKED.value
        view.buttons.rests["park"].click()
        qtbot.waitUntil(lambda: at_rest(mount) and telescope.parked, timeout=15_000)
        qtbot.waitUntil(lambda: view.go.goto.explanation.reason == why.PARKED, timeout=5_000)
        assert view.message.text() == "Parked."
        assert view.tracking.currentText() == "Tracking off"
        view.buttons.rests["unpark"].click()
        qtbot.waitUntil(lambda: view.buttons.rests["home"].explanation.reason == "" and at_rest(mount), timeout=5_000)
        view.buttons.rests["home"].click()
        qtbot.waitUntil(lambda: view.message.text() == "At home.", timeout=15_000)
        view.tracking.activated.emit(list(TrackingRate).index(TrackingRate.LUNAR))
        qtbot.waitUntil(lambda: view.tracking.currentText() == "Track the Moon", timeout=5_000)
        assert telescope.tracking_deg_s == TrackingRate.LUNAR.deg_s


def test_a_clock_that_contradicts_greys_the_slews_and_is_set_by_one_click(qtbot, unpainted):
    _, commands = unpainted
    with connected(qtbot, commands, "onstep") as mount:
        view, conflict = mount.view, mount.view.conflict
        assert not conflict.isVisible()
        settings, guard = mount.bench.settings, mount.opening.guard
        settings.clock_error = -timedelta(hours=1)
        mount.control.order("look", lambda guard: looking(guard))
        qtbot.waitUntil(lambda: conflict.isVisible() and at_rest(mount), timeout=15_000)
        assert "its clock is 1.0 h slow (summer time or zone?)" in view.doubt.text()
        for greyed in (view.go.goto, view.buttons.sync):
            assert greyed.explanation.reason == why.Need.AGREEMENT.value
        assert view.pad.buttons[Direction.NORTH].explanation.reason == ""
        view.buttons.settles["set clock"].click()
        qtbot.waitUntil(lambda: not conflict.isVisible() and at_rest(mount), timeout=15_000)
        assert abs(settings.clock_error.total_seconds()) < 3.0
        assert "The mount has this computer’s clock." in mount.said
        assert view.go.goto.explanation.reason == ""
        settings.clock_error = timedelta(hours=1)
        mount.control.order("look", lambda guard: looking(guard))
        qtbot.waitUntil(lambda: conflict.isVisible() and at_rest(mount), timeout=15_000)
        view.trust.click()
        qtbot.waitUntil(lambda: not conflict.isVisible() and at_rest(mount), timeout=15_000)
        assert view.go.goto.explanation.reason == ""
        assert guard.clock_doubt() == ""


def looking(guard):
    guard.clock_doubt()
    yield Progress("looking")


def test_a_mount_taken_for_another_epoch_than_it_speaks_in_is_told(qtbot, unpainted, monkeypatch):
    monkeypatch.setattr("kochab.gear.mounts.drivers.nexstar.NexStar.default_epoch", Epoch.J2000)
    _, commands = unpainted
    commands.views.show("mount")
    said = []
    control = commands.views.docks["mount"].view.control
    control.message.connect(lambda sentence, role: said.append((sentence, role)))
    with connected(qtbot, commands, "nexstar"):
        qtbot.waitUntil(lambda: said[-1:] and said[-1][1] == "wrong", timeout=15_000)
        assert "Choose the epoch date (--epoch date)" in said[-1][0]


def test_what_a_mount_cannot_do_is_greyed_and_told_on_focus(qtbot, unpainted):
    _, commands = unpainted
    with connected(qtbot, commands, "lx200") as mount:
        tracking = mount.view.tracking
        reason = mount.opening.guard.lacks[Ability.SIDEREAL]
        assert tracking.toolTip() == tracking.explanation.reason == reason
        assert reason in tracking.accessibleDescription()
        assert tracking.palette().buttonText().color() == QColor(theme_colours().faint)
        assert mount.view.stop.palette().buttonText().color() != QColor(theme_colours().faint)
        tracking.setFocus()
        assert mount.view.why.isVisible()
        assert mount.view.why.text() == reason
        tracking.activated.emit(1)
        mount.view.stop.setFocus()
        assert not mount.view.why.isVisible()
        assert not [e for e in mount.telescope.log if e[0] == "track"]


def test_the_wheel_orders_and_sets_nothing_with_focus_or_without(qtbot, unpainted, settings):
    """A page that is scrolled takes fields under the pointer: the tracking, the flip, the limits, the camera."""
    _, commands = unpainted
    with connected(qtbot, commands, "onstep") as mount:
        view = mount.view
        limits = current_profile(settings).limits
        fields = [*view.findChildren(QComboBox), *view.findChildren(QDoubleSpinBox)]
        assert {view.tracking, view.meridian, view.limits.lowest, view.camera.box.source} <= set(fields)
        keys = Qt.MouseButton.NoButton, Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase
        for field in fields * 2:  # a second time with the focus
            before, middle = field_value(field), QPointF(field.rect().center())
            for step in (-120, 120, 120):
                event = QWheelEvent(middle, field.mapToGlobal(middle), QPoint(), QPoint(0, step), *keys, False)
                QApplication.sendEvent(field, event)
                assert field_value(field) == before, field.accessibleName()
            assert field.focusPolicy() == Qt.FocusPolicy.StrongFocus, "or the wheel takes Space from STOP"
            field.setFocus()
        view.stop.setFocus()  # a limit is kept when the focus leaves it
        assert current_profile(settings).limits == limits
        assert not mount.control.known.busy
        assert not [entry for entry in mount.telescope.log if entry[0] == "track"]


def test_there_is_one_stop_in_every_mode_at_one_place(qtbot, unpainted):
    window, commands = unpainted
    with connected(qtbot, commands):
        places = set()
        for name in ("image", *VIEWS):
            commands.views.show(name)
            qtbot.waitUntil(lambda n=name: n == "image" or commands.views.docks[n].view is not None)
            QApplication.processEvents()
            stops = [b for b in window.findChildren(QAbstractButton) if "STOP" in b.text() and b.isVisible()]
            assert len(stops) == 1, name
            places.add(stops[0].mapTo(window, stops[0].rect().topRight()).toTuple())
        assert len(places) == 1


def test_goto_a_place_and_a_name_that_is_none(qtbot, unpainted):
    _, commands = unpainted
    with connected(qtbot, commands) as mount:
        mount.view.go.target.setText("no such star")
        mount.view.go.goto.click()
        qtbot.waitUntil(lambda: any("no such star" in s for s in mount.said), timeout=20_000)
        assert not mount.telescope.log
        target = place(-30.0, 35.0, mount.bench.clock)
        mount.view.go.target.setText(f"{target[0]:.4f} {target[1]:.4f}")
        qtbot.keyClick(mount.view.go.target, Qt.Key.Key_Return)
        qtbot.waitUntil(lambda: any("reports that it reached" in s for s in mount.said), timeout=30_000)
        assert [e[0] for e in mount.telescope.log] == ["goto"]


def test_the_guard_refuses_in_one_sentence(qtbot, unpainted):
    _, commands = unpainted
    with connected(qtbot, commands) as mount:
        mount.view.go.target.setText("83.8 -88")  # below the bench's horizon
        mount.view.go.goto.click()
        qtbot.waitUntil(lambda: any("deg" in s for s in mount.said), timeout=20_000)
        assert not mount.telescope.log
        assert mount.view.go.goto.explanation.reason == ""


@pytest.mark.parametrize("where", ["field", "frame", "button", "live", "polar"])
def test_escape_stops_a_slew_from_anywhere(qtbot, unpainted, where):
    window, commands = unpainted
    with connected(qtbot, commands, slew_deg_s=1.0) as mount:
        far = place(-60.0, 40.0, mount.bench.clock)
        mount.view.go.target.setText(f"{far[0]:.4f} {far[1]:.4f}")
        mount.view.go.goto.click()
        qtbot.waitUntil(lambda: mount.telescope.slewing, timeout=20_000)
        if where in ("live", "polar"):
            commands.views.show(where)
            focus = commands.views.docks[where].view.focusProxy()
            qtbot.waitUntil(lambda: mount.view.visibleRegion().isEmpty(), timeout=5_000)
        else:
            focus = {
                "field": mount.view.go.target,
                "frame": window.workspace.view,
                "button": window.findChild(MountStatus).stop,
            }[where]
        if where == "button":
            focus.click()
        else:
            focus.setFocus()
            qtbot.keyClick(focus, Qt.Key.Key_Escape)
        qtbot.waitUntil(lambda: at_rest(mount), timeout=10_000)
        assert "stop" in [e[0] for e in mount.telescope.log]
        assert mount.telescope.log[0][0] == "goto"
        assert len([e for e in mount.telescope.log if e[0] == "goto"]) == 1
        assert any("topped" in s for s in mount.said)


def test_escape_stops_a_slew_from_a_file_dialog_too(qtbot, unpainted):
    """The system's own dialog would keep the key to itself: Qt's is shown while a mount is connected."""
    window, commands = unpainted
    native = Qt.ApplicationAttribute.AA_DontUseNativeDialogs
    assert not QApplication.testAttribute(native)
    with connected(qtbot, commands, slew_deg_s=1.0) as mount:
        assert QApplication.testAttribute(native)
        StopKey(lambda: None, window).listen(False)  # the polar view's own, without motors
        assert QApplication.testAttribute(native)
        far = place(-60.0, 40.0, mount.bench.clock)
        mount.view.go.target.setText(f"{far[0]:.4f} {far[1]:.4f}")
        mount.view.go.goto.click()
        qtbot.waitUntil(lambda: mount.telescope.slewing, timeout=20_000)
        dialogs = []

        def press():
            if (dialog := QApplication.activeModalWidget()) is None:  # not shown yet
                QTimer.singleShot(50, press)
                return
            dialogs.append(dialog)
            qtbot.keyClick(dialog, Qt.Key.Key_Escape)

        QTimer.singleShot(200, press)
        assert ask_frames(window, "", "Open", "*") == []
        assert isinstance(dialogs[0], QFileDialog)
        qtbot.waitUntil(lambda: at_rest(mount), timeout=10_000)
        assert "stop" in [e[0] for e in mount.telescope.log]
    qtbot.waitUntil(lambda: not QApplication.testAttribute(native), timeout=60_000)


def test_a_key_that_goes_with_its_window_leaves_the_systems_dialogs(qtbot):
    native, window = Qt.ApplicationAttribute.AA_DontUseNativeDialogs, QWidget()
    before = QApplication.testAttribute(native)
    StopKey(lambda: None, window).listen(True)
    assert QApplication.testAttribute(native)
    shiboken6.delete(window)
    assert QApplication.testAttribute(native) is before


def test_stop_goes_out_while_an_answer_is_still_waited_for(qtbot, unpainted):
    _, commands = unpainted
    with connected(qtbot, commands, slew_deg_s=1.0) as mount:
        faults, heard = mount.bench.faults, mount.bench.line.transcript
        far = place(-60.0, 40.0, mount.bench.clock)
        mount.view.go.target.setText(f"{far[0]:.4f} {far[1]:.4f}")
        mount.view.go.goto.click()
        qtbot.waitUntil(lambda: mount.telescope.slewing, timeout=20_000)
        faults.late_s = 4.0
        faults.next("late", 1)
        qtbot.waitUntil(lambda: faults.happened["late"] == 1, timeout=10_000)
        heard.clear()  # from here on the line's thread hangs on that answer
        mount.view.stop.click()
        qtbot.waitUntil(lambda: any(way == ">" for way, _ in heard), timeout=15_000)
        said = list(heard)
        answered = next(i for i, (way, _) in enumerate(said) if way == ">")
        assert any(b":Q" in data for way, data in said[:answered]), "Stop came before the answer"
        qtbot.waitUntil(lambda: at_rest(mount), timeout=30_000)


def test_a_pulled_cable_is_told_and_the_window_goes_on(qtbot, unpainted):
    _, commands = unpainted
    with connected(qtbot, commands) as mount:
        mount.bench.line.unplug()
        qtbot.waitUntil(lambda: mount.control.known.phase == "lost", timeout=15_000)
        assert "CONNECTION LOST" in mount.view.pointing.state.text()
        assert mount.view.go.goto.explanation.reason == why.LOST
        assert mount.view.stop.isVisible()
        mount.view.stop.click()
        qtbot.waitUntil(lambda: any("cut its power" in s for s in mount.said), timeout=15_000)
        mount.bench.line.plug()
        qtbot.waitUntil(lambda: mount.control.known.phase == "on", timeout=20_000)
        qtbot.waitUntil(lambda: mount.view.go.goto.explanation.reason == "", timeout=15_000)


def test_a_stop_that_does_not_help_is_said_in_capitals_until_the_mount_stands(qtbot, unpainted):
    _, commands = unpainted
    with connected(qtbot, commands, "nexstar", slew_deg_s=0.5) as mount:
        far = place(-60.0, 40.0, mount.bench.clock)
        mount.view.go.target.setText(f"{far[0]:.4f} {far[1]:.4f}")
        mount.view.go.goto.click()
        qtbot.waitUntil(lambda: mount.telescope.slewing, timeout=20_000)
        # the LX200's responder keeps the method it was made with; this one looks it up
        heeds, mount.telescope.stop = mount.telescope.stop, lambda **_: None
        mount.view.stop.click()
        capitals = "THE MOUNT MAY STILL MOVE: CUT ITS POWER"
        qtbot.waitUntil(lambda: any(capitals in s for s in mount.said), timeout=30_000)
        assert mount.telescope.slewing
        assert mount_status_text(mount.control.known) == capitals
        qtbot.waitUntil(lambda: capitals in mount.view.pointing.state.text(), timeout=5_000)
        mount.telescope.stop = heeds
        mount.view.stop.click()
        qtbot.waitUntil(lambda: any("Mount stopped" in s for s in mount.said), timeout=30_000)
        assert not mount.telescope.slewing
        assert capitals not in mount_status_text(mount.control.known)


def test_a_cable_pulled_in_a_slew_ends_it_and_stops_it_when_it_is_back(qtbot, unpainted):
    _, commands = unpainted
    with connected(qtbot, commands, slew_deg_s=1.0) as mount:
        far = place(-60.0, 40.0, mount.bench.clock)
        mount.view.go.target.setText(f"{far[0]:.4f} {far[1]:.4f}")
        mount.view.go.goto.click()
        qtbot.waitUntil(lambda: mount.telescope.slewing, timeout=20_000)
        mount.bench.line.unplug()
        qtbot.waitUntil(lambda: mount.control.known.phase == "lost", timeout=15_000)
        assert mount.telescope.slewing
        assert not mount.control.known.busy
        mount.bench.line.plug()
        qtbot.waitUntil(lambda: mount.control.known.phase == "on", timeout=20_000)
        qtbot.waitUntil(lambda: not mount.telescope.slewing, timeout=10_000)
        assert len([e for e in mount.telescope.log if e[0] == "goto"]) == 1, "nothing is repeated"


def test_closing_the_window_stops_the_mount(qtbot, unpainted):
    window, commands = unpainted
    with connected(qtbot, commands, slew_deg_s=1.0) as mount:
        far = place(-60.0, 40.0, mount.bench.clock)
        mount.view.go.target.setText(f"{far[0]:.4f} {far[1]:.4f}")
        mount.view.go.goto.click()
        qtbot.waitUntil(lambda: mount.telescope.slewing, timeout=20_000)
        window.close()
        qtbot.waitUntil(lambda: not window.isVisible(), timeout=30_000)
        assert not mount.telescope.slewing
        assert mount.opening.closed


def test_disconnect_stops_and_gives_the_port_back(qtbot, unpainted):
    _, commands = unpainted
    with connected(qtbot, commands, slew_deg_s=1.0) as mount:
        mount.view.orders.nudge(Direction.NORTH, 18000.0)
        qtbot.waitUntil(lambda: bool(mount.telescope.log), timeout=15_000)
        mount.view.leave.click()
        qtbot.waitUntil(lambda: mount.control.known.phase == "off", timeout=15_000)
        assert mount.opening.closed
        assert mount.view.connection.isVisible()
        assert not mount.telescope.slewing
        qtbot.waitUntil(lambda: not [t for t in threading.enumerate() if t.name == "kochab-mount"])


def test_arrow_keys_nudge_while_the_pad_has_the_focus(qtbot, unpainted):
    _, commands = unpainted
    with connected(qtbot, commands, "onstep") as mount:
        pad = mount.view.pad
        pad.step.setCurrentText("30″")
        before = mount.control.known.report.icrs_deg
        pad.buttons[Direction.EAST].setFocus()
        qtbot.keyClick(pad.buttons[Direction.EAST], Qt.Key.Key_Up)
        assert pad.buttons[Direction.NORTH].hasFocus()
        qtbot.waitUntil(lambda: any("Nudged north" in s for s in mount.said), timeout=30_000)
        moved = mount.control.known.report.icrs_deg[1] - before[1]
        assert 10.0 < moved * 3600.0 < 60.0


def test_a_nudge_at_a_chosen_rate_is_one_bounded_move(qtbot, unpainted):
    _, commands = unpainted
    with connected(qtbot, commands, "ioptron") as mount:
        pad = mount.view.pad
        assert pad.rate.count() > 3, "the mount's own rates"
        pad.rate.setCurrentText("64 × sidereal")
        pad.step.setCurrentText("20′")
        before = mount.control.known.report.icrs_deg
        pad.buttons[Direction.SOUTH].click()
        qtbot.waitUntil(lambda: mount.control.known.busy == "nudge dec", timeout=5_000)
        assert "nudging" in pad.buttons[Direction.NORTH].explanation.reason
        qtbot.waitUntil(lambda: any("one move of" in s for s in mount.said), timeout=30_000)
        moved = (mount.control.known.report.icrs_deg[1] - before[1]) * 60.0
        assert -30.0 < moved < -10.0


def test_who_connects_is_told_what_to_do_first_and_the_name_has_the_line_to_itself(qtbot, unpainted):
    """At 1366 px "Practice: Meade LX200 classic" stood in four lines beside its button."""
    window, commands = unpainted
    window.resize(1366, 768)
    with connected(qtbot, commands) as mount:
        assert "Take a frame to see where it really points" in mount.view.message.text()
        view = mount.view
        view.name.setText("Practice: Meade LX200 classic")
        qtbot.waitUntil(lambda: view.leave.isVisible() and view.name.width() > 200)
        assert view.name.heightForWidth(view.name.width()) <= 2 * view.name.fontMetrics().lineSpacing() + 2
        box = view.tracking
        room = box.width() - 3 * box.fontMetrics().averageCharWidth()  # without its arrow
        assert box.fontMetrics().horizontalAdvance(box.placeholderText()) < room


def test_practice_is_not_begun_over_a_connected_mount(qtbot, unpainted):
    _, commands = unpainted
    with connected(qtbot, commands) as mount:
        object.__setattr__(commands.services.wiring, "practice", lambda **_: 1 / 0)
        commands.views.practise()
        qtbot.waitUntil(lambda: any("Disconnect it" in s for s in mount.said), timeout=5_000)
        assert mount.control.known.phase == "on"
        mount.view.leave.click()
        qtbot.waitUntil(lambda: any("Good night." in s for s in mount.said), timeout=15_000)


def test_sync_on_the_open_frame_is_previewed_done_and_undone(qtbot, unpainted):
    window, commands = unpainted
    with connected(qtbot, commands, at=NEAR_ORION) as mount:
        sky = fake_solution(600, 400).ra_dec_deg
        before = mount.control.known.report.icrs_deg
        mount.view.buttons.sync.click()
        qtbot.waitUntil(lambda: bool(window.findChildren(SyncDialog)), timeout=15_000)
        (dialog,) = window.findChildren(SyncDialog)
        assert not [e for e in mount.telescope.log if e[0] == "sync"], "only a preview so far"
        texts = " ".join(w.text() for w in dialog.findChildren(QWidget) if hasattr(w, "text"))
        assert "the open frame alone" in texts
        assert "only if the telescope has not moved" in texts
        assert "slews by the offset" not in texts, "one frame alone is no ground for a slew"
        dialog.yes.click()
        qtbot.waitUntil(lambda: any(s.startswith("Synced") for s in mount.said), timeout=15_000)
        qtbot.waitUntil(lambda: mount.view.buttons.undo.explanation.reason == "", timeout=10_000)
        assert apart_deg(mount.control.known.report.icrs_deg, sky) * 3600.0 < 120.0
        mount.view.buttons.undo.click()
        qtbot.waitUntil(lambda: any("Sync undone" in s for s in mount.said[1:]), timeout=15_000)
        qtbot.waitUntil(lambda: apart_deg(mount.control.known.report.icrs_deg, before) * 3600.0 < 120.0, timeout=10_000)


def test_a_sync_that_is_refused_offers_no_yes(qtbot, unpainted):
    window, commands = unpainted
    with connected(qtbot, commands) as mount:  # tens of degrees from the open frame's sky
        mount.view.buttons.sync.click()
        qtbot.waitUntil(lambda: bool(window.findChildren(SyncDialog)), timeout=15_000)
        (dialog,) = window.findChildren(SyncDialog)
        assert not dialog.yes.isVisible()
        qtbot.keyClick(dialog, Qt.Key.Key_Escape)
        assert not [e for e in mount.telescope.log if e[0] == "sync"]


def test_two_clicks_in_the_frame_bring_a_star(qtbot, unpainted):
    window, commands = unpainted
    with connected(qtbot, commands, at=NEAR_ORION) as mount:
        before = mount.control.known.report.icrs_deg
        star = mount.control.solution.stars[3]
        mount.view.buttons.move_star.click()
        frame = window.workspace.view
        for _ in range(2):  # on the star, and on it again: to the middle
            frame.clicked.emit(star.x + 1.0, star.y, 14.0)
        qtbot.waitUntil(lambda: any("Star moved" in s for s in mount.said), timeout=60_000)
        after = mount.control.known.report.icrs_deg
        centre = mount.control.solution.ra_dec_deg
        assert after[0] - before[0] == pytest.approx(star.ra_deg - centre[0], abs=0.03)
        assert after[1] - before[1] == pytest.approx(star.dec_deg - centre[1], abs=0.03)
        frame.clicked.emit(star.x, star.y, 14.0)
        assert len([e for e in mount.telescope.log if e[0] == "goto"]) == 1


def test_looking_for_a_mount_finds_it_and_can_be_cancelled(qtbot, opened):
    _, commands = opened
    commands.views.show("mount")
    view = commands.views.docks["mount"].view
    with simulated("nexstar") as bench:
        view.connect_box.set_port(bench.port)
        view.connect_box.find_button.click()
        qtbot.waitUntil(lambda: view.connect_box.driver.currentData() == "nexstar")
        assert "NexStar" in view.message.text()
        assert view.connect_box.chosen_port == bench.port
        qtbot.waitUntil(view.cancel_find.isHidden)
        bench.faults.chance("silence", 1.0)
        view.connect_box.find_button.click()
        assert view.cancel_find.isVisible()
        view.cancel_find.click()
        qtbot.waitUntil(lambda: "Search cancelled" in view.message.text(), timeout=15_000)
        assert not view.cancel_find.isVisible()


def test_a_search_pressed_again_does_not_stand_in_its_own_way(qtbot, opened):
    """It holds the port until its next step: another would be told to close the other program."""
    _, commands = opened
    commands.views.show("mount")
    view = commands.views.docks["mount"].view
    box, told = view.connect_box, []
    box.progressed.connect(told.append)
    with simulated("nexstar") as bench:
        bench.faults.late_s = 0.3
        bench.faults.chance("late", 1.0)
        box.set_port(bench.port)
        box.search()
        qtbot.waitUntil(lambda: bool(bench.line.transcript), timeout=10_000)
        assert not box.connect_button.isEnabled()
        box.find_button.click()
        box.search()
        qtbot.waitUntil(lambda: None in told, timeout=30_000)
        assert "NexStar" in view.message.text()
        assert box.connect_button.hasFocus()
        assert box.find_button.isEnabled()


def test_port_driver_and_site_come_back_after_a_restart(qtbot, make_window, engine, settings):
    _, commands = make_window(engine)
    commands.views.show("mount")
    box = commands.views.docks["mount"].view.connect_box
    box.set_port("socket://127.0.0.1:9")
    box.driver.setCurrentIndex(box.driver.findData("ioptron"))
    box.baud.setCurrentText("115200")
    box.epoch.setCurrentText("J2000")
    box.site.setText("50, 8")
    box.site.editingFinished.emit()
    box.connect_button.click()
    commands.window.close()
    _, again = make_window(engine)
    again.views.show("mount")
    box = again.views.docks["mount"].view.connect_box
    assert box.chosen_port == "socket://127.0.0.1:9"
    assert box.driver.currentData() == "ioptron"
    assert (box.baud.currentText(), box.epoch.currentText()) == ("115200", "J2000")
    assert box.site.text().startswith("50, 8")
    assert settings.site == SITE


@pytest.mark.parametrize("on", [True, False])
def test_solve_after_slew_comes_back_as_it_was_left(make_window, engine, settings, on):
    settings.keep("mount/after", on)
    _, commands = make_window(engine)
    commands.views.show("mount")
    view = commands.views.docks["mount"].view
    assert (view.after.isChecked(), view.orders.auto_frame) == (on, on)
    view.after.click()
    assert (view.orders.auto_frame, settings.flag("mount/after", on)) == (not on, not on)


def test_the_view_and_its_dialog_are_red_at_night(qtbot, opened):
    window, commands = opened
    commands.actions["night"].trigger()
    qtbot.waitUntil(lambda: commands.appearance.settled)
    with connected(qtbot, commands, at=NEAR_ORION) as mount:
        assert_red(window)
        mount.view.buttons.sync.click()
        qtbot.waitUntil(lambda: bool(window.findChildren(SyncDialog)), timeout=15_000)
        (dialog,) = window.findChildren(SyncDialog)
        assert_red(dialog)
        dialog.reject()
        mount.bench.line.unplug()
        qtbot.waitUntil(lambda: mount.control.known.phase == "lost", timeout=15_000)
        assert_red(mount.view)
        mount.bench.line.plug()
    qtbot.waitUntil(lambda: mount.control.known.phase == "off", timeout=15_000)
    assert_red(mount.view)
    commands.appearance.use_theme("dark", "normal")


KINDS = (QAbstractButton, QComboBox, QLineEdit, QDoubleSpinBox)


@pytest.mark.parametrize("phase", ["off", "on"])
def test_the_keyboard_reaches_every_control_and_each_has_a_name(qtbot, unpainted, phase):
    window, commands = unpainted
    with connected(qtbot, commands) as mount:
        if phase == "off":
            mount.control.disconnect_mount()
            qtbot.waitUntil(lambda: mount.control.known.phase == "off", timeout=15_000)
        view = mount.view
        controls = [
            w
            for w in view.findChildren(QWidget)
            if isinstance(w, KINDS)
            and w.isVisible()
            and w.isEnabled()
            and not isinstance(w.parent(), QComboBox | QDoubleSpinBox)
        ]
        silent = [w for w in controls if not (w.accessibleName() or getattr(w, "text", str)())]
        assert not silent
        window.activateWindow()
        view.setFocus()
        stops = set()
        for _ in range(120):
            qtbot.keyClick(window.focusWidget() or window, Qt.Key.Key_Tab)
            stops.add(window.focusWidget())
        stops |= {w.parent() for w in stops if isinstance(w, QLineEdit)}
        missed = [w for w in controls if w not in stops]
        assert not missed, [w.accessibleName() or w.text() for w in missed]
        assert not [d for d in window.findChildren(QDialog) if d.isVisible()]


def test_the_arrow_is_drawn_where_the_sky_is(qtbot):
    arrow = OffsetArrow()
    qtbot.addWidget(arrow)
    arrow.resize(arrow.sizeHint())
    blank = picture(arrow)
    arrow.show_offset(Offset(3.0, 3.0, 0.0))  # east is left
    changed = np.argwhere((picture(arrow) != blank).any(axis=2))
    middle = arrow.width() / 2
    assert (changed[:, 1] < middle - 20).sum() > (changed[:, 1] > middle + 20).sum()
    assert "east" in arrow.accessibleName()


def picture(widget):
    image = widget.grab().toImage().convertToFormat(widget.grab().toImage().Format.Format_RGB32)
    bits = np.frombuffer(image.constBits(), np.uint8).copy()
    return bits.reshape(image.height(), image.bytesPerLine() // 4, 4)[:, : image.width(), :3]


def test_a_pointing_model_is_made_of_what_diagnose_has_seen_and_ends_with_a_sync(qtbot, unpainted):
    from tests.pointing.faulty_mounts import sightings
    from tests.pointing.test_pointing_model import bad_mount

    _, commands = unpainted
    with connected(qtbot, commands, "onstep") as mount:
        mount.view.buttons.model.click()
        qtbot.waitUntil(lambda: "needs 4 sightings" in mount.view.message.text(), timeout=10_000)
        faulty, rng = bad_mount(2)
        seen = sightings(faulty, 6, rng, sides=True)
        late = mount.opening.guard.clock() - max(one.time_utc for one in seen)
        mount.control.sightings = tuple(replace(one, time_utc=one.time_utc + late) for one in seen)
        mount.view.buttons.model.click()
        qtbot.waitUntil(lambda: "aimed by a pointing model" in mount.view.message.text(), timeout=10_000)
        assert mount.opening.guard.supervisor.aim is not None


def test_a_spiral_search_is_one_press_and_stop_ends_it(qtbot, unpainted):
    _, commands = unpainted
    with connected(qtbot, commands, "onstep") as mount:
        mount.telescope.log.clear()
        mount.view.buttons.spiral.click()
        qtbot.waitUntil(lambda: any(entry[0] == "goto" for entry in mount.telescope.log), timeout=10_000)
        mount.view.stop.click()
        qtbot.waitUntil(lambda: at_rest(mount), timeout=10_000)
        count = len([entry for entry in mount.telescope.log if entry[0] == "goto"])
        assert count < 24
