"""The stars of the Laboratory: the open frame's or a simulated field's, and what is told of it."""

from enum import StrEnum
from typing import Any

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QComboBox,
    QDoubleSpinBox,
    QGridLayout,
    QSpinBox,
    QVBoxLayout,
    QWidget,
)

from app.ui.widgets import label
from app.workflows.laboratory import FieldWish

NO_SKY = "This window was started without the simulated sky."


class Source(StrEnum):
    """Where the stars come from."""

    FRAME = "the open frame"
    FIELD = "a simulated field"


class Told(StrEnum):
    """What the methods are told beforehand."""

    SCALE = "the scale"
    PLACE = "scale and place"
    NOTHING = "nothing"


class SetupPanel(QWidget):
    """The stars to work on."""

    changed = Signal()

    def __init__(self, can_simulate: bool) -> None:
        super().__init__()
        self.setObjectName("page")
        self.source = _box("Stars of", Source)
        self.told = _box("Methods are told", Told)
        self.width_deg = _number("Field width", 1.0, 120.0, 20.0, 1, " °")
        self.side_px = _count("Side of the square frame", 128, 16384, 2048, " px")
        self.stars = _count("Number of stars", 3, 200, 20)
        self.noise = _number("Noise of a position", 0.0, 20.0, 0.3, 2, " px")
        self.noise.setToolTip("Noise of a position; in a picture, of that of the faintest star")
        self.false = _count("False stars, per cent of the real ones", 0, 300, 10, " %")
        self.false.setToolTip("False stars, per cent of the real ones; in a picture, hot pixels")
        self.missing = _count("Missing stars, per cent", 0, 95, 10, " %")
        self.seed = _count("Number of the field", 1, 999_999, 1)
        self.fields = _count("Fields for a point of a curve", 1, 1000, 10)
        self.limit = _count("Time limit of a method", 1, 600, 10, " s")
        rows = (
            ("Stars of", self.source), ("Told", self.told),
            ("Field width", self.width_deg), ("Frame", self.side_px),
            ("Stars", self.stars), ("Noise", self.noise),
            ("False stars", self.false), ("Missing", self.missing),
            ("Field no.", self.seed), ("Fields a point", self.fields),
            ("Time limit", self.limit),
        )  # fmt: skip
        grid = QGridLayout()
        grid.setHorizontalSpacing(10)
        grid.setVerticalSpacing(5)
        grid.setColumnStretch(1, 1)
        grid.setColumnStretch(3, 1)
        for number, (title, field) in enumerate(rows):
            grid.addWidget(label(title), number // 2, number % 2 * 2)
            grid.addWidget(field, number // 2, number % 2 * 2 + 1)
        column = QVBoxLayout(self)
        column.setContentsMargins(8, 8, 8, 8)
        column.addLayout(grid)
        if not can_simulate:
            self.source.setEnabled(False)
            column.addWidget(label(NO_SKY, "muted", wrap=True))
        column.addStretch(1)
        self.can_simulate = can_simulate
        self.source.currentIndexChanged.connect(self._source_changed)
        self._source_changed()

    @property
    def wish(self) -> FieldWish:
        """The simulated field that is wanted."""
        return FieldWish(
            self.width_deg.value(), self.stars.value(), self.noise.value(),
            self.false.value() / 100.0, self.missing.value() / 100.0, self.side_px.value(),
        )  # fmt: skip

    @property
    def from_field(self) -> bool:
        """Whether the stars are simulated."""
        return Source(self.source.currentText()) is Source.FIELD

    def state(self) -> dict[str, Any]:
        """What is chosen, to be kept."""
        kept: dict[str, Any] = {name: box.value() for name, box in self._numbers().items()}
        return kept | {"source": self.source.currentText(), "told": self.told.currentText()}

    def restore(self, kept: dict[str, Any]) -> None:
        """Choose what was kept, as far as it still makes sense."""
        for name, box in self._numbers().items():
            value = kept.get(name)
            if not isinstance(value, int | float):
                continue
            if isinstance(box, QDoubleSpinBox):
                box.setValue(float(value))
            else:
                box.setValue(round(value))
        if self.can_simulate:
            self.source.setCurrentText(str(kept.get("source", Source.FRAME)))
        self.told.setCurrentText(str(kept.get("told", Told.SCALE)))

    def _numbers(self) -> dict[str, QSpinBox | QDoubleSpinBox]:
        return {
            "width_deg": self.width_deg, "size_px": self.side_px,
            "stars": self.stars, "noise_px": self.noise,
            "false": self.false, "missing": self.missing, "seed": self.seed,
            "fields": self.fields, "limit_s": self.limit,
        }  # fmt: skip

    def _source_changed(self) -> None:
        self.seed.setEnabled(self.from_field)
        self.changed.emit()


def _box(name: str, words: type[StrEnum]) -> QComboBox:
    made = QComboBox()
    made.addItems([str(word) for word in words])
    made.setAccessibleName(name)
    made.setMinimumContentsLength(10)
    return made


def _number(
    name: str, low: float, high: float, value: float, decimals: int, unit: str
) -> QDoubleSpinBox:
    made = QDoubleSpinBox()
    made.setDecimals(decimals)
    made.setRange(low, high)
    made.setSingleStep(10.0 ** (1 - decimals) if decimals > 1 else 1.0)
    made.setValue(value)
    made.setSuffix(unit)
    made.setAccessibleName(name)
    made.setToolTip(name)
    return made


def _count(name: str, low: int, high: int, value: int, unit: str = "") -> QSpinBox:
    made = QSpinBox()
    made.setRange(low, high)
    made.setValue(value)
    made.setSuffix(unit)
    made.setAccessibleName(name)
    made.setToolTip(name)
    return made
