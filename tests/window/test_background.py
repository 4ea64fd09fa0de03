import threading

from kochab.core.errors import CatalogueError
from kochab.core.progress import Progress, run
from kochab.sky.completion import completion
from kochab.window.application import Background
from kochab.window.frame.session import WorkflowEngine
from tests.window.fakes import FakeEngine


def test_the_first_start_prepares_and_says_how_far(qtbot, make_window, a_file):
    engine = FakeEngine(preparing=3, gate=threading.Event())
    window, commands = make_window(engine)
    background = Background(window, engine, after_ms=0)
    shown = window.status.background
    qtbot.waitUntil(lambda: "42 %" in shown.text(), timeout=5000)
    assert "small-field index" in shown.text()
    assert not window.bar.cancel.isVisible()
    with qtbot.waitSignal(background.job.finished, timeout=5000):
        engine.gate.set()
    assert shown.text() == ""
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        commands.files.open(a_file)


def test_the_time_that_is_left_is_estimated(qtbot, make_window, monkeypatch):
    engine, now = FakeEngine(preparing=1, gate=threading.Event()), [0.0]
    monkeypatch.setattr("kochab.window.application.monotonic", lambda: now[0])
    window, _ = make_window(engine)
    background = Background(window, engine, after_ms=60_000)
    told = []
    for now[0], share in ((0.0, 0.0), (0.1, 0.2), (2.1, 0.28), (4.1, 0.36)):  # it goes on at 20 %
        background._progressed(Progress("patterns", share))
        told.append(window.status.background.text().removeprefix("Building the small-field index: "))
    assert told == ["0 %", "20 %", "28 %, about 20 s left", "36 %, about 20 s left"]
    engine.gate.set()


def test_nothing_is_said_when_nothing_is_to_be_made(qtbot, make_window, engine):
    window, _ = make_window(engine)
    background = Background(window, engine, after_ms=0)
    with qtbot.waitSignal(background.job.finished, timeout=5000):
        pass
    assert window.status.background.text() == ""


def test_a_preparation_that_fails_is_one_sentence(qtbot, make_window):
    class Failing(FakeEngine):
        def prepare(self):
            yield Progress("patterns", 0.1)
            raise CatalogueError("The disk is full.")

    window, _ = make_window(Failing())
    background = Background(window, Failing(), after_ms=0)
    with qtbot.waitSignal(background.job.finished, timeout=5000):
        pass
    assert window.status.currentMessage() == "The disk is full."


def test_closing_ends_the_preparation(qtbot, make_window):
    engine = FakeEngine(preparing=1, gate=threading.Event())
    window, _ = make_window(engine)
    background = Background(window, engine, after_ms=0)
    qtbot.waitUntil(lambda: background.job.running, timeout=5000)
    window.close()
    assert not background.job.running


def test_the_search_has_its_names_before_anybody_asks(monkeypatch):
    """The first opening waited most of a second for them."""
    monkeypatch.setattr("kochab.identification.index.fine", object)
    completion.cache_clear()
    run(WorkflowEngine().prepare())
    assert completion.cache_info().currsize == 1
