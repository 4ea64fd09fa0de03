"""The Mount view: the star chart with the mount in it, and beside it what is done with hands."""

from datetime import UTC, datetime
from functools import partial
from typing import Any

from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QPushButton, QWidget

from kochab.core.attitude import unit_vectors
from kochab.core.frame import Site
from kochab.core.mount import Ability, MountState
from kochab.core.progress import Progress
from kochab.gear.actions import POLAR, reasons_against
from kochab.gear.profiles import current_profile, save_selection, saved_profiles
from kochab.gear.session import Meridian, MountSelection
from kochab.text.translation import tr, tr_noop
from kochab.window.devices.mount_status import way_text
from kochab.window.frame.picture_age import PictureAge
from kochab.window.mount.actions import MountActions, MoveStarMode
from kochab.window.mount.buttons import OrderButtons
from kochab.window.mount.camera_choice import CameraChoice
from kochab.window.mount.camera_picture import CameraPicture
from kochab.window.mount.connect_box import ConnectBox
from kochab.window.mount.controls import GoBox, NudgePad, TrackingChoice
from kochab.window.mount.gamepad import Gamepad
from kochab.window.mount.limits import LimitsBox
from kochab.window.mount.pointing import PointingCard, SyncDialog
from kochab.window.mount.room import MountRoom
from kochab.window.mount.score_card import ScoreCard
from kochab.window.services import Services
from kochab.window.view import View
from kochab.window.widgets import (
    Fold,
    Part,
    ProgressBar,
    button,
    column,
    grid,
    label,
    narrow_box,
    page,
    row,
    scrolled,
    show_text,
    styled_frame,
    switch,
)
from kochab.workflows.goto_target import FlipQuestion, Target, names_to_offer, resolved
from kochab.workflows.sync_mount import SyncOffer
from kochab.workflows.target_tonight import target_tonight, tonight_text

MERIDIAN_TIP = tr_noop(
    "A German equatorial must flip at the meridian, or its tube may hit the pier. A fork, wedge or "
    "alt-azimuth mount goes on without a flip."
)
ANY_PLACE = tr_noop("any place of the chart: double-click to centre it")
TRUST_TIP = tr_noop("Slew and sync anyway. Limits use this computer’s clock and your site.")
ALIGNING = tr_noop("Polar alignment (F4) is using the mount")


class MountView(View):
    """The side; its ``room`` is the chart with the pointing and the commands over it. STOP is in the bar above."""

    room: MountRoom
    pages_scroll = True

    def __init__(self, services: Services) -> None:
        super().__init__()
        self._services = services
        self.control = services.mount
        self._target: Target | None = None  # the one that is typed
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
        self.go = GoBox(orders.goto, orders.centre)
        self.buttons = OrderButtons(control, orders, self.move_star, self.go)
        self.pad = NudgePad(orders.nudge)
        Gamepad(self.pad, control, orders)
        self.tracking = TrackingChoice()
        self.meridian = narrow_box(tr("What the mount does at the meridian"), 8, {tr(way): way for way in Meridian})
        self.meridian.setToolTip(tr(MERIDIAN_TIP))
        self.pointing = PointingCard()
        self.camera_picture = CameraPicture(self._services.session, self._services.jobs)
        self.large = button("", lambda: self.frame_wanted.emit(not self.room.isHidden()))
        self.limits = LimitsBox()
        self.doubt = label("", "wrong", wrap=True)
        self.line, self.cannot = label("", "muted", wrap=True), label("", "muted", wrap=True)
        self.trust = button(tr("Mount is right"), partial(orders.settle, "trust"), "", tr(TRUST_TIP))
        self.flip = button(tr("Flip and go"), self._flip_and_go, "", tr("Flip the mount on its way there"))
        self.leave = button(tr("Disconnect"), control.disconnect_mount, "", tr("Stop the mount and close the port"))
        self.cancel_find = button(tr("Cancel"), self.connect_box.cancel_search)
        self.name = label("", "heading", wrap=True)
        self.message, self.why = label("", "muted", wrap=True), label("", "muted", wrap=True)
        self.bar = ProgressBar(tr("Progress of the mount"))

    def _lay_out(self) -> None:
        for hidden in (self.bar, self.cancel_find, self.message, self.why, self.flip):
            hidden.setVisible(False)
        self.area, self.picture = scrolled(self._side()), PictureAge(self._services.session)
        column((self.area, 1), self.picture, on=self, margins=(6, 8, 6, 8))
        strip, progress = styled_frame("card"), row((self.bar, 1), self.cancel_find)
        self.go.lay_out(self.buttons.sync)
        notes = row((self.message, 1), self.flip)
        column(self.go, notes, self.why, progress, on=strip, spacing=4, margins=(10, 10, 10, 10))
        self.room = MountRoom(self._services, self.pointing, strip, self.aim)

    def _side(self) -> QWidget:
        """From top to bottom by how often it is needed; what is set once lies behind one line."""
        made = self.buttons
        self.connection = _card(self.connect_box)
        self.conflict = _card(self.doubt, row(*made.settles.values(), self.trust, None))
        self.compared = page()
        frames = grid((made.take, self.large), (made.diagnose, made.undo), across=6, down=6, stretch=(1, 1))
        column(row(self.leave, None), self.camera_picture, frames, on=self.compared, spacing=6, margins=(0, 0, 0, 0))
        self.moving = page()
        rests = grid(tuple(made.rests.values())[:2], tuple(made.rests.values())[2:], across=6, down=6, stretch=(1, 1))
        more = grid((made.spiral, made.move_star), (made.model, self.tracking), across=6, down=6, stretch=(1, 1))
        column(self.pad, more, rests, self.cannot, on=self.moving, spacing=8, margins=(0, 0, 0, 0))
        meridian = row(label(tr("Meridian")), (self.meridian, 1))
        frame_after = row(self.after, label(tr("Centred within")), self.go.tolerance, None)
        set_once = (self.line, self.camera.box, frame_after, meridian, styled_frame("rule"), self.limits)
        self.settings = Fold(tr("Connection, limits, camera"), *set_once)
        inside = page()
        parts = (self.name, self.connection, self.conflict, self.compared, self.moving, self.settings, None)
        column(*parts, on=inside, spacing=12, margins=(2, 4, 2, 4))
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
        control.scored.connect(lambda score: self.room.show_score(ScoreCard(score)))
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
        self._show_large(False)
        self.room.seen.connect(lambda seen: self._show_large(not seen))
        self.room.read.connect(self.camera_picture.use_sky)
        self.move_star.frame_wanted.connect(self.frame_wanted)
        self.go.typed.connect(self._seek)
        self.room.picked.connect(self.go.target.setText)
        self.room.centre_wanted.connect(self._centre_there)
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

    def _show_large(self, on: bool) -> None:
        """The open frame takes the chart's place, or gives it back."""
        self.large.setText(tr("Show the chart") if on else tr("Show the frame"))
        self.picture.setVisible(on)

    def _seek(self, text: str) -> None:
        """Mark the typed target on the chart, and tell when it can be had."""
        if not text:
            self._found(text, None)
            return
        job = self._services.jobs.run(resolved(text, self._now, self._site), "target")
        job.succeeded.connect(partial(self._found, text))
        job.failed.connect(partial(self._not_found, text))

    def _found(self, text: str, target: Target | None) -> None:
        if text == self.go.target.text().strip():  # and nothing else was typed meanwhile
            self._target = target
            self.room.show_target(target)
            self._tell_tonight()

    def _not_found(self, text: str, sentence: str) -> None:
        self._found(text, None)
        if text == self.go.target.text().strip():
            self.go.about.setText(sentence)

    @property
    def _now(self) -> datetime:
        """By the clock that the mount goes by."""
        report = self.control.known.report
        return datetime.now(UTC) if report is None or report.time_utc is None else report.time_utc

    @property
    def _site(self) -> Site | None:
        connected = self.control.known.connected
        return self._services.settings.site if connected is None else connected.site

    def _tell_tonight(self) -> None:
        """When the target, or where none is typed what the mount points at, is high and flips."""
        report, typed = self.control.known.report, bool(self.go.target.text().strip())
        place = self._target
        if place is None and report is not None and not typed:
            place = Target("", *report.icrs_deg)
        if place is None:
            if not typed:
                self.go.about.setText(tr(ANY_PLACE))
            return
        words = [] if typed else [tr(ANY_PLACE)]
        if (site := self._site) is not None:
            limits, when = self.control.kept.limits, self._now
            vector = unit_vectors(place.ra_deg, place.dec_deg)
            words.insert(0, tonight_text(target_tonight(vector, site, when, limits), when, limits))
        self.go.about.setText(" · ".join(words))

    def _centre_there(self, place: str) -> None:
        """After a double click on the chart; without a camera the mount is sent there by its own pointing."""
        self.go.target.setText(place)
        against = reasons_against(self.control.situation)
        self.aim("goto" if against["centre"] and not against["goto"] else "centre", place)

    def practise(self) -> None:
        """Start a simulated telescope and connect to it."""
        self.camera_picture.forget()
        self.control.practise()
        # Space stops the mount until something else takes the focus.
        self.stop.setFocus()

    def _connect_mount(self, selection: MountSelection) -> None:
        save_selection(self._services.settings, selection)
        self.camera_picture.forget()
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
        for part in (self.compared, self.moving):
            part.setVisible(not off)
        self.limits.picture.show_mount(None if known.report is None else known.report.altaz_deg)
        doubt = self.control.situation.clock_conflict or self.control.situation.slew_block_reason
        self.conflict.setVisible(bool(doubt))
        self.doubt.setText(doubt)
        self.leave.setText(tr("End practice") if known.practice else tr("Disconnect"))
        self.name.setText(self._title())
        show_text(self.line, "" if off else tr("Connected on {port}", port=known.port))
        lacks = "" if known.connected is None else known.connected.lacks.get(Ability.PARK, "")
        mute = known.report is not None and known.report.state.tracking is None
        limits = (
            tr("This mount does not report tracking.") if mute else "",
            tr("Park: {reason}", reason=tr(lacks)) if lacks else "",
        )
        show_text(self.cannot, "\n".join(filter(None, limits)))
        self.pointing.show_known(known, self._services.settings.angle_style)
        self.camera_picture.show_motion(known.moved_since, known.slewing or known.left_deg is not None)
        self.room.show_known(known, self._site, self.control.kept.limits)
        self._tell_tonight()
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
        if way := way_text(self.control.known):
            self.bar.show_share(progress.fraction)
            self.say(f"{way}…", "muted")
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
