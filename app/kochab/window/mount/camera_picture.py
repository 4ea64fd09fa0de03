"""The last frame of the mount's camera, small, with its age; an opened file is never shown here."""

from time import monotonic

import numpy as np
from PySide6.QtCore import QRectF, QSize, QTimer
from PySide6.QtGui import QColor, QHideEvent, QPainter, QPaintEvent, QPixmap, QShowEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from kochab.core.arrays import Array
from kochab.core.frame import Frame
from kochab.core.progress import Progress, Task
from kochab.core.solution import Solution
from kochab.core.values import mutable
from kochab.sky.layer import MARKS, Layers
from kochab.sky.sky_tables import SkyTables
from kochab.text.angle_text import age_text
from kochab.text.translation import tr
from kochab.window.frame.session import Session
from kochab.window.image.overlay import Overlay
from kochab.window.image.screen_image import Viewport
from kochab.window.image.thumbnails import as_pixmap, reduced
from kochab.window.job import Jobs
from kochab.window.themes import THEMES, theme_colours, translucent
from kochab.window.widgets import column, label

MOST_PX, LOOK_MS = 640, 1000
SHOWN = ("objects", "names", "bodies")
SHAPE = 0.66  # height over width, before there is a frame


@mutable(eq=False)
class Taken:
    """One frame of the camera, and what came of it so far."""

    frame: Frame
    at_s: float  # when it came, by the monotonic clock
    picture: Array | None = None
    solution: Solution | None = None
    is_over: bool = False  # solved, or given up


def _reduced(frame: Frame) -> Task[Array]:
    yield Progress("thumbnails")
    return reduced(frame, MOST_PX)


class CameraPicture(QWidget):
    """Frames without a file are the camera's. The labels of one stay until the next is solved, if nothing moved."""

    def __init__(self, session: Session, jobs: Jobs) -> None:
        super().__init__()
        self._session, self._jobs = session, jobs
        self.shown: Taken | None = None
        self._next: Taken | None = None  # taken, and not shown yet
        self._has_moved = False
        self._slews = False
        self.canvas = _Canvas()
        self.caption = label("", "muted", wrap=True)
        column(self.canvas, self.caption, on=self, spacing=4, margins=(0, 0, 0, 0))
        self._clock = QTimer(self, interval=LOOK_MS)
        self._clock.timeout.connect(self.look)
        session.opened.connect(self._taken)
        session.solved.connect(lambda _: self._over())
        session.unsolved.connect(lambda _: self._over())
        self.look()

    def use_sky(self, tables: SkyTables) -> None:
        """What the labels are taken from."""
        self.canvas.overlay.tables = tables
        self._show()

    def show_motion(self, has_moved: bool, slews: bool) -> None:
        """Whether the mount has moved since the last solved frame, and whether it slews now."""
        if (has_moved, slews) != (self._has_moved, self._slews):
            self._has_moved, self._slews = has_moved, slews
            self._show()

    def forget(self) -> None:
        """Another mount, another camera: its last frame is not this one's."""
        self.shown = self._next = None
        self._show()

    def _taken(self, frame: Frame) -> None:
        if self._session.known.path is not None or self._session.streams:
            return
        self._next = taken = Taken(frame, self._session.known.shown_at_s)
        job = self._jobs.run(_reduced(frame), "camera picture")

        def has(picture: Array) -> None:
            taken.picture = picture
            self._advance()

        job.succeeded.connect(has)

    def _over(self) -> None:
        if self._next is not None and self._next.frame is self._session.known.frame:
            self._next.solution, self._next.is_over = self._session.known.solution, True
            self._advance()
        elif self.shown is not None and self.shown.frame is self._session.known.frame:
            self.shown.solution, self.shown.is_over = self._session.known.solution, True
            self._show()

    def _advance(self) -> None:
        """Show the next frame once it is solved; at once where no labels would be lost, or they are of elsewhere."""
        labelled = self.shown is not None and self.shown.solution is not None and not self._has_moved
        if self._next is not None and self._next.picture is not None and (self._next.is_over or not labelled):
            self.shown, self._next = self._next, None
        self._show()

    def _show(self) -> None:
        self.canvas.show_taken(self.shown, is_old=self._has_moved or self._slews)
        self.look()

    def look(self) -> None:
        """Say how old it is."""
        self.caption.setText(self._words())
        self.canvas.setAccessibleName(self.caption.text())

    def _words(self) -> str:
        taken = self.shown
        if taken is None:
            return tr("No frame of the camera yet.")
        age = age_text(monotonic() - taken.at_s)
        if self._slews:
            return tr("taken {age} ago, before this slew", age=age)
        if self._has_moved:
            return tr("taken {age} ago, before the mount moved", age=age)
        if self._next is not None:
            return tr("taken {age} ago · solving the next frame", age=age)
        if taken.is_over and taken.solution is None:
            return tr("taken {age} ago · no solution", age=age)
        return tr("taken {age} ago", age=age)

    def showEvent(self, event: QShowEvent) -> None:
        self.look()
        self._clock.start()

    def hideEvent(self, event: QHideEvent) -> None:
        self._clock.stop()


class _Canvas(QWidget):
    """Paints it as wide as there is room, with its names."""

    def __init__(self) -> None:
        super().__init__()
        self.overlay = Overlay(Layers(on={name: name in SHOWN for name in MARKS}))
        self._taken: Taken | None = None
        self._is_old = False
        self._pixmap: tuple[object, QPixmap] | None = None
        policy = QSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Preferred)
        policy.setHeightForWidth(True)
        self.setSizePolicy(policy)

    @property
    def _shape(self) -> float:
        frame = None if self._taken is None else self._taken.frame
        return SHAPE if frame is None else min(frame.height / frame.width, 1.0)

    def heightForWidth(self, width: int) -> int:
        return round(width * self._shape)

    def sizeHint(self) -> QSize:
        return QSize(240, self.heightForWidth(240))

    def minimumSizeHint(self) -> QSize:
        return QSize(120, self.heightForWidth(120))

    def show_taken(self, taken: Taken | None, is_old: bool) -> None:
        """Draw it, dimmed where the mount has moved since."""
        before, self._taken, self._is_old = self._taken, taken, is_old
        solution = None if taken is None or is_old else taken.solution
        if solution is not self.overlay.solution:
            self.overlay.show(np.empty((0, 2)), solution)
        if before is not taken:
            self.updateGeometry()
        self.update()

    def paintEvent(self, _: QPaintEvent) -> None:
        painter, colours, box = QPainter(self), theme_colours(), QRectF(self.rect())
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        painter.fillRect(box, QColor(colours.sky))
        if self._taken is not None and self._taken.picture is not None:
            self._paint(painter, self._taken.frame, self._taken.picture, box)
        painter.setPen(QColor(colours.line))
        painter.drawRect(box.adjusted(0, 0, -1, -1))
        painter.end()

    def _paint(self, painter: QPainter, frame: Frame, picture: Array, box: QRectF) -> None:
        red = theme_colours() is THEMES["night"]
        if self._pixmap is None or self._pixmap[0] != (id(picture), red):
            self._pixmap = (id(picture), red), as_pixmap(picture, red)
        scale = min(box.width() / frame.width, box.height() / frame.height)
        wide, high = scale * frame.width, scale * frame.height
        left, top = (box.width() - wide) / 2.0, (box.height() - high) / 2.0
        pixmap = self._pixmap[1]
        painter.drawPixmap(QRectF(left, top, wide, high), pixmap, QRectF(pixmap.rect()))
        if self._is_old:
            painter.fillRect(box, translucent(theme_colours().sky, 150))
        elif self.overlay.solution is not None:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            self.overlay.paint(painter, Viewport(self.width(), self.height(), scale, left, top))
