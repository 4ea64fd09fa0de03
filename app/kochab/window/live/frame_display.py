"""Renders a running camera's frames in a thread of their own and draws the newest in the frame view."""

from collections import deque
from collections.abc import Callable
from time import monotonic

import numpy as np
from PySide6.QtCore import QObject, QTimer, Signal

from kochab.core.frame import Detections, Frame
from kochab.core.progress import Progress, Task
from kochab.core.solution import NoSolution, Solution
from kochab.core.values import frozen
from kochab.window.image.screen_image import RenderedFrame
from kochab.window.live.rendering import DisplaySettings, Levels, LiveRenderer
from kochab.window.services import Services
from kochab.workflows.live.capture import Mailbox
from kochab.workflows.live.update import LiveUpdate
from kochab.workflows.solve_frame import SolvedFrame

WAIT_S = 0.1  # for a frame, before the task sees whether it was cancelled


@frozen(eq=False)
class Rendered:
    """A frame ready to be drawn; ``update`` is its solution, None when it is not solved yet."""

    frame: Frame
    picture: RenderedFrame
    update: LiveUpdate | None
    levels: Levels

    @property
    def result(self) -> Solution | NoSolution | None:
        return None if self.update is None else self.update.result


class RenderQueue:
    """Frames go in at :meth:`show` and come out rendered at :meth:`take`; the newest is always next.

    ``ready`` is called in the rendering thread whenever there is a frame to take. Set
    :attr:`settings` from any thread.
    """

    def __init__(self, ready: Callable[[], None]) -> None:
        self.settings = DisplaySettings()
        self._ready = ready
        self._coming: Mailbox[tuple[Frame, LiveUpdate | None]] = Mailbox()
        self._made: Mailbox[Rendered] = Mailbox()

    def show(self, frame: Frame, update: LiveUpdate | None) -> None:
        """Add a frame, from any thread; returns at once."""
        self._coming.put((frame, update))

    def take(self) -> Rendered | None:
        """The frame to draw now."""
        return self._made.take()

    def close(self) -> None:
        """Let :meth:`task` end."""
        self._coming.close()

    def task(self) -> Task[None]:
        """Render frames until it is closed."""
        # Made in this thread, which alone uses what it keeps from frame to frame.
        renderer = LiveRenderer()
        while not self._coming.closed:
            item = self._coming.take(WAIT_S)
            if item is not None:
                frame, update = item
                picture = renderer.picture(frame, self.settings)
                self._made.put(Rendered(frame, picture, update, renderer.levels))
                self._ready()
            yield Progress("display")


SHORTEST_S = 0.030  # between two drawings: about 30 a second, with room for jitter
SOLVED_EVERY_S = 1.0  # the panels beside the frame are slower than the frames
RATE_OVER = 30  # drawings


class LiveDisplay(QObject):
    """Draws what its :attr:`queue` is given in the frame view, from :meth:`begin` to :meth:`end`."""

    drawn = Signal(object)  # Rendered
    _ready = Signal()

    def __init__(self, services: Services, parent: QObject) -> None:
        super().__init__(parent)
        self._services = services
        self.queue: RenderQueue | None = None
        self.shown: Rendered | None = None
        self.moments: deque[float] = deque(maxlen=RATE_OVER)
        self.latency_ms: float | None = None
        self._solved_s = 0.0
        self._drawn_s = 0.0
        self._timer = QTimer(self, singleShot=True)
        self._timer.timeout.connect(self._draw)
        self._ready.connect(self._draw_soon)
        for signal in (services.panes.view.zoomed, services.panes.strip.changed, services.looks.changed):
            signal.connect(self._configure)

    def begin(self, name: str) -> RenderQueue:
        """Close the open frame and draw what is put into the queue from now on."""
        self.end(keep=False)
        self.shown, self.latency_ms = None, None
        self.moments.clear()
        # A signal takes the word from the rendering thread to this one.
        self.queue = queue = RenderQueue(self._ready.emit)
        self._services.jobs.run(queue.task(), "live-display")
        self._services.session.begin_stream(name)
        self._configure()
        return queue

    def end(self, keep: bool = True) -> None:
        """Stop drawing; with ``keep`` the last frame stays open, like a file."""
        queue, self.queue = self.queue, None
        if queue is None:
            return
        queue.close()
        self._timer.stop()
        if keep and self.shown is not None:
            session, frame, result = self._services.session, self.shown.frame, self.shown.result
            session.show(frame, session.known.name)
            if result is None:
                session.solve()
            else:
                # A live solution keeps the stars that matched, not all that were detected.
                xy = result.stars_px if isinstance(result, Solution) else np.empty((0, 2))
                detections = Detections.from_list(xy, frame.width, frame.height)
                session.answer(SolvedFrame(frame.path, frame, detections, result))

    @property
    def drawn_hz(self) -> float | None:
        """Frames drawn per second, over the last ones."""
        # A rate from before a pause is none.
        if len(self.moments) < 2 or monotonic() - self.moments[-1] > 5.0:
            return None
        return (len(self.moments) - 1) / (self.moments[-1] - self.moments[0])

    def _configure(self, _: object = None) -> None:
        if self.queue is None:
            return
        strip, view = self._services.panes.strip, self._services.panes.view
        stretch = None if strip.auto.isChecked() else strip.stretch
        scale = view.viewport.scale * view.devicePixelRatioF()
        self.queue.settings = DisplaySettings(stretch, self._services.looks.is_night, scale, self._in_colour)

    @property
    def _in_colour(self) -> bool:
        return self._services.settings.flag("colour", True)

    def _draw_soon(self) -> None:
        """Draw the newest frame by a timer, never at once.

        Qt first hands out all events of other threads, those too that come while a frame is drawn: a camera faster than
        the drawing would keep keys and timers waiting for ever.
        """
        if not self._timer.isActive():
            left = self._drawn_s + SHORTEST_S - monotonic()
            self._timer.start(max(0, round(1e3 * left)))

    def _draw(self) -> None:
        ready = self.queue.take() if self.queue is not None else None
        if self.queue is None or ready is None:
            return
        # No signal tells of this switch.
        if self.queue.settings.colour != self._in_colour:
            self._configure()
        self._drawn_s = monotonic()
        # Another binning gives frames of another size: whoever keeps pixels of a frame must hear of it.
        before, self.shown = self.shown, ready
        first = before is None or before.frame.pixels.shape != ready.frame.pixels.shape
        session = self._services.session
        session.stream(ready.frame, ready.picture, ready.result)
        if first:
            session.opened.emit(ready.frame)
            self._services.panes.strip.show_picture(ready.picture)
            self._configure()
        elif before is not None and before.picture.histogram is not ready.picture.histogram:
            self._services.panes.strip.follow(ready.picture)
        # Painted within this call, so that the moment below is when the frame was on the screen.
        self._services.panes.view.repaint()
        now = monotonic()
        self.moments.append(now)
        if ready.update is not None:
            self.latency_ms = 1e3 * (now - ready.update.shot.shutter_s)
        self._announce(ready.result, now)
        self.drawn.emit(ready)

    def _announce(self, result: Solution | NoSolution | None, now: float) -> None:
        """Tell the rest of the window once a second, and at once when a frame has no solution."""
        session = self._services.session
        if isinstance(result, Solution):
            if now - self._solved_s >= SOLVED_EVERY_S:
                self._solved_s = now
                session.solved.emit(result)
        elif isinstance(result, NoSolution) and self._solved_s:
            self._solved_s = 0.0
            session.unsolved.emit(result)
