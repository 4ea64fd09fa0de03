"""The area of a plot, which is made when first shown.

The plotting library takes half a second to load: in a thread, and not before a plot is shown. Qt's types
come into being when first named, and two threads that make them at once crash: the window makes them first.
"""

import logging
import time
from collections.abc import Iterator
from contextlib import suppress
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
QT = ("QtCore", "QtGui", "QtWidgets", "QtSvg", "QtTest", "QtOpenGL", "QtOpenGLWidgets")  # what it imports
TURN_S = 0.005  # of making types, before the window goes on
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
            self._loading = Job(_loading(), "plots")
            self._loading.succeeded.connect(self._make)
            self._loading.failed.connect(log.warning)
            QTimer.singleShot(self.after_ms, self._make_types)

    def _make_types(self) -> None:
        """Make some of Qt's types; after the last of them, load the library."""
        until = time.perf_counter() + TURN_S
        while time.perf_counter() < until:
            if next(_TYPES, None) is None:
                assert self._loading is not None
                self._loading.start()
                return
        QTimer.singleShot(0, self._make_types)

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


def _types() -> Iterator[str]:
    for library in QT:
        with suppress(ImportError):  # the plotting library does without some, too
            module = import_module(f"PySide6.{library}")
            for name in dir(module):
                getattr(module, name)
                yield name


_TYPES = _types()
_ONE_AT_A_TIME = Lock()


def _loading() -> Task[None]:
    """Load the library for one plot, which is painted before the next may be made."""
    yield Progress("plots")
    with _ONE_AT_A_TIME:
        import_module(LIBRARY)
        time.sleep(BETWEEN_S)
