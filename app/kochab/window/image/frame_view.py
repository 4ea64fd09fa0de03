"""The widget that shows a frame: zoom, pan, stretch, and marks painted on top in one pass."""

from collections.abc import Callable

import numpy as np
from PySide6.QtCore import QPoint, QPointF, QRectF, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QContextMenuEvent,
    QFocusEvent,
    QImage,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QResizeEvent,
    QWheelEvent,
)
from PySide6.QtWidgets import QSizePolicy, QWidget

from kochab.text.translation import tr
from kochab.window.image.frame_image import FrameImage, ScreenStretch
from kochab.window.image.screen_image import RenderedFrame, ScreenImage, Viewport
from kochab.window.themes import theme_colours

Paint = Callable[[QPainter, Viewport], None]
CLICK_PX = 4  # a press that moves less than this is a click, not a drag
PANS_PX = {
    Qt.Key.Key_Left: (60.0, 0.0),
    Qt.Key.Key_Right: (-60.0, 0.0),
    Qt.Key.Key_Up: (0.0, 60.0),
    Qt.Key.Key_Down: (0.0, -60.0),
}


class FrameView(QWidget):
    """Shows an image; ``marks`` paints over it. Holds no frame and no solution."""

    hovered = Signal(object)  # (x, y) image px, or None outside
    clicked = Signal(float, float, float)  # x, y image px and reach in px
    menu_wanted = Signal(object, QPoint)  # (x, y, reach) image px, or None by the keyboard; where on the screen
    zoomed = Signal(float)  # screen px per image px

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setMouseTracking(True)  # what is under the cursor is told without a button
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setMinimumSize(240, 180)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setAccessibleName(tr("Frame"))
        self.setAccessibleDescription(
            tr("The image. Plus and minus zoom, arrow keys pan, 0 fits it to the window, 1 shows it at 100 %.")
        )
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.marks: Paint | None = None
        self.quiet = False  # without marks for a while
        self.viewport = Viewport(self.width(), self.height())
        self._image = ScreenImage()
        self._fits = True
        self._pressed: QPointF | None = None
        self._dragged = self._focus_by_key = False

    @property
    def picture(self) -> FrameImage | RenderedFrame | None:
        return self._image.picture

    def show_picture(self, picture: FrameImage | RenderedFrame | None, keep_view: bool = False) -> None:
        """Draw ``picture``, fitted unless ``keep_view``."""
        self._image.set_picture(picture)
        if not keep_view:
            self.fit()
        self.update()

    def whole(self, longest: int) -> QImage | None:
        """The whole image as it looks here, without marks, its longer side at most about ``longest`` px."""
        picture = self.picture
        if picture is None:
            return None
        share = min(1.0, longest / max(picture.width, picture.height))
        wide, high = max(1, round(share * picture.width)), max(1, round(share * picture.height))
        drawn = self._image.render(Viewport(wide, high).fitted(picture.width, picture.height), 1.0)
        return None if drawn is None else drawn[0].copy()  # it borrows the pixels of the next

    def set_look(self, stretch: ScreenStretch, colour: bool, red: bool) -> None:
        """How values become brightness; ``red`` draws with red light alone."""
        self._image.set_look(stretch, colour, red)
        self.update()

    def fit(self) -> None:
        """Show the whole frame, also when the window changes size."""
        self._fits = True
        picture = self.picture
        if picture is not None:
            self._look(self.viewport.fitted(picture.width, picture.height))

    def actual_pixels(self, at: QPointF | None = None) -> None:
        # To pixels of the screen, not to Qt's logical ones.
        self._zoom(1.0 / self.devicePixelRatioF() / self.viewport.scale, at)

    def zoom_in(self) -> None:
        self._zoom(1.5)

    def zoom_out(self) -> None:
        self._zoom(1 / 1.5)

    def centre(self, x: float, y: float) -> None:
        """Bring image pixel (x, y) to the middle, at twice the scale when all of the image was shown."""
        if self._fits:
            self._zoom(2.0)
        self._look(self.viewport.centred_on(x, y))

    def reveal(self, x: float, y: float) -> None:
        """Bring image pixel (x, y) into sight, moving only when it is not."""
        sx, sy = self.viewport.to_screen(np.array([[x, y]]))[0]
        if not (20 < sx < self.width() - 20 and 20 < sy < self.height() - 20):
            self._fits = False
            self._look(self.viewport.centred_on(x, y))

    def _zoom(self, factor: float, at: QPointF | None = None) -> None:
        """Zoom around a place on the widget, by default its centre."""
        at = at or QPointF(self.width() / 2, self.height() / 2)
        self._fits = False
        self._look(self.viewport.zoomed(factor, at.x(), at.y()))

    def _look(self, viewport: Viewport) -> None:
        if self.picture is not None and not self._fits:
            viewport = viewport.held(self.picture.width, self.picture.height)
        self.viewport = viewport
        self.zoomed.emit(viewport.scale * self.devicePixelRatioF())
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.fillRect(self.rect(), QColor(theme_colours().sky))
        drawn = self._image.render(self.viewport, self.devicePixelRatioF())
        if drawn is not None:
            image, target = drawn
            smooth = self.viewport.scale * self.devicePixelRatioF() < 2.0
            painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform, smooth)
            painter.drawImage(target, image, QRectF(image.rect()))
            if self.marks is not None and not self.quiet:
                painter.setRenderHint(QPainter.RenderHint.Antialiasing)
                self.marks(painter, self.viewport)
        if self._focus_by_key and self.hasFocus():
            painter.setRenderHint(QPainter.RenderHint.Antialiasing, False)
            painter.setPen(self.palette().highlight().color())
            painter.setBrush(Qt.BrushStyle.NoBrush)
            painter.drawRect(self.rect().adjusted(0, 0, -1, -1))
        painter.end()

    def resizeEvent(self, event: QResizeEvent) -> None:
        old = self.viewport
        self.viewport = Viewport(self.width(), self.height(), old.scale, old.dx, old.dy)
        if self._fits:
            self.fit()
        elif self.picture is not None:
            self._look(self.viewport.held(self.picture.width, self.picture.height))

    def wheelEvent(self, event: QWheelEvent) -> None:
        steps = event.angleDelta().y() / 120.0
        if self.picture is not None and steps:
            self._zoom(1.25**steps, event.position())
            self._hover(event.position())
        event.accept()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() in (Qt.MouseButton.LeftButton, Qt.MouseButton.MiddleButton):
            self._pressed = event.position()
            self._dragged = False

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        here = event.position()
        if self._pressed is not None and self.picture is not None:
            moved = here - self._pressed
            if self._dragged or moved.manhattanLength() >= CLICK_PX:
                self._dragged, self._fits = True, False
                self.setCursor(Qt.CursorShape.ClosedHandCursor)
                self._look(self.viewport.panned(moved.x(), moved.y()))
                self._pressed = here
        self._hover(here)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if self._pressed is not None and not self._dragged and self.picture is not None:
            x, y = self.viewport.to_image(event.position().x(), event.position().y())
            # The reach is 14 px of the screen at any zoom.
            self.clicked.emit(x, y, 14.0 / self.viewport.scale)
        self._pressed = None
        self.unsetCursor()

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        at = None
        if event.reason() == QContextMenuEvent.Reason.Mouse:
            at = *self.viewport.to_image(event.pos().x(), event.pos().y()), 14.0 / self.viewport.scale
        if self.picture is not None:
            self.menu_wanted.emit(at, event.globalPos())

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        if self._fits and self.picture is not None:
            self.actual_pixels(event.position())
        else:
            self.fit()

    def focusInEvent(self, event: QFocusEvent) -> None:
        """The edge that shows the focus is for those who go by the keyboard."""
        self._focus_by_key = event.reason() in (Qt.FocusReason.TabFocusReason, Qt.FocusReason.BacktabFocusReason)
        super().focusInEvent(event)

    def leaveEvent(self, event: object) -> None:
        self.hovered.emit(None)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in PANS_PX and self.picture is not None:
            self._fits = False
            self._look(self.viewport.panned(*PANS_PX[Qt.Key(event.key())]))
        else:
            super().keyPressEvent(event)

    def _hover(self, position: QPointF) -> None:
        x, y = self.viewport.to_image(position.x(), position.y())
        size = self.picture
        inside = size is not None and -0.5 <= x < size.width - 0.5 and -0.5 <= y < size.height - 0.5
        self.hovered.emit((x, y) if inside else None)
