"""The pointing of the live camera in numbers, and its trail on an all-sky chart."""

from time import monotonic
from typing import TYPE_CHECKING

import numpy as np
from PySide6.QtCore import QSize, Signal
from PySide6.QtWidgets import QSizePolicy

from kochab.core.arrays import Floats
from kochab.core.attitude import radec_deg, wrapped
from kochab.text.angle_text import AngleStyle, age_text
from kochab.text.translation import number, tr, tr_noop
from kochab.window.charts.plot_area import PlotArea
from kochab.window.live import status_text
from kochab.window.live.sky_points import SkyPoints, Trail
from kochab.window.live.status_text import NOTHING
from kochab.window.widgets import (
    Page,
    button,
    column,
    facts_grid,
    label,
    position_labels,
    row,
    set_role,
    show_text,
    value_label,
)
from kochab.workflows.live.update import LiveUpdate
from kochab.workflows.session.live_stream import Lens

if TYPE_CHECKING:
    from kochab.window.live.sky_plot import SkyPlot

MARGIN_PX = 6
FAR_RAD = np.radians(75.0)  # from the central meridian; farther out the map is re-centred


class SkyChart(PlotArea):
    """An all-sky chart with the trail of the pointing; the stars are redrawn only when it is re-centred."""

    def __init__(self) -> None:
        super().__init__(tr("All-sky chart with the trail of the pointing"))
        self.trail = Trail()
        self._points: SkyPoints | None = None
        self._centre_ra_deg = 0.0
        policy = QSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        policy.setHeightForWidth(True)
        self.setSizePolicy(policy)
        self.setMinimumSize(220, 120)

    def sizeHint(self) -> QSize:
        return QSize(360, 186)

    def heightForWidth(self, width: int) -> int:
        return min(width // 2 + MARGIN_PX, 300)  # the map is twice as wide as high

    def show_points(self, points: SkyPoints) -> None:
        """The stars to draw."""
        self._points = points
        self._draw_sky()

    def show_pointing(self, centre: Floats, old: bool) -> None:
        """Add the boresight, an ICRS unit vector (3,), to the trail."""
        first = self.trail.here is None
        self.trail.add(centre, old)
        ra, dec = radec_deg(centre)
        known, here = tr("Last known pointing: RA {ra}°, Dec {dec}°."), tr("Pointing: RA {ra}°, Dec {dec}°.")
        self.describe((known if old else here).format(ra=number(ra, ".1f"), dec=number(dec, "+.1f")))
        away = np.radians(wrapped(ra - self._centre_ra_deg))
        if first or abs(away) > FAR_RAD:
            self._centre_ra_deg = round(ra / 15.0) * 15.0 % 360.0  # a whole hour
            self._draw_sky()
        self.refill()

    def clear(self) -> None:
        """Remove the trail."""
        self.trail.clear()
        self.refill()

    def make_plot(self) -> "SkyPlot":
        from kochab.window.live.sky_plot import SkyPlot

        plot = SkyPlot()
        plot.show_sky(self._points, self._centre_ra_deg)
        return plot

    def fill_plot(self) -> None:
        self.plot.show_trail(self.trail)

    def _draw_sky(self) -> None:
        if self.plot is not None:
            self.plot.show_sky(self._points, self._centre_ra_deg)
            self.refill()


ROWS = {
    tr_noop("Uncertainty"): tr_noop("1σ of the pointing, filtered over the frames"),
    tr_noop("Age"): tr_noop("Time since mid-exposure of the last solved frame"),
    tr_noop("Drift RA"): tr_noop("Times cos(Dec), positive towards the east"),
    tr_noop("Drift Dec"): tr_noop("Positive towards the north"),
    tr_noop("Rates"): tr_noop("Rotation of the camera about its x, y and z axes"),
    tr_noop("Frame rate"): tr_noop("Frames per second"),
    tr_noop("Latency"): tr_noop("Time to solve, and from mid-exposure to the screen"),
    tr_noop("Lens"): tr_noop("Calibration of camera and lens"),
}
RATES = ("Drift RA", "Drift Dec", "Rates")
STOPPED = tr_noop("OLD: last pointing before the camera stopped")


class PointingPanel(Page):
    """Rewritten a few times a second, so that the age runs on without new frames."""

    save_wanted = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.angle_style = AngleStyle.SEXAGESIMAL
        self.ra, self.dec = position_labels()
        self.old = label("", "old", wrap=True)
        self.doubt = label("", "wrong", wrap=True)
        self.chart = SkyChart()
        self.values = {title: value_label(tr(title), tr(tip)) for title, tip in ROWS.items()}
        rows = ((tr(title), value) for title, value in self.values.items())
        self._grid = facts_grid(4, (tr("RA"), self.ra), (tr("Dec"), self.dec), *rows)
        tip = tr("Name camera and lens, and use this calibration the next time")
        self.save = button(tr("Save &lens as…"), self.save_wanted.emit, tip=tip)
        save = row(self.save, None)
        column(self.old, self._grid, save, self.doubt, (self.chart, 1), on=self, spacing=8, margins=(10, 10, 10, 10))
        self.clear()

    def clear(self) -> None:
        """Nothing is known."""
        for value in (self.ra, self.dec, *self.values.values()):
            value.setText(NOTHING)
        self._hide_unmeasured()
        self.save.setVisible(False)
        show_text(self.old, "")
        show_text(self.doubt, "")
        self.chart.clear()

    def show_update(
        self, update: LiveUpdate, lens: Lens, name: str, drawn_hz: float | None, screen_ms: float | None
    ) -> None:
        """Show the latest update; may be called again with the same one, which has aged.

        Parameters
        ----------
        update : LiveUpdate
            The latest of the stream.
        lens : Lens
            What is known of the camera.
        name : str
            What the person calls it.
        drawn_hz : float or None
            Frames drawn a second; None: not counted yet.
        screen_ms : float or None
            From mid-exposure to the screen; None: not measured yet.
        """
        now = monotonic()
        old, good = status_text.is_old(update, now), update.last_good
        for value, text in zip((self.ra, self.dec), status_text.position_texts(update, self.angle_style), strict=True):
            value.setText(text)
        not_now = old or update.recorded
        self._mute_position(not_now)
        east, north = status_text.drift_texts(None if old else update.drift)
        age = age_text(good.age_s(now) if update.is_old else update.shown_age_s(now)) if good is not None else NOTHING
        for title, text in {
            "Uncertainty": NOTHING if old else status_text.sigma_text(update),
            "Age": age,
            "Drift RA": east,
            "Drift Dec": north,
            "Rates": NOTHING if old else status_text.rates_text(update),
            "Frame rate": status_text.frame_rate_text(update),
            "Latency": status_text.latency_text(update, screen_ms),
            "Lens": status_text.lens_text(lens),
        }.items():
            self.values[title].setText(text)
        self._hide_unmeasured()
        self.save.setVisible(not name and lens.profile is not None and lens.profile.frames > 0)
        self.values["Frame rate"].setToolTip(status_text.frame_rate_tip(update, drawn_hz))
        show_text(self.old, status_text.old_text(good.age_s(now)) if not_now and good is not None else "")
        show_text(self.doubt, lens.doubt)
        centre = status_text.pointing_vector(update)
        if centre is not None:
            self.chart.show_pointing(centre, old)

    def show_stopped(self) -> None:
        """The camera has stopped: keep the last pointing, marked as old."""
        if self.ra.text() == NOTHING:
            return
        self._mute_position(True)
        for title, value in self.values.items():
            if title != "Lens":
                value.setText(NOTHING)
        self._hide_unmeasured()
        self.save.setVisible(False)
        show_text(self.old, tr(STOPPED))
        if self.chart.trail.here is not None:
            self.chart.show_pointing(self.chart.trail.here, old=True)

    def _hide_unmeasured(self) -> None:
        """Rates come after several frames: until then their rows are not shown."""
        for line, (title, value) in enumerate(self.values.items(), 2):  # below RA and Dec
            for at in (0, 1) if title in RATES else ():
                item = self._grid.itemAtPosition(line, at)
                if item is not None and (part := item.widget()) is not None:
                    part.setVisible(value.text() != NOTHING)

    def _mute_position(self, old: bool) -> None:
        for value in (self.ra, self.dec):
            set_role(value, "muted" if old else "value")
