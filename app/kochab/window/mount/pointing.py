"""Where the mount reports that it points, where plate solving finds it, and what a sync would do."""

import math
from time import monotonic

from PySide6.QtCore import QPointF, QSize, Qt, QTimer, Signal
from PySide6.QtGui import QColor, QHideEvent, QPainter, QPaintEvent, QPen, QPolygonF, QShowEvent
from PySide6.QtWidgets import QDialog, QFrame, QGridLayout, QSizePolicy, QWidget

from kochab.core.attitude import apart_deg, wrapped
from kochab.core.solution import Solution
from kochab.core.values import frozen
from kochab.gear.mount_events import MountSnapshot
from kochab.text.angle_text import (
    AngleStyle,
    age_text,
    angle_text,
    arcsec_text,
    dec_text,
    ra_text,
    radec_text,
    round_angle_text,
)
from kochab.text.translation import tr, tr_noop
from kochab.window.devices.mount_status import words_of
from kochab.window.themes import Colours, theme_colours
from kochab.window.widgets import (
    Part,
    button,
    column,
    draw_text,
    facts_grid,
    label,
    named,
    position_labels,
    row,
    set_role,
    show_text,
)
from kochab.workflows.sync_mount import SyncOffer

RINGS_ARCSEC = (10, 30, 60, 180, 600, 1800, 3600, 3 * 3600, 10 * 3600, 30 * 3600, 90 * 3600, 180 * 3600)
SHARE = 0.82  # of the half width: the radius of the ring


@frozen
class Offset:
    """From the mount's position to the solved one, degrees on the sky."""

    total_deg: float
    east_deg: float
    north_deg: float

    @classmethod
    def between(cls, mount_deg: tuple[float, float], sky_deg: tuple[float, float]) -> "Offset":
        """Both ICRS degrees; the east part is times cos(Dec)."""
        east = wrapped(sky_deg[0] - mount_deg[0]) * math.cos(math.radians(sky_deg[1]))
        return cls(apart_deg(mount_deg, sky_deg), east, sky_deg[1] - mount_deg[1])

    @property
    def parts_text(self) -> str:
        """East and north part."""
        across, up = angle_text(abs(self.east_deg)), angle_text(abs(self.north_deg))
        east = tr("{angle} east", angle=across) if self.east_deg >= 0 else tr("{angle} west", angle=across)
        north = tr("{angle} north", angle=up) if self.north_deg >= 0 else tr("{angle} south", angle=up)
        return f"{east}, {north}"


def ring_arcsec(total_deg: float) -> int:
    """Radius of the smallest ring around an arrow of this length."""
    # A thousandth more, so that rounding does not take an offset of just one ring to the next.
    return next((r for r in RINGS_ARCSEC if total_deg * 3600.0 <= r * 1.001), RINGS_ARCSEC[-1])


class OffsetArrow(QWidget):
    """An arrow from the mount's position to the solved one, north up and east left."""

    def __init__(self) -> None:
        super().__init__()
        self._offset: Offset | None = None
        self._old = False
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.setToolTip(tr("From the position the mount reports (centre) to the solved position (tip)"))
        self.show_offset(None)

    def sizeHint(self) -> QSize:
        side = max(132, 8 * self.fontMetrics().height())
        return QSize(side, side)

    def show_offset(self, offset: Offset | None, old: bool = False) -> None:
        """Draw it; ``old`` when the mount has moved since."""
        if (offset, old) == (self._offset, self._old) and self.accessibleName():
            return
        self._offset, self._old = offset, old
        text = tr("unknown")
        if offset is not None:
            text = f"{angle_text(offset.total_deg)}: {offset.parts_text}"
        self.setAccessibleName(tr("Mount offset {offset}", offset=text))
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.translate(self.width() / 2, self.height() / 2)  # the position the mount reports is at (0, 0)
        radius = SHARE * min(self.width(), self.height()) / 2
        self._scale(painter, radius, theme_colours())
        if self._offset is not None:
            self._arrow(painter, radius, self._offset, theme_colours())
        painter.end()

    def _scale(self, painter: QPainter, radius: float, colours: Colours) -> None:
        painter.setPen(QPen(QColor(colours.line), 1.2))
        for size in (radius, 2.5):
            painter.drawEllipse(QPointF(0, 0), size, size)
        painter.setPen(QColor(colours.muted))
        draw_text(painter, QPointF(0, -radius), tr("N"), colours.surface)
        draw_text(painter, QPointF(-radius, 0), tr("E"), colours.surface)
        if self._offset is not None:
            ring = round_angle_text(ring_arcsec(self._offset.total_deg))
            draw_text(painter, QPointF(0, radius), ring, colours.surface)

    def _arrow(self, painter: QPainter, radius: float, offset: Offset, colours: Colours) -> None:
        colour = QColor(colours.faint if self._old else colours.accent)
        long = radius * min(1.0, offset.total_deg * 3600.0 / ring_arcsec(offset.total_deg))
        # The arrow then runs along x; east is to the left, and the screen's y runs down.
        painter.rotate(math.degrees(math.atan2(-offset.north_deg, -offset.east_deg)))
        painter.setPen(QPen(colour, 2.4, Qt.PenStyle.DashLine if self._old else Qt.PenStyle.SolidLine))
        painter.drawLine(QPointF(0, 0), QPointF(long, 0))
        if long > 8.0:
            painter.setBrush(colour)
            painter.setPen(Qt.PenStyle.NoPen)
            painter.drawPolygon(QPolygonF([QPointF(long, 0), QPointF(long - 11, 5), QPointF(long - 11, -5)]))


AGREES_DEG = 1.0 / 60.0  # as near the mount's own place and the solved one are as good as one
OFTEN_MS = 1000


class PointingCard(QFrame):
    """Where it points: as the sky says, or where that is not known, or old, as the mount says."""

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("card")
        self.state = named(label("", "muted", wrap=True), tr("State of the mount"))
        self.ra, self.dec = position_labels()
        self.offset = named(label("", wrap=True), tr("Offset"))
        self._known, self._style = MountSnapshot(), AngleStyle.SEXAGESIMAL
        self._solution: Solution | None = None  # the last one, and when it came by the clock of this computer
        self._solved_s = 0.0
        place = row(self.ra, self.dec, None, spacing=14)
        column(self.state, place, self.offset, on=self, spacing=2, margins=(14, 10, 14, 10))
        self._clock = QTimer(self, interval=OFTEN_MS)
        self._clock.timeout.connect(self._say)

    def show_known(self, known: MountSnapshot, style: AngleStyle) -> None:
        """Show a snapshot."""
        if known.sight is not None and known.sight.solution is not self._solution:
            self._solution, self._solved_s = known.sight.solution, monotonic()
        self._known, self._style = known, style
        self._say()

    def showEvent(self, event: QShowEvent) -> None:
        self._clock.start()
        self._say()

    def hideEvent(self, event: QHideEvent) -> None:
        self._clock.stop()

    def _say(self) -> None:
        known, report, sight = self._known, self._known.report, self._known.sight
        place = None if report is None else report.icrs_deg
        if sight is not None and not known.moved_since:
            place = sight.solution.ra_dec_deg
        texts = ("", "") if place is None else (ra_text(place[0], self._style), dec_text(place[1], self._style))
        for one, text in zip((self.ra, self.dec), texts, strict=True):
            show_text(one, text)
            set_role(one, "value_old" if known.phase == "lost" else "value")
        show_text(self.offset, self._offset_words())
        show_text(self.state, state_text(known), "wrong" if known.phase == "lost" or known.alarm else "muted")

    def _offset_words(self) -> str:
        """How old the solved place is, and how far the mount is from it."""
        known = self._known
        if known.report is None:
            return ""
        if known.sight is None:
            return tr("as the mount reports, not solved yet")
        offset = Offset.between(known.sight.mount_deg, known.sight.solution.ra_dec_deg)
        total, age = angle_text(offset.total_deg), age_text(monotonic() - self._solved_s)
        if known.moved_since:
            return tr("as the mount reports. OLD: solved {age} ago, before it moved, {angle} off", age=age, angle=total)
        if offset.total_deg < AGREES_DEG:
            return tr("solved {age} ago · mount agrees within {angle}", age=age, angle=total)
        parts = offset.parts_text
        return tr("solved {age} ago · mount is off by {angle} ({parts})", age=age, angle=total, parts=parts)


PHASES = {
    "off": tr_noop("Not connected"),
    "connecting": tr_noop("Connecting…"),
    "leaving": tr_noop("Disconnecting…"),
    "lost": tr_noop("CONNECTION LOST. The position shown is old. Reconnecting automatically."),
}


def state_text(known: MountSnapshot) -> str:
    """The state of the mount in words."""
    if known.phase != "on":
        return tr(PHASES[known.phase])
    if known.report is None:
        return known.trouble or tr("Reading the position…")
    words = [tr("Connected"), *words_of(known.report.state)]
    if known.report.altaz_deg is None:  # an alignment may have found it in a frame since
        words.append(tr("no site: disconnect and set yours to allow motion"))
    trouble = " ".join(dict.fromkeys(t for t in (known.alarm, known.trouble) if t))
    return ", ".join(words) + (f". {trouble}" if trouble else "")


NO_SYNC = tr_noop("Kochab can slew by the offset instead.")
IF_REFUSED = tr_noop("If the mount rejects the sync, Kochab slews by the offset instead.")


class SyncDialog(QDialog):
    """Shows a sync before it is done; ``wanted`` when it is accepted. ``mount_deg`` is ICRS."""

    wanted = Signal(object)  # SyncOffer

    def __init__(self, parent: QWidget, offer: SyncOffer, mount_deg: tuple[float, float], style: AngleStyle) -> None:
        super().__init__(parent)
        self.offer = offer
        self.setWindowTitle(tr("Sync the mount"))
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        offset = Offset.between(mount_deg, offer.sky_deg)
        self.arrow = OffsetArrow()
        self.arrow.show_offset(offset)
        preview = offer.preview
        line = row(self.arrow, (_numbers(offer, offset, mount_deg, style), 1))
        parts: list[Part] = [label(tr("Mount is off by {angle}", angle=angle_text(offset.total_deg)), "heading"), line]
        for sentences, role in ((preview.refusals, "wrong"), (preview.confirmations, "wrong"), (preview.warnings, "")):
            parts += [label(sentence, role, wrap=True) for sentence in sentences]
        if offer.no_sync:
            parts.append(label(f"{offer.no_sync} {tr(NO_SYNC)}", "", wrap=True))
        elif preview.allowed and len(offer.evidence.centres_deg) > 1:  # one frame alone is no ground for a slew
            parts.append(label(tr(IF_REFUSED), "muted", wrap=True))
        self.yes = button(_yes(offer), self._accept, "main")
        self.yes.setVisible(preview.allowed)
        self.no = button(tr("Cancel") if preview.allowed else tr("Close"), self.reject)
        parts.append(row(None, self.yes, self.no))
        column(*parts, on=self, spacing=10, margins=(20, 20, 20, 16))
        # Space must not confirm what needs a second look.
        (self.no if preview.confirmations or not preview.allowed else self.yes).setFocus()
        self.setMinimumWidth(520)

    def _accept(self) -> None:
        self.wanted.emit(self.offer)
        self.accept()


def _yes(offer: SyncOffer) -> str:
    if offer.no_sync:
        return tr("Slew by the offset")
    return tr("Sync anyway") if offer.preview.confirmations else tr("Sync")


def _numbers(offer: SyncOffer, offset: Offset, mount_deg: tuple[float, float], style: AngleStyle) -> QGridLayout:
    frames = len(offer.evidence.centres_deg)
    rows = (
        (tr("Mount reports"), radec_text(*mount_deg, style)),
        (tr("Plate solve"), radec_text(*offer.sky_deg, style)),
        (tr("Offset"), offset.parts_text),
        (tr("Based on"), tr("two frames that agree") if frames > 1 else tr("the open frame alone")),
        (tr("Residual"), arcsec_text(offer.solution.rms_arcsec)),
    )
    return facts_grid(6, *((title, label(text)) for title, text in rows))
