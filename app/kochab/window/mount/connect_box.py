"""Which mount on which port, and how it is found."""

from PySide6.QtCore import QRectF, Signal
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import QComboBox, QWidget

from kochab.core.errors import UsageError
from kochab.core.frame import Site
from kochab.core.mount import Home
from kochab.core.progress import Progress
from kochab.gear import session as equipment
from kochab.gear.mounts import COUNT_STEPS, DRIVERS, Diagnosis
from kochab.gear.mounts.probe import PortInfo
from kochab.gear.session import DRIVER_DEFAULT, EPOCHS, MountSelection
from kochab.parsing.angles import parse_site, site_text
from kochab.text.translation import tr, tr_noop
from kochab.window.job import Job, Jobs
from kochab.window.themes import draw_glyph, theme_colours
from kochab.window.widgets import button, column, form, narrow_box, row, switch, text_field

BAUDS = (DRIVER_DEFAULT, "9600", "19200", "38400", "57600", "115200", "230400")
EPOCH_TIP = tr_noop(
    "Equinox of the mount's coordinates. Leave it at default unless the mount is off by about 20′ everywhere."
)
HOME_TIP = tr_noop(
    "This mount only counts motor steps. It does not slew until you confirm the home position or "
    "sync on a solved frame."
)
FIND_TIP = tr_noop("Ask every port which mount is there. Nothing moves.")
PRACTICE = tr_noop("Practice with a simulated telescope")
PRACTICE_TIP = tr_noop("A misaligned mount with a camera, under a simulated sky")
WEDGE_TIP = tr_noop("Kochab moves an AZ-GTi or, by Wi-Fi, a Celestron fork only in equatorial mode, on a wedge")
SITE_TIP = tr_noop("Latitude, longitude in degrees, north and east positive; never sent to the mount")


class HomePicture(QWidget):
    """A German mount at home, in the colours of the theme."""

    def __init__(self) -> None:
        super().__init__()
        self.setFixedSize(96, 96)
        self.setAccessibleName(tr("The tube points at the pole, the counterweight hangs down"))

    def paintEvent(self, event: QPaintEvent) -> None:
        """Draw it."""
        painter = QPainter(self)
        draw_glyph(painter, "home", theme_colours().text, QRectF(self.rect()))
        painter.end()


class ConnectBox(QWidget):
    """Port, driver, baud rate, epoch and site of a mount that is not connected yet, and the search for it."""

    connect_wanted = Signal(object)  # MountSelection
    practice_wanted = Signal()
    site_given = Signal(object)  # Site, or None
    profile_chosen = Signal(str)  # a name, empty for none
    message = Signal(str, str)  # a sentence and its role
    progressed = Signal(object)  # Progress of a search, or None when it is over

    def __init__(self, jobs: Jobs, can_practise: bool) -> None:
        super().__init__()
        self._jobs = jobs
        self._search: Job | None = None
        self.profile = _combo(tr("Equipment profile"), tr("New equipment…"))
        self.profile.setToolTip(tr("Camera, mount, site and limits under one name, for every view"))
        typed = self.profile.lineEdit()
        assert typed is not None
        # textActivated does not come for a name that is not listed.
        for done in (self.profile.textActivated, typed.returnPressed):
            done.connect(lambda *_: self.profile_chosen.emit(self.profile.currentText().strip()))
        self.port = _combo(tr("Port of the mount"), tr("USB port or network address"))
        drivers = {tr(driver.title): name for name, driver in DRIVERS.loaded().items()}
        self.driver = narrow_box(tr("Driver of the mount"), 8, drivers)
        self.baud = _combo(tr("Baud rate"), "9600")
        self.baud.addItems([tr(BAUDS[0]), *BAUDS[1:]])
        self.epoch = narrow_box(
            tr("Epoch of the mount's coordinates"), 8, {tr(name): epoch for name, epoch in EPOCHS.items()}
        )
        self.epoch.setToolTip(tr(EPOCH_TIP))
        self.site = text_field(
            tr("Site of the mount"), tr("{example} (sets the horizon limit)", example="48.14, 11.58"), tr(SITE_TIP)
        )
        self.site.editingFinished.connect(self._site_typed)
        self.home = switch(tr("At home: tube at the pole, counterweight down"), tr(HOME_TIP))
        self.home_picture = HomePicture()
        self.equatorial = switch(tr("AZ-GTi or Celestron fork on an equatorial wedge"), tr(WEDGE_TIP))
        self.driver.currentIndexChanged.connect(self._show_questions)
        self.connect_button = button(tr("Connect"), self._connect, "main", tr("Open the port. Nothing moves."))
        self.find_button = button(tr("Find my mount"), self.search, tip=tr(FIND_TIP))
        self.practice_button = button(tr(PRACTICE), self.practice_wanted.emit, tip=tr(PRACTICE_TIP))
        self._lay_out()
        self.practice_button.setVisible(can_practise)  # not before it has a parent: it would be a window
        self._show_questions()

    def _lay_out(self) -> None:
        fields = form(
            (tr("Profile"), self.profile),
            (tr("Port"), self.port),
            (tr("Driver"), self.driver),
            (tr("Baud rate"), self.baud),
            (tr("Epoch"), self.epoch),
            (tr("Your site"), self.site),
            spacing=6,
        )
        buttons = row(self.connect_button, self.find_button, None)
        parts = (fields, self.home_picture, self.home, self.equatorial, buttons, self.practice_button)
        column(*parts, on=self, spacing=8, margins=(0, 0, 0, 0))

    def show_profiles(self, names: list[str], chosen: str) -> None:
        """List the profiles."""
        self.profile.clear()
        self.profile.addItems(["", *names])
        self.profile.setCurrentText(chosen)

    def show_ports(self, ports: list[PortInfo]) -> None:
        """List the ports; what was typed stays."""
        typed = self.chosen_port
        self.port.clear()
        for info in ports:
            words = ", ".join(w for w in (info.description, info.usb, info.hint) if w)
            self.port.addItem(f"{info.port}  ({words})", info.port)
        self.set_port(typed or (ports[0].port if ports else ""))

    def set_port(self, port: str) -> None:
        """Show a port, listed or not."""
        at = self.port.findData(port)
        if at >= 0:
            self.port.setCurrentIndex(at)
        else:
            self.port.setEditText(port)

    @property
    def chosen_port(self) -> str:
        """The chosen device, or what was typed."""
        at = self.port.findText(self.port.currentText())
        return str(self.port.itemData(at)) if at >= 0 else self.port.currentText().strip()

    def show_selection(self, selection: MountSelection) -> None:
        """Fill the fields."""
        baud, epoch = selection.baud, selection.epoch
        self.set_port(selection.port)
        self.driver.setCurrentIndex(max(0, self.driver.findData(selection.driver)))
        self.baud.setCurrentText(tr(DRIVER_DEFAULT) if baud is None else str(baud))
        self.epoch.setCurrentText(tr(DRIVER_DEFAULT if epoch is None else str(epoch)))

    def show_site(self, site: Site | None) -> None:
        """Fill in the site."""
        self.site.setText(site_text(site) if site is not None else "")

    def _connect(self) -> None:
        driver, baud, epoch = str(self.driver.currentData()), self.baud.currentText(), self.epoch.currentText()
        baud = "" if baud == tr(DRIVER_DEFAULT) else baud
        epoch = next((name for name in EPOCHS if tr(name) == epoch), epoch)
        try:
            selection = MountSelection.typed(self.chosen_port, driver, baud, epoch, *self._confirmed())
        except UsageError as error:
            self.message.emit(str(error), "wrong")
            return
        for question in (self.home, self.equatorial):
            question.setChecked(False)  # true of this moment only, so asked every time
        self.connect_wanted.emit(selection)

    def _confirmed(self) -> tuple[Home | None, bool]:
        """What only the person can know of a mount that reports neither."""
        if self.driver.currentData() not in COUNT_STEPS:
            return None, False
        return (Home.NOW if self.home.isChecked() else None), self.equatorial.isChecked()

    def _show_questions(self) -> None:
        for question in (self.home_picture, self.home, self.equatorial):
            question.setVisible(self.driver.currentData() in COUNT_STEPS)

    def _site_typed(self) -> None:
        text = self.site.text().strip()
        try:
            self.site_given.emit(parse_site(text) if text else None)
        except UsageError as error:
            self.message.emit(str(error), "wrong")

    @property
    def searching(self) -> bool:
        """Whether a search for mounts is under way."""
        return self._search is not None

    def list_ports(self) -> None:
        """List the ports, without asking anything of them."""
        job = self._jobs.run(equipment.find_ports(), "ports")
        job.succeeded.connect(self.show_ports)
        job.failed.connect(lambda sentence: self.message.emit(sentence, "muted"))

    def search(self) -> None:
        """Search every port for a mount."""
        if self.searching:
            return
        self._allow(False)
        self._search = job = self._jobs.run(equipment.find_mounts(self.chosen_port), "find")
        job.progressed.connect(self.progressed)
        job.succeeded.connect(self._found)
        job.failed.connect(lambda sentence: self.message.emit(sentence, "wrong"))
        job.cancelled.connect(lambda: self.message.emit(tr("Search cancelled."), "muted"))
        job.finished.connect(self._over)
        self.progressed.emit(Progress(tr_noop("looking for ports")))

    def cancel_search(self) -> None:
        """End the search."""
        if self._search is not None:
            self._search.cancel()

    def _over(self) -> None:
        self._search = None
        self._allow(True)
        self.progressed.emit(None)

    def _allow(self, on: bool) -> None:
        """A search holds the port until its next step, also when it is cancelled."""
        for one in (self.connect_button, self.find_button):
            one.setEnabled(on)

    def _found(self, result: tuple[list[PortInfo], list[Diagnosis]]) -> None:
        listed, found = result
        self.show_ports(listed)
        mount = next((one for one in found if one.found), None)
        if mount is not None:
            self.show_selection(MountSelection(mount.port, mount.driver, mount.baud or None))
            self._allow(True)  # a disabled button takes no focus
            self.connect_button.setFocus()
        self.message.emit(equipment.search_text(found), "good" if mount else "wrong")


def _combo(name: str, example: str) -> QComboBox:
    """A list to choose from or to type in, where an ``example`` stands while it is empty."""
    made = narrow_box(name, 8)
    made.setEditable(True)
    made.setInsertPolicy(QComboBox.InsertPolicy.NoInsert)
    made.setLineEdit(text_field(name, example))
    return made
