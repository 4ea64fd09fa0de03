"""A frame that another thread has made ready to be put on the screen as it is."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QRectF
from PySide6.QtGui import QImage

from app.ui.stretch import Stretch
from app.ui.viewport import Viewport


@dataclass(frozen=True, slots=True, eq=False)
class ReadyPicture:
    """``image`` is a ``width`` x ``height`` px frame, stretched and perhaps binned.

    ``histogram`` and ``auto`` are as those of :class:`app.ui.picture.Picture`. ``memory`` is what
    the image borrows.
    """

    width: int
    height: int
    image: QImage
    auto: Stretch
    histogram: NDArray[np.float64]
    memory: NDArray[np.uint32]

    def placed(self, viewport: Viewport) -> tuple[QImage, QRectF]:
        """The image and where it goes on the widget, logical px."""
        scale = viewport.scale
        binned = -(-self.width // self.image.width())  # the last odd column was dropped
        wide, high = self.image.width() * binned * scale, self.image.height() * binned * scale
        return self.image, QRectF(viewport.dx, viewport.dy, wide, high)
