"""What is done once on the user's machine while the window is already in use."""

from PySide6.QtCore import QObject, QTimer

from app.core.progress import Progress
from app.ui.engine import Engine
from app.ui.job import Job
from app.ui.main_window import MainWindow

AFTER_MS = 1500  # the person's first frame goes first


class Background(QObject):
    """Runs the engine's preparation in a thread, told in the status bar; nobody has to wait."""

    def __init__(self, window: MainWindow, engine: Engine, after_ms: int = AFTER_MS) -> None:
        super().__init__(window)
        self._status = window.status
        self.job = Job(engine.prepare(), "background", self)
        self.job.progressed.connect(self._progressed)
        self.job.failed.connect(self._failed)
        self.job.finished.connect(lambda: self._status.background.setText(""))
        window.closing.connect(self._close)
        self._timer = QTimer(self)
        self._timer.setSingleShot(True)
        self._timer.timeout.connect(self.job.start)
        self._timer.start(after_ms)

    def _progressed(self, progress: Progress) -> None:
        if progress.stage != "patterns":
            return
        share = "" if progress.fraction is None else f" {progress.fraction:.0%}"
        self._status.background.setText(f"Preparing for small fields, once:{share}")
        self._status.background.setToolTip(
            "Star patterns for fields below about 2° are made on this computer, once. "
            "Wider frames are solved meanwhile."
        )

    def _failed(self, sentence: str) -> None:
        self._status.showMessage(sentence, 15_000)

    def _close(self) -> None:
        self._timer.stop()
        self.job.abandon()
        self.job.join(5.0)
