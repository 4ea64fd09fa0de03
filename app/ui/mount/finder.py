"""Find my mount: the ports of the computer, and which mount answers on them."""

from functools import partial

from PySide6.QtCore import QObject, Signal

from app.core.progress import Progress
from app.mounts.ports import PortInfo
from app.mounts.probe import Diagnosis
from app.ui.job import Job
from app.ui.mount import search
from app.ui.mount.connect_box import ConnectBox
from app.ui.services import Jobs


class Finder(QObject):
    """Fills a :class:`ConnectBox`; one search at a time."""

    said = Signal(str, str)  # a sentence and its role
    progressed = Signal(object)  # Progress, or None when it is over

    def __init__(self, box: ConnectBox, jobs: Jobs) -> None:
        super().__init__(box)
        self._box, self._jobs = box, jobs
        self._job: Job | None = None
        box.find_wanted.connect(self.find)

    @property
    def running(self) -> bool:
        """Whether it is asking round."""
        return self._job is not None

    def list_ports(self) -> None:
        """List the ports, without asking anything of them."""
        job = self._jobs.run(search.ports(), "ports")
        job.succeeded.connect(self._box.show_ports)

    def find(self) -> None:
        """The serial doctor, on every port."""
        self.cancel()
        self._job = job = self._jobs.run(search.find(self._box.wished_port), "find")
        job.progressed.connect(self.progressed)
        job.succeeded.connect(self._found)
        job.failed.connect(lambda sentence: self.said.emit(sentence, "wrong"))
        job.cancelled.connect(lambda: self.said.emit("Not looked any further.", "muted"))
        job.finished.connect(partial(self._over, job))
        self.progressed.emit(Progress("looking for ports"))

    def cancel(self) -> None:
        """Look no further."""
        if self._job is not None:
            self._job.cancel()

    def _over(self, job: Job) -> None:
        if job is self._job:
            self._job = None
            self.progressed.emit(None)

    def _found(self, result: tuple[list[PortInfo], list[Diagnosis]]) -> None:
        listed, found = result
        self._box.show_ports(listed)
        mount = next((one for one in found if one.found), None)
        if mount is not None:
            self._box.show_found(mount)
            self._box.connect_button.setFocus()
        self.said.emit(search.words(found), "good" if mount else "wrong")
