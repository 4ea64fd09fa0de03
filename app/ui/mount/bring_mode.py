"""Bring a star here: two clicks in the frame, the star and then the place."""

import numpy as np
from PySide6.QtCore import QObject, Qt, Signal

from app.ui.mount.asks import Asks
from app.ui.mount.desk import Desk
from app.ui.services import Services

FIRST = "Click the star in the frame; Esc gives it up. Twice on the star brings it to the middle."
SECOND = "Now click where it shall go, or on it again for the middle of the frame."
NEAR_PX = 12.0


class BringMode(QObject):
    """Listens to the frame's clicks while it is on; a star that was identified is snapped to."""

    said = Signal(str, str)  # a sentence and its role

    def __init__(self, services: Services, desk: Desk, asks: Asks) -> None:
        super().__init__(desk)
        self._view, self._lookout, self._asks = services.view, desk.lookout, asks
        desk.stopping.connect(self.end)
        self._on = False
        self._star: tuple[float, float] | None = None
        services.session.opened.connect(lambda _: self.end())

    @property
    def on(self) -> bool:
        """Whether clicks are waited for."""
        return self._on

    def begin(self) -> None:
        """Wait for the first click."""
        self.end()
        self._on, self._star = True, None
        self._view.clicked.connect(self._clicked)
        self._view.setCursor(Qt.CursorShape.CrossCursor)
        self.said.emit(FIRST, "")

    def end(self) -> None:
        """Wait no more."""
        if self._on:
            self._view.clicked.disconnect(self._clicked)
            self._view.unsetCursor()
        self._on = False

    def _clicked(self, x: float, y: float, reach_px: float) -> None:
        if self._star is None:
            self._star = self._snapped(x, y, reach_px)
            self.said.emit(SECOND, "")
            return
        star, here = self._star, (x, y)
        self.end()
        solution = self._lookout.solution
        if solution is None:
            return
        if np.hypot(x - star[0], y - star[1]) <= max(reach_px, NEAR_PX):
            here = ((solution.camera.width - 1) / 2.0, (solution.camera.height - 1) / 2.0)
        self._asks.bring(star, here)

    def _snapped(self, x: float, y: float, reach_px: float) -> tuple[float, float]:
        solution = self._lookout.solution
        if solution is None or not solution.stars:
            return x, y
        nearest = min(solution.stars, key=lambda s: np.hypot(s.x - x, s.y - y))
        near = np.hypot(nearest.x - x, nearest.y - y) <= reach_px
        return (nearest.x, nearest.y) if near else (x, y)
