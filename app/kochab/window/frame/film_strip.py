"""The film strip below the image: many files with their states, the table of their results, and blinking."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path

from PySide6.QtCore import QObject, QRectF, QSize, Qt, QTimer, Signal
from PySide6.QtGui import QColor, QFontMetrics, QIcon, QPainter, QPen, QPixmap
from PySide6.QtWidgets import (
    QAbstractItemView,
    QDialog,
    QFrame,
    QHeaderView,
    QListView,
    QListWidget,
    QListWidgetItem,
    QTableWidget,
    QTableWidgetItem,
    QWidget,
)

from kochab.core.solution import Solution
from kochab.text.angle_text import AngleStyle
from kochab.text.translation import tr, tr_n, tr_noop
from kochab.window.frame.batch import Batch, FileState
from kochab.window.frame.workspace import Workspace
from kochab.window.image.frame_image import FrameImage
from kochab.window.image.thumbnails import HEIGHT, WIDTH, as_pixmap
from kochab.window.themes import draw_glyph, theme_colours
from kochab.window.widgets import ProgressBar, button, choice_box, column, label, named, row, switch
from kochab.workflows.solution_text import RESULT_TITLES, result_cells

ORDERS: dict[str, Callable[[FileState], object]] = {
    tr_noop("in order"): lambda _: 0,  # sorting is stable
    tr_noop("by name"): lambda f: f.path.name.lower(),
    tr_noop("newest first"): lambda f: -(os.path.getmtime(f.path) if os.path.exists(f.path) else 0.0),
    tr_noop("failed first"): lambda f: (not f.failed, f.result is not None),  # and then those that wait
}
BADGE_PX, BLINK_MS = 16, 800
MARGIN_PX, EDGE_PX = 32, 18  # beside a small picture, and of that what a name may not use
COMMON_LETTERS = 8  # letters with which all names begin; so many and more are left out
APART = " _-."  # where a name is parted
PATH = Qt.ItemDataRole.UserRole


class FilmStrip(QFrame):
    """Shows the files of a :class:`Batch`; seen while there are several."""

    chosen = Signal(Path)
    results_wanted = Signal()

    def __init__(self, batch: Batch) -> None:
        super().__init__()
        self.setObjectName("films")
        self._batch = batch
        self._open: Path | None = None
        self.count = label("", "muted")
        self.bar = ProgressBar(tr("Progress of the files"))
        self.bar.setFixedWidth(110)
        self.solve = button(tr("Solve the rest"), batch.start, "small", tr("Solve the files that have no result yet"))
        self.cancel = button(tr("Cancel"), batch.cancel, "small", tr("Stop; keeps solved images"))
        self.failed = switch(tr("Failed only"), tr("Show only files without a solution"))
        self.order = choice_box(tr("Order of the files"), {tr(title): order for title, order in ORDERS.items()})
        tip = tr("All results in a table, to save as CSV")
        results = button(tr("Results…"), self.results_wanted.emit, "small", tip)
        self.list = named(QListWidget(), tr("Files"))
        self.list.setFlow(QListView.Flow.LeftToRight)
        self.list.setViewMode(QListView.ViewMode.IconMode)
        self.list.setMovement(QListView.Movement.Static)
        self.list.setWrapping(False)
        self.list.setUniformItemSizes(True)
        self.list.setTextElideMode(Qt.TextElideMode.ElideMiddle)
        self.list.setWordWrap(True)  # else the second line of a name is not drawn
        self.list.setHorizontalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.list.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.list.setIconSize(QSize(WIDTH, HEIGHT))
        above = row(self.count, self.bar, self.cancel, self.solve, None, self.failed, self.order, results, spacing=8)
        column(above, self.list, on=self, spacing=4, margins=(8, 4, 8, 4))
        # Enter activates, a click need not.
        self.list.itemActivated.connect(self._choose)
        self.list.itemClicked.connect(self._choose)
        self.failed.toggled.connect(self.fill)
        self.order.currentIndexChanged.connect(self.fill)
        batch.changed.connect(self._change)
        batch.moved.connect(self._tell)
        self.hide()

    def fill(self, _: object = None) -> None:
        """Show the files anew, in the order and with the filter that are set."""
        self.list.clear()
        files = sorted(self._batch.files.values(), key=self.order.currentData())
        metrics = self.list.fontMetrics()
        size = QSize(WIDTH + MARGIN_PX, HEIGHT + 2 * metrics.lineSpacing() + 20)
        alike = alike_at_first([state.path.name for state in files])
        for state in files:
            if state.failed or not self.failed.isChecked():
                name = f"…{state.path.name[alike:]}" if alike else state.path.name
                item = QListWidgetItem(in_two_lines(name, metrics, size.width() - EDGE_PX), self.list)
                item.setData(PATH, state.path)
                item.setSizeHint(size)
                self._dress(item, state)
        self.list.setFixedHeight(size.height() + 20)
        self.setVisible(len(self._batch.files) > 1)
        self.show_open(self._open)
        self._tell()

    def show_open(self, path: Path | None) -> None:
        """Mark the file that is open."""
        self._open = path
        item = next((i for i in self._items() if i.data(PATH) == path), None)
        self.list.setCurrentItem(item)  # type: ignore[arg-type]  # None is none
        if item is not None:
            self.list.scrollToItem(item)

    def next(self) -> None:
        """Open the next file."""
        self._step(1)

    def previous(self) -> None:
        """Open the file before."""
        self._step(-1)

    def _step(self, by: int) -> None:
        at = min(max(self.list.currentRow() + by, 0), self.list.count() - 1)
        if (item := self.list.item(at)) is not None and at != self.list.currentRow():
            self._choose(item)

    def redraw(self) -> None:
        """In the colours of the present theme."""
        for item in self._items():
            self._dress(item, self._batch.files[item.data(PATH)])

    def _items(self) -> list[QListWidgetItem]:
        return [self.list.item(at) for at in range(self.list.count())]

    def _choose(self, item: QListWidgetItem) -> None:
        self.chosen.emit(item.data(PATH))

    def _change(self, state: FileState) -> None:
        found = [item for item in self._items() if item.data(PATH) == state.path]
        for item in found:
            self._dress(item, state)
        if not found and state.failed and self.failed.isChecked():
            self.fill()
        self._tell()

    def _tell(self) -> None:
        files = self._batch.files.values()
        done, failed = len(files) - len(self._batch.waiting), sum(f.failed for f in files)
        text = tr_n(
            "{n} file, {solved} solved, {failed} failed",
            "{n} files, {solved} solved, {failed} failed",
            len(files),
            solved=done - failed,
            failed=failed,
        )
        self.count.setText(text)
        self.bar.show_share(done / max(len(files), 1))
        for shown in (self.bar, self.cancel):
            shown.setVisible(self._batch.at is not None)
        self.solve.setVisible(self._batch.at is None and done < len(files))

    def _dress(self, item: QListWidgetItem, state: FileState) -> None:
        picture = _film(state)
        icon = QIcon(picture)
        icon.addPixmap(picture, QIcon.Mode.Selected)  # else it is tinted, and its badge is hard to tell
        item.setIcon(icon)
        item.setToolTip(f"{state.path}\n{state.words}")
        item.setData(Qt.ItemDataRole.AccessibleTextRole, f"{state.path.name}, {state.words}")


def alike_at_first(names: Sequence[str]) -> int:
    """With how many letters all names begin, whole words of them; 0 where that is not worth leaving out."""
    first, last = min(names, default=""), max(names, default="")  # what these two share, all do
    alike = next((k for k, (a, b) in enumerate(zip(first, last, strict=False)) if a != b), 0)
    ends = max(first.rfind(letter, 0, alike) for letter in APART) + 1
    return ends if ends >= COMMON_LETTERS else 0


def in_two_lines(name: str, metrics: QFontMetrics, width_px: int) -> str:
    """A name as it is, or in two lines, with the middle of the second left out where it is too long for that."""
    if metrics.horizontalAdvance(name) <= width_px:
        return name
    fits = next((k - 1 for k in range(2, len(name)) if metrics.horizontalAdvance(name[:k]) > width_px), len(name))
    first = max((k for k in range(fits // 2, fits + 1) if name[k - 1 : k] in (*APART,)), default=fits)
    return f"{name[:first]}\n{metrics.elidedText(name[first:], Qt.TextElideMode.ElideMiddle, width_px)}"


def _film(state: FileState) -> QPixmap:
    """The small picture with a badge: a dot when solved, a cross when not, a ring while it waits."""
    colours = theme_colours()
    if state.picture is None:
        picture = QPixmap(2 * WIDTH, 2 * HEIGHT)  # for screens of 200 %
        picture.setDevicePixelRatio(2.0)
        picture.fill(QColor(colours.raised))
    else:
        picture = as_pixmap(state.picture, colours.text == "#ff0000")
    painter = QPainter(picture)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    box = QRectF(WIDTH - BADGE_PX - 3, 3, BADGE_PX, BADGE_PX)
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(QColor(colours.halo))
    painter.drawEllipse(box)
    if state.failed:
        draw_glyph(painter, "close", colours.bad, box)
    else:
        painter.setPen(QPen(QColor(colours.muted if state.result is None else colours.good), 2.0))
        painter.setBrush(QColor(colours.good) if state.result is not None else Qt.BrushStyle.NoBrush)
        painter.drawEllipse(box.adjusted(4, 4, -4, -4))
    painter.end()
    return picture


def results_table(parent: QWidget, batch: Batch, style: AngleStyle, save: Callable[[], object]) -> QDialog:
    """The results of all files.

    Parameters
    ----------
    parent : QWidget
        The window that the dialog belongs to.
    batch : Batch
        The files and what each gave.
    style : AngleStyle
        How coordinates are written.
    save : Callable[[], object]
        Asked to keep them as CSV.
    """
    dialog = QDialog(parent)
    dialog.setWindowTitle(tr("Results"))
    dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    table = named(QTableWidget(len(batch.files), len(RESULT_TITLES)), tr("Results of all files"))
    table.setHorizontalHeaderLabels([tr(title) for title in RESULT_TITLES])
    table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
    table.setTabKeyNavigation(False)
    for at, state in enumerate(batch.files.values()):
        solution = state.result if isinstance(state.result, Solution) else None
        for place, text in enumerate(result_cells(state.path.name, state.words, solution, style)):
            table.setItem(at, place, QTableWidgetItem(text))
    table.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
    table.verticalHeader().hide()
    keep = button(tr("Save CSV…"), save, "main")
    keep.setEnabled(bool(batch.files))
    empty = label(tr("Open several images to compare their solutions here."), "muted", wrap=True)
    empty.setVisible(not batch.files)
    buttons = row(keep, None, button(tr("Close"), dialog.close))
    column(empty, table, buttons, on=dialog, spacing=10, margins=(14, 14, 14, 14))
    dialog.resize(min(980, parent.width()), min(520, parent.height()))
    return dialog


class Blink(QObject):
    """Shows the open image and the one before in turn, without marks: what differs, blinks."""

    named = Signal(str)  # the file whose image is shown

    def __init__(self, panes: Workspace) -> None:
        super().__init__(panes)
        self._panes = panes
        self.shown: list[tuple[str, FrameImage]] = []
        """The open image, and then the one before; with their names."""
        self._turn = 0
        self._timer = QTimer(self, interval=BLINK_MS)
        self._timer.timeout.connect(self._show_next)

    def remember(self, name: str, picture: FrameImage, several: bool) -> None:
        """A file was opened; the one before is kept only where there are ``several``."""
        # The bool is a length: none or one of those before.
        self.shown = [(name, picture), *(one for one in self.shown[:several] if one[0] != name)]

    def switch(self, on: bool) -> None:
        """Begin or end; the open image is shown again with its marks and its card."""
        # Not while a camera runs, or before the open image has been prepared.
        on = on and len(self.shown) > 1 and self._panes.view.picture is self.shown[0][1]
        self._turn = 0
        if on:
            self._timer.start()
        elif self._timer.isActive():
            self._timer.stop()
            self._show(0)
        self._panes.card.setVisible(not on)
        self._panes.view.quiet = on
        self._panes.view.update()

    def _show_next(self) -> None:
        self._turn = 1 - self._turn
        self._show(self._turn)

    def _show(self, turn: int) -> None:
        name, picture = self.shown[turn]
        self._panes.view.show_picture(picture, keep_view=True)
        self.named.emit(name)
