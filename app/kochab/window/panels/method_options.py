"""The choice of method, detector and attitude estimator, with the method's options as fields."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QCheckBox, QGroupBox, QLineEdit, QWidget

from kochab.attitude import ESTIMATORS
from kochab.core.errors import UsageError
from kochab.core.registry import Option, options_of
from kochab.identification import IDENTIFIERS
from kochab.text.translation import tr, tr_noop
from kochab.window.dialogs import redden_caret
from kochab.window.widgets import (
    Page,
    choice_box,
    clear_layout,
    column,
    field_value,
    fill_fields,
    form,
    grid,
    label,
    set_property,
    show_text,
)

NOTHING = tr_noop("No options.")
SHOWN_AS_THEY_ARE = ("switch", "choice")  # kinds of options; all others are typed


class OptionsForm(Page):
    """Fields for a method's :class:`kochab.core.registry.Option`; an empty one means the default."""

    changed = Signal()

    def __init__(self, options: Sequence[Option] = ()) -> None:
        super().__init__()
        self._options: tuple[Option, ...] = ()
        self.fields: dict[str, QWidget] = {}
        self._grid = grid(across=10, down=5, stretch=(0, 1), on=self)
        self._grid.setContentsMargins(0, 0, 0, 0)
        self.show_options(options)

    def show_options(self, options: Sequence[Option]) -> None:
        clear_layout(self._grid)
        self._options, self.fields = tuple(options), {}
        for row, option in enumerate(self._options):
            self.fields[option.name] = field = self._field(option)
            self._grid.addWidget(title := label(_title(option)), row, 0)
            title.setToolTip(_tip(option))
            self._grid.addWidget(field, row, 1)
            unit = "" if option.unit == option.name else option.unit
            self._grid.addWidget(label(unit, "muted"), row, 2)
        # Rows of the method before keep their stretch.
        for row in range(self._grid.rowCount()):
            self._grid.setRowStretch(row, 0)
        self._grid.setRowStretch(max(1, len(self._options)), 1)
        if not self._options:
            self._grid.addWidget(label(tr(NOTHING), "muted", wrap=True), 0, 0, 1, 3)

    def values(self) -> dict[str, Any]:
        """What differs from the defaults; UsageError says which value is not allowed."""
        found = {option.name: self._value(option) for option in self._options}
        return {o.name: found[o.name] for o in self._options if found[o.name] != o.value}

    def fill(self, values: dict[str, Any]) -> None:
        """Show ``values`` of some options and the defaults of all others."""
        shown = {option.name: option.value for option in self._options} | values
        for option in self._options:
            if option.kind not in SHOWN_AS_THEY_ARE:
                value = shown[option.name]
                shown[option.name] = "" if value == option.value else replace(option, value=value).value_text
        fill_fields(self.fields, shown)

    def _field(self, option: Option) -> QWidget:
        made: QWidget
        if option.kind == "switch":
            made = box = QCheckBox()
            box.setChecked(bool(option.value))
            box.toggled.connect(lambda _: self.changed.emit())
        elif option.kind == "choice":
            made = words = choice_box(_title(option), option.choices)
            words.setCurrentText(str(option.value))
            words.currentTextChanged.connect(lambda _: self.changed.emit())
        else:
            made = line = QLineEdit()
            line.setPlaceholderText(option.value_text)
            redden_caret(line)
            line.textChanged.connect(lambda _: self._check(option))
        made.setAccessibleName(_title(option))
        made.setAccessibleDescription(_tip(option))
        made.setToolTip(_tip(option))
        return made

    def _value(self, option: Option) -> Any:
        shown = field_value(self.fields[option.name])
        if option.kind in SHOWN_AS_THEY_ARE:
            return shown
        text = str(shown).strip().replace("−", "-")
        # The default as it is shown may be rounded.
        return option.parse(_points(option, text)) if text not in ("", option.value_text) else option.value

    def _check(self, option: Option) -> None:
        wrong = False
        try:
            self._value(option)
        except UsageError:
            wrong = True
        set_property(self.fields[option.name], "wrong", wrong)
        self.changed.emit()


def _points(option: Option, text: str) -> str:
    """``text`` with decimal points; a comma or semicolon separates the numbers of a pair."""
    if option.kind == "pair" and ";" not in text:
        return text
    return text.replace(",", ".").replace(";", ",")


def _title(option: Option) -> str:
    """``separation_deg`` as "Separation": the unit is beside the field."""
    name = option.name
    for ending in ("_deg", "_px", "_urad", "_arcsec", "_s"):
        name = name.removesuffix(ending)
    return tr(name.replace("_", " ").capitalize())


def _tip(option: Option) -> str:
    text = tr(option.text)
    sentence = f"{text[:1].upper()}{text[1:]}: {option.range_text}."
    return " ".join([sentence, tr("Absent: {meaning}.", meaning=tr(option.none))] if option.none else [sentence])


FITTED = tr_noop("fit with the camera")


class MethodGroup(QGroupBox):
    """The choices of ``--method``, ``--detector`` and ``--attitude``."""

    def __init__(self, methods: list[str], detectors: list[str]) -> None:
        super().__init__(tr("Method"))
        self.method, self.detector = choice_box(tr("Method"), methods), choice_box(tr("Detector"), detectors)
        self.attitude = choice_box(tr("Attitude"), [tr(FITTED), *ESTIMATORS])
        self.method.currentTextChanged.connect(self._show_method)
        self.paper = label("", "muted", wrap=True)
        self.options = OptionsForm()
        boxes = form((tr("&Method"), self.method), (tr("Dete&ctor"), self.detector), (tr("&Attitude"), self.attitude))
        column(boxes, self.paper, self.options, on=self)
        self.paper.hide()
        self.options.hide()

    def choices(self) -> dict[str, Any]:
        """For :class:`kochab.solver.SolveOptions`; UsageError when an option is not allowed."""
        try:
            options = self.options.values()
        except UsageError as error:
            name = self.method.currentText()
            raise UsageError("Method {name}: {error}", name=name, error=error) from error
        fitted = self.attitude.currentIndex() == 0
        return {
            "method": self.method.currentText(),
            "method_options": options,
            "detector": self.detector.currentText(),
            "attitude": None if fitted else self.attitude.currentText(),
        }

    def reset(self) -> None:
        for box in (self.method, self.detector, self.attitude):
            box.setCurrentIndex(0)

    def _show_method(self, name: str) -> None:
        try:
            method = IDENTIFIERS.load(name)
            options, paper = options_of(method), str(getattr(method, "paper", ""))
        except UsageError as error:  # of another package that cannot be loaded
            options, paper = (), str(error)
        self.options.show_options(options)
        self.options.setVisible(bool(options))
        show_text(self.paper, paper)
