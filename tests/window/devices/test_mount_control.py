"""One owner of the mount's line: what one view connects, moves and stops, the others know."""

import threading
from dataclasses import replace
from time import sleep

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QMenu

from kochab.core.errors import LineLostError, RefusedError
from kochab.core.frame import Site
from kochab.core.mount import Direction, Epoch, MountState
from kochab.core.progress import Progress
from kochab.gear import actions as why
from kochab.gear.actions import POLAR
from kochab.gear.mount_events import (
    Connected,
    LineLost,
    MountSnapshot,
    OrderDone,
    OrderFailed,
    OrderProgress,
    PositionReport,
)
from kochab.polar.error import Knob
from kochab.window.devices.mount_status import ALARM, MountStatus, mount_status_text
from kochab.window.devices.mount_task import MountTask
from kochab.window.mount.pointing import state_text
from kochab.window.polar.alignment_run import OTHER_SKY, mount_is_still
from kochab.workflows.session.alignment import AxisTurnedBy, FrameSource
from tests.gear.mounts.bench import SITE, place, simulated
from tests.window.mount_bench import BenchOpening, connected
from tests.window.polar.conftest import polar
from tests.window.polar.test_view import Nights, drive
from tests.window.polar_cases import adjusting

__all__ = ["polar"]  # a fixture
PACE_S = 0.02  # an order asks a mount no faster; one that does not wait takes the processor from the window beside it


def corner(commands):
    return commands.window.findChild(MountStatus)


def turning(view):
    """Set up so that the practice mount turns the axis itself."""
    view.setup.frames.source.setCurrentText(FrameSource.PRACTICE)
    view.setup.axis.hand.setCurrentText(AxisTurnedBy.MOUNT)
    view.setup.frames.exposure.setValue(0.5)


def test_polar_alignment_connects_the_mount_for_every_view(qtbot, polar):
    nights = Nights(rate=1.0)
    commands, view = polar(nights)
    commands.views.show("mount")
    mount = commands.views.docks["mount"].view
    assert corner(commands).text.text() == "No mount"
    assert corner(commands).stop.isHidden()
    turning(view)
    view.begin()
    qtbot.waitUntil(lambda: mount.control.known.doing is not None, timeout=60_000)
    qtbot.waitUntil(lambda: mount.control.known.doing.stage == "turn", timeout=60_000)
    assert mount.control.known.phase == "on"
    assert mount.name.text().startswith("Practice: ")
    assert mount.pad.buttons[Direction.NORTH].explanation.reason == mount.go.goto.explanation.reason
    assert "polar alignment (F4), which turns the RA axis" in mount.go.goto.explanation.reason
    assert corner(commands).text.text() == "Practice mount: polar alignment"
    assert not mount.stop.isHidden()
    assert mount.stop.isEnabled()
    with pytest.raises(RefusedError, match="polar alignment"):
        mount.control.order("goto", lambda guard: iter(()))
    telescope = nights.made[-1].rig.mount
    qtbot.waitUntil(lambda: telescope.slewing, timeout=20_000)
    mount.stop.click()  # in the other view
    drive(view)
    qtbot.waitUntil(lambda: not telescope.slewing, timeout=5_000)
    assert "Cancelled" in view.message.text()
    qtbot.waitUntil(lambda: mount.control.known.phase == "off", timeout=15_000)
    assert corner(commands).text.text() == "No mount"


def test_polar_alignment_uses_the_mount_that_is_connected(qtbot, polar):
    nights = Nights(rate=1.0)
    commands, view = polar(nights)
    commands.views.practise()
    mount = commands.views.docks["mount"].view
    qtbot.waitUntil(lambda: mount.control.known.report is not None, timeout=30_000)
    commands.views.show("polar")
    assert view.setup.axis.mount.text().startswith("Connected: ")
    turning(view)
    view.begin()
    qtbot.waitUntil(lambda: view.alignment.adjuster is not None, timeout=30_000)
    assert len(nights.made) == 1, "the same telescope under the same sky"
    commands.window.activateWindow()
    qtbot.waitUntil(commands.window.isActiveWindow)
    qtbot.keyClick(view.room.frame, Qt.Key.Key_Escape)
    drive(view)
    assert mount.control.known.phase == "on", "who opened it closes it"
    assert mount.go.goto.explanation.reason == ""
    view.setup.frames.source.setCurrentText(FrameSource.CAMERA)
    view.begin()
    assert view.message.text() == OTHER_SKY


def test_an_alignment_by_hand_is_on_the_practice_telescope_that_is_there(qtbot, polar):
    nights = Nights()
    commands, view = polar(nights)
    commands.views.practise()
    mount = commands.views.docks["mount"].view
    qtbot.waitUntil(lambda: mount.control.known.report is not None, timeout=30_000)
    turning(view)
    view.setup.axis.hand.setCurrentText(AxisTurnedBy.PERSON)
    view.begin()
    qtbot.waitUntil(lambda: view.alignment.adjuster is not None, timeout=30_000)
    assert len(nights.made) == 1
    assert mount.go.goto.explanation.reason == mount.go.centre.explanation.reason == why.BY_HAND
    assert mount.pad.buttons[Direction.NORTH].explanation.reason == why.BY_HAND
    assert mount.pad.buttons[Direction.EAST].explanation.reason == "", "that is a way to turn the RA axis"
    assert not mount.stop.isHidden()
    assert mount.stop.isEnabled()
    with pytest.raises(RefusedError, match="by hand"):
        mount.control.order("goto", lambda guard: iter(()))
    mount.orders.nudge(Direction.NORTH, 60.0)
    assert mount.message.text() == why.BY_HAND
    view.buttons.cancel.trigger()
    drive(view)
    assert mount.go.goto.explanation.reason == ""
    assert mount.control.known.phase == "on"
    assert nights.made[0].rig.frame(0.1) is not None


def test_one_order_at_a_time_whoever_gives_it(qtbot, unpainted):
    _, commands = unpainted
    with connected(qtbot, commands, slew_deg_s=1.0) as mount:
        commands.views.show("polar")
        view = commands.views.docks["polar"].view
        view.setup.frames.source.setCurrentText(FrameSource.CAMERA)
        view.setup.axis.hand.setCurrentText(AxisTurnedBy.MOUNT)
        far = place(-60.0, 40.0, mount.bench.clock)
        mount.view.orders.goto(f"{far[0]:.4f} {far[1]:.4f}")
        view.begin()
        assert view.message.text() == why.BUSY.format("slewing to the target")
        assert not view.buttons.start.isHidden()
        view.setup.axis.hand.setCurrentText(AxisTurnedBy.PERSON)
        view.begin()
        assert view.message.text() == why.BUSY.format("slewing to the target")
        assert not mount.control.by_hand
        mount.control.stop()
        qtbot.waitUntil(lambda: not mount.control.known.busy, timeout=10_000)


def test_an_task_ends_with_the_line(qtbot, unpainted):
    _, commands = unpainted
    with connected(qtbot, commands) as mount:
        heard = []

        def waits(guard):
            while True:
                sleep(PACE_S)
                yield Progress("waiting")

        task = mount.control.order("long", waits)
        task.cancelled.connect(lambda: heard.append("cancelled"))
        task.finished.connect(lambda: heard.append("finished"))
        mount.control.disconnect_mount()
        qtbot.waitUntil(lambda: heard == ["cancelled", "finished"], timeout=15_000)
        with pytest.raises(RefusedError, match="Connect a mount first"):
            mount.control.order("goto", waits)


def test_a_stop_that_fails_while_disconnecting_is_told_and_stays(qtbot, unpainted):
    _, commands = unpainted
    with connected(qtbot, commands) as mount:

        def fails():
            sleep(0.5)  # as long as a line takes to find out
            raise LineLostError("The cable is out.")

        mount.opening.guard.mount.stop = fails
        mount.control.disconnect_mount()
        qtbot.waitUntil(lambda: mount.control.known.phase == "off", timeout=15_000)
        assert "cut its power" in mount.view.message.text()
        assert not any("mount stopped" in sentence for sentence in mount.said)
        assert corner(commands).text.text() == ALARM


def test_stop_still_goes_out_while_a_mount_is_being_disconnected(qtbot, unpainted):
    _, commands = unpainted
    with connected(qtbot, commands) as mount:
        begun, answers = threading.Event(), threading.Event()

        def waits(guard):
            begun.set()
            answers.wait(30.0)
            yield Progress("waiting")

        mount.control.order("long", waits)
        qtbot.waitUntil(begun.is_set)
        mount.control.disconnect_mount()
        qtbot.waitUntil(lambda: "stop" in [entry[0] for entry in mount.telescope.log], timeout=10_000)
        mount.telescope.log.clear()
        assert corner(commands).stop.isVisible()
        corner(commands).stop.click()
        qtbot.waitUntil(lambda: "stop" in [entry[0] for entry in mount.telescope.log], timeout=10_000)
        answers.set()
        qtbot.waitUntil(lambda: mount.control.known.phase == "off", timeout=15_000)
        assert mount.said[-1] == "Disconnected, mount stopped. Good night."


def test_a_connection_that_is_cancelled_tells_of_no_stop(qtbot, unpainted):
    _, commands = unpainted
    commands.views.show("mount")
    view = commands.views.docks["mount"].view
    with simulated("lx200") as bench:
        view.control.begin(BenchOpening(bench, "lx200"), bench.port)
        view.control.disconnect_mount()
        qtbot.waitUntil(lambda: view.control.known.phase == "off", timeout=15_000)
    assert view.message.text() == "Disconnected."


@pytest.mark.parametrize("where", ["profile", "hints"])
def test_a_new_site_waits_for_the_next_connection_and_that_is_said(qtbot, unpainted, where):
    """Motor boards and NexStar reckon by the site that their driver was opened with: the guard must not by another."""
    _, commands = unpainted
    with connected(qtbot, commands) as mount:
        hints = commands.window.workspace.hints
        for site in (SITE, Site(48.0, 11.0)):
            if where == "profile":
                commands.equipment.keep(site=site)
            else:
                hints.show_site(site)
                hints.site.editingFinished.emit()
            assert commands.settings.site == site
            assert ("again to use the new site" in mount.view.message.text()) == (site != SITE)
        assert mount.opening.guard.site == SITE


def test_a_mount_without_a_site_says_how_it_gets_one():
    told = known(report=report(tracking=True))
    assert state_text(told).endswith("no site: disconnect and set yours to allow motion")
    told.report = replace(told.report, altaz_deg=(40.0, 180.0))
    assert "site" not in state_text(told)


@pytest.mark.parametrize("lost", [False, True])
def test_limits_drawn_while_the_mount_is_busy_hold_after_a_stop_and_without_a_cable(qtbot, unpainted, lost):
    """The profile has kept them and the picture shows them: the guard must not keep the old ones."""
    _, commands = unpainted
    with connected(qtbot, commands) as mount:

        def waits(guard):
            while True:
                sleep(PACE_S)
                yield Progress("waiting")

        mount.control.order("long", waits)
        qtbot.waitUntil(lambda: mount.control.known.doing is not None)
        if lost:
            mount.bench.line.unplug()
            qtbot.waitUntil(lambda: mount.control.known.phase == "lost", timeout=15_000)
        tree = ((0.0, 10.0), (90.0, 40.0), (180.0, 10.0))
        mount.control.use_limits(horizon_deg=tree)
        mount.control.stop()
        qtbot.waitUntil(lambda: mount.opening.guard.limits.horizon_deg == tree, timeout=10_000)
        mount.bench.line.plug()
        qtbot.waitUntil(lambda: mount.control.known.phase == "on" and not mount.control.known.busy, timeout=20_000)


@pytest.mark.parametrize("ending", ["plugged", "stopped"])
def test_an_order_that_stands_waits_for_a_loose_cable(qtbot, unpainted, ending):
    """Bolts are turned for minutes: the measurement is not lost with the cable."""
    _, commands = unpainted
    with connected(qtbot, commands) as mount:
        seen, told = [], []

        def follows(guard):
            while len(seen) < 5:
                sleep(PACE_S)
                yield Progress("adjust")
                if mount.control.known.phase == "on" and told:
                    seen.append(1)
            return "followed"

        task = mount.control.order(POLAR, follows, mount_is_still)
        for name in ("succeeded", "failed", "cancelled"):
            getattr(task, name).connect(lambda *_, n=name: told.append(n))
        qtbot.waitUntil(lambda: mount.control.known.at_rest, timeout=10_000)  # it has begun
        mount.bench.line.unplug()
        qtbot.waitUntil(lambda: mount.control.known.phase == "lost", timeout=15_000)
        assert mount.control.known.busy == POLAR
        assert not told
        if ending == "stopped":
            mount.control.stop()
            qtbot.waitUntil(lambda: told == ["failed"], timeout=10_000)
            assert mount.control.known.phase == "lost"
        mount.bench.line.plug()
        qtbot.waitUntil(lambda: mount.control.known.phase == "on", timeout=20_000)
        if ending == "plugged":
            told.append("back")
            qtbot.waitUntil(lambda: told == ["back", "succeeded"], timeout=10_000)


@pytest.mark.parametrize(("stage", "waits"), [("adjust", True), ("measure", True), ("turn", False)])
def test_what_turns_the_mount_never_waits(stage, waits):
    assert mount_is_still(Progress(stage)) is waits


@pytest.mark.parametrize(
    ("word", "signal"),
    [
        (OrderDone("x", 3), "succeeded"),
        (OrderFailed("x", "Broken."), "failed"),
        (OrderFailed("x", "Stopped.", stopped=True), "cancelled"),
    ],
)
def test_an_task_ends_like_a_job(qtbot, word, signal):
    task = MountTask("x", lambda: None, None)
    told = []
    for name in ("succeeded", "failed", "cancelled", "finished"):
        getattr(task, name).connect(lambda *_, n=name: told.append(n))
    task.end(word)
    assert told == [signal, "finished"]


def test_escape_at_the_bolts_only_leaves_them_while_the_mount_stands(qtbot, unpainted):
    """The axis is followed with eyes on the bolts: a key that leaves the screen loses nothing."""
    _, commands = unpainted
    with connected(qtbot, commands) as mount:
        commands.views.show("polar")
        view = commands.views.docks["polar"].view
        stage, over = ["adjust"], []

        def following(guard):
            while not over:
                sleep(PACE_S)
                yield Progress(stage[0])

        task = mount.control.order(POLAR, following)
        cancelled = []
        task.cancelled.connect(lambda: cancelled.append(1))
        qtbot.waitUntil(lambda: mount.control.known.at_rest, timeout=10_000)
        view.alignment.state = adjusting(-900.0, 100.0)
        assert view.alignment.state.knob in (Knob.ALTITUDE, Knob.AZIMUTH)
        view.show_bolts()
        qtbot.waitUntil(view.bolts.isActiveWindow)
        qtbot.keyClick(view.bolts, Qt.Key.Key_Escape)
        assert not view.bolts.isVisible()
        menu = QMenu(commands.window)
        menu.addAction("one")
        menu.popup(commands.window.mapToGlobal(commands.window.rect().center()))
        qtbot.waitUntil(menu.isVisible)
        qtbot.keyClick(menu, Qt.Key.Key_Escape)
        qtbot.wait(300)
        assert not cancelled
        stage[0] = "turn"
        qtbot.waitUntil(lambda: not mount.control.known.at_rest, timeout=10_000)
        view.show_bolts()
        qtbot.waitUntil(view.bolts.isActiveWindow)
        qtbot.keyClick(view.bolts, Qt.Key.Key_Escape)
        qtbot.waitUntil(lambda: bool(cancelled), timeout=10_000)
        assert ("stop",) in [entry[:1] for entry in mount.telescope.log]


def known(**more):
    return MountSnapshot("on", "COM3", Connected("A mount", {}, Epoch.DATE, None), **more)


def report(**state):
    return PositionReport((1.0, 2.0), MountState(**state))


def test_at_rest_is_only_what_is_known_to_stand():
    assert known().at_rest
    assert not known(report=report(slewing=True)).at_rest
    assert not known(busy="goto").at_rest
    assert not known(busy="accept_sync").at_rest, "it may fall back to a slew"
    assert known(busy="take_frame").at_rest
    aligning = known(busy=POLAR)
    assert not aligning.at_rest, "nothing is heard of it yet"
    for stage, rests in (("measure", True), ("turn", False), ("adjust", True)):
        aligning.hear(OrderProgress(POLAR, Progress(stage)))
        assert aligning.at_rest is rests
    aligning.hear(LineLost("gone"))
    assert not aligning.at_rest


def test_what_is_over_in_a_moment_hides_no_longer_order():
    told = known(busy="goto")
    for word in (OrderProgress("limits", Progress("limits")), OrderDone("limits", None)):
        told.hear(word)
        assert told.busy == "goto"
    told.hear(OrderDone("goto", ""))
    assert told.busy == ""


@pytest.mark.parametrize(
    ("told", "text"),
    [
        (MountSnapshot(), "No mount"),
        (MountSnapshot("connecting"), "Mount: connecting…"),
        (MountSnapshot("lost", busy="goto"), "Mount: CONNECTION LOST"),
        (known(), "Mount: connected"),
        (known(report=report(tracking=True)), "Mount: tracking"),
        (known(report=report(tracking=False)), "Mount: idle, not tracking"),
        (known(report=report(slewing=True, tracking=True)), "Mount: slewing"),
        (known(report=report(parked=True)), "Mount: parked"),
        (known(busy="centre", practice=True), "Practice mount: centring"),
        (known(busy="no such"), "Mount: no such"),
    ],
)
def test_the_corner_says_how_the_mount_is(told, text):
    assert mount_status_text(told) == text
