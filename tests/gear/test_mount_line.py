"""The thread of a mount's line, stepped by hand: what becomes of orders when the line is lost."""

from time import sleep

import pytest

from kochab.core.errors import LineLostError
from kochab.core.progress import Progress
from kochab.gear import mount_line
from kochab.gear.mount_events import Connected, LineLost, OrderDone, OrderFailed, OrderProgress, StopFailed, Stopped
from kochab.gear.mount_line import LOST, STOPPED, MountLine
from tests.gear.mounts.imaginary import at, guarded

STEPS = 200  # more than anything here needs


class Session:
    """A line that looks at every step and waits for nothing, what it told, and its guard."""

    def __init__(self):
        self.guard, self.mount = guarded()
        self.guard._reopen = lambda: self.mount
        self.told = []
        self.line = MountLine(lambda: self.guard, self.told.append)
        self.steps = self.line.run()

    def of(self, kind):
        return [word for word in self.told if isinstance(word, kind)]

    def until(self, kind, count=1):
        for _ in range(STEPS):
            if len(self.of(kind)) >= count:
                return self.of(kind)
            next(self.steps)
        raise AssertionError(f"never told: {kind.__name__}")


@pytest.fixture
def session(monkeypatch):
    for name in ("POLL_S", "LISTEN_S", "RETRY_S"):
        monkeypatch.setattr(mount_line, name, 0.0)
    found = Session()
    found.until(Connected)
    yield found
    found.mount.closed = False
    found.steps.close()


def test_orders_that_wait_when_the_line_is_lost_are_told_as_failed_and_none_moves_the_mount_later(session) -> None:
    session.mount.closed = True
    session.line.order("goto", lambda guard: guard.slew(*at(-30.0, 40.0)))
    session.line.order("park", lambda guard: guard.park())
    session.guard._reopen = lambda: (_ for _ in ()).throw(LineLostError("Still out."))
    failed = session.until(OrderFailed, 2)
    assert [(word.name, word.sentence) for word in failed] == [("goto", LOST), ("park", LOST)]
    session.mount.closed, session.guard._reopen = False, lambda: session.mount
    session.until(Connected, 2)
    for _ in range(5):
        next(session.steps)
    assert not {"goto", "park"} & {did[0] for did in session.mount.did}
    assert not session.of(OrderDone)


def test_the_order_under_way_when_the_line_breaks_is_told_as_failed_with_the_reason(session) -> None:
    def broken(guard):
        yield Progress("slewing")
        raise LineLostError("The cable is out.")

    session.line.order("goto", broken)
    session.until(LineLost)
    assert [(word.name, word.sentence) for word in session.of(OrderFailed)] == [("goto", "The cable is out.")]


def test_an_order_given_up_is_told_as_stopped_and_one_that_ended_as_done(session) -> None:
    def endless(guard):
        while True:
            sleep(0.01)
            yield Progress("searching")

    def seven(guard):
        yield Progress("counting")
        return 7

    session.line.order("search", endless)
    session.until(OrderProgress)
    session.line.cancel()
    (failed,) = session.until(OrderFailed)
    assert (failed.name, failed.sentence, failed.stopped) == ("search", STOPPED, True)
    session.line.order("limits", seven)
    (done,) = session.until(OrderDone)
    assert (done.name, done.result) == ("limits", 7)


@pytest.mark.parametrize(("closed", "kind"), [(False, Stopped), (True, StopFailed)])
def test_a_stop_is_told_as_sent_or_as_failed(session, closed, kind) -> None:
    if closed:
        session.mount.fails["stop"] = LineLostError("The cable is out.")
    session.line.stop()
    session.line._stopper.join()
    assert [type(word) for word in session.told if isinstance(word, Stopped | StopFailed)] == [kind]
