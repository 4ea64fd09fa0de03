"""The Mount view: connect, compare, sync, goto, centre, nudge and stop."""

from functools import partial
from typing import Any

from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QPushButton, QWidget

from kochab.core import tr, tr_noop
from kochab.core.mount import MountState
from kochab.core.progress import Progress
from kochab.gear.actions import POLAR, reasons_against
from kochab.gear.profiles import current_profile, save_selection, saved_profiles
from kochab.gear.session import CameraSelection, Meridian, MountSelection
from kochab.window.devices.cameras import CameraBox
from kochab.window.frame.picture_age import PictureAge
from kochab.window.mount.actions import MountActions, MoveStarMode
from kochab.window.mount.connect_box import ConnectBox
from kochab.window.mount.controls import ExplainedButton, GoBox, NudgePad, TrackingChoice
from kochab.window.mount.gamepad import Gamepad
from kochab.window.mount.limits import LimitsBox
from kochab.window.mount.pointing import PointingBox, SyncDialog
from kochab.window.services import Services
from kochab.window.view import View
from kochab.window.widgets import (
    Part,
    ProgressBar,
    button,
    column,
    label,
    narrow_box,
    page,
    row,
    scrolled,
    show_text,
    styled_frame,
    switch,
)
from kochab.workflows.goto_target import FlipQuestion, names_to_offer
from kochab.workflows.sync_mount import SyncOffer, undo_sync

MERIDIAN_TIP = tr_noop(
    "A German equatorial must flip at the meridian, or its tube may hit the pier. A fork, wedge or "
    "alt-azimuth mount goes on without a flip."
)
DIAGNOSE_TIP = tr_noop(
    "Take a frame and find the cause of the offset: summer time, epoch, site, polar axis, cone error"
)
MODEL_TIP = tr_noop(
    "Aim gotos by a model of the offsets that Diagnose has seen in four places or more, until the next sync"
)
SPIRAL_TIP = tr_noop(
    "Not in the field? Search around here in a square spiral, two thirds of a field at a time; Stop ends it"
)
RESTS = {
    "park": (tr_noop("Park"), tr_noop("Slew to the park position that is set in the mount, and stay there")),
    "unpark": (tr_noop("Unpark"), tr_noop("Let a parked mount move again")),
    "home": (tr_noop("Home"), tr_noop("Slew to the mount’s own home position")),
    "flip": (tr_noop("Flip"), tr_noop("Take a German mount to the other side of its pier where it points")),
}
SETTLES = {
    "set clock": (tr_noop("Set clock"), tr_noop("Set the mount’s clock to this computer’s")),
    "set site": (tr_noop("Set site"), tr_noop("Set the mount’s site to yours")),
}
TRUST_TIP = tr_noop("Slew and sync anyway. Limits use this computer’s clock and your site.")
ALIGNING = tr_noop("Polar alignment (F4) is using the mount")


class MountView(View):
    """Cards that scroll; the message and the progress are always in sight below. STOP is in the bar above."""

    def __init__(self, services: Services) -> None:
        super().__init__()
        self._services = services
        self.control = services.mount
        self.orders = MountActions(self.control)
        self.move_star = MoveStarMode(services, self.control, self.orders)
        self._make_controls()
        self._lay_out()
        self._connect()
        self._restore()
        self._show()

    def _make_controls(self) -> None:
        orders, control = self.orders, self.control
        self.connect_box = ConnectBox(self._services.jobs, self._services.wiring.practice is not None)
        self.camera = CameraBox(at_once=True)
        self._shown_camera: CameraSelection | None = None
        self.take = ExplainedButton(tr("Take a frame"), orders.take_frame, tr("See where the mount really points"))
        tip = tr("Solve two frames, then sync the mount on them")
        self.sync = ExplainedButton(tr("Sync…"), orders.offer_sync, tip, "main")
        self.undo = ExplainedButton(tr("Undo sync"), lambda: control.ask("undo", undo_sync), tr("Undo the last sync"))
        self.diagnose = ExplainedButton(tr("Diagnose"), orders.diagnose, tr(DIAGNOSE_TIP))
        self.model = ExplainedButton(tr("Pointing model"), orders.use_model, tr(MODEL_TIP))
        self.spiral = ExplainedButton(tr("Spiral search"), orders.spiral, tr(SPIRAL_TIP))
        tip = tr("Click a star in the frame, then where to put it")
        self.bring = ExplainedButton(tr("Move star to…"), self.move_star.begin, tip)
        self.pad = NudgePad(orders.nudge, self.bring)
        Gamepad(self.pad, control, orders)
        self.tracking = TrackingChoice()
        self.after = switch(tr("Solve after slew"), tr("Take and solve a frame after each goto or nudge"))
        self.go = GoBox(orders.goto, orders.centre, self.after)
        self.meridian = narrow_box(tr("What the mount does at the meridian"), 8, {tr(way): way for way in Meridian})
        self.meridian.setToolTip(tr(MERIDIAN_TIP))
        self.pointing = PointingBox(self.tracking)
        self.limits = LimitsBox()
        settles = {
            n: ExplainedButton(tr(text), partial(orders.settle, n), tr(tip)) for n, (text, tip) in SETTLES.items()
        }
        self.settles, self.doubt = settles, label("", "wrong", wrap=True)
        self.trust = button(tr("Mount is right"), partial(orders.settle, "trust"), "", tr(TRUST_TIP))
        self.flip = button(tr("Flip and go"), self._flip_and_go, "", tr("Flip the mount on its way there"))
        self.rests = {n: ExplainedButton(tr(t), partial(orders.rest, n), tr(tip)) for n, (t, tip) in RESTS.items()}
        self.leave = button(tr("Disconnect"), control.disconnect_mount, "", tr("Stop the mount and close the port"))
        self.cancel_find = button(tr("Cancel"), self.connect_box.cancel_search)
        self.name = label("", "heading", wrap=True)
        self.message, self.why = label("", "muted", wrap=True), label("", "muted", wrap=True)
        self.bar = ProgressBar(tr("Progress of the mount"))
        # by the names of the actions in kochab.gear.actions
        self.explained = {
            "sync": self.sync,
            "undo": self.undo,
            "take_frame": self.take,
            "goto": self.go.goto,
            "centre": self.go.centre,
            "move_star": self.bring,
            "diagnose": self.diagnose,
            "model": self.model,
            "spiral": self.spiral,
            **self.rests,
            **self.settles,
        }

    def _lay_out(self) -> None:
        for hidden in (self.bar, self.cancel_find, self.why, self.flip):
            hidden.setVisible(False)
        self.area = scrolled(self._cards())
        progress = row((self.bar, 1), self.cancel_find)
        parts = ((self.area, 1), self.message, row(self.flip, None), self.why, progress)
        column(*parts, on=self, margins=(8, 8, 8, 8))

    def _cards(self) -> QWidget:
        frames = column(row(self.take, self.sync, self.undo, None), row(self.diagnose, self.model, None))
        meridian = row(label(tr("Meridian")), (self.meridian, 1))
        self.connection = _card(self.connect_box)
        self.doubted = _card(self.doubt, row(*self.settles.values(), self.trust, None))
        self.picture = PictureAge(self._services.session)
        self.compared = _card(self.pointing, frames, self.camera, self.picture)
        self.moving = _card(
            self.go, meridian, row(*self.rests.values(), self.spiral, None), styled_frame("rule"), self.pad
        )
        inside, top = page(), row((self.name, 1), self.leave)
        parts = (top, self.connection, self.doubted, self.compared, self.moving, _card(self.limits), None)
        column(*parts, on=inside, spacing=10, margins=(4, 4, 4, 4))
        return inside

    def _connect(self) -> None:
        control, orders, box, cameras = self.control, self.orders, self.connect_box, self._services.cameras
        explanations = [one.explanation for one in (*self.explained.values(), *self.pad.buttons.values())]
        for explanation in (*explanations, self.tracking.explanation):
            explanation.shown.connect(partial(show_text, self.why))
        self.limits.changed.connect(self._use_limits)
        for speaker in (control, self.move_star, box, self.limits):
            speaker.message.connect(self.say)
        control.changed.connect(self._show)
        control.progressed.connect(self._show_progress)
        orders.offered.connect(self._offer)
        orders.flip_asked.connect(self._ask_flip)
        box.progressed.connect(self._show_progress)
        box.connect_wanted.connect(self._connect_mount)
        box.practice_wanted.connect(self.practise)
        box.site_given.connect(control.use_site)
        box.profile_chosen.connect(self._services.equipment.choose)
        self._services.equipment.changed.connect(self._use_profile)
        self._services.equipment.refused.connect(lambda sentence: self.say(sentence, "wrong"))
        self.camera.chosen.connect(self._use_camera)
        self.camera.follow(cameras)
        # The box does not adopt it by itself: here a camera is in use as soon as it is chosen.
        cameras.chosen.connect(self._adopt_camera)
        self.tracking.wanted.connect(orders.track)
        self.meridian.textActivated.connect(
            lambda _: control.use_limits(meridian=Meridian(self.meridian.currentData()))
        )
        session = self._services.session
        for signal in (session.solved, session.unsolved, session.opened):
            signal.connect(lambda _=None: self._show())

    def _restore(self) -> None:
        settings = self._services.settings
        self._show_equipment(self._services.cameras.choice)
        self.after.setChecked(settings.flag("mount/after", True))
        self.orders.auto_frame = self.after.isChecked()
        self.after.toggled.connect(self._solve_after)
        names = self._services.jobs.run(names_to_offer(), "names")
        names.succeeded.connect(self.go.offer_names)

    def _show_equipment(self, camera_of_other_view: tuple[str, str] | None = None) -> None:
        profile = current_profile(self._services.settings)
        self.connect_box.show_profiles([one.name for one in saved_profiles()[0]], profile.name)
        self.connect_box.show_selection(profile.mount)
        self.connect_box.show_site(profile.site)
        self.limits.show_limits(profile.limits)
        self.meridian.setCurrentText(tr(profile.meridian or Meridian.STAYS))
        if not self.control.known.practice:
            camera = profile.camera
            if camera_of_other_view is not None:
                camera = CameraSelection(*camera_of_other_view, camera.exposure_s)
            self.camera.show_selection(camera)
            self.control.use_camera(camera if camera.source else None)

    def _use_limits(self, changes: dict[str, Any]) -> None:
        self.control.use_limits(**changes)
        self.limits.show_limits(self.control.limits)

    def _use_profile(self) -> None:
        if self.control.known.phase != "off":  # its camera is in use
            return
        self._show_equipment()
        camera = self.camera.selection
        if camera is not None:
            self._services.cameras.choose(camera.source, camera.address)

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        # Another view may have set the site, and a cable may have been plugged in.
        self.connect_box.show_site(self._services.settings.site)
        self.connect_box.list_ports()

    @property
    def stop(self) -> QPushButton:
        """The one STOP of the window."""
        return self._services.stop

    def aim(self, action: str, target: str) -> None:
        """Go to a target, or "centre" it, as if a person had typed it here and pressed the button."""
        self.go.target.setText(target)
        # Through the button, which checks what the mount can do now.
        self.explained[action].click()

    def practise(self) -> None:
        """Start a simulated telescope and connect to it."""
        self.control.practise()
        # Space stops the mount until something else takes the focus.
        self.stop.setFocus()

    def _connect_mount(self, selection: MountSelection) -> None:
        save_selection(self._services.settings, selection)
        self.control.connect_mount(selection)
        self.stop.setFocus()

    def _use_camera(self, selection: CameraSelection | None) -> None:
        if not self.control.known.practice:
            # The practice camera must not become the profile's.
            save_selection(self._services.settings, selection or CameraSelection(""))
        self.control.use_camera(selection)
        if selection is not None:
            self._services.cameras.choose(selection.source, selection.address)

    def _adopt_camera(self, source: str, address: str) -> None:
        """Use the camera that another view has chosen; a practice telescope keeps its own."""
        selection = CameraSelection(source, address, self.camera.exposure.value())
        # This view's own choice comes back here, too.
        if selection != self.camera.selection and not self.control.known.practice:
            self.camera.show_selection(selection)
            self._use_camera(selection)

    def _solve_after(self, on: bool) -> None:
        self.orders.auto_frame = on
        self._services.settings.keep("mount/after", on)

    def say(self, sentence: str, role: str) -> None:
        """One sentence that stays until the next."""
        if sentence:
            show_text(self.message, sentence, role)
            # The offer to flip belongs to the question that this sentence replaces.
            self.flip.hide()

    def _show(self) -> None:
        known, why = self.control.known, reasons_against(self.control.situation)
        off = known.phase == "off"
        if self.connection.isHidden() == off:
            self.area.updateGeometry()  # it is as wide as what it shows
        self.connection.setVisible(off)
        for part in (self.leave, self.compared, self.moving):
            part.setVisible(not off)
        self.limits.picture.show_mount(None if known.report is None else known.report.altaz_deg)
        doubt = self.control.situation.clock_conflict or self.control.situation.slew_block_reason
        self.doubted.setVisible(bool(doubt))
        self.doubt.setText(doubt)
        self.leave.setText(tr("End practice") if known.practice else tr("Disconnect"))
        self.name.setText(self._title())
        self.pointing.show_known(known, self._services.settings.angle_style)
        for name, control in self.explained.items():
            control.explanation.set_reason(why[name])
        self.pad.allow(why["nudge"], why["nudge dec"])
        if known.connected is not None:
            self.pad.show_rates(known.connected.rates_deg_s)
        self.tracking.show_state(MountState() if known.report is None else known.report.state, why)
        camera = self.control.camera
        selection = None if camera is None else camera.selection
        # Not whenever the fields differ: this runs twice a second, and a person may be typing in them.
        if selection != self._shown_camera:
            self._shown_camera = selection
            self.camera.show_selection(selection or CameraSelection("", "", self.camera.exposure.value()))
        self.camera.show_note("" if camera is None else camera.exposure_told)
        if not known.busy and not self.connect_box.searching:
            self.bar.setVisible(False)

    def _title(self) -> str:
        known = self.control.known
        if known.phase == "off":
            return tr("Connect a mount")
        name = known.connected.name if known.connected is not None else tr("Connecting")
        return tr("Practice: {name}", name=name) if known.practice else name

    def _show_progress(self, progress: Progress | None) -> None:
        """Show the progress of an order or a search, None when it is over."""
        self.bar.setVisible(progress is not None)
        self.cancel_find.setVisible(self.connect_box.searching)
        if progress is None:
            return
        user = tr(ALIGNING) if self.control.known.busy == POLAR else ""
        self.bar.show_share(progress.fraction)
        stage = tr(progress.stage)
        words = (user, stage if user else stage[:1].upper() + stage[1:], progress.detail)
        self.say(": ".join(w.rstrip(".…") for w in words if w) + "…", "muted")

    def _ask_flip(self, question: FlipQuestion) -> None:
        """Offer the flip until something else is said."""
        self.asked_flip = question.text
        self.flip.show()

    def _flip_and_go(self) -> None:
        self.orders.goto(self.asked_flip, flip=True)

    def _offer(self, offer: SyncOffer) -> None:
        report = self.control.known.report
        if report is None:
            return
        dialog = SyncDialog(self.window(), offer, report.icrs_deg, self._services.settings.angle_style)
        dialog.wanted.connect(self.orders.accept_sync)
        dialog.open()


def _card(*parts: Part) -> QWidget:
    made = styled_frame("card")
    column(*parts, on=made, spacing=8, margins=(12, 10, 12, 10))
    return made
