"""Makes the newest frame ready for the screen, in a thread of its own, whatever the solver does."""

from collections.abc import Callable
from dataclasses import dataclass

from app.core.frame import Frame
from app.core.progress import Progress, Task
from app.ui.live.brighten import Brightener, Levels, Look
from app.ui.ready_picture import ReadyPicture
from app.workflows.live_update import LiveUpdate
from app.workflows.mailbox import Mailbox

WAIT_S = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Ready:
    """A frame to be drawn; ``update`` is its answer, None when it is not solved yet."""

    frame: Frame
    picture: ReadyPicture
    update: LiveUpdate | None
    levels: Levels


class Display:
    """Frames go in at :meth:`show` and come out at :meth:`take`; the newest is always next.

    ``ready`` is called in this one's thread when there is something to take, and not again before
    it was taken. Set :attr:`look` from any thread.
    """

    def __init__(self, ready: Callable[[], None]) -> None:
        self.look = Look()
        self._tell = ready
        self._coming: Mailbox[tuple[Frame, LiveUpdate | None]] = Mailbox()
        self._made: Mailbox[Ready] = Mailbox()

    def show(self, frame: Frame, update: LiveUpdate | None) -> None:
        """Take a frame in, from any thread; returns at once."""
        self._coming.put((frame, update))

    def take(self) -> Ready | None:
        """What is to be drawn now."""
        return self._made.take()

    def close(self) -> None:
        """Let :meth:`task` end."""
        self._coming.close()

    def task(self) -> Task[None]:
        """Brighten frames until it is closed."""
        brightener = Brightener()
        while not self._coming.closed:
            item = self._coming.take(WAIT_S)
            if item is not None:
                frame, update = item
                picture = brightener.picture(frame, self.look)
                self._made.put(Ready(frame, picture, update, brightener.levels))
                self._tell()
            yield Progress("display")
