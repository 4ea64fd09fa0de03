"""The camera of the Live view: its exposure, gain and binning, and its histogram."""

from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QSignalBlocker, QTimer, Signal
from PySide6.QtWidgets import QAbstractSpinBox

from kochab.core.capture import CaptureLimits, CaptureSettings
from kochab.gear.session import CameraSelection
from kochab.text.translation import tr, tr_noop
from kochab.window.devices.cameras import CameraBox
from kochab.window.image.stretch_strip import AXIS_POWER, Histogram
from kochab.window.live.rendering import Levels
from kochab.window.live.status_text import fixed_settings, levels_text
from kochab.window.widgets import (
    Page,
    column,
    field_values,
    fill_fields,
    grid,
    label,
    number_field,
    row,
    show_text,
    switch,
    text_field,
)

if TYPE_CHECKING:
    from kochab.window.charts.histogram_plot import HistogramPlot


DEFAULT = tr_noop("default")
LEAST_LETTERS = 13  # of a field's width in a small window; the largest value needs more
UNSET = -1.0  # 0 is a gain
MOST = LONGEST_S, MOST_GAIN, MOST_BINNING = 3600.0, 1e6, 16


class SettingFields(Page):
    """Exposure, gain and binning; the lowest value of each is the camera's default."""

    changed = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.exposure = number_field(tr("Exposure"), 0.0, LONGEST_S, 0.0, 4, tr(" s"))
        self.gain = number_field(tr("Gain, in the camera’s units"), UNSET, MOST_GAIN, UNSET, 1)
        self.binning = number_field(tr("Binning"), 0, MOST_BINNING, 0)
        self.in_force = label("", "muted", wrap=True)
        self.fields = {"exposure": self.exposure, "gain": self.gain, "binning": self.binning}
        for field in (self.exposure, self.gain):
            field.setStepType(QAbstractSpinBox.StepType.AdaptiveDecimalStepType)
        for field in self.fields.values():
            field.setSpecialValueText(tr(DEFAULT))
            field.setMinimumWidth(LEAST_LETTERS * field.fontMetrics().averageCharWidth())
            field.valueChanged.connect(lambda _: self.changed.emit())
        self.titles = [label(title, "muted") for title in (tr("Exposure"), tr("Gain"), tr("Binning"))]
        fields = grid(self.titles, self.fields.values(), stretch=(1, 1, 1))
        column(fields, self.in_force, on=self, spacing=4, margins=(0, 0, 0, 0))
        self.show_limits(None, CaptureSettings())

    def settings(self) -> CaptureSettings:
        """The settings to use; None where the camera's default is kept."""
        return CaptureSettings(
            self.exposure.value() if self.exposure.value() > 0 else None,
            self.gain.value() if self.gain.value() > UNSET else None,
            round(self.binning.value()) or None,
        )

    def show_limits(self, limits: CaptureLimits | None, in_force: CaptureSettings) -> None:
        """Restrict the fields to the camera's limits, and hide those it cannot set; None while no camera is open."""
        reasons = {} if limits is None else fixed_settings(limits)
        known = limits or CaptureLimits()
        ranges = known.exposure_s, known.gain, known.binning
        for (name, field), title, limit, most in zip(self.fields.items(), self.titles, ranges, MOST, strict=True):
            field.setEnabled(name not in reasons)
            for part in (title, field):
                part.setVisible(name not in reasons)
            # A lower maximum may change the value, which is no wish of the person.
            with QSignalBlocker(field):
                field.setMaximum(limit[1] if limit else most)
        show_text(self.in_force, "" if limits is None else _in_force_text(in_force, reasons))


def _in_force_text(now: CaptureSettings, reasons: dict[str, str]) -> str:
    parts = [tr("{seconds:g} s", seconds=now.exposure_s)] if now.exposure_s is not None else []
    parts += [tr("gain {gain:g}", gain=now.gain)] if now.gain is not None else []
    parts += [tr("binning {binning}", binning=now.binning)] if now.binning is not None else []
    sentences = [tr("Camera uses {settings}.", settings=", ".join(parts))] if parts else []
    if reasons:
        names = {"exposure": tr("exposure"), "gain": tr("gain"), "binning": tr("binning")}
        fixed = ", ".join(names[name] for name in reasons)
        sentences.append(tr("This camera cannot set {settings}.", settings=fixed))
    return " ".join(sentences)


MARKS = (0.01, 0.1, 0.5)  # of full scale


class LevelView(Histogram):
    """The histogram of the camera's frames, full scale at the right edge."""

    def __init__(self) -> None:
        super().__init__(tr("Histogram of the camera, empty to full"))
        self._levels = Levels()

    def show_levels(self, levels: Levels) -> None:
        """Show the levels of another frame."""
        if levels is not self._levels:
            self._levels = levels
            self.set_counts(levels.counts)

    def make_plot(self) -> "HistogramPlot":
        from kochab.window.charts.histogram_plot import HistogramPlot

        return HistogramPlot(tuple(share ** (1 / AXIS_POWER) for share in MARKS))

    def fill_plot(self) -> None:
        super().fill_plot()
        self.plot.mark_full(self._levels.clipped > 0)


SETTLE_MS = 300  # a key that is held changes a field many times; the camera is set once after the last


class CameraPanel(Page):
    """The choice of a camera and its settings; opens nothing itself."""

    settings_wanted = Signal(object)  # CaptureSettings

    def __init__(self) -> None:
        super().__init__()
        self.box = CameraBox()
        self.lens = text_field(tr("Name of camera and lens"), tr("name it to save its calibration"))
        self.reconnect = switch(tr("Reconnect auto&matically"))
        self.fields = SettingFields()
        self._kept = {"lens": self.lens, "again": self.reconnect, **self.fields.fields}
        self.levels = LevelView()
        self.levels.hide()  # until a frame has been measured
        self.levels_status = label("", "muted", wrap=True)
        self._settle = QTimer(self, singleShot=True, interval=SETTLE_MS)
        self._settle.timeout.connect(lambda: self.settings_wanted.emit(self.fields.settings()))
        self.fields.changed.connect(self._settle.start)
        column(
            self.box,
            row(label(tr("Lens")), (self.lens, 1)),
            *(self.reconnect, self.fields, self.levels, self.levels_status, None),
            on=self,
            spacing=8,
            margins=(10, 10, 10, 10),
        )

    def show_levels(self, levels: Levels) -> None:
        """Histogram and exposure advice for the newest frame."""
        self.levels.show_levels(levels)
        self.levels.setVisible(bool(len(levels.counts)))
        self.levels_status.setText(levels_text(levels))

    def set_running(self, on: bool) -> None:
        """Disable the choice of another camera while one runs."""
        for part in (self.box, self.lens, self.reconnect):
            part.setEnabled(not on)
        if not on:
            self.fields.show_limits(None, CaptureSettings())

    def state(self) -> dict[str, Any]:
        """The choice to save."""
        return {"source": self.box.kind, "where": self.box.address.text(), **field_values(self._kept)}

    def restore(self, saved: dict[str, Any]) -> None:
        """Show a saved choice, as far as it still exists."""
        source, where = saved.get("source"), saved.get("where")
        if isinstance(source, str) and isinstance(where, str):
            self.box.show_selection(CameraSelection(source, where))
        fill_fields(self._kept, saved)
