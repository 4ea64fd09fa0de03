"""A window that is closed while its mount moves stays until somebody has seen that the mount stands."""

import pytest

from kochab.gear.mounts import open_mount
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Limits
from tests.boards import served
from tests.boards.sky import sidereal_deg


class BoardOpening:
    """A board behind its guard, in the board's own night."""

    farewell, practice, score = "", None, None

    def __init__(self, board):
        self.board, self.closed = board, False

    def __call__(self):
        board = self.board
        mount = open_mount(board.driver, board.port, site=board.site, clock=board.clock)
        return Guard(mount, board.site, Limits(crosses_meridian=True), clock=board.clock)

    def over(self):
        self.closed = True


@pytest.fixture
def slewing(qtbot, opened):
    """A window whose mount, which loses its next Stop, is under way for half a minute."""
    window, commands = opened
    with served("onstep", slew_deg_s=2.0, acceleration_deg_s2=4.0) as board:
        board.align(-40.0, 40.0)
        commands.views.show("mount")
        control, opening = commands.services.mount, BoardOpening(board)
        control.begin(opening, board.port)
        qtbot.waitUntil(lambda: control.known.report is not None, timeout=30_000)
        far = (sidereal_deg(board.clock.unix(), board.site.longitude_deg) + 50.0) % 360.0, -10.0
        control.order("goto", lambda guard: guard.slew(*far))
        qtbot.waitUntil(lambda: board.moving, timeout=30_000)
        board.lose_stops(1)
        yield window, control, board, opening
        board.lose_stops(0)
        with board.lock:
            board.stop()
        qtbot.waitUntil(lambda: opening.closed, timeout=60_000)


def test_a_closed_window_stays_until_a_lost_stop_was_repeated(qtbot, slewing):
    window, _, board, opening = slewing
    window.close()
    assert window.isVisible()
    assert "Stopping the mount" in window.status.currentMessage()
    qtbot.waitUntil(lambda: not window.isVisible(), timeout=60_000)
    assert not board.moving
    assert opening.closed


def test_a_window_whose_mount_cannot_be_stopped_stays_open_with_the_alarm(qtbot, slewing, capfd):
    window, control, board, opening = slewing
    board.lose_stops(1000)
    window.close()
    qtbot.waitUntil(lambda: opening.closed, timeout=60_000)
    qtbot.waitUntil(lambda: control.known.phase == "off", timeout=60_000)
    assert window.isVisible()
    assert "CUT ITS POWER" in window.status.currentMessage()
    assert "CUT ITS POWER" in capfd.readouterr().err
    window.close()
    assert not window.isVisible()


def test_a_signal_ends_the_window_with_the_alarm_on_the_terminal(qtbot, slewing, capfd):
    window, _, board, _ = slewing
    board.lose_stops(1000)
    window.end()
    qtbot.waitUntil(lambda: not window.isVisible(), timeout=60_000)
    assert "CUT ITS POWER" in capfd.readouterr().err


def test_a_window_that_is_closed_twice_does_not_wait(slewing):
    window, _, _, _ = slewing
    window.close()
    assert window.isVisible()
    window.close()
    assert not window.isVisible()
