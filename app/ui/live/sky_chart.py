"""A small chart of the whole sky with the trail of the pointing."""

from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QSize
from PySide6.QtWidgets import QSizePolicy

from app.core.attitude import radec_deg
from app.ui.live.sky_points import SkyPoints
from app.ui.live.trail import Trail
from app.ui.plot_place import PlotPlace

if TYPE_CHECKING:
    from app.ui.live.sky_plot import SkyPlot

Floats = NDArray[np.float64]
MARGIN_PX = 6
FAR_RAD = np.radians(75.0)  # from the middle meridian; beyond, the map is turned


class SkyChart(PlotPlace):
    """Keeps the trail; stars and figures are drawn once for a middle of the map."""

    def __init__(self) -> None:
        super().__init__("Chart of the whole sky with the trail of the pointing")
        self.trail = Trail()
        self._points: SkyPoints | None = None
        self._middle_ra_deg = 0.0
        policy = QSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        policy.setHeightForWidth(True)
        self.setSizePolicy(policy)
        self.setMinimumSize(220, 120)

    def sizeHint(self) -> QSize:
        return QSize(360, 186)

    def heightForWidth(self, width: int) -> int:
        return min(width // 2 + MARGIN_PX, 300)

    def show_points(self, points: SkyPoints) -> None:
        """The stars to draw."""
        self._points = points
        self._draw_ground()

    def show_here(self, centre: Floats, old: bool) -> None:
        """The camera points there, ICRS unit vector (3,), or did when that is ``old``."""
        first = self.trail.here is None
        self.trail.add(centre, old)
        ra, dec = radec_deg(centre)
        word = "was last known" if old else "is"
        self.describe(f"The camera {word} at RA {ra:.1f}°, Dec {dec:+.1f}°.")
        away = np.radians((ra - self._middle_ra_deg + 180.0) % 360.0 - 180.0)
        if first or abs(away) > FAR_RAD:
            self._middle_ra_deg = round(ra / 15.0) * 15.0 % 360.0
            self._draw_ground()
        self.refill()

    def forget(self) -> None:
        """No trail."""
        self.trail.clear()
        self.refill()

    # the plot ---------------------------------------------------------------------------------
    def make_plot(self) -> "SkyPlot":
        from app.ui.live.sky_plot import SkyPlot

        plot = SkyPlot()
        plot.show_sky(self._points, self._middle_ra_deg)
        return plot

    def fill_plot(self) -> None:
        self._sky.show_trail(self.trail)

    def dress_plot(self) -> None:
        self._sky.dress(self.colours)

    @property
    def _sky(self) -> "SkyPlot":
        return cast("SkyPlot", self.plot)

    def _draw_ground(self) -> None:
        if self.plot is not None:
            self._sky.show_sky(self._points, self._middle_ra_deg)
            self.refill()
