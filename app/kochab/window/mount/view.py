"""The Mount view: connect, compare, sync, goto, centre, nudge and stop."""

from functools import partial
from typing import Any

from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QPushButton, QWidget

from kochab.core.mount import MountState
from kochab.core.progress import Progress
from kochab.gear.actions import POLAR, reasons_against
from kochab.gear.profiles import current_profile, save_selection, saved_profiles
from kochab.gear.session import Meridian, MountSelection
from kochab.text.translation import tr, tr_noop
from kochab.window.frame.picture_age import PictureAge
from kochab.window.mount.actions import MountActions, MoveStarMode
from kochab.window.mount.buttons import OrderButtons
from kochab.window.mount.camera_choice import CameraChoice
from kochab.window.mount.connect_box import ConnectBox
from kochab.window.mount.controls import GoBox, NudgePad, TrackingChoice
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
from kochab.workflows.sync_mount import SyncOffer

MERIDIAN_TIP = tr_noop(
    "A German equatorial must flip at the meridian, or its tube may hit the pier. A fork, wedge or "
    "alt-azimuth mount goes on without a flip."
)
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
        self.camera = CameraChoice(self, control, self._services.cameras, self._services.settings)
        self.after = switch(tr("Solve after slew"), tr("Take and solve a frame after each goto or nudge"))
        self.go = GoBox(orders.goto, orders.centre, self.after)
        self.buttons = OrderButtons(control, orders, self.move_star, self.go)
        self.pad = NudgePad(orders.nudge, self.buttons.move_star)
        Gamepad(self.pad, control, orders)
        self.tracking = TrackingChoice()
        self.meridian = narrow_box(tr("What the mount does at the meridian"), 8, {tr(way): way for way in Meridian})
        self.meridian.setToolTip(tr(MERIDIAN_TIP))
        self.pointing = PointingBox(self.tracking)
        self.limits = LimitsBox()
        self.doubt = label("", "wrong", wrap=True)
        self.trust = button(tr("Mount is right"), partial(orders.settle, "trust"), "", tr(TRUST_TIP))
        self.flip = button(tr("Flip and go"), self._flip_and_go, "", tr("Flip the mount on its way there"))
        self.leave = button(tr("Disconnect"), control.disconnect_mount, "", tr("Stop the mount and close the port"))
        self.cancel_find = button(tr("Cancel"), self.connect_box.cancel_search)
        self.name = label("", "heading", wrap=True)
        self.message, self.why = label("", "muted", wrap=True), label("", "muted", wrap=True)
        self.bar = ProgressBar(tr("Progress of the mount"))

    def _lay_out(self) -> None:
        for hidden in (self.bar, self.cancel_find, self.why, self.flip):
            hidden.setVisible(False)
        self.area, self.picture = scrolled(self._cards()), PictureAge(self._services.session)
        progress = row((self.bar, 1), self.cancel_find)
        parts = ((self.area, 1), self.picture, self.message, row(self.flip, None), self.why, progress)
        column(*parts, on=self, margins=(8, 8, 8, 8))

    def _cards(self) -> QWidget:
        made = self.buttons
        frames = column(row(made.take, made.sync, made.undo, None), row(made.diagnose, made.model, None))
        meridian = row(label(tr("Meridian")), (self.meridian, 1))
        self.connection = _card(self.connect_box)
        self.doubted = _card(self.doubt, row(*made.settles.values(), self.trust, None))
        self.compared = _card(self.pointing, frames, self.camera.box)
        self.moving = _card(
            self.go, meridian, row(*made.rests.values(), made.spiral, None), styled_frame("rule"), self.pad
        )
        inside, top = page(), row((self.name, 1), self.leave)
        parts = (top, self.connection, self.doubted, self.compared, self.moving, _card(self.limits), None)
        column(*parts, on=inside, spacing=10, margins=(4, 4, 4, 4))
        return inside

    def _connect(self) -> None:
        control, orders, box = self.control, self.orders, self.connect_box
        nudges = [made.explanation for made in self.pad.buttons.values()]
        for explanation in (*self.buttons.explanations, *nudges, self.tracking.explanation):
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
        self.camera.use_profiles(profile.camera, camera_of_other_view)

    def _use_limits(self, changes: dict[str, Any]) -> None:
        self.control.use_limits(**changes)
        self.limits.show_limits(self.control.kept.limits)

    def _use_profile(self) -> None:
        if self.control.known.phase != "off":  # its camera is in use
            return
        self._show_equipment()
        self.camera.tell_others()

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
        self.buttons.by_action[action].click()

    def practise(self) -> None:
        """Start a simulated telescope and connect to it."""
        self.control.practise()
        # Space stops the mount until something else takes the focus.
        self.stop.setFocus()

    def _connect_mount(self, selection: MountSelection) -> None:
        save_selection(self._services.settings, selection)
        self.control.connect_mount(selection)
        self.stop.setFocus()

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
        self.buttons.show_reasons(why)
        self.pad.allow(why["nudge"], why["nudge dec"])
        if known.connected is not None:
            self.pad.show_rates(known.connected.rates_deg_s)
        self.tracking.show_state(MountState() if known.report is None else known.report.state, why)
        self.camera.show()
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
