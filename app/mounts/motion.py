"""Whether something may still be moving, and the last chance to stop it."""

from contextlib import suppress
from dataclasses import dataclass
from time import monotonic

from app.core.errors import DeviceError
from app.core.mount import Mount


@dataclass(slots=True)
class Motion:
    """Shared between a guard and what runs when the guard is forgotten or the program ends."""

    mount: Mount
    until: float = 0.0

    def begin(self, seconds: float) -> None:
        """Something moves for so long at most."""
        self.until = max(self.until, monotonic() + seconds)

    def end(self) -> None:
        """Everything stands, or only tracks."""
        self.until = 0.0

    @property
    def possible(self) -> bool:
        """Whether something may be moving now."""
        return monotonic() < self.until


def stop_at_exit(motion: Motion) -> None:
    """The program ends, or the guard was forgotten, while the mount moves."""
    if motion.possible:
        with suppress(DeviceError):
            motion.mount.stop()
