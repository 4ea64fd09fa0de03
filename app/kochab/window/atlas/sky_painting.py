"""What is painted into the sky of a chart: the open frame, bent as its lens bent it, and the glow of the Milky Way."""

import numpy as np
from PySide6.QtCore import QPointF, QRect, QRectF
from PySide6.QtGui import QColor, QImage, QPainter, QPolygonF, QTransform

from kochab.core.arrays import Floats
from kochab.core.solution import Solution
from kochab.sky.milky_way import MilkyWay
from kochab.window.image.screen_image import Viewport

CELLS = 10  # along each side; within one the chart's projection and the lens bend by less than a pixel
LEAST_PX = 24.0  # of the chart: smaller, the outline says enough
GLOW_STEP_DEG, GLOW_STEP_PX = 0.9, (5.0, 48.0)
"""Between samples of the glow, which is smoothed by 1.8 degrees; px of the widget at least and at most."""
GLOW_MOST = 0.22  # how bright its brightest cloud is
OVERLAP_PX = 0.7  # of the image, by which a cell reaches into the next: no seams


def paint_frame(painter: QPainter, image: QImage, frame: Solution, sheet: Solution, view: Viewport) -> None:
    """Paint the image of a solved frame where it lies on a chart.

    Parameters
    ----------
    painter : QPainter
        Of the chart.
    image : QImage
        The whole frame, of any size.
    frame : Solution
        Where the frame points.
    sheet : Solution
        The chart, as a solved frame.
    view : Viewport
        From the chart's pixels to the widget.
    """
    corners = _corners(frame, sheet, view)
    seen = corners[np.isfinite(corners).all(axis=2)]
    if not len(seen) or np.ptp(seen, axis=0).max() < LEAST_PX:
        return
    wide, high = image.width() / CELLS, image.height() / CELLS
    painter.save()
    painter.setRenderHint(QPainter.RenderHint.Antialiasing, False)
    painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
    for row in range(CELLS):
        for column in range(CELLS):
            around = corners[[row, row, row + 1, row + 1], [column, column + 1, column + 1, column]]
            cell, way = QRectF(column * wide, row * high, wide, high), QTransform()
            if not np.isfinite(around).all() or not QTransform.quadToQuad(_box(cell), _polygon(around), way):
                continue
            painter.save()
            painter.setTransform(way, True)
            grown = cell.adjusted(-OVERLAP_PX, -OVERLAP_PX, OVERLAP_PX, OVERLAP_PX) & QRectF(image.rect())
            painter.drawImage(grown, image, grown)
            painter.restore()
    painter.restore()


def paint_glow(painter: QPainter, glow: MilkyWay, sheet: Solution, room: QRect, ink: QColor) -> None:
    """Paint the Milky Way as faint light.

    Parameters
    ----------
    painter : QPainter
        Of the chart.
    glow : MilkyWay
        How bright it is where.
    sheet : Solution
        The chart, as a solved frame.
    room : QRect
        The widget.
    ink : QColor
        Of its light.
    """
    step = float(np.clip(sheet.camera.focal_px * np.radians(GLOW_STEP_DEG), *GLOW_STEP_PX))
    wide, high = max(2, round(room.width() / step)), max(2, round(room.height() / step))
    x = (np.arange(wide) + 0.5) * room.width() / wide - 0.5
    y = (np.arange(high) + 0.5) * room.height() / high - 0.5
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    share = GLOW_MOST * glow.brightness(sheet.sky_at(places)).reshape(high, wide)
    pixels = np.empty((high, wide, 4), np.uint8)
    for k, light in enumerate((ink.red(), ink.green(), ink.blue(), 255)):
        pixels[..., k] = np.rint(share * light)  # premultiplied
    image = QImage(pixels.data, wide, high, 4 * wide, QImage.Format.Format_RGBA8888_Premultiplied)
    painter.save()
    painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
    painter.drawImage(room, image)
    painter.restore()


def _corners(frame: Solution, sheet: Solution, view: Viewport) -> Floats:
    """The corners of the cells on the widget (CELLS + 1, CELLS + 1, 2); NaN behind the chart."""
    x = np.linspace(-0.5, frame.camera.width - 0.5, CELLS + 1)
    y = np.linspace(-0.5, frame.camera.height - 0.5, CELLS + 1)
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    return np.asarray(view.to_screen(sheet.pixels_of(frame.sky_at(places)))).reshape(CELLS + 1, CELLS + 1, 2)


def _box(cell: QRectF) -> QPolygonF:
    return QPolygonF([cell.topLeft(), cell.topRight(), cell.bottomRight(), cell.bottomLeft()])


def _polygon(corners: Floats) -> QPolygonF:
    return QPolygonF([QPointF(x, y) for x, y in corners.tolist()])
