"""The Laboratory's stars: the open frame or a simulated field, and what the methods know of it."""

from enum import StrEnum
from typing import Any

from PySide6.QtWidgets import QDoubleSpinBox

from kochab.window.widgets import Page, choice_box, column, field_values, fill_fields, grid, label, number_field


class StarSource(StrEnum):
    """Where the stars come from."""

    FRAME = "open frame"
    FIELD = "simulated field"


class Hints(StrEnum):
    """What the methods know of the pointing."""

    SCALE = "pixel scale"
    POSITION = "pixel scale and position"
    NOTHING = "nothing"


# name: (title, tip, lowest, highest, default, decimals, unit)
NUMBERS: dict[str, tuple[str, str, float, float, float, int, str]] = {
    "width_deg": ("Field width", "Field of view of the simulated frame", 1, 120, 20, 1, " °"),
    "size_px": ("Frame", "Side of the square frame", 128, 16384, 2048, 0, " px"),
    "stars": ("Stars", "Number of stars", 3, 200, 20, 0, ""),
    "noise_px": ("Noise", "Position noise; in an image, that of the faintest star", 0, 20, 0.3, 2, " px"),
    "false": ("False stars", "False stars, % of the real ones; in an image, hot pixels", 0, 300, 10, 0, " %"),
    "missing": ("Missing", "Stars that were not detected", 0, 95, 10, 0, " %"),
    "seed": ("Field no.", "Number of the simulated field", 1, 999_999, 1, 0, ""),
    "fields": ("Fields per point", "Simulated fields for each point of a curve", 1, 1000, 10, 0, ""),
    "limit_s": ("Time limit", "Time limit of a method", 1, 600, 10, 0, " s"),
}


class LaboratorySetupPanel(Page):
    """The fields of :data:`NUMBERS` with the source of the stars and the hints."""

    def __init__(self) -> None:
        super().__init__()
        self.source = choice_box("Stars from", StarSource, 10)
        self.hints = choice_box("Known in advance", Hints, 10)
        self.numbers = {name: _number(*made[1:]) for name, made in NUMBERS.items()}
        self._kept = {**self.numbers, "source": self.source, "hints": self.hints}
        titles = ("Stars from", "Known", *(title for title, *_ in NUMBERS.values()))
        fields = (self.source, self.hints, *self.numbers.values())
        cells = [cell for title, field in zip(titles, fields, strict=True) for cell in (label(title), field)]
        rows = (cells[at : at + 4] for at in range(0, len(cells), 4))
        form = grid(*rows, down=5, stretch=(0, 1, 0, 1))
        column(form, None, on=self, margins=(8, 8, 8, 8))
        self.source.currentIndexChanged.connect(self._enable)
        self._enable()

    def number(self, name: str) -> int:
        """The whole number in a field."""
        return round(self.numbers[name].value())

    @property
    def field(self) -> tuple[float, int, float, float, float, int]:
        """What the simulated fields are like, as :func:`kochab.lab.laboratory.comparison.field_plan` takes it."""
        value = {name: field.value() for name, field in self.numbers.items()}
        false, missing = value["false"] / 100.0, value["missing"] / 100.0
        return value["width_deg"], self.number("stars"), value["noise_px"], false, missing, self.number("size_px")

    @property
    def from_field(self) -> bool:
        return StarSource(self.source.currentText()) is StarSource.FIELD

    def state(self) -> dict[str, Any]:
        return field_values(self._kept)

    def restore(self, kept: dict[str, Any]) -> None:
        """Choose what was kept, as far as it still makes sense."""
        fill_fields(self._kept, kept)

    def _enable(self) -> None:
        self.numbers["seed"].setEnabled(self.from_field)


def _number(tip: str, low: float, high: float, value: float, decimals: int, unit: str) -> QDoubleSpinBox:
    made = number_field(tip, low, high, value, decimals, unit, tip)
    made.setSingleStep(10.0 ** (1 - decimals) if decimals > 1 else 1.0)
    return made
