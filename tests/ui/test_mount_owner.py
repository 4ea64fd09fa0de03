"""One owner of the mount's line: what one view connects, moves and stops, the others know."""

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QMenu

from app.core.errors import RefusedError
from app.core.mount import Direction, Epoch, MountState
from app.core.progress import Progress
from app.polar.bolts import Knob
from app.ui.mount import reasons as why
from app.ui.mount.corner import MountCorner, corner_text
from app.ui.mount.errand import Errand
from app.ui.mount.known import POLAR, MountKnown
from app.ui.mount.words import Connected, Done, Failed, Lost, Report, Under
from app.ui.polar.run import OTHER_SKY, stands
from app.ui.polar.wish import Hand, Source
from tests.mounts.bench import place
from tests.ui.mount_bench import connected
from tests.ui.polar_cases import adjusting
from tests.ui.test_polar_view import Nights, drive, polar

__all__ = ["polar"]  # a fixture


def corner(commands):
    return commands.window.findChild(MountCorner)


def turning(view):
    """Set up so that the practice mount turns the axis itself."""
    view.setup.source.setCurrentText(Source.PRACTICE)
    view.setup.hand.setCurrentText(Hand.MOUNT)
    view.setup.exposure.setValue(0.5)


def test_polar_alignment_connects_the_mount_for_every_view(qtbot, polar):
    nights = Nights(rate=1.0)
    commands, view = polar(nights)
    commands.views.show("mount")
    mount = commands.views.docks["mount"].view
    assert corner(commands).text.text() == "No mount"
    assert corner(commands).stop.isHidden()
    turning(view)
    view.begin()
    qtbot.waitUntil(lambda: mount.desk.known.doing is not None, timeout=60_000)
    qtbot.waitUntil(lambda: mount.desk.known.doing.stage == "turn", timeout=60_000)
    assert mount.desk.known.phase == "on"
    assert mount.name.text().startswith("Practice: ")
    assert mount.pad.buttons[Direction.NORTH].reason == mount.go.goto.reason
    assert "polar alignment (F4), which turns the RA axis" in mount.go.goto.reason
    assert corner(commands).text.text() == "Practice mount: polar alignment"
    assert mount.stop.reason == ""
    with pytest.raises(RefusedError, match="polar alignment"):
        mount.desk.order("goto", lambda guard: iter(()))
    telescope = nights.made[-1].rig.mount
    qtbot.waitUntil(lambda: telescope.slewing, timeout=20_000)
    mount.stop.click()  # in the other view
    drive(view)
    qtbot.waitUntil(lambda: not telescope.slewing, timeout=5_000)
    assert "Cancelled" in view.said.text()
    qtbot.waitUntil(lambda: mount.desk.known.phase == "off", timeout=15_000)
    assert corner(commands).text.text() == "No mount"


def test_polar_alignment_uses_the_mount_that_is_connected(qtbot, polar):
    nights = Nights(rate=1.0)
    commands, view = polar(nights)
    commands.practise()
    mount = commands.views.docks["mount"].view
    qtbot.waitUntil(lambda: mount.desk.known.report is not None, timeout=30_000)
    commands.views.show("polar")
    assert view.setup.mount.text().startswith("Connected: ")
    turning(view)
    view.begin()
    qtbot.waitUntil(lambda: view.hands is not None, timeout=30_000)
    assert len(nights.made) == 1, "the same telescope under the same sky"
    commands.window.activateWindow()
    qtbot.waitUntil(commands.window.isActiveWindow)
    qtbot.keyClick(view.cancel, Qt.Key.Key_Escape)
    drive(view)
    assert mount.desk.known.phase == "on", "who opened it closes it"
    assert mount.go.goto.reason == ""
    view.setup.source.setCurrentText(Source.CAMERA)
    view.begin()
    assert view.said.text() == OTHER_SKY


def test_an_alignment_by_hand_is_on_the_practice_telescope_that_is_there(qtbot, polar):
    nights = Nights()
    commands, view = polar(nights)
    commands.practise()
    mount = commands.views.docks["mount"].view
    qtbot.waitUntil(lambda: mount.desk.known.report is not None, timeout=30_000)
    turning(view)
    view.setup.hand.setCurrentText(Hand.PERSON)
    view.begin()
    qtbot.waitUntil(lambda: view.hands is not None, timeout=30_000)
    assert len(nights.made) == 1
    assert mount.go.goto.reason == mount.go.centre.reason == why.BY_HAND
    assert mount.pad.buttons[Direction.NORTH].reason == why.BY_HAND
    assert mount.pad.buttons[Direction.EAST].reason == "", "that is a way to turn the RA axis"
    assert mount.stop.reason == ""
    with pytest.raises(RefusedError, match="by hand"):
        mount.desk.order("goto", lambda guard: iter(()))
    mount.asks.nudge(Direction.NORTH, 60.0)
    assert mount.said.text() == why.BY_HAND
    view.cancel.click()
    drive(view)
    assert mount.go.goto.reason == ""
    assert mount.desk.known.phase == "on"
    assert nights.made[0].rig.frame(0.1) is not None


def test_one_order_at_a_time_whoever_gives_it(qtbot, opened):
    _, commands = opened
    with connected(qtbot, commands, slew_deg_s=1.0) as mount:
        commands.views.show("polar")
        view = commands.views.docks["polar"].view
        view.setup.source.setCurrentText(Source.CAMERA)
        view.setup.hand.setCurrentText(Hand.MOUNT)
        far = place(-60.0, 40.0, mount.bench.clock)
        mount.view.asks.goto(f"{far[0]:.4f} {far[1]:.4f}")
        view.begin()
        assert view.said.text() == why.BUSY.format("going there")
        assert not view.start.isHidden()
        view.setup.hand.setCurrentText(Hand.PERSON)
        view.begin()
        assert view.said.text() == why.BUSY.format("going there")
        assert not mount.desk.by_hand
        mount.desk.stop()
        qtbot.waitUntil(lambda: not mount.desk.known.busy, timeout=10_000)


def test_an_errand_ends_with_the_line(qtbot, opened):
    _, commands = opened
    with connected(qtbot, commands) as mount:
        heard = []

        def waits(guard):
            while True:
                yield Progress("waiting")

        errand = mount.desk.order("long", waits)
        errand.cancelled.connect(lambda: heard.append("cancelled"))
        errand.finished.connect(lambda: heard.append("finished"))
        mount.desk.disconnect_mount()
        qtbot.waitUntil(lambda: heard == ["cancelled", "finished"], timeout=15_000)
        with pytest.raises(RefusedError, match="Connect a mount first"):
            mount.desk.order("goto", waits)


@pytest.mark.parametrize("ending", ["plugged", "stopped"])
def test_an_order_that_stands_waits_for_a_loose_cable(qtbot, opened, ending):
    """Bolts are turned for minutes: the measurement is not lost with the cable."""
    _, commands = opened
    with connected(qtbot, commands) as mount:
        seen, told = [], []

        def follows(guard):
            while len(seen) < 5:
                yield Progress("adjust")
                if mount.desk.known.phase == "on" and told:
                    seen.append(1)
            return "followed"

        errand = mount.desk.order(POLAR, follows, stands)
        for name in ("succeeded", "failed", "cancelled"):
            getattr(errand, name).connect(lambda *_, n=name: told.append(n))
        qtbot.waitUntil(lambda: mount.desk.known.at_rest, timeout=10_000)  # it has begun
        mount.bench.line.unplug()
        qtbot.waitUntil(lambda: mount.desk.known.phase == "lost", timeout=15_000)
        assert mount.desk.known.busy == POLAR
        assert not told
        if ending == "stopped":
            mount.desk.stop()
            qtbot.waitUntil(lambda: told == ["failed"], timeout=10_000)
            assert mount.desk.known.phase == "lost"
        mount.bench.line.plug()
        qtbot.waitUntil(lambda: mount.desk.known.phase == "on", timeout=20_000)
        if ending == "plugged":
            told.append("back")
            qtbot.waitUntil(lambda: told == ["back", "succeeded"], timeout=10_000)


@pytest.mark.parametrize(("stage", "waits"), [("adjust", True), ("measure", True), ("turn", False)])
def test_what_turns_the_mount_never_waits(stage, waits):
    assert stands(Progress(stage)) is waits


@pytest.mark.parametrize(
    ("word", "signal"),
    [
        (Done("x", 3), "succeeded"),
        (Failed("x", "Broken."), "failed"),
        (Failed("x", "Stopped.", stopped=True), "cancelled"),
    ],
)
def test_an_errand_ends_like_a_job(qtbot, word, signal):
    errand = Errand("x", lambda: None, None)
    told = []
    for name in ("succeeded", "failed", "cancelled", "finished"):
        getattr(errand, name).connect(lambda *_, n=name: told.append(n))
    errand.end(word)
    assert told == [signal, "finished"]


def test_escape_at_the_bolts_only_leaves_them_while_the_mount_stands(qtbot, opened):
    """The axis is followed with eyes on the bolts: a key that leaves the screen loses nothing."""
    _, commands = opened
    with connected(qtbot, commands) as mount:
        commands.views.show("polar")
        view = commands.views.docks["polar"].view
        stage, over = ["adjust"], []

        def following(guard):
            while not over:
                yield Progress(stage[0])

        errand = mount.desk.order(POLAR, following)
        cancelled = []
        errand.cancelled.connect(lambda: cancelled.append(1))
        qtbot.waitUntil(lambda: mount.desk.known.at_rest, timeout=10_000)
        view.state = adjusting(-900.0, 100.0)
        assert view.state.knob in (Knob.ALTITUDE, Knob.AZIMUTH)
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
        qtbot.waitUntil(lambda: not mount.desk.known.at_rest, timeout=10_000)
        view.show_bolts()
        qtbot.waitUntil(view.bolts.isActiveWindow)
        qtbot.keyClick(view.bolts, Qt.Key.Key_Escape)
        qtbot.waitUntil(lambda: bool(cancelled), timeout=10_000)
        assert ("stop",) in [entry[:1] for entry in mount.telescope.log]


def known(**more):
    return MountKnown("on", "COM3", Connected("A mount", {}, Epoch.DATE, None), **more)


def report(**state):
    return Report((1.0, 2.0), MountState(**state))


def test_at_rest_is_only_what_is_known_to_stand():
    assert known().at_rest
    assert not known(report=report(slewing=True)).at_rest
    assert not known(busy="goto").at_rest
    assert not known(busy="accept").at_rest, "it may fall back to a slew"
    assert known(busy="take").at_rest
    aligning = known(busy=POLAR)
    assert not aligning.at_rest, "nothing is heard of it yet"
    for stage, rests in (("measure", True), ("turn", False), ("adjust", True)):
        aligning.hear(Under(POLAR, Progress(stage)))
        assert aligning.at_rest is rests
    aligning.hear(Lost("gone"))
    assert not aligning.at_rest


def test_what_is_over_in_a_moment_hides_no_longer_order():
    told = known(busy="goto")
    for word in (Under("site", Progress("site")), Done("site", None)):
        told.hear(word)
        assert told.busy == "goto"
    told.hear(Done("goto", ""))
    assert told.busy == ""


@pytest.mark.parametrize(
    ("told", "text"),
    [
        (MountKnown(), "No mount"),
        (MountKnown("connecting"), "Mount: connecting…"),
        (MountKnown("lost", busy="goto"), "Mount: LINE LOST"),
        (known(), "Mount: connected"),
        (known(report=report(tracking=True)), "Mount: tracking"),
        (known(report=report(tracking=False)), "Mount: not tracking"),
        (known(report=report(slewing=True, tracking=True)), "Mount: slewing"),
        (known(report=report(parked=True)), "Mount: parked"),
        (known(busy="centre", practice=True), "Practice mount: centring"),
        (known(busy="no such"), "Mount: no such"),
    ],
)
def test_the_corner_says_how_the_mount_is(told, text):
    assert corner_text(told) == text
