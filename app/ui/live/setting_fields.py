"""Exposure, gain and binning: what is wished for, and what the camera allows."""

from typing import Any

from PySide6.QtCore import QSignalBlocker, Signal
from PySide6.QtWidgets import QAbstractSpinBox, QDoubleSpinBox, QGridLayout, QSpinBox, QWidget

from app.core.capture import CaptureLimits, CaptureSettings
from app.ui.live.words import cannot
from app.ui.widgets import label

OWN = "camera’s own"
UNSET = -1.0
LONGEST_S, MOST_GAIN, MOST_BINNING = 3600.0, 1e6, 16


class SettingFields(QWidget):
    """The lowest value of each field leaves the choice to the camera."""

    changed = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("page")
        self.exposure = _number("Exposure", LONGEST_S, 4, " s")
        self.gain = _number("Gain, in the camera’s own units", MOST_GAIN, 1)
        self.binning = QSpinBox()
        self.binning.setRange(0, MOST_BINNING)
        self.binning.setSpecialValueText(OWN)
        self.binning.setAccessibleName("Binning")
        self.in_force = label("", "muted", wrap=True)
        self.fields: dict[str, QAbstractSpinBox] = {
            "exposure": self.exposure, "gain": self.gain, "binning": self.binning,
        }  # fmt: skip
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setHorizontalSpacing(10)
        grid.setVerticalSpacing(4)
        for column, (name, field) in enumerate(self.fields.items()):
            grid.addWidget(label(name.capitalize(), "muted"), 0, column)
            grid.addWidget(field, 1, column)
            grid.setColumnStretch(column, 1)
        grid.addWidget(self.in_force, 2, 0, 1, 3)
        for field in (self.exposure, self.gain):
            field.valueChanged.connect(lambda _: self.changed.emit())
        self.binning.valueChanged.connect(lambda _: self.changed.emit())
        self.show_limits(None, CaptureSettings())

    def settings(self) -> CaptureSettings:
        """What is wished for; None for what is left to the camera."""
        return CaptureSettings(
            self.exposure.value() if self.exposure.value() > 0 else None,
            self.gain.value() if self.gain.value() > UNSET else None,
            self.binning.value() or None,
        )

    def show_limits(self, limits: CaptureLimits | None, in_force: CaptureSettings) -> None:
        """Allow what the camera allows, everything while none is open (None)."""
        reasons = {} if limits is None else cannot(limits)
        for name, field in self.fields.items():
            field.setEnabled(name not in reasons)
            field.setToolTip(reasons.get(name, ""))
            field.setAccessibleDescription(reasons.get(name, ""))
        known = limits or CaptureLimits()
        with (
            QSignalBlocker(self.exposure),
            QSignalBlocker(self.gain),
            QSignalBlocker(self.binning),
        ):
            self.exposure.setMaximum(known.exposure_s[1] if known.exposure_s else LONGEST_S)
            self.gain.setMaximum(known.gain[1] if known.gain else MOST_GAIN)
            self.binning.setMaximum(known.binning[1] if known.binning else MOST_BINNING)
        self.in_force.setText("" if limits is None else _told(in_force, reasons))
        self.in_force.setVisible(bool(self.in_force.text()))

    def state(self) -> dict[str, Any]:
        """What is to be remembered."""
        told = self.settings()
        return {"exposure": told.exposure_s, "gain": told.gain, "binning": told.binning}

    def restore(self, kept: dict[str, Any]) -> None:
        """Wish for what was wished for before."""
        for field, name, unset in ((self.exposure, "exposure", 0.0), (self.gain, "gain", UNSET)):
            value = kept.get(name)
            field.setValue(float(value) if isinstance(value, int | float) else unset)
        binning = kept.get("binning")
        self.binning.setValue(binning if isinstance(binning, int) else 0)


def _number(name: str, most: float, decimals: int, unit: str = "") -> QDoubleSpinBox:
    made = QDoubleSpinBox()
    made.setDecimals(decimals)
    made.setRange(0.0 if unit else UNSET, most)
    made.setSpecialValueText(OWN)
    made.setSuffix(unit)
    made.setStepType(QAbstractSpinBox.StepType.AdaptiveDecimalStepType)
    made.setAccessibleName(name)
    made.setValue(made.minimum())
    return made


def _told(now: CaptureSettings, reasons: dict[str, str]) -> str:
    """What is in force, and what cannot be set."""
    parts = [f"{now.exposure_s:g} s"] if now.exposure_s is not None else []
    parts += [f"gain {now.gain:g}"] if now.gain is not None else []
    parts += [f"binning {now.binning}"] if now.binning is not None else []
    said = f"In force: {', '.join(parts)}." if parts else ""
    if reasons:
        said += f" Not to be set on this camera: {', '.join(reasons)}."
    return said.strip()
