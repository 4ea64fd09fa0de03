"""The tour: four cards over the window, at the first start or from the Help menu."""

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QFrame, QWidget

from kochab.window.widgets import button, column, label, row

CARDS = (
    (
        "Open an image",
        "Drop an image of the night sky on the window, or try a sample. Kochab says where it points. "
        "It needs no focal length, no coordinates and no internet.",
    ),
    (
        "The card says where",
        "What the frame shows, right ascension and declination with their uncertainty, and the field. "
        "Details has everything else.",
    ),
    (
        "Five modes at the left",
        "Image, Live with a camera, Mount, Polar alignment, and a Laboratory of methods. "
        "F1 opens the help for the one you are in.",
    ),
    (
        "STOP and Night",
        "With a mount connected, STOP stands at the right end of the bar; Esc does the same from anywhere. "
        "Night (Ctrl+N) turns everything red.",
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
        self.back = button("Back", lambda: self._turn(-1))
        self.next = button("Next", lambda: self._turn(1), "main")
        self.skip = button("Skip", self.close)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        buttons = row(self.count, None, self.skip, self.back, self.next, spacing=8)
        column(self.title, self.text, 6, buttons, on=self, spacing=8, margins=(18, 16, 18, 14))
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
        self.title.setText(title)
        self.text.setText(text)
        self.setAccessibleName(f"{title}. {text}")
        self.count.setText(f"{self.at + 1} of {len(CARDS)}")
        self.back.setVisible(self.at > 0)
        self.next.setText("Done" if self.at == len(CARDS) - 1 else "Next")
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
