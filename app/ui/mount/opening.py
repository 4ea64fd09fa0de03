"""How a line is opened: a mount on a port, or a simulated telescope as if it were one."""

from collections.abc import Callable
from datetime import UTC, datetime
from functools import partial
from typing import Protocol

from app.core.hint import Site
from app.mounts.guard import Guard
from app.mounts.limits import Limits
from app.ui.mount.wishes import MountWish
from app.ui.mount.words import Practising, Word
from app.ui.wiring import Practice, StartPractice

PRACTICE_FOV_DEG = 4.0  # wide enough for the patterns that are shipped


class Opening(Protocol):
    """Called in the thread of the line; ``farewell`` is what is said when it is over."""

    farewell: str

    def __call__(self) -> Guard:
        """The mount behind its guard; DeviceError with one sentence."""
        ...

    def over(self) -> None:
        """The line is closed."""
        ...


class _OnPort:
    farewell = ""

    def __init__(self, wish: MountWish, site: Site | None, limits: Limits) -> None:
        self._wish, self._site, self._limits = wish, site, limits

    def __call__(self) -> Guard:
        return guarded(self._wish, self._site, self.now, self._limits)

    def now(self) -> datetime:
        return datetime.now(UTC)

    def over(self) -> None:
        pass


class PracticeOpening:
    """Starts the simulated telescope and connects over its line; it ends with the line.

    ``tell`` hears of it, in the thread of the line.
    """

    def __init__(self, start: StartPractice, tell: Callable[[Word], None], limits: Limits) -> None:
        self._start, self._tell, self._limits = start, tell, limits
        self.practice: Practice | None = None
        self.farewell = ""

    def __call__(self) -> Guard:
        self.practice = practice = self._start(fov_deg=PRACTICE_FOV_DEG)
        self._tell(Practising(practice.port, practice.camera))
        wish = MountWish(practice.port, practice.driver)
        return guarded(wish, practice.rig.config.site, self.now, self._limits)

    def now(self) -> datetime:
        if self.practice is None:
            return datetime.now(UTC)
        now: datetime = self.practice.rig.clock.now_utc()
        return now

    def over(self) -> None:
        if self.practice is not None:
            self.farewell = self.practice.score().as_text()
            self.practice.stop()


def on_port(wish: MountWish, site: Site | None, limits: Limits) -> Opening:
    """A mount on a serial port or a socket."""
    return _OnPort(wish, site, limits)


def guarded(
    wish: MountWish, site: Site | None, clock: Callable[[], datetime], limits: Limits
) -> Guard:
    """Open it behind its guard; the line can be opened again when it was lost."""
    from app.mounts import open_mount

    again = partial(
        open_mount, wish.driver, wish.port, wish.baud, wish.epoch, site, clock, stop_first=True
    )
    first = open_mount(wish.driver, wish.port, wish.baud, wish.epoch, site, clock)
    return Guard(first, site, limits, clock=clock, reopen=again)
