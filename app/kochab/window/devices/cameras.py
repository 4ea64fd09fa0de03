"""The cameras of a window, shared by its views, and the fields to choose one."""

from collections.abc import Callable, Iterable
from pathlib import Path

from PySide6.QtCore import QObject, QSignalBlocker, Signal
from PySide6.QtWidgets import QDoubleSpinBox, QWidget

from kochab.core.capture import CameraDevice, CaptureSettings
from kochab.core.progress import Progress, Task
from kochab.gear.cameras import SOURCES
from kochab.gear.cameras.shared_cameras import Share, SharedCameras
from kochab.gear.session import CameraSelection
from kochab.text.translation import tr, tr_noop
from kochab.window.dialogs import ask_folder
from kochab.window.job import Job, Jobs
from kochab.window.widgets import (
    button,
    choice_box,
    column,
    label,
    narrow_box,
    number_field,
    row,
    show_text,
    text_field,
)


class Cameras(QObject):
    """Finds and opens cameras for all views; ``choice`` is the source and address chosen last."""

    chosen = Signal(str, str)  # source, a name of kochab.gear.cameras.SOURCES, and its address
    found = Signal(str, list)  # source and its CameraDevices
    missed = Signal(str, str)  # source, and why its cameras cannot be listed
    gone = Signal(str, str)  # source and address of a camera that will not come back

    def __init__(self, jobs: Jobs) -> None:
        super().__init__(jobs)
        self.choice: tuple[str, str] | None = None
        self._jobs = jobs
        self._open = SharedCameras()
        self._looking: dict[str, Job] = {}

    def choose(self, source: str, address: str) -> None:
        """Remember the person's choice of camera for every view."""
        if source and (source, address) != self.choice:
            self.choice = source, address
            self.chosen.emit(source, address)

    def forget(self, source: str, address: str) -> None:
        """A camera that is gone; no view goes on offering it."""
        if self.choice == (source, address):
            self.choice = None
        self.gone.emit(source, address)

    def look(self, source: str, address: str = "") -> None:
        """Find cameras of one kind; a search under way is abandoned."""
        if (before := self._looking.pop(source, None)) is not None:
            before.abandon()
        self._looking[source] = job = self._jobs.run(_devices(source, address), "cameras")
        job.succeeded.connect(lambda devices: self.found.emit(source, devices))
        job.failed.connect(lambda sentence: self.missed.emit(source, sentence))

    @property
    def looking(self) -> bool:
        return any(job.running for job in self._looking.values())

    def open(self, source: str, address: str = "", settings: CaptureSettings | None = None) -> Share:
        """A share of this camera, from any thread; DeviceError when it cannot be opened."""
        return self._open.open(source, address, settings)


def _devices(source: str, address: str) -> Task[list[CameraDevice]]:
    from kochab.gear.cameras import list_devices

    yield Progress(tr_noop("look for cameras"))
    return list_devices(source, address)


TITLES = {
    "": tr_noop("None (use the open image)"),
    "simulated": tr_noop("Simulated sky"),
    "folder": tr_noop("Watched folder"),
    "indi": tr_noop("INDI server"),
    "alpaca": tr_noop("ASCOM Alpaca"),
    "webcam": tr_noop("Webcam (UVC)"),
}
EXAMPLES = {
    "folder": tr_noop("folder your capture program saves to"),
    "indi": tr_noop("host:7624/Camera name"),
    "alpaca": "host:11111/0",
    "webcam": tr_noop("/dev/video0 or an address"),
}
UNLISTED = ("", "folder")  # kinds that have no cameras to be found
NONE_FOUND = tr_noop("No camera found. Enter its address.")
EXPOSURE_S = (0.001, 60.0)


class CameraBox(QWidget):
    """The choice of a camera: its kind, one that was found or an address, and the exposure.

    ``at_once`` is for a view whose camera is in use as soon as it is chosen: it can have none, has
    its exposure here, and takes a found camera only when it is the only one.
    """

    chosen = Signal(object)  # CameraSelection or None, by a person
    look_wanted = Signal(str, str)  # source, address

    def __init__(self, sources: Iterable[str] = tuple(SOURCES), at_once: bool = False) -> None:
        super().__init__()
        self._at_once = at_once
        self._note = self._missed = ""
        kinds = ("", *sources) if at_once else sources
        self.source = choice_box(tr("Kind of camera"), {tr(TITLES.get(name, name)): name for name in kinds}, 0)
        self.found = narrow_box(tr("Cameras that were found"), 12)
        self.look = button(tr("F&ind"), self.search, tip=tr("Search for cameras of this kind"))
        self.address = text_field(tr("Address of the camera"))
        self.folder = button(tr("F&older…"), self._ask_folder, tip=tr("Choose the folder to watch"))
        self.exposure = number_field(tr("Exposure in seconds"), *EXPOSURE_S, 2.0, 3, tr(" s"))
        self.exposure.setStepType(QDoubleSpinBox.StepType.AdaptiveDecimalStepType)
        self.status = label("", "muted", wrap=True)
        column(
            row(label(tr("Camera")), (self.source, 1), self.exposure),
            row((self.found, 1), self.look),
            row((self.address, 1), self.folder),
            self.status,
            on=self,
            spacing=6,
            margins=(0, 0, 0, 0),
        )
        self.exposure.setVisible(at_once)  # not before it has a parent: it would be a window
        self.source.currentIndexChanged.connect(self._kind_changed)
        self.found.activated.connect(self._take)
        self.address.editingFinished.connect(self._emit)
        self.exposure.editingFinished.connect(self._emit)
        self._arrange()

    def follow(self, cameras: Cameras, is_free: Callable[[], bool] = lambda: True) -> None:
        """Use ``cameras`` to search, show what they find and, while ``is_free``, adopt another view's choice."""
        self.look_wanted.connect(cameras.look)
        cameras.found.connect(self.show_found)
        cameras.missed.connect(self.show_missed)
        self._is_free = is_free
        cameras.chosen.connect(self._adopt)
        if cameras.choice is not None:
            self._adopt(*cameras.choice)

    def _adopt(self, source: str, address: str) -> None:
        if self._is_free() and not self._at_once:  # else its view takes the camera into use
            self.show_selection(CameraSelection(source, address))

    @property
    def kind(self) -> str:
        """The chosen source, a name of :data:`kochab.gear.cameras.SOURCES`; empty for no camera."""
        return str(self.source.currentData())

    @property
    def selection(self) -> CameraSelection | None:
        """The chosen camera; None for no camera."""
        if not self.kind:
            return None
        return CameraSelection(self.kind, self.address.text().strip(), self.exposure.value())

    def show_selection(self, selection: CameraSelection) -> None:
        """Show a choice made elsewhere; one that cannot be made here is ignored."""
        at = self.source.findData(selection.source)
        if at < 0:
            return
        other = at != self.source.currentIndex()
        # A choice made elsewhere must not be told as one made here, which would also clear the address.
        with QSignalBlocker(self.source):
            self.source.setCurrentIndex(at)
        self.address.setText(selection.address)
        self.exposure.setValue(selection.exposure_s)
        self._arrange()
        if other:
            self.found.clear()
            self.search()
        self._point_out()

    def search(self) -> None:
        """Search for cameras of the chosen kind."""
        if not self.found.isHidden():
            self.look_wanted.emit(self.kind, self.address.text().strip())

    def show_note(self, note: str) -> None:
        """Show a sentence about the camera in use; an empty one removes it."""
        if note != self._note:
            self._note = note
            self._show_status()

    def show_found(self, source: str, devices: list[CameraDevice]) -> None:
        """List the cameras found, and fill in the first unless one was chosen."""
        if source != self.kind:
            return
        self.found.clear()
        for device in devices:
            self.found.addItem(device.description, device.address)
        self.found.setToolTip("\n".join(f"{d.address}: {d.description}" for d in devices))
        self.found.setEnabled(bool(devices))
        if devices and not self.address.text().strip() and not (self._at_once and len(devices) > 1):
            self.address.setText(devices[0].address)
            if self._at_once:
                self._emit()
        self._point_out()
        self._missed = "" if devices or self.kind in UNLISTED else tr(NONE_FOUND)
        self._show_status()

    def show_missed(self, source: str, sentence: str) -> None:
        """Show why cameras of this kind cannot be listed, such as a missing package."""
        if source == self.kind:
            self.show_found(source, [])
            self._missed = sentence
            self._show_status()

    def _kind_changed(self) -> None:
        self.address.clear()
        self.found.clear()
        self._missed = ""
        self._arrange()
        self._emit()
        self.search()

    def _take(self, index: int) -> None:
        self.address.setText(str(self.found.itemData(index)))
        self._emit()

    def _ask_folder(self) -> None:
        start = self.address.text() or str(Path.home())
        if (path := ask_folder(self.window(), start, tr("Folder to watch"))) is not None:
            self.address.setText(str(path))
            self._emit()

    def _emit(self) -> None:
        # Without an address there is nothing to use yet; with at_once the choice may be no camera.
        if self._at_once or self.address.text().strip():
            self.chosen.emit(self.selection)

    def _point_out(self) -> None:
        self.found.setCurrentIndex(self.found.findData(self.address.text().strip()))

    def _arrange(self) -> None:
        self.address.setPlaceholderText(tr(EXAMPLES.get(self.kind, "")))
        self.address.setVisible(self.kind not in ("", "simulated"))  # that one is chosen in the list alone
        self.folder.setVisible(self.kind == "folder")
        listed = self.kind not in UNLISTED
        self.found.setVisible(listed)
        self.look.setVisible(listed)
        self.exposure.setEnabled(listed)  # a folder's frames are exposed by another program
        self._show_status()

    def _show_status(self) -> None:
        show_text(self.status, self._note or self._missed)
