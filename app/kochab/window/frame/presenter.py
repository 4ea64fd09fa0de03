"""Connects the session to the views, and the views to the session."""

from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import numpy as np
from PySide6.QtCore import QObject

from kochab.core import number, tr
from kochab.core.angle_text import AngleStyle, altaz_text, milliseconds_text, short_name
from kochab.core.errors import printable
from kochab.core.frame import Frame, Site
from kochab.core.progress import Progress, Task
from kochab.core.solution import NoSolution, Solution
from kochab.polar.horizon import Horizon, horizon_of
from kochab.sky.apparent import julian_years
from kochab.sky.finder import finder
from kochab.sky.layer import Mark
from kochab.sky.sky_tables import SkyTables, sky_tables
from kochab.solver import UNKNOWN_YEAR
from kochab.window.frame.readout import readout
from kochab.window.frame.session import Known, Session
from kochab.window.image.frame_image import FrameImage
from kochab.window.image.object_card import ObjectCard, facts
from kochab.window.image.overlay import Overlay
from kochab.window.image.screen_image import RenderedFrame
from kochab.window.settings import WindowSettings
from kochab.window.shell.main_window import MainWindow

HOVER_PX = 10.0  # of the screen: so near, the cursor is on a star


class Presenter(QObject):
    """Shows one :class:`Session` in one :class:`MainWindow`, and passes on what the person does."""

    def __init__(self, window: MainWindow, session: Session, settings: WindowSettings) -> None:
        super().__init__(window)
        self.window, self.session, self.settings = window, session, settings
        self.overlay = Overlay(horizon=self.horizon)
        self._place = ""  # what the open frame, or a running camera's last one, shows
        self._sky_asked = False
        self.style = settings.angle_style
        self.panes = panes = window.workspace
        self.object_card = ObjectCard(panes.view)
        panes.view.marks, self.overlay.covered = self.overlay.paint, panes.covered
        panes.solution.set_style(self.style)
        panes.card.set_style(self.style)
        panes.hints.show_site(settings.site)
        panes.stars.set_style(self.style)
        # Wrong hints are shown in their pane, and the frame is solved without any.
        session.options_for = lambda frame: panes.hints.checked_options(frame.width)
        s = session
        s.opening.connect(self._opening)
        s.opened.connect(self._opened)
        s.pictured.connect(self._pictured)
        s.streaming.connect(self._streaming)
        s.streamed.connect(self._streamed)
        s.live.connect(self._live)
        s.solving.connect(self._solving)
        s.progressed.connect(self._progressed)
        s.solved.connect(self._solved)
        s.unsolved.connect(self._unsolved)
        s.failed.connect(self._failed)
        s.stopped.connect(panes.card.show_stopped)
        s.idle.connect(self._idle)
        panes.view.hovered.connect(self._hovered)
        panes.view.clicked.connect(self._clicked)
        panes.view.zoomed.connect(self._zoomed)
        panes.stars.picked.connect(self._picked)
        panes.solution.style_changed.connect(self._restyled)
        panes.hints.solve_wanted.connect(self.solve)
        panes.hints.site_given.connect(self.settings.keep_site)
        panes.card.again_wanted.connect(self.solve)
        panes.card.hints_wanted.connect(self._turn_to_hints)
        self.window.bar.cancel_wanted.connect(self.session.cancel)

    def horizon(self) -> Horizon | None:
        """Where and when the shown frame was taken; None when either is not known, as when only its file has a time."""
        frame = self.session.known.frame
        return None if frame is None or frame.hint.taken_utc is None else horizon_of(frame, self.settings.site)

    def solve(self) -> None:
        """Solve the open frame with what the hints pane says."""
        if (frame := self.session.known.frame) is None:
            return
        options = self.panes.hints.checked_options(frame.width)
        if options is not None:
            self.session.solve(options)
        else:
            self._turn_to_hints()

    def _turn_to_hints(self) -> None:
        self.window.actions_by_name["tab_hints"].trigger()

    def _opening(self, path: Path) -> None:
        self._entitle(printable(path.name))
        self._begin(Progress("read", None, path.name))
        self._progressed(Progress("read", None))

    def _entitle(self, name: str, state: str = "") -> None:
        """Say in the title and in the bar what is shown."""
        self.window.setWindowTitle(f"{state}{', ' * bool(state)}{name} – Kochab")
        self.window.bar.name.setText(short_name(name))
        self.window.bar.name.setToolTip(name)

    def _begin(self, progress: Progress) -> None:
        """Clear what belongs to the frame before."""
        self._place = ""
        self._clear_marks()
        self._hovered(None)
        self.panes.view.show_picture(None)
        self.panes.card.show_working(progress)
        self._age_solution()
        self.window.show_frame_page()

    def _opened(self, frame: Frame) -> None:
        if self.session.known.path is not None:
            self.settings.add_recent(self.session.known.path)
        when = frame.hint.time_utc
        self.overlay.year = UNKNOWN_YEAR if when is None else julian_years(when)
        self.window.status.show_frame(f"{frame.width} × {frame.height}", "\n".join(map(tr, frame.warnings)))

    def _pictured(self, picture: FrameImage) -> None:
        self.panes.view.show_picture(picture)
        self.panes.strip.show_picture(picture)

    def _streaming(self, name: str) -> None:
        self.overlay.year = julian_years(datetime.now(UTC))
        self._begin(Progress("live", None, name))

    def _streamed(self, picture: RenderedFrame) -> None:
        before, result = self.panes.view.picture, self.session.known.result
        same = before is not None and (before.width, before.height) == (picture.width, picture.height)
        # A person's zoom stays from frame to frame.
        self.panes.view.show_picture(picture, keep_view=same)
        self._show_marks(result if isinstance(result, Solution) else None)

    def _live(self, headline: str) -> None:
        self._entitle(printable(self.session.known.name), headline)
        self.window.bar.show_idle(headline)

    def _solving(self) -> None:
        self._place = ""
        self._clear_marks()
        self.panes.view.update()
        self._age_solution()

    def _progressed(self, progress: Progress) -> None:
        self.window.bar.show_progress(progress)
        if progress.stage != "display":
            self.panes.card.show_working(progress)

    def _solved(self, solution: Solution) -> None:
        known = self.session.known
        self._show_marks(solution)
        self.panes.card.show_solution(solution, self._place)
        self.panes.solution.show_solution(solution, known.last_good_from)
        self.panes.stars.set_stars(solution.stars)
        self.panes.view.update()
        self.say_place()
        self.look_for_bodies()

    def look_for_bodies(self) -> None:
        """Look for the bodies of the Solar System and the satellites in the open frame."""
        known = self.session.known
        if known.frame is not None and isinstance(known.result, Solution) and not self.session.streams:
            job = self.session.jobs.run(_bodies(known.frame, known.result, self.settings.site), "bodies")
            job.succeeded.connect(partial(self._has_bodies, known.result))

    def say_place(self) -> None:
        """Say on the card what the open frame shows, and how high it stood from the present site."""
        known = self.session.known
        if known.frame is not None and isinstance(known.result, Solution):
            site = None if self.session.streams else self.settings.site  # a camera's frames come too often to read it
            job = self.session.jobs.run(_place(known.frame, known.result, site), "place")
            job.succeeded.connect(partial(self._placed, known, known.result))

    def _placed(self, known: Known, solution: Solution, told: tuple[str, str]) -> None:
        # A running camera's field keeps its name from frame to frame.
        if self.session.known is known and (known.result is solution or self.session.streams):
            self._place = told[0]
            self.panes.card.show_place(*told)

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
            self.window.status.show_frame("", "")
            self._zoomed(None)
            self.panes.strip.forget_picture()

    def _idle(self) -> None:
        known = self.session.known
        total = known.result.elapsed_ms.get("total") if known.result else None
        word = {Solution: tr("Solved"), NoSolution: tr("No solution")}.get(type(known.result), tr("Ready"))
        told = word if total is None else tr("{word} in {time}", word=word, time=milliseconds_text(total))
        self.window.bar.show_idle(told)

    def _show_marks(self, solution: Solution | None) -> None:
        found = self.session.known.detections
        self.overlay.show(found.xy if found is not None else np.empty((0, 2)), solution)
        # Once, with the first solution: without one nothing of the sky is drawn.
        if solution is not None and not self._sky_asked:
            self._sky_asked = True
            self.session.jobs.run(_tables(), "sky").succeeded.connect(self._has_sky)

    def _has_sky(self, tables: SkyTables) -> None:
        self.overlay.tables = tables
        self.panes.view.update()

    def _has_bodies(self, solution: Solution, bodies: tuple[Mark, ...]) -> None:
        # Another frame may have been opened meanwhile.
        if bodies and self.overlay.solution is solution:
            self.overlay.show_bodies(bodies)
            self.panes.view.update()

    def _clear_marks(self) -> None:
        self.object_card.hide()
        self.overlay.clear()
        self.panes.stars.set_stars(())

    def _age_solution(self) -> None:
        known = self.session.known
        self.panes.solution.setVisible(known.last_good is not None)
        self.panes.card.show_pointing(known.last_good, known.last_good_from)

    def _hovered(self, at: tuple[float, float] | None) -> None:
        known = self.session.known
        text = ""
        if at is not None and known.frame is not None:
            solution = known.result if isinstance(known.result, Solution) else None
            text = readout(known.frame, solution, *at, style=self.style, site=self.settings.site)
            mark = self.overlay.mark_at(*at, HOVER_PX / self.panes.view.viewport.scale)
            text = f"{mark.text}    {text}" if mark is not None else text
        self.window.status.place.setText(text)

    def _zoomed(self, scale: float | None) -> None:
        """Screen pixels to an image pixel, on the button that fits it; None without an image."""
        percent = 0.0 if scale is None else scale * 100.0
        shown = number(percent, ".0f" if percent >= 10 else ".1f")
        text = tr("Fit") if scale is None else tr("Fit {percent} %", percent=shown)
        self.window.actions_by_name["fit"].setIconText(text)

    def _clicked(self, x: float, y: float, reach: float) -> None:
        result = self.session.known.result
        if not isinstance(result, Solution) or not result.stars:
            return
        away = np.array([np.hypot(s.x - x, s.y - y) for s in result.stars])
        nearest = int(away.argmin())
        self.panes.stars.select(nearest if away[nearest] <= reach else None)
        self._pick(self.overlay.mark_at(x, y, reach), result)

    def find(self, x: float, y: float, reach: float) -> None:
        """Show a place of the frame, px, in the middle, and pick what is there."""
        view, overlay = self.panes.view, self.overlay
        solution = overlay.solution
        if solution is None:
            return
        view.centre(x, y)
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

    def _pick(self, mark: Mark | None, solution: Solution, card: bool = True) -> None:
        """Show the card of a star or an object, or none."""
        self.overlay.picked, tables = mark, self.overlay.tables
        self.object_card.setVisible(mark is not None and card)
        if mark is not None and card and tables is not None:
            site = self.settings.site
            horizon = None if site is None else Horizon(site, datetime.now(UTC))
            self.object_card.show_facts(mark.text, facts(tables, mark, solution, self.style, horizon))
        self.panes.view.update()

    def _picked(self, star: int | None) -> None:
        self.overlay.selected = star
        result = self.session.known.result
        view = self.panes.view
        if star is not None and isinstance(result, Solution) and star < len(result.stars):
            view.reveal(result.stars[star].x, result.stars[star].y)
        view.update()

    def _restyled(self, style: AngleStyle) -> None:
        self.style = style
        self.settings.keep("angles", style.value)
        self.panes.stars.set_style(style)
        self.panes.card.set_style(style)


def _place(frame: Frame, solution: Solution, site: Site | None) -> Task[tuple[str, str]]:
    """What a solved frame shows, and the altitude and azimuth of its centre, empty where time or site are not known."""
    yield Progress("place")
    from kochab.sky.landmarks import name_of_field

    horizon = horizon_of(frame, site)
    altaz = "" if horizon is None else altaz_text(*horizon.altaz_deg(solution.centre_vector), begins=True)
    return name_of_field(solution), altaz


def _bodies(frame: Frame, solution: Solution, site: Site | None) -> Task[tuple[Mark, ...]]:
    yield Progress("bodies")
    from kochab.sky.elements import kept_elements
    from kochab.sky.frame_bodies import body_marks

    return (yield from body_marks(frame, solution, site, kept_elements()))


def _tables() -> Task[SkyTables]:
    yield Progress("sky", None, tr("reading the names of the sky"))
    finder()  # so that the first search does not wait for it
    return sky_tables()
