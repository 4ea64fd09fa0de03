"""That the image beside a view of the mount is not what the telescope sees now, and how old it is."""

import time

from PySide6.QtCore import QTimer
from PySide6.QtGui import QHideEvent, QShowEvent
from PySide6.QtWidgets import QVBoxLayout, QWidget

from kochab.text.angle_text import age_text
from kochab.text.translation import tr
from kochab.window.frame.session import Session
from kochab.window.widgets import label, show_text

OLD_S, LOOK_MS = 6.0, 1000  # as old as the polar error may be without a word; from one look to the next


def picture_words(session: Session, now_s: float) -> str:
    """What to say of the open image; empty where it is of just now, or where there is none."""
    known = session.known
    if known.frame is None:
        return ""
    if known.path is not None:
        return tr("The image is a file, {name}: not what the telescope sees now.", name=known.path.name)
    age_s = now_s - known.shown_at_s
    return tr("The image is OLD: taken {age} ago.", age=age_text(age_s)) if age_s > OLD_S else ""


class PictureAge(QWidget):
    """Says it while it is in sight."""

    def __init__(self, session: Session) -> None:
        super().__init__()
        self._session = session
        self.words = label("", "muted", wrap=True)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.words)
        self._clock = QTimer(self, interval=LOOK_MS)
        self._clock.timeout.connect(self.look)
        for changed in (session.opened, session.streamed, session.idle):
            changed.connect(self.look)
        self.look()

    def look(self, _: object = None) -> None:
        """Say how it is now."""
        show_text(self.words, picture_words(self._session, time.monotonic()))

    def showEvent(self, event: QShowEvent) -> None:
        self.look()
        self._clock.start()

    def hideEvent(self, event: QHideEvent) -> None:
        self._clock.stop()
