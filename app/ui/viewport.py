"""Where the image lies on the screen."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
SMALLEST, LARGEST = 1.0 / 64.0, 48.0


@dataclass(frozen=True, slots=True)
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
        f = scale / self.scale
        return replace(self, scale=scale, dx=x - (x - self.dx) * f, dy=y - (y - self.dy) * f)

    def panned(self, dx: float, dy: float) -> "Viewport":
        """Moved by screen pixels."""
        return replace(self, dx=self.dx + dx, dy=self.dy + dy)

    def fitted(self, width: int, height: int) -> "Viewport":
        """The whole of a width x height image, centred, with a small margin."""
        margin = 0.98
        scale = margin * min(self.width / max(width, 1), self.height / max(height, 1))
        scale = min(max(scale, SMALLEST), LARGEST)
        return self.centred_on((width - 1) / 2, (height - 1) / 2, scale)

    def centred_on(self, x: float, y: float, scale: float | None = None) -> "Viewport":
        """Image pixel (x, y) in the middle of the widget."""
        s = self.scale if scale is None else scale
        return replace(
            self,
            scale=s,
            dx=self.width / 2 - (x + 0.5) * s,
            dy=self.height / 2 - (y + 0.5) * s,
        )

    def held(self, width: int, height: int) -> "Viewport":
        """Moved back so that at least a quarter of the widget, or of the image, stays in sight."""
        w, h = width * self.scale, height * self.scale
        mx, my = min(self.width / 4, w / 2), min(self.height / 4, h / 2)
        dx = min(max(self.dx, mx - w), self.width - mx)
        dy = min(max(self.dy, my - h), self.height - my)
        return replace(self, dx=dx, dy=dy)
