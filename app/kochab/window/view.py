"""What stands in a dock beside the image: the protocol of a view."""

from pathlib import Path

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QWidget

from kochab.window.widgets import Page


class View(Page):
    """A page that is made with :class:`kochab.window.services.Services` alone when its dock is first shown.

    ``room`` is what fills the middle of the window while the view stands beside it; None: the open frame does.
    ``frame_wanted`` asks for the open frame in place of the room, or for the room again.

    Its row in :data:`kochab.window.shell.views.VIEWS` names it. The window asks the view that has the mount's buttons
    to aim it and to begin a practice, and the Polar view to measure frames; another has nothing to do then.
    """

    frame_wanted = Signal(bool)
    side_wanted = Signal()  # the view itself, should it be folded away
    room: QWidget | None = None
    room_first = False  # whether the room is seen first where a small window has no place for both
    pages_scroll = False  # within the view: it may be as low as can be

    def heightForWidth(self, width: int) -> int:
        """What its dock gives it at least."""
        if not self.pages_scroll:
            return super().heightForWidth(width)
        layout = self.layout()
        return -1 if layout is None else layout.minimumHeightForWidth(width)

    def aim(self, action: str, target: str) -> None:
        """Carry out ``action``, "goto" or "centre" of :mod:`kochab.gear.actions`, at a target as a person types it."""

    def practise(self) -> None:
        """Start a simulated telescope."""

    def measure(self, paths: list[Path]) -> None:
        """Measure the polar axis from these frames."""
