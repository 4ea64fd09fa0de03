"""Which methods stand in the Laboratory, and the options of each."""

from typing import Any

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QHBoxLayout, QListWidget, QListWidgetItem, QVBoxLayout, QWidget

from app.core.errors import UsageError
from app.identify import IDENTIFIERS
from app.identify.options import checked_options, method_options, paper_of
from app.ui.options_form import OptionsForm
from app.ui.widgets import label, scrolled
from app.workflows.laboratory import Choice


class MethodsPanel(QWidget):
    """A list to tick; the highlighted method's options stand beside it."""

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("page")
        self.list = QListWidget()
        self.list.setAccessibleName("Methods; space ticks one")
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        for name in IDENTIFIERS:
            item = QListWidgetItem(name, self.list)
            item.setFlags(item.flags() | Qt.ItemFlag.ItemIsUserCheckable)
            item.setCheckState(Qt.CheckState.Checked)
        self.options = OptionsForm()
        self.options.changed.connect(self._keep)
        self.paper = label("", "muted", wrap=True)
        self.changed_options: dict[str, dict[str, Any]] = {}
        self._faults: dict[str, str] = {}
        self._shown = ""
        line = QHBoxLayout(self)
        line.setContentsMargins(8, 8, 8, 8)
        line.addWidget(self.list, 2)
        column = QVBoxLayout()
        column.addWidget(self.paper)
        column.addWidget(scrolled(self.options), 1)
        line.addLayout(column, 3)
        self.list.currentItemChanged.connect(self._show)
        self.list.setCurrentRow(0)

    def choices(self) -> list[Choice]:
        """The ticked methods; UsageError when an option of one is not allowed."""
        ticked = [item.text() for item in self._items() if _is_ticked(item)]
        for name in ticked:
            if name in self._faults:
                raise UsageError(f"Method {name}: {self._faults[name]}")
        if not ticked:
            raise UsageError("Tick at least one method.")
        return [Choice(name, self.changed_options.get(name, {})) for name in ticked]

    def tick(self, names: list[str]) -> None:
        """Tick these and no others."""
        for item in self._items():
            on = item.text() in names
            item.setCheckState(Qt.CheckState.Checked if on else Qt.CheckState.Unchecked)

    def state(self) -> dict[str, Any]:
        """What is chosen, to be kept."""
        return {
            "ticked": [item.text() for item in self._items() if _is_ticked(item)],
            "options": self.changed_options,
        }

    def restore(self, kept: dict[str, Any]) -> None:
        """Choose what was kept, as far as it is still known and allowed."""
        ticked, options = kept.get("ticked"), kept.get("options")
        if isinstance(ticked, list):
            self.tick(ticked)
        for name, values in options.items() if isinstance(options, dict) else ():
            try:
                plain = {k: tuple(v) if isinstance(v, list) else v for k, v in values.items()}
                self.changed_options[name] = checked_options(name, plain)
            except (UsageError, AttributeError):
                continue
        self._show(self.list.currentItem())

    def _items(self) -> list[QListWidgetItem]:
        return [self.list.item(i) for i in range(self.list.count())]

    def _show(self, item: QListWidgetItem | None, _: object = None) -> None:
        name = item.text() if item is not None else ""
        if not name:
            return
        self._shown = ""  # filling in is not changing
        self.options.show_options(method_options(name))
        self.options.fill(self.changed_options.get(name, {}))
        self._faults.pop(name, None)
        self._shown = name
        self.paper.setText(paper_of(name) or "Kochab’s own")

    def _keep(self) -> None:
        if not self._shown:
            return
        try:
            self.changed_options[self._shown] = self.options.values()
            self._faults.pop(self._shown, None)
        except UsageError as error:
            self._faults[self._shown] = str(error)


def _is_ticked(item: QListWidgetItem) -> bool:
    return item.checkState() is Qt.CheckState.Checked
