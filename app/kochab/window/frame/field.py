"""What of the sky the open frame shows, found out in jobs: names and figures, bodies, its place and its height."""

from functools import partial

from PySide6.QtCore import QObject, Signal

from kochab.core.frame import Frame, Site
from kochab.core.progress import Progress, Task
from kochab.core.solution import Solution
from kochab.sky.finder import finder
from kochab.sky.horizon import Horizon, horizon_of
from kochab.sky.layer import Mark
from kochab.sky.sky_tables import SkyTables, sky_tables
from kochab.text.angle_text import altaz_text
from kochab.text.translation import tr
from kochab.window.frame.session import Known, Session
from kochab.window.image.overlay import Overlay
from kochab.window.settings import WindowSettings


class SkyField(QObject):
    """Fills the overlay of the open frame, and says where it is; listens to the session by itself."""

    placed = Signal(str, str)  # what the frame shows, and its altitude and azimuth, empty where not known
    drawn = Signal()  # the overlay has more to draw

    def __init__(self, session: Session, settings: WindowSettings) -> None:
        super().__init__(session)
        self._session, self._settings = session, settings
        self.overlay = Overlay(horizon=self.horizon)
        self.place = ""  # what the open frame, or a running camera's last one, shows
        self._asked = False
        for begun in (session.opening, session.streaming, session.solving):
            begun.connect(self._forget)

    def horizon(self) -> Horizon | None:
        """Where and when the shown frame was taken; None when either is not known, as when only its file has a time."""
        frame = self._session.known.frame
        return None if frame is None or frame.hint.taken_utc is None else horizon_of(frame, self._settings.site)

    def read_names(self) -> None:
        """Read the names and figures of the sky, once: without a solution nothing of it is drawn."""
        if not self._asked:
            self._asked = True
            self._session.jobs.run(_tables(), "sky").succeeded.connect(self._has_names)

    def look_for_bodies(self) -> None:
        """Look for the bodies of the Solar System and the satellites in the open frame."""
        known = self._session.known
        if known.frame is not None and known.solution is not None and not self._session.streams:
            job = self._session.jobs.run(_bodies(known.frame, known.solution, self._settings.site), "bodies")
            job.succeeded.connect(partial(self._has_bodies, known.solution))

    def say_place(self) -> None:
        """Find out what the open frame shows, and how high it stood from the present site."""
        known = self._session.known
        if known.frame is not None and known.solution is not None:
            site = None if self._session.streams else self._settings.site  # a camera's frames come too often to read it
            job = self._session.jobs.run(_place(known.frame, known.solution, site), "place")
            job.succeeded.connect(partial(self._has_place, known, known.solution))

    def _forget(self, _: object = None) -> None:
        self.place = ""

    def _has_names(self, tables: SkyTables) -> None:
        self.overlay.tables = tables
        self.drawn.emit()

    def _has_bodies(self, solution: Solution, bodies: tuple[Mark, ...]) -> None:
        # Another frame may have been opened meanwhile.
        if bodies and self.overlay.solution is solution:
            self.overlay.show_bodies(bodies)
            self.drawn.emit()

    def _has_place(self, known: Known, solution: Solution, named: tuple[str, str]) -> None:
        # A running camera's field keeps its name from frame to frame.
        if self._session.known is known and (known.result is solution or self._session.streams):
            self.place = named[0]
            self.placed.emit(*named)


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
