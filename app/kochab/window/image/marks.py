"""The marks over a frame, one function a kind; sizes are screen px."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter, QPainterPath, QPen, QPixmap

from kochab.core.arrays import Floats
from kochab.core.solution import Solution
from kochab.frames.sky_grid import GridLine
from kochab.window.image.screen_image import LabelSpace, Viewport
from kochab.window.image.sky_grid import label
from kochab.window.themes import Colours, translucent

DETECTED_PX, IDENTIFIED_PX = 4.5, 8.0  # radii
MOST_CIRCLES = 4000
CROWDED = 300  # from this many circles on they are drawn fainter and smaller
MOST_NAMES, MOST_NUMBERS = 60, 25  # labels of stars with a name, and with only a number
AROUND_X, AROUND_Y = 3.0, 1.0  # of the dark background beside and above its text


@dataclass(slots=True)
class Brush:
    """What every mark needs to paint itself."""

    painter: QPainter
    view: Viewport
    colours: Colours
    space: LabelSpace

    def pen(self, colour: str, width: float, alpha: int = 255) -> None:
        self.painter.setPen(QPen(translucent(colour, alpha), width))
        self.painter.setBrush(Qt.BrushStyle.NoBrush)

    def text(self, at: QPointF, text: str, colour: str) -> None:
        """Text on a dark background, unless its place is taken."""
        ratio = self.painter.device().devicePixelRatio()
        font = self.painter.font().toString()
        box, picture = _words(text, font, colour, self.colours.halo, ratio)
        placed = self.space.place(box.translated(at))
        if placed is not None:
            self.painter.drawPixmap(placed.topLeft() - QPointF(AROUND_X, AROUND_Y), picture)

    def width(self, text: str) -> float:
        return QFontMetricsF(self.painter.font()).horizontalAdvance(text)


@lru_cache(maxsize=512)
def _words(text: str, font: str, colour: str, halo: str, ratio: float) -> tuple[QRectF, QPixmap]:
    """The box of a text from its base line, and the text drawn on its dark background."""
    written = QFont()
    written.fromString(font)
    box = QFontMetricsF(written).boundingRect(text)
    ground = box.adjusted(-AROUND_X, -AROUND_Y, AROUND_X, AROUND_Y)
    picture = QPixmap(*(int(np.ceil(side * ratio)) for side in (ground.width(), ground.height())))
    picture.setDevicePixelRatio(ratio)
    picture.fill(translucent(halo, 165))
    painter = QPainter(picture)
    painter.setFont(written)
    painter.setPen(QColor(colour))
    painter.drawText(-ground.topLeft(), text)
    painter.end()
    return box, picture


def circles(brush: Brush, xy: Floats, colour: str, radius: float, width: float) -> None:
    """A circle around each image place (N, 2) in sight."""
    at = brush.view.to_screen(xy[:MOST_CIRCLES])
    at = at[in_sight(at, brush.view)]
    ratio = brush.painter.device().devicePixelRatio()
    alpha, size = (235, 1.0) if len(at) < CROWDED else (170, 0.65)
    ring = _ring(colour, alpha, size * radius, width, ratio)
    half = ring.deviceIndependentSize().width() / 2.0
    for x, y in (at - half).tolist():
        brush.painter.drawPixmap(QPointF(x, y), ring)


@lru_cache(maxsize=32)
def _ring(colour: str, alpha: int, radius: float, width: float, ratio: float) -> QPixmap:
    """A circle drawn once: copying it takes a twentieth of the time."""
    size = int(np.ceil(2 * radius + width)) + 2
    picture = QPixmap(round(size * ratio), round(size * ratio))
    picture.setDevicePixelRatio(ratio)
    picture.fill(Qt.GlobalColor.transparent)
    painter = QPainter(picture)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.setPen(QPen(translucent(colour, alpha), width))
    middle = picture.deviceIndependentSize().width() / 2.0
    painter.drawEllipse(QPointF(middle, middle), radius, radius)
    painter.end()
    return picture


def names(brush: Brush, solution: Solution, xy: Floats) -> None:
    """Names first, brightest first; then numbers while few of them are in sight."""
    at = brush.view.to_screen(xy)
    seen = sorted(np.flatnonzero(in_sight(at, brush.view)), key=lambda i: solution.stars[i].mag)
    named = [i for i in seen if solution.stars[i].name][:MOST_NAMES]
    rest = [i for i in seen if not solution.stars[i].name][: max(MOST_NUMBERS - len(named), 8)]
    for i in (*named, *rest):
        star = solution.stars[i]
        name(brush, star.name or star.id, at[i], brush.colours.identified)


def name(brush: Brush, text: str, at: Floats, colour: str) -> None:
    """One label beside its circle: to the right, or to the left where the widget ends."""
    away = IDENTIFIED_PX + 4
    x = float(at[0]) + away
    width = brush.width(text)
    if x + width > brush.view.width - 6:
        x = float(at[0]) - away - width
    brush.text(QPointF(x, at[1] + 4), text, colour)


def selection(brush: Brush, at: Floats, text: str) -> None:
    """Four ticks around a screen place, and its label."""
    brush.pen(brush.colours.selected, 2.0)
    inner, outer = IDENTIFIED_PX + 3, IDENTIFIED_PX + 11
    cross(brush, at[0], at[1], inner, outer)
    name(brush, text, at + np.array([6.0, -10.0]), brush.colours.selected)


def cross(brush: Brush, x: float, y: float, inner: float, outer: float) -> None:
    """Four ticks that leave the middle free."""
    for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        near = QPointF(x + dx * inner, y + dy * inner)
        brush.painter.drawLine(near, QPointF(x + dx * outer, y + dy * outer))


def sky_lines(brush: Brush, lines: list[GridLine], edges: QRectF) -> None:
    """The lines of the grid inside the frame's ``edges``."""
    brush.pen(brush.colours.grid, 1.0, 150)
    brush.painter.save()
    brush.painter.setClipRect(edges)
    for line in lines:
        brush.painter.drawPath(_path(brush.view.to_screen(line.xy)))
    brush.painter.restore()


def sky_labels(brush: Brush, lines: list[GridLine], edges: QRectF) -> None:
    """What each line is, where it enters the frame."""
    inside = edges.adjusted(2, 2, -2, -2)
    for line in lines:
        spot = _label_spot(brush.view.to_screen(line.xy), inside, line.kind)
        if spot is not None:
            brush.text(spot, label(line), brush.colours.grid_text)


def in_sight(xy: Floats, view: Viewport) -> NDArray[np.bool_]:
    """Which screen places (N, 2) the widget shows, with room for a circle."""
    x, y = xy[:, 0], xy[:, 1]
    return np.asarray((x > -20) & (y > -20) & (x < view.width + 20) & (y < view.height + 20))


def _path(xy: Floats) -> QPainterPath:
    path = QPainterPath()
    with np.errstate(invalid="ignore"):
        seen: list[bool] = np.all(np.abs(xy) <= 1e5, axis=1).tolist()
    pen_down = False
    for (x, y), near in zip(xy.tolist(), seen, strict=True):
        if near and pen_down:
            path.lineTo(x, y)
        elif near:
            path.moveTo(x, y)
        pen_down = near
    return path


def _label_spot(xy: Floats, edges: QRectF, kind: str) -> QPointF | None:
    """Where the text of a line starts: low for right ascension, far left for declination."""
    x, y = xy[:, 0], xy[:, 1]
    with np.errstate(invalid="ignore"):
        inside = (x > edges.left()) & (x < edges.right()) & (y > edges.top()) & (y < edges.bottom())
    if not inside.any():
        return None
    best = int(np.where(inside, y if kind == "ra" else -x, -np.inf).argmax())
    return QPointF(x[best] + 4, min(y[best] - 4, edges.bottom() - 6))
