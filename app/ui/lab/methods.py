"""What stands in the Laboratory: methods, detectors or estimators, and the options of each."""

from dataclasses import dataclass, field
from typing import Any

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QComboBox,
    QHBoxLayout,
    QListWidget,
    QListWidgetItem,
    QVBoxLayout,
    QWidget,
)

from app.core.errors import UsageError
from app.ui.options_form import OptionsForm
from app.ui.widgets import label, scrolled
from app.workflows.laboratory import Choice
from app.workflows.laboratory_kinds import Kind, allowed, names_of, options_for, paper_for

ROW_PX = 6  # of a row, beside its letters
TITLES = {
    Kind.METHOD: "Methods of identification",
    Kind.DETECTOR: "Star detectors",
    Kind.ATTITUDE: "Attitude estimators",
}


@dataclass(slots=True)
class Chosen:
    """What is chosen of one kind: names, their options, and the sentences of wrong options."""

    ticked: list[str]
    options: dict[str, dict[str, Any]] = field(default_factory=dict)
    faults: dict[str, str] = field(default_factory=dict)


class MethodsPanel(QWidget):
    """A list to tick for each kind; the highlighted one's options stand beside it."""

    kind_changed = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("page")
        self._chosen = {kind: Chosen(names_of(kind)) for kind in Kind}
        self._shown = ""
        self.kinds = QComboBox()
        self.kinds.setAccessibleName("What is compared")
        self.kinds.setMinimumContentsLength(10)
        for kind, title in TITLES.items():
            self.kinds.addItem(title, kind)
        self.list = QListWidget()
        self.list.setSpacing(1)
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        rows = max(len(names_of(kind)) for kind in Kind)
        self.list.setMinimumHeight(rows * (self.list.fontMetrics().height() + ROW_PX))
        self.options = OptionsForm()
        self.paper = label("", "muted", wrap=True)
        left, right = QVBoxLayout(), QVBoxLayout()
        left.addWidget(self.kinds)
        left.addWidget(self.list, 1)
        right.addWidget(self.paper)
        right.addWidget(scrolled(self.options), 1)
        line = QHBoxLayout(self)
        line.setContentsMargins(8, 8, 8, 8)
        line.setSpacing(10)
        line.addLayout(left, 2)
        line.addLayout(right, 3)
        self.options.changed.connect(self._keep)
        self.list.currentItemChanged.connect(self._show)
        self.list.itemChanged.connect(self._keep_ticks)
        self.kinds.currentIndexChanged.connect(self._show_kind)
        self._show_kind()

    @property
    def kind(self) -> Kind:
        """What is compared."""
        return Kind(self.kinds.currentData())

    def choose(self, kind: Kind) -> None:
        """Compare these."""
        self.kinds.setCurrentIndex(list(TITLES).index(kind))

    def choices(self) -> list[Choice]:
        """The ticked ones; UsageError when an option of one is not allowed."""
        chosen = self._chosen[self.kind]
        for name in chosen.ticked:
            if name in chosen.faults:
                raise UsageError(f"{self.kind.capitalize()} {name}: {chosen.faults[name]}")
        if not chosen.ticked:
            raise UsageError(f"Tick at least one {self.kind}.")
        return [Choice(name, chosen.options.get(name, {})) for name in chosen.ticked]

    def tick(self, names: list[str]) -> None:
        """Tick these and no others."""
        for item in self._items():
            on = item.text() in names
            item.setCheckState(Qt.CheckState.Checked if on else Qt.CheckState.Unchecked)

    # what is kept -----------------------------------------------------------------------------
    def state(self) -> dict[str, Any]:
        """What is chosen, to be kept."""
        kept: dict[str, Any] = {
            kind: {"ticked": chosen.ticked, "options": chosen.options}
            for kind, chosen in self._chosen.items()
        }
        return kept | {"compared": self.kind}

    def restore(self, kept: dict[str, Any]) -> None:
        """Choose what was kept, as far as it is still known and allowed."""
        for kind in Kind:
            if isinstance(kept.get(kind), dict):
                self._restore_kind(kind, kept[kind])
        if kept.get("compared") in list(Kind):
            self.choose(Kind(kept["compared"]))
        self._show_kind()

    def _restore_kind(self, kind: Kind, kept: dict[str, Any]) -> None:
        ticked, options = kept.get("ticked"), kept.get("options")
        if isinstance(ticked, list):
            self._chosen[kind].ticked = [name for name in names_of(kind) if name in ticked]
        for name, values in options.items() if isinstance(options, dict) else ():
            try:
                plain = {k: tuple(v) if isinstance(v, list) else v for k, v in values.items()}
                self._chosen[kind].options[name] = allowed(kind, name, plain)
            except (UsageError, AttributeError):
                continue

    # what is shown ----------------------------------------------------------------------------
    def _items(self) -> list[QListWidgetItem]:
        return [self.list.item(i) for i in range(self.list.count())]

    def _show_kind(self) -> None:
        ticked = self._chosen[self.kind].ticked
        self.list.blockSignals(True)
        self.list.clear()
        for name in names_of(self.kind):
            item = QListWidgetItem(name, self.list)
            item.setFlags(item.flags() | Qt.ItemFlag.ItemIsUserCheckable)
            on = name in ticked
            item.setCheckState(Qt.CheckState.Checked if on else Qt.CheckState.Unchecked)
        self.list.setCurrentRow(0)
        self.list.blockSignals(False)
        self.list.setAccessibleName(f"{TITLES[self.kind]}; space ticks one")
        self._show(self.list.currentItem())
        self.kind_changed.emit()

    def _show(self, item: QListWidgetItem | None, _: object = None) -> None:
        if item is None:
            return
        name, chosen = item.text(), self._chosen[self.kind]
        self._shown = ""  # filling in is not changing
        self.options.show_options(options_for(self.kind, name))
        self.options.fill(chosen.options.get(name, {}))
        chosen.faults.pop(name, None)
        self._shown = name
        self.paper.setText(paper_for(self.kind, name))

    def _keep(self) -> None:
        if not self._shown:
            return
        chosen = self._chosen[self.kind]
        try:
            chosen.options[self._shown] = self.options.values()
            chosen.faults.pop(self._shown, None)
        except UsageError as error:
            chosen.faults[self._shown] = str(error)

    def _keep_ticks(self) -> None:
        self._chosen[self.kind].ticked = [i.text() for i in self._items() if _is_ticked(i)]


def _is_ticked(item: QListWidgetItem) -> bool:
    return item.checkState() is Qt.CheckState.Checked
