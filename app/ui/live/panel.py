"""What the Live view shows: the camera and the pointing in tabs, the headline, Start and Stop."""

from collections.abc import Callable

from PySide6.QtWidgets import QHBoxLayout, QTabWidget, QVBoxLayout, QWidget

from app.ui.live import words
from app.ui.live.camera_panel import CameraPanel
from app.ui.live.pointing_panel import PointingPanel
from app.ui.live.record_panel import RecordPanel
from app.ui.palette import Colours
from app.ui.widgets import button, label, scrolled, set_role

READY = "Choose a camera, then Start."
POINTING = 1


class LivePanel(QWidget):
    """Widgets alone; the headline, Start and Stop are always in sight."""

    def __init__(
        self, begin: Callable[[], None], end: Callable[[], None], can_record: bool
    ) -> None:
        super().__init__()
        self.setObjectName("page")
        self.camera = CameraPanel()
        self.pointing = PointingPanel()
        self.record = RecordPanel(can_record)
        self.title = label("", "heading", wrap=True)
        self.text = label(READY, "muted", wrap=True)
        self.said = label("", wrap=True)
        self.said.setVisible(False)
        self.start = button("&Start", begin, "main", "Open the camera and solve its frames")
        self.stop = button("Sto&p", end, tip="Give the camera back; the last frame stays")
        self.tabs = QTabWidget()
        self._lay_out()

    def _lay_out(self) -> None:
        top = QHBoxLayout()
        top.addWidget(self.title, 1)
        top.addWidget(self.start)
        top.addWidget(self.stop)
        where = QWidget()
        where.setObjectName("page")
        column = QVBoxLayout(where)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self.pointing, 1)
        self.tabs.setDocumentMode(True)
        self.tabs.setAccessibleName("Live")
        self.tabs.addTab(scrolled(self.camera), "Camera")
        self.tabs.addTab(scrolled(where), "Pointing")
        outer = QVBoxLayout(self)
        outer.setContentsMargins(10, 8, 10, 8)
        outer.setSpacing(6)
        outer.addLayout(top)
        outer.addWidget(self.text)
        outer.addWidget(self.said)
        outer.addWidget(self.tabs, 1)
        outer.addWidget(self.record)
        self.setFocusProxy(self.start)

    def show_running(self, on: bool) -> None:
        """Whether a camera runs."""
        self.start.setEnabled(not on)
        self.start.setVisible(not on)
        self.stop.setVisible(on)
        self.camera.run(on)
        if on:
            self.stop.setFocus()

    def show_headline(self, state: words.State) -> None:
        """How it stands, in the words that are always in sight."""
        if self.title.text() != state.title:
            self.title.setText(state.title)
        if self.title.property("role") != state.role:
            set_role(self.title, state.role)
        if self.text.text() != state.text:
            self.text.setText(state.text)
        self.text.setVisible(bool(state.text))

    def show_said(self, sentence: str, role: str = "") -> None:
        """One sentence that stays until the next."""
        self.said.setText(sentence)
        self.said.setVisible(bool(sentence))
        if self.said.property("role") != role:
            set_role(self.said, role)

    def wear(self, colours: Colours, red: bool) -> None:
        """Another theme; ``red`` is for red light alone."""
        self.camera.levels.wear(colours)
        self.pointing.chart.wear(colours)
        for panel in (self.camera, self.record):
            panel.use_red(red)
        self.update()
