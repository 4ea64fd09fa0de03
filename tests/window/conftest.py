"""A window with an engine that answers at once, settings of its own, and no threads left behind."""

import gc
import os
from functools import wraps

import pytest
from PySide6.QtCore import QEventLoop, QSettings, QTimer
from pytestqt.qtbot import QtBot

from kochab.window.application import build
from kochab.window.settings import WindowSettings
from kochab.window.shell.welcome import Sample
from kochab.window.themes import apply_theme
from kochab.window.widgets import use_plain_numerals
from tests.window.fakes import FakeEngine, close_windows

PATIENCE_MS = 60_000

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
if os.name == "nt":  # where a screen that is none has no font of its own: every letter would be a box as wide as an M
    os.environ.setdefault("QT_QPA_FONTDIR", os.path.join(os.environ["WINDIR"], "Fonts"))


@pytest.fixture(scope="session", autouse=True)
def plain_numerals(qapp):
    """As the application does at its start."""
    use_plain_numerals()


@pytest.fixture(scope="session", autouse=True)
def patience():
    """A busy machine may take longer than pytest-qt's five seconds; what never comes is still told."""
    for name in ("waitUntil", "waitSignal", "waitSignals"):
        setattr(QtBot, name, patient(getattr(QtBot, name)))
    QtBot.wait = waits_lightly


def patient(wait):
    """``wait`` with a minute at least, unless it is to see that something does not come."""

    @wraps(wait)
    def waits(bot, *arguments, timeout=PATIENCE_MS, **more):
        shortest = 0 if more.get("raising") is False else PATIENCE_MS
        return wait(bot, *arguments, timeout=max(timeout, shortest), **more)

    return waits


def waits_lightly(bot, ms):
    """As pytest-qt's, which makes a loop, a timer and a blocker of signals at each of ``waitUntil``'s looks.

    0.24 ms of processor every ten, here 0.10.
    """
    kept = vars(bot).pop("loop_and_timer", None)  # gone meanwhile: what waits within this wait makes its own
    loop, timer = kept or (QEventLoop(), QTimer())
    if kept is None:
        timer.setSingleShot(True)
        timer.timeout.connect(loop.quit)
    timer.start(ms)
    loop.exec()
    bot.loop_and_timer = loop, timer


@pytest.fixture(autouse=True)
def garbage_in_this_thread_only():
    """As the application does: a worker that collects would destroy Qt objects in its thread."""
    gc.disable()
    gc.freeze()
    yield
    gc.collect()
    gc.unfreeze()
    gc.enable()


@pytest.fixture
def settings(tmp_path):
    return WindowSettings(QSettings(str(tmp_path / "window.ini"), QSettings.Format.IniFormat))


@pytest.fixture
def use_theme(qapp):
    """Gives the application a theme for the time of a test."""

    def use(name):
        apply_theme(qapp, name)
        qapp.processEvents()  # Qt tells the widgets of their new palette in the next turn of the loop

    yield use
    use("dark")


@pytest.fixture
def a_file(tmp_path):
    path = tmp_path / "orion.fits"
    path.write_bytes(b"not read by the fake engine")
    return path


@pytest.fixture
def engine():
    return FakeEngine()


@pytest.fixture
def make_window(qtbot, settings, tmp_path):
    """Windows on demand; each is closed and its threads are joined."""
    made = []

    def make(engine, sample_frames=None):
        offered = [Sample(tmp_path / "sample.fits", "A sample", "To try")]
        window, commands = build(engine, settings, offered if sample_frames is None else sample_frames)
        qtbot.addWidget(window)
        window.resize(1200, 800)
        window.show()
        made.append(commands)
        return window, commands

    yield make
    close_windows(*made)


@pytest.fixture
def opened(qtbot, make_window, engine, a_file):
    """A window that has opened and solved a frame."""
    window, commands = make_window(engine)
    with qtbot.waitSignal(commands.session.idle):
        commands.files.open(a_file)
    return window, commands


@pytest.fixture
def unpainted(opened):
    """The same window, never repainted, where no pixel matters: a connected mount's charts would be most of the work."""
    opened[0].setUpdatesEnabled(False)
    return opened
