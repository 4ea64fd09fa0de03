"""Beside the Polar room: the axis drawn around its pole, whether it is good enough, and what the uncertainty holds."""

import math
from collections.abc import Callable

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFontMetricsF, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from kochab.polar.error import (
    Imaging,
    Knob,
    PolarError,
    altitude_in_words,
    angle_in_words,
    azimuth_in_words,
    knob_in_words,
    limit_in_words,
    split_in_words,
)
from kochab.polar.pole import Pole, name_of
from kochab.polar.report import RINGS_ARCSEC
from kochab.text.angle_text import round_angle_text
from kochab.text.translation import tr, tr_noop
from kochab.window.polar.frame_fields import zone_box
from kochab.window.polar.setup import SECOND_TIP
from kochab.window.themes import Colours, theme_colours
from kochab.window.widgets import Page, button, column, draw_text, label, row, show_text, styled_frame
from kochab.workflows.session.alignment import AlignmentRequest, FrameSource
from kochab.workflows.session.alignment_state import AlignmentState

# Of the drawing's edge; the last is 90 degrees.
REACHES_ARCSEC = (22.0, 45.0, 90.0, 200.0, 450.0, 1200.0, 2700.0, 6000.0, 14400.0, 43200.0, 324000.0)
LEFT, RIGHT = tr_noop("◂ anticlockwise"), tr_noop("clockwise ▸")
LEAST_RING_PX = 12.0  # smaller rings are left out
LEAST_ELLIPSE_PX = 2.5


class AxisTarget(QWidget):
    """Draws the axis around the pole: altitude up, azimuth clockwise to the right.

    Rings stand at round errors; around the axis is its error ellipse, behind it the trail.
    """

    def __init__(self) -> None:
        super().__init__()
        self.state = AlignmentState()
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(180, 180)
        self.setAccessibleName(tr("The axis around the pole"))

    def sizeHint(self) -> QSize:
        return QSize(340, 340)

    def show_state(self, state: AlignmentState) -> None:
        """Draw a state."""
        self.state, error = state, state.error
        description = tr("Not measured yet.")
        if error is not None:
            ways = {Knob.ALTITUDE: altitude_in_words, Knob.AZIMUTH: azimuth_in_words}
            description = "; ".join(
                words(error) if state.tells(knob) else f"{tr(KNOBS[knob][0])}: {knob_text(state, knob)}"
                for knob, words in ways.items()
            )
        self.setAccessibleDescription(description)
        self.update()

    @property
    def reach_arcsec(self) -> float:
        """The error at the edge; those drawn are well inside, with their ellipses."""
        # Once a bolt was turned the ring follows the newest error alone: the last measurement is an older place.
        before = () if self.state.live or self.state.trail else self.state.measured[-1:]
        errors = [e for e in (self.state.error, *before) if e is not None]
        most = max((e.total_arcsec + e.with_systematics.ellipse_arcsec()[0] for e in errors), default=280.0)
        return next((r for r in REACHES_ARCSEC if r > 1.1 * most), REACHES_ARCSEC[-1])

    def paintEvent(self, event: QPaintEvent) -> None:
        painter, colours = QPainter(self), theme_colours()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.fillRect(self.rect(), QColor(colours.surface))
        line = QFontMetricsF(self.font()).height()
        below = 1 if self._names_fit() else 2  # lines
        box = QRectF(self.rect()).adjusted(4, line + 4, -4, -below * line - 4)
        radius = min(box.width(), box.height()) / 2.0
        scale = radius / self.reach_arcsec
        painter.translate(box.center())  # the pole is at (0, 0) from here on
        self._rings(painter, scale, radius, colours)
        self._names(painter, box, line, colours)
        painter.setClipRect(box.translated(-box.center()))
        # While the axis is followed live, even the last measurement is an older place.
        for before in self.state.measured[:-1] if not self.state.live else self.state.measured:
            self._ellipse(painter, scale, before, QPen(QColor(colours.muted), 1.0))
        painter.setPen(QPen(QColor(colours.muted), 1.2, Qt.PenStyle.DotLine))
        painter.drawPolyline(QPolygonF([QPointF(x * scale, -y * scale) for x, y in self.state.trail]))
        if self.state.error is not None:
            self._ellipse(painter, scale, self.state.error, QPen(QColor(colours.accent), 2.0))
        if self.state.error is not None and self.state.known_error is not None:
            self._cross(painter, _place(self.state.error, scale), colours)
        painter.end()

    def _rings(self, painter: QPainter, scale: float, radius: float, colours: Colours) -> None:
        painter.setBrush(Qt.BrushStyle.NoBrush)
        for ring in RINGS_ARCSEC:
            size = ring * scale
            if not LEAST_RING_PX <= size <= 1.02 * radius:
                continue
            painter.setPen(QPen(QColor(colours.grid), 1.2))
            painter.drawEllipse(QPointF(0, 0), size, size)
            # 34 degrees from the top, where no name of a direction stands.
            at = QPointF(size * math.sin(0.6), -size * math.cos(0.6))
            painter.setPen(QColor(colours.text))
            draw_text(painter, at, round_angle_text(ring), colours.surface)
        painter.setPen(QPen(QColor(colours.good), 2))
        painter.drawLine(-8, 0, 8, 0)
        painter.drawLine(0, -8, 0, 8)

    def _names(self, painter: QPainter, box: QRectF, line: float, colours: Colours) -> None:
        painter.setPen(QColor(colours.muted))
        middle = Qt.AlignmentFlag.AlignCenter
        top, bottom = (edge - box.center().y() for edge in (box.top(), box.bottom()))
        painter.drawText(QRectF(-100, top - line - 2, 200, line), middle, tr("too high"))
        painter.drawText(QRectF(-100, bottom + 2, 200, line), middle, tr("too low"))
        # In the lower corners, where no ring and no axis is drawn.
        lowest = bottom + (2 if self._names_fit() else line + 2)
        side = QRectF(6 - self.width() / 2.0, lowest, self.width() - 12, line)
        painter.drawText(side, Qt.AlignmentFlag.AlignRight, tr(RIGHT))
        painter.drawText(side, Qt.AlignmentFlag.AlignLeft, tr(LEFT))

    def _names_fit(self) -> bool:
        """Whether the names of three directions fit beside each other below the drawing."""
        metrics = QFontMetricsF(self.font())
        side = max(metrics.horizontalAdvance(tr(name)) for name in (LEFT, RIGHT))
        return 2.0 * side + metrics.horizontalAdvance(tr("too low")) + 28 <= self.width()

    def _ellipse(self, painter: QPainter, scale: float, error: PolarError, pen: QPen) -> None:
        long, short, angle = error.with_systematics.ellipse_arcsec()
        painter.save()
        painter.translate(_place(error, scale))
        # The angle runs from azimuth to altitude, which is up; Qt's runs clockwise.
        painter.rotate(-math.degrees(angle))
        painter.setPen(pen)
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.drawEllipse(QPointF(0, 0), max(long * scale, LEAST_ELLIPSE_PX), max(short * scale, LEAST_ELLIPSE_PX))
        painter.restore()

    def _cross(self, painter: QPainter, at: QPointF, colours: Colours) -> None:
        painter.setPen(QPen(QColor(colours.accent), 2.5))
        for dx, dy in ((9, 0), (0, 9), (-9, 0), (0, -9)):
            painter.drawLine(at + QPointF(dx / 2.2, dy / 2.2), at + QPointF(dx, dy))


def _place(error: PolarError, scale: float) -> QPointF:
    """Where the axis is, px from the pole."""
    return QPointF(error.azimuth_on_sky_arcsec * scale, -error.altitude_arcsec * scale)


NONE = "–"


KNOBS = {
    Knob.ALTITUDE: (tr_noop("Altitude"), tr_noop("Altitude error")),
    Knob.AZIMUTH: (tr_noop("Azimuth"), tr_noop("Azimuth error")),
}


def knob_text(state: AlignmentState, knob: Knob) -> str:
    """The error at a knob, or that a drift does not tell it yet."""
    if state.error is None:
        return NONE
    if state.drift is not None and not state.tells(knob):
        return state.drift.unknown(knob)
    return signed_text(state.error, knob)


def signed_text(error: PolarError, knob: Knob) -> str:
    """The error at a knob: positive is too high, or too far clockwise."""
    return f"{'+' if error.knob_arcsec(knob) >= 0 else '−'}{knob_in_words(error, knob)}"


def more_text(state: AlignmentState) -> str:
    """How much farther to rotate RA, or how much longer to track, while it is measured or when it was not reached."""
    if state.drift is not None:
        return state.drift.better
    if state.stage not in ("measure", "turn", "done"):
        return ""
    more, creep = state.more_turn_deg, state.creep_arcsec
    farther = tr("Rotate RA {more:.0f}° farther for a more accurate axis.", more=more) if more else ""
    slip = tr("Optional: turn RA back to the start; checks for slip (±{creep:.0f}″ assumed).", creep=creep)
    return "\n".join(filter(None, (farther, slip if creep else "")))


POLES = {  # without a site of the person's: by the frames' or by the practice telescope's
    Pole.REFRACTED: (
        tr_noop("Aligning to: Refracted pole of the frames’ site"),
        tr_noop("Aligning to: Refracted pole of the practice site"),
    ),
    Pole.TRUE: (
        tr_noop("Aligning to: True pole of the frames’ site"),
        tr_noop("Aligning to: True pole of the practice site"),
    ),
    Pole.HALF_WAY: (
        tr_noop("Aligning to: Half-way pole of the frames’ site"),
        tr_noop("Aligning to: Half-way pole of the practice site"),
    ),
}
MOSTLY = 0.9  # of the ±


class Enough(QWidget):
    """Whether the error is good enough for somebody's frames: a row if they guide, a row if not."""

    def __init__(self) -> None:
        super().__init__()
        self.rows = tuple((label("", "muted", wrap=True), label("", "", wrap=True)) for _ in range(2))
        self.ask = label(tr("Fill in “Your frames” in the set-up to see."), "muted", wrap=True)
        self.setAccessibleName(tr("Good enough?"))
        parts = [widget for pair in self.rows for widget in pair]
        column(*parts, self.ask, on=self, spacing=2, margins=(0, 0, 0, 0))

    def show_error(self, error: PolarError | None, imaging: Imaging | None) -> None:
        """Show how the error stands against what such frames allow."""
        self.ask.setVisible(imaging is None)
        if imaging is None:
            for pair in self.rows:
                for part in pair:
                    part.hide()
            return
        words = tr("{focal:.0f} mm, {exposure:.0f} s, guided", focal=imaging.focal_mm, exposure=imaging.exposure_s)
        for (name, value), title, allowed in zip(
            self.rows, (words, tr("unguided")), (imaging.guided_arcsec, imaging.unguided_arcsec), strict=True
        ):
            show_text(name, title)
            limit = limit_in_words(allowed)
            if error is None:
                show_text(value, tr("allows {limit}", limit=limit), "")
            elif error.total_arcsec <= allowed:
                show_text(value, tr("allows {limit}: yes, already", limit=limit), "good")
            else:
                show_text(value, tr("allows {limit}: not yet", limit=limit), "strong")


class AlignPage(Page):
    """Beside the room: the axis around its pole, whether it is good enough, and what the ± holds."""

    def __init__(self, measure_flexure: Callable[[], None]) -> None:
        super().__init__()
        self.pole = label("", "muted", wrap=True)
        self.zone = zone_box()
        self.asks_zone = QWidget()
        column(label(tr("Clock of the files")), self.zone, on=self.asks_zone, margins=(0, 0, 0, 0))
        self.target = AxisTarget()
        self.enough = Enough()
        self.imaging: Imaging | None = None
        self.split = label("", "", wrap=True)
        self.split.setAccessibleDescription(tr("What the ± holds"))
        self.flexure = button(tr("Measure flexure"), measure_flexure, tip=tr(SECOND_TIP))
        column(
            label(tr("Where the axis points"), "heading", wrap=True),
            self.pole,
            self.asks_zone,
            (self.target, 1),
            styled_frame("rule"),
            label(tr("Good enough?"), "heading", wrap=True),
            self.enough,
            styled_frame("rule"),
            label(tr("What the ± holds"), "heading", wrap=True),
            self.split,
            row(self.flexure, None),
            None,
            on=self,
            spacing=8,
            margins=(4, 8, 4, 4),
        )

    def show_pole(self, request: AlignmentRequest, guess: str) -> None:
        """Name the pole that is aligned to, and say where the axis stood another night."""
        practice = request.source is FrameSource.PRACTICE
        frames, practised = POLES[request.pole]
        text = tr(practised if practice else frames)
        if request.site is not None and not practice:
            named = name_of(request.pole, request.site)
            text = tr("Aligning to: {pole}", pole=named[0].upper() + named[1:])
        self.pole.setText("\n".join(filter(None, (text, guess))))

    def show_state(self, state: AlignmentState) -> None:
        """Show a state."""
        self.target.show_state(state)
        self.enough.show_error(state.bolt_error, self.imaging)
        show_text(self.split, uncertainty_words(state))

    def ask_zone(self, on: bool, chosen: int) -> None:
        """Ask for the clock of the files, where another would give another axis."""
        self.asks_zone.setVisible(on)
        self.zone.setCurrentIndex(chosen)


def uncertainty_words(state: AlignmentState) -> str:
    """What the ± holds, in one line."""
    error = state.known_error
    if error is None:
        return tr("Not measured yet.")
    if state.flexure_measured:
        return f"{split_in_words(error)}."
    sigma = angle_in_words(error.with_systematics.sigma_total_arcsec)
    if error.flexure_along_arcsec > MOSTLY * error.with_systematics.sigma_total_arcsec:
        return tr("±{sigma}, nearly all assumed flexure.", sigma=sigma)
    return tr("±{sigma}, assumed flexure included.", sigma=sigma)
