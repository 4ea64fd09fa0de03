"""What stands under the cursor: its place on the sky and the pixel."""

import numpy as np

from kochab.core.attitude import radec_deg
from kochab.core.frame import Frame, Site
from kochab.core.solution import Solution
from kochab.sky.horizon import horizon_of
from kochab.text.angle_text import AngleStyle, altaz_text, radec_text
from kochab.text.translation import number, tr


def readout(
    frame: Frame, solution: Solution | None, x: float, y: float, style: AngleStyle, site: Site | None = None
) -> str:
    """Text for a place: RA and Dec of a solved frame, the pixel (0, 0 is the centre of the first), its value.

    With refracted altitude and azimuth when the frame has a time, and a site is known.

    Parameters
    ----------
    frame : Frame
        Its pixels and when it was taken.
    solution : Solution or None
        Where it points; None: not solved.
    x, y : float
        The place, px.
    style : AngleStyle
        How coordinates are written.
    site : Site or None
        Used where the frame does not say its own.
    """
    pixel = tr("x {x:.1f}  y {y:.1f}  value {value}", x=x, y=y, value=value_at(frame, x, y))
    if solution is None:
        return pixel
    vector = solution.sky_at(np.array([[x, y]]))[0]
    horizon = horizon_of(frame, site)
    local = f"    {altaz_text(*horizon.altaz_deg(vector))}" if horizon is not None else ""
    return f"{radec_text(*radec_deg(vector), style)}{local}    {pixel}"


def value_at(frame: Frame, x: float, y: float) -> str:
    """The value of the pixel at (x, y), as text; empty outside."""
    # Whole numbers are the centres of pixels.
    column, row = int(np.floor(x + 0.5)), int(np.floor(y + 0.5))
    if not (0 <= column < frame.width and 0 <= row < frame.height):
        return ""
    value = frame.pixels[row, column]
    return number(value, ".5g") if np.issubdtype(frame.pixels.dtype, np.floating) else f"{value}"
