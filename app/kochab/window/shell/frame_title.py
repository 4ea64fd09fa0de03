"""Which frame is open and how far it is: in the window's title, and in the bars above and below the image."""

from pathlib import Path

from PySide6.QtCore import QObject

from kochab.core.errors import printable
from kochab.core.frame import Frame
from kochab.core.progress import Progress
from kochab.core.solution import NoSolution, Solution
from kochab.text.angle_text import milliseconds_text, short_name
from kochab.text.translation import number, tr
from kochab.window.frame.session import Session
from kochab.window.shell.main_window import MainWindow


class FrameTitle(QObject):
    """Tells of one :class:`Session` around the panes of the open frame."""

    def __init__(self, window: MainWindow, session: Session) -> None:
        super().__init__(window)
        self._window, self._session, self._bar = window, session, window.bar
        session.opening.connect(self._opening)
        session.streaming.connect(lambda _: window.show_frame_page())
        session.opened.connect(self._opened)
        session.progressed.connect(window.bar.show_progress)
        session.live.connect(self._live)
        session.failed.connect(self._failed)
        session.idle.connect(self._idle)
        window.workspace.view.zoomed.connect(self._zoomed)
        window.bar.cancel_wanted.connect(session.cancel)

    def _opening(self, path: Path) -> None:
        self._entitle(printable(path.name))
        if self._session.known.path is None:
            self._window.take_frame()
        else:
            self._window.show_frame_page()
        self._bar.show_progress(Progress("read", None))

    def _entitle(self, name: str, state: str = "") -> None:
        self._window.setWindowTitle(f"{state}{', ' * bool(state)}{name} – Kochab")
        self._bar.name.setText(short_name(name))
        self._bar.name.setToolTip(name)

    def _opened(self, frame: Frame) -> None:
        self._window.status.show_frame(f"{frame.width} × {frame.height}", "\n".join(map(tr, frame.warnings)))

    def _live(self, headline: str) -> None:
        self._entitle(printable(self._session.known.name), headline)
        self._bar.show_idle(headline)

    def _failed(self, _: str) -> None:
        if self._session.known.frame is None:  # facts of the frame before must not seem to be this one's
            self._window.status.show_frame("", "")
            self._zoomed(None)

    def _idle(self) -> None:
        known = self._session.known
        total = known.result.elapsed_ms.get("total") if known.result else None
        word = {Solution: tr("Solved"), NoSolution: tr("No solution")}.get(type(known.result), tr("Ready"))
        summary = word if total is None else tr("{word} in {time}", word=word, time=milliseconds_text(total))
        self._bar.show_idle(summary)

    def _zoomed(self, scale: float | None) -> None:
        """Screen pixels to an image pixel, on the button that fits it; None without an image."""
        percent = 0.0 if scale is None else scale * 100.0
        shown = number(percent, ".0f" if percent >= 10 else ".1f")
        text = tr("Fit") if scale is None else tr("Fit {percent} %", percent=shown)
        self._window.actions_by_name["fit"].setIconText(text)
