"""The area of a plot, which is made when first shown.

The plotting library takes half a second to load: in a thread, and not before a plot is shown.
"""

import logging
import time
from importlib import import_module
from threading import Lock
from typing import Any

from PySide6.QtCore import QEvent, Qt, QTimer
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QApplication, QVBoxLayout, QWidget

from kochab.core.progress import Progress, Task
from kochab.window.job import Job
from kochab.window.themes import theme_colours

log = logging.getLogger("kochab")
LIBRARY = "pyqtgraph"
LOOKS = (QEvent.Type.PaletteChange, QEvent.Type.FontChange, QEvent.Type.StyleChange)
BETWEEN_S = 0.02  # from one plot to the next: the first one is painted meanwhile


class PlotArea(QWidget):
    """Holds one plot; subclasses make and fill it. ``after_ms`` delays loading the library."""

    after_ms = 0

    def __init__(self, title: str) -> None:
        super().__init__()
        self._look: object = None  # colours and letter size of the plot
        self._loading: Job | None = None
        self.plot: Any = None  # a widget with ``set_colours(colours)``, once it is made
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(0, 0, 0, 0)
        self.setAccessibleName(title)

    def make_plot(self) -> QWidget:
        """A new plot; the library may be imported here."""
        raise NotImplementedError

    def fill_plot(self) -> None:
        """Draw in :attr:`plot` what this area was given."""
        raise NotImplementedError

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() in LOOKS and self.plot is not None:
            self._colour_plot()

    def _colour_plot(self) -> None:
        """Give the plot the theme's colours; one theme comes with several events."""
        look = theme_colours(), QApplication.font().pointSizeF()
        if look != self._look:
            self._look = look
            self.plot.set_colours(theme_colours())

    def refill(self) -> None:
        if self.plot is not None:
            self.fill_plot()

    def describe(self, text: str) -> None:
        """Text that a screen reader reads for the plot."""
        self.setAccessibleDescription(text)
        if self.plot is not None:
            self.plot.setAccessibleDescription(text)

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        if self._loading is None:
            self._loading = Job(_loading(), "plots", self)
            self._loading.succeeded.connect(self._make)
            self._loading.failed.connect(log.warning)
            QTimer.singleShot(self.after_ms, self._loading.start)

    def _make(self, _: object) -> None:
        """Make the plot; takes some ten milliseconds."""
        self.plot = plot = self.make_plot()
        plot.setAccessibleName(self.accessibleName())
        plot.setAccessibleDescription(self.accessibleDescription())
        if plot.focusPolicy() != Qt.FocusPolicy.NoFocus:
            self.setFocusProxy(plot)
        self._colour_plot()
        self.fill_plot()
        self._column.addWidget(plot)


_ONE_AT_A_TIME = Lock()


def _loading() -> Task[None]:
    """Load the library for one plot, which is painted before the next may be made."""
    yield Progress("plots")
    with _ONE_AT_A_TIME:
        import_module(LIBRARY)
        time.sleep(BETWEEN_S)
