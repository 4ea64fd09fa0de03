"""Starts Qt, makes one window, and runs it to its end."""

import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication

from app.detect import DETECTORS
from app.identify import IDENTIFIERS
from app.ui.background import Background
from app.ui.commands import Commands
from app.ui.engine import Engine, WorkflowEngine
from app.ui.garbage import Garbage
from app.ui.main_window import MainWindow
from app.ui.numerals import one_way_of_writing
from app.ui.presenter import Presenter
from app.ui.samples import Sample, samples
from app.ui.session import Session
from app.ui.settings import Settings
from app.ui.wiring import Wiring


def build(
    engine: Engine,
    settings: Settings,
    sample_frames: list[Sample] | None = None,
    wiring: Wiring | None = None,
) -> tuple[MainWindow, Commands]:
    """A window wired to ``engine``; it is not shown yet."""
    offered = samples() if sample_frames is None else sample_frames
    window = MainWindow(list(IDENTIFIERS), list(DETECTORS), offered)
    presenter = Presenter(window, Session(engine, window), settings)
    return window, Commands(presenter, offered, wiring)


def run(paths: Sequence[str | Path] = (), wiring: Wiring | None = None) -> int:
    """Open the window, with the first of ``paths`` when there is one; the exit code."""
    app = QApplication.instance() or QApplication(sys.argv[:1])
    assert isinstance(app, QApplication)
    app.setApplicationName("Kochab")
    app.setDesktopFileName("kochab")
    one_way_of_writing()
    engine = WorkflowEngine()
    window, commands = build(engine, Settings(), wiring=wiring)
    garbage = Garbage()
    background = Background(window, engine)
    window.show()
    if paths:
        commands.open(Path(paths[0]))
    else:
        commands.add_thumbnails()
    # Python handles Ctrl+C only when it runs, so the event loop lets it now and then.
    signal.signal(signal.SIGINT, lambda *_: window.close())
    pulse = QTimer()
    pulse.start(300)
    pulse.timeout.connect(lambda: None)
    code = app.exec()
    garbage.stop()
    background.job.join(5.0)
    return code
