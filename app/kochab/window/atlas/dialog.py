"""A small atlas beside the image: a chart of the sky with the open frame on it, and what other frames would hold.

The chart is turned and zoomed from a hemisphere to the frame. It is drawn by the layers that lie over images, over a
camera of its own.
"""

from collections.abc import Callable
from datetime import UTC, datetime
from functools import partial

from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtWidgets import QDialog, QMenu, QWidget

from kochab.core.attitude import radec_deg
from kochab.core.frame import Hint
from kochab.core.solution import Solution
from kochab.gear.actions import reasons_against
from kochab.sky.catalogue import Catalogue
from kochab.sky.finder import NotFound
from kochab.sky.landmarks import constellation_at
from kochab.sky.layer import Mark
from kochab.sky.milky_way import MilkyWay
from kochab.sky.sky_tables import SkyTables
from kochab.sky.solar_system import Body
from kochab.text.angle_text import AngleStyle, angle_text, dec_text, ra_text, radec_plain
from kochab.text.translation import number, tr, tr_noop
from kochab.window.atlas.chart import StarChart
from kochab.window.atlas.chart_menu import offer_menu
from kochab.window.atlas.mosaic import Mosaic
from kochab.window.atlas.sky_reading import read_bodies, read_sky
from kochab.window.frame.search import sought, taken_for
from kochab.window.image.object_card import facts
from kochab.window.services import Services
from kochab.window.widgets import button, column, copy_text, form, label, number_field, row, switch, text_field

FRAME_PX = 900  # of the open frame's longer side, as it is painted into the sky
EXAMPLE = tr_noop("M 31, Vega, Jupiter, 05h35m -5 23")


class Atlas(QDialog):
    """The chart, what frames would hold around its middle, and the mount sent there."""

    def __init__(self, parent: QWidget, services: Services, aim: Callable[[str, str], object]) -> None:
        super().__init__(parent)
        self._services, self._aim = services, aim
        self.setWindowTitle(tr("Sky atlas"))
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.chart = StarChart()
        self.chart.image = partial(services.panes.view.whole, FRAME_PX)
        self.sought = text_field(tr("Find"), tr(EXAMPLE), tr("A star, an object, a planet or coordinates"))
        self.description = label("", "muted", wrap=True)
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
        self.copy = button(tr("&Copy panel centres"), self._copy, tip=tip)
        self.centre = button(tr("C&entre the mount here"), self._send)
        self.home = button(tr("&Show the open frame"), self.chart.show_frame)
        sizes = form(*((each.accessibleName(), each) for each in self.fields))
        side = column(
            self.sought, self.description, 6, self.framing, sizes, self.copy, None, self.dated, self.home, self.centre
        )
        row((self.chart, 1), side, on=self, spacing=12, margins=(12, 12, 12, 12))
        self.sought.returnPressed.connect(self._seek)
        self.chart.moved.connect(self._say)
        self.chart.clicked.connect(self._say)
        self.chart.menu_wanted.connect(self._offer)
        self.framing.toggled.connect(self._frame)
        for each in self.fields:
            each.valueChanged.connect(self._frame)
        services.session.solved.connect(self._solved)
        services.session.opened.connect(self._date)
        job = services.jobs.run(read_sky(), "sky")
        job.succeeded.connect(self._fill)
        job.failed.connect(self.description.setText)
        self._date()
        self._solved(frame := services.session.known.solution)
        if frame is not None:
            for field, value in zip(self.fields, (*frame.camera.fov_deg, frame.roll_deg), strict=False):
                field.setValue(value)
        self.chart.show_frame()
        self._frame()
        self._say()
        self.resize(980, 640)

    def _fill(self, read: tuple[SkyTables, Catalogue, MilkyWay]) -> None:
        self.chart.fill(*read)

    def _date(self) -> None:
        """Show the planets as they stood when the open frame was taken, or as they stand."""
        frame, site = self._services.session.known.frame, self._services.settings.site
        hint = Hint() if frame is None else frame.hint
        self._when, self._site = hint.taken_utc or datetime.now(UTC), hint.site or site
        job = self._services.jobs.run(read_bodies(self._when, self._site), "bodies")
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
        """Draw the fields of the planned frames."""
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
        style = self._services.settings.angle_style
        middle = "\n".join((ra_text(place[0], style), dec_text(place[1], style), around))
        head = tr("In the middle")
        self.description.setText(middle if mark is None else f"{self._facts(mark)}\n\n{head}\n{middle}")
        against = reasons_against(self._services.mount.situation)["centre"]
        self.centre.setEnabled(not against)
        self.centre.setToolTip(against)

    def _facts(self, mark: Mark) -> str:
        """What a mark of the chart is."""
        tables, sheet = self.chart.overlay.tables, self.chart.sheet
        if tables is None:
            return mark.text
        description = facts(tables, mark, sheet, self._services.settings.angle_style, None)
        return "\n".join((mark.text, *(f"{title}  {text}".strip() for title, text in description.items())))

    def _seek(self) -> None:
        text = self.sought.text().strip()
        if not text:
            return
        found = sought(text, self._when, self._site)
        if isinstance(found, NotFound):
            self.description.setText(found.sentence)
        else:
            self.chart.look(found.vector)
            if doubt := taken_for(text, found):
                self.description.setText(doubt)

    def _copy(self) -> None:
        if self.chart.mosaic is not None:
            copy_text(self.chart.mosaic.text(self.chart.centre, self._services.settings.angle_style))

    def _send(self) -> None:
        self._aim("centre", radec_plain(*radec_deg(self.chart.centre), AngleStyle.DECIMAL))

    def _offer(self, at: QPointF, where: QPoint) -> QMenu | None:
        return offer_menu(self.chart, self._services, self._aim, at, where)
