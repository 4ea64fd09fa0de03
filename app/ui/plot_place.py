"""A place for a plot, which is made when it is first seen.

The plotting library takes half a second to load. That happens in a thread, and not before a plot
is to be seen; each plot is then made in a turn of the event loop of its own.
"""

import logging
import sys
from importlib import import_module

from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QVBoxLayout, QWidget
from shiboken6 import isValid

from app.core.progress import Progress, Task
from app.ui.job import Job
from app.ui.palette import THEMES, Colours

log = logging.getLogger("kochab")
LIBRARY = "pyqtgraph"
BETWEEN_MS = 20  # from one plot to the next: the first one is painted meanwhile


class PlotPlace(QWidget):
    """Holds one plot; a kind of plot says how it is made and what it is to show."""

    after_ms = 0  # to wait before the library is loaded

    def __init__(self, title: str) -> None:
        super().__init__()
        self.colours: Colours = THEMES["dark"]
        self.plot: QWidget | None = None
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(0, 0, 0, 0)
        self.setAccessibleName(title)

    def make_plot(self) -> QWidget:
        """The plot, new; the library may be imported here."""
        raise NotImplementedError

    def fill_plot(self) -> None:
        """Show in :attr:`plot` what this place was given."""
        raise NotImplementedError

    def dress_plot(self) -> None:
        """Give :attr:`plot` the colours of the theme."""
        raise NotImplementedError

    def wear(self, colours: Colours) -> None:
        """The colours of another theme."""
        self.colours = colours
        if self.plot is not None:
            self.dress_plot()

    def refill(self) -> None:
        """There is something else to show."""
        if self.plot is not None:
            self.fill_plot()

    def describe(self, text: str) -> None:
        """What is read out instead of the picture."""
        self.setAccessibleDescription(text)
        if self.plot is not None:
            self.plot.setAccessibleDescription(text)

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        if self.plot is None:
            _LIBRARY.make_for(self)

    def make_now(self) -> None:
        """Make the plot, which takes some ten milliseconds."""
        if self.plot is not None:
            return
        self.plot = plot = self.make_plot()
        plot.setAccessibleName(self.accessibleName())
        plot.setAccessibleDescription(self.accessibleDescription())
        if plot.focusPolicy() != Qt.FocusPolicy.NoFocus:
            self.setFocusProxy(plot)
        self.dress_plot()
        self.fill_plot()
        self._column.addWidget(plot)


class _Library:
    """Loads the library for the first plot, and makes one plot after the other."""

    def __init__(self) -> None:
        self._waiting: list[PlotPlace] = []
        self._job: Job | None = None

    def make_for(self, place: PlotPlace) -> None:
        """Make the plot of ``place`` soon."""
        if place not in self._waiting:
            self._waiting.append(place)
        if self._job is not None:
            return
        if LIBRARY in sys.modules:
            QTimer.singleShot(0, self._next)
        else:
            self._load(place.after_ms)

    def _load(self, after_ms: int) -> None:
        self._job = job = Job(_loading(), "plots")
        job.succeeded.connect(self._has_loaded)
        job.failed.connect(log.warning)
        QTimer.singleShot(after_ms, job.start)

    def _has_loaded(self, _: object) -> None:
        self._job = None
        self._next()

    def _next(self) -> None:
        while self._waiting:
            place = self._waiting.pop(0)
            if isValid(place):
                place.make_now()
                break
        if self._waiting:
            QTimer.singleShot(BETWEEN_MS, self._next)


def _loading() -> Task[None]:
    yield Progress("plots")
    import_module(LIBRARY)


_LIBRARY = _Library()
