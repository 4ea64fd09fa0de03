"""What is picked for an alignment from outside: files, the open frame, cameras that are found."""

from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QFileDialog

from app.core.progress import Progress, Task
from app.ui.polar.setup import SetupPanel
from app.ui.red_light import RedLight
from app.ui.services import Services

FRAMES = "Frames (*.fit *.fits *.fts *.xisf *.cr2 *.cr3 *.nef *.arw *.dng *.tif *.tiff *.png *.jpg)"


class Chooser(QObject):
    """Answers the buttons of a :class:`SetupPanel`."""

    said = Signal(str, str)  # a sentence and its role

    def __init__(self, setup: SetupPanel, services: Services) -> None:
        super().__init__(setup)
        self._setup, self._services = setup, services
        setup.files_wanted.connect(self._ask_files)
        setup.open_frame_wanted.connect(self._add_open_frame)
        setup.devices_wanted.connect(self._find_devices)

    def _ask_files(self, second: bool) -> None:
        start = self._services.settings.text("folder", str(Path.home()))
        dialog = QFileDialog(
            self._setup.window(), "Frames to measure", start, f"{FRAMES};;All files (*)"
        )
        dialog.setFileMode(QFileDialog.FileMode.ExistingFiles)
        if self._services.looks.is_night:
            dialog.setOption(QFileDialog.Option.DontUseNativeDialog)
            dialog.setGraphicsEffect(RedLight(dialog))
        if dialog.exec():
            self._setup.add_files([Path(p) for p in dialog.selectedFiles()], int(second))
        dialog.deleteLater()

    def _add_open_frame(self) -> None:
        path = self._services.session.known.path
        if path is None:
            self.said.emit("Open a frame first.", "muted")
        else:
            self._setup.add_files([path])

    def _find_devices(self, source: str, address: str) -> None:
        def looking() -> Task[Any]:
            from app.cameras import list_devices

            yield Progress("devices")
            return list_devices(source, address)

        job = self._services.jobs.run(looking(), "devices")
        job.succeeded.connect(self._found)
        job.failed.connect(lambda sentence: self.said.emit(sentence, "wrong"))

    def _found(self, devices: list[Any]) -> None:
        self._setup.show_devices(devices)
        self.said.emit("" if devices else "No camera of this kind was found.", "muted")
