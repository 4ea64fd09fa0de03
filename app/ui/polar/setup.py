"""What an alignment begins with: frames from where, who turns the axis, which pole, which place."""

from pathlib import Path

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QFormLayout,
    QGridLayout,
    QHBoxLayout,
    QVBoxLayout,
    QWidget,
)

from app.cameras import SOURCES
from app.core.capture import CameraDevice
from app.core.errors import UsageError
from app.core.hint import Site
from app.polar.poles import Pole, name_of
from app.ui.angle_input import parse_positive, parse_site, site_text
from app.ui.mount.eye import CameraWish
from app.ui.mount.known import MountKnown
from app.ui.mount.wishes import MountWish
from app.ui.polar.fields import choice, seconds, text, whole
from app.ui.polar.frame_list import FrameList
from app.ui.polar.wish import AlignWish, Hand, Source
from app.ui.widgets import button, label

ADVICE = (
    "Any two frames or more between which the mount turned about its RA axis, in any part of the"
    " sky, tracking or not. The pole need not be in sight."
)
POLES = {
    Pole.REFRACTED: "Refracted pole: best tracking at middle latitudes",
    Pole.TRUE: "True pole: without the air",
    Pole.HALF_WAY: "Half-way between: best near latitude 20°",
}
PLANNED = 0.0
SECOND_TIP = "It shows how the tube bends with gravity, which one sweep cannot tell from the axis"
SECOND = "Frames at another declination, the RA axis turned between them: they show flexure"


class SetupPanel(QWidget):
    """Fields alone; :meth:`wish` understands them."""

    files_wanted = Signal(bool)  # whether they are of a second sweep
    open_frame_wanted = Signal()
    devices_wanted = Signal(str, str)  # source, address

    def __init__(self, can_practise: bool) -> None:
        super().__init__()
        self.setObjectName("page")
        self.source = choice("Where the frames come from", [str(s) for s in Source])
        self.files = FrameList()
        self.add = button("&Add frames…", lambda: self.files_wanted.emit(False))
        self.add_check = button("Second s&weep…", lambda: self.files_wanted.emit(True), tip=SECOND)
        self.add_open = button("The &open frame", self.open_frame_wanted.emit)
        self.clear = button("Clea&r", self.files.clear)
        self.kind = choice("Kind of camera", [n for n in SOURCES if n != "simulated"])
        self.device = choice("Camera")
        self.device.setEditable(True)
        self.search = button("F&ind", self._find, tip="Look for cameras of this kind")
        self.exposure = seconds("Exposure", 0.05, 60.0, 2.0)
        self.exposure.setToolTip("While it is aligned this holds for every view of the camera")
        self.hand = choice("Who turns the RA axis", [str(h) for h in Hand])
        self.site = text("Your site", "48.14, 11.58: latitude, longitude; empty: as the frames say")
        self.pole = choice("Pole", list(POLES.values()))
        self.pole_name = label("", "muted", wrap=True)
        self.goal = whole("Goal", 10, 600, 30, "″")
        self.turn = whole("Turn of the axis", 0, 120, 0, "°")
        self.turn.setSpecialValueText("planned from the first frame")
        self.turn.setSingleStep(5)
        self.second = QCheckBox("show it by a second sweep")
        self.second.setAccessibleName("Second sweep at another declination")
        self.second.setToolTip(SECOND_TIP)
        self.fov = text("Field width", "degrees, may stay empty")
        self.mount = label("", "muted", wrap=True)
        self._known_mount: MountWish | None = None
        self._lay_out()
        if not can_practise:
            self.source.removeItem(0)
        self.source.currentIndexChanged.connect(self._enable)
        self.pole.currentIndexChanged.connect(self._name_pole)
        self.site.textChanged.connect(self._name_pole)
        self._enable()
        self._name_pole()

    def _lay_out(self) -> None:
        self.form = form = QFormLayout()
        form.setRowWrapPolicy(QFormLayout.RowWrapPolicy.WrapLongRows)
        form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        self.file_row, self.camera_row = QWidget(), QWidget()
        grid = QGridLayout(self.file_row)
        for place, made in enumerate((self.add, self.add_check, self.add_open, self.clear)):
            grid.addWidget(made, place // 2, place % 2)
        line = QHBoxLayout(self.camera_row)
        line.addWidget(self.kind)
        line.addWidget(self.device, 1)
        line.addWidget(self.search)
        for layout in (grid, line):
            layout.setContentsMargins(0, 0, 0, 0)
        form.addRow("Frames from", self.source)
        form.addRow("", self.files)
        form.addRow("", self.file_row)
        form.addRow("Ca&mera", self.camera_row)
        form.addRow("Exposure", self.exposure)
        form.addRow("RA a&xis", self.hand)
        form.addRow("", self.mount)
        form.addRow("&Your site", self.site)
        form.addRow("&Pole", self.pole)
        form.addRow("", self.pole_name)
        form.addRow("&Goal", self.goal)
        form.addRow("Turn", self.turn)
        form.addRow("Bending", self.second)
        form.addRow("Field width", self.fov)
        column = QVBoxLayout(self)
        column.setContentsMargins(12, 12, 12, 12)
        column.addWidget(label(ADVICE, "muted", wrap=True))
        column.addLayout(form)
        column.addStretch(1)

    # what stands there ------------------------------------------------------------------------
    @property
    def chosen_source(self) -> Source:
        """Where frames come from."""
        return Source(self.source.currentText())

    @property
    def chosen_pole(self) -> Pole:
        """The pole to align to."""
        return list(POLES)[self.pole.currentIndex()]

    def wish(self) -> AlignWish:
        """What was chosen; UsageError says what is wrong."""
        site, fov = self.site.text().strip(), self.fov.text().strip()
        address = self.device.currentData() or self.device.currentText().strip()
        turn = float(self.turn.value())
        return AlignWish(
            self.chosen_source, self.chosen_pole, parse_site(site) if site else None,
            self.files.paths(0), self.files.paths(1),
            CameraWish(self.kind.currentText(), str(address), self.exposure.value()),
            Hand(self.hand.currentText()), self._known_mount, float(self.goal.value()),
            None if turn == PLANNED else turn,
            fov_deg=parse_positive(fov, "The field width", 170.0) if fov else None,
            second_sweep=self.second.isChecked(),
        )  # fmt: skip

    def add_files(self, paths: list[Path], sweep: int = 0) -> None:
        """More frames, each once; of the first sweep or the second."""
        self.files.add(paths, sweep)

    def show_devices(self, devices: list[CameraDevice]) -> None:
        """What was found."""
        self.device.clear()
        for found in devices:
            self.device.addItem(found.description, found.address)

    def show_camera(self, source: str, address: str) -> None:
        """The camera that another view has chosen; a simulated one has a mount of its own."""
        at = self.kind.findText(source)
        if at >= 0:
            self.kind.setCurrentIndex(at)
            self.device.setCurrentIndex(self.device.findData(address))
            if self.device.currentIndex() < 0:
                self.device.setEditText(address)

    def show_mount(self, wish: MountWish, known: MountKnown) -> None:
        """The mount that the Mount view knows, and whether it is connected."""
        self._known_mount = wish if wish.port else None
        self.mount.setText(mount_text(self._known_mount, known))

    def show_site(self, site: Site | None) -> None:
        """Where the person observes, unless something is typed already."""
        if not self.site.text().strip() and site is not None:
            self.site.setText(site_text(site))

    # inside -----------------------------------------------------------------------------------
    def _enable(self, _: int = 0) -> None:
        source = self.chosen_source
        files, camera = source is Source.FILES, source is Source.CAMERA
        for widget in (self.files, self.file_row):
            self.form.setRowVisible(widget, files)
        self.form.setRowVisible(self.camera_row, camera)
        for widget in (self.exposure, self.hand, self.turn, self.second):
            self.form.setRowVisible(widget, not files)
        self.form.setRowVisible(self.mount, camera)
        for widget in (self.site, self.fov):
            self.form.setRowVisible(widget, source is not Source.PRACTICE)
        self._name_pole()

    def _name_pole(self, _: object = None) -> None:
        text = self.site.text().strip()
        told = "Which sky and how high is said when the site is known."
        if text and self.chosen_source is not Source.PRACTICE:
            try:
                told = f"The {name_of(self.chosen_pole, parse_site(text))}."
            except UsageError:
                told = ""
        self.pole_name.setText(told)

    def _find(self) -> None:
        self.devices_wanted.emit(self.kind.currentText(), self.device.currentText().strip())


def mount_text(wish: MountWish | None, known: MountKnown) -> str:
    """Which mount will turn the axis when a person leaves it to one."""
    if known.phase not in ("off", "leaving"):
        name = known.connected.name if known.connected is not None else known.port
        return f"Connected: {name}. Esc stops it from anywhere."
    if wish is not None:
        return f"Known: {wish.driver} on {wish.port}. It is connected when you begin."
    return "No mount is known yet: connect it once in the Mount view (F3), or turn by hand."
