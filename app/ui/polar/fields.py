"""Small fields of the set-up, each with its name for a screen reader."""

from PySide6.QtWidgets import QComboBox, QDoubleSpinBox, QLineEdit, QSpinBox

from app.ui.widgets import narrow_box


def choice(name: str, texts: list[str] | None = None) -> QComboBox:
    """One of several; no wider than a narrow dock."""
    made = narrow_box(name, 8)
    made.addItems(texts or [])
    return made


def whole(name: str, low: int, high: int, value: int, unit: str) -> QSpinBox:
    """A whole number with its unit."""
    made = QSpinBox()
    made.setRange(low, high)
    made.setValue(value)
    made.setSuffix(unit)
    made.setAccessibleName(name)
    return made


def seconds(name: str, low: float, high: float, value: float) -> QDoubleSpinBox:
    """A time."""
    made = QDoubleSpinBox()
    made.setRange(low, high)
    made.setSuffix(" s")
    made.setValue(value)
    made.setAccessibleName(name)
    return made


def text(name: str, example: str) -> QLineEdit:
    """A line that shows an example until something is typed."""
    made = QLineEdit()
    made.setAccessibleName(name)
    made.setPlaceholderText(example)
    return made
