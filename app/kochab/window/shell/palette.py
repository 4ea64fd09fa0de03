"""The search palette: everything that begins as a person types, and what Enter does with it.

Enter shows it in the frame, on the chart of the sky, or runs the command; Alt+Enter slews the mount there, through its
guard; Shift+Enter opens the sky atlas there.
"""

from collections.abc import Callable, Mapping
from datetime import UTC, datetime

from PySide6.QtCore import QEvent, QModelIndex, QObject, QPersistentModelIndex, QRect, QSize, Qt, QTimer
from PySide6.QtGui import QAction, QColor, QFont, QFontMetrics, QKeyEvent, QPainter, QPen
from PySide6.QtWidgets import (
    QAbstractItemView,
    QDialog,
    QListWidget,
    QListWidgetItem,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QWidget,
)

from kochab.core.arrays import Floats
from kochab.core.attitude import radec_deg
from kochab.core.frame import Hint
from kochab.core.progress import Progress, Task
from kochab.gear.actions import reasons_against
from kochab.sky.completion import Completion, completion
from kochab.sky.elements import kept_elements
from kochab.sky.finder import Found, NotFound, find, finder
from kochab.sky.horizon import Horizon
from kochab.sky.solar_system import Body
from kochab.text.angle_text import AngleStyle, radec_plain
from kochab.text.translation import tr, tr_n, tr_noop
from kochab.window.atlas.sky_reading import read_bodies
from kochab.window.frame.picker import Picker
from kochab.window.services import Services
from kochab.window.shell.palette_results import Result, Surroundings, command_results, meant_results, sky_results
from kochab.window.themes import theme_colours
from kochab.window.widgets import button, column, label, row, show_text, styled_frame, text_field

EXAMPLE = tr_noop("M 42, theta1 Ori, Sh2-155, 05h35m -5 23, grid")
CLOSEST_PX = 5.0  # a mark so near the place is what was sought
SEEK_MS = 250  # after the last key: whole texts, such as minor planets' numbers, are then looked up
WIDE_PX, TALL = 660, 0.62  # the palette, and its list as a share of the window's height
RESULT = int(Qt.ItemDataRole.UserRole)
Index = QModelIndex | QPersistentModelIndex


def read_names() -> Task[Completion]:
    """Every name, as the palette completes them: two seconds of work, once."""
    yield Progress("names")
    finder()
    yield Progress("names")
    return completion()


class ResultPainter(QStyledItemDelegate):
    """A line: its name, what it is, and at the right end where it stands or its keys."""

    def sizeHint(self, option: QStyleOptionViewItem, index: Index) -> QSize:
        result, line = index.data(RESULT), QFontMetrics(option.font).height()
        return QSize(100, round(line * (1.9 if isinstance(result, Result) else 1.6)))

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: Index) -> None:
        result, colours = index.data(RESULT), theme_colours()
        rect, bold = option.rect.adjusted(10, 0, -10, 0), QFont(option.font)
        painter.save()
        if not isinstance(result, Result):
            painter.setPen(QColor(colours.muted))
            low = Qt.AlignmentFlag.AlignBottom | Qt.AlignmentFlag.AlignLeft
            painter.drawText(rect.adjusted(0, 0, 0, -3), low, index.data(Qt.ItemDataRole.DisplayRole))
            painter.restore()
            return
        chosen = bool(option.state & QStyle.StateFlag.State_Selected)
        if chosen:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            painter.setPen(QPen(QColor(colours.accent), 1.0))
            painter.setBrush(QColor(colours.accent))
            painter.drawRoundedRect(option.rect.adjusted(1, 1, -1, -1), 6, 6)
        strong, soft = (colours.on_accent,) * 2 if chosen else (colours.text, colours.muted)
        bold.setWeight(QFont.Weight.DemiBold)
        side = QFontMetrics(option.font).horizontalAdvance(result.side)
        self._write(painter, rect, result.side, option.font, soft, Qt.AlignmentFlag.AlignRight)
        rect = rect.adjusted(0, 0, -side - 16, 0)
        self._write(painter, rect, result.title, bold, strong)
        rect = rect.adjusted(min(QFontMetrics(bold).horizontalAdvance(result.title), rect.width()) + 10, 0, 0, 0)
        self._write(painter, rect, result.detail, option.font, soft)
        painter.restore()

    def _write(
        self,
        painter: QPainter,
        rect: QRect,
        text: str,
        font: QFont,
        colour: str,
        side: Qt.AlignmentFlag = Qt.AlignmentFlag.AlignLeft,
    ) -> None:
        """Write a part of the line, elided where there is no room.

        Parameters
        ----------
        painter : QPainter
            Of the list.
        rect : QRect
            The room for it.
        text : str
            What is written.
        font : QFont
            In which font.
        colour : str
            In which colour.
        side : Qt.AlignmentFlag
            On which side of the room.
        """
        if rect.width() > 0:
            painter.setFont(font)
            painter.setPen(QColor(colour))
            text = QFontMetrics(font).elidedText(text, Qt.TextElideMode.ElideRight, rect.width())
            painter.drawText(rect, side | Qt.AlignmentFlag.AlignVCenter, text)


class Palette(QDialog):
    """One field and what it may mean.

    ``aim`` has the mount do something at coordinates, ``show_atlas`` opens the chart at a place, ``show_frame`` brings
    the open frame to the front.
    """

    def __init__(
        self,
        parent: QWidget,
        services: Services,
        picker: Picker,
        actions: Mapping[str, QAction],
        aim: Callable[[str, str], object],
        show_atlas: Callable[[Floats], object],
        show_frame: Callable[[], object],
    ) -> None:
        super().__init__(parent, Qt.WindowType.Dialog | Qt.WindowType.FramelessWindowHint)
        self._over = parent
        self._services, self._picker, self._actions = services, picker, actions
        self._aim, self._show_atlas, self._show_frame = aim, show_atlas, show_frame
        self._names: Completion | None = None
        self.setWindowTitle(tr("Search"))
        self.setObjectName("palette")
        self.setAttribute(Qt.WidgetAttribute.WA_TranslucentBackground)  # its round corners show what is behind
        self._around = self._look_around()
        self._build()
        self._read()

    def _look_around(self) -> Surroundings:
        """Where everything is seen from: the open frame, and the person's site now."""
        frame, site = self._services.session.known.frame, self._services.settings.site
        self._hint = Hint() if frame is None else frame.hint
        horizon = None if site is None else Horizon(site, datetime.now(UTC))
        return Surroundings(self._picker.overlay.solution, horizon)

    def _build(self) -> None:
        tip = tr("A star, an object, a planet, coordinates or a command")
        self.field = text_field(tr("Search"), tr(EXAMPLE), tip)
        self.field.setProperty("role", "palette")
        self.count = label("", "muted")
        self.list = QListWidget()
        self.list.setObjectName("palette")
        self.list.setItemDelegate(ResultPainter(self.list))
        self.list.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # the field keeps it, and moves the choice
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.list.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.list.setAccessibleName(tr("Results"))
        self.message = label("", "muted", wrap=True)
        self.show_it = button(tr("Show") + "  ↵", self.show_chosen, "small", tr("Show it, or run the command (Enter)"))
        self.atlas = button(tr("Open in the atlas") + "  ⇧↵", self.open_atlas, "small", tr("Shift+Enter"))
        self.slew = button(tr("Slew there") + "  Alt+↵", self.slew_there, "small", tr("Alt+Enter"))
        for each in (self.show_it, self.atlas, self.slew):
            each.setAutoDefault(False)
        close = button(tr("Esc"), self.reject, "small", tr("Close (Esc)"))
        close.setAutoDefault(False)
        box = styled_frame("card")
        top = row((self.field, 1), self.count, close, spacing=10)
        keys = row(self.show_it, self.atlas, self.slew, None, spacing=8)
        column(top, self.list, self.message, keys, on=box, spacing=8, margins=(12, 12, 12, 10))
        column(box, on=self, spacing=0, margins=(0, 0, 0, 0))
        self.field.installEventFilter(self)
        self.field.textChanged.connect(self._typed)
        self.list.currentItemChanged.connect(lambda *_: self._chosen())
        self.list.itemActivated.connect(lambda _: self.show_chosen())
        self.list.itemClicked.connect(lambda _: self.show_chosen())
        self._wait = QTimer(self, singleShot=True, interval=SEEK_MS)
        self._wait.timeout.connect(self._seek)
        self._typed()

    def _read(self) -> None:
        """The names, and the bodies of the Solar System when the open frame was taken, or now."""
        when = self._hint.taken_utc or datetime.now(UTC)
        names = self._services.jobs.run(read_names(), "names")
        names.succeeded.connect(self._has_names)
        names.failed.connect(self.message.setText)
        bodies = self._services.jobs.run(read_bodies(when, self._hint.site or self._services.settings.site), "bodies")
        bodies.succeeded.connect(self._has_bodies)

    def _has_names(self, names: Completion) -> None:
        self._names = names
        self._typed()

    def _has_bodies(self, found: tuple[datetime, list[Body]]) -> None:
        self._around = Surroundings(self._around.solution, self._around.horizon, found[1])
        self._typed()

    # -- Results ---------------------------------------------------------------------------------

    @property
    def results(self) -> list[Result]:
        """What is listed."""
        items = (self.list.item(k).data(RESULT) for k in range(self.list.count()))
        return [each for each in items if isinstance(each, Result)]

    @property
    def chosen(self) -> Result | None:
        """The line that Enter is about."""
        item = self.list.currentItem()
        result = None if item is None else item.data(RESULT)
        return result if isinstance(result, Result) else None

    def _typed(self) -> None:
        """List what begins so, and look the whole text up a moment later."""
        text = self.field.text().strip()
        results = [] if self._names is None or not text else sky_results(text, self._names, self._around)
        self._fill(results + command_results(text, self._actions))
        waits = self._names is None and bool(text)
        show_text(self.message, tr("Reading the names…") if waits else "")
        self._wait.stop()
        if text and not results and not waits:
            self._wait.start()

    def _seek(self) -> None:
        """Look the whole text up: minor planets, comets, and what is spelled nearly so."""
        text = self.field.text().strip()
        when = self._hint.taken_utc or datetime.now(UTC)
        task = find(text, when, self._hint.site or self._services.settings.site, kept_elements())
        job = self._services.jobs.run(task, "search")
        self.destroyed.connect(job.abandon)
        job.succeeded.connect(lambda found: self._has_found(text, found))
        job.failed.connect(self.message.setText)

    def _has_found(self, text: str, found: Found | NotFound) -> None:
        if text != self.field.text().strip():
            return
        commands = command_results(text, self._actions)
        if isinstance(found, Found):
            self._fill([self._around.result(found, text), *commands])
            return
        index = finder()
        meant = list(meant_results(found.suggestions, index.still, self._around))
        self._fill([*commands, *meant])
        if not commands:
            show_text(self.message, tr("No object, star or command is called {name}.", name=text))

    def _fill(self, results: list[Result]) -> None:
        self.list.clear()
        group = ""
        for result in results:
            if result.group != group:
                group = result.group
                head = QListWidgetItem(tr(group))
                head.setFlags(Qt.ItemFlag.NoItemFlags)
                self.list.addItem(head)
            item = QListWidgetItem(", ".join(filter(None, (result.title, result.detail, result.side))))
            item.setData(RESULT, result)
            self.list.addItem(item)
        if results:
            self.list.setCurrentRow(1)  # below the first group's name
        searched = bool(results or (self._names is not None and self.field.text().strip()))
        self.count.setText(tr_n("{n} result", "{n} results", len(results)) if searched else "")
        self.list.setVisible(bool(results))
        self._chosen()
        self._fit()

    def _fit(self) -> None:
        """As tall as what is listed, within the window."""
        parent = self._over
        rows = sum(self.list.sizeHintForRow(k) for k in range(self.list.count()))
        self.list.setFixedHeight(min(rows + 8, round(TALL * parent.height())))
        self.setFixedWidth(min(WIDE_PX + 20 * max(0, self.fontMetrics().averageCharWidth() - 7), parent.width() - 40))
        self.adjustSize()

    def _chosen(self) -> None:
        """What can be done with the line that is chosen."""
        result = self.chosen
        place = result is not None and result.vector is not None
        against = reasons_against(self._services.mount.situation)["goto"]
        self.show_it.setEnabled(result is not None)
        self.atlas.setEnabled(place)
        self.slew.setEnabled(place and not against)
        self.slew.setToolTip(against or tr("Alt+Enter"))
        if result is not None:
            item = self.list.currentItem()
            self.field.setAccessibleDescription(item.text())

    # -- What is done ----------------------------------------------------------------------------

    def show_chosen(self) -> None:
        """Show it in the frame, or on the chart where it is outside; or run the command."""
        result = self.chosen
        if result is None:
            if self.field.text().strip() and self._names is not None:
                self._seek()
        elif result.action is not None:
            self.accept()
            result.action.trigger()
        elif result.xy is not None:
            self.accept()
            self._show_frame()
            self._picker.find(*result.xy, CLOSEST_PX)
        else:
            self.open_atlas()

    def open_atlas(self) -> None:
        """Show it on the chart of the sky."""
        result = self.chosen
        if result is not None and result.vector is not None:
            self.accept()
            self._show_atlas(result.vector)

    def slew_there(self) -> None:
        """Send the mount there; why not, where it cannot go."""
        result = self.chosen
        if result is None or result.vector is None:
            return
        against = reasons_against(self._services.mount.situation)["goto"]
        if against:
            show_text(self.message, against, "wrong")
            self._fit()
            return
        self.accept()
        self._aim("goto", radec_plain(*radec_deg(result.vector), AngleStyle.DECIMAL))

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.KeyPress and isinstance(event, QKeyEvent):
            key, held = event.key(), event.modifiers()
            if key in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
                if held & Qt.KeyboardModifier.AltModifier:
                    self.slew_there()
                elif held & Qt.KeyboardModifier.ShiftModifier:
                    self.open_atlas()
                else:
                    self.show_chosen()
                return True
            if key in (Qt.Key.Key_Up, Qt.Key.Key_Down):
                self._step(1 if key == Qt.Key.Key_Down else -1)
                return True
        return super().eventFilter(watched, event)

    def _step(self, by: int) -> None:
        """Choose the next line, past a group's name, and from the last on to the first."""
        rows = [k for k in range(self.list.count()) if isinstance(self.list.item(k).data(RESULT), Result)]
        if rows:
            here = self.list.currentRow()
            at = rows.index(here) if here in rows else -by
            self.list.setCurrentRow(rows[(at + by) % len(rows)])

    def open(self) -> None:
        """Open at the top of the window, over what is shown."""
        parent = self._over
        self._fit()
        corner = parent.mapToGlobal(parent.rect().topLeft())
        self.move(corner.x() + (parent.width() - self.width()) // 2, corner.y() + 56)
        super().open()
        self.field.setFocus()
