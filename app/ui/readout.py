"""What the status bar says of the place under the cursor."""

import numpy as np

from app.core.attitude import radec_deg
from app.core.frame import Frame
from app.core.solution import Solution
from app.ui.formats import AngleStyle, radec_text


def readout(frame: Frame, solution: Solution | None, x: float, y: float, style: AngleStyle) -> str:
    """RA/Dec when the frame is solved, the pixel (0, 0 is the centre of the first), its value."""
    pixel = f"x {x:.1f}  y {y:.1f}  value {value_at(frame, x, y)}"
    if solution is None:
        return pixel
    sky = radec_deg(solution.sky_at(np.array([[x, y]]))[0])
    return f"{radec_text(*sky, style)}    {pixel}"


def value_at(frame: Frame, x: float, y: float) -> str:
    """The value of the pixel at (x, y), as text; empty outside."""
    column, row = int(np.floor(x + 0.5)), int(np.floor(y + 0.5))
    if not (0 <= column < frame.width and 0 <= row < frame.height):
        return ""
    value = frame.pixels[row, column]
    return f"{value:.5g}" if np.issubdtype(frame.pixels.dtype, np.floating) else f"{value}"
