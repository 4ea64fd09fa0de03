"""Small pictures of the sample frames, made in a thread while the welcome page is already there."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtGui import QColor, QIcon, QImage, QPainter, QPixmap

from app.core.progress import Progress, Task
from app.ui.job import Job

if TYPE_CHECKING:
    from app.ui.main_window import MainWindow

WIDTH, HEIGHT, GAP = 96, 64, 10


class Thumbnails(QObject):
    """Emits ``made`` with each file's path and its picture (H, W, 3), uint8."""

    made = Signal(object, object)

    def __init__(self, paths: list[Path], window: "MainWindow") -> None:
        super().__init__(window)
        self.job = Job(self._make(paths), "thumbnails", self)
        self.job.succeeded.connect(self._tell)
        window.closing.connect(self._close)

    def _close(self) -> None:
        self.job.abandon()
        self.job.join(3.0)

    def _make(self, paths: list[Path]) -> Task[dict[Path, np.ndarray]]:
        pictures = {}
        for i, path in enumerate(paths):
            yield Progress("thumbnails", i / len(paths))
            pictures[path] = thumbnail(path)
        return pictures

    def _tell(self, pictures: dict[Path, np.ndarray]) -> None:
        for path, picture in pictures.items():
            self.made.emit(path, picture)


def thumbnail(path: Path) -> np.ndarray:
    """The stretched frame in a small box (HEIGHT * 2, WIDTH * 2, 3), uint8; black when unreadable.

    The brightest pixel of each cell is kept, so that stars survive the shrinking.
    """
    from app.core.errors import KochabError
    from app.frames import read_frame
    from app.frames.stretch import apply, debayer_preview, stretch_parameters

    box = np.zeros((2 * HEIGHT, 2 * WIDTH, 3), dtype=np.uint8)
    try:
        frame = read_frame(path)
    except KochabError:
        return box
    shown = debayer_preview(frame, 2) if frame.bayer or frame.colour is not None else frame.pixels
    factor = max(1, shown.shape[0] // box.shape[0], shown.shape[1] // box.shape[1])
    shown = shown[: shown.shape[0] // factor * factor, : shown.shape[1] // factor * factor]
    cells = shown.reshape(
        shown.shape[0] // factor, factor, shown.shape[1] // factor, factor, *shown.shape[2:]
    )
    grey = apply(cells.max(axis=(1, 3)), stretch_parameters(shown))
    grey = grey[..., None] if grey.ndim == 2 else grey
    h, w = min(box.shape[0], grey.shape[0]), min(box.shape[1], grey.shape[1])
    top, left = (grey.shape[0] - h) // 2, (grey.shape[1] - w) // 2
    y, x = (box.shape[0] - h) // 2, (box.shape[1] - w) // 2
    box[y : y + h, x : x + w] = grey[top : top + h, left : left + w]
    return box


def as_icon(picture: np.ndarray, red: bool) -> QIcon:
    """The picture as an icon with room before the text; ``red`` leaves red light alone."""
    kept = np.ascontiguousarray(picture)
    h, w = kept.shape[:2]
    image = QImage(kept.data, w, h, 3 * w, QImage.Format.Format_RGB888)
    pixmap = QPixmap(w + 2 * GAP, h)
    pixmap.fill(Qt.GlobalColor.transparent)
    painter = QPainter(pixmap)
    painter.drawImage(0, 0, image)
    if red:
        painter.setCompositionMode(QPainter.CompositionMode.CompositionMode_Multiply)
        painter.fillRect(0, 0, w, h, QColor(255, 0, 0))
    painter.end()
    pixmap.setDevicePixelRatio(2.0)
    return QIcon(pixmap)
