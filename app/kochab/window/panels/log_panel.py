"""The log pane: the journal's lines as they come, and a report to save."""

import logging

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QDockWidget, QPlainTextEdit, QWidget

from kochab.gear.journal import versions
from kochab.text.translation import tr
from kochab.window.job import fault_text
from kochab.window.widgets import button, column, copy_text, fixed_font_family, page, row, switch

MOST_LINES = 5000


class QtLogHandler(logging.Handler):
    """Carries log records from any thread to the window's."""

    def __init__(self, panel: "LogPanel") -> None:
        super().__init__(logging.INFO)
        self._panel = panel
        self.setFormatter(logging.Formatter("%(asctime)s %(levelname)-7s %(message)s", "%H:%M:%S"))

    def emit(self, record: logging.LogRecord) -> None:
        try:
            self._panel.line.emit(self.format(record))
            # Only what nothing caught is critical.
            if record.levelno >= logging.CRITICAL and record.exc_info and record.exc_info[1]:
                self._panel.fault.emit(fault_text(record.exc_info[1]))
        except RuntimeError:  # the window is gone
            logging.getLogger("kochab").removeHandler(self)


class LogPanel(QDockWidget):
    """Lines of the log, newest last; ``fault`` carries a sentence for a fault that nothing caught."""

    line = Signal(str)
    fault = Signal(str)
    report_wanted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(tr("Log"), parent)
        self.setObjectName("log")
        self.setAllowedAreas(Qt.DockWidgetArea.BottomDockWidgetArea | Qt.DockWidgetArea.TopDockWidgetArea)
        self.handler = QtLogHandler(self)
        self.lines = QPlainTextEdit(readOnly=True, tabChangesFocus=True, maximumBlockCount=MOST_LINES)
        self.lines.setAccessibleName(tr("Log"))
        self.lines.setStyleSheet(f"font-family: '{fixed_font_family()}', monospace;")
        self.details = switch(tr("Show details"), tr("Also show every command to the mount, byte by byte"))
        self.details.toggled.connect(lambda on: self.handler.setLevel(logging.DEBUG if on else logging.INFO))
        tip = tr("Pack the journal, versions and settings, without passwords or your exact site")
        save = button(tr("Save a report…"), self.report_wanted.emit, tip=tip)
        copy = button(tr("Copy log"), self.copy_log, tip=tr("Copy the versions and these lines"))
        clear = button(tr("Clear log"), self.lines.clear)
        inside = page()
        column(self.lines, row(save, copy, clear, self.details, None), on=inside, margins=(8, 8, 8, 8))
        self.setWidget(inside)
        self.line.connect(self.lines.appendPlainText)
        logger = logging.getLogger("kochab")
        logger.addHandler(self.handler)
        # An open journal has set its own.
        if logger.level == logging.NOTSET:
            logger.setLevel(logging.INFO)

    def text(self) -> str:
        """The versions and the lines."""
        head = ", ".join(f"{name} {version}" for name, version in versions().items())
        return f"{head}\n{self.lines.toPlainText()}\n"

    def copy_log(self) -> None:
        copy_text(self.text())

    def detach(self) -> None:
        logging.getLogger("kochab").removeHandler(self.handler)
