"""The set-up of an alignment: frames, who turns the RA axis, pole and site; remembered between starts."""

import json
from contextlib import suppress
from datetime import UTC, datetime

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QFormLayout, QWidget

from kochab.core.errors import UsageError
from kochab.core.frame import Site
from kochab.gear.mount_events import MountSnapshot
from kochab.gear.profiles import current_profile
from kochab.gear.session import CameraSelection, MountSelection
from kochab.parsing.angles import parse_positive, parse_site, site_text
from kochab.polar.bolts import Base
from kochab.polar.error import Imaging, angle_in_words
from kochab.polar.pole import Pole, name_of
from kochab.text.translation import tr, tr_noop
from kochab.window.polar.alignment_run import NO_MOUNT
from kochab.window.polar.frame_fields import FrameFields
from kochab.window.services import Services
from kochab.window.widgets import (
    Page,
    column,
    field_values,
    fill_fields,
    form,
    label,
    narrow_box,
    number_field,
    show_text,
    switch,
    text_field,
)
from kochab.workflows.polar.sources import last_night
from kochab.workflows.session.alignment import AlignmentRequest, AxisTurnedBy, FrameSource

ADVICE = tr_noop(
    "Take two or more frames with the RA axis rotated between them, in any part of the sky, tracking"
    " or not. The pole need not be visible."
)
FILES_ADVICE = tr_noop(
    "Two or more frames with the RA axis rotated between them, in any part of the sky. Or what a tracking mount gave"
    " while nobody turned it, 10 minutes or more: light frames, a recorded live session (solutions.jsonl), a PHD2 guide"
    " log. Solved files (.wcs, JSON) do too. Drop them here."
)
DRIFT_ADVICE = tr_noop(
    "Let the mount track one place and touch nothing: its drift shows the axis in some minutes, azimuth soonest near"
    " the meridian, altitude 6 h from it. Best with the guider off."
)
BASE_TIP = tr_noop("What carries the mount. Without adjusting screws, 4′ is the finest goal")
MOTORS_TIP = tr_noop(
    "Motorised azimuth and altitude adjusters: OAPA, AAPA, Avalon. A small move shows Kochab which way each one goes"
)
POLES = {
    Pole.REFRACTED: tr_noop("Refracted pole: best tracking at mid latitudes"),
    Pole.TRUE: tr_noop("True pole: without refraction"),
    Pole.HALF_WAY: tr_noop("Halfway between: best near latitude 20°"),
}
SENTENCES = {  # the set-up in one sentence
    FrameSource.PRACTICE: tr_noop("Practice: align to the {pole} within {goal}. {hand}"),
    FrameSource.CAMERA: tr_noop("Align to the {pole} within {goal}, with the camera. {hand}"),
    FrameSource.FILES: tr_noop("Measure the error against the {pole} from files. Drop them here."),
}
SHORT_POLES = {
    Pole.REFRACTED: tr_noop("refracted pole"),
    Pole.TRUE: tr_noop("true pole"),
    Pole.HALF_WAY: tr_noop("half-way pole"),
}
HANDS = {
    AxisTurnedBy.PERSON: tr_noop("You rotate RA by hand."),
    AxisTurnedBy.MOUNT: tr_noop("The mount rotates RA."),
    AxisTurnedBy.NOBODY: tr_noop("Measured by drift."),
}
PLANNED = 0.0  # the lowest value, which is shown as words
NO_SITE = tr_noop("Set your site to see the target's altitude.")
SECOND_TIP = tr_noop("Measures flexure, which a single sweep cannot tell from the axis error; takes about a minute")
NAME = "polar"  # in the settings


class AxisFields(QObject):
    """Who turns the RA axis and how far, what carries the mount, and what turns its adjusters."""

    changed = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.hand = narrow_box(tr("Who turns the RA axis"), 8, {tr(hand): hand for hand in AxisTurnedBy})
        self.mount = label("", "muted", wrap=True)
        self.base = narrow_box(tr("What carries the mount"), 8, {tr(base): base for base in Base})
        self.base.setToolTip(tr(BASE_TIP))
        self.motors = switch(tr("motorised"), tr(MOTORS_TIP))
        self.motors.setAccessibleName(tr("Motors turn the adjusters"))
        self.motor_port = text_field(tr("Port of the adjusters"), tr("/dev/ttyUSB1, COM5, tcp://192.168.4.1:4030"))
        self.turn = number_field(tr("Rotation in RA"), 0, 120, PLANNED, 0, "°")
        self.turn.setSpecialValueText(tr("planned from the first frame"))
        self.turn.setSingleStep(5)
        self.second = switch(tr("second sweep"), tr(SECOND_TIP))
        self.second.setAccessibleName(tr("Second sweep at another declination"))
        self.hand.currentIndexChanged.connect(self.changed)
        self.motors.toggled.connect(self.changed)

    @property
    def turned_by(self) -> AxisTurnedBy:
        """Who turns the RA axis."""
        return AxisTurnedBy(self.hand.currentData())

    @property
    def turn_deg(self) -> float | None:
        """How far it is turned; None where that is planned from the first frame."""
        return None if self.turn.value() == PLANNED else self.turn.value()

    def adjusters(self, source: FrameSource) -> str:
        """The port of motorised adjusters, or "" for hands; UsageError where none is named."""
        port = self.motor_port.text().strip()
        if self.motors.isHidden() or not self.motors.isChecked():
            return ""
        if source is FrameSource.CAMERA and not port:
            raise UsageError("Fill in the port of the motorised adjusters.")
        # The motors of a practice night have no port.
        return port or "practice"

    def show_in(self, form: QFormLayout, source: FrameSource, drifts: bool) -> None:
        """Show the fields that the source needs; ``drifts`` when nobody turns the axis."""
        files, camera = source is FrameSource.FILES, source is FrameSource.CAMERA
        form.setRowVisible(self.hand, not files)
        form.setRowVisible(self.mount, camera and not drifts)
        form.setRowVisible(self.motor_port, camera and not drifts and self.motors.isChecked())
        for widget in (self.turn, self.second, self.motors, self.base):
            form.setRowVisible(widget, not (files or drifts))


class AimFields(QObject):
    """Where the person observes, which pole the axis is to point at, and how well."""

    changed = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.site = text_field(tr("Your site"), tr("{example} (empty: as the frames say)", example="48.14, 11.58"))
        self.pole = narrow_box(tr("Pole"), 8, {tr(title): pole for pole, title in POLES.items()})
        self.pole_name = label("", "muted", wrap=True)
        self.goal = number_field(tr("Goal"), 10, 600, 30, 0, "″")
        self.fov = text_field(tr("Field of view"), tr("width in degrees, optional"))
        self.imaging = text_field(
            tr("Your frames"), tr("{example} (optional: is it good enough?)", example="600 mm, 3.76 µm, 300 s")
        )
        self._shown_site: Site | None = None
        self.pole.currentIndexChanged.connect(self.changed)
        self.site.textChanged.connect(self.changed)

    @property
    def chosen_pole(self) -> Pole:
        """The pole to align to."""
        return list(POLES)[self.pole.currentIndex()]

    @property
    def typed_site(self) -> Site | None:
        """The site as it is typed, None for none; UsageError says what is wrong."""
        text = self.site.text().strip()
        return parse_site(text) if text else None

    @property
    def fov_deg(self) -> float | None:
        """The width of the frames; UsageError says what is wrong."""
        text = self.fov.text().strip()
        return parse_positive(text, tr("The field of view"), 170.0) if text else None

    @property
    def frames_to_take(self) -> Imaging | None:
        """What the alignment is for; UsageError says what is wrong."""
        text = self.imaging.text().strip()
        return Imaging.parse(text) if text else None

    def offer_site(self, site: Site | None) -> None:
        """Fill in the person's site, unless one is typed."""
        # Once: a field that a person clears stays empty, though this runs twice a second.
        if site != self._shown_site:
            self._shown_site = site
            if not self.site.text().strip() and site is not None:
                self.site.setText(site_text(site))

    def show_in(self, form: QFormLayout, source: FrameSource, drifts: bool) -> None:
        """Show the fields that the source needs, and the name of the pole."""
        form.setRowVisible(self.goal, not drifts)
        for widget in (self.site, self.fov):
            form.setRowVisible(widget, source is not FrameSource.PRACTICE)  # which has a site of its own
        text = ""
        if source is not FrameSource.PRACTICE:
            with suppress(UsageError):
                site = self.typed_site
                text = tr(NO_SITE) if site is None else tr("Target: {pole}", pole=name_of(self.chosen_pole, site))
        self.pole_name.setText(text)
        form.setRowVisible(self.pole_name, bool(text))


class AlignmentSetupPanel(Page):
    """Frames, axis and aim in one form; :meth:`request` reads them."""

    def __init__(self, services: Services) -> None:
        super().__init__()
        self._services = services
        self.frames, self.axis, self.aim = FrameFields(services), AxisFields(), AimFields()
        self.advice = label("", "muted", wrap=True)
        self.last_night = label("", "", wrap=True)
        self._known_mount: MountSelection | None = None
        self._kept: dict[str, QWidget] = {
            "source": self.frames.source,
            "hand": self.axis.hand,
            "pole": self.aim.pole,
            "goal": self.aim.goal,
            "turn": self.axis.turn,
            "exposure": self.frames.exposure,
            "fov": self.aim.fov,
            "second": self.axis.second,
            "imaging": self.aim.imaging,
            "base": self.axis.base,
            "motors": self.axis.motors,
            "motor_port": self.axis.motor_port,
        }
        self._lay_out()
        for fields in (self.frames, self.axis, self.aim):
            fields.changed.connect(self._show)
        self._restore()
        # After the saved choice, since the present choice of another view counts more.
        self.frames.camera.follow(services.cameras)
        self._show()

    def _lay_out(self) -> None:
        axis, aim = self.axis, self.aim
        self.form = form(
            *self.frames.rows(),
            (tr("RA a&xis"), axis.hand),
            ("", axis.mount),
            (tr("Base"), axis.base),
            (tr("Ad&justers"), axis.motors),
            ("", axis.motor_port),
            (tr("&Your site"), aim.site),
            (tr("&Pole"), aim.pole),
            ("", aim.pole_name),
            (tr("&Goal"), aim.goal),
            (tr("Rotation"), axis.turn),
            (tr("Flexure"), axis.second),
            (tr("Field of view"), aim.fov),
            (tr("Your frames"), aim.imaging),
        )
        # Without a title, across both columns, which `form` has no way to say.
        self.form.insertRow(3, self.frames.camera)
        self.form.setRowWrapPolicy(QFormLayout.RowWrapPolicy.WrapLongRows)
        self.form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        column(self.advice, self.last_night, self.form, None, on=self, margins=(12, 12, 12, 12))

    def request(self) -> AlignmentRequest:
        """What was chosen; UsageError says what is wrong."""
        frames, axis, aim = self.frames, self.axis, self.aim
        camera = frames.selection
        return AlignmentRequest(
            frames.chosen,
            aim.chosen_pole,
            aim.typed_site,
            frames.files.paths(0),
            frames.files.paths(1),
            camera,
            axis.turned_by,
            self._known_mount,
            aim.goal.value(),
            axis.turn_deg,
            fov_deg=aim.fov_deg,
            second_sweep=axis.second.isChecked(),
            hint=current_profile(self._services.settings).hint_of(*camera.camera),
            utc_offset_h=frames.zone.currentData(),
            guided=frames.guided.currentData(),
            follow=frames.grows.isChecked(),
            adjusters=axis.adjusters(frames.chosen),
            base=Base(axis.base.currentData()),
            dec_sign=frames.dec_sign.currentData(),
            profile=self._profile_name,
            mount_doubt=self._mount_doubt,
        )

    @property
    def sentence(self) -> str:
        """What was chosen, in one sentence."""
        pole, goal = tr(SHORT_POLES[self.aim.chosen_pole]), angle_in_words(self.aim.goal.value())
        return tr(SENTENCES[self.frames.chosen], pole=pole, goal=goal, hand=tr(HANDS[self.axis.turned_by]))

    @property
    def other_steps(self) -> tuple[str, ...]:
        """How it goes where no bolt is turned: from files, or by the drift of a mount that nobody turns."""
        return (self.advice.text(),) if self._drifts or self.frames.chosen is FrameSource.FILES else ()

    @property
    def guess(self) -> str:
        """Where the axis of a tripod on the same marks stands, after another night; empty without one."""
        if self.frames.chosen is not FrameSource.PRACTICE:
            # A site that is being typed is none yet.
            with suppress(UsageError):
                site = self.aim.typed_site
                night = None if site is None else last_night(site, self._profile_name, datetime.now(UTC))
                return "" if night is None else night.guess
        return ""

    @property
    def _mount_doubt(self) -> str:
        """What a connected mount contradicts of this computer's clock and of the site."""
        known = self._services.mount.known
        return known.report.clock_conflict if known.phase == "on" and known.report is not None else ""

    @property
    def _profile_name(self) -> str:
        return current_profile(self._services.settings).name

    def refresh(self) -> None:
        """Show the mount that would turn the axis, and the site unless one is typed."""
        selection = current_profile(self._services.settings).mount
        self._known_mount = selection if selection.port else None
        self.axis.mount.setText(mount_text(self._known_mount, self._services.mount.known))
        self.aim.offer_site(self._services.settings.site)
        self._show_aim()

    @property
    def _drifts(self) -> bool:
        return self.frames.chosen is not FrameSource.FILES and self.axis.turned_by is AxisTurnedBy.NOBODY

    def _show(self) -> None:
        """Show the fields that go with the choices."""
        source, drifts = self.frames.chosen, self._drifts
        files = source is FrameSource.FILES
        self.advice.setText(tr(FILES_ADVICE if files else DRIFT_ADVICE if drifts else ADVICE))
        self.frames.show_in(self.form, drifts)
        self.axis.show_in(self.form, source, drifts)
        self._show_aim()

    def _show_aim(self) -> None:
        self.aim.show_in(self.form, self.frames.chosen, self._drifts)
        show_text(self.last_night, self.guess)

    def save(self) -> None:
        """Remember what was chosen, except files and the site."""
        box = self.frames.camera
        camera = {"kind": box.kind, "address": box.address.text()}
        self._services.settings.keep(NAME, json.dumps(field_values(self._kept) | camera))

    def _restore(self) -> None:
        """As last time; damaged values stay at their defaults."""
        saved = self._services.settings.table(NAME)
        fill_fields(self._kept, saved)
        if isinstance(saved.get("kind"), str) and isinstance(saved.get("address"), str):
            self.frames.camera.show_selection(CameraSelection(saved["kind"], saved["address"]))


def mount_text(selection: MountSelection | None, known: MountSnapshot) -> str:
    """Which mount would turn the axis."""
    if known.phase not in ("off", "leaving"):
        name = known.connected.name if known.connected is not None else known.port
        return tr("Connected: {name}. Esc stops it.", name=name)
    if selection is None:
        return tr(NO_MOUNT)
    return tr("{driver} on {port}: connects when you begin.", driver=selection.driver, port=selection.port)
