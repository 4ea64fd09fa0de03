"""The window: it lays out its panes, takes files that are dropped, and closes cleanly."""

from PySide6.QtCore import QChildEvent, QEvent, QObject, QPoint, QRect, QSize, Qt, Signal
from PySide6.QtGui import QCloseEvent, QDragEnterEvent, QDropEvent, QResizeEvent
from PySide6.QtWidgets import QBoxLayout, QMainWindow, QStackedWidget, QToolButton, QWidget

from kochab.core import tr
from kochab.window.image.frame_view import FrameView
from kochab.window.image.stretch_strip import StretchStrip
from kochab.window.panels.card import Card
from kochab.window.panels.hints_panel import HintsPanel
from kochab.window.panels.log_panel import LogPanel
from kochab.window.panels.solution_panel import SolutionPanel
from kochab.window.panels.star_table import StarTable
from kochab.window.shell.dialogs import dropped_files
from kochab.window.shell.menus import Menus, Rail, button_of, make_actions
from kochab.window.shell.status import Status, TopBar
from kochab.window.shell.welcome import Sample, Welcome
from kochab.window.widgets import Page, column, page, row, scrolled, styled_frame, tab_pages

CARD_LETTERS = 56  # about as wide as a line of so many
MARGIN_PX, STRIP_PX = 8, 560


class Workspace(Page):
    """The open frame, and over it the card, a few buttons and the stretch; ``tabs`` stand beside it when asked for."""

    def __init__(self, methods: list[str], detectors: list[str], buttons: list[QToolButton]) -> None:
        super().__init__()
        self.view = FrameView()
        self.strip = StretchStrip()
        self.card = Card()
        self.solution = SolutionPanel()
        self.stars = StarTable()
        self.hints = HintsPanel(methods, detectors)
        first = page()
        column(self.solution, None, on=first, spacing=12, margins=(12, 12, 12, 12))
        tabs = (tr("Solution"), scrolled(first)), (tr("Stars"), self.stars), (tr("Hints, method"), scrolled(self.hints))
        self.tabs = tab_pages(tr("Frame details"), *tabs)
        for index in range(self.tabs.count()):
            self.tabs.setTabToolTip(index, f"Alt+{index + 1}")
        self.buttons = styled_frame("card")
        self._row = row(*buttons, on=self.buttons, spacing=2, margins=(3, 3, 3, 3))
        self._column = column((self.view, 1), on=self, spacing=0, margins=(0, 0, 0, 0))
        self.strip.hide()
        self.covered: list[QRect] = []  # parts of the view, where no label could be read
        for over in (self.card, self.buttons, self.strip):
            over.setParent(self)
            over.installEventFilter(self)
        self.view.installEventFilter(self)

    def add_below(self, widget: QWidget) -> None:
        """Put a widget under the image."""
        self._column.addWidget(widget)

    def minimumSizeHint(self) -> QSize:
        """Wide enough for the card."""
        least = super().minimumSizeHint()
        return least.expandedTo(QSize(self.card.minimumSizeHint().width() + 2 * MARGIN_PX, 0))

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() in (QEvent.Type.LayoutRequest, QEvent.Type.Resize, QEvent.Type.ShowToParent):
            self._place()
            if watched is self.card:
                self.updateGeometry()
        return super().eventFilter(watched, event)

    def _place(self) -> None:
        """The card at the lower left, the buttons at the lower right, or at the top when there is no room beside it."""
        inside = self.view.geometry().adjusted(MARGIN_PX, MARGIN_PX, -MARGIN_PX, -MARGIN_PX)
        letters = self.fontMetrics().averageCharWidth() * CARD_LETTERS
        card = QRect(QPoint(), QSize(min(letters, inside.width()), 0))
        card.setHeight(self.card.heightForWidth(card.width()))
        card.moveBottomLeft(inside.bottomLeft())
        long = sum(made.sizeHint().width() + 4 for made in self.buttons.findChildren(QToolButton))
        way = QBoxLayout.Direction.LeftToRight if long < inside.width() else QBoxLayout.Direction.TopToBottom
        if self._row.direction() != way:
            self._row.setDirection(way)
        buttons = QRect(QPoint(), self.buttons.sizeHint())
        buttons.moveBottomRight(inside.bottomRight())
        if buttons.intersects(card.adjusted(0, 0, MARGIN_PX, 0)):
            buttons.moveTopLeft(inside.topLeft())
        strip = QRect(QPoint(), QSize(min(STRIP_PX, inside.width()), self.strip.sizeHint().height()))
        strip.moveBottomRight(buttons.topRight() - QPoint(0, MARGIN_PX))
        if strip.intersects(card) or not inside.contains(strip):
            strip.moveTopLeft(inside.topLeft() if buttons.top() > inside.top() else buttons.bottomLeft())
        self.covered[:] = (card, buttons)
        for over, at in ((self.card, card), (self.buttons, buttons), (self.strip, strip)):
            over.setGeometry(at)


class MainWindow(QMainWindow):
    """Widgets only; :class:`kochab.window.shell.presenter.Presenter` connects them."""

    files_dropped = Signal(object)  # list[Path]
    closing = Signal()
    resized = Signal()
    has_part = Signal(object)  # a QWidget that is about to be seen in the window

    def __init__(self, methods: list[str], detectors: list[str], samples: list[Sample]) -> None:
        super().__init__()
        self.setWindowTitle("Kochab")
        self.setAcceptDrops(True)
        # The same in every theme, so that the window itself need not be dressed again.
        self.setStyleSheet("QMainWindow::separator { background: transparent; width: 4px; height: 4px; }")
        self.resize(1360, 860)
        self.actions_by_name = make_actions(self)
        self.bar = TopBar()
        self.setMenuWidget(self.bar)
        self.menus = Menus(self, self.bar.menus, self.actions_by_name)
        self.rail = Rail(self)
        self.welcome = Welcome(samples)
        over = [self.actions_by_name[name] for name in ("histogram", "fit", "details")]
        self.bar.add_first(button_of(self.actions_by_name["open"]))
        buttons = [button_of(self.menus.layers.menuAction(), self.menus.layers), *map(button_of, over)]
        self.workspace = Workspace(methods, detectors, buttons)
        self.pages = _Pages()
        self.pages.addWidget(self.welcome)
        self.pages.addWidget(self.workspace)
        self.setCentralWidget(self.pages)
        self.log = LogPanel(self)
        self.addDockWidget(Qt.DockWidgetArea.BottomDockWidgetArea, self.log)
        self.log.hide()
        self.welcome.first.setFocus()
        self.status = Status()
        self.setStatusBar(self.status)

    def show_frame_page(self) -> None:
        self.pages.setCurrentWidget(self.workspace)
        self.workspace.view.setFocus()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self.resized.emit()
        self.rail.suit(self.width())

    def childEvent(self, event: QChildEvent) -> None:
        # When it is added, a child is not constructed yet, and no QWidget.
        child = event.child() if event.polished() else None
        if isinstance(child, QWidget):
            self.has_part.emit(child)
        super().childEvent(event)

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        if dropped_files(event):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        if paths := dropped_files(event):
            event.acceptProposedAction()
            self.files_dropped.emit(paths)

    def closeEvent(self, event: QCloseEvent) -> None:
        self.closing.emit()
        self.log.detach()
        super().closeEvent(event)


class _Pages(QStackedWidget):
    """Needs no more room than the page that is seen."""

    def __init__(self) -> None:
        super().__init__()
        self.currentChanged.connect(self.updateGeometry)

    def minimumSizeHint(self) -> QSize:
        page = self.currentWidget()
        return super().minimumSizeHint() if page is None else page.minimumSizeHint()
