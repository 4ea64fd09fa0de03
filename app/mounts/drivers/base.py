"""What all drivers over a line share: the conversation, the bound on motions, Stop and close."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from datetime import datetime
from types import MappingProxyType
from typing import ClassVar

from app.core.errors import DeviceError, RefusedError
from app.core.hint import Site
from app.core.mount import Ability, Direction, Epoch
from app.mounts.beliefs import Beliefs
from app.mounts.conversation import Conversation, Reader
from app.mounts.deadman import Deadman
from app.mounts.link import Link
from app.mounts.motion_log import utc_now


class SerialMount:
    """The common half of a driver; a driver adds its words.

    ``site`` and ``clock`` are only for a mount that knows neither; nothing is ever sent of them.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    bauds: ClassVar[tuple[int, ...]] = (9600,)
    default_epoch: ClassVar[Epoch] = Epoch.DATE
    timeout_s: ClassVar[float] = 5.0
    blind_stop: ClassVar[bytes]  # what stops it before anything is known of it
    rates_deg_s: tuple[float, ...] = ()

    def __init__(
        self,
        link: Link,
        epoch: Epoch | None = None,
        site: Site | None = None,
        clock: Callable[[], datetime] | None = None,
    ) -> None:
        self.epoch = epoch or self.default_epoch
        self.site = site
        self.clock = clock or utc_now
        self.talk = Conversation(link)
        self.deadman = Deadman()
        self._lacks: dict[Ability, str] = {}
        self.start()

    def start(self) -> None:
        """Find out what is there; nothing may move."""

    @property
    def lacks(self) -> Mapping[Ability, str]:
        """What it cannot do, each with the reason."""
        return MappingProxyType(self._lacks)

    def beliefs(self) -> Beliefs:
        """What it believes of its place and time, where it tells."""
        return Beliefs()

    def stop(self) -> None:
        """Stop every motion, from any thread; what is answered is read later."""
        self.talk.stopping()
        try:
            moved = self.deadman.moving
            self.deadman.disarm()
            for command, answers in self.stop_words(moved):
                self.talk.urge(command, *answers)
        finally:
            self.talk.stopped()

    def stop_words(self, moved: bool) -> list[tuple[bytes, tuple[Reader, ...]]]:
        """The bytes of Stop and how their answers are read; ``moved``: a move may be running."""
        raise NotImplementedError

    def close(self) -> None:
        """Stop a bounded motion that still runs, and give the port back."""
        if self.deadman.moving:
            with suppress(DeviceError):
                self.stop()
                self.talk.settle()
        self.deadman.disarm()
        self.talk.close()

    def need(self, ability: Ability) -> None:
        """Raise the reason when the mount cannot do this."""
        if ability in self._lacks:
            raise RefusedError(self._lacks[ability])

    def nearest_rate(self, rate_deg_s: float) -> int:
        """Index of the rate nearest to the one asked for."""
        return min(
            range(len(self.rates_deg_s)), key=lambda i: abs(self.rates_deg_s[i] - rate_deg_s)
        )

    def bounded(
        self, direction: Direction, seconds: float, *halt: tuple[bytes, tuple[Reader, ...]]
    ) -> None:
        """Let a motion that begins now end after ``seconds`` by these bytes."""
        self.deadman.check()

        def end() -> None:
            for command, answers in halt:
                self.talk.urge(command, *answers)

        axis = "dec" if direction in (Direction.NORTH, Direction.SOUTH) else "ra"
        self.deadman.arm(axis, seconds, end)
