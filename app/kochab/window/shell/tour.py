"""The tour: up to four cards beside what they speak of, at the first start or from the Help menu."""

from PySide6.QtCore import QEvent, QObject, QPoint, QRect, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QFrame, QToolButton, QWidget

from kochab.text.translation import tr, tr_noop
from kochab.window.shell.main_window import MainWindow
from kochab.window.widgets import button, column, label, row

CARDS = (  # title, text, and what it speaks of
    (
        tr_noop("Modes at the left"),
        tr_noop(
            "Image, Live with a camera, Mount, Polar alignment, and a Laboratory of methods. "
            "F1 opens the help for the one you are in."
        ),
        "rail",
    ),
    (
        tr_noop("The card says where"),
        tr_noop(
            "What the frame shows, right ascension and declination with their uncertainty, and the field. "
            "Details has everything else."
        ),
        "card",
    ),
    (
        tr_noop("STOP and Night"),
        tr_noop(
            "With a mount connected, STOP stands at the right end of the bar; Esc does the same from anywhere. "
            "Night (Ctrl+N) turns everything red."
        ),
        "night",
    ),
    (
        tr_noop("Open an image"),
        tr_noop(
            "Drop an image of the night sky on the window, or try a sample. Kochab says where it points. "
            "It needs no focal length, no coordinates and no internet."
        ),
        "open",
    ),
)
WIDTH_PX = 420
APART_PX, RIM_PX = 16, 4  # from what a card speaks of, and the outline around that


class Tour(QFrame):
    """One card at a time, beside what it speaks of, which has an outline; Esc or Skip ends it, the last one opens."""

    def __init__(self, window: MainWindow) -> None:
        super().__init__(window)
        self._over = window
        self.setObjectName("card")
        # Before the first frame there is no card to point at.
        self.cards = [card for card in CARDS if card[2] != "card" or window.workspace.card.isVisible()]
        self.at = 0
        self.outline = QFrame(window)
        self.outline.setObjectName("outline")
        self.outline.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.title, self.text = label("", "heading", wrap=True), label("", wrap=True)
        self.count = label("", "muted")
        self.back = button(tr("Back"), lambda: self._turn(-1))
        self.next = button(tr("Next"), lambda: self._turn(1), "main")
        self.open = button(tr("Open…"), self._open, "main")
        self.skip = button(tr("Skip"), self.close)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        buttons = row(self.count, None, self.skip, self.back, self.next, self.open, spacing=8)
        column(self.title, self.text, 6, buttons, on=self, spacing=8, margins=(18, 16, 18, 14))
        # It is in no layout, so it follows the window's size by itself.
        window.installEventFilter(self)
        self.destroyed.connect(self.outline.deleteLater)
        self._turn(0)
        self.show()
        self.raise_()
        self.next.setFocus()

    def _turn(self, by: int) -> None:
        self.at += by
        last = self.at == len(self.cards) - 1
        title, text, _ = self.cards[self.at]
        self.title.setText(tr(title))
        self.text.setText(tr(text))
        self.setAccessibleName(f"{tr(title)}. {tr(text)}")
        self.count.setText(tr("{at} of {cards}", at=self.at + 1, cards=len(self.cards)))
        self.back.setVisible(self.at > 0)
        self.next.setVisible(not last)
        self.open.setVisible(last)
        self.skip.setText(tr("Close") if last else tr("Skip"))
        (self.open if last else self.next).setFocus()
        self._place()

    def _open(self) -> None:
        """The end of the tour is the beginning: choose an image."""
        self.close()
        self._over.actions_by_name["open"].trigger()

    def target(self) -> QWidget | None:
        """What the card speaks of; None while it is not in sight."""
        window, name = self._over, self.cards[self.at][2]
        if name == "open" and window.welcome.isVisible():
            found: QWidget | None = window.welcome.first
        elif name == "open":
            buttons = window.bar.findChildren(QToolButton)
            found = next((b for b in buttons if b.defaultAction() is window.actions_by_name["open"]), None)
        elif name == "night":
            found = window.rail.widgetForAction(window.actions_by_name["night"])
        else:
            found = window.rail if name == "rail" else window.workspace.card
        return found if found is not None and found.isVisible() else None

    def _place(self) -> None:
        """Beside its target, wherever there is room; without one in the upper half of the window."""
        window, target = self._over, self.target()
        if (inside := self.layout()) is not None:
            inside.activate()  # other buttons are shown now
        wide = max(WIDTH_PX, self.fontMetrics().averageCharWidth() * 60, self.minimumSizeHint().width())
        width = min(wide, window.width() - 40)
        height = max(self.heightForWidth(width), self.sizeHint().height())
        middle = QRect((window.width() - width) // 2, (window.height() - height) * 2 // 5, width, height)
        self.outline.setVisible(target is not None)
        if target is None:
            self.setGeometry(middle)
            return
        box = QRect(target.mapTo(window, QPoint(0, 0)), target.size())
        rim = box.adjusted(-RIM_PX, -RIM_PX, RIM_PX, RIM_PX) & window.rect()
        self.outline.setGeometry(rim)
        self.outline.raise_()
        self.raise_()
        x, y = rim.center().x() - width // 2, rim.center().y() - height // 2
        corners = (rim.right() + APART_PX, y), (x, rim.bottom() + APART_PX), (x, rim.top() - APART_PX - height)
        room = window.rect().adjusted(8, 8, -8, -8)
        for corner in corners:
            place = QRect(*corner, width, height)
            # Along the target's side it may move; away from it, it may not come over it.
            place.moveLeft(min(max(place.left(), room.left()), room.right() - width))
            place.moveTop(min(max(place.top(), room.top()), room.bottom() - height))
            if not place.intersects(rim):
                self.setGeometry(place)
                return
        self.setGeometry(middle)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Resize:
            self._place()
        return False

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Escape:
            self.close()
        else:
            super().keyPressEvent(event)
