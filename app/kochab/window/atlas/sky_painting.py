"""What is painted into the sky of a chart: the open frame, bent as its lens bent it, stars, the Milky Way's glow."""

from functools import lru_cache
from math import ceil, isfinite

import numpy as np
from PySide6.QtCore import QPointF, QRect, QRectF, Qt
from PySide6.QtGui import QColor, QImage, QPainter, QPixmap, QPolygonF, QTransform

from kochab.core.arrays import Floats
from kochab.core.solution import Solution
from kochab.sky.milky_way import MilkyWay
from kochab.window.image.screen_image import Viewport

CELLS = 10  # along each side; within one the chart's projection and the lens bend by less than a pixel
LEAST_PX = 24.0  # of the chart: smaller, the outline says enough
GLOW_STEP_DEG, GLOW_STEP_PX = 0.9, (5.0, 48.0)
"""Between samples of the glow, which is smoothed by 1.8 degrees; px of the widget at least and at most."""
GLOW_MOST = 0.22  # how bright its brightest cloud is
PHASES = 2  # places of a star within a pixel of the screen, along each side
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


def paint_glow(painter: QPainter, glow: MilkyWay, sheet: Solution, room: QRect, inks: tuple[QColor, QColor]) -> None:
    """Paint the sky with the Milky Way as faint light; both at once, for blending takes longer.

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
    inks : tuple[QColor, QColor]
        Of the sky, and of its light.
    """
    step = float(np.clip(sheet.camera.focal_px * np.radians(GLOW_STEP_DEG), *GLOW_STEP_PX))
    wide, high = max(2, round(room.width() / step)), max(2, round(room.height() / step))
    x = (np.arange(wide) + 0.5) * room.width() / wide - 0.5
    y = (np.arange(high) + 0.5) * room.height() / high - 0.5
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    share = GLOW_MOST * glow.brightness(sheet.sky_at(places)).reshape(high, wide)
    dark, light = (np.array([ink.red(), ink.green(), ink.blue()], dtype=np.float64) for ink in inks)
    pixels = np.full((high, wide), 0xFF000000, np.uint32)
    for k, part in enumerate(np.rint(dark + share[..., None] * (light - dark)).astype(np.uint32).transpose(2, 0, 1)):
        pixels |= part << np.uint32(16 - 8 * k)
    image = QImage(pixels.data, wide, high, 4 * wide, QImage.Format.Format_RGB32)
    # Smoothed to every other pixel: to every one takes twice as long, and nobody sees it in so soft a light.
    ratio = painter.device().devicePixelRatio() / 2.0
    soft = _paper(round(room.width() * ratio), round(room.height() * ratio))
    smooth = QPainter(soft)
    smooth.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
    smooth.drawImage(soft.rect(), image)
    smooth.end()
    painter.save()
    painter.setCompositionMode(QPainter.CompositionMode.CompositionMode_Source)
    painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform, False)
    painter.drawImage(room, soft)
    painter.restore()


@lru_cache(maxsize=1)
def _paper(width: int, height: int) -> QImage:
    """An image to paint on, again and again: to have the memory of another takes a third of the time."""
    return QImage(width, height, QImage.Format.Format_RGB32)


def paint_stars(painter: QPainter, at: Floats, diameters: Floats, inks: list[str]) -> None:
    """Paint stars as discs, each a copy of one that was drawn before: drawing it takes four times as long.

    Parameters
    ----------
    painter : QPainter
        Of the chart.
    at : Floats
        Where (N, 2), px of the widget; NaN is left out.
    diameters : Floats
        How large (N,), px of the widget.
    inks : list[str]
        The colour of each.
    """
    ratio = painter.device().devicePixelRatio()
    steps = np.round(at * ratio * PHASES)  # between pixels of the screen
    whole = np.floor_divide(steps, PHASES)
    phases = steps - whole * PHASES
    stars = zip((whole / ratio).tolist(), phases.tolist(), diameters.tolist(), inks, strict=True)
    for (x, y), (across, down), diameter, ink in stars:
        if isfinite(x + y):
            disc, half = _disc(ink, diameter, across / PHASES, down / PHASES, ratio)
            painter.drawPixmap(QPointF(x - half, y - half), disc)


@lru_cache(maxsize=2048)
def _disc(ink: str, diameter: float, across: float, down: float, ratio: float) -> tuple[QPixmap, float]:
    """A disc and how far its middle is from the corner, px of the widget; ``across`` and ``down`` px of the screen."""
    half = ceil(diameter * ratio / 2.0) + 2
    picture = QPixmap(2 * half + 1, 2 * half + 1)
    picture.fill(Qt.GlobalColor.transparent)
    painter = QPainter(picture)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(QColor(ink))
    radius = diameter * ratio / 2.0
    painter.drawEllipse(QPointF(half + across, half + down), radius, radius)
    painter.end()
    picture.setDevicePixelRatio(ratio)
    return picture, half / ratio


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
