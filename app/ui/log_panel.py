"""The log, and a report to copy from it."""

import logging
import platform

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtWidgets import QDockWidget, QHBoxLayout, QPlainTextEdit, QVBoxLayout, QWidget

from app import __version__
from app.ui.widgets import button, copy_text, fixed_font_family

MOST_LINES = 5000


class _Bridge(QObject):
    line = Signal(str)


class QtLogHandler(logging.Handler):
    """Carries log records from any thread to the window's."""

    def __init__(self) -> None:
        super().__init__()
        self.bridge = _Bridge()
        self.setFormatter(logging.Formatter("%(asctime)s %(levelname)-7s %(message)s", "%H:%M:%S"))

    def emit(self, record: logging.LogRecord) -> None:
        """Pass a record on, unless the window is gone."""
        try:
            self.bridge.line.emit(self.format(record))
        except RuntimeError:
            logging.getLogger("kochab").removeHandler(self)


class LogPanel(QDockWidget):
    """Lines of the log, newest last."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Log", parent)
        self.setObjectName("log")
        self.setAllowedAreas(
            Qt.DockWidgetArea.BottomDockWidgetArea | Qt.DockWidgetArea.TopDockWidgetArea
        )
        self.lines = QPlainTextEdit()
        self.lines.setReadOnly(True)
        self.lines.setTabChangesFocus(True)
        self.lines.setMaximumBlockCount(MOST_LINES)
        self.lines.setAccessibleName("Log")
        self.lines.setStyleSheet(f"font-family: '{fixed_font_family()}', monospace;")
        inside = QWidget()
        inside.setObjectName("page")
        column = QVBoxLayout(inside)
        column.setContentsMargins(8, 8, 8, 8)
        column.addWidget(self.lines)
        line = QHBoxLayout()
        line.addWidget(button("Copy report", self.copy_report, tip="Version, system and the log"))
        line.addWidget(button("Clear log", self.lines.clear))
        line.addStretch(1)
        column.addLayout(line)
        self.setWidget(inside)
        self.handler = QtLogHandler()
        self.handler.bridge.line.connect(self.lines.appendPlainText)
        logger = logging.getLogger("kochab")
        logger.addHandler(self.handler)
        if logger.level == logging.NOTSET:
            logger.setLevel(logging.INFO)

    def report(self) -> str:
        """What to send when something went wrong."""
        import numpy
        import PySide6

        head = (
            f"Kochab {__version__}, Python {platform.python_version()}, "
            f"PySide6 {PySide6.__version__}, numpy {numpy.__version__}, {platform.platform()}"
        )
        return f"{head}\n{self.lines.toPlainText()}\n"

    def copy_report(self) -> None:
        """The report to the clipboard."""
        copy_text(self.report())

    def detach(self) -> None:
        """Stop listening to the log."""
        logging.getLogger("kochab").removeHandler(self.handler)
