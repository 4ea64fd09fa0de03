"""Brings the window to life: the session's news go to the views, the person's wishes back."""

from pathlib import Path

import numpy as np
from PySide6.QtCore import QObject

from app.core.frame import Frame
from app.core.progress import Progress
from app.core.solution import NoSolution, Solution
from app.ui.formats import AngleStyle, milliseconds_text
from app.ui.main_window import MainWindow
from app.ui.overlay import Overlay
from app.ui.picture import Picture
from app.ui.readout import readout
from app.ui.ready_picture import ReadyPicture
from app.ui.session import Session
from app.ui.settings import Settings


class Presenter(QObject):
    """Translates between one :class:`Session` and one :class:`MainWindow`."""

    def __init__(self, window: MainWindow, session: Session, settings: Settings) -> None:
        super().__init__(window)
        self.window, self.session, self.settings = window, session, settings
        self.overlay = Overlay(switches=settings.switches())
        self.style = settings.angle_style
        panes = window.workspace
        panes.view.marks = self.overlay.paint
        panes.solution.set_style(self.style)
        panes.hints.show_site(settings.site)
        panes.stars.set_style(self.style)
        session.options_for = lambda frame: panes.hints.checked_options(frame.width)
        self._listen_to_session()
        self._listen_to_views()

    def _listen_to_session(self) -> None:
        s = self.session
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
        s.stopped.connect(self._stopped)
        s.idle.connect(self._idle)

    def _listen_to_views(self) -> None:
        panes = self.window.workspace
        panes.view.hovered.connect(self._hovered)
        panes.view.clicked.connect(self._clicked)
        panes.view.zoomed.connect(self.window.status.show_zoom)
        panes.stars.picked.connect(self._picked)
        panes.solution.style_changed.connect(self._restyled)
        panes.hints.solve_wanted.connect(self.solve)
        panes.hints.site_given.connect(self.settings.keep_site)
        panes.card.again_wanted.connect(self.solve)
        panes.card.hints_wanted.connect(self._turn_to_hints)
        self.window.status.cancel_wanted.connect(self.session.cancel)

    # wishes -----------------------------------------------------------------------------------
    def solve(self) -> None:
        """Solve the open frame with what the hints pane says."""
        frame = self.session.known.frame
        panes = self.window.workspace
        if frame is None:
            return
        options = panes.hints.checked_options(frame.width)
        if options is None:
            panes.tabs.setCurrentIndex(2)
            return
        panes.tabs.setCurrentIndex(0)
        self.session.solve(options)

    def _turn_to_hints(self) -> None:
        panes = self.window.workspace
        panes.tabs.setCurrentIndex(2)
        panes.hints.fov.setFocus()

    # news -------------------------------------------------------------------------------------
    def _opening(self, path: Path) -> None:
        self.window.setWindowTitle(f"{path.name} – Kochab")
        panes = self.window.workspace
        self._clear_marks()
        self._hovered(None)  # until the pointer moves, nothing is said of another frame's pixel
        panes.view.show_picture(None)
        panes.card.show_working(Progress("read", None, path.name))
        self._age_solution()
        self.window.show_frame_page()
        self._progressed(Progress("read", None))

    def _opened(self, frame: Frame) -> None:
        if self.session.known.path is not None:
            self.settings.add_recent(self.session.known.path)
        text = f"{frame.width} × {frame.height}"
        self.window.status.show_frame(text, "\n".join(frame.warnings))

    def _pictured(self, picture: Picture) -> None:
        panes = self.window.workspace
        panes.view.show_picture(picture)
        panes.strip.show_picture(picture)

    def _streaming(self, name: str) -> None:
        panes = self.window.workspace
        self._clear_marks()
        self._hovered(None)  # until the pointer moves, nothing is said of another frame's pixel
        panes.view.show_picture(None)
        panes.card.show_working(Progress("live", None, name))
        self._age_solution()
        self.window.show_frame_page()

    def _streamed(self, picture: ReadyPicture) -> None:
        view, result = self.window.workspace.view, self.session.known.result
        before = view.picture
        size = (picture.width, picture.height)
        same = before is not None and (before.width, before.height) == size
        view.show_picture(picture, keep_view=same)
        self._show_marks(result if isinstance(result, Solution) else None)

    def _solving(self) -> None:
        self._clear_marks()
        self.window.workspace.view.update()
        self._age_solution()

    def _progressed(self, progress: Progress) -> None:
        self.window.status.show_progress(progress)
        if progress.stage != "display":
            self.window.workspace.card.show_working(progress)

    def _solved(self, solution: Solution) -> None:
        panes, known = self.window.workspace, self.session.known
        self._show_marks(solution)
        panes.card.show_solution(solution)
        panes.solution.show_solution(solution, known.last_good_from)
        panes.stars.set_stars(solution.stars)
        panes.view.update()

    def _unsolved(self, failure: NoSolution) -> None:
        panes, known = self.window.workspace, self.session.known
        self._show_marks(None)
        panes.card.show_failure(failure, known.path.name if known.path else "")
        panes.tabs.setCurrentIndex(0)
        self._age_solution()
        panes.view.update()

    def _failed(self, sentence: str) -> None:
        panes = self.window.workspace
        panes.card.show_trouble(sentence)
        panes.tabs.setCurrentIndex(0)
        if self.session.known.frame is None:  # nothing of the frame before may seem to be of this
            self.window.status.forget_frame()
            panes.strip.forget_picture()

    def _stopped(self) -> None:
        self.window.workspace.card.show_stopped()

    def _idle(self) -> None:
        known = self.session.known
        total = known.result.elapsed_ms.get("total") if known.result else None
        word = {Solution: "Solved", NoSolution: "No solution"}.get(type(known.result), "Ready")
        took = f" in {milliseconds_text(total)}" if total is not None else ""
        self.window.status.show_idle(word + took)

    # the frame --------------------------------------------------------------------------------
    def _show_marks(self, solution: Solution | None) -> None:
        found = self.session.known.detections
        self.overlay.show(found.xy if found is not None else np.empty((0, 2)), solution)

    def _clear_marks(self) -> None:
        self.overlay.clear()
        self.window.workspace.stars.set_stars(())

    def _age_solution(self) -> None:
        known = self.session.known
        if known.last_good is not None:
            self.window.workspace.solution.show_solution(
                known.last_good, known.last_good_from, old=True
            )

    def _hovered(self, at: tuple[float, float] | None) -> None:
        known = self.session.known
        text = ""
        if at is not None and known.frame is not None:
            solution = known.result if isinstance(known.result, Solution) else None
            text = readout(known.frame, solution, *at, style=self.style, site=self.settings.site)
        self.window.status.place.setText(text)

    def _clicked(self, x: float, y: float, reach: float) -> None:
        result = self.session.known.result
        if not isinstance(result, Solution) or not result.stars:
            return
        away = np.array([np.hypot(s.x - x, s.y - y) for s in result.stars])
        nearest = int(away.argmin())
        self.window.workspace.stars.select(nearest if away[nearest] <= reach else None)

    def _picked(self, star: int | None) -> None:
        self.overlay.selected = star
        result = self.session.known.result
        view = self.window.workspace.view
        if star is not None and isinstance(result, Solution) and star < len(result.stars):
            view.reveal(result.stars[star].x, result.stars[star].y)
        view.update()

    def _restyled(self, style: AngleStyle) -> None:
        self.style = style
        self.settings.keep("angles", style.value)
        self.window.workspace.stars.set_style(style)
