"""The tour: four cards over the window, at the first start or from the Help menu."""

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QFrame, QWidget

from kochab.text.translation import tr, tr_noop
from kochab.window.widgets import button, column, label, row

CARDS = (
    (
        tr_noop("Open an image"),
        tr_noop(
            "Drop an image of the night sky on the window, or try a sample. Kochab says where it points. "
            "It needs no focal length, no coordinates and no internet."
        ),
    ),
    (
        tr_noop("The card says where"),
        tr_noop(
            "What the frame shows, right ascension and declination with their uncertainty, and the field. "
            "Details has everything else."
        ),
    ),
    (
        tr_noop("Five modes at the left"),
        tr_noop(
            "Image, Live with a camera, Mount, Polar alignment, and a Laboratory of methods. "
            "F1 opens the help for the one you are in."
        ),
    ),
    (
        tr_noop("STOP and Night"),
        tr_noop(
            "With a mount connected, STOP stands at the right end of the bar; Esc does the same from anywhere. "
            "Night (Ctrl+N) turns everything red."
        ),
    ),
)
WIDTH_PX = 420


class Tour(QFrame):
    """One card at a time; Esc or Skip ends it."""

    def __init__(self, window: QWidget) -> None:
        super().__init__(window)
        self.setObjectName("card")
        self.at = 0
        self.title, self.text = label("", "heading", wrap=True), label("", wrap=True)
        self.count = label("", "muted")
        self.back = button(tr("Back"), lambda: self._turn(-1))
        self.next = button(tr("Next"), lambda: self._turn(1), "main")
        self.skip = button(tr("Skip"), self.close)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        buttons = row(self.count, None, self.skip, self.back, self.next, spacing=8)
        column(self.title, self.text, 6, buttons, on=self, spacing=8, margins=(18, 16, 18, 14))
        # It is in no layout, so it follows the window's size by itself.
        window.installEventFilter(self)
        self._turn(0)
        self.show()
        self.raise_()
        self.next.setFocus()

    def _turn(self, by: int) -> None:
        self.at += by
        if self.at == len(CARDS):
            self.close()
            return
        title, text = CARDS[self.at]
        self.title.setText(tr(title))
        self.text.setText(tr(text))
        self.setAccessibleName(f"{tr(title)}. {tr(text)}")
        self.count.setText(tr("{at} of {cards}", at=self.at + 1, cards=len(CARDS)))
        self.back.setVisible(self.at > 0)
        self.next.setText(tr("Done") if self.at == len(CARDS) - 1 else tr("Next"))
        self.skip.setVisible(self.at < len(CARDS) - 1)
        self._place()

    def _place(self) -> None:
        """In the upper half of the window, above the card of the image."""
        window = self.window()
        width = min(max(WIDTH_PX, self.fontMetrics().averageCharWidth() * 60), window.width() - 40)
        height = max(self.heightForWidth(width), self.sizeHint().height())
        self.setGeometry((window.width() - width) // 2, (window.height() - height) * 2 // 5, width, height)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Resize:
            self._place()
        return False

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Escape:
            self.close()
        else:
            super().keyPressEvent(event)
