"""The star chart: turned and zoomed from a hemisphere to the frame.

It is drawn by the layers that lie over images, over a camera of its own.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Protocol

import numpy as np
from PySide6.QtCore import QPoint, QPointF, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QContextMenuEvent,
    QImage,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPen,
    QPixmap,
    QPolygonF,
    QWheelEvent,
)
from PySide6.QtWidgets import QWidget

from kochab.core.arrays import Floats
from kochab.core.attitude import unit
from kochab.core.camera import ChartCamera
from kochab.core.solution import Solution
from kochab.frames.sky_grid import pieces
from kochab.sky.catalogue import Catalogue
from kochab.sky.frame_bodies import body_mark
from kochab.sky.layer import FIRST, MARKS, Layers, Mark, named_to, star_rank
from kochab.sky.milky_way import MilkyWay
from kochab.sky.object_index import inside
from kochab.sky.sky_tables import SkyTables
from kochab.sky.solar_system import Body, BodyKind
from kochab.text.translation import tr
from kochab.window.atlas.mosaic import Mosaic, border, frame_at
from kochab.window.atlas.sky_painting import paint_frame, paint_glow, paint_stars
from kochab.window.dialogs import is_red
from kochab.window.image.frame_view import CLICK_PX, PANS_PX
from kochab.window.image.overlay import Brush, Overlay
from kochab.window.image.screen_image import LabelSpace, Viewport
from kochab.window.themes import Colours, theme_colours, translucent

WIDEST_DEG, CLOSEST_DEG = 180.0, 0.1


WIDE_DEG, WIDE_MAG, WIDE_RANK = 60.0, 5.0, 8.0  # wider, a chart names no more, and leaves boundaries out
SPARE = 0.125  # by how much more names are looked at than wished, of 0..1
STEPS, WIDE_STEP = 4, 99  # steps of a narrower chart's width to a factor of two, and the one of all wide charts


AROUND, LEAST_DEG = 4.0, 25.0  # so many times the frame is shown at first, and so much at least


STARS = 1500  # of one chart, the brightest


STAR_PX, PX_A_MAG, LARGEST_PX = 1.1, 0.75, 7.0  # the faintest star's diameter, and how they grow


SHOWN = ("objects", "names", "bodies", "figures", "boundaries", "ecliptic", "grid")


STAR_INKS = ((0.0, "#becfff"), (0.3, "#dbe3ff"), (0.6, "#fdf8ff"), (0.9, "#ffeddf"), (1.3, "#ffdebd"), (9.9, "#ffcc94"))
"""Up to which B-V a star is drawn in which colour: sRGB of a blackbody of the bin's temperature (Ballesteros 2012,
EPL 97, 34008, eq. 14), through the colour matching functions of Wyman, Sloan and Shirley (2013, JCGT 2, 2)."""


GLOW_DEG = 6.0  # closer, the Milky Way is its stars


MOONS_DEG = 3.0  # wider, moons of planets are not


REACH_PX = 14.0  # so near, the cursor is on a mark


DRAG_STEPS = 8  # each leaves a part of the way: north up turns the chart meanwhile


NO_STARS = np.empty((0, 2))


class ViewsOwn(Protocol):
    """What a view paints over the sky of its chart."""

    @property
    def ground_key(self) -> object:
        """Changes when the ground has to be painted anew."""

    def paint_ground(self, painter: QPainter, chart: "StarChart") -> None:
        """What hardly moves: it is kept with the sky."""

    def paint_marks(self, painter: QPainter, chart: "StarChart") -> None:
        """What moves: painted each time, over the rest."""


class StarChart(QWidget):
    """The chart: dragged, it turns; the wheel zooms; a click names what is there."""

    moved = Signal()
    clicked = Signal(object)  # what is there, a mark or nothing
    double_clicked = Signal(object)  # a place of the widget
    menu_wanted = Signal(object, QPoint)  # screen place, and where on the screen

    def __init__(self) -> None:
        super().__init__()
        self.setMinimumSize(300, 240)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName(tr("Sky chart"))
        self.setAccessibleDescription(tr("Plus and minus zoom, arrow keys pan, 0 shows the open frame."))
        self.overlay = Overlay(Layers(on={name: name in SHOWN for name in MARKS}))
        self.frame: Solution | None = None
        self.image: Callable[[], QImage | None] = lambda: None  # of the open frame
        self.mosaic: Mosaic | None = None
        self.catalogue: Catalogue | None = None
        self._glow: MilkyWay | None = None
        self.centre, self.field_deg = np.array([1.0, 0.0, 0.0]), 60.0
        self.roll_deg = 0.0  # of its top from north, as of :func:`frame_at`
        self.own: ViewsOwn | None = None
        self.is_light = False  # as wide charts are: while it turns with something, twice as fast
        self._picture: tuple[object, QPixmap] | None = None  # of the sky, until something of it changes
        self._tables: SkyTables | None = None
        # By how wide the chart is, and how much of stars and objects is wished: the rest would hold up its turning.
        self._suiting: dict[tuple[int, float, float], SkyTables] = {}
        self._key: object = None
        self._stars: tuple[Floats, Floats, Floats] = NO_STARS, np.empty(0), np.empty(0)
        self._bodies: list[Body] = []
        self._pressed: QPointF | None = None
        self._dragged = False

    @property
    def sheet(self) -> Solution:
        """The chart as a frame, north up and east to the left, but for its roll."""
        key = self.centre.tobytes(), self.roll_deg, self.field_deg, self.width(), self.height(), self.is_light
        if key != self._key or self.overlay.solution is None:
            camera = ChartCamera.of(self.width(), self.height(), self.field_deg)
            self._key, sheet = key, frame_at(camera, self.centre, self.roll_deg)
            self.overlay.tables = self._suit()
            self.overlay.show(NO_STARS, sheet)
            self.overlay.show_bodies(tuple(self._marks(sheet)))
            if self.catalogue is not None:
                # The chart shows a hemisphere at most.
                radius = min(sheet.radius_rad, np.pi / 2.0)
                rows = self.catalogue.brightest(self.centre, radius, STARS)
                places = sheet.pixels_of(self.catalogue.vectors(rows))
                self._stars = places, self.catalogue.mag(rows), self.catalogue.bv(rows)
        assert self.overlay.solution is not None, "shown above"
        return self.overlay.solution

    def fill(self, tables: SkyTables, catalogue: Catalogue, glow: MilkyWay | None = None) -> None:
        """The sky has been read; without ``glow`` there is no Milky Way."""
        self._glow = glow
        self._tables, self.catalogue, self._key = tables, catalogue, None
        self._suiting.clear()
        self.update()

    def _suit(self) -> SkyTables | None:
        """What a chart of this width can show: the names of a narrow one would hold up the turning of a wide one."""
        if self._tables is None:
            return None
        is_wide = self.is_light or self.field_deg > WIDE_DEG
        step = WIDE_STEP if is_wide else int(np.floor(STEPS * np.log2(self.field_deg)))
        # Names also leave free what nobody wished to have named.
        names, objects = (min(1.0, self.overlay.layers.amount[layer] + SPARE) for layer in ("names", "objects"))
        key = step, names, objects
        if key not in self._suiting:
            tables, lines = self._tables, self._tables.lines
            last = named_to(2.0 ** (step / STEPS), names, objects)
            shown, named = star_rank(tables.stars.mag) - FIRST <= last["star"], tables.ranks <= last["object"]
            if is_wide:
                lines = {kind: chains for kind, chains in lines.items() if kind != "boundaries"}
                shown, named = tables.stars.mag < WIDE_MAG, tables.ranks < WIDE_RANK
            stars = tables.stars.take(np.flatnonzero(shown))
            ranks = np.where(named, tables.ranks, np.inf)
            self._suiting[key] = replace(tables, lines=lines, stars=stars, ranks=ranks)
        return self._suiting[key]

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

    def brush(self, painter: QPainter) -> Brush:
        """Paints marks and words over this chart."""
        view = Viewport(self.width(), self.height())
        return Brush(painter, view, theme_colours(), LabelSpace(view.width, view.height))

    def drag(self, before: QPointF, after: QPointF) -> None:
        """Turn the sky so that what was at one place comes to another, with north up."""
        held, camera, centre = self.sky_at(before), self.sheet.camera, self.centre
        place = np.array([[after.x() - 0.5, after.y() - 0.5]])
        for _ in range(DRAG_STEPS):
            centre = unit(centre + held - frame_at(camera, centre).sky_at(place)[0])
        self.look(centre)

    def paintEvent(self, _: QPaintEvent) -> None:
        picture = self._sky_picture()
        painter = QPainter(self)
        painter.drawPixmap(0, 0, picture)
        if self.own is not None:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            self.own.paint_marks(painter, self)
        if self.hasFocus():
            painter.setPen(self.palette().highlight().color())
            painter.drawRect(self.rect().adjusted(0, 0, -1, -1))
        painter.end()

    def _sky_picture(self) -> QPixmap:
        """The sky as it was painted last, while nothing of it has changed: at 4K it takes a tenth of a second."""
        colours, sheet, ratio = theme_colours(), self.sheet, self.devicePixelRatioF()
        over, ground = self.overlay, None if self.own is None else self.own.ground_key
        covered = tuple(box.getRect() for box in over.covered)
        drawn = id(sheet), id(self._bodies), id(self.frame), id(over.tables), id(over.picked)
        key = self._key, drawn, self.mosaic, covered, ground, id(colours), self.font().toString(), ratio
        if self._picture is None or self._picture[0] != key:
            size, picture = self.size() * ratio, None if self._picture is None else self._picture[1]
            if picture is None or (picture.size(), picture.devicePixelRatio()) != (size, ratio):
                picture = QPixmap(size)  # else the one before is painted over: at 4K another takes 8 ms
                picture.setDevicePixelRatio(ratio)
            painter = QPainter(picture)
            painter.setFont(self.font())
            self._paint_sky(painter, colours, sheet)
            painter.end()
            self._picture = key, picture
        return self._picture[1]

    def _paint_sky(self, painter: QPainter, colours: Colours, sheet: Solution) -> None:
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        view = Viewport(self.width(), self.height())
        if self._glow is not None and self.field_deg > GLOW_DEG:
            paint_glow(painter, self._glow, sheet, self.rect(), (QColor(colours.sky), QColor(colours.star)))
        else:
            painter.fillRect(self.rect(), QColor(colours.sky))
        self._paint_stars(painter, view, colours.star)
        if self.frame is not None and (image := self.image()) is not None:
            paint_frame(painter, image, self.frame, sheet, view)
        self.overlay.paint(painter, view)
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.setPen(QPen(translucent(colours.figure, 150), 1.0))
        horizon_px = 2.0 * sheet.camera.focal_px  # a quarter of the sky from the middle
        painter.drawEllipse(QPointF(self.width() / 2.0, self.height() / 2.0), horizon_px, horizon_px)
        for panel in () if self.mosaic is None else self.mosaic.panels(self.centre):
            self._outline(painter, view, panel, QPen(QColor(colours.centre), 1.4))
        if self.frame is not None:
            self._outline(painter, view, self.frame, QPen(QColor(colours.identified), 2.0))
        if self.own is not None:
            self.own.paint_ground(painter, self)

    def _paint_stars(self, painter: QPainter, view: Viewport, colour: str) -> None:
        """Discs by magnitude in the stars' colours."""
        xy, mags, bv = self._stars
        if not len(xy):
            return
        # At night there is red light alone; a star of unknown colour is drawn white.
        inks = (colour,) if is_red() else (*(ink for _, ink in STAR_INKS), colour)
        ink_of = np.zeros(len(xy), dtype=int) if is_red() else np.searchsorted([limit for limit, _ in STAR_INKS], bv)
        sizes = np.clip(STAR_PX + PX_A_MAG * (mags.max() - mags), STAR_PX, LARGEST_PX)
        paint_stars(painter, view.to_screen(xy), np.rint(2.0 * sizes) / 2.0, [inks[k] for k in ink_of.tolist()])

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

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self.double_clicked.emit(event.position())

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
