"""Puts a running camera's frames on the window's frame view, the newest first and no faster."""

from collections import deque
from time import monotonic

import numpy as np
from PySide6.QtCore import QObject, QTimer, Signal

from app.core.detections import Detections
from app.core.frame import Frame
from app.core.solution import NoSolution, Solution
from app.ui.job import Job
from app.ui.live.brighten import Look
from app.ui.live.display import Display, Ready
from app.ui.services import Services
from app.workflows.solve_frame import SolvedFrame

SHORTEST_S = 0.030  # between two drawings: about 30 a second, with room for jitter
TELL_S = 1.0  # between two answers told to the rest of the window
RATE_OVER = 30


class Stage(QObject):
    """Draws what its :attr:`display` is given, from :meth:`begin` to :meth:`end`."""

    drawn = Signal(object)  # Ready
    _has_ready = Signal()

    def __init__(self, services: Services, parent: QObject) -> None:
        super().__init__(parent)
        self._services = services
        self.display: Display | None = None
        self.shown: Ready | None = None
        self.moments: deque[float] = deque(maxlen=RATE_OVER)
        self.latency_ms: float | None = None
        self._job: Job | None = None
        self._told_s = 0.0
        self._drawn_s = 0.0
        self._timer = QTimer(self)
        self._timer.setSingleShot(True)
        self._timer.timeout.connect(self._draw)
        self._has_ready.connect(self._soon)
        services.view.zoomed.connect(self._look)
        services.panes.strip.changed.connect(self._look)
        services.looks.changed.connect(self._look)

    def begin(self, name: str) -> Display:
        """Leave what is open; what the display is given is drawn from now on."""
        self.end(keep=False)
        self.shown, self.latency_ms = None, None
        self.moments.clear()
        self.display = display = Display(self._has_ready.emit)
        self._job = self._services.jobs.run(display.task(), "live-display")
        self._services.session.begin_stream(name)
        self._look()
        return display

    def end(self, keep: bool = True) -> None:
        """Draw no more; with ``keep`` the last frame stays, as an opened one would."""
        display, self.display = self.display, None
        if display is None:
            return
        display.close()
        self._timer.stop()
        if keep and self.shown is not None:
            name = self._services.session.known.name
            frame, result = self.shown.frame, _result(self.shown)
            self._services.session.show(frame, name)
            if result is None:
                self._services.session.solve()
            else:
                found = _detections(frame, result)
                self._services.session.answer(SolvedFrame(frame.path, frame, found, result))

    @property
    def drawn_hz(self) -> float | None:
        """Frames drawn a second, of late."""
        if len(self.moments) < 2 or monotonic() - self.moments[-1] > 5.0:
            return None
        return (len(self.moments) - 1) / (self.moments[-1] - self.moments[0])

    # drawing ----------------------------------------------------------------------------------
    def _look(self, _: object = None) -> None:
        """How frames are to be made ready now."""
        if self.display is None:
            return
        strip, view = self._services.panes.strip, self._services.view
        stretch = None if strip.auto.isChecked() else strip.stretch
        scale = view.viewport.scale * view.devicePixelRatioF()
        self.display.look = Look(stretch, self._services.looks.is_night, scale, self._in_colour)

    @property
    def _in_colour(self) -> bool:
        return self._services.settings.flag("colour", True)

    def _soon(self) -> None:
        left = self._drawn_s + SHORTEST_S - monotonic()
        if left <= 0:
            self._draw()
        elif not self._timer.isActive():
            self._timer.start(max(1, round(1e3 * left)))

    def _draw(self) -> None:
        if self.display is None:
            return
        ready = self.display.take()
        if ready is None:
            return
        if self.display.look.colour != self._in_colour:
            self._look()
        self._drawn_s = monotonic()
        first = self.shown is None or _size(self.shown.frame) != _size(ready.frame)
        self.shown = ready
        session = self._services.session
        session.stream(ready.frame, ready.picture, _result(ready))
        if first:
            session.opened.emit(ready.frame)
            self._services.panes.strip.show_picture(ready.picture)
            self._look()
        self._services.view.repaint()
        now = monotonic()
        self.moments.append(now)
        if ready.update is not None:
            self.latency_ms = 1e3 * (now - ready.update.shot.shutter_s)
        self._tell(ready, now)
        self.drawn.emit(ready)

    def _tell(self, ready: Ready, now: float) -> None:
        """Let the rest of the window know now and then, and at once when there is no answer."""
        result, session = _result(ready), self._services.session
        if isinstance(result, Solution):
            if now - self._told_s >= TELL_S:
                self._told_s = now
                session.solved.emit(result)
        elif isinstance(result, NoSolution) and self._told_s:
            self._told_s = 0.0
            session.unsolved.emit(result)


def _result(ready: Ready) -> Solution | NoSolution | None:
    return None if ready.update is None else ready.update.result


def _size(frame: Frame) -> tuple[int, int]:
    return frame.width, frame.height


def _detections(frame: Frame, result: Solution | NoSolution) -> Detections:
    stars = result.stars if isinstance(result, Solution) else ()
    xy = np.array([(s.x, s.y) for s in stars], dtype=np.float64).reshape(-1, 2)
    return Detections.from_list(xy, frame.width, frame.height)
