"""Whether something may still be moving, and the last chance to stop it."""

from contextlib import suppress
from dataclasses import dataclass
from math import inf
from time import monotonic

from app.core.errors import DeviceError
from app.core.mount import Mount
from app.mounts.watch import Watch


@dataclass(slots=True)
class Motion:
    """Shared between a guard and what runs when the guard is forgotten or the program ends."""

    mount: Mount
    until: float = 0.0
    watch: Watch | None = None

    def begin(self, seconds: float, watch: Watch | None = None) -> None:
        """Something moves for so long at most."""
        self.until = max(self.until, monotonic() + seconds)
        self.watch = watch

    def end(self) -> None:
        """Everything stands, or only tracks."""
        self.until, self.watch = 0.0, None

    @property
    def watched(self) -> Watch | None:
        """What is watched now."""
        return self.watch if self.possible else None

    @property
    def endless(self) -> bool:
        """Whether something moves until the mount says that it has ended."""
        return self.until == inf

    @property
    def possible(self) -> bool:
        """Whether something may be moving now."""
        return monotonic() < self.until


def stop_at_exit(motion: Motion) -> None:
    """The program ends, or the guard was forgotten, while the mount moves."""
    if motion.possible:
        with suppress(DeviceError):
            motion.mount.stop()
