"""What every view of the Tools menu is given: small, frozen, and nothing behind it."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject, Signal

from app.core.progress import Task
from app.ui.frame_view import FrameView
from app.ui.job import Job
from app.ui.looks import Looks
from app.ui.main_window import MainWindow
from app.ui.session import Session
from app.ui.settings import Settings
from app.ui.wiring import Wiring
from app.ui.workspace import Workspace

if TYPE_CHECKING:
    from app.sky import Catalogue
    from app.ui.cameras import Cameras
    from app.ui.mount.desk import Desk

log = logging.getLogger("kochab")
JOIN_S = 5.0


class Jobs(QObject):
    """Starts the views' jobs and ends them with the window."""

    closing = Signal()

    def __init__(self, window: MainWindow) -> None:
        super().__init__(window)
        self._jobs: list[Job] = []
        window.closing.connect(self._close)

    def run(self, task: Task[Any], name: str) -> Job:
        """Start ``task`` in a thread; its signals may be connected after this.

        They are delivered by the event loop, so that none can be missed.
        """
        job = Job(task, name)
        self._jobs = [j for j in self._jobs if j.running] + [job]
        job.start()
        return job

    def _close(self) -> None:
        self.closing.emit()  # a view may want to stop a mount first
        for job in self._jobs:
            job.abandon()
        for job in self._jobs:
            if not job.join(JOIN_S):
                log.warning("%s did not end in time", job.name)


@dataclass(frozen=True)
class Services:
    """What a view may use of the window.

    ``session`` has the open frame and its answer (``session.known``) and signals when they change
    (``opened``, ``solved``, ``unsolved``). ``looks`` has the theme's ``colours``, ``is_night``, and
    the signal ``changed``. ``jobs.run(task, name)`` runs a generator in a thread; ``jobs.closing``
    comes before the window ends them. ``say`` puts a sentence in the status bar for a while.
    ``view`` shows the open frame (``clicked``: its pixels), and ``panes`` are all that stand
    about it, for whoever brings frames of a camera. ``mount`` is the one owner of the mount's line,
    ``cameras`` that of every camera.
    """

    settings: Settings
    session: Session
    looks: Looks
    jobs: Jobs
    wiring: Wiring
    say: Callable[[str], None]
    view: FrameView
    panes: Workspace
    log: logging.Logger = log

    @cached_property
    def mount(self) -> "Desk":
        """The mount of this window, the same for every view; made when the first asks for it."""
        from app.ui.mount.presence import desk_in

        return desk_in(self)

    @cached_property
    def cameras(self) -> "Cameras":
        """The cameras of this window, shared by its views; made when the first asks for them."""
        from app.ui.cameras import Cameras

        return Cameras(self.jobs)

    @staticmethod
    def catalogue() -> "Catalogue":
        """The star catalogue, opened once; some ms the first time, so ask in a job."""
        return _catalogue()


@cache
def _catalogue() -> "Catalogue":
    from app.sky import open_catalogue

    return open_catalogue()
