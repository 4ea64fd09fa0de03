"""What stands beside the image: folded away to a handle, or in the image's place where there is no room for both."""

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtWidgets import QSizePolicy, QToolButton, QWidget

from kochab.text.translation import tr
from kochab.window.view import View
from kochab.window.widgets import named, row, scrolled

HANDLE_PX = 18
LEAST_PX = 300  # of a view that takes the image's place; what is wider scrolls


class Side(QWidget):
    """A view that scrolls, and at its left edge the handle; ``alone`` while there is no room for the image too."""

    handled = Signal()  # it was folded away, or shown again

    def __init__(self, inside: QWidget) -> None:
        super().__init__()
        self.setObjectName("page")
        self.area = scrolled(inside)  # a view may be taller than a small screen
        self.handle = QToolButton()
        self.handle.setObjectName("handle")
        self.handle.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self.handle.setFixedWidth(HANDLE_PX)
        self.handle.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Expanding)
        self.handle.clicked.connect(lambda: self.fold(not self.folded))
        row(self.handle, (self.area, 1), on=self, spacing=0, margins=(0, 0, 0, 0))
        self.alone = False
        self._folded = {False: False, True: isinstance(inside, View) and inside.room_first}  # by ``alone``
        self.show_folded()

    @property
    def folded(self) -> bool:
        """Whether the handle alone is seen."""
        return self._folded[self.alone]

    def fold(self, on: bool) -> None:
        """Fold away, or show again; a window with room for the image too keeps its own choice."""
        if on != self.folded:
            had_focus = self.isAncestorOf(self.window().focusWidget() or self.window())
            self._folded[self.alone] = on
            self.show_folded()
            self.handled.emit()
            if had_focus:
                self.handle.setFocus()

    def show_folded(self) -> None:
        """Show what ``folded`` says."""
        self.area.setHidden(self.folded)
        self.handle.setArrowType(Qt.ArrowType.LeftArrow if self.folded else Qt.ArrowType.RightArrow)
        named(self.handle, tr("Show the side again") if self.folded else tr("Fold this side away"))
        self.handle.setToolTip(self.handle.accessibleName())
        policy = Qt.ScrollBarPolicy.ScrollBarAsNeeded if self.alone else Qt.ScrollBarPolicy.ScrollBarAlwaysOff
        self.area.setHorizontalScrollBarPolicy(policy)
        self.updateGeometry()

    @property
    def whole_px(self) -> int:
        """The width that it needs to show all of it."""
        return HANDLE_PX + (0 if self._folded[False] else self.area.minimumSizeHint().width())

    def minimumSizeHint(self) -> QSize:
        least = self.area.minimumSizeHint()
        wide = 0 if self.folded else min(least.width(), LEAST_PX) if self.alone else least.width()
        return QSize(HANDLE_PX + wide, least.height())
