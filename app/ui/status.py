"""The bar at the bottom: what is going on, and what is under the cursor."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QStatusBar

from app.core.progress import Progress
from app.ui.progress_bar import ProgressBar
from app.ui.widgets import button, label

STAGE_TEXT = {
    "read": "Reading",
    "display": "Preparing the picture",
    "detect": "Detecting stars",
    "identify": "Identifying",
    "attitude": "Fitting",
    "names": "Naming stars",
}


class Status(QStatusBar):
    """Says; decides nothing."""

    cancel_wanted = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setSizeGripEnabled(False)
        self.setContentsMargins(8, 2, 8, 2)
        self.doing = label("Ready")
        self.bar = ProgressBar("Progress")
        self.bar.setFixedWidth(150)
        self.cancel = button("Cancel", self.cancel_wanted.emit, "small", "Stop (Esc)")
        self.background = label("", "muted")
        self.frame = label("", "muted")
        self.place = label("")
        self.place.setAccessibleName("Under the cursor")
        self.zoom = label("", "muted")
        self.addWidget(self.doing)
        self.addWidget(self.bar)
        self.addWidget(self.cancel)
        for widget in (self.background, self.place, self.frame, self.zoom):
            self.addPermanentWidget(widget)
        self.show_idle("Ready")

    def show_progress(self, progress: Progress) -> None:
        """Something is under way."""
        text = STAGE_TEXT.get(progress.stage, progress.stage.capitalize())
        self.doing.setText(f"{text}…")
        self.doing.setToolTip(progress.detail)
        self.bar.show_share(progress.fraction)
        self.bar.setVisible(True)
        self.cancel.setVisible(True)

    def show_idle(self, text: str) -> None:
        """Nothing is under way."""
        self.doing.setText(text)
        self.bar.setVisible(False)
        self.cancel.setVisible(False)

    def show_frame(self, text: str, tip: str) -> None:
        """Size of the open frame, and its reader's warnings."""
        self.frame.setText(f"{text} ⚠" if tip else text)
        self.frame.setToolTip(tip)

    def forget_frame(self) -> None:
        """No frame is open."""
        self.show_frame("", "")
        self.zoom.clear()

    def show_zoom(self, scale: float) -> None:
        """Screen pixels to an image pixel."""
        self.zoom.setText(f"{scale * 100:.0f} %" if scale >= 0.1 else f"{scale * 100:.1f} %")
