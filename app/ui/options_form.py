"""The options of a method as fields to fill in, each with its unit, range and meaning."""

from collections.abc import Sequence
from typing import Any

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QCheckBox, QComboBox, QGridLayout, QLineEdit, QWidget

from app.core.errors import UsageError
from app.core.options import Option
from app.ui.red_light import dress_field
from app.ui.widgets import label

NOTHING = "There is nothing to set here."


class OptionsForm(QWidget):
    """Made from :class:`app.core.options.Option`; an empty field means the method's own value."""

    changed = Signal()

    def __init__(self, options: Sequence[Option] = ()) -> None:
        super().__init__()
        self.setObjectName("page")
        self._options: tuple[Option, ...] = ()
        self.fields: dict[str, QWidget] = {}
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setHorizontalSpacing(10)
        self._grid.setVerticalSpacing(5)
        self._grid.setColumnStretch(1, 1)
        self.show_options(options)

    def show_options(self, options: Sequence[Option]) -> None:
        """Other options, at their defaults."""
        while (item := self._grid.takeAt(0)) is not None:
            if (old := item.widget()) is not None:
                old.hide()
                old.deleteLater()
        self._options, self.fields = tuple(options), {}
        for row, option in enumerate(self._options):
            field = self._field(option)
            self.fields[option.name] = field
            title = label(_title(option))
            title.setToolTip(_tip(option))
            self._grid.addWidget(title, row, 0)
            self._grid.addWidget(field, row, 1)
            unit = "" if option.unit == option.name else option.unit
            self._grid.addWidget(label(unit, "muted"), row, 2)
        for row in range(self._grid.rowCount()):
            self._grid.setRowStretch(row, 0)
        self._grid.setRowStretch(max(1, len(self._options)), 1)
        if not self._options:
            self._grid.addWidget(label(NOTHING, "muted", wrap=True), 0, 0, 1, 3)

    def values(self) -> dict[str, Any]:
        """What differs from the defaults; UsageError with one sentence when it is not allowed."""
        found = {option.name: self._value(option) for option in self._options}
        return {o.name: found[o.name] for o in self._options if found[o.name] != o.value}

    def fill(self, values: dict[str, Any]) -> None:
        """Show ``values`` of some options and the defaults of all others."""
        for option in self._options:
            self._show(option, values.get(option.name, option.value))

    def _field(self, option: Option) -> QWidget:
        made: QWidget
        if option.kind == "switch":
            made = box = QCheckBox()
            box.setChecked(bool(option.value))
            box.toggled.connect(lambda _: self.changed.emit())
        elif option.kind == "choice":
            made = words = QComboBox()
            words.addItems(list(option.choices))
            words.setCurrentText(str(option.value))
            words.currentTextChanged.connect(lambda _: self.changed.emit())
        else:
            made = line = QLineEdit()
            line.setPlaceholderText(option.value_text)
            dress_field(line)
            line.textChanged.connect(lambda _: self._check(option))
        made.setAccessibleName(_title(option))
        made.setAccessibleDescription(_tip(option))
        made.setToolTip(_tip(option))
        return made

    def _value(self, option: Option) -> Any:
        field = self.fields[option.name]
        if isinstance(field, QCheckBox):
            return field.isChecked()
        if isinstance(field, QComboBox):
            return field.currentText()
        assert isinstance(field, QLineEdit)
        text = field.text().strip().replace("−", "-")
        # The default as it is shown may be rounded.
        return (
            option.parse(_points(option, text))
            if text not in ("", option.value_text)
            else option.value
        )

    def _show(self, option: Option, value: Any) -> None:
        field = self.fields[option.name]
        if isinstance(field, QCheckBox):
            field.setChecked(bool(value))
        elif isinstance(field, QComboBox):
            field.setCurrentText(str(value))
        elif isinstance(field, QLineEdit):
            field.setText("" if value == option.value else _text(option, value))

    def _check(self, option: Option) -> None:
        field = self.fields[option.name]
        try:
            self._value(option)
            wrong = False
        except UsageError:
            wrong = True
        field.setProperty("wrong", wrong)
        field.style().unpolish(field)
        field.style().polish(field)
        self.changed.emit()


def _points(option: Option, text: str) -> str:
    """``text`` with decimal points; the two numbers of a pair stand apart by comma or semicolon."""
    if option.kind == "pair" and ";" not in text:
        return text
    return text.replace(",", ".").replace(";", ",")


def _title(option: Option) -> str:
    """``separation_deg`` as "separation": the unit stands beside the field."""
    name = option.name
    for ending in ("_deg", "_px", "_urad", "_arcsec", "_s"):
        name = name.removesuffix(ending)
    return name.replace("_", " ").capitalize()


def _tip(option: Option) -> str:
    absent = f" Absent: {option.none}." if option.none else ""
    return f"{option.text[:1].upper()}{option.text[1:]}: {option.range_text}.{absent}"


def _text(option: Option, value: Any) -> str:
    if value is None:
        return "none"
    return ",".join(f"{v:g}" for v in value) if isinstance(value, tuple) else f"{value:g}"
