"""Push-to and planetarium programs: a target, an arrow to it with the distance, and who sees the telescope."""

from collections.abc import Callable
from functools import partial
from time import monotonic

from PySide6.QtCore import QObject, QPointF, QSignalBlocker, QSize, Qt, QTimer, Signal
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPolygonF
from PySide6.QtWidgets import QApplication, QLineEdit, QWidget

from kochab.core.errors import RefusedError
from kochab.core.progress import Progress, Task
from kochab.gear.mount_line import MakeTask
from kochab.text.translation import tr, tr_noop
from kochab.window.devices.mount_control import MountControl
from kochab.window.job import Job
from kochab.window.services import Services
from kochab.window.themes import theme_colours
from kochab.window.tones import Cue, Cues
from kochab.window.widgets import Page, button, column, label, row, show_text, switch, text_field
from kochab.workflows.goto_target import Target, resolved
from kochab.workflows.live.update import LiveUpdate
from kochab.workflows.session.wiring import TelescopePorts
from kochab.workflows.telescope.gyro_aid import pointing_aid
from kochab.workflows.telescope.offered import OfferedTelescope
from kochab.workflows.telescope.push_to import PushTo, push_to

WHAT = tr_noop(
    "SkySafari, Stellarium, KStars and ASCOM programs see where the telescope points, and their gotos set the target."
)
CLEAR_SHARE = 0.25
"""A distance that changed by this share is played."""
MOVES_MS, CLOSING_S = 200, 1.0
NO_TARGET = tr_noop("Set a target; each solved frame then shows which way to push.")
NO_POINTING = tr_noop("Start the camera: its first solved frame shows the way.")


class Arrow(QWidget):
    """The way to the target as a person behind the telescope sees it, up for higher; a ring once it is there."""

    def __init__(self) -> None:
        super().__init__()
        self.way: PushTo | None = None
        self.setMinimumSize(96, 96)
        self.setAccessibleName(tr("Arrow to the target"))

    def sizeHint(self) -> QSize:
        return QSize(140, 140)

    def paintEvent(self, event: QPaintEvent) -> None:
        way = self.way
        if way is None or way.below:
            return
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        colours = theme_colours()
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(Qt.GlobalColor.transparent)
        painter.translate(self.width() / 2.0, self.height() / 2.0)
        radius = min(self.width(), self.height()) / 2.0 - 4.0
        if way.there:
            pen = painter.pen()
            pen.setStyle(Qt.PenStyle.SolidLine)
            pen.setColor(QColor(colours.good))
            pen.setWidthF(radius / 6.0)
            painter.setPen(pen)
            painter.drawEllipse(QPointF(0.0, 0.0), radius * 0.7, radius * 0.7)
        else:
            painter.setBrush(QColor(colours.muted if way.old else colours.accent))
            painter.rotate(way.arrow_deg)
            shape = ((0.0, -1.0), (0.6, -0.25), (0.22, -0.25), (0.22, 1.0), (-0.22, 1.0), (-0.22, -0.25), (-0.6, -0.25))
            painter.drawPolygon(QPolygonF([QPointF(x * radius, y * radius) for x, y in shape]))
        painter.end()


class _Orders(QObject):
    """Orders of programs, which come in a thread of theirs, on their way to the window's mount."""

    wished = Signal(str, object, object)
    stopped = Signal()

    def __init__(self, mount: MountControl) -> None:
        super().__init__(mount)
        self._mount = mount
        self.wished.connect(self._do)
        self.stopped.connect(mount.stop)

    @property
    def busy(self) -> bool:
        return bool(self._mount.known.busy)

    def order(self, name: str, make: MakeTask, failed: Callable[[str], None]) -> None:
        self.wished.emit(name, make, failed)

    def stop(self) -> None:
        if (line := self._mount.connection.line) is not None:
            line.stop()  # now, whatever the window is at
        self.stopped.emit()

    def _do(self, name: str, make: MakeTask, failed: Callable[[str], None]) -> None:
        try:
            task = self._mount.order(name, make)
        except RefusedError as error:
            failed(str(error) or tr("The mount is not connected."))
        else:
            task.failed.connect(failed)
            task.cancelled.connect(partial(failed, tr("Stopped.")))


class PushPanel(Page):
    """Keeps the telescope that is offered; ``way`` is told whenever it is written anew."""

    way = Signal(object)  # PushTo | None
    status = Signal(str)

    def __init__(self, services: Services) -> None:
        super().__init__()
        self._services = services
        self._orders = _Orders(services.mount)
        self.telescope = OfferedTelescope(self.status.emit)
        self.cues = Cues(QApplication.beep)
        self._ports: TelescopePorts | None = None
        self._job: Job | None = None
        self._solved = 0
        self._played_deg: float | None = None
        self._build()
        self._moves = QTimer(self, interval=MOVES_MS)  # by encoders or a gyroscope, between two frames
        self._moves.timeout.connect(self.write)
        self.status.connect(self._say)
        services.mount.changed.connect(self._follow_mount)
        services.jobs.closing.connect(self._close)
        self.write()

    def _build(self) -> None:
        self.target: QLineEdit = text_field(tr("Target"), tr("M 42, Vega, or 83.82 -5.39"))
        self.set = button(tr("Set &target"), self._ask_target, tip=tr("Show the way to this target"))
        self.target.returnPressed.connect(self.set.click)
        self.arrow = Arrow()
        self.distance = label("", "heading")
        self.words = label("", wrap=True)
        self.age = label("", "wrong", wrap=True)
        self.tones = switch(tr("T&ones: nearer, further, there"), self.cues.description)
        self.tones.toggled.connect(self._sound)
        self.aid = switch(tr("Encoders or phone"), tr("Move the arrow between two solves, which align them"))
        self.aid.toggled.connect(self._use_aid)
        self.aid_address = text_field(
            tr("Port of the encoders, or the phone's address"),
            tr("COM3 or http://PHONE:8080"),
            tr(
                "A box of encoders (DSC protocol) at a serial port or tcp://HOST:PORT, or a phone on the tube: its "
                "gyroscope, shown by the app phyphox with remote access on"
            ),
        )
        self.aid_address.setText(self._services.settings.text("encoders", ""))
        self.offer = switch(tr("&Offer to planetarium programs"))
        self.offer.setEnabled(self._services.wiring.offer_telescope is not None)
        self.offer.toggled.connect(self._toggle)
        self.lan = switch(tr("Local network too, unencrypted"), tr("For a phone or tablet; else this computer only"))
        self.remote = switch(
            tr("Stellarium follows"),
            tr("Its plug-in Remote Control turns its view to the telescope; select an object there to push to it"),
        )
        self.remote_address = text_field(
            tr("Address of Stellarium"),
            "127.0.0.1:8090",
            tr("HOST or HOST:PORT; with a password, :PASSWORD@HOST. Empty: this computer"),
        )
        self.move_mount = switch(tr("Let them move the mount"), tr("Within its limits; they may always stop it"))
        self.move_mount.toggled.connect(self._allow)
        self.state = label(tr("Off."), "muted", wrap=True)
        self.programs = label("", wrap=True)
        self.message = label("", "muted", wrap=True)
        what = label(tr(WHAT), "muted", wrap=True)
        reading = column(self.distance, self.words, self.age, None)
        parts = (
            row((self.target, 1), self.set),
            row(self.arrow, (reading, 1)),
            self.tones,
            row(self.aid, (self.aid_address, 1)),
            self.offer,
            what,
            self.lan,
            row(self.remote, (self.remote_address, 1)),
            self.move_mount,
            self.state,
            self.programs,
            self.message,
        )
        column(*parts, on=self, spacing=8, margins=(10, 10, 10, 10)).addStretch(1)

    # -- What is seen ------------------------------------------------------------------------------

    def see(self, update: LiveUpdate) -> None:
        """Take the newest frame of the stream."""
        if update.track.solution is not None and update.shot.number != self._solved:
            self._solved = update.shot.number
            self.telescope.see_solution(update.track.solution, update.shot.shutter_s)
        self.write()

    def _follow_mount(self) -> None:
        known = self._services.mount.known
        report = known.report if known.phase == "on" else None
        self.telescope.mount = self._orders if report is not None else None
        slewing = report is not None and (bool(report.state.slewing) or report.target_deg is not None)
        self.telescope.see_mount(None if report is None else report.icrs_deg, slewing)
        self.write()

    def write(self) -> None:
        """Show the way, and who is connected."""
        site = self._services.mount.kept.site
        if site != self.telescope.site:
            self.telescope.site = site
            if self.aid.isChecked():
                self._use_aid(True)  # where the base stands is another place
        way = push_to(self.telescope, monotonic())
        self._play(self.arrow.way, way)
        self.arrow.way = way
        self.arrow.setAccessibleDescription("" if way is None else way.words)
        self.arrow.update()
        self.distance.setText("" if way is None else way.distance_text)
        waiting = NO_TARGET if self.telescope.target is None else NO_POINTING
        show_text(self.words, tr(waiting) if way is None else way.words, "muted" if way is None else "")
        show_text(self.age, "" if way is None else way.age_words, "wrong" if way is None or way.old else "muted")
        show_text(self.programs, self.telescope.connected_text if self._ports is not None else "")
        self.way.emit(way)

    def _play(self, before: PushTo | None, now: PushTo | None) -> None:
        if now is None or (before is not None and before.target != now.target):
            self._played_deg = None
        if now is None:
            return
        was_there, was_old = before is not None and before.there, before is not None and before.old
        if now.there and not was_there:
            self._played_deg = now.distance_deg
            self.cues.play(Cue.STOP)
        elif now.old and not was_old:
            self.cues.play(Cue.LOST)
        elif self._played_deg is None:
            self._played_deg = now.distance_deg
        elif abs(now.distance_deg - self._played_deg) > CLEAR_SHARE * self._played_deg and not now.there:
            self.cues.play(Cue.NEARER if now.distance_deg < self._played_deg else Cue.FURTHER)
            self._played_deg = now.distance_deg

    # -- What a person does ------------------------------------------------------------------------

    def _ask_target(self) -> None:
        job = self._services.jobs.run(
            resolved(self.target.text(), self.telescope.now(), self.telescope.site), "push-to"
        )
        job.succeeded.connect(self._aim)
        job.failed.connect(self._say)

    def _aim(self, target: Target) -> None:
        self.telescope.target = target
        self._say("")
        self.write()

    def _say(self, sentence: str) -> None:
        """The newest sentence; a goto of a program has changed the target."""
        show_text(self.message, sentence)
        self.write()

    def _sound(self, on: bool) -> None:
        self.cues.on = on

    def _allow(self, on: bool) -> None:
        self.telescope.may_move = on

    def _use_aid(self, on: bool) -> None:
        self._leave_aid(0.0)
        address = self.aid_address.text().strip()
        if on and not address:
            with QSignalBlocker(self.aid):
                self.aid.setChecked(False)
            self._say(tr("Give the port of the encoder box, or the phone's address, first."))
            return
        self.aid_address.setEnabled(not on)
        if on:
            self._services.settings.keep("encoders", address)
            self.telescope.aid = pointing_aid(address, self.status.emit, self.telescope.now, self.telescope.site)
            self._moves.start()
        self.write()

    def _leave_aid(self, wait_s: float) -> None:
        self._moves.stop()
        aid, self.telescope.aid = self.telescope.aid, None
        if aid is not None:
            aid.stop(wait_s)

    def _toggle(self, on: bool) -> None:
        for choice in (self.lan, self.remote, self.remote_address):
            choice.setEnabled(not on)
        if not on:
            self.close_ports()
            show_text(self.state, tr("Off."), "muted")
            self.write()
            return
        show_text(self.state, tr("Switching on…"), "muted")
        remote = self.remote_address.text() if self.remote.isChecked() else None
        self._job = job = self._services.jobs.run(self._open(self.lan.isChecked(), remote), "telescope")
        job.succeeded.connect(self._opened)
        job.failed.connect(self._failed)

    def _open(self, lan: bool, remote: str | None) -> Task[TelescopePorts]:
        yield Progress("ports")
        offer = self._services.wiring.offer_telescope
        assert offer is not None
        return offer(self.telescope, lan, remote)

    def _opened(self, ports: TelescopePorts) -> None:
        self._ports = ports
        if not self.offer.isChecked():  # switched off meanwhile
            self.close_ports()
            return
        show_text(self.state, "\n".join(ports.lines), "good")
        self.write()

    def _failed(self, sentence: str) -> None:
        self.offer.setChecked(False)
        show_text(self.state, sentence, "wrong")

    def close_ports(self) -> None:
        """Switch off at once, as when the window closes."""
        ports, self._ports = self._ports, None
        if ports is not None:
            ports.stop()
        self.cues.close()

    def _close(self) -> None:
        self.close_ports()
        self._leave_aid(CLOSING_S)
