"""The panes of an open frame: the frame with its strip, and the side pane with its tabs."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QSplitter, QTabWidget, QVBoxLayout, QWidget

from app.ui.frame_view import FrameView
from app.ui.hints_panel import HintsPanel
from app.ui.solution_panel import SolutionPanel
from app.ui.star_table import StarTable
from app.ui.state_card import StateCard
from app.ui.stretch_strip import StretchStrip
from app.ui.widgets import scrolled

SIDE_PX = 400


class Workspace(QSplitter):
    """Puts the panes in their places; the focus goes from the frame to the side, top to bottom."""

    def __init__(self, methods: list[str], detectors: list[str]) -> None:
        super().__init__(Qt.Orientation.Horizontal)
        self.view = FrameView()
        self.strip = StretchStrip()
        self.card = StateCard()
        self.solution = SolutionPanel()
        self.stars = StarTable()
        self.hints = HintsPanel(methods, detectors)
        self.tabs = QTabWidget()
        self.tabs.setAccessibleName("About the frame")
        self.tabs.setDocumentMode(True)
        self.tabs.addTab(scrolled(self._answer()), "Solution")
        self.tabs.addTab(self.stars, "Stars")
        self.tabs.addTab(scrolled(self.hints), "Hints, method")
        for index in range(self.tabs.count()):
            self.tabs.setTabToolTip(index, f"Alt+{index + 1}")
        self.tabs.setMinimumWidth(320)
        left = QWidget()
        left.setObjectName("page")
        column = QVBoxLayout(left)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(self.view, 1)
        column.addWidget(self.strip)
        self.addWidget(left)
        self.addWidget(self.tabs)
        self.setStretchFactor(0, 1)
        self.setStretchFactor(1, 0)
        self.setSizes([900, SIDE_PX])
        self.setCollapsible(0, False)

    def _answer(self) -> QWidget:
        page = QWidget()
        page.setObjectName("page")
        column = QVBoxLayout(page)
        column.setContentsMargins(12, 12, 12, 12)
        column.setSpacing(12)
        column.addWidget(self.card)
        column.addWidget(self.solution)
        column.addStretch(1)
        return page
