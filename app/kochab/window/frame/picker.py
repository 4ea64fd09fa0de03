"""What is under the cursor, and the star, object or place that was picked, with its card."""

from datetime import UTC, datetime

import numpy as np
from PySide6.QtCore import QObject, Signal

from kochab.core.solution import Solution
from kochab.sky.horizon import Horizon
from kochab.sky.layer import Mark
from kochab.window.frame.readout import readout
from kochab.window.frame.session import Session
from kochab.window.frame.workspace import Workspace
from kochab.window.image.object_card import ObjectCard, facts
from kochab.window.image.overlay import Overlay
from kochab.window.settings import WindowSettings

HOVER_PX = 10.0  # of the screen: so near, the cursor is on a star


class Picker(QObject):
    """Follows cursor and clicks in the image of the open frame."""

    hovered = Signal(str)  # what is under the cursor

    def __init__(self, session: Session, panes: Workspace, overlay: Overlay, settings: WindowSettings) -> None:
        super().__init__(panes)
        self._session, self._panes, self.overlay, self._settings = session, panes, overlay, settings
        self.card = ObjectCard(panes.view)
        panes.view.hovered.connect(self._hovered)
        panes.view.clicked.connect(self._clicked)
        session.solving.connect(self.card.hide)
        for begun in (session.opening, session.streaming):
            begun.connect(self._begin)

    def find(self, x: float, y: float, reach: float) -> None:
        """Show a place of the frame, px, in the middle, and pick what is there."""
        overlay, solution = self.overlay, self.overlay.solution
        if solution is None:
            return
        self._panes.view.centre(x, y)
        marks = () if overlay.sky is None else overlay.sky.marks
        nearest = min(marks, key=lambda mark: float(np.hypot(*(mark.xy - (x, y)))), default=None)
        near = nearest is not None and np.hypot(*(nearest.xy - (x, y))) <= reach
        self._pick(nearest if near else Mark("", 0, np.array([x, y]), 0.0, 0.0, "", ""), solution, card=bool(near))

    def mark_at(self, at: tuple[float, float, float] | None) -> Mark | None:
        """Mark what is at a place of the solved frame, px, with reach, or the place itself; None: what is picked."""
        overlay, solution = self.overlay, self.overlay.solution
        if solution is None or overlay.tables is None:
            return None
        centre = (solution.camera.width - 1) / 2.0, (solution.camera.height - 1) / 2.0
        there = overlay.picked if at is None else overlay.mark_at(*at)
        mark = there or Mark("", 0, np.array(centre if at is None else at[:2]), 0.0, 0.0, "", "")
        self._pick(mark, solution, card=at is None and there is not None and bool(mark.kind))
        return mark

    def _begin(self, _: object) -> None:
        """Another frame: nothing of it is under the cursor or picked yet."""
        self.card.hide()
        self._hovered(None)

    def _hovered(self, at: tuple[float, float] | None) -> None:
        known = self._session.known
        text = ""
        if at is not None and known.frame is not None:
            style, site = self._settings.angle_style, self._settings.site
            text = readout(known.frame, known.solution, *at, style=style, site=site)
            mark = self.overlay.mark_at(*at, HOVER_PX / self._panes.view.viewport.scale)
            text = f"{mark.text}    {text}" if mark is not None else text
        self.hovered.emit(text)

    def _clicked(self, x: float, y: float, reach: float) -> None:
        solution = self._session.known.solution
        if solution is None or not solution.named:
            return
        away = np.array([np.hypot(s.x - x, s.y - y) for s in solution.named])
        nearest = int(away.argmin())
        self._panes.stars.select(nearest if away[nearest] <= reach else None)
        self._pick(self.overlay.mark_at(x, y, reach), solution)

    def _pick(self, mark: Mark | None, solution: Solution, card: bool = True) -> None:
        """Show the card of a star or an object, or none."""
        self.overlay.picked, tables = mark, self.overlay.tables
        self.card.setVisible(mark is not None and card)
        if mark is not None and card and tables is not None:
            site = self._settings.site
            horizon = None if site is None else Horizon(site, datetime.now(UTC))
            self.card.show_facts(mark.text, facts(tables, mark, solution, self._settings.angle_style, horizon))
        self._panes.view.update()
