"""The one owner of a window's cameras: which was chosen, which were found, and which are open."""

from PySide6.QtCore import QObject, Signal

from app.cameras.shared import Share, SharedCameras
from app.core.capture import CameraDevice, CaptureSettings
from app.core.progress import Progress, Task
from app.ui.job import Job
from app.ui.services import Jobs


class Cameras(QObject):
    """Views choose here, and hear what another has chosen; a camera is opened here, once for all.

    ``choice`` is the source and address that were chosen last since the window opened.
    """

    chosen = Signal(str, str)  # source, a name of app.cameras.SOURCES, and its address
    found = Signal(str, list)  # source and its CameraDevices
    missed = Signal(str, str)  # source, and why it cannot be asked
    gone = Signal(str, str)  # source and address of a camera that will not come back

    def __init__(self, jobs: Jobs) -> None:
        super().__init__(jobs)
        self.choice: tuple[str, str] | None = None
        self._jobs = jobs
        self._open = SharedCameras()
        self._looking: dict[str, Job] = {}

    def choose(self, source: str, address: str) -> None:
        """Remember which camera a person wants to use, and let the other views take it over."""
        if source and (source, address) != self.choice:
            self.choice = source, address
            self.chosen.emit(source, address)

    def forget(self, source: str, address: str) -> None:
        """Tell that this camera is there no more."""
        if self.choice == (source, address):
            self.choice = None
        self.gone.emit(source, address)

    def look(self, source: str, address: str = "") -> None:
        """Look for cameras of one kind; the newest answer alone is told."""
        before = self._looking.pop(source, None)
        if before is not None:
            before.abandon()
        self._looking[source] = job = self._jobs.run(_devices(source, address), "cameras")
        job.succeeded.connect(lambda devices: self.found.emit(source, devices))
        job.failed.connect(lambda sentence: self.missed.emit(source, sentence))

    @property
    def looking(self) -> bool:
        """Whether some kind of camera is being looked for."""
        return any(job.running for job in self._looking.values())

    def open(
        self, source: str, address: str = "", settings: CaptureSettings | None = None
    ) -> Share:
        """A share of this camera, from any thread; DeviceError when it cannot be opened."""
        return self._open.open(source, address, settings)


def _devices(source: str, address: str) -> Task[list[CameraDevice]]:
    from app.cameras import list_devices

    yield Progress("look for cameras")
    return list_devices(source, address)
