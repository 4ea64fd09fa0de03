"""Stop at the window's lower edge, for when the Mount view itself is not in sight."""

from collections.abc import Callable

from PySide6.QtWidgets import QPushButton, QWidget

from app.ui.main_window import MainWindow
from app.ui.mount.stop_key import KEY
from app.ui.widgets import button


class StopCorner:
    """One button in the status bar, there while a mount is connected."""

    def __init__(self, stop: Callable[[], None]) -> None:
        self._stop = stop
        self.button: QPushButton | None = None

    def show(self, window: QWidget, on: bool) -> None:
        """Put it into ``window``'s status bar, or hide it."""
        if on and self.button is None and isinstance(window, MainWindow):
            tip = f"Stop the mount now; {KEY} does it from anywhere"
            self.button = button(f"Stop mount ({KEY})", self._stop, "small", tip)
            window.status.addPermanentWidget(self.button)
        if self.button is not None:
            self.button.setVisible(on)
