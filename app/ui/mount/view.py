"""The Mount view: connect, compare, sync, go, centre, nudge, and stop."""

from functools import partial

from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QCheckBox, QHBoxLayout, QProgressBar, QVBoxLayout, QWidget

from app.core.hint import Site
from app.core.progress import Progress
from app.mounts.ports import PortInfo
from app.mounts.probe import Diagnosis
from app.ui.job import Job
from app.ui.mount import search
from app.ui.mount.bring_mode import BringMode
from app.ui.mount.camera_box import CameraBox
from app.ui.mount.connect_box import ConnectBox
from app.ui.mount.corner import StopCorner
from app.ui.mount.desk import Desk
from app.ui.mount.eye import CameraWish
from app.ui.mount.go_box import GoBox
from app.ui.mount.nudge_pad import NudgePad
from app.ui.mount.pointing_box import PointingBox
from app.ui.mount.reasoned import ReasonedButton, ReasonedSwitch
from app.ui.mount.reasons import reasons
from app.ui.mount.stop_key import KEY, StopKey
from app.ui.mount.sync_dialog import SyncDialog
from app.ui.mount.targets import names_to_offer
from app.ui.mount.wishes import MountWish, keep_camera, keep_mount, kept_camera, kept_mount
from app.ui.palette import Colours
from app.ui.services import Services
from app.ui.widgets import button, card, label, rule, scrolled, set_role
from app.workflows.sync_mount import SyncOffer


class MountView(QWidget):
    """Widgets over one :class:`Desk`, which is where everything is known and asked for."""

    def __init__(self, services: Services) -> None:
        super().__init__()
        self.setObjectName("page")
        self._services = services
        self.desk = Desk(services)
        self.desk.setParent(self)
        self.connect_box = ConnectBox(services.wiring.practice is not None)
        self.camera = CameraBox()
        self.take = ReasonedButton(
            "Take a frame", self.desk.take_frame, "See where it really points"
        )
        self.sync = ReasonedButton(
            "Sync…", self.desk.offer_sync, "Look twice, then tell the mount where it is", "main"
        )
        self.undo = ReasonedButton("Undo sync", self.desk.undo_sync, "Take the last sync back")
        self.ask = ReasonedButton(
            "Why?", self.desk.ask_why,
            "Take a frame and name the cause: summer time, epoch, site, hemisphere, cone",
        )  # fmt: skip
        self.bring = ReasonedButton(
            "Bring a star here…", self._bring, "Click a star in the frame, then where it shall go"
        )
        self.pad = NudgePad(self.bring)
        self.tracking = ReasonedSwitch("Tracking", "Follow the sky")
        self.after = QCheckBox("a frame after each move")
        self.after.setToolTip("Take one and solve it when a goto or a nudge is over")
        self.go = GoBox(self.after)
        self.pointing = PointingBox(self.tracking)
        self.leave = button(
            "Disconnect", self.desk.disconnect_mount, "", "Stop, and close the port"
        )
        self.stop = ReasonedButton(
            f"STOP  ({KEY})", self.stop_all, f"Stop the mount now; {KEY} does it from anywhere",
            "stop",
        )  # fmt: skip
        self.cancel_find = button("Cancel", self._cancel_find)
        self.name = label("", "heading", wrap=True)
        self.said, self.why = label("", "muted", wrap=True), label("", "muted", wrap=True)
        self.bar = QProgressBar()
        self._finding: Job | None = None
        self._bringing = BringMode(services, self.desk, self._say)
        self._corner = StopCorner(self.stop_all)
        self._key = StopKey(self.stop_all, self)
        self._lay_out()
        self._listen()
        self._restore()
        self._show()

    # set-up -----------------------------------------------------------------------------------
    def _lay_out(self) -> None:
        self.bar.setTextVisible(False)
        self.bar.setRange(0, 1000)
        self.bar.setAccessibleName("Progress of the mount")
        self.bar.setVisible(False)
        self.cancel_find.setVisible(False)
        top = QHBoxLayout()
        top.addWidget(self.name, 1)
        top.addWidget(self.leave)
        looking = _line(self.take, self.sync, self.undo, self.ask)
        inside = QWidget()
        inside.setObjectName("page")
        column = QVBoxLayout(inside)
        column.setContentsMargins(4, 4, 4, 4)
        column.setSpacing(10)
        column.addLayout(top)
        self.connection = _card(self.connect_box)
        column.addWidget(self.connection)
        self.asking = _card(self.pointing, looking, self.camera)
        column.addWidget(self.asking)
        self.moving = _card(self.go, rule(), self.pad)
        column.addWidget(self.moving)
        column.addStretch(1)
        doing = QHBoxLayout()
        doing.addWidget(self.bar, 1)
        doing.addWidget(self.cancel_find)
        outer = QVBoxLayout(self)
        outer.setContentsMargins(8, 8, 8, 8)
        self.area = scrolled(inside)
        outer.addWidget(self.area, 1)
        outer.addWidget(self.said)
        outer.addWidget(self.why)
        outer.addLayout(doing)
        outer.addWidget(self.stop)
        self.why.setVisible(False)

    def _listen(self) -> None:
        desk, box = self.desk, self.connect_box
        desk.changed.connect(self._show)
        desk.said.connect(self._say)
        desk.progressed.connect(self._progress)
        desk.offered.connect(self._offer)
        box.connect_wanted.connect(self._connect)
        box.practice_wanted.connect(self.practise)
        box.find_wanted.connect(self.find_mount)
        box.site_given.connect(self._site)
        box.trouble.connect(lambda sentence: self._say(sentence, "wrong"))
        self.camera.chosen.connect(self._camera_chosen)
        self.go.goto_wanted.connect(desk.goto)
        self.go.centre_wanted.connect(desk.centre)
        self.pad.nudge_wanted.connect(desk.nudge)
        self.tracking.wanted.connect(desk.track)
        for control in self._controls().values():
            control.explained.connect(self._explain)
        self.tracking.explained.connect(self._explain)
        self.pad.explained.connect(self._explain)
        session = self._services.session
        for signal in (session.solved, session.unsolved, session.opened):
            signal.connect(lambda _=None: self._show())
        self._services.looks.changed.connect(self._dress)

    def _restore(self) -> None:
        settings = self._services.settings
        self.connect_box.show_wish(kept_mount(settings))
        self.connect_box.show_site(settings.site)
        camera = kept_camera(settings)
        self.camera.show_wish(camera)
        self.desk.use_camera(camera if camera.source else None)
        self.after.toggled.connect(self._after)
        self.after.setChecked(settings.flag("mount/after", True))
        self._dress(self._services.looks.colours)
        names = self._services.jobs.run(names_to_offer(), "names")
        names.succeeded.connect(self.go.offer_names)

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self.look_for_ports()

    def _controls(self) -> dict[str, ReasonedButton]:
        return {
            "sync": self.sync, "undo": self.undo, "take": self.take, "goto": self.go.goto,
            "centre": self.go.centre, "bring": self.bring, "why": self.ask, "stop": self.stop,
        }  # fmt: skip

    # wishes -----------------------------------------------------------------------------------
    def practise(self) -> None:
        """Start a simulated telescope and connect to it."""
        self.desk.practise()
        self.stop.setFocus()

    def stop_all(self) -> None:
        """Stop the mount, and wait for no clicks any more."""
        self.desk.stop()
        self._bringing.end()

    def look_for_ports(self) -> None:
        """List the ports, without asking anything of them."""
        job = self._services.jobs.run(search.ports(), "ports")
        job.succeeded.connect(self.connect_box.show_ports)

    def find_mount(self) -> None:
        """The serial doctor, on every port."""
        self._cancel_find()
        task = search.find(self.connect_box.wished_port)
        self._finding = job = self._services.jobs.run(task, "find")
        job.progressed.connect(self._progress)
        job.succeeded.connect(self._found)
        job.failed.connect(lambda sentence: self._say(sentence, "wrong"))
        job.cancelled.connect(lambda: self._say("Not looked any further.", "muted"))
        job.finished.connect(partial(self._not_finding, job))
        self.cancel_find.setVisible(True)

    def _cancel_find(self) -> None:
        if self._finding is not None:
            self._finding.cancel()

    def _not_finding(self, job: Job) -> None:
        if job is self._finding:
            self._finding = None
            self.cancel_find.setVisible(False)
            self._progress(None)

    def _found(self, result: tuple[list[PortInfo], list[Diagnosis]]) -> None:
        listed, found = result
        self.connect_box.show_ports(listed)
        mount = next((one for one in found if one.found), None)
        if mount is not None:
            self.connect_box.show_found(mount)
            self.connect_box.connect_button.setFocus()
        self._say(search.words(found), "good" if mount else "wrong")

    def _connect(self, wish: MountWish) -> None:
        keep_mount(self._services.settings, wish)
        self.desk.connect_mount(wish)
        self.stop.setFocus()

    def _site(self, site: Site | None) -> None:
        self.desk.use_site(site)

    def _camera_chosen(self, wish: CameraWish | None) -> None:
        if not self.desk.known.practice:
            keep_camera(self._services.settings, wish or CameraWish(""))
        self.desk.use_camera(wish)

    def _after(self, on: bool) -> None:
        self.desk.auto_frame = on
        self._services.settings.keep("mount/after", on)

    def _bring(self) -> None:
        self._bringing.begin()

    # news -------------------------------------------------------------------------------------
    def _show(self) -> None:
        known, why = self.desk.known, reasons(self.desk.situation)
        off = known.phase == "off"
        if self.connection.isHidden() == off:
            self.area.updateGeometry()  # it is as wide as what it shows
        self.connection.setVisible(off)
        self.leave.setVisible(not off)
        self.leave.setText("End practice" if known.practice else "Disconnect")
        self.asking.setVisible(not off)
        self.moving.setVisible(not off)
        self.name.setText(self._title())
        self.pointing.show_known(known, self._services.settings.angle_style)
        for name, control in self._controls().items():
            control.allow(why[name])
        self.pad.allow(why["nudge"])
        if known.connected is not None:
            self.pad.show_rates(known.connected.rates_deg_s)
        self.tracking.allow(why["track"])
        if known.report is not None:
            tracks = known.report.state.tracking
            self.tracking.setChecked(bool(tracks))
            self.tracking.setText("Tracking: not told" if tracks is None else "Tracking")
        eye = self.desk.eye
        if eye is not None and eye.wish != self.camera.wish:
            self.camera.show_wish(eye.wish)
        self._key.listen(not off)
        self._corner.show(self._services.view.window(), not off)
        if not known.busy and self._finding is None:
            self.bar.setVisible(False)

    def _title(self) -> str:
        known = self.desk.known
        if known.phase == "off":
            return "Connect a mount"
        name = known.connected.name if known.connected is not None else "Connecting"
        return f"{'Practice: ' if known.practice else ''}{name}"

    def _say(self, sentence: str, role: str) -> None:
        if not sentence:
            return
        self.said.setText(sentence)
        if self.said.property("role") != role:
            set_role(self.said, role)

    def _explain(self, reason: str) -> None:
        self.why.setText(reason)
        self.why.setVisible(bool(reason))

    def _progress(self, progress: Progress | None) -> None:
        self.bar.setVisible(progress is not None)
        if progress is None:
            return
        self.bar.setRange(0, 0 if progress.fraction is None else 1000)
        if progress.fraction is not None:
            self.bar.setValue(round(1000 * min(max(progress.fraction, 0.0), 1.0)))
        doing = ": ".join(w for w in (progress.stage.capitalize(), progress.detail) if w)
        self._say(f"{doing}…", "muted")

    def _offer(self, offer: SyncOffer) -> None:
        report = self.desk.known.report
        if report is None:
            return
        style = self._services.settings.angle_style
        dialog = SyncDialog(
            self.window(), offer, report.icrs_deg, style, self._services.looks.colours
        )
        dialog.wanted.connect(self.desk.accept_sync)
        dialog.open()

    def _dress(self, colours: Colours) -> None:
        self.pointing.arrow.colours = colours
        self.pointing.arrow.update()


def _line(*widgets: QWidget) -> QWidget:
    made = QWidget()
    line = QHBoxLayout(made)
    line.setContentsMargins(0, 0, 0, 0)
    for widget in widgets:
        line.addWidget(widget)
    line.addStretch(1)
    return made


def _card(*widgets: QWidget) -> QWidget:
    made = card()
    column = QVBoxLayout(made)
    column.setContentsMargins(12, 10, 12, 10)
    column.setSpacing(8)
    for widget in widgets:
        column.addWidget(widget)
    return made
