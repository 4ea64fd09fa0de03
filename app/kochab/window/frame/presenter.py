"""Shows the session in the panes of the open frame, and passes on to it what a person does there."""

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from PySide6.QtCore import QObject, Signal

from kochab.core.frame import Frame
from kochab.core.progress import Progress
from kochab.core.solution import NoSolution, Solution
from kochab.sky.apparent import julian_years
from kochab.solver import UNKNOWN_YEAR
from kochab.text.angle_text import AngleStyle
from kochab.text.translation import tr
from kochab.window.frame.field import SkyField
from kochab.window.frame.session import Session
from kochab.window.frame.workspace import Workspace
from kochab.window.image.frame_image import FrameImage
from kochab.window.image.screen_image import RenderedFrame
from kochab.window.settings import WindowSettings


class Presenter(QObject):
    """Shows one :class:`Session` in one :class:`Workspace`: image, marks, card, solution and stars."""

    hints_wanted = Signal()  # the hints pane is to be shown

    def __init__(self, session: Session, panes: Workspace, field: SkyField, settings: WindowSettings) -> None:
        super().__init__(panes)
        self.session, self.panes, self._field, self._settings = session, panes, field, settings
        self.overlay = field.overlay
        panes.view.marks, self.overlay.covered = self.overlay.paint, panes.covered
        self._use_style(settings.angle_style)
        panes.solution.set_style(settings.angle_style)
        panes.hints.show_site(settings.site)
        # Wrong hints are shown in their pane, and the frame is solved without any.
        session.options_for = lambda frame: panes.hints.checked_options(frame.width)
        s = session
        s.opening.connect(self._opening)
        s.opened.connect(self._opened)
        s.pictured.connect(self._pictured)
        s.streaming.connect(self._streaming)
        s.streamed.connect(self._streamed)
        s.solving.connect(self._solving)
        s.progressed.connect(self._progressed)
        s.solved.connect(self._solved)
        s.unsolved.connect(self._unsolved)
        s.failed.connect(self._failed)
        s.stopped.connect(panes.card.show_stopped)
        field.placed.connect(panes.card.show_place)
        field.drawn.connect(panes.view.update)
        panes.stars.picked.connect(self._picked)
        panes.solution.style_changed.connect(self._restyled)
        panes.hints.solve_wanted.connect(self.solve)
        panes.hints.site_given.connect(settings.keep_site)
        panes.card.again_wanted.connect(self.solve)
        panes.card.hints_wanted.connect(self.hints_wanted)

    def solve(self) -> None:
        """Solve the open frame with what the hints pane says."""
        if (frame := self.session.known.frame) is None:
            return
        options = self.panes.hints.checked_options(frame.width)
        if options is not None:
            self.session.solve(options)
        else:
            self.hints_wanted.emit()

    def _opening(self, path: Path) -> None:
        self._clear()
        self._progressed(Progress("read", None))

    def _clear(self) -> None:
        """Clear what belongs to the frame before."""
        self._clear_marks()
        self.panes.view.show_picture(None)
        self._age_solution()

    def _opened(self, frame: Frame) -> None:
        when = frame.hint.time_utc
        self.overlay.year = UNKNOWN_YEAR if when is None else julian_years(when)

    def _pictured(self, picture: FrameImage) -> None:
        self.panes.view.show_picture(picture)
        self.panes.strip.show_picture(picture)

    def _streaming(self, name: str) -> None:
        self.overlay.year = julian_years(datetime.now(UTC))
        self._clear()
        self.panes.card.show_working(Progress("live", None, name))

    def _streamed(self, picture: RenderedFrame) -> None:
        before = self.panes.view.picture
        same = before is not None and (before.width, before.height) == (picture.width, picture.height)
        # A person's zoom stays from frame to frame.
        self.panes.view.show_picture(picture, keep_view=same)
        if self.session.known.result is not None or not same:  # until it is solved the names of the frame before stay
            self._show_marks(self.session.known.solution)

    def _solving(self) -> None:
        self._clear_marks()
        self.panes.view.update()
        self._age_solution()

    def _progressed(self, progress: Progress) -> None:
        if progress.stage != "display":
            self.panes.card.show_working(progress)

    def _solved(self, solution: Solution) -> None:
        self._show_marks(solution)
        self.panes.card.show_solution(solution, self._field.place)
        self.panes.solution.show_solution(solution, self.session.known.last_good_from)
        self.panes.stars.set_stars(solution.named)
        self.panes.view.update()
        self._field.say_place()
        self._field.look_for_bodies()

    def _unsolved(self, failure: NoSolution) -> None:
        known = self.session.known
        self._show_marks(None)
        self.panes.card.show_failure(failure, known.path.name if known.path else "")
        self._age_solution()
        self.panes.view.update()

    def _failed(self, sentence: str) -> None:
        known = self.session.known
        self.panes.card.show_error(tr("No image") if known.frame is None else tr("Error"), sentence)
        if known.frame is None:  # facts of the frame before must not seem to be this one's
            self.panes.strip.forget_picture()

    def _show_marks(self, solution: Solution | None) -> None:
        found = self.session.known.detections
        self.overlay.show(found.xy if found is not None else np.empty((0, 2)), solution)
        if solution is not None:
            self._field.read_names()

    def _clear_marks(self) -> None:
        self.overlay.clear()
        self.panes.stars.set_stars(())

    def _age_solution(self) -> None:
        known = self.session.known
        self.panes.solution.setVisible(known.last_good is not None)
        self.panes.card.show_pointing(known.last_good, known.last_good_from)

    def _picked(self, star: int | None) -> None:
        """Show in the image what was picked in the table of stars."""
        self.overlay.selected = star
        solution, view = self.session.known.solution, self.panes.view
        if star is not None and solution is not None and star < len(solution.named):
            view.reveal(solution.named[star].x, solution.named[star].y)
        view.update()

    def _restyled(self, style: AngleStyle) -> None:
        self._settings.keep("angles", style.value)
        self._use_style(style)

    def _use_style(self, style: AngleStyle) -> None:
        self.panes.stars.set_style(style)
        self.panes.card.set_style(style)
