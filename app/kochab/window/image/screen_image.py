"""The visible part of a frame as a QImage, where it lies on the screen, and where labels have room."""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QRectF
from PySide6.QtGui import QImage

from kochab.core.arrays import Array, Floats
from kochab.core.values import frozen
from kochab.window.image.frame_image import FrameImage, ScreenStretch

SMALLEST, LARGEST = 1.0 / 64.0, 48.0  # px of the screen for one of the image


@frozen
class Viewport:
    """``screen = (pixel + 0.5) * scale + offset`` in logical screen pixels.

    ``width`` and ``height`` are those of the widget; the half brings pixel (0, 0), the centre of
    the first pixel, to where it is drawn.
    """

    width: int
    height: int
    scale: float = 1.0
    dx: float = 0.0
    dy: float = 0.0

    def to_screen(self, xy: Floats) -> Floats:
        """Screen positions (N, 2) of image pixels (N, 2)."""
        return np.asarray((np.asarray(xy) + 0.5) * self.scale + (self.dx, self.dy))

    def to_image(self, x: float, y: float) -> tuple[float, float]:
        """Image pixel of a screen position."""
        return (x - self.dx) / self.scale - 0.5, (y - self.dy) / self.scale - 0.5

    def corners(self) -> tuple[float, float, float, float]:
        """Image pixels (x0, y0, x1, y1) of the widget's corners."""
        return (*self.to_image(0.0, 0.0), *self.to_image(self.width, self.height))

    def zoomed(self, factor: float, x: float, y: float) -> "Viewport":
        """Scaled by ``factor`` with the image held still under screen position (x, y)."""
        scale = min(max(self.scale * factor, SMALLEST), LARGEST)
        f = scale / self.scale  # what the limits leave of the factor
        return replace(self, scale=scale, dx=x - (x - self.dx) * f, dy=y - (y - self.dy) * f)

    def panned(self, dx: float, dy: float) -> "Viewport":
        return replace(self, dx=self.dx + dx, dy=self.dy + dy)

    def fitted(self, width: int, height: int) -> "Viewport":
        """The whole of a width x height image, centred, with a small margin."""
        scale = 0.98 * min(self.width / max(width, 1), self.height / max(height, 1))
        scaled = replace(self, scale=min(max(scale, SMALLEST), LARGEST))
        return scaled.centred_on((width - 1) / 2, (height - 1) / 2)

    def centred_on(self, x: float, y: float) -> "Viewport":
        """Image pixel (x, y) in the middle of the widget."""
        return replace(self, dx=self.width / 2 - (x + 0.5) * self.scale, dy=self.height / 2 - (y + 0.5) * self.scale)

    def held(self, width: int, height: int) -> "Viewport":
        """Moved back so that at least a quarter of the widget, or of the image, stays in sight."""
        w, h = width * self.scale, height * self.scale
        mx, my = min(self.width / 4, w / 2), min(self.height / 4, h / 2)
        dx = min(max(self.dx, mx - w), self.width - mx)
        dy = min(max(self.dy, my - h), self.height - my)
        return replace(self, dx=dx, dy=dy)


@frozen(eq=False)
class RenderedFrame:
    """A ``width`` x ``height`` px frame that another thread has stretched and perhaps binned.

    ``histogram`` and ``auto`` as in :class:`FrameImage`; ``memory`` is what ``image`` borrows.
    """

    width: int
    height: int
    image: QImage
    auto: ScreenStretch
    histogram: NDArray[np.float64]
    memory: NDArray[np.uint32]

    def placed(self, viewport: Viewport) -> tuple[QImage, QRectF]:
        """The image and where it goes on the widget, logical px."""
        scale = viewport.scale
        binned = -(-self.width // self.image.width())  # the last odd column was dropped
        wide, high = self.image.width() * binned * scale, self.image.height() * binned * scale
        return self.image, QRectF(viewport.dx, viewport.dy, wide, high)


OPAQUE = 0xFF000000
GREY, RED, GREEN, BLUE = 0x010101, 0x010000, 0x000100, 0x000001
"""What one step of brightness adds to 0xffRRGGBB."""

Planes = tuple[Array, ...]
Parts = tuple[tuple[int, float], ...]


def coloured(planes: Planes, stretch: ScreenStretch, span: tuple[float, float], parts: Parts) -> NDArray[np.uint32]:
    """0xffRRGGBB (H, W) of stored values.

    Parameters
    ----------
    planes : Planes
        Each (H, W), uint8 or uint16.
    stretch : ScreenStretch
        From values to brightness.
    span : tuple[float, float]
        The values that the stretch calls 0 and 1.
    parts : Parts
        For each plane its light, as :data:`GREY`, and how far it is too high.
    """
    made = tables(planes[0].dtype, stretch, span, parts)
    first, *others = (np.take(table, plane, mode="clip") for table, plane in zip(made, planes, strict=True))
    for other in others:
        # Each light has a byte of its own, so that "or" adds them in place.
        first |= other
    return np.asarray(first)


@lru_cache(maxsize=4)
def tables(
    kind: np.dtype[Any], stretch: ScreenStretch, span: tuple[float, float], parts: Parts
) -> tuple[NDArray[np.uint32], ...]:
    """A look-up table for each of ``parts``; the sum of their values is the colour of a pixel.

    Parameters
    ----------
    kind : np.dtype[Any]
        Of the stored values: uint8 or uint16.
    stretch : ScreenStretch
        From values to brightness.
    span : tuple[float, float]
        The values that the stretch calls 0 and 1.
    parts : Parts
        For each plane its light and how far it is too high.
    """
    levels = 256 if kind == np.uint8 else 65536
    made = []
    for number, (light, shift) in enumerate(parts):
        bright = stretch.table(levels, span[0] + shift, span[1] + shift).astype(np.uint32) * np.uint32(light)
        # One of the tables makes the pixel opaque.
        made.append(bright + np.uint32(0 if number else OPAQUE))
    return tuple(made)


class ScreenImage:
    """Crops the right pyramid level to the screen and applies the look-up table."""

    def __init__(self) -> None:
        self.picture: FrameImage | RenderedFrame | None = None
        self._stretch, self._colour, self._red = ScreenStretch(), True, False
        self._key: object = None
        self._made: tuple[QImage, QRectF] | None = None
        self._pixels: NDArray[np.uint32] | None = None  # QImage borrows this memory

    def set_picture(self, picture: FrameImage | RenderedFrame | None) -> None:
        self.picture = picture
        self._made, self._key = None, None

    def set_look(self, stretch: ScreenStretch, colour: bool, red: bool) -> None:
        self._stretch, self._colour, self._red = stretch, colour, red
        self._key = None

    def render(self, viewport: Viewport, ratio: float) -> tuple[QImage, QRectF] | None:
        """The image and where it goes on the widget (logical px); None when none is in sight."""
        picture = self.picture
        if picture is None:
            return None
        if isinstance(picture, RenderedFrame):
            return picture.placed(viewport)
        if (key := (viewport, ratio)) != self._key:
            self._made, self._key = self._render(picture, viewport, ratio), key
        return self._made

    def _render(self, picture: FrameImage, viewport: Viewport, ratio: float) -> tuple[QImage, QRectF] | None:
        level = picture.level_for(viewport.scale * ratio)
        in_colour = self._colour and bool(picture.colour) and not self._red
        levels = picture.colour if in_colour else picture.mono
        # The colours' pyramid may have fewer levels than the mono one.
        level = min(level, len(levels) - 1)
        source, b = levels[level], 2**level
        x0, y0, x1, y1 = viewport.corners()
        c0, r0 = max(0, int((x0 + 0.5) // b)), max(0, int((y0 + 0.5) // b))
        # One more than the last whole pixel, which is seen in part.
        c1 = min(source.shape[1], int((x1 + 0.5) // b) + 2)
        r1 = min(source.shape[0], int((y1 + 0.5) // b) + 2)
        if c1 <= c0 or r1 <= r0:
            return None
        image = self._to_image(picture, source[r0:r1, c0:c1], in_colour)
        s = viewport.scale * b
        target = QRectF(c0 * s + viewport.dx, r0 * s + viewport.dy, (c1 - c0) * s, (r1 - r0) * s)
        return image, target

    def _to_image(self, picture: FrameImage, crop: NDArray[Any], in_colour: bool) -> QImage:
        planes: Planes = (crop,)
        parts: Parts = ((RED if self._red else GREY, 0.0),)
        if in_colour:
            planes = tuple(crop[..., c] for c in range(3))
            parts = tuple(zip((RED, GREEN, BLUE), picture.sky_shift, strict=True))
        self._pixels = pixels = coloured(planes, self._stretch, (picture.low, picture.high), parts)
        high, wide = pixels.shape
        return QImage(pixels.data, wide, high, 4 * wide, QImage.Format.Format_RGB32)


class LabelSpace:
    """Keeps labels on a widget of ``width`` x ``height`` px from covering each other."""

    def __init__(self, width: int, height: int) -> None:
        self._edges = QRectF(2, 2, width - 4, height - 4)
        self.taken: list[QRectF] = []

    def place(self, box: QRectF) -> QRectF | None:
        """``box`` moved inside the widget, or None when its place is taken."""
        if not self._edges.intersects(box):
            return None
        e = self._edges
        x = min(max(box.left(), e.left() + 3), e.right() - box.width() - 3)
        y = min(max(box.top(), e.top() + 1), e.bottom() - box.height() - 1)
        box = QRectF(x, y, box.width(), box.height())
        grown = box.adjusted(-3, -2, 3, 2)
        if any(grown.intersects(other) for other in self.taken):
            return None
        self.taken.append(grown)
        return box
