"""One slot between two threads: the newest thing is always next, and nothing can pile up."""

from threading import Condition
from time import monotonic
from typing import Generic, TypeVar

T = TypeVar("T")


class Mailbox(Generic[T]):
    """Holds at most one item. A new one takes the place of one nobody came for.

    ``put``, ``taken`` and ``dropped`` count; ``put_count == taken + dropped + (1 if full)``.
    """

    def __init__(self) -> None:
        self._changed = Condition()
        self._slot: list[T] = []
        self._closed = False
        self.put_count = 0
        self.taken = 0
        self.dropped = 0

    @property
    def closed(self) -> bool:
        """Whether nothing more will come once the slot is empty."""
        return self._closed

    def put(self, item: T) -> None:
        """Leave ``item``, in place of one that still lies there; after closing it is dropped."""
        with self._changed:
            self.put_count += 1
            if self._closed:
                self.dropped += 1
                return
            self.dropped += len(self._slot)
            self._slot[:] = [item]
            self._changed.notify()

    def take(self, timeout_s: float = 0.0) -> T | None:
        """The newest item, or None when none came in time or the box is closed and empty."""
        deadline = monotonic() + timeout_s
        with self._changed:
            while not self._slot and not self._closed:
                left = deadline - monotonic()
                if left <= 0 or not self._changed.wait(left):
                    break
            if not self._slot:
                return None
            self.taken += 1
            return self._slot.pop()

    def close(self) -> None:
        """Let nothing more in and wake who waits; what lies in the slot can still be taken."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
