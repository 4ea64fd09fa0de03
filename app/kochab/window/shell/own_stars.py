"""A quiet line, once: a deeper star catalogue was found on this computer, and whether to use it."""

from PySide6.QtCore import QObject, QTimer, Signal
from PySide6.QtWidgets import QWidget

from kochab.core.progress import Progress, Task
from kochab.sky import user_catalogues
from kochab.sky.user_catalogues import UserCatalogue, Where
from kochab.text.translation import tr
from kochab.window.job import Jobs
from kochab.window.shell.status import Status
from kochab.window.widgets import button, label, row


def deepest() -> Task[Where | None]:
    """The catalogue with the most stars in the usual folders; None: there is none that is deeper than the shipped."""
    best, most = None, SHIPPED_DEG2
    for where in user_catalogues.found():
        yield Progress("catalog")
        try:
            density = user_catalogues.open_user_catalogue(where).reach().density_deg2
        except user_catalogues.CatalogueError:
            continue
        if density > most:
            best, most = where, density
    return best


SHIPPED_DEG2 = 60.0
"""Stars a square degree that are shipped, and a few more."""


class OwnStars(QObject):
    """Looks for a catalogue in a job some time after the start, and asks in the status bar."""

    answered = Signal()

    def __init__(self, status: Status, jobs: Jobs, after_ms: int) -> None:
        super().__init__(status)
        self._status, self._jobs = status, jobs
        self._where: Where | None = None
        self.question = label("", "muted")
        self.use = button(
            tr("Use it"), self._use, "small", tr("Solve fields narrower than 1° whose position is known.")
        )
        self.not_now = button(tr("No"), self._decline, "small", tr("Use only the shipped stars."))
        self.line = QWidget()
        row(self.question, self.use, self.not_now, on=self.line, spacing=6).setContentsMargins(0, 0, 8, 0)
        self.line.hide()
        status.addPermanentWidget(self.line)
        self.line.hide()  # a status bar shows what it is given
        self._timer = QTimer(self, singleShot=True, interval=after_ms)
        self._timer.timeout.connect(self.look)
        if not user_catalogues.asked_before():
            self._timer.start()

    def look(self) -> None:
        """Look for catalogues and ask about the deepest."""
        self._jobs.run(deepest(), "catalogues").succeeded.connect(self._found)

    def _found(self, where: Where | None) -> None:
        if where is None or user_catalogues.asked_before():
            return
        self._where = where
        self.question.setText(tr("{name} was found. Use its stars?", name=where.title))
        self.question.setToolTip(str(where.path))
        self.line.show()

    def _use(self) -> None:
        assert self._where is not None
        job = self._jobs.run(user_catalogues.choose_at(self._where), "catalogue")
        job.succeeded.connect(self._chosen)
        job.failed.connect(self._failed)

    def _chosen(self, catalogue: UserCatalogue) -> None:
        self.line.hide()
        self._status.showMessage(tr("Using {catalogue}.", catalogue=f"{catalogue.kind} {catalogue.name}"), 8000)
        self.answered.emit()

    def _failed(self, sentence: str) -> None:
        self.line.hide()
        self._status.showMessage(sentence, 15_000)
        self.answered.emit()

    def _decline(self) -> None:
        user_catalogues.forget()
        self.line.hide()
        self.answered.emit()
