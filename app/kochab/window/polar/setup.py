"""The set-up of an alignment: frames, who turns the RA axis, pole and site; remembered between starts."""

import json
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QComboBox, QFormLayout, QListWidget, QListWidgetItem, QWidget

from kochab.core import tr, tr_noop
from kochab.core.angle_text import parse_positive, parse_site, site_text
from kochab.core.errors import UsageError
from kochab.core.frame import Site
from kochab.gear.cameras import SOURCES
from kochab.gear.mount_events import MountSnapshot
from kochab.gear.profiles import current_profile
from kochab.gear.session import CameraSelection, MountSelection
from kochab.polar.bolts import Base
from kochab.polar.error import Imaging
from kochab.polar.horizon import Pole, name_of
from kochab.window.devices.cameras import CameraBox
from kochab.window.dialogs import ask_frames
from kochab.window.polar.alignment_run import NO_MOUNT
from kochab.window.services import Services
from kochab.window.widgets import (
    Page,
    button,
    column,
    field_values,
    fill_fields,
    form,
    grid,
    label,
    narrow_box,
    number_field,
    show_text,
    switch,
    text_field,
)
from kochab.workflows.polar.guide_logs import is_guide_log
from kochab.workflows.polar.sources import last_night
from kochab.workflows.session.alignment import AlignmentRequest, AxisTurnedBy, FrameSource

SWEEP = Qt.ItemDataRole.UserRole
LINES = 6


class FrameList(QListWidget):
    """The frames to measure, each once; those of a second sweep measure flexure."""

    changed = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setAccessibleName(tr("Frames to measure"))
        self.setFixedHeight(LINES * self.fontMetrics().height())

    def add(self, paths: list[Path], sweep: int = 0) -> None:
        """Add frames of the first sweep (0) or the second (1)."""
        # The tip of an item is its whole path.
        there = {self.item(i).toolTip() for i in range(self.count())}
        for path in paths:
            if str(path) not in there:
                there.add(str(path))
                item = QListWidgetItem(tr("{name}, second sweep", name=path.name) if sweep else path.name)
                item.setToolTip(str(path))
                item.setData(SWEEP, sweep)
                self.addItem(item)
        self.changed.emit()

    def clear(self) -> None:
        """Take all out."""
        super().clear()
        self.changed.emit()

    def fill(self, sweeps: tuple[tuple[Path, ...], ...]) -> None:
        """The files of each sweep, in place of all there are."""
        self.clear()
        for sweep, paths in enumerate(sweeps):
            self.add(list(paths), sweep)

    def paths(self, sweep: int) -> tuple[Path, ...]:
        """The files of one sweep."""
        items = [self.item(i) for i in range(self.count())]
        return tuple(Path(i.toolTip()) for i in items if i.data(SWEEP) == sweep)


FRAMES = "*.fit *.fits *.fts *.xisf *.cr2 *.cr3 *.nef *.arw *.dng *.tif *.tiff *.png *.jpg"
SOLVED_OR_GUIDED = "*.wcs *.json *.jsonl *GuideLog*.txt"
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
GUIDED = {tr_noop("as the drift shows"): None, tr_noop("guided"): True, tr_noop("not guided"): False}
GUIDED_TIP = tr_noop("A guider holds the stars: then only the rotation of the field counts")
DEC_SIGNS = {tr_noop("as the log says"): 0, tr_noop("north is north"): 1, tr_noop("north is south"): -1}
DEC_SIGN_TIP = tr_noop(
    "Which way the north pulses of a guide log move the mount, where the log doesn't say it, as ASIAIR's"
)
GROWS_TIP = tr_noop("For a guide log or a live session still being recorded, until the axis is known to 30″")
BASE_TIP = tr_noop("What carries the mount. Without adjusting screws, 4′ is the finest goal")
MOTORS_TIP = tr_noop(
    "Motorised azimuth and altitude adjusters: OAPA, AAPA, Avalon. A small move shows Kochab which way each one goes"
)
ZONE_TIP = tr_noop("How far the clock of the files is ahead of UTC")
# The zones that are no whole hours ahead of UTC.
HALF_ZONES_H = (-9.5, -3.5, 3.5, 4.5, 5.5, 5.75, 6.5, 8.75, 9.5, 10.5, 12.75)
POLES = {
    Pole.REFRACTED: tr_noop("Refracted pole: best tracking at mid latitudes"),
    Pole.TRUE: tr_noop("True pole: without refraction"),
    Pole.HALF_WAY: tr_noop("Halfway between: best near latitude 20°"),
}
PLANNED = 0.0  # the lowest value, which is shown as words
NO_SITE = tr_noop("Set your site to see the target's altitude.")
EXPOSURE_TIP = tr_noop("Applies to every view of this camera during the alignment")
SECOND_TIP = tr_noop("Measures flexure, which a single sweep cannot tell from the axis error")
SECOND = tr_noop("Frames of a second sweep at another declination, to measure flexure")
NAME = "polar"  # in the settings


class AlignmentSetupPanel(Page):
    """The fields; :meth:`request` reads them."""

    message = Signal(str, str)  # a sentence and its role

    def __init__(self, services: Services) -> None:
        super().__init__()
        self._services = services
        self.source = narrow_box(tr("Source of the frames"), 8, {tr(source): source for source in FrameSource})
        if services.wiring.practice is None:
            # Practice is the first of FrameSource.
            self.source.removeItem(0)
        self.files = FrameList()
        self.add = button(tr("&Add frames…"), lambda: self._ask_files(0))
        self.add_check = button(tr("Second s&weep…"), lambda: self._ask_files(1), tip=tr(SECOND))
        self.add_open = button(tr("Use &open frame"), self._add_open_frame)
        self.clear = button(tr("Clea&r"), self._clear_files)
        self.camera = CameraBox(n for n in SOURCES if n != "simulated")  # that one has its own mount
        self.exposure = number_field(tr("Exposure"), 0.05, 60.0, 2.0, 2, tr(" s"), tr(EXPOSURE_TIP))
        self.hand = narrow_box(tr("Who turns the RA axis"), 8, {tr(hand): hand for hand in AxisTurnedBy})
        self.zone = zone_box()
        self.guided = narrow_box(tr("Guided"), 8, {tr(text): guided for text, guided in GUIDED.items()})
        self.guided.setToolTip(tr(GUIDED_TIP))
        self.dec_sign = narrow_box(tr("Dec pulses"), 8, {tr(text): sign for text, sign in DEC_SIGNS.items()})
        self.dec_sign.setToolTip(tr(DEC_SIGN_TIP))
        self.grows = switch(tr("measure again as they grow"), tr(GROWS_TIP))
        self.grows.setAccessibleName(tr("Follow files that grow"))
        self.advice = label("", "muted", wrap=True)
        self.last_night = label("", "", wrap=True)
        self.site = text_field(tr("Your site"), tr("{example} (empty: as the frames say)", example="48.14, 11.58"))
        self.pole = narrow_box(tr("Pole"), 8, {tr(title): pole for pole, title in POLES.items()})
        self.pole_name = label("", "muted", wrap=True)
        self.goal = number_field(tr("Goal"), 10, 600, 30, 0, "″")
        self.turn = number_field(tr("Rotation in RA"), 0, 120, PLANNED, 0, "°")
        self.turn.setSpecialValueText(tr("planned from the first frame"))
        self.turn.setSingleStep(5)
        self.second = switch(tr("second sweep"), tr(SECOND_TIP))
        self.second.setAccessibleName(tr("Second sweep at another declination"))
        self.fov = text_field(tr("Field of view"), tr("width in degrees, optional"))
        self.imaging = text_field(
            tr("Your frames"), tr("{example} (optional: is it good enough?)", example="600 mm, 3.76 µm, 300 s")
        )
        self.base = narrow_box(tr("What carries the mount"), 8, {tr(base): base for base in Base})
        self.base.setToolTip(tr(BASE_TIP))
        self.motors = switch(tr("motorised"), tr(MOTORS_TIP))
        self.motors.setAccessibleName(tr("Motors turn the adjusters"))
        self.motor_port = text_field(tr("Port of the adjusters"), tr("/dev/ttyUSB1, COM5, tcp://192.168.4.1:4030"))
        self.mount = label("", "muted", wrap=True)
        self._known_mount: MountSelection | None = None
        self._shown_site: Site | None = None
        self._kept = {
            "source": self.source,
            "hand": self.hand,
            "pole": self.pole,
            "goal": self.goal,
            "turn": self.turn,
            "exposure": self.exposure,
            "fov": self.fov,
            "second": self.second,
            "imaging": self.imaging,
            "base": self.base,
            "motors": self.motors,
            "motor_port": self.motor_port,
        }
        self._lay_out()
        self.source.currentIndexChanged.connect(self._enable)
        self.hand.currentIndexChanged.connect(self._enable)
        self.files.changed.connect(self._enable)
        self.motors.toggled.connect(self._enable)
        self.pole.currentIndexChanged.connect(self._name_pole)
        self.site.textChanged.connect(self._name_pole)
        self._restore()
        # After the saved choice, since the present choice of another view counts more.
        self.camera.follow(services.cameras)
        self._enable()

    def _lay_out(self) -> None:
        self.file_row = QWidget()
        files = grid((self.add, self.add_check), (self.add_open, self.clear), across=6, down=6, on=self.file_row)
        files.setContentsMargins(0, 0, 0, 0)
        self.form = form(
            (tr("Frames from"), self.source),
            ("", self.files),
            ("", self.file_row),
            (tr("Clock"), self.zone),
            (tr("Guided"), self.guided),
            (tr("Dec pulses"), self.dec_sign),
            (tr("Follow"), self.grows),
            (tr("Exposure"), self.exposure),
            (tr("RA a&xis"), self.hand),
            ("", self.mount),
            (tr("Stands on"), self.base),
            (tr("Ad&justers"), self.motors),
            ("", self.motor_port),
            (tr("&Your site"), self.site),
            (tr("&Pole"), self.pole),
            ("", self.pole_name),
            (tr("&Goal"), self.goal),
            (tr("Rotation"), self.turn),
            (tr("Flexure"), self.second),
            (tr("Field of view"), self.fov),
            (tr("Your frames"), self.imaging),
        )
        # Without a title, across both columns, which `form` has no way to say.
        self.form.insertRow(3, self.camera)
        self.form.setRowWrapPolicy(QFormLayout.RowWrapPolicy.WrapLongRows)
        self.form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        column(self.advice, self.last_night, self.form, None, on=self, margins=(12, 12, 12, 12))

    @property
    def chosen_source(self) -> FrameSource:
        """Where the frames come from."""
        return FrameSource(self.source.currentData())

    @property
    def chosen_pole(self) -> Pole:
        """The pole to align to."""
        return list(POLES)[self.pole.currentIndex()]

    def request(self) -> AlignmentRequest:
        """What was chosen; UsageError says what is wrong."""
        site, fov, turn = self.site.text().strip(), self.fov.text().strip(), self.turn.value()
        camera = CameraSelection(self.camera.kind, self.camera.address.text().strip(), self.exposure.value())
        return AlignmentRequest(
            self.chosen_source,
            self.chosen_pole,
            parse_site(site) if site else None,
            self.files.paths(0),
            self.files.paths(1),
            camera,
            AxisTurnedBy(self.hand.currentData()),
            self._known_mount,
            self.goal.value(),
            None if turn == PLANNED else turn,
            fov_deg=parse_positive(fov, tr("The field of view"), 170.0) if fov else None,
            second_sweep=self.second.isChecked(),
            hint=current_profile(self._services.settings).hint_of(*camera.camera),
            utc_offset_h=self.zone.currentData(),
            guided=self.guided.currentData(),
            follow=self.grows.isChecked(),
            adjusters=self._adjusters,
            base=Base(self.base.currentData()),
            dec_sign=self.dec_sign.currentData(),
            profile=self._profile_name,
            mount_doubt=self._mount_doubt,
        )

    @property
    def _adjusters(self) -> str:
        """The port of motorised adjusters, or "" for hands; UsageError where none is named."""
        port = self.motor_port.text().strip()
        if self.motors.isHidden() or not self.motors.isChecked():
            return ""
        if self.chosen_source is FrameSource.CAMERA and not port:
            raise UsageError("Fill in the port of the motorised adjusters.")
        # The motors of a practice night have no port.
        return port or "practice"

    @property
    def guess(self) -> str:
        """Where the axis of a tripod on the same marks stands, after another night; empty without one."""
        site = self.site.text().strip()
        if self.chosen_source is not FrameSource.PRACTICE and site:
            # A site that is being typed is none yet.
            with suppress(UsageError):
                night = last_night(parse_site(site), self._profile_name, datetime.now(UTC))
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

    def frames_to_take(self) -> Imaging | None:
        """What the alignment is for; UsageError says what is wrong."""
        text = self.imaging.text().strip()
        return Imaging.parse(text) if text else None

    def refresh(self) -> None:
        """Show the mount that would turn the axis, and the site unless one is typed."""
        selection = current_profile(self._services.settings).mount
        self._known_mount = selection if selection.port else None
        self.mount.setText(mount_text(self._known_mount, self._services.mount.known))
        site = self._services.settings.site
        # Once: a field that a person clears stays empty, though this runs twice a second.
        if site != self._shown_site:
            self._shown_site = site
            if not self.site.text().strip() and site is not None:
                self.site.setText(site_text(site))
        self._name_pole()

    def _enable(self, _: int = 0) -> None:
        source = self.chosen_source
        files, camera = source is FrameSource.FILES, source is FrameSource.CAMERA
        drifts = not files and AxisTurnedBy(self.hand.currentData()) is AxisTurnedBy.NOBODY
        self.advice.setText(tr(FILES_ADVICE if files else DRIFT_ADVICE if drifts else ADVICE))
        for widget in (self.files, self.file_row, self.zone):
            self.form.setRowVisible(widget, files)
        self.form.setRowVisible(self.guided, files or drifts)
        self.form.setRowVisible(self.camera, camera)
        self.form.setRowVisible(self.mount, camera and not drifts)
        for widget in (self.exposure, self.hand):
            self.form.setRowVisible(widget, not files)
        self.form.setRowVisible(self.motor_port, camera and not drifts and self.motors.isChecked())
        for widget in (self.turn, self.second, self.motors, self.base):
            self.form.setRowVisible(widget, not (files or drifts))
        self.form.setRowVisible(self.goal, not drifts)
        self.form.setRowVisible(self.grows, files)
        self.form.setRowVisible(self.dec_sign, files and any(is_guide_log(path) for path in self.files.paths(0)))
        for widget in (self.site, self.fov):
            self.form.setRowVisible(widget, source is not FrameSource.PRACTICE)
        self._name_pole()

    def _name_pole(self, _: object = None) -> None:
        site, text = self.site.text().strip(), ""
        if self.chosen_source is not FrameSource.PRACTICE:  # which has a site of its own
            with suppress(UsageError):
                text = tr("Target: {pole}", pole=name_of(self.chosen_pole, parse_site(site))) if site else tr(NO_SITE)
        self.pole_name.setText(text)
        show_text(self.last_night, self.guess)
        self.form.setRowVisible(self.pole_name, bool(text))

    def take_files(self, paths: list[Path]) -> None:
        """Measure from these files, with those that are there already."""
        self.source.setCurrentIndex(self.source.findData(FrameSource.FILES))
        self.files.add(paths)

    def _clear_files(self) -> None:
        before = self.files.paths(0), self.files.paths(1)
        self.files.clear()
        self._services.undo.made(tr("clear the frames to measure"), self.files.fill, before, ((), ()))

    def _ask_files(self, sweep: int) -> None:
        start = self._services.settings.text("folder", str(Path.home()))
        kinds = tr("Frames ({endings});;All files (*)", endings=f"{FRAMES} {SOLVED_OR_GUIDED}")
        paths = ask_frames(self.window(), start, tr("Frames to measure"), kinds)
        self.files.add(paths, sweep)

    def _add_open_frame(self) -> None:
        path = self._services.session.known.path
        if path is None:
            self.message.emit(tr("Open a frame first."), "muted")
        else:
            self.files.add([path])

    def save(self) -> None:
        """Remember what was chosen, except files and the site."""
        camera = {"kind": self.camera.kind, "address": self.camera.address.text()}
        self._services.settings.keep(NAME, json.dumps(field_values(self._kept) | camera))

    def _restore(self) -> None:
        """As last time; damaged values stay at their defaults."""
        saved = self._services.settings.table(NAME)
        fill_fields(self._kept, saved)
        if isinstance(saved.get("kind"), str) and isinstance(saved.get("address"), str):
            self.camera.show_selection(CameraSelection(saved["kind"], saved["address"]))


def zone_box() -> QComboBox:
    """To say how far the clock of files is ahead of UTC: hours, or None as they say it themselves."""
    hours = sorted((*range(-12, 15), *HALF_ZONES_H))
    zones = {tr("UTC{hours}", hours=hours_text(h)) if h else tr("UTC"): float(h) for h in hours}
    made = narrow_box(tr("Clock of the files"), 14, {tr("as the files say"): None, **zones})
    made.setToolTip(tr(ZONE_TIP))
    return made


def hours_text(hours: float) -> str:
    """``+5:30`` for 5.5."""
    whole, minutes = divmod(round(abs(hours) * 60.0), 60)
    return f"{'+' if hours > 0 else '−'}{whole}{f':{minutes:02d}' if minutes else ''}"


def mount_text(selection: MountSelection | None, known: MountSnapshot) -> str:
    """Which mount would turn the axis."""
    if known.phase not in ("off", "leaving"):
        name = known.connected.name if known.connected is not None else known.port
        return tr("Connected: {name}. Esc stops it.", name=name)
    if selection is None:
        return tr(NO_MOUNT)
    return tr("{driver} on {port}: connects when you begin.", driver=selection.driver, port=selection.port)
