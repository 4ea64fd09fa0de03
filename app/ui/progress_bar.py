"""A bar of progress that is painted in its turn."""

from PySide6.QtWidgets import QProgressBar

STEPS = 1000


class ProgressBar(QProgressBar):
    """Shows a share, or that it is not known.

    Qt's bar has itself painted within ``setValue``, and with it everything in the window that waits
    to be: a dozen steps told in one turn of the event loop paint the window a dozen times.
    """

    def __init__(self, name: str) -> None:
        super().__init__()
        self.setRange(0, STEPS)
        self.setTextVisible(False)
        self.setAccessibleName(name)

    def show_share(self, share: float | None) -> None:
        """A share in 0..1, None for one that is not known."""
        self.setUpdatesEnabled(False)
        self.setRange(0, 0 if share is None else STEPS)
        if share is not None:
            self.setValue(round(STEPS * min(max(share, 0.0), 1.0)))
        self.setUpdatesEnabled(True)  # asks to be painted, later
