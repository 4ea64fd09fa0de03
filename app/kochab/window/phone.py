"""Serves a page with what the view shows to a phone on the local network; off by default."""

from collections.abc import Sequence

from PySide6.QtCore import QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QPainter, QPaintEvent
from PySide6.QtWidgets import QWidget

from kochab.core.progress import Progress, Task
from kochab.text.translation import tr, tr_noop
from kochab.window.dialogs import is_red
from kochab.window.job import Job
from kochab.window.services import Services
from kochab.window.widgets import Page, button, column, copy_text, label, row, show_text, switch, value_label
from kochab.workflows.session.wiring import PageState, PolarPage

WHAT = tr_noop(
    "Shows the same numbers on a phone at the mount, read only, over the local network. Nothing is"
    " sent to the internet, and the page ends when this window closes."
)
QUIET = 4  # empty modules around a QR code, as ISO/IEC 18004 requires

Rows = Sequence[Sequence[int]]  # of a QR code with its margin: 0 or 1, from the top


def serving(page: PolarPage, host: str | None = None) -> Task[Rows]:
    """Switch the page on and return the QR code of its address; in a job, because segno loads slowly."""
    yield Progress("phone")
    import segno

    return [tuple(bits) for bits in segno.make(page.start(host), error="m", micro=False).matrix_iter(border=QUIET)]


def ending(page: PolarPage, starting: Job | None) -> Task[None]:
    """Switch the page off, for good: one that is just being switched on would come after."""
    yield Progress("phone")
    if starting is not None:
        starting.abandon()
        starting.join(5.0)
    page.stop()


class QrCode(QWidget):
    """Dark modules on white; at night black on red, which phones read as well."""

    def __init__(self) -> None:
        super().__init__()
        self.rows: Rows = ()
        self.setMinimumSize(200, 200)
        self.setAccessibleName(tr("QR code of the page's address"))

    def sizeHint(self) -> QSize:
        return QSize(260, 260)

    def paintEvent(self, event: QPaintEvent) -> None:
        if not self.rows:
            return
        painter = QPainter(self)
        # Whole pixels, so that all modules are of one size.
        module = max(1, min(self.width(), self.height()) // len(self.rows))
        light, dark = QColor("#ff0000" if is_red() else "#ffffff"), QColor("#000000")
        for y, bits in enumerate(self.rows):
            for x, bit in enumerate(bits):
                painter.fillRect(QRectF(x * module, y * module, module, module), dark if bit else light)
        painter.end()


class PhonePanel(Page):
    """Switches the page on and off and shows its address; ``switched`` says which."""

    switched = Signal(bool)

    def __init__(self, services: Services, host: str | None = None) -> None:
        super().__init__()
        self.page = services.wiring.phone_page() if services.wiring.phone_page else None
        self._services, self._host = services, host
        self._job: Job | None = None
        self.switch = switch(tr("Show on a pho&ne"))
        self.switch.toggled.connect(self._toggle)
        self.switch.setEnabled(self.page is not None)
        self.state = label(tr("Off."), "muted", wrap=True)
        self.url = value_label(tr("Address of the page"))
        self.copy = button(tr("Copy address"), lambda: copy_text(self.url.text()))
        self.code = QrCode()
        self._lay_out()
        self._show(())
        services.jobs.closing.connect(self.close_page)

    def _lay_out(self) -> None:
        what, copy = label(tr(WHAT), "muted", wrap=True), row(self.copy, None)
        made = column(self.switch, what, self.state, self.url, copy, on=self, margins=(12, 12, 12, 12))
        made.addWidget(self.code, 1, Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop)
        made.addStretch(1)

    def show_state(self, state: PageState) -> None:
        """Update the page."""
        if self.page is not None:
            self.page.show(state)

    def close_page(self) -> None:
        """Switch off at once, as when the window closes."""
        if self.page is not None:
            for _ in ending(self.page, self._job):
                pass

    def _toggle(self, on: bool) -> None:
        if self.page is None:
            return
        if on:
            self.state.setText(tr("Switching on…"))
            self._job = job = self._services.jobs.run(serving(self.page, self._host), "phone")
            job.succeeded.connect(self._show)
            job.failed.connect(self._failed)
            return
        self._show(())
        self.switch.setEnabled(False)  # until it is really off, which takes a tenth of a second
        off = self._services.jobs.run(ending(self.page, self._job), "phone-off")
        off.finished.connect(lambda: self.switch.setEnabled(True))

    def _show(self, code: Rows) -> None:
        """Show the address and its QR code; without one, that the page is off."""
        # The switch may have gone off while the page was starting.
        on = bool(code) and self.page is not None and self.switch.isChecked()
        self.url.setText(self.page.url if self.page is not None and on else "")
        self.code.rows = code if on else ()
        self.code.update()
        for part in (self.code, self.copy, self.url):
            part.setVisible(on)
        state = tr("On. Anyone on this network with the link can view.") if on else tr("Off.")
        show_text(self.state, state, "good" if on else "muted")
        self.switched.emit(on)

    def _failed(self, sentence: str) -> None:
        self.switch.setChecked(False)
        show_text(self.state, sentence, "wrong")
