"""Which camera, and how it is set."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from PySide6.QtCore import QSignalBlocker, QTimer, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QGridLayout,
    QHBoxLayout,
    QLineEdit,
    QVBoxLayout,
    QWidget,
)

from app.cameras import SOURCES
from app.core.capture import CameraDevice, CaptureLimits, CaptureSettings
from app.ui.dialogs import ask_folder
from app.ui.live.brighten import Levels
from app.ui.live.level_view import LevelView
from app.ui.live.setting_fields import SettingFields
from app.ui.live.words import levels_text
from app.ui.widgets import button, label, narrow_box

TITLES = {
    "simulated": "Simulated sky", "folder": "Watched folder", "indi": "INDI server",
    "alpaca": "ASCOM Alpaca", "webcam": "Webcam (UVC)",
}  # fmt: skip
WHERE = {
    "simulated": "new", "folder": "the folder a capture program writes into",
    "indi": "host:port/camera", "alpaca": "host:port/number", "webcam": "the device",
}  # fmt: skip
NONE_FOUND = "No camera of this kind was found; give its address."
SETTLE_MS = 300  # after the last turn of a wheel, before the camera is set


@dataclass(frozen=True, slots=True)
class CameraChoice:
    """What the panel says."""

    source: str
    address: str
    profile: str
    again: bool
    settings: CaptureSettings


class CameraPanel(QWidget):
    """Says what is wanted; opens nothing itself."""

    look_wanted = Signal()  # what can be opened
    settings_wanted = Signal(object)  # CaptureSettings
    chosen = Signal(str, str)  # source and address, by a person

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("page")
        self.source = QComboBox()
        for name in SOURCES:
            self.source.addItem(TITLES.get(name, name), name)
        self.source.setAccessibleName("Kind of camera")
        self.found = narrow_box("Cameras that were found", 12)
        self.look = button("&Find", self.look_wanted.emit, tip="Look for cameras of this kind")
        self.where = QLineEdit()
        self.where.setAccessibleName("Address of the camera")
        self.folder = button("Fo&lder…", self._ask_folder, tip="Choose the folder to watch")
        self.lens = QLineEdit()
        self.lens.setAccessibleName("Name of camera and lens")
        self.lens.setPlaceholderText("a name, to keep what is learned of it")
        self.again = QCheckBox("&Wait for a camera that was lost")
        self.told = label("", "muted", wrap=True)
        self.fields = SettingFields()
        self.levels = LevelView()
        self.levels_told = label("", "muted", wrap=True)
        self._red = False
        self._settle = QTimer(self)
        self._settle.setSingleShot(True)
        self._settle.setInterval(SETTLE_MS)
        self._settle.timeout.connect(lambda: self.settings_wanted.emit(self.fields.settings()))
        self.fields.changed.connect(self._settle.start)
        self.source.currentIndexChanged.connect(self._another_kind)
        self.found.activated.connect(self._activated)
        self.where.editingFinished.connect(self._tell)
        self._lay_out()
        self._another_kind()

    def _lay_out(self) -> None:
        grid = QGridLayout()
        grid.setHorizontalSpacing(10)
        grid.setVerticalSpacing(6)
        grid.setColumnStretch(1, 1)
        rows: tuple[tuple[str, QWidget, QWidget | None], ...] = (
            ("Kind", self.source, None), ("Camera", self.found, self.look),
            ("Address", self.where, self.folder), ("Lens", self.lens, None),
        )  # fmt: skip
        for row, (title, field, beside) in enumerate(rows):
            grid.addWidget(label(title, "muted"), row, 0)
            grid.addWidget(field, row, 1, 1, 1 if beside else 2)
            if beside is not None:
                grid.addWidget(beside, row, 2)
        column = QVBoxLayout(self)
        column.setContentsMargins(10, 10, 10, 10)
        column.setSpacing(8)
        column.addLayout(grid)
        column.addWidget(self.told)
        column.addWidget(self.again)
        column.addWidget(self.fields)
        line = QHBoxLayout()
        line.addWidget(self.levels, 1)
        column.addLayout(line)
        column.addWidget(self.levels_told)
        column.addStretch(1)

    # what it says -----------------------------------------------------------------------------
    @property
    def kind(self) -> str:
        """The chosen source, a name of :data:`app.cameras.SOURCES`."""
        return str(self.source.currentData())

    @property
    def address(self) -> str:
        """Where it is, as typed or picked."""
        return self.where.text().strip()

    def choice(self) -> CameraChoice:
        """What is wanted now."""
        return CameraChoice(
            self.kind, self.address, self.lens.text().strip(),
            self.again.isChecked(), self.fields.settings(),
        )  # fmt: skip

    # what it shows ----------------------------------------------------------------------------
    def show_found(self, devices: list[CameraDevice]) -> None:
        """What can be opened; the first one, unless an address was given."""
        with QSignalBlocker(self.found):
            self.found.clear()
            for device in devices:
                self.found.addItem(device.description, device.address)
            self.found.setToolTip("\n".join(f"{d.address}: {d.description}" for d in devices))
            self.found.setEnabled(bool(devices))
            at = self.found.findData(self.address)
            self.found.setCurrentIndex(max(at, 0) if devices else -1)
        silent = bool(devices) or self.kind == "folder"
        self.say("" if silent else NONE_FOUND)
        if devices and not self.address:
            self._picked(0)

    def say(self, sentence: str) -> None:
        """One sentence about the choice, such as how to get what is missing."""
        self.told.setText(sentence)
        self.told.setVisible(bool(sentence))

    def show_limits(self, limits: CaptureLimits, in_force: CaptureSettings) -> None:
        """What can be set on the open camera, and what it does now."""
        self.fields.show_limits(limits, in_force)

    def show_levels(self, levels: Levels) -> None:
        """How the newest frame is exposed."""
        self.levels.show_levels(levels)
        self.levels_told.setText(levels_text(levels))

    def run(self, on: bool) -> None:
        """Whether the camera runs: it cannot be changed for another then."""
        for field in (self.source, self.where, self.lens, self.folder, self.look, self.again):
            field.setEnabled(not on)
        self.found.setEnabled(not on and self.found.count() > 0)
        if not on:
            self.fields.show_limits(None, CaptureSettings())

    def use_red(self, on: bool) -> None:
        """Whether dialogs are to shine red alone."""
        self._red = on

    # memory -----------------------------------------------------------------------------------
    def state(self) -> dict[str, Any]:
        """What is to be remembered."""
        return {
            "source": self.kind, "where": self.where.text(), "lens": self.lens.text(),
            "again": self.again.isChecked(), **self.fields.state(),
        }  # fmt: skip

    def show_choice(self, source: str, address: str) -> None:
        """Say what was chosen elsewhere in the window."""
        at = self.source.findData(source)
        if at >= 0:
            self.source.setCurrentIndex(at)
            self.where.setText(address)

    def restore(self, kept: dict[str, Any]) -> None:
        """Say what was said before, as far as it is still known."""
        at = self.source.findData(kept.get("source"))
        self.source.setCurrentIndex(max(at, 0))
        for field, name in ((self.where, "where"), (self.lens, "lens")):
            if isinstance(kept.get(name), str):
                field.setText(kept[name])
        self.again.setChecked(kept.get("again") is True)
        self.fields.restore(kept)

    # its own ----------------------------------------------------------------------------------
    def _another_kind(self) -> None:
        self.where.clear()
        self.found.clear()
        self.where.setPlaceholderText(WHERE.get(self.kind, ""))
        self.folder.setVisible(self.kind == "folder")
        self.found.setVisible(self.kind != "folder")
        self.look.setVisible(self.kind != "folder")
        self.say("")
        self.look_wanted.emit()

    def _picked(self, index: int) -> None:
        address = self.found.itemData(index)
        if isinstance(address, str):
            self.where.setText(address)

    def _activated(self, index: int) -> None:
        self._picked(index)
        self._tell()

    def _tell(self) -> None:
        if self.address:
            self.chosen.emit(self.kind, self.address)

    def _ask_folder(self) -> None:
        start = self.where.text() or str(Path.home())
        path = ask_folder(self.window(), start, "The folder to watch", self._red)
        if path is not None:
            self.where.setText(str(path))
            self._tell()
