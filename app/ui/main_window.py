"""The window: it lays out its panes, takes files that are dropped, and closes cleanly."""

from pathlib import Path

from PySide6.QtCore import QChildEvent, QSize, Qt, Signal
from PySide6.QtGui import QCloseEvent, QDragEnterEvent, QDropEvent
from PySide6.QtWidgets import QMainWindow, QStackedWidget, QWidget

from app.ui.actions import make_actions
from app.ui.log_panel import LogPanel
from app.ui.menus import Menus, make_toolbar
from app.ui.samples import Sample
from app.ui.status import Status
from app.ui.welcome import Welcome
from app.ui.workspace import Workspace


class MainWindow(QMainWindow):
    """Views only; :class:`app.ui.presenter.Presenter` brings them to life."""

    files_dropped = Signal(object)  # list[Path]
    closing = Signal()
    has_part = Signal(object)  # a QWidget that is about to be seen in the window

    def __init__(self, methods: list[str], detectors: list[str], samples: list[Sample]) -> None:
        super().__init__()
        self.setWindowTitle("Kochab")
        self.setAcceptDrops(True)
        # The same in every theme, so that the window itself need not be dressed again.
        self.setStyleSheet(
            "QMainWindow::separator { background: transparent; width: 4px; height: 4px; }"
        )
        self.resize(1360, 860)
        self.actions_by_name = make_actions(self)
        self.menus = Menus(self, self.actions_by_name)
        self.tools = make_toolbar(self, self.actions_by_name)
        self.welcome = Welcome(samples)
        self.workspace = Workspace(methods, detectors)
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
        """Leave the welcome page."""
        self.pages.setCurrentWidget(self.workspace)
        self.workspace.view.setFocus()

    def childEvent(self, event: QChildEvent) -> None:
        child = event.child() if event.polished() else None
        if isinstance(child, QWidget):
            self.has_part.emit(child)
        super().childEvent(event)

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        if _files(event):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        paths = _files(event)
        if paths:
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


def _files(event: QDragEnterEvent | QDropEvent) -> list[Path]:
    urls = event.mimeData().urls() if event.mimeData().hasUrls() else []
    return [Path(u.toLocalFile()) for u in urls if u.isLocalFile()]
