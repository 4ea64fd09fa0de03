"""What the Laboratory compares: methods, detectors or estimators, and the options of each."""

from dataclasses import dataclass, field
from typing import Any

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import QListWidget, QListWidgetItem

from kochab.core.errors import UsageError
from kochab.core.registry import checked, options_of
from kochab.lab.laboratory.comparison import REGISTRIES, Choice, ComparedPart, paper_for
from kochab.window.panels.method_options import OptionsForm
from kochab.window.widgets import Page, choice_box, grid, label, scrolled

ROW_PX = 6  # of a row, above and below its text
CHECKED = {True: Qt.CheckState.Checked, False: Qt.CheckState.Unchecked}
TITLES = {
    ComparedPart.METHOD: "Identification methods",
    ComparedPart.DETECTOR: "Star detectors",
    ComparedPart.ATTITUDE: "Attitude estimators",
}


@dataclass(slots=True)
class MethodChoice:
    """What is chosen of one kind: names, their options, and why options are not allowed."""

    ticked: list[str]
    options: dict[str, dict[str, Any]] = field(default_factory=dict)
    faults: dict[str, str] = field(default_factory=dict)


class MethodsPanel(Page):
    """A list to tick for each kind, beside the options of the highlighted one."""

    kind_changed = Signal()

    def __init__(self) -> None:
        super().__init__()
        self._chosen = {kind: MethodChoice(list(REGISTRIES[kind])) for kind in ComparedPart}
        self.kinds = choice_box("Compare", {title: kind for kind, title in TITLES.items()}, 10)
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
        self.kinds.setCurrentIndex(list(TITLES).index(kind))

    def choices(self) -> list[Choice]:
        """What is ticked; UsageError when an option is not allowed."""
        chosen = self._chosen[self.kind]
        for name in chosen.ticked:
            if name in chosen.faults:
                raise UsageError(f"{self.kind.capitalize()} {name}: {chosen.faults[name]}")
        if not chosen.ticked:
            raise UsageError(f"Tick at least one {self.kind}.")
        return [Choice(name, chosen.options.get(name, {})) for name in chosen.ticked]

    def tick(self, names: list[str]) -> None:
        for item in self._items():
            item.setCheckState(CHECKED[item.text() in names])

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
        with QSignalBlocker(self.list):
            self.list.clear()
            for name in REGISTRIES[self.kind]:
                item = QListWidgetItem(name, self.list)
                item.setFlags(item.flags() | Qt.ItemFlag.ItemIsUserCheckable)
                item.setCheckState(CHECKED[name in ticked])
            self.list.setCurrentRow(0)
        self.list.setAccessibleName(f"{TITLES[self.kind]}; space ticks one")
        self._show(self.list.currentItem())
        self.kind_changed.emit()

    def _show(self, item: QListWidgetItem | None, _: object = None) -> None:
        if item is None:
            return
        name, chosen = item.text(), self._chosen[self.kind]
        with QSignalBlocker(self.options):  # filling the fields is no change by the person
            self.options.show_options(options_of(REGISTRIES[self.kind].load(name)))
            self.options.fill(chosen.options.get(name, {}))
        chosen.faults.pop(name, None)
        self.paper.setText(paper_for(self.kind, name))

    def _keep(self) -> None:
        name, chosen = self.list.currentItem().text(), self._chosen[self.kind]
        try:
            chosen.options[name] = self.options.values()
            chosen.faults.pop(name, None)
        except UsageError as error:
            chosen.faults[name] = str(error)

    def _keep_ticks(self) -> None:
        self._chosen[self.kind].ticked = [i.text() for i in self._items() if i.checkState() is CHECKED[True]]
