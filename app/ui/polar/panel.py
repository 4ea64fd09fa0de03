"""The widgets of the Polar view: tabs above; what can be pressed, and what is said, below."""

from PySide6.QtWidgets import (
    QApplication,
    QHBoxLayout,
    QPushButton,
    QTabWidget,
    QVBoxLayout,
    QWidget,
)

from app.ui.polar.align_page import AlignPage
from app.ui.polar.bolts_view import BoltsView
from app.ui.polar.cues import Cues
from app.ui.polar.night import NightPage
from app.ui.polar.phone import PhonePanel
from app.ui.polar.setup import SECOND_TIP, SetupPanel
from app.ui.polar.state import State
from app.ui.progress_bar import ProgressBar
from app.ui.services import Services
from app.ui.widgets import label, scrolled, set_role

READY = "Choose where the frames come from, and begin."
PHONE = 3  # its tab


class PolarPanel(QWidget):
    """Pages and buttons; what they do is connected by the view."""

    def __init__(self, services: Services) -> None:
        super().__init__()
        self.setObjectName("page")
        self.setup = SetupPanel(services.wiring.practice is not None)
        self.page = AlignPage()
        self.night = NightPage(services)
        self.phone = PhonePanel(services)
        self.bolts = BoltsView()
        self.cues = Cues(QApplication.beep)
        self.start = _button("&Begin", "Measure, adjust, and measure again", "main")
        self.done = _button("Done, &go on", "I have turned what was asked (Space)")
        self.again = _button("&Measure again", "Leave the bolts; measure now")
        self.enough = _button("Eno&ugh", "Go on with the frames there are")
        self.second = _button("Second s&weep", SECOND_TIP)
        self.at_bolts = _button("At the bo&lts", "Huge digits (F7)")
        self.obey = _button("&Practice hands: do it", "Turn what is asked for")
        self.sound = _button("Soun&ds", f"Heard beside the mount: {self.cues.told}")
        self.sound.setCheckable(True)
        self.cancel = _button("Cancel", "Give up; a mount that turns is stopped")
        self.bar = ProgressBar("Progress of the alignment")
        self.said = label(READY, "muted", wrap=True)
        self.served = label("", "good", wrap=True)
        self.served.setVisible(False)
        self._lay_out()

    def _lay_out(self) -> None:
        self.tabs = QTabWidget()
        self.tabs.setDocumentMode(True)
        self.tabs.setAccessibleName("Polar alignment")
        for widget, name in (
            (scrolled(self.setup), "Set up"), (scrolled(self.page), "Align"),
            (scrolled(self.night), "Tonight"), (scrolled(self.phone), "Phone"),
        ):  # fmt: skip
            self.tabs.addTab(widget, name)
        first, second = QHBoxLayout(), QHBoxLayout()
        for made in (self.start, self.done, self.obey, self.cancel):
            first.addWidget(made)
        first.addWidget(self.bar, 1)
        first.addStretch(1)
        for made in (self.again, self.enough, self.second, self.at_bolts, self.sound):
            second.addWidget(made)
        second.addStretch(1)
        column = QVBoxLayout(self)
        column.setContentsMargins(8, 8, 8, 8)
        column.addWidget(self.tabs, 1)
        column.addWidget(self.said)
        column.addWidget(self.served)
        column.addLayout(first)
        column.addLayout(second)
        self.setFocusProxy(self.start)

    def heightForWidth(self, width: int) -> int:
        """As low as can be: the pages scroll, and the buttons stay in sight on a small screen."""
        layout = self.layout()
        return -1 if layout is None else layout.minimumHeightForWidth(width)

    def enable(self, running: bool, hands: bool) -> None:
        """What can be pressed while an alignment runs, and while none does."""
        within = self.isAncestorOf(self.window().focusWidget() or self.window())
        for made in (self.done, self.enough, self.second, self.cancel, self.bar):
            made.setVisible(running)
        self.again.setVisible(False)
        self.start.setVisible(not running)
        self.setup.setEnabled(not running)
        self.obey.setVisible(running and hands)
        self.done.setEnabled(running)
        self.cancel.setEnabled(running)
        self.setFocusProxy(self.done if running else self.start)
        if within:
            self.setFocus()

    def show_state(self, state: State, now_s: float) -> None:
        """Bring every page and button up to date."""
        self.page.show_state(state, now_s)
        self.phone.show_state(state)
        if self.bolts.isVisible():
            self.bolts.show_state(state, now_s)
        self.bar.show_share(state.fraction)
        if state.running:
            adjusting = state.stage == "adjust"
            self.again.setVisible(adjusting)  # one of the two: they mean the same while adjusting
            self.enough.setVisible(not adjusting)
            self.enough.setEnabled(state.stage != "opening")
            self.obey.setEnabled(state.hand_needed)

    def say(self, text: str, role: str) -> None:
        """One sentence that stays until the next; an empty one takes it away."""
        self.said.setText(text)
        self.said.setVisible(bool(text))
        if self.said.property("role") != role:
            set_role(self.said, role)

    def tell_phone(self, on: bool) -> None:
        """Whether the phone's page is served, in sight from every tab."""
        self.served.setText(f"The phone's page is ON: {self.phone.page.url}" if on else "")
        self.served.setVisible(on)
        self.tabs.setTabText(PHONE, "Phone: ON" if on else "Phone")


def _button(text: str, tip: str, role: str = "") -> QPushButton:
    made = QPushButton(text)
    if role:
        made.setProperty("role", role)
    made.setToolTip(tip)
    made.setAutoDefault(False)
    return made
