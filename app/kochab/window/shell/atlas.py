"""A small atlas beside the image: a chart of the sky with the open frame on it, and what other frames would hold.

The chart is turned and zoomed from a hemisphere to the frame. It is drawn by the layers that lie over images, over a
camera of its own.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from itertools import pairwise

import numpy as np
from PySide6.QtCore import QPoint, QPointF, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QContextMenuEvent,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPen,
    QPolygonF,
    QWheelEvent,
)
from PySide6.QtWidgets import QDialog, QMenu, QWidget

from kochab.core import number, tr, tr_noop
from kochab.core.angle_text import AngleStyle, angle_text, dec_text, ra_text, radec_plain
from kochab.core.arrays import Floats
from kochab.core.attitude import attitude_from, radec_deg, unit
from kochab.core.camera import Camera, ChartCamera
from kochab.core.frame import Hint, Site
from kochab.core.progress import Progress, Task
from kochab.core.solution import Solution
from kochab.frames.sky_grid import pieces
from kochab.gear.actions import reasons_against
from kochab.sky.catalogue import Catalogue, open_catalogue
from kochab.sky.elements import kept_elements
from kochab.sky.finder import NotFound
from kochab.sky.frame_bodies import body_mark
from kochab.sky.landmarks import constellation_at
from kochab.sky.layer import MARKS, Layers, Mark, inside
from kochab.sky.sky_tables import SkyTables, sky_tables
from kochab.sky.small_bodies import SmallBodies, bodies_near
from kochab.sky.solar_system import Body, BodyKind
from kochab.window.image.frame_view import CLICK_PX, PANS_PX
from kochab.window.image.object_card import facts, links, place_menu, vector_of
from kochab.window.image.overlay import Overlay
from kochab.window.image.screen_image import Viewport
from kochab.window.shell.presenter import Presenter
from kochab.window.shell.search import nothing_called, sought, taken_for
from kochab.window.shell.views import Services
from kochab.window.themes import theme_colours, translucent
from kochab.window.widgets import button, column, copy_text, form, label, number_field, row, switch, text_field

WIDEST_DEG, CLOSEST_DEG = 180.0, 0.1
WIDE_DEG, WIDE_MAG, WIDE_RANK = 60.0, 5.0, 8.0  # wider, a chart names no more, and leaves boundaries out
AROUND, LEAST_DEG = 4.0, 25.0  # so many times the frame is shown at first, and so much at least
STARS = 1500  # of one chart, the brightest
STAR_PX, PX_A_MAG, LARGEST_PX = 1.1, 0.75, 7.0  # the faintest star's diameter, and how they grow
SHOWN = ("objects", "names", "bodies", "figures", "boundaries", "ecliptic", "grid")
BODIES_MAG = 10.0  # down to which asteroids and comets are drawn
MOONS_DEG = 3.0  # wider, moons of planets are not
REACH_PX = 14.0  # so near, the cursor is on a mark
DRAG_STEPS = 8  # each leaves a part of the way: north up turns the chart meanwhile
SIDE_POINTS = 17  # of a side of a frame: straight in the frame, it bends on the chart
NO_STARS = np.empty((0, 2))
EXAMPLE = tr_noop("M 31, Vega, Jupiter, 05h35m -5 23")


@dataclass(frozen=True, slots=True)
class Mosaic:
    """Frames of ``width_deg`` x ``height_deg`` side by side, each turned to the position angle ``rotation_deg``.

    ``overlap`` is the share of a side that neighbours have in common. A camera keeps its position angle from panel
    to panel on an equatorial mount, so near a pole their edges are not parallel.
    """

    width_deg: float
    height_deg: float
    rotation_deg: float = 0.0
    columns: int = 1
    rows: int = 1
    overlap: float = 0.15

    def centres(self, middle: Floats) -> Iterator[Floats]:
        """ICRS unit vectors (3,) of the panels around the middle (3,), row by row from the upper left."""
        x, y, z = attitude_from(*radec_deg(middle), self.rotation_deg).matrix
        across, down = (2.0 * np.tan(np.radians(side) / 2.0) for side in (self.width_deg, self.height_deg))
        for j in range(self.rows):
            for i in range(self.columns):
                u = (i - (self.columns - 1) / 2.0) * across * (1.0 - self.overlap)
                v = (j - (self.rows - 1) / 2.0) * down * (1.0 - self.overlap)
                yield unit(z + u * x + v * y)

    def panels(self, middle: Floats) -> list[Solution]:
        """The same as frames."""
        half = np.tan(np.radians(np.array([self.width_deg, self.height_deg])) / 2.0)
        width, height = np.maximum(1, np.rint(1000.0 * half / half.max())).astype(int).tolist()
        camera = Camera.centred(width, height, max(width, height) / (2.0 * float(half.max())))
        return [frame_at(camera, centre, self.rotation_deg) for centre in self.centres(middle)]

    def text(self, middle: Floats, style: AngleStyle) -> str:
        """A line of coordinates and position angle for each panel."""
        places = (radec_plain(*radec_deg(centre), style) for centre in self.centres(middle))
        return "".join(f"{n}\t{place}\t{self.rotation_deg:g}\n" for n, place in enumerate(places, 1))


def frame_at(camera: Camera, centre: Floats, roll_deg: float = 0.0) -> Solution:
    """A frame of a camera that looks at an ICRS unit vector (3,); no stars were found in it."""
    return Solution(camera, attitude_from(*radec_deg(centre), roll_deg), (), 0.0, 0.0, "")


def border(frame: Solution) -> Floats:
    """ICRS unit vectors (N, 3) along the edge of a frame, closed."""
    share = np.linspace(0.0, 1.0, SIDE_POINTS)[:, None]
    width, height = frame.camera.width - 0.5, frame.camera.height - 0.5
    corners = np.array([[-0.5, -0.5], [width, -0.5], [width, height], [-0.5, height], [-0.5, -0.5]])
    return frame.sky_at(np.concatenate([a + share * (b - a) for a, b in pairwise(corners)]))


def _loaded() -> Task[tuple[SkyTables, Catalogue]]:
    yield Progress("sky")
    return sky_tables(), open_catalogue()


def _bodies(when: datetime, site: Site | None) -> Task[tuple[datetime, list[Body]]]:
    """Those of the whole sky at a time, but for satellites: they are elsewhere in a minute."""
    own = [table for table in kept_elements() if isinstance(table, SmallBodies)]
    return when, (yield from bodies_near(when, site, np.array([0.0, 0.0, 1.0]), np.pi, BODIES_MAG, own))


class StarChart(QWidget):
    """The chart: dragged, it turns; the wheel zooms; a click names what is there."""

    moved = Signal()
    clicked = Signal(object)  # what is there, a mark or nothing
    menu_wanted = Signal(object, QPoint)  # screen place, and where on the screen

    def __init__(self) -> None:
        super().__init__()
        self.setMinimumSize(320, 260)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName(tr("Sky chart"))
        self.setAccessibleDescription(tr("Plus and minus zoom, arrow keys pan, 0 shows the open frame."))
        self.overlay = Overlay(Layers(on={name: name in SHOWN for name in MARKS}))
        self.frame: Solution | None = None
        self.mosaic: Mosaic | None = None
        self.catalogue: Catalogue | None = None
        self.centre, self.field_deg = np.array([1.0, 0.0, 0.0]), 60.0
        self._tables: SkyTables | None = None
        self._wide: SkyTables | None = None  # what suits a wide chart: the rest would hold up its turning
        self._key: object = None
        self._stars: tuple[Floats, Floats] = NO_STARS, np.empty(0)
        self._bodies: list[Body] = []
        self._pressed: QPointF | None = None
        self._dragged = False

    @property
    def sheet(self) -> Solution:
        """The chart as a frame, north up and east to the left."""
        key = self.centre.tobytes(), self.field_deg, self.width(), self.height()
        if key != self._key or self.overlay.solution is None:
            camera = ChartCamera.of(self.width(), self.height(), self.field_deg)
            self._key, sheet = key, frame_at(camera, self.centre)
            self.overlay.tables = self._wide if self.field_deg > WIDE_DEG else self._tables
            self.overlay.show(NO_STARS, sheet)
            self.overlay.show_bodies(tuple(self._marks(sheet)))
            if self.catalogue is not None:
                # The chart shows a hemisphere at most.
                radius = min(sheet.radius_rad, np.pi / 2.0)
                rows = self.catalogue.brightest(self.centre, radius, STARS)
                self._stars = sheet.pixels_of(self.catalogue.vectors(rows)), self.catalogue.mag(rows)
        assert self.overlay.solution is not None, "shown above"
        return self.overlay.solution

    def fill(self, tables: SkyTables, catalogue: Catalogue) -> None:
        """The sky has been read."""
        self._tables, self.catalogue, self._key = tables, catalogue, None
        lines = {kind: chains for kind, chains in tables.lines.items() if kind != "boundaries"}
        stars = tables.stars.take(np.flatnonzero(tables.stars.mag < WIDE_MAG))
        ranks = np.where(tables.ranks < WIDE_RANK, tables.ranks, np.inf)
        self._wide = replace(tables, lines=lines, stars=stars, ranks=ranks)
        self.update()

    def show_bodies(self, bodies: list[Body]) -> None:
        """Draw bodies of the Solar System."""
        self._bodies, self._key = bodies, None
        self.update()

    def _marks(self, sheet: Solution) -> Iterator[Mark]:
        """Bodies in sight."""
        vectors = np.array([body.vector for body in self._bodies]).reshape(-1, 3)
        xy = sheet.pixels_of(vectors)
        for k in np.flatnonzero(inside(sheet, xy)).tolist():
            if self._bodies[k].kind is not BodyKind.SATELLITE or self.field_deg < MOONS_DEG:
                yield body_mark(sheet, self._bodies[k], k, xy[k])

    def look(self, centre: Floats, field_deg: float | None = None) -> None:
        """Bring an ICRS unit vector (3,) to the middle."""
        self.centre = np.asarray(centre)
        self.field_deg = float(np.clip(self.field_deg if field_deg is None else field_deg, CLOSEST_DEG, WIDEST_DEG))
        self.moved.emit()
        self.update()

    def show_frame(self) -> None:
        """The open frame in the middle, with the sky around it."""
        if self.frame is not None:
            self.look(self.frame.centre_vector, max(LEAST_DEG, AROUND * max(self.frame.camera.fov_deg)))

    def zoom(self, factor: float) -> None:
        self.look(self.centre, self.field_deg / factor)

    def sky_at(self, at: QPointF) -> Floats:
        """The ICRS unit vector (3,) at a place of the widget."""
        return np.asarray(self.sheet.sky_at(np.array([[at.x() - 0.5, at.y() - 0.5]]))[0])

    def mark_at(self, at: QPointF) -> Mark | None:
        """What is at a place of the widget."""
        return self.overlay.mark_at(at.x() - 0.5, at.y() - 0.5, REACH_PX)

    def drag(self, before: QPointF, after: QPointF) -> None:
        """Turn the sky so that what was at one place comes to another, with north up."""
        held, camera, centre = self.sky_at(before), self.sheet.camera, self.centre
        place = np.array([[after.x() - 0.5, after.y() - 0.5]])
        for _ in range(DRAG_STEPS):
            centre = unit(centre + held - frame_at(camera, centre).sky_at(place)[0])
        self.look(centre)

    def paintEvent(self, _: QPaintEvent) -> None:
        painter, colours, sheet = QPainter(self), theme_colours(), self.sheet
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.fillRect(self.rect(), QColor(colours.sky))
        view = Viewport(self.width(), self.height())
        self._paint_stars(painter, view, colours.star)
        self.overlay.paint(painter, view)
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.setPen(QPen(translucent(colours.figure, 150), 1.0))
        horizon_px = 2.0 * sheet.camera.focal_px  # a quarter of the sky from the middle
        painter.drawEllipse(QPointF(self.width() / 2.0, self.height() / 2.0), horizon_px, horizon_px)
        for panel in () if self.mosaic is None else self.mosaic.panels(self.centre):
            self._outline(painter, view, panel, QPen(QColor(colours.centre), 1.4))
        if self.frame is not None:
            self._outline(painter, view, self.frame, QPen(QColor(colours.identified), 2.0))
        if self.hasFocus():
            painter.setPen(self.palette().highlight().color())
            painter.drawRect(self.rect().adjusted(0, 0, -1, -1))
        painter.end()

    def _paint_stars(self, painter: QPainter, view: Viewport, colour: str) -> None:
        """Discs by magnitude, those of one size at once."""
        xy, mags = self._stars
        if not len(xy):
            return
        sizes = np.clip(STAR_PX + PX_A_MAG * (mags.max() - mags), STAR_PX, LARGEST_PX)
        steps = np.rint(2.0 * sizes)
        at = view.to_screen(xy)
        for step in np.unique(steps).tolist():
            chosen = at[(steps == step) & np.isfinite(at[:, 0])]
            painter.setPen(QPen(QColor(colour), step / 2.0, c=Qt.PenCapStyle.RoundCap))
            painter.drawPoints(QPolygonF([QPointF(x, y) for x, y in chosen.tolist()]))

    def _outline(self, painter: QPainter, view: Viewport, frame: Solution, pen: QPen) -> None:
        painter.setPen(pen)
        for part in pieces(self.sheet.pixels_of(border(frame))):
            painter.drawPolyline(QPolygonF([QPointF(x, y) for x, y in view.to_screen(part).tolist()]))

    def wheelEvent(self, event: QWheelEvent) -> None:
        self.zoom(1.25 ** (event.angleDelta().y() / 120.0))
        event.accept()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self._pressed, self._dragged = event.position(), False

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if self._pressed is None:
            return
        here = event.position()
        if self._dragged or (here - self._pressed).manhattanLength() >= CLICK_PX:
            self._dragged = True
            self.drag(self._pressed, here)
            self._pressed = here

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if self._pressed is not None and not self._dragged:
            self.overlay.picked = self.mark_at(event.position())
            self.clicked.emit(self.overlay.picked)
            self.update()
        self._pressed = None

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        by_mouse = event.reason() == QContextMenuEvent.Reason.Mouse
        at = QPointF(event.pos()) if by_mouse else QPointF(self.rect().center())
        self.menu_wanted.emit(at, event.globalPos())

    def keyPressEvent(self, event: QKeyEvent) -> None:
        key, middle = event.key(), QPointF(self.rect().center())
        if key in PANS_PX:
            self.drag(middle, middle + QPointF(*PANS_PX[Qt.Key(key)]))
        elif key in (Qt.Key.Key_Plus, Qt.Key.Key_Equal, Qt.Key.Key_Minus):
            self.zoom(1 / 1.5 if key == Qt.Key.Key_Minus else 1.5)
        elif key in (Qt.Key.Key_0, Qt.Key.Key_Home):
            self.show_frame()
        else:
            super().keyPressEvent(event)


class Atlas(QDialog):
    """The chart, what frames would hold around its middle, and the mount sent there."""

    def __init__(self, presenter: Presenter, services: Services, aim: Callable[[str, str], object]) -> None:
        super().__init__(presenter.window)
        self._presenter, self._services, self._aim = presenter, services, aim
        self.setWindowTitle(tr("Sky atlas"))
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.chart = StarChart()
        self.sought = text_field(tr("Find"), tr(EXAMPLE), tr("A star, an object, a planet or coordinates"))
        self.told = label("", "muted", wrap=True)
        self.dated = label("", "muted", wrap=True)
        self.framing = switch(tr("&Framing"), tr("Show your field or a mosaic at the chart centre"))
        self.wide = number_field(tr("Width"), 0.01, 90.0, 1.5, 2, "°")
        self.high = number_field(tr("Height"), 0.01, 90.0, 1.0, 2, "°")
        self.turn = number_field(
            tr("Position angle"), -180.0, 180.0, 0.0, 1, "°", tr("Of the frame’s up, east of north")
        )
        self.columns = number_field(tr("Columns"), 1, 20, 1)
        self.rows = number_field(tr("Rows"), 1, 20, 1)
        self.overlap = number_field(tr("Overlap"), 0, 90, 15, 0, " %")
        self.fields = (self.wide, self.high, self.turn, self.columns, self.rows, self.overlap)
        tip = tr("Number, coordinates and position angle of each panel, for a sequence")
        self.copy = button(tr("&Copy the panels"), self._copy, tip=tip)
        self.centre = button(tr("C&entre the mount here"), self._send)
        self.home = button(tr("&Show the open frame"), self.chart.show_frame)
        sizes = form(*((each.accessibleName(), each) for each in self.fields))
        side = column(
            self.sought, self.told, 6, self.framing, sizes, self.copy, None, self.dated, self.home, self.centre
        )
        row((self.chart, 1), side, on=self, spacing=12, margins=(12, 12, 12, 12))
        self.sought.returnPressed.connect(self._seek)
        self.chart.moved.connect(self._say)
        self.chart.clicked.connect(self._say)
        self.chart.menu_wanted.connect(self._offer)
        self.framing.toggled.connect(self._frame)
        for each in self.fields:
            each.valueChanged.connect(self._frame)
        presenter.session.solved.connect(self._solved)
        presenter.session.opened.connect(self._date)
        job = presenter.session.jobs.run(_loaded(), "sky")
        job.succeeded.connect(lambda read: self.chart.fill(*read))
        job.failed.connect(self.told.setText)
        self._date()
        self._solved(frame := presenter.overlay.solution)
        if frame is not None:
            for field, value in zip(self.fields, (*frame.camera.fov_deg, frame.roll_deg), strict=False):
                field.setValue(value)
        self.chart.show_frame()
        self._frame()
        self._say()
        self.resize(980, 640)

    def _date(self) -> None:
        """Show the planets as they stood when the open frame was taken, or as they stand."""
        frame, site = self._presenter.session.known.frame, self._presenter.settings.site
        hint = Hint() if frame is None else frame.hint
        self._when, self._site = hint.taken_utc or datetime.now(UTC), hint.site or site
        job = self._presenter.session.jobs.run(_bodies(self._when, self._site), "bodies")
        job.succeeded.connect(self._has_bodies)
        self.dated.setText(tr("Planets: {time} UTC", time=f"{self._when:%Y-%m-%d %H:%M}"))

    def _has_bodies(self, found: tuple[datetime, list[Body]]) -> None:
        if found[0] == self._when:  # and not of the frame before
            self.chart.show_bodies(found[1])

    def _solved(self, solution: Solution | None) -> None:
        """Show where the open frame lies; the chart stays where the person has turned it."""
        self.chart.frame = solution
        self.home.setEnabled(solution is not None)
        self.chart.update()

    def _frame(self) -> None:
        """Draw what frames would hold."""
        on = self.framing.isChecked()
        for each in (*self.fields, self.copy):
            each.setEnabled(on)
        wide, high, turn, columns, rows, overlap = (each.value() for each in self.fields)
        self.chart.mosaic = Mosaic(wide, high, turn, int(columns), int(rows), overlap / 100.0) if on else None
        self.chart.update()

    def _say(self, mark: Mark | None = None) -> None:
        """What was clicked, what is in the middle, and what a mount may do about it."""
        place, field = radec_deg(self.chart.centre), self.chart.field_deg
        wide = f"{number(field, '.0f')}°" if field >= 10.0 else angle_text(field)
        around = tr("{constellation}, {angle} across", constellation=constellation_at(self.chart.centre), angle=wide)
        style = self._presenter.style
        middle = "\n".join((ra_text(place[0], style), dec_text(place[1], style), around))
        head = tr("In the middle")
        self.told.setText(middle if mark is None else f"{self._facts(mark)}\n\n{head}\n{middle}")
        against = reasons_against(self._services.situation)["centre"]
        self.centre.setEnabled(not against)
        self.centre.setToolTip(against)

    def _facts(self, mark: Mark) -> str:
        """What a mark of the chart is."""
        tables, sheet = self.chart.overlay.tables, self.chart.sheet
        if tables is None:
            return mark.text
        told = facts(tables, mark, sheet, self._presenter.style, None)
        return "\n".join((mark.text, *(f"{title}  {text}".strip() for title, text in told.items())))

    def _seek(self) -> None:
        text = self.sought.text().strip()
        if not text:
            return
        found = sought(text, self._when, self._site)
        if isinstance(found, NotFound):
            self.told.setText(nothing_called(found))
        else:
            self.chart.look(found.vector)
            if doubt := taken_for(text, found):
                self.told.setText(doubt)

    def _copy(self) -> None:
        if self.chart.mosaic is not None:
            copy_text(self.chart.mosaic.text(self.chart.centre, self._presenter.style))

    def _send(self) -> None:
        self._aim("centre", radec_plain(*radec_deg(self.chart.centre), AngleStyle.DECIMAL))

    def _offer(self, at: QPointF, where: QPoint) -> QMenu | None:
        """What can be done with what is at a place of the chart."""
        chart, tables = self.chart, self.chart.overlay.tables
        if tables is None:
            return None
        mark = chart.mark_at(at)
        vector = chart.sky_at(at) if mark is None else vector_of(tables, mark, chart.sheet)
        against = reasons_against(self._services.situation)
        pages = {} if mark is None else links(tables, mark, vector, 0.5)
        place, name = radec_deg(vector), "" if mark is None else mark.text
        menu = place_menu(self, name, place, self._presenter.style, pages, against, self._aim)
        middle = menu.addAction(tr("&Middle of the chart"))
        middle.triggered.connect(partial(chart.look, vector))
        menu.aboutToHide.connect(menu.deleteLater)
        menu.popup(where)
        return menu
