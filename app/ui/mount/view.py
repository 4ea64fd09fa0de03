"""The Mount view: connect, compare, sync, go, centre, nudge, and stop."""

from PySide6.QtGui import QShowEvent

from app.core.progress import Progress
from app.ui.mount.asks import Asks
from app.ui.mount.bring_mode import BringMode
from app.ui.mount.eye import CameraWish
from app.ui.mount.finder import Finder
from app.ui.mount.known import POLAR
from app.ui.mount.meridian import kept_meridian
from app.ui.mount.panel import MountPanel
from app.ui.mount.reasons import reasons
from app.ui.mount.sync_dialog import SyncDialog
from app.ui.mount.targets import names_to_offer
from app.ui.mount.wishes import MountWish, keep_camera, keep_mount, kept_camera, kept_mount
from app.ui.palette import Colours
from app.ui.services import Services
from app.workflows.sync_mount import SyncOffer

ALIGNING = "Polar alignment (F4) has the mount"


class MountView(MountPanel):
    """Shows what the window's desk knows, and asks it for what a person wants."""

    def __init__(self, services: Services) -> None:
        desk = services.mount
        asks = Asks(desk)
        bringing = BringMode(services, desk, asks)
        super().__init__(desk, asks, bringing, services.wiring.practice is not None)
        self.desk, self.asks, self._services = desk, asks, services
        bringing.said.connect(self.say)
        self._finder = Finder(self.connect_box, services.jobs)
        self._listen()
        self._restore()
        self._show()

    # set-up -----------------------------------------------------------------------------------
    def _listen(self) -> None:
        desk, asks, box = self.desk, self.asks, self.connect_box
        desk.changed.connect(self._show)
        desk.said.connect(self.say)
        desk.progressed.connect(self._doing)
        asks.offered.connect(self._offer)
        self._finder.said.connect(self.say)
        self._finder.progressed.connect(self._finding)
        self.cancel_find.clicked.connect(self._finder.cancel)
        box.connect_wanted.connect(self._connect)
        box.practice_wanted.connect(self.practise)
        box.site_given.connect(desk.use_site)
        box.trouble.connect(lambda sentence: self.say(sentence, "wrong"))
        cameras = self._services.cameras
        self.camera.chosen.connect(self._camera_chosen)
        self.camera.look_wanted.connect(cameras.look)
        cameras.found.connect(self.camera.show_found)
        cameras.missed.connect(self.camera.show_missed)
        cameras.chosen.connect(self._adopt_camera)
        self.go.goto_wanted.connect(asks.goto)
        self.go.centre_wanted.connect(asks.centre)
        self.pad.nudge_wanted.connect(asks.nudge)
        self.tracking.wanted.connect(asks.track)
        self.meridian.chosen.connect(desk.use_meridian)
        session = self._services.session
        for signal in (session.solved, session.unsolved, session.opened):
            signal.connect(lambda _=None: self._show())
        self._services.looks.changed.connect(self._dress)

    def _restore(self) -> None:
        settings = self._services.settings
        self.connect_box.show_wish(kept_mount(settings))
        self.meridian.show_meridian(kept_meridian(settings))
        if not self.desk.known.practice:
            camera = kept_camera(settings)
            if self._services.cameras.choice is not None:  # another view's
                camera = CameraWish(*self._services.cameras.choice, camera.exposure_s)
            self.camera.show_wish(camera)
            self.desk.use_camera(camera if camera.source else None)
        self.after.toggled.connect(self._after)
        self.after.setChecked(settings.flag("mount/after", True))
        self._dress(self._services.looks.colours)
        names = self._services.jobs.run(names_to_offer(), "names")
        names.succeeded.connect(self.go.offer_names)

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self.connect_box.show_site(self._services.settings.site)
        self._finder.list_ports()

    # wishes -----------------------------------------------------------------------------------
    def practise(self) -> None:
        """Start a simulated telescope and connect to it."""
        self.desk.practise()
        self.stop.setFocus()

    def _connect(self, wish: MountWish) -> None:
        keep_mount(self._services.settings, wish)
        self.desk.connect_mount(wish)
        self.stop.setFocus()

    def _camera_chosen(self, wish: CameraWish | None) -> None:
        if not self.desk.known.practice:
            keep_camera(self._services.settings, wish or CameraWish(""))
        self.desk.use_camera(wish)
        if wish is not None:
            self._services.cameras.choose(wish.source, wish.address)

    def _adopt_camera(self, source: str, address: str) -> None:
        """Look through the camera that another view has chosen."""
        if self.desk.known.practice:
            return  # the telescope's own
        wish = CameraWish(source, address, self.camera.exposure.value())
        if wish != self.camera.wish:
            self.camera.show_wish(wish)
            keep_camera(self._services.settings, wish)
            self.desk.use_camera(wish)

    def _after(self, on: bool) -> None:
        self.asks.auto_frame = on
        self._services.settings.keep("mount/after", on)

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
        for name, control in self.controls().items():
            control.allow(why[name])
        self.pad.allow(why["nudge"], why["nudge dec"])
        if known.connected is not None:
            self.pad.show_rates(known.connected.rates_deg_s)
        self.tracking.allow(why["track"])
        if known.report is not None:
            tracks = known.report.state.tracking
            self.tracking.setChecked(bool(tracks))
            self.tracking.setText("Tracking: not told" if tracks is None else "Tracking")
        eye = self.desk.lookout.eye
        wish = None if eye is None else eye.wish
        if wish != self.camera.wish:
            self.camera.show_wish(wish or CameraWish("", "", self.camera.exposure.value()))
        self.camera.say("" if eye is None else eye.exposure_told)
        if not known.busy and not self._finder.running:
            self.bar.setVisible(False)

    def _title(self) -> str:
        known = self.desk.known
        if known.phase == "off":
            return "Connect a mount"
        name = known.connected.name if known.connected is not None else "Connecting"
        return f"{'Practice: ' if known.practice else ''}{name}"

    def _doing(self, progress: Progress | None) -> None:
        self.show_progress(progress, ALIGNING if self.desk.known.busy == POLAR else "")

    def _finding(self, progress: Progress | None) -> None:
        self.cancel_find.setVisible(progress is not None)
        self.show_progress(progress)

    def _offer(self, offer: SyncOffer) -> None:
        report = self.desk.known.report
        if report is None:
            return
        style = self._services.settings.angle_style
        dialog = SyncDialog(
            self.window(), offer, report.icrs_deg, style, self._services.looks.colours
        )
        dialog.wanted.connect(self.asks.accept_sync)
        dialog.open()

    def _dress(self, colours: Colours) -> None:
        self.pointing.arrow.colours = colours
        self.pointing.arrow.update()
