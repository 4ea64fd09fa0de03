"""TCP ports where programs find the telescope: one thread serves them all, and none of them can hold it up.

A connection reads at most a few kilobytes ahead and writes no more than its program takes; there are so many at a time,
and who speaks no sense or nothing at all is let go with a sentence.
"""

import asyncio
import socket
import threading
from collections.abc import Awaitable, Callable
from concurrent.futures import Future
from typing import Protocol

from kochab.core.errors import PortError
from kochab.core.values import mutable
from kochab.text.translation import tr, tr_noop
from kochab.workflows.telescope.offered import OfferedTelescope

MOST_CLIENTS = 16
LARGEST_READ, WRITE_S = 4096, 10.0
VERDICT_S = 8.0
"""How long a program waits for the guard's word on its goto; SkySafari gives up after about ten seconds."""
TOO_MANY = tr_noop("Too many connections: Kochab serves {most} at a time.")
GARBAGE = tr_noop("Disconnected: it does not speak this protocol.")
SLOW = tr_noop("Disconnected: it does not take what it is sent.")


class NotTheProtocol(Exception):  # noqa: N818 (ends a conversation, is nobody's fault of ours)
    """What came is not of this protocol."""


@mutable(eq=False)
class Line:
    """One connection; ``who`` names it on the screen."""

    who: str
    reader: asyncio.StreamReader
    writer: asyncio.StreamWriter
    telescope: OfferedTelescope

    async def read(self, quiet_s: float | None = None) -> bytes:
        """What came, at most :data:`LARGEST_READ` bytes, empty at the end or after ``quiet_s`` of silence."""
        try:
            async with asyncio.timeout(quiet_s):
                return await self.reader.read(LARGEST_READ)
        except TimeoutError:
            return b""

    async def send(self, data: bytes) -> None:
        """Write it, and wait until the program takes it; TimeoutError when it does not."""
        self.writer.write(data)
        async with asyncio.timeout(WRITE_S):
            await self.writer.drain()


Talk = Callable[[Line], Awaitable[None]]


async def verdict_of(future: "Future[str]") -> str:
    """The guard's word on an order; one that is not begun in time is taken back."""
    waiting = asyncio.wrap_future(future)
    try:
        async with asyncio.timeout(VERDICT_S):
            return await asyncio.shield(waiting)
    except TimeoutError:
        # Taken back, or on the wire already: then its word is waited for, for it may move.
        return tr("The mount does not answer.") if future.cancel() else await waiting


class Server(Protocol):
    """Listens from its making on."""

    def stop(self) -> None:
        """Close its port."""


class Ports:
    """Listens from the first :meth:`listen` on, until :meth:`stop`."""

    def __init__(self, telescope: OfferedTelescope, host: str) -> None:
        self.telescope, self.host = telescope, host
        self._lines = 0
        self.others: list[Server] = []
        """What listens by itself, and ends with these ports."""
        self._servers: list[asyncio.Server] = []
        self._over = asyncio.Event()
        self._runner = asyncio.Runner(loop_factory=asyncio.new_event_loop)
        self._loop = self._runner.get_loop()
        self._thread = threading.Thread(target=self._run, name="kochab-telescope", daemon=True)
        self._thread.start()

    def listen(self, name: str, talk: Talk, port: int) -> int:
        """Serve ``talk`` at a port, 0 for any, and return it; PortError when it cannot be had."""
        try:
            listener = socket.create_server((self.host, port))
        except OSError as error:
            raise PortError(
                "Can't listen at {host}:{port}: {why}.", host=self.host, port=port, why=error.strerror or error
            ) from None
        number = int(listener.getsockname()[1])
        asyncio.run_coroutine_threadsafe(self._serve(name, talk, listener), self._loop).result()
        return number

    def stop(self) -> None:
        """Close every port and connection."""
        while self.others:
            self.others.pop().stop()
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._over.set)
            self._thread.join(2.0)

    def _run(self) -> None:
        with self._runner as runner:  # which cancels the connections at its end
            runner.run(self._until_over())

    async def _until_over(self) -> None:
        await self._over.wait()
        for server in self._servers:
            server.close()

    async def _serve(self, name: str, talk: Talk, listener: socket.socket) -> None:
        async def connected(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            await self._converse(name, talk, reader, writer)

        server = await asyncio.start_server(connected, sock=listener, limit=LARGEST_READ)
        self._servers.append(server)

    async def _converse(
        self, name: str, talk: Talk, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        """One connection, whatever it says.

        Parameters
        ----------
        name : str
            The protocol's, for the screen.
        talk : Talk
            Speaks it.
        reader : asyncio.StreamReader
            Gives what the program sends.
        writer : asyncio.StreamWriter
            Takes what it is sent.
        """
        host = (writer.get_extra_info("peername") or ("?",))[0]
        line = Line(f"{name} ({host})", reader, writer, self.telescope)
        if self._lines >= MOST_CLIENTS:
            writer.transport.abort()
            self.telescope.say(f"{line.who}: {tr(TOO_MANY, most=MOST_CLIENTS)}")
            return
        writer.transport.set_write_buffer_limits(high=LARGEST_READ)
        self._lines += 1
        self.telescope.join(line.who)
        why = ""
        try:
            await talk(line)
        except NotTheProtocol:
            why = tr(GARBAGE)
        except TimeoutError:
            why = tr(SLOW)
        except OSError:
            pass  # a program that went away
        except asyncio.CancelledError:
            pass  # the end of the ports; streams would print it as a fault
        finally:
            self._lines -= 1
            self.telescope.leave(line.who, why)
            writer.transport.abort()
