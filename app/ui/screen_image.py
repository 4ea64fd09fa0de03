"""The visible part of a picture as a QImage, made anew only when something changed."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QRectF
from PySide6.QtGui import QImage, qRgb

from app.ui.picture import Picture
from app.ui.ready_picture import ReadyPicture
from app.ui.stretch import Stretch
from app.ui.viewport import Viewport

RED_TABLE = [qRgb(i, 0, 0) for i in range(256)]


class ScreenImage:
    """Crops the right pyramid level to the screen and runs it through the look-up table."""

    def __init__(self) -> None:
        self.picture: Picture | ReadyPicture | None = None
        self._stretch = Stretch()
        self._colour = True
        self._red = False
        self._tables: list[NDArray[np.uint8]] = []  # mono, or red, green, blue
        self._key: object = None
        self._made: tuple[QImage, QRectF] | None = None
        self._pixels: NDArray[np.uint8] | None = None  # QImage borrows this memory

    def set_picture(self, picture: Picture | ReadyPicture | None) -> None:
        """Another picture."""
        self.picture = picture
        self._tables, self._made, self._key = [], None, None

    def set_look(self, stretch: Stretch, colour: bool, red: bool) -> None:
        """Another stretch or colouring."""
        self._stretch, self._colour, self._red = stretch, colour, red
        self._tables, self._key = [], None

    def render(self, viewport: Viewport, ratio: float) -> tuple[QImage, QRectF] | None:
        """The image and where it goes on the widget (logical px); None when none is in sight."""
        picture = self.picture
        if picture is None:
            return None
        if isinstance(picture, ReadyPicture):
            return picture.placed(viewport)
        key = (viewport, ratio)
        if key != self._key:
            self._made, self._key = self._render(picture, viewport, ratio), key
        return self._made

    def _render(
        self, picture: Picture, viewport: Viewport, ratio: float
    ) -> tuple[QImage, QRectF] | None:
        level = picture.level_for(viewport.scale * ratio)
        in_colour = self._colour and bool(picture.colour) and not self._red
        levels = picture.colour if in_colour else picture.mono
        level = min(level, len(levels) - 1)
        source, b = levels[level], 2**level
        x0, y0, x1, y1 = viewport.corners()
        c0, r0 = max(0, int((x0 + 0.5) // b)), max(0, int((y0 + 0.5) // b))
        c1 = min(source.shape[1], int((x1 + 0.5) // b) + 2)
        r1 = min(source.shape[0], int((y1 + 0.5) // b) + 2)
        if c1 <= c0 or r1 <= r0:
            return None
        image = self._to_image(picture, source[r0:r1, c0:c1], in_colour)
        s = viewport.scale * b
        target = QRectF(
            c0 * s + viewport.dx, r0 * s + viewport.dy, (c1 - c0) * s, (r1 - r0) * s
        )  # fmt: skip
        return image, target

    def _to_image(self, picture: Picture, crop: NDArray[Any], in_colour: bool) -> QImage:
        if not self._tables:
            shifts = picture.sky_shift if in_colour else (0.0,)
            self._tables = [picture.table(self._stretch, shift) for shift in shifts]
        pixels = np.empty(crop.shape, dtype=np.uint8)
        if in_colour:
            for c, table in enumerate(self._tables):
                pixels[..., c] = table[crop[..., c]]
        else:
            np.take(self._tables[0], crop, out=pixels, mode="clip")
        self._pixels = pixels
        h, w = crop.shape[:2]
        if in_colour:
            return QImage(pixels.data, w, h, 3 * w, QImage.Format.Format_RGB888)
        if self._red:
            image = QImage(pixels.data, w, h, w, QImage.Format.Format_Indexed8)
            image.setColorTable(RED_TABLE)
            # Scaling an indexed image would not interpolate; the conversion owns its memory.
            return image.convertToFormat(QImage.Format.Format_RGB32)
        return QImage(pixels.data, w, h, w, QImage.Format.Format_Grayscale8)
