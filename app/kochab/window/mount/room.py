"""The middle of the window while a mount is used: the star chart, the pointing over it, the commands below."""

from collections.abc import Callable
from datetime import UTC, datetime

from PySide6.QtCore import QEvent, QObject, QPoint, QPointF, QRect, QSize, Qt, Signal
from PySide6.QtGui import QHideEvent, QKeyEvent, QShowEvent
from PySide6.QtWidgets import QMenu, QWidget

from kochab.core.arrays import Floats
from kochab.core.attitude import apart_deg, radec_deg, separation_deg, unit_vectors
from kochab.core.frame import Site
from kochab.gear.mount_events import MountSnapshot
from kochab.gear.mounts.motion_plan import Limits
from kochab.sky.catalogue import Catalogue
from kochab.sky.layer import Mark
from kochab.sky.milky_way import MilkyWay
from kochab.sky.sky_tables import SkyTables
from kochab.text.angle_text import AngleStyle, angle_text, radec_plain
from kochab.text.duration_text import duration_text
from kochab.text.translation import tr
from kochab.window.atlas.chart import StarChart
from kochab.window.atlas.chart_menu import offer_menu
from kochab.window.atlas.sky_reading import read_bodies, read_sky
from kochab.window.image.object_card import vector_of
from kochab.window.mount.sky_overlay import MountMarks
from kochab.window.services import Services
from kochab.window.widgets import Page, button, column
from kochab.workflows.goto_target import Target
from kochab.workflows.target_tonight import target_tonight

MARGIN_PX = 12
CARD_LETTERS, STRIP_LETTERS = 46, 86  # as wide as a line of so many
HOME_KEYS = (Qt.Key.Key_0, Qt.Key.Key_Home)
KEYS = (*HOME_KEYS, Qt.Key.Key_Plus, Qt.Key.Key_Minus, Qt.Key.Key_Equal)
FIELD_DEG = 60.0  # across the chart at first
MOVED_SHARE = 0.002  # of the field: nearer to the middle the mount need not be brought
WAY_SHARE, WIDEST_DEG = 2.5, 120.0  # so many times the way of a slew is shown, and at most so much


class MountRoom(Page):
    """The chart follows the mount until a person turns it; ``card`` and ``strip`` lie over it.

    A click names what is there, a double click wants the mount there.
    """

    picked = Signal(str)  # the name of what was clicked, or coordinates
    centre_wanted = Signal(str)  # the same of a double click
    read = Signal(object)  # SkyTables, once they are there
    seen = Signal(bool)  # whether the room fills the middle

    def __init__(self, services: Services, card: QWidget, strip: QWidget, aim: Callable[[str, str], object]) -> None:
        super().__init__()
        self._services, self._aim = services, aim
        self.chart, self.marks = StarChart(), MountMarks()
        self.chart.own = self.marks
        self.chart.field_deg = FIELD_DEG
        self.chart.setAccessibleDescription(
            tr("Plus and minus zoom, arrow keys pan, 0 follows the mount. A double click centres the mount there.")
        )
        self.card, self.strip = card, strip
        self.follow = button(tr("Follow the mount"), self.follow_mount, tip=tr("Turn the chart with the mount (0)"))
        self._follows, self._turning, self._dressed = True, False, False
        self._typed: Target | None = None  # where a goto would go
        self._score: QWidget | None = None  # of the practice that is over
        self._field_before: float | None = None  # of the chart, before it was widened for a slew
        column((self.chart, 1), on=self, spacing=0, margins=(0, 0, 0, 0))
        for over in (card, strip, self.follow):
            over.setParent(self)
            over.installEventFilter(self)
        self.follow.hide()
        self.chart.installEventFilter(self)
        self.chart.moved.connect(self._moved)
        self.chart.clicked.connect(self._clicked)
        self.chart.double_clicked.connect(lambda at: self.centre_wanted.emit(self._name_at(at)))
        self.chart.menu_wanted.connect(self._offer)
        job = services.jobs.run(read_sky(), "sky")
        job.succeeded.connect(self._fill)
        self._bodies_of: datetime | None = None

    def _fill(self, read: tuple[SkyTables, Catalogue, MilkyWay]) -> None:
        self.chart.fill(*read)
        self.read.emit(read[0])

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self.seen.emit(True)

    def hideEvent(self, event: QHideEvent) -> None:
        super().hideEvent(event)
        if self.isHidden():  # and not all of the middle, whose place the side takes in a small window
            self.seen.emit(False)

    def show_score(self, card: QWidget) -> None:
        """Lay how a practice went over the middle of the chart, in place of an older one."""
        if self._score is not None:
            self._score.hide()
            self._score.deleteLater()
        self._score = card
        card.setParent(self)
        self._place()
        card.show()
        card.setFocus()

    # -- what is known of the mount --------------------------------------------------------------

    def show_known(self, known: MountSnapshot, site: Site | None, limits: Limits) -> None:
        """Show where the mount and the sky say that it points, and where it goes."""
        marks, report, sight = self.marks, known.report, known.sight
        when = datetime.now(UTC) if report is None or report.time_utc is None else report.time_utc
        marks.mount = None if report is None else unit_vectors(*report.icrs_deg)
        marks.solved, marks.is_old = None, known.moved_since
        if sight is not None:
            marks.solved = sight.solution.centre_vector
            off = angle_text(apart_deg(sight.mount_deg, sight.solution.ra_dec_deg))
            marks.offset_text = tr("{angle} off", angle=off)
        marks.slewing = report is not None and report.target_deg is not None
        if report is not None and report.target_deg is not None:
            marks.target, marks.target_text = unit_vectors(*report.target_deg), known.target
        else:
            self._mark_typed()
        self.chart.frame = None if sight is None or known.moved_since else sight.solution
        marks.show_site(site, when, limits)
        marks.meridian_text = self._meridian_text(site, when, limits)
        self._date(when, site)
        if marks.mount is not None and self._follows:
            self._turn_to(marks.mount, known.left_deg)
        elif site is not None and not self._dressed:
            self._turn_to(marks.south(site, when), None)
        self._dressed = True
        self._place()
        self.chart.update()

    def _meridian_text(self, site: Site | None, when: datetime, limits: Limits) -> str:
        """How long until the mount comes there."""
        mount = self.marks.mount
        if site is None:
            return ""
        left = 0.0 if mount is None else target_tonight(mount, site, when, limits).meridian_h
        if left <= 0.0:
            return tr("meridian")
        time = duration_text(3600.0 * left)
        return tr("meridian in {time}", time=time) if limits.crosses_meridian else tr("flip in {time}", time=time)

    def show_target(self, target: Target | None) -> None:
        """Mark where a goto would go."""
        self._typed = target
        if not self.marks.slewing:
            self._mark_typed()
            self.chart.update()

    def _mark_typed(self) -> None:
        target = self._typed
        self.marks.target = None if target is None else unit_vectors(target.ra_deg, target.dec_deg)
        self.marks.target_text = "" if target is None else target.name

    def _date(self, when: datetime, site: Site | None) -> None:
        """The planets of the night, once an hour."""
        if self._bodies_of is None or abs((when - self._bodies_of).total_seconds()) > 3600.0:
            self._bodies_of = when
            job = self._services.jobs.run(read_bodies(when, site), "bodies")
            job.succeeded.connect(lambda found: self.chart.show_bodies(found[1]))

    # -- the chart follows -------------------------------------------------------------------------

    def follow_mount(self) -> None:
        """Bring the mount to the middle, and keep it there."""
        self._follows = True
        self.follow.hide()
        self._place()
        if self.marks.mount is not None:
            self._turn_to(self.marks.mount, None)

    def _turn_to(self, mount: Floats, left_deg: float | None) -> None:
        """Turn the chart with the mount; for a long slew it is widened, and narrowed again after it."""
        chart, field = self.chart, self.chart.field_deg
        chart.is_light = self.marks.slewing
        if left_deg is not None and self._field_before is None:
            self._field_before = field
            field = max(field, min(WAY_SHARE * left_deg, WIDEST_DEG))
        elif left_deg is None and self._field_before is not None:
            field, self._field_before = self._field_before, None
        far = separation_deg(chart.centre, mount) > MOVED_SHARE * field
        if far or field != chart.field_deg:
            self._turning = True
            chart.look(mount if far else chart.centre, field)
            self._turning = False

    def _moved(self) -> None:
        """A person who drags the chart has it where they want it; a zoom alone goes on following."""
        mount = self.marks.mount
        if self._turning or mount is None:
            return
        self._field_before = None
        self.chart.is_light = False
        if self._follows and separation_deg(self.chart.centre, mount) > MOVED_SHARE * self.chart.field_deg:
            self._follows = False
            self.follow.show()
            self._place()

    # -- the pointer -------------------------------------------------------------------------------

    def _name_at(self, at: QPointF) -> str:
        """What is there, by its coordinates: a name may be short for several things."""
        mark, tables = self.chart.mark_at(at), self.chart.overlay.tables
        vector = self.chart.sky_at(at) if mark is None or tables is None else vector_of(tables, mark, self.chart.sheet)
        return radec_plain(*radec_deg(vector), AngleStyle.DECIMAL)

    def _clicked(self, mark: Mark | None) -> None:
        if mark is not None:
            self.picked.emit(mark.text)

    def _offer(self, at: QPointF, where: QPoint) -> QMenu | None:
        return offer_menu(self.chart, self._services, self._aim, at, where)

    # -- where things lie --------------------------------------------------------------------------

    def minimumSizeHint(self) -> QSize:
        """Wide enough for the strip."""
        least = super().minimumSizeHint()
        return least.expandedTo(QSize(self.strip.minimumSizeHint().width() + 2 * MARGIN_PX, 0))

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() in (QEvent.Type.LayoutRequest, QEvent.Type.Resize, QEvent.Type.ShowToParent):
            self._place()
            if watched is self.strip and event.type() == QEvent.Type.LayoutRequest:
                self.updateGeometry()
        if watched is self.chart and isinstance(event, QKeyEvent):
            if event.type() == QEvent.Type.ShortcutOverride and event.key() in KEYS:
                event.accept()  # else they would zoom the image that is not seen
                return True
            if event.type() == QEvent.Type.KeyPress and event.key() in HOME_KEYS:
                self.follow_mount()
                return True
        return super().eventFilter(watched, event)

    def _place(self) -> None:
        """The card above at the left, the strip below, and the button that follows beside it."""
        inside = self.chart.geometry().adjusted(MARGIN_PX, MARGIN_PX, -MARGIN_PX, -MARGIN_PX)
        letter = self.fontMetrics().averageCharWidth()
        places = {
            self.card: _sized(self.card, CARD_LETTERS * letter, inside),
            self.strip: _sized(self.strip, STRIP_LETTERS * letter, inside),
        }
        places[self.card].moveTopLeft(inside.topLeft())
        places[self.strip].moveBottomLeft(inside.bottomLeft())
        at = QRect(QPoint(), self.follow.sizeHint())
        at.moveTopRight(inside.topRight())
        places[self.follow] = at
        for over, where in places.items():
            if over.geometry() != where:
                over.setGeometry(where)
        if self._score is not None:
            score = QRect(QPoint(), self._score.sizeHint().boundedTo(inside.size()))
            score.moveCenter(inside.center())
            self._score.setGeometry(score)
            self._score.raise_()
        covered = [places[self.card], places[self.strip]]
        if self._follows and self.marks.mount is not None:
            covered.append(self.marks.room_px(self.chart))
        if self.chart.overlay.covered != covered:
            self.chart.overlay.covered[:] = covered
            self.chart.update()


def _sized(over: QWidget, width: int, inside: QRect) -> QRect:
    """As wide as wanted, or as there is room, and as high as it needs then."""
    wide = min(max(width, over.minimumSizeHint().width()), inside.width())
    high = over.heightForWidth(wide) if over.hasHeightForWidth() else over.sizeHint().height()
    return QRect(0, 0, wide, max(high, 1))
