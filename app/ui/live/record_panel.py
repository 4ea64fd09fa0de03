"""The recording switch: frames and solutions into a folder."""

from pathlib import Path
from typing import Any

from PySide6.QtCore import QSignalBlocker, Signal
from PySide6.QtWidgets import QCheckBox, QGridLayout, QWidget

from app.ui.dialogs import ask_folder
from app.ui.live.recording import Recorded
from app.ui.live.words import recorded_text
from app.ui.widgets import button, label

CANNOT = "This window was started without what writes recordings."


class RecordPanel(QWidget):
    """Says where to record, or None; shows how it does."""

    wanted = Signal(object)  # Path | None

    def __init__(self, can_record: bool) -> None:
        super().__init__()
        self.setObjectName("page")
        self.folder = Path.home() / "Kochab"
        self._red = False
        self.switch = QCheckBox("&Record frames and solutions")
        self.switch.setEnabled(can_record)
        self.switch.toggled.connect(self._toggled)
        self.choose = button("&Into…", self._ask, tip="The folder that sessions are written into")
        self.told = label("", "muted", wrap=True)
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setColumnStretch(0, 1)
        grid.addWidget(self.switch, 0, 0)
        grid.addWidget(self.choose, 0, 1)
        grid.addWidget(self.told, 1, 0, 1, 2)
        self.told.setText(f"Into {self.folder}" if can_record else CANNOT)

    def show_state(self, state: Recorded | None) -> None:
        """How the recording does; the switch goes off when it has ended by itself."""
        if state is None:
            return
        text = recorded_text(state)
        if self.told.text() != text:
            self.told.setText(text)
        if not state.going_on and self.switch.isChecked():
            with QSignalBlocker(self.switch):
                self.switch.setChecked(False)
            self.choose.setEnabled(True)
            self.wanted.emit(None)

    def use_folder(self, folder: Path) -> None:
        """Record there from the next time on."""
        self.folder = folder
        self.told.setText(f"Into {folder}")

    def use_red(self, on: bool) -> None:
        """Whether dialogs are to shine red alone."""
        self._red = on

    def state(self) -> dict[str, Any]:
        """What is to be remembered."""
        return {"record": str(self.folder)}

    def restore(self, kept: dict[str, Any]) -> None:
        """The folder of before."""
        folder = kept.get("record")
        if isinstance(folder, str) and folder:
            self.folder = Path(folder)
            if self.switch.isEnabled():
                self.use_folder(self.folder)

    def _toggled(self, on: bool) -> None:
        self.choose.setEnabled(not on)
        self.wanted.emit(self.folder if on else None)

    def _ask(self) -> None:
        path = ask_folder(self.window(), str(self.folder), "Where to record", self._red)
        if path is not None:
            self.use_folder(path)
