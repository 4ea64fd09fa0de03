"""The status bar: what is going on, and what is under the cursor."""

from typing import TYPE_CHECKING

import numpy as np
from PySide6.QtCore import Signal
from PySide6.QtWidgets import QStatusBar

from kochab.core.angle_text import AngleStyle, altaz_text, radec_text
from kochab.core.attitude import radec_deg
from kochab.core.frame import Frame, Site
from kochab.core.progress import Progress
from kochab.core.solution import Solution
from kochab.window.widgets import ProgressBar, button, label

if TYPE_CHECKING:
    from kochab.polar.horizon import Horizon


STAGE_TEXT = {
    "read": "Reading",
    "display": "Preparing the image",
    "detect": "Detecting stars",
    "identify": "Identifying",
    "attitude": "Fitting",
    "names": "Naming stars",
}


class Status(QStatusBar):
    """Progress with its Cancel, the place under the cursor, and facts of the open frame."""

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
        for widget in (self.doing, self.bar, self.cancel):
            self.addWidget(widget)
        for widget in (self.background, self.place, self.frame, self.zoom):
            self.addPermanentWidget(widget)
            widget.setMinimumWidth(1)  # cut on a small screen, else they push Stop out of it
        self.show_idle("Ready")

    def show_progress(self, progress: Progress) -> None:
        text = STAGE_TEXT.get(progress.stage, progress.stage.capitalize())
        self.doing.setText(f"{text}…")
        self.doing.setToolTip(progress.detail)
        self.bar.show_share(progress.fraction)
        self.bar.show()
        self.cancel.show()

    def show_idle(self, text: str) -> None:
        self.doing.setText(text)
        self.bar.hide()
        self.cancel.hide()

    def show_frame(self, text: str, tip: str) -> None:
        """Size of the open frame, and its reader's warnings."""
        self.frame.setText(f"{text} ⚠" if tip else text)
        self.frame.setToolTip(tip)

    def show_zoom(self, scale: float) -> None:
        """Screen pixels to an image pixel."""
        self.zoom.setText(f"{scale * 100:.0f} %" if scale >= 0.1 else f"{scale * 100:.1f} %")


def readout(
    frame: Frame, solution: Solution | None, x: float, y: float, style: AngleStyle, site: Site | None = None
) -> str:
    """Text for a place: RA/Dec of a solved frame, the pixel (0, 0 is the centre of the first), its value.

    With refracted altitude and azimuth when the frame has a time, and a site or else ``site``.
    """
    pixel = f"x {x:.1f}  y {y:.1f}  value {value_at(frame, x, y)}"
    if solution is None:
        return pixel
    vector = solution.sky_at(np.array([[x, y]]))[0]
    horizon = horizon_of(frame, site)
    local = f"    {altaz_text(*horizon.altaz_deg(vector))}" if horizon is not None else ""
    return f"{radec_text(*radec_deg(vector), style)}{local}    {pixel}"


def horizon_of(frame: Frame, site: Site | None) -> "Horizon | None":
    """Where and when the frame was taken; None when either is not known."""
    from kochab.polar.horizon import Horizon

    where = frame.hint.site or site
    if where is None or frame.hint.time_utc is None:
        return None
    return Horizon(where, frame.hint.time_utc)


def value_at(frame: Frame, x: float, y: float) -> str:
    """The value of the pixel at (x, y), as text; empty outside."""
    column, row = int(np.floor(x + 0.5)), int(np.floor(y + 0.5))
    if not (0 <= column < frame.width and 0 <= row < frame.height):
        return ""
    value = frame.pixels[row, column]
    return f"{value:.5g}" if np.issubdtype(frame.pixels.dtype, np.floating) else f"{value}"
