"""One alignment from Begin to its end, in a job of its own or on the line of the mount it turns."""

from PySide6.QtCore import QObject, Signal

from app.core.errors import UsageError
from app.core.progress import Progress, Task
from app.mounts.guard import Guard
from app.polar.history import History
from app.ui.job import Job
from app.ui.mount.desk import PRACTISE_LATER, Desk
from app.ui.mount.errand import Errand
from app.ui.mount.known import MAY_MOVE, POLAR
from app.ui.mount.reasons import BUSY
from app.ui.polar.tools import Tools
from app.ui.polar.wish import AlignWish, Hand, Source
from app.ui.polar.work import working
from app.ui.services import Services
from app.workflows.polar_update import PolarControls

NO_MOUNT = "No mount is known yet: connect it once in the Mount view (F3), or turn by hand."
SLEWING = "The mount slews: wait until it stands, or stop it."
MOVING = ("opening", "turn", "settle")
OTHER_SKY = (
    "The practice telescope is connected: choose it above, or end the practice in the Mount view"
    " (F3)."
)


def stands(progress: Progress) -> bool:
    """Whether the alignment does not move the mount: a loose cable then costs no measurement."""
    return progress.stage not in MOVING


class Run(QObject):
    """Carries what the alignment's thread tells into the window's; an older run is not heard."""

    step = Signal(object)  # Progress
    kept = Signal(object)  # History
    practising = Signal(object)  # Practice

    def __init__(self, services: Services, wish: AlignWish, parent: QObject) -> None:
        super().__init__(parent)
        self.controls = PolarControls()
        self._services, self._wish = services, wish
        self._desk = services.mount
        self._tools = Tools(
            self.controls, self.step.emit, self.kept.emit, self.practising.emit,
            services.wiring.practice, lambda: self._desk.practice, services.cameras.open,
        )  # fmt: skip

    def start(self) -> Job | Errand:
        """Begin; what is returned tells of the end and can be cancelled.

        Raises
        ------
        KochabError
            It cannot be begun now; one sentence.

        """
        wish = self._wish
        if wish.source is Source.FILES:
            return self._services.jobs.run(working(wish, self._tools), POLAR)
        if wish.hand is Hand.PERSON:
            return self._by_hand()
        made = self._connect()
        errand = self._desk.order(POLAR, self._on_line, stands)
        if made:  # a practice telescope that was begun for this ends with it
            errand.finished.connect(self._desk.disconnect_mount)
        return errand

    def _by_hand(self) -> Job:
        """A person turns the axis: meanwhile nobody sends the mount anywhere."""
        desk = self._desk
        if desk.known.busy in MAY_MOVE:
            raise UsageError(BUSY.format(desk.known.user))
        if desk.known.slewing:
            raise UsageError(SLEWING)
        job = self._services.jobs.run(working(self._wish, self._tools), POLAR)
        desk.leave_to_hand(True)
        job.finished.connect(lambda: desk.leave_to_hand(False))
        return job

    def _connect(self) -> bool:
        """See to it that the right mount is connected; whether a practice night was begun."""
        desk, wish = self._desk, self._wish
        practise = wish.source is Source.PRACTICE
        if desk.known.phase == "off":
            self._open(desk)
            return practise
        if practise != desk.known.practice:
            raise UsageError(PRACTISE_LATER if practise else OTHER_SKY)
        if wish.site is not None:
            desk.use_site(wish.site)
        return False

    def _open(self, desk: Desk) -> None:
        if self._wish.source is Source.PRACTICE:
            desk.practise()
        elif self._wish.mount is None:
            raise UsageError(NO_MOUNT)
        else:
            desk.connect_mount(self._wish.mount)

    def _on_line(self, guard: Guard) -> Task[History]:
        """In the thread of the mount's line; the Mount view's camera is let go for this."""
        self._desk.lookout.close()
        return working(self._wish, self._tools, guard)
