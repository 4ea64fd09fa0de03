"""The open frame and what lies over it and beside it."""

from PySide6.QtCore import QEvent, QObject, QPoint, QRect, QSize
from PySide6.QtWidgets import QBoxLayout, QToolButton, QWidget

from kochab.text.translation import tr
from kochab.window.image.frame_view import FrameView
from kochab.window.image.stretch_strip import StretchStrip
from kochab.window.panels.card import Card
from kochab.window.panels.hints_panel import HintsPanel
from kochab.window.panels.solution_panel import SolutionPanel
from kochab.window.panels.star_table import StarTable
from kochab.window.widgets import Page, column, page, row, scrolled, styled_frame, tab_pages

CARD_LETTERS = 56  # about as wide as a line of so many
NARROW, LOW_LINES = 1.5, 32  # a room of so many widths of the card, and so many lines, has no place for all of it


MARGIN_PX, STRIP_PX = 8, 560


class Workspace(Page):
    """The open frame, and over it the card, a few buttons and the stretch; ``tabs`` stand beside it when asked for."""

    def __init__(self, methods: list[str], detectors: list[str], buttons: list[QToolButton]) -> None:
        super().__init__()
        self.view = FrameView()
        self.strip = StretchStrip()
        self.card = Card()
        self.solution = SolutionPanel()
        self.stars = StarTable()
        self.hints = HintsPanel(methods, detectors)
        first = page()
        column(self.solution, None, on=first, spacing=12, margins=(12, 12, 12, 12))
        tabs = (tr("Solution"), scrolled(first)), (tr("Stars"), self.stars), (tr("Hints, method"), scrolled(self.hints))
        self.tabs = tab_pages(tr("Frame details"), *tabs)
        for index in range(self.tabs.count()):
            self.tabs.setTabToolTip(index, f"Alt+{index + 1}")
        self.buttons = styled_frame("card")
        self._row = row(*buttons, on=self.buttons, spacing=2, margins=(3, 3, 3, 3))
        self._column = column((self.view, 1), on=self, spacing=0, margins=(0, 0, 0, 0))
        self.strip.hide()
        self.covered: list[QRect] = []  # parts of the view, where no label could be read
        for over in (self.card, self.buttons, self.strip):
            over.setParent(self)
            over.installEventFilter(self)
        self.view.installEventFilter(self)

    def add_below(self, widget: QWidget) -> None:
        """Put a widget under the image."""
        self._column.addWidget(widget)

    def minimumSizeHint(self) -> QSize:
        """Wide enough for the card."""
        least = super().minimumSizeHint()
        return least.expandedTo(QSize(self.card.minimumSizeHint().width() + 2 * MARGIN_PX, 0))

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() in (QEvent.Type.LayoutRequest, QEvent.Type.Resize, QEvent.Type.ShowToParent):
            self._place()
            if watched is self.card:
                self.updateGeometry()
        return super().eventFilter(watched, event)

    def _place(self) -> None:
        """The card at the lower left, the buttons at the lower right, or at the top when there is no room beside it."""
        inside = self.view.geometry().adjusted(MARGIN_PX, MARGIN_PX, -MARGIN_PX, -MARGIN_PX)
        letters = self.fontMetrics().averageCharWidth() * CARD_LETTERS
        narrow, low = inside.width() < NARROW * letters, inside.height() < LOW_LINES * self.fontMetrics().lineSpacing()
        self.card.shorten(narrow and low)
        card = QRect(QPoint(), QSize(min(letters, inside.width()), 0))
        card.setHeight(self.card.heightForWidth(card.width()))
        card.moveBottomLeft(inside.bottomLeft())
        long = sum(made.sizeHint().width() + 4 for made in self.buttons.findChildren(QToolButton))
        way = QBoxLayout.Direction.LeftToRight if long < inside.width() else QBoxLayout.Direction.TopToBottom
        if self._row.direction() != way:
            self._row.setDirection(way)
        buttons = QRect(QPoint(), self.buttons.sizeHint())
        buttons.moveBottomRight(inside.bottomRight())
        if buttons.intersects(card.adjusted(0, 0, MARGIN_PX, 0)):
            buttons.moveTopLeft(inside.topLeft())
        strip = QRect(QPoint(), QSize(min(STRIP_PX, inside.width()), self.strip.sizeHint().height()))
        strip.moveBottomRight(buttons.topRight() - QPoint(0, MARGIN_PX))
        if strip.intersects(card) or not inside.contains(strip):
            strip.moveTopLeft(inside.topLeft() if buttons.top() > inside.top() else buttons.bottomLeft())
        self.covered[:] = (card, buttons)
        for over, at in ((self.card, card), (self.buttons, buttons), (self.strip, strip)):
            over.setGeometry(at)
