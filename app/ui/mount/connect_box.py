"""Which mount and which camera: the fields, and what is done with them."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QComboBox,
    QFormLayout,
    QHBoxLayout,
    QLineEdit,
    QVBoxLayout,
    QWidget,
)

from app.core.errors import UsageError
from app.core.hint import Site
from app.mounts import DRIVERS, driver_class
from app.mounts.ports import PortInfo
from app.mounts.probe import Diagnosis
from app.ui.angle_input import parse_site, site_text
from app.ui.mount.wishes import EPOCHS, OWN, MountWish
from app.ui.widgets import button, label, narrow_box

BAUDS = (OWN, "9600", "19200", "38400", "57600", "115200", "230400")
EPOCH_TIP = (
    "Which equator the mount counts from. Leave it at the driver's own unless the mount is off by "
    "about 20′ everywhere."
)
SITE_TIP = "Latitude, longitude in degrees, north and east positive. It is never sent to the mount."


class ConnectBox(QWidget):
    """Port, driver, baud rate, epoch and site of a mount that is not connected yet."""

    connect_wanted = Signal(object)  # MountWish
    practice_wanted = Signal()
    find_wanted = Signal()
    site_given = Signal(object)  # Site, or None
    trouble = Signal(str)

    def __init__(self, can_practise: bool) -> None:
        super().__init__()
        self.port = _combo("Port of the mount", "a device, COM3 or socket://HOST:PORT")
        self.driver = _combo("Driver of the mount")
        for name in DRIVERS:
            self.driver.addItem(driver_class(name).title, name)
        self.baud = _combo("Baud rate", "9600")
        self.baud.addItems(BAUDS)
        self.epoch = _combo("Epoch of the mount's coordinates")
        self.epoch.addItems(list(EPOCHS))
        self.epoch.setToolTip(EPOCH_TIP)
        self.site = QLineEdit()
        self.site.setAccessibleName("Site of the mount")
        self.site.setPlaceholderText("48.14, 11.58: the horizon is kept by it")
        self.site.setToolTip(SITE_TIP)
        self.site.editingFinished.connect(self._site_typed)
        self.connect_button = button(
            "Connect", self._connect, "main", "Open the port; nothing moves"
        )
        self.find_button = button(
            "Find my mount", self.find_wanted.emit, "",
            "Ask on every port which mount is there: questions only, nothing moves",
        )  # fmt: skip
        self.practice_button = button(
            "Practice with a simulated telescope", self.practice_wanted.emit, "",
            "A mount that stands wrong and a camera on it, under a simulated sky",
        )  # fmt: skip
        self.practice_button.setVisible(can_practise)
        self._lay_out()

    def _lay_out(self) -> None:
        form = QFormLayout()
        form.setHorizontalSpacing(12)
        form.setVerticalSpacing(6)
        form.addRow("Port", self.port)
        form.addRow("Driver", self.driver)
        line = QHBoxLayout()
        line.setSpacing(10)
        line.addWidget(self.baud, 1)
        line.addWidget(label("Epoch"))
        line.addWidget(self.epoch, 1)
        form.addRow("Baud rate", line)
        form.addRow("Your site", self.site)
        buttons = QHBoxLayout()
        for b in (self.connect_button, self.find_button):
            buttons.addWidget(b)
        buttons.addStretch(1)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(8)
        column.addLayout(form)
        column.addLayout(buttons)
        column.addWidget(self.practice_button)

    def show_ports(self, ports: list[PortInfo]) -> None:
        """What the system tells of its ports; what was typed stays."""
        typed = self.wished_port
        self.port.clear()
        for info in ports:
            words = ", ".join(w for w in (info.description, info.usb, info.hint) if w)
            self.port.addItem(f"{info.port}  ({words})", info.port)
        self.set_port(typed or (ports[0].port if ports else ""))

    def set_port(self, port: str) -> None:
        """Choose a port that is listed, or type one."""
        at = self.port.findData(port)
        if at >= 0:
            self.port.setCurrentIndex(at)
        else:
            self.port.setEditText(port)

    @property
    def wished_port(self) -> str:
        """The device behind the chosen line, or what was typed."""
        at = self.port.findText(self.port.currentText())
        return str(self.port.itemData(at)) if at >= 0 else self.port.currentText().strip()

    def show_wish(self, wish: MountWish) -> None:
        """Fill the fields."""
        self.set_port(wish.port)
        self.driver.setCurrentIndex(max(0, self.driver.findData(wish.driver)))
        self.baud.setCurrentText(OWN if wish.baud is None else str(wish.baud))
        self.epoch.setCurrentText(OWN if wish.epoch is None else str(wish.epoch))

    def show_found(self, found: Diagnosis) -> None:
        """Fill the fields with a mount that answered."""
        self.show_wish(MountWish(found.port, found.driver, found.baud or None))

    def show_site(self, site: Site | None) -> None:
        """Where the mount stands."""
        self.site.setText(site_text(site) if site is not None else "")

    def _connect(self) -> None:
        try:
            wish = MountWish.typed(
                self.wished_port, str(self.driver.currentData()), self.baud.currentText(),
                self.epoch.currentText(),
            )  # fmt: skip
        except UsageError as error:
            self.trouble.emit(str(error))
            return
        self.connect_wanted.emit(wish)

    def _site_typed(self) -> None:
        text = self.site.text().strip()
        try:
            self.site_given.emit(parse_site(text) if text else None)
        except UsageError as error:
            self.trouble.emit(str(error))


def _combo(name: str, example: str = "") -> QComboBox:
    """A list to choose from; with an ``example`` one can type in it, too."""
    made = narrow_box(name, 8)
    made.setEditable(bool(example))
    if example:
        made.setInsertPolicy(QComboBox.InsertPolicy.NoInsert)
        field = made.lineEdit()
        assert field is not None
        field.setAccessibleName(name)
        field.setPlaceholderText(example)
    return made
