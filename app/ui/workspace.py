"""The panes of an open frame: the frame with its strip, and the side pane with its tabs."""

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QSplitter, QTabWidget, QVBoxLayout, QWidget

from app.ui.frame_view import FrameView
from app.ui.hints_panel import HintsPanel
from app.ui.solution_panel import SolutionPanel
from app.ui.star_table import StarTable
from app.ui.state_card import StateCard
from app.ui.stretch_strip import StretchStrip
from app.ui.widgets import scrolled

SIDE_PX, LEAST_SIDE_PX = 400, 320
LEAST_FRAME_PX = 420  # beside the side; a frame that is smaller is better seen alone


class Workspace(QSplitter):
    """Puts the panes in their places; the focus goes from the frame to the side, top to bottom.

    Where a tool leaves no room for both, the frame is seen alone, and the keys of the side's tabs
    bring the side in its place and take it away again.
    """

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
        self.tabs.setMinimumWidth(LEAST_SIDE_PX)
        self._side_wanted, self._side_alone = True, False
        self._left = left = QWidget()
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

    def minimumSizeHint(self) -> QSize:
        """As narrow as the frame alone."""
        return QSize(self._left.minimumSizeHint().width(), super().minimumSizeHint().height())

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._share()

    def show_side(self, on: bool) -> None:
        """Whether the side may be seen at all."""
        self._side_wanted = on
        self._share()

    def turn_to(self, index: int) -> bool:
        """Bring a tab of the side in front; False when that has brought the frame back instead."""
        again = self._side_alone and self.tabs.currentIndex() == index
        self._side_alone = not again
        self.tabs.setCurrentIndex(index)
        self._share()
        return self.tabs.isVisible()

    def _share(self) -> None:
        """Give the room to both, or to one."""
        least = max(self._left.minimumSizeHint().width(), LEAST_FRAME_PX)
        both = self.width() >= least + LEAST_SIDE_PX
        if both or not self._side_wanted:
            self._side_alone = False
        self.tabs.setVisible(self._side_wanted and (both or self._side_alone))
        self._left.setVisible(not self._side_alone)

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
