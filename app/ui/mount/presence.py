"""The mount in every view: how it is, what uses it, and Stop, at the window's lower edge."""

from PySide6.QtCore import QObject
from PySide6.QtWidgets import QApplication

from app.ui.main_window import MainWindow
from app.ui.mount.corner import MountCorner
from app.ui.mount.desk import Desk
from app.ui.mount.stop_key import StopKey
from app.ui.services import Services


class Presence(QObject):
    """Follows a :class:`Desk` in the window's corner and hears its Stop key."""

    def __init__(self, desk: Desk, window: MainWindow) -> None:
        super().__init__(desk)
        self._desk = desk
        self.corner = MountCorner(desk.stop)
        window.status.addPermanentWidget(self.corner)
        self._key = StopKey(self._pressed, self)
        window.closing.connect(lambda: self._key.listen(False))
        desk.changed.connect(self._show)
        self._show()

    def _show(self) -> None:
        self._key.listen(self._desk.known.phase != "off")
        self.corner.show_known(self._desk.known)

    def _pressed(self) -> None:
        if not (self._desk.known.at_rest and _closes_something()):
            self._desk.stop()


def _closes_something() -> bool:
    """Whether the key has another use now: a menu, a list or a dialog is open, or a full view.

    While the mount stands, that alone is meant: an alignment is not lost over a closed menu.
    """
    window = QApplication.activeWindow()
    return (
        QApplication.activePopupWidget() is not None
        or QApplication.activeModalWidget() is not None
        or (window is not None and not isinstance(window, MainWindow) and window.isFullScreen())
    )


def desk_in(services: Services) -> Desk:
    """The desk of a window, with its presence there."""
    desk = Desk(services)
    window = services.view.window()
    if isinstance(window, MainWindow):
        Presence(desk, window)
    return desk
