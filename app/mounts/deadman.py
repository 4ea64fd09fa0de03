"""A motion that ends by itself, whatever happens to who began it."""

from collections.abc import Callable
from threading import Lock, Timer

from app.core.errors import DeviceError


class Deadman:
    """Calls ``halt`` after the time allowed unless the motion was ended before.

    ``halt`` runs in the timer's thread and so may only use what any thread may use. It is tried
    three times; ``failure`` is then the sentence for whoever asks next.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._timers: dict[str, Timer] = {}
        self.failure: DeviceError | None = None

    def arm(self, name: str, seconds: float, halt: Callable[[], None]) -> None:
        """Let the motion ``name`` last ``seconds``; arm before the motion begins."""
        timer = Timer(max(0.0, seconds), self._expire, (name, halt))
        timer.daemon = True
        with self._lock:
            before = self._timers.pop(name, None)
            self._timers[name] = timer
        if before is not None:
            before.cancel()
        timer.start()

    def disarm(self) -> None:
        """Every motion has been ended by other means."""
        with self._lock:
            timers, self._timers = list(self._timers.values()), {}
        for timer in timers:
            timer.cancel()

    @property
    def moving(self) -> bool:
        """Whether a motion is still allowed to run."""
        with self._lock:
            return bool(self._timers)

    def check(self) -> None:
        """Raise what went wrong when a motion should have ended, once."""
        failure, self.failure = self.failure, None
        if failure is not None:
            raise failure

    def _expire(self, name: str, halt: Callable[[], None]) -> None:
        for _ in range(3):
            try:
                halt()
            except DeviceError as error:
                self.failure = error
            else:
                self.failure = None
                break
        with self._lock:
            self._timers.pop(name, None)
