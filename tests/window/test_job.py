import gc
import subprocess
import sys
import threading
import traceback

import pytest
from PySide6.QtCore import QObject, Signal

from kochab.core.errors import FrameError
from kochab.core.progress import Progress
from kochab.window.job import Job, Jobs


def count(n, then=None):
    for i in range(n):
        yield Progress("count", i / n)
    if then is not None:
        raise then
    return n


class Heard:
    """Everything a job said, in order."""

    def __init__(self, job):
        self.said = []
        job.progressed.connect(lambda p: self.said.append(("progressed", p.stage)))
        job.succeeded.connect(lambda v: self.said.append(("succeeded", v)))
        job.failed.connect(lambda v: self.said.append(("failed", v)))
        job.cancelled.connect(lambda: self.said.append(("cancelled", None)))
        job.finished.connect(lambda: self.said.append(("finished", None)))

    @property
    def ends(self):
        return [s for s in self.said if s[0] != "progressed"]


def run(qtbot, task):
    job = Job(task)
    heard = Heard(job)
    with qtbot.waitSignal(job.finished, timeout=5000):
        job.start()
    assert job.join(60.0)
    return heard


def test_a_result_and_then_finished(qtbot):
    heard = run(qtbot, count(3))
    assert heard.said[0] == ("progressed", "count")
    assert heard.ends == [("succeeded", 3), ("finished", None)]


def test_a_job_that_ended_is_heard_though_another_begins_before_its_signals_are_delivered(qtbot):
    """The card kept its "Solved" where the film strip began with the next file in the same turn of the loop."""

    class Window(QObject):
        closing = Signal()

    window = Window()
    jobs, told = Jobs(window, window.closing), []
    jobs.run(count(1), "quick").succeeded.connect(told.append)
    assert jobs.join(60.0)
    jobs.run(count(2), "next")
    gc.collect()
    qtbot.waitUntil(lambda: told == [1])
    window.closing.emit()


def test_a_house_error_arrives_as_its_sentence(qtbot):
    heard = run(qtbot, count(1, FrameError("This is not a picture.")))
    assert heard.ends == [("failed", "This is not a picture."), ("finished", None)]


def test_a_fault_is_told_without_a_traceback_and_logged_with_one(qtbot, caplog):
    heard = run(qtbot, count(1, ZeroDivisionError("boom")))
    (kind, sentence), end = heard.ends
    assert kind == "failed"
    assert "ZeroDivisionError: boom" in sentence  # never by its name alone
    assert "\n" not in sentence
    assert end == ("finished", None)
    (fault,) = [r for r in caplog.records if r.exc_info]
    assert "raise then" in "".join(traceback.format_exception(*fault.exc_info))


def test_running_out_of_memory_is_a_sentence(qtbot):
    heard = run(qtbot, count(0, MemoryError()))
    assert heard.ends[0][0] == "failed"
    assert "memory" in heard.ends[0][1]


def test_cancel_closes_the_task_between_yields(qtbot):
    closed, begun = threading.Event(), threading.Event()

    def endless():
        try:
            while True:
                begun.set()
                yield Progress("wait")
        finally:
            closed.set()

    job = Job(endless())
    heard = Heard(job)
    job.start()
    assert begun.wait(60)
    with qtbot.waitSignal(job.finished, timeout=5000):
        job.cancel()
    assert closed.is_set()
    assert heard.ends == [("cancelled", None), ("finished", None)]
    assert job.join(60.0)


def test_an_abandoned_job_says_nothing(qtbot):
    release = threading.Event()

    def task():
        yield Progress("a")
        release.wait(60)
        yield Progress("b")

    job = Job(task())
    heard = Heard(job)
    job.start()
    job.abandon()
    release.set()
    assert job.join(60.0)
    qtbot.wait(50)
    assert heard.said == []


def test_a_job_that_begins_after_its_window_has_closed_says_nothing(qtbot):
    """A camera's last frame is solved then, and asks what it shows."""

    class Window(QObject):
        closing = Signal()

    window = Window()
    jobs = Jobs(window, window.closing)
    window.closing.emit()
    heard = Heard(jobs.run(count(3), "late"))
    assert jobs.join()
    qtbot.wait(50)
    assert not heard.said


def test_signals_arrive_in_the_thread_of_the_window(qtbot):
    where = []
    job = Job(count(2))
    job.succeeded.connect(lambda _: where.append(threading.current_thread()))
    with qtbot.waitSignal(job.finished, timeout=5000):
        job.start()
    assert where == [threading.main_thread()]
    job.join(2.0)


@pytest.mark.parametrize("steps", [0, 1, 5000])
def test_finished_comes_once_however_long(qtbot, steps):
    heard = run(qtbot, count(steps))
    assert heard.said.count(("finished", None)) == 1
    # Progress is thinned: a task of thousands of steps does not flood the window.
    assert len(heard.said) < 200


def test_a_cancel_during_the_last_step_is_heeded(qtbot):
    begun, release = threading.Event(), threading.Event()

    def task():
        yield Progress("a")
        begun.set()
        release.wait(60)
        return 7

    job = Job(task())
    heard = Heard(job)
    job.start()
    assert begun.wait(60)
    job.cancel()
    with qtbot.waitSignal(job.finished, timeout=5000):
        release.set()
    assert heard.ends == [("cancelled", None), ("finished", None)]
    assert job.join(60.0)


def test_a_job_outlives_the_widget_that_started_it():
    """In a process of its own, which crashed: a plot's area went while its thread told of its progress."""
    code = """
import threading
from PySide6.QtCore import QCoreApplication, QEvent, QEventLoop, QTimer
from PySide6.QtWidgets import QApplication
import shiboken6
from kochab.core.progress import Progress
from kochab.window.charts import plot_area
go, told = threading.Event(), threading.Event()
def loading():
    yield Progress("plots")
    go.wait(20)
    for _ in range(2000):
        yield Progress("plots")
    told.set()
plot_area._loading = loading
app = QApplication([])
area = plot_area.PlotArea("Noise")
area.show()
loop, timer = QEventLoop(), QTimer()
timer.timeout.connect(lambda: loop.quit() if area._loading._thread.ident else None)
timer.start(5)
loop.exec()
job = area._loading
area.deleteLater()
QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
assert not shiboken6.isValid(area)
go.set()
assert told.wait(60.0)
assert shiboken6.isValid(job)
print("THERE")
"""
    found = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, timeout=60)
    assert found.stdout.strip() == "THERE", (found.returncode, found.stderr)
