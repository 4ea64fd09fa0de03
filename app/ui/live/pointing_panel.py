"""Where the camera points now, how sure that is, how old, and how it moves."""

from time import monotonic

from PySide6.QtWidgets import QLabel, QVBoxLayout, QWidget

from app.ui.formats import AngleStyle
from app.ui.live import words
from app.ui.live.sky_chart import SkyChart
from app.ui.live.stream import Lens
from app.ui.widgets import facts_grid, label, position_labels, set_role, value_label
from app.workflows.live_update import LiveUpdate

ROWS = (
    ("Sigma", "One-sigma error of the pointing, filtered over the frames"),
    ("Age", "Since the middle of the exposure the pointing belongs to"),
    ("Drift RA", "Times cos(Dec); positive towards the east"),
    ("Drift Dec", "Positive towards the north"),
    ("Rates", "The camera’s turning against the stars about its x, y and z axis"),
    ("Pace", "Frames a second"),
    ("Latency", "How far what is on the screen lags behind the sky"),
    ("Lens", "What is known of camera and lens"),
)
LEFT = "OLD: the last pointing before the camera stopped"


class PointingPanel(QWidget):
    """Written a few times a second; the age goes on by itself."""

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("page")
        self.style_ = AngleStyle.SEXAGESIMAL
        self.ra, self.dec = position_labels()
        self.old = label("", "old", wrap=True)
        self.doubt = label("", "wrong", wrap=True)
        self.values: dict[str, QLabel] = {}
        self.chart = SkyChart()
        grid = facts_grid(4, ("RA", self.ra), ("Dec", self.dec))
        for row, (title, why) in enumerate(ROWS, 2):
            name, value = label(title, "muted"), value_label(title)
            name.setToolTip(why)
            value.setToolTip(why)
            grid.addWidget(name, row, 0)
            grid.addWidget(value, row, 1)
            self.values[title] = value
        column = QVBoxLayout(self)
        column.setContentsMargins(10, 10, 10, 10)
        column.setSpacing(8)
        column.addWidget(self.old)
        column.addLayout(grid)
        column.addWidget(self.doubt)
        column.addWidget(self.chart, 1)
        self.clear()

    def clear(self) -> None:
        """Nothing is known."""
        for value in (self.ra, self.dec, *self.values.values()):
            _write(value, words.NOTHING)
        self.old.setVisible(False)
        self.doubt.setVisible(False)
        self.chart.forget()

    def show_update(
        self, update: LiveUpdate, lens: Lens, name: str, drawn_hz: float | None,
        screen_ms: float | None,
    ) -> None:  # fmt: skip
        """What is known now; may be called again with the same update, which has aged."""
        now = monotonic()
        old = words.is_old(update, now)
        good = update.last_good
        ra, dec = words.position_texts(update, self.style_)
        _write(self.ra, ra)
        _write(self.dec, dec)
        self._fade(old)
        east, north = words.drift_texts(None if old else update.drift)
        age = words.age_text(good.age_s(now)) if good is not None else words.NOTHING
        for title, text in {
            "Sigma": words.NOTHING if old else words.sigma_text(update), "Age": age,
            "Drift RA": east, "Drift Dec": north,
            "Rates": words.NOTHING if old else words.rates_text(update),
            "Pace": words.pace_text(update, drawn_hz),
            "Latency": words.latency_text(update, screen_ms),
            "Lens": words.lens_text(lens, name),
        }.items():  # fmt: skip
            _write(self.values[title], text)
        _write(self.old, f"OLD: the pointing of {age} ago; where it points now is not known")
        self.old.setVisible(old)
        _write(self.doubt, lens.doubt)
        self.doubt.setVisible(bool(lens.doubt))
        self._show_place(update, old)

    def leave(self) -> None:
        """The camera runs no more: what was known stays, as old."""
        if self.ra.text() == words.NOTHING:
            return
        self._fade(True)
        for title in ("Sigma", "Age", "Drift RA", "Drift Dec", "Rates", "Pace", "Latency"):
            _write(self.values[title], words.NOTHING)
        _write(self.old, LEFT)
        self.old.setVisible(True)
        if self.chart.trail.here is not None:
            self.chart.show_here(self.chart.trail.here, old=True)

    def _fade(self, old: bool) -> None:
        """An old position does not look like a new one."""
        role = "muted" if old else "value"
        for value in (self.ra, self.dec):
            if value.property("role") != role:
                set_role(value, role)

    def _show_place(self, update: LiveUpdate, old: bool) -> None:
        centre = update.track.filtered_centre
        if centre is None and update.last_good is not None:
            centre = update.last_good.solution.centre_vector
        if centre is not None:
            self.chart.show_here(centre, old)


def _write(target: QLabel, text: str) -> None:
    """Only what has changed: each text costs a layout."""
    if target.text() != text:
        target.setText(text)
