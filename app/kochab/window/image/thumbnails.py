"""Small pictures of frames, for buttons and the film strip."""

from pathlib import Path

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QImage, QPainter, QPixmap

from kochab.core.frame import Frame
from kochab.core.progress import Progress, Task

WIDTH, HEIGHT, GAP = 96, 64, 10


def thumbnails(paths: list[Path]) -> Task[dict[Path, np.ndarray]]:
    """A small picture of each file, see :func:`thumbnail`."""
    made = {}
    for i, path in enumerate(paths):
        yield Progress("thumbnails", i / len(paths))
        made[path] = thumbnail(path)
    return made


def thumbnail(path: Path) -> np.ndarray:
    """The stretched frame in a box (HEIGHT * 2, WIDTH * 2, 3), uint8; black when unreadable.

    Each cell keeps its brightest pixel, so that stars survive the shrinking.
    """
    from kochab.core.errors import KochabError
    from kochab.frames import read_frame

    try:
        return small_picture(read_frame(path))
    except KochabError:
        return np.zeros((2 * HEIGHT, 2 * WIDTH, 3), dtype=np.uint8)


def small_picture(frame: Frame) -> np.ndarray:
    """The same of a frame that was read."""
    from kochab.frames.stretch import apply, debayer_preview, stretch_parameters

    box = np.zeros((2 * HEIGHT, 2 * WIDTH, 3), dtype=np.uint8)  # for screens of 200 %
    shown = debayer_preview(frame, 2) if frame.bayer or frame.colour is not None else frame.pixels
    factor = max(1, shown.shape[0] // box.shape[0], shown.shape[1] // box.shape[1])
    shown = shown[: shown.shape[0] // factor * factor, : shown.shape[1] // factor * factor]
    cells = shown.reshape(shown.shape[0] // factor, factor, shown.shape[1] // factor, factor, *shown.shape[2:])
    grey = apply(cells.max(axis=(1, 3)), stretch_parameters(shown))
    grey = grey[..., None] if grey.ndim == 2 else grey
    h, w = min(box.shape[0], grey.shape[0]), min(box.shape[1], grey.shape[1])
    top, left = (grey.shape[0] - h) // 2, (grey.shape[1] - w) // 2
    y, x = (box.shape[0] - h) // 2, (box.shape[1] - w) // 2
    box[y : y + h, x : x + w] = grey[top : top + h, left : left + w]
    return box


def reduced(frame: Frame, most_px: int) -> np.ndarray:
    """The whole stretched frame (H, W, 3), uint8, at most so many px wide or high; each cell its brightest pixel."""
    from kochab.frames.stretch import apply, debayer_preview, stretch_parameters

    shown = debayer_preview(frame, 2) if frame.bayer or frame.colour is not None else frame.pixels
    factor = max(1, -(-max(shown.shape[:2]) // most_px))
    shown = shown[: max(1, shown.shape[0] // factor) * factor, : max(1, shown.shape[1] // factor) * factor]
    rows, columns = (np.arange(0, side, factor) for side in shown.shape[:2])
    cells = np.maximum.reduceat(np.maximum.reduceat(shown, rows, axis=0), columns, axis=1)
    bright = apply(cells, stretch_parameters(shown))
    return np.broadcast_to(bright[..., None] if bright.ndim == 2 else bright, (*bright.shape[:2], 3))


def as_pixmap(picture: np.ndarray, red: bool, gap: int = 0) -> QPixmap:
    """The picture with ``gap`` px of room behind it, in red light alone if ``red``."""
    # QImage is told that a row has 3 * w bytes.
    kept = np.ascontiguousarray(picture)
    h, w = kept.shape[:2]
    image = QImage(kept.data, w, h, 3 * w, QImage.Format.Format_RGB888)
    pixmap = QPixmap(w + 2 * gap, h)
    pixmap.fill(Qt.GlobalColor.transparent)
    painter = QPainter(pixmap)
    painter.drawImage(0, 0, image)
    if red:
        painter.setCompositionMode(QPainter.CompositionMode.CompositionMode_Multiply)
        painter.fillRect(0, 0, w, h, QColor(255, 0, 0))
    painter.end()
    pixmap.setDevicePixelRatio(2.0)
    return pixmap
