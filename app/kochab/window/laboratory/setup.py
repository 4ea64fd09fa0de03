"""What the Laboratory compares, with the options of each, and on which stars."""

from dataclasses import field
from enum import StrEnum
from typing import Any

from PySide6.QtCore import QSignalBlocker, Qt
from PySide6.QtWidgets import QDoubleSpinBox, QListWidget, QListWidgetItem

from kochab.core.errors import UsageError
from kochab.core.registry import checked, options_of
from kochab.core.values import mutable
from kochab.lab.laboratory.comparison import REGISTRIES, Choice, ComparedPart, in_words, paper_for
from kochab.text.translation import tr, tr_noop
from kochab.window.panels.method_options import OptionsForm
from kochab.window.widgets import (
    Page,
    choice_box,
    column,
    field_values,
    fill_fields,
    grid,
    label,
    number_field,
    scrolled,
)

ROW_PX = 6  # of a row, above and below its text
CHECKED = {True: Qt.CheckState.Checked, False: Qt.CheckState.Unchecked}
KINDS = {
    ComparedPart.METHOD: tr_noop("Identification"),
    ComparedPart.DETECTOR: tr_noop("Detection"),
    ComparedPart.ATTITUDE: tr_noop("Attitude"),
}


ONE = {
    ComparedPart.METHOD: tr_noop("Tick at least one method."),
    ComparedPart.DETECTOR: tr_noop("Tick at least one detector."),
    ComparedPart.ATTITUDE: tr_noop("Tick at least one attitude."),
}


@mutable
class MethodChoice:
    """What is chosen of one kind: names, their options, and why options are not allowed."""

    ticked: list[str]
    options: dict[str, dict[str, Any]] = field(default_factory=dict)
    faults: dict[str, str] = field(default_factory=dict)


class MethodsPanel(Page):
    """A list to tick for each kind, beside the options of the highlighted one."""

    def __init__(self) -> None:
        super().__init__()
        self._chosen = {kind: MethodChoice(list(REGISTRIES[kind])) for kind in ComparedPart}
        self.kinds = choice_box(tr("Compare"), {tr(title): kind for kind, title in KINDS.items()}, 10)
        self.list = QListWidget()
        self.list.setSpacing(1)
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        rows = max(len(REGISTRIES[kind]) for kind in ComparedPart)
        self.list.setMinimumHeight(rows * (self.list.fontMetrics().height() + ROW_PX))
        self.options = OptionsForm()
        self.paper = label("", "muted", wrap=True)
        above, below = (self.kinds, self.paper), (self.list, scrolled(self.options))
        panes = grid(above, below, down=6, stretch=(2, 3), on=self)
        panes.setContentsMargins(8, 8, 8, 8)
        panes.setRowStretch(1, 1)
        self.options.changed.connect(self._keep)
        self.list.currentItemChanged.connect(self._show)
        self.list.itemChanged.connect(self._keep_ticks)
        self.kinds.currentIndexChanged.connect(self._show_kind)
        self._show_kind()

    @property
    def kind(self) -> ComparedPart:
        return ComparedPart(self.kinds.currentData())

    def choose(self, kind: ComparedPart) -> None:
        self.kinds.setCurrentIndex(list(KINDS).index(kind))

    def choices(self) -> list[Choice]:
        """What is ticked; UsageError when an option is not allowed."""
        chosen = self._chosen[self.kind]
        for name in chosen.ticked:
            if name in chosen.faults:
                raise UsageError(
                    "{tr} {name}: {faults}", tr=tr(self.kind.capitalize()), name=name, faults=chosen.faults[name]
                )
        if not chosen.ticked:
            raise UsageError(ONE[self.kind])
        return [Choice(name, chosen.options.get(name, {})) for name in chosen.ticked]

    def tick(self, names: list[str]) -> None:
        for item in self._items():
            item.setCheckState(CHECKED[_name(item) in names])

    def state(self) -> dict[str, Any]:
        kept: dict[str, Any] = {
            kind: {"ticked": chosen.ticked, "options": chosen.options} for kind, chosen in self._chosen.items()
        }
        return kept | {"compared": self.kind}

    def restore(self, kept: dict[str, Any]) -> None:
        """Choose what was kept, as far as it is still known and allowed."""
        for kind in ComparedPart:
            if isinstance(kept.get(kind), dict):
                self._restore_kind(kind, kept[kind])
        if kept.get("compared") in list(ComparedPart):
            self.choose(ComparedPart(kept["compared"]))
        self._show_kind()

    def _restore_kind(self, kind: ComparedPart, kept: dict[str, Any]) -> None:
        ticked, options = kept.get("ticked"), kept.get("options")
        if isinstance(ticked, list):
            self._chosen[kind].ticked = [name for name in REGISTRIES[kind] if name in ticked]
        for name, values in options.items() if isinstance(options, dict) else ():
            try:
                plain = {k: tuple(v) if isinstance(v, list) else v for k, v in values.items()}
                self._chosen[kind].options[name] = checked(REGISTRIES[kind].load(name), plain)
            except (UsageError, AttributeError):
                continue

    def _items(self) -> list[QListWidgetItem]:
        return [self.list.item(i) for i in range(self.list.count())]

    def _show_kind(self) -> None:
        ticked = self._chosen[self.kind].ticked
        # Else a tick that is shown would be kept as the person's before the rest of the list is there.
        with QSignalBlocker(self.list):
            self.list.clear()
            for name in REGISTRIES[self.kind]:
                item = QListWidgetItem(in_words(name), self.list)
                item.setData(Qt.ItemDataRole.UserRole, name)
                item.setFlags(item.flags() | Qt.ItemFlag.ItemIsUserCheckable)
                item.setCheckState(CHECKED[name in ticked])
            self.list.setCurrentRow(0)
        self.list.setMinimumWidth(self.list.sizeHintForColumn(0) + 2 * self.list.frameWidth() + ROW_PX)
        self.list.setAccessibleName(tr("{kinds}; space ticks one", kinds=tr(KINDS[self.kind])))
        self._show(self.list.currentItem())

    def _show(self, item: QListWidgetItem | None, _: object = None) -> None:
        if item is None:
            return
        name, chosen = _name(item), self._chosen[self.kind]
        with QSignalBlocker(self.options):  # filling the fields is no change by the person
            self.options.show_options(options_of(REGISTRIES[self.kind].load(name)))
            self.options.fill(chosen.options.get(name, {}))
        chosen.faults.pop(name, None)
        self.paper.setText(paper_for(self.kind, name))

    def _keep(self) -> None:
        name, chosen = _name(self.list.currentItem()), self._chosen[self.kind]
        try:
            chosen.options[name] = self.options.values()
            chosen.faults.pop(name, None)
        except UsageError as error:
            chosen.faults[name] = str(error)

    def _keep_ticks(self) -> None:
        self._chosen[self.kind].ticked = [_name(i) for i in self._items() if i.checkState() is CHECKED[True]]


def _name(item: QListWidgetItem) -> str:
    """The name by which a row's method is registered."""
    return str(item.data(Qt.ItemDataRole.UserRole))


# -- The stars: the open frame or a simulated field, and what the methods know of it --


class StarSource(StrEnum):
    """Where the stars come from."""

    FRAME = tr_noop("open frame")
    FIELD = tr_noop("simulated field")


class Hints(StrEnum):
    """What the methods know of the pointing."""

    SCALE = tr_noop("pixel scale")
    POSITION = tr_noop("pixel scale and position")
    NOTHING = tr_noop("nothing")


NOISE_TIP = tr_noop("Position noise; in an image, that of the faintest star")
FALSE_TIP = tr_noop("False stars, % of the real ones; in an image, hot pixels")
# name: (title, tip, lowest, highest, default, decimals, unit)
NUMBERS: dict[str, tuple[str, str, float, float, float, int, str]] = {
    "width_deg": (tr_noop("Field width"), tr_noop("Field of view of the simulated frame"), 1, 120, 20, 1, " °"),
    "size_px": (tr_noop("Frame"), tr_noop("Side of the square frame"), 128, 16384, 2048, 0, tr_noop(" px")),
    "stars": (tr_noop("Stars"), tr_noop("Number of stars"), 3, 200, 20, 0, ""),
    "noise_px": (tr_noop("Noise"), NOISE_TIP, 0, 20, 0.3, 2, " px"),
    "false": (tr_noop("False stars"), FALSE_TIP, 0, 300, 10, 0, " %"),
    "missing": (tr_noop("Missing"), tr_noop("Stars that were not detected"), 0, 95, 10, 0, " %"),
    "seed": (tr_noop("Field no."), tr_noop("Number of the simulated field"), 1, 999_999, 1, 0, ""),
    "fields": (tr_noop("Fields per point"), tr_noop("Simulated fields for each point of a curve"), 1, 1000, 10, 0, ""),
    "limit_s": (tr_noop("Time limit"), tr_noop("Time limit of a method"), 1, 600, 10, 0, " s"),
}


class LaboratorySetupPanel(Page):
    """The fields of :data:`NUMBERS` with the source of the stars and the hints."""

    def __init__(self) -> None:
        super().__init__()
        self.source = choice_box(tr("Stars from"), {tr(source): source for source in StarSource}, 10)
        self.hints = choice_box(tr("Known in advance"), {tr(hint): hint for hint in Hints}, 10)
        self.numbers = {name: _number(*made[1:]) for name, made in NUMBERS.items()}
        self._kept = {**self.numbers, "source": self.source, "hints": self.hints}
        titles = (tr("Stars from"), tr("Known"), *(tr(title) for title, *_ in NUMBERS.values()))
        fields = (self.source, self.hints, *self.numbers.values())
        rows = ((label(title), field) for title, field in zip(titles, fields, strict=True))
        form = grid(*rows, down=5, stretch=(0, 1))
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
        return StarSource(self.source.currentData()) is StarSource.FIELD

    def state(self) -> dict[str, Any]:
        return field_values(self._kept)

    def restore(self, kept: dict[str, Any]) -> None:
        """Choose what was kept, as far as it still makes sense."""
        fill_fields(self._kept, kept)

    def _enable(self) -> None:
        self.numbers["seed"].setEnabled(self.from_field)


def _number(tip: str, low: float, high: float, value: float, decimals: int, unit: str) -> QDoubleSpinBox:
    made = number_field(tr(tip), low, high, value, decimals, tr(unit), tr(tip))
    made.setSingleStep(10.0 ** (1 - decimals) if decimals > 1 else 1.0)
    return made
