"""Question and answer on one line, with Stop ahead of everything.

A reading exchange holds the line for its own answer only. :meth:`Conversation.urge` does not wait
for it: it writes at once, and what the mount answers to it is read later, in the order in which
the bytes were sent.
"""

from collections import deque
from collections.abc import Callable
from contextlib import suppress
from threading import Lock, RLock
from time import sleep
from typing import TypeVar

from app.core.errors import NoAnswerError, StoppedError
from app.mounts.link import Link

T = TypeVar("T")
Reader = Callable[[Link], bytes]
QUIET_S = 0.3  # after a bad answer the line must be silent so long before it is trusted again
DOUBT = 2  # the first answer after a bad one may be the late one, and the right one yet to come


class ProtocolError(NoAnswerError):
    """An answer that makes no sense."""


class Conversation:
    """Exchanges over ``link``: one at a time, each with its own answer."""

    def __init__(self, link: Link) -> None:
        self.link = link
        self._exchange = RLock()  # one reader
        self._order = Lock()  # held for single writes only: who was sent first
        self._owed: deque[Reader] = deque()  # answers to what was urged
        self._doubt = 0  # exchanges before which the line must fall silent
        self._counting = Lock()
        self._hurrying = 0  # Stops whose bytes are on their way: everything else waits
        self.stops = 0  # how often everything was stopped: what began before must not begin now

    def ask(
        self,
        command: bytes,
        read: Reader,
        parse: Callable[[bytes], T],
        since: int | None = None,
    ) -> T:
        """Send ``command``, read its answer and understand it.

        A command that begins a motion gives ``since``, the count of :attr:`stops` when it was
        decided: a Stop in between wins, and `StoppedError` is raised instead.
        """
        with self._exchange:
            self._send(command, since)
            try:
                value = parse(read(self.link))
            except ProtocolError as error:
                self._doubt = DOUBT
                raise ProtocolError(
                    f"The device on {self.link.port} answered something else: {error}"
                ) from error
            except NoAnswerError:
                self._doubt = DOUBT
                raise
            self._doubt = max(0, self._doubt - 1)
            return value

    def query(self, command: bytes, read: Reader, parse: Callable[[bytes], T], tries: int = 2) -> T:
        """:meth:`ask` for what changes nothing: repeated when the answer makes no sense."""
        for _ in range(tries - 1):
            with suppress(ProtocolError):
                return self.ask(command, read, parse)
        return self.ask(command, read, parse)

    def tell(self, command: bytes, since: int | None = None) -> None:
        """Send what is not answered; ``since`` as for :meth:`ask`."""
        with self._exchange:
            self._send(command, since)

    def stopping(self) -> None:
        """Count a Stop, and let no other exchange begin until :meth:`stopped`."""
        with self._counting:
            self.stops += 1
            self._hurrying += 1

    def stopped(self) -> None:
        """The bytes of Stop have been sent, or could not be."""
        with self._counting:
            self._hurrying -= 1

    def urge(self, command: bytes, *answers: Reader) -> None:
        """Send now, from any thread, without waiting for anybody; answers are read later."""
        with self._order:
            self.link.write(command)
            self._owed.extend(answers)

    def settle(self) -> None:
        """Read what is still owed to :meth:`urge`."""
        with self._exchange:
            self._settle()

    def close(self) -> None:
        """Give the port back."""
        self.link.close()

    def _send(self, command: bytes, since: int | None = None) -> None:
        while True:
            self._settle()
            self.link.discard(QUIET_S if self._doubt else 0.0)
            while self._hurrying:
                sleep(0.001)
            with self._order:
                if since is not None and since != self.stops:
                    raise StoppedError("The motion was stopped before it began.")
                if not self._owed:
                    self.link.write(command)
                    return

    def _settle(self) -> None:
        while self._owed:
            read = self._owed[0]
            with suppress(NoAnswerError):
                read(self.link)
            self._owed.popleft()


def exactly(count: int, timeout_s: float) -> Reader:
    """Read ``count`` bytes."""
    return lambda link: link.read_exact(count, timeout_s)


def until(terminator: bytes, limit: int, timeout_s: float) -> Reader:
    """Read up to and with ``terminator``."""
    return lambda link: link.read_until(terminator, limit, timeout_s)
