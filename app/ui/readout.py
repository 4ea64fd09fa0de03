"""What the status bar says of the place under the cursor."""

from typing import TYPE_CHECKING

import numpy as np

from app.core.attitude import radec_deg
from app.core.frame import Frame
from app.core.hint import Site
from app.core.solution import Solution
from app.ui.formats import AngleStyle, altaz_text, radec_text

if TYPE_CHECKING:
    from app.polar.horizon import Horizon


def readout(
    frame: Frame,
    solution: Solution | None,
    x: float,
    y: float,
    style: AngleStyle,
    site: Site | None = None,
) -> str:
    """RA/Dec when the frame is solved, the pixel (0, 0 is the centre of the first), its value.

    Also altitude and azimuth, as the air shows them, when the frame says when it was taken and
    where; ``site`` is meant when it does not say where.
    """
    pixel = f"x {x:.1f}  y {y:.1f}  value {value_at(frame, x, y)}"
    if solution is None:
        return pixel
    vector = solution.sky_at(np.array([[x, y]]))[0]
    horizon = horizon_of(frame, site)
    local = f"    {altaz_text(*altaz_deg(horizon, vector))}" if horizon is not None else ""
    return f"{radec_text(*radec_deg(vector), style)}{local}    {pixel}"


def horizon_of(frame: Frame, site: Site | None) -> "Horizon | None":
    """Where and when the frame was taken; None when either is not known."""
    from app.polar.horizon import Horizon

    where = frame.hint.site or site
    if where is None or frame.hint.time_utc is None:
        return None
    return Horizon(where, frame.hint.time_utc)


def altaz_deg(horizon: "Horizon", vector: np.ndarray) -> tuple[float, float]:
    """Altitude and azimuth (from north through east) of an ICRS unit vector (3,)."""
    east, north, up = horizon.observed(vector)[0]
    altitude = np.degrees(np.arcsin(np.clip(up, -1.0, 1.0)))
    return float(altitude), float(np.degrees(np.arctan2(east, north)) % 360.0)


def value_at(frame: Frame, x: float, y: float) -> str:
    """The value of the pixel at (x, y), as text; empty outside."""
    column, row = int(np.floor(x + 0.5)), int(np.floor(y + 0.5))
    if not (0 <= column < frame.width and 0 <= row < frame.height):
        return ""
    value = frame.pixels[row, column]
    return f"{value:.5g}" if np.issubdtype(frame.pixels.dtype, np.floating) else f"{value}"
