"""The limits of a mount's motions: the horizon, drawn over azimuth with the mount in it, and the meridian."""

from dataclasses import replace

import numpy as np
from PySide6.QtCore import QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QMouseEvent, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from kochab.core.errors import UsageError
from kochab.gear.mounts.motion_plan import Horizon, Limits
from kochab.gear.profiles import BOUNDS, read_horizon
from kochab.text.translation import tr, tr_noop
from kochab.window.dialogs import ask_frames
from kochab.window.themes import Colours, theme_colours
from kochab.window.widgets import button, column, draw_text, form, label, number_field, row

STEP_DEG = 5.0
AZIMUTHS_DEG = np.arange(0.0, 360.0, STEP_DEG)
EVERY_DEG = np.arange(0.0, 361.0)  # both ends of the drawing are north
WAYS = (tr_noop("N"), tr_noop("E"), tr_noop("S"), tr_noop("W"), tr_noop("N"))
DRAW_TIP = tr_noop("Draw trees and houses with the left button, erase them with the right one")
FILE_TIP = tr_noop("A text file with lines of azimuth and altitude, degrees")
PAST_TIP = tr_noop("How far a German mount may track past the meridian before it must flip")


class HorizonPicture(QWidget):
    """Altitude over azimuth, from north over east: what is too low or too high, and where the mount points."""

    drawn = Signal(object)  # Horizon

    def __init__(self) -> None:
        super().__init__()
        self.limits = Limits()
        self.mount_deg: tuple[float, float] | None = None  # altitude and azimuth
        self._drawing = False
        self._last: tuple[int, float] | None = None  # step of azimuth and altitude of the stroke so far
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setToolTip(tr(DRAW_TIP))
        self.show_limits(Limits())

    def sizeHint(self) -> QSize:
        height = self.fontMetrics().height()
        return QSize(16 * height, 8 * height)

    def show_limits(self, limits: Limits) -> None:
        """Draw these, unless a person is drawing."""
        if not self._drawing:
            self.limits = limits
            self._describe()

    def show_mount(self, altaz_deg: tuple[float, float] | None) -> None:
        """Altitude and azimuth of the mount; None when they are not known."""
        self.mount_deg = altaz_deg
        self._describe()

    def _describe(self) -> None:
        floors = self.limits.floors_deg(EVERY_DEG)
        highest = int(np.argmax(floors))
        low, high = floors.min(), floors[highest]
        words = tr("Horizon limit from {low:.0f}° to {high:.0f}° (azimuth {at}°)", low=low, high=high, at=highest)
        if self.mount_deg is not None:
            up, round_ = self.mount_deg
            mount = tr("the mount is {height:.0f}° high at azimuth {azimuth:.0f}°", height=up, azimuth=round_)
            words = f"{words}; {mount}"
        self.setAccessibleName(words)
        self.update()

    # -- drawing ---------------------------------------------------------------------------------

    @property
    def _sky(self) -> QRectF:
        """Where azimuth and altitude are drawn; the letters stand below."""
        margin = self.fontMetrics().height()
        return QRectF(self.rect()).adjusted(0.6 * margin, 0.3 * margin, -0.6 * margin, -1.2 * margin)

    def _at(self, azimuth_deg: float, altitude_deg: float) -> QPointF:
        sky = self._sky
        return QPointF(
            sky.left() + azimuth_deg / 360.0 * sky.width(), sky.bottom() - max(0.0, altitude_deg) / 90.0 * sky.height()
        )

    def paintEvent(self, event: QPaintEvent) -> None:
        painter, colours, sky = QPainter(self), theme_colours(), self._sky
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(QPen(QColor(colours.line), 1.2))
        painter.setBrush(QColor(colours.window))
        painter.drawRect(sky)
        self._forbidden(painter, colours)
        painter.setPen(QColor(colours.muted))
        for i, way in enumerate(WAYS):
            place = QPointF(self._at(90.0 * i, 0.0).x(), sky.bottom() + 0.7 * self.fontMetrics().height())
            draw_text(painter, place, tr(way), colours.surface)
        if self.mount_deg is not None:
            altitude, azimuth = self.mount_deg
            painter.setPen(QPen(QColor(colours.accent), 2.0))
            painter.setBrush(Qt.BrushStyle.NoBrush)
            here, size = self._at(azimuth % 360.0, altitude), 0.35 * self.fontMetrics().height()
            painter.drawEllipse(here, size, size)
            for step in (QPointF(1.7 * size, 0.0), QPointF(0.0, 1.7 * size)):
                painter.drawLine(here - step, here + step)
        painter.end()

    def _forbidden(self, painter: QPainter, colours: Colours) -> None:
        """What is below the horizon limit or above the highest altitude."""
        edges = [
            self._at(azimuth, floor)
            for azimuth, floor in zip(EVERY_DEG, self.limits.floors_deg(EVERY_DEG), strict=True)
        ]
        painter.setPen(QPen(QColor(colours.muted), 1.2))
        painter.setBrush(QColor(colours.hover))
        painter.drawPolygon(QPolygonF([self._at(0.0, 0.0), *edges, self._at(360.0, 0.0)]))
        if self.limits.highest_altitude_deg < 90.0:
            painter.drawRect(QRectF(self._at(0.0, 90.0), self._at(360.0, self.limits.highest_altitude_deg)))

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self._drawing, self._last = True, None
        self._draw(event)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        self._draw(event)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        self._drawing = False
        # Once a stroke: each keeps the profile and orders the guard's new limits.
        self.drawn.emit(self.limits.horizon_deg)

    def _draw(self, event: QMouseEvent) -> None:
        """Draw the horizon along the pointer's way, or erase it there."""
        sky, at = self._sky, event.position()
        which = round(min(max((at.x() - sky.left()) / sky.width(), 0.0), 1.0) * len(AZIMUTHS_DEG))
        # The drawn horizon alone: the horizon limit must not become a part of it.
        floors = replace(self.limits, lowest_altitude_deg=0.0).floors_deg(AZIMUTHS_DEG)
        erased = event.buttons() & Qt.MouseButton.RightButton
        height = 0.0 if erased else min(max((sky.bottom() - at.y()) / sky.height() * 90.0, 0.0), 89.0)
        # A quick stroke skips steps between two events: a gap would let a slew through the tree.
        (start, before), self._last = self._last or (which, height), (which, height)
        n = abs(which - start) + 1
        floors[np.linspace(which, start, n, dtype=int) % len(floors)] = np.linspace(height, before, n).round()
        drawn = tuple(zip(AZIMUTHS_DEG.tolist(), floors.tolist(), strict=True))
        self.limits = replace(self.limits, horizon_deg=drawn if floors.any() else ())
        self._describe()


class LimitsBox(QWidget):
    """The picture, the horizon from a file, and how low and how far past the meridian a mount may go."""

    changed = Signal(dict)  # fields of the equipment profile, and their new values
    message = Signal(str, str)  # a sentence and its role

    def __init__(self) -> None:
        super().__init__()
        self.picture = HorizonPicture()
        self.lowest = number_field(tr("Horizon limit"), *BOUNDS["lowest_altitude_deg"][:2], 5.0, 0, "°")
        self.past = number_field(tr("Past the meridian"), *BOUNDS["past_meridian_deg"][:2], 15.0, 0, "°", tr(PAST_TIP))
        self.file = button(tr("Horizon file…"), self._choose, "", tr(FILE_TIP))
        self.clear = button(tr("Clear horizon"), lambda: self._keep_horizon(()), "", tr("Keep the horizon limit alone"))
        fields = form((tr("Horizon limit"), self.lowest), (tr("Past meridian"), self.past), spacing=6)
        column(
            label(tr("Limits"), "heading"),
            self.picture,
            fields,
            row(self.file, self.clear, None),
            on=self,
            margins=(0, 0, 0, 0),
        )
        self.picture.drawn.connect(self._keep_horizon)
        self.lowest.editingFinished.connect(lambda: self.changed.emit({"lowest_altitude_deg": self.lowest.value()}))
        self.past.editingFinished.connect(lambda: self.changed.emit({"past_meridian_deg": self.past.value()}))

    def show_limits(self, limits: Limits) -> None:
        """Fill the fields, but for one that is being typed in."""
        self.picture.show_limits(limits)
        for field, value in ((self.lowest, limits.lowest_altitude_deg), (self.past, limits.past_meridian_deg)):
            if not field.hasFocus():
                field.setValue(value)
        self.clear.setEnabled(bool(limits.horizon_deg))

    def _keep_horizon(self, horizon: Horizon) -> None:
        self.changed.emit({"horizon_deg": horizon or None})

    def _choose(self) -> None:
        for path in ask_frames(self, "", tr("Open a horizon"), tr("Horizon (*.txt *.hrz *.csv);;All files (*)"))[:1]:
            self.read(str(path))

    def read(self, path: str) -> None:
        """Take the horizon of a file."""
        try:
            self._keep_horizon(read_horizon(path))
        except UsageError as error:
            self.message.emit(str(error), "wrong")
