"""The switch of the page for a phone: off until asked for, and plainly said while it is on."""

from collections.abc import Sequence
from dataclasses import dataclass

from PySide6.QtCore import QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QPainter, QPaintEvent
from PySide6.QtWidgets import QCheckBox, QHBoxLayout, QVBoxLayout, QWidget

from app.core.progress import Progress, Task
from app.polar.page import PhonePage
from app.polar.page_numbers import page_numbers
from app.ui.job import Job
from app.ui.palette import THEMES, Colours
from app.ui.polar.state import State
from app.ui.services import Services
from app.ui.widgets import button, copy_text, label, set_role, value_label

WHAT = (
    "The same numbers on a phone, beside the bolts: over the local network, read only, without the"
    " internet. Nothing is sent anywhere else, and it ends with this window."
)
QUIET = 4  # modules of empty ground around a QR code, as its standard asks

Rows = Sequence[Sequence[int]]


@dataclass(frozen=True, slots=True)
class Served:
    """Where the page is, and its QR code as rows of 0 and 1."""

    url: str
    rows: tuple[tuple[int, ...], ...]


def serving(page: PhonePage, host: str | None = None) -> Task[Served]:
    """Switch the page on; in a job, for the library that draws the code takes its time to load."""
    yield Progress("phone")
    import segno

    url = page.start(host)
    code = segno.make(url, error="m", micro=False)
    return Served(url, tuple(tuple(int(bool(bit)) for bit in row) for row in code.matrix))


def _ending(page: PhonePage, starting: Job | None) -> Task[None]:
    yield Progress("phone")
    if starting is not None:
        starting.abandon()
        starting.join(5.0)
    page.stop()


class QrCode(QWidget):
    """Dark modules on light ground; at night black on red, which phones read as well."""

    def __init__(self) -> None:
        super().__init__()
        self.rows: Rows = ()
        self.light, self.dark = QColor("#ffffff"), QColor("#000000")
        self.setMinimumSize(200, 200)
        self.setAccessibleName("QR code of the page's address")

    def sizeHint(self) -> QSize:
        return QSize(260, 260)

    def paintEvent(self, event: QPaintEvent) -> None:
        if not self.rows:
            return
        painter = QPainter(self)
        count = len(self.rows) + 2 * QUIET
        module = max(1, min(self.width(), self.height()) // count)
        side = module * count
        painter.fillRect(QRectF(0, 0, side, side), self.light)
        for y, row in enumerate(self.rows):
            for x, bit in enumerate(row):
                if bit:
                    at = QRectF((x + QUIET) * module, (y + QUIET) * module, module, module)
                    painter.fillRect(at, self.dark)
        painter.end()


class PhonePanel(QWidget):
    """Switches the page on and off; ``shown`` tells everybody that it is on."""

    switched = Signal(bool)

    def __init__(self, services: Services, host: str | None = None) -> None:
        super().__init__()
        self.setObjectName("page")
        self.page = PhonePage()
        self._services, self._host = services, host
        self._job: Job | None = None
        self.switch = QCheckBox("Show the numbers on a pho&ne")
        self.switch.toggled.connect(self._toggle)
        self.state = label("Off.", "muted", wrap=True)
        self.url = value_label("Address of the page")
        self.copy = button("Copy the address", lambda: copy_text(self.page.url))
        self.code = QrCode()
        self._lay_out()
        self._show(None)
        services.jobs.closing.connect(self.close_page)

    def _lay_out(self) -> None:
        line = QHBoxLayout()
        line.addWidget(self.copy)
        line.addStretch(1)
        column = QVBoxLayout(self)
        column.setContentsMargins(12, 12, 12, 12)
        column.addWidget(self.switch)
        column.addWidget(label(WHAT, "muted", wrap=True))
        column.addWidget(self.state)
        column.addWidget(self.url)
        column.addLayout(line)
        column.addWidget(self.code, 1, Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop)
        column.addStretch(1)

    @property
    def on(self) -> bool:
        """Whether the page is served."""
        return self.page.running

    def show_state(self, state: State) -> None:
        """Give the page the newest numbers."""
        if state.error is None:
            self.page.show({"stage": state.stage, "words": state.words, "solved": state.solved})
        else:
            self.page.show(page_numbers(state.error, state.words, state.solved))

    def close_page(self) -> None:
        """Switch off at once; also when the window closes."""
        if self._job is not None:
            self._job.abandon()
            self._job.join(5.0)
            self._job = None
        self.page.stop()

    def wear(self, colours: Colours) -> None:
        """Red light alone at night."""
        night = colours is THEMES["night"]
        self.code.light = QColor("#ff0000" if night else "#ffffff")
        self.code.update()

    def _toggle(self, on: bool) -> None:
        if on:
            self.state.setText("Switching on…")
            self._job = job = self._services.jobs.run(serving(self.page, self._host), "phone")
            job.succeeded.connect(self._show)
            job.failed.connect(self._failed)
            return
        self._show(None)
        self.switch.setEnabled(False)  # until it is really off, which takes a tenth of a second
        off = self._services.jobs.run(_ending(self.page, self._job), "phone-off")
        off.finished.connect(lambda: self.switch.setEnabled(True))

    def _show(self, served: Served | None) -> None:
        on = served is not None and self.switch.isChecked()
        self.url.setText(served.url if served is not None and on else "")
        self.code.rows = served.rows if served is not None and on else ()
        self.code.update()
        self.code.setVisible(on)
        self.copy.setVisible(on)
        self.url.setVisible(on)
        words = "ON: whoever is in this network and has the address can read along." if on else ""
        self.state.setText(words or "Off.")
        set_role(self.state, "good" if on else "muted")
        self.switched.emit(on)

    def _failed(self, sentence: str) -> None:
        self.switch.setChecked(False)
        self.state.setText(sentence)
        set_role(self.state, "wrong")
