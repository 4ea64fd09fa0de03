"""The simulator's end of a line: a pseudo-terminal's master, or a listening socket."""

import contextlib
import os
import socket
import sys
from pathlib import Path
from typing import Protocol

from app.core.errors import PortError


class LineEnd(Protocol):
    """Something that can be plugged, watched, read and written; broken means OSError."""

    @property
    def port(self) -> str:
        """What a program opens."""

    def plug(self) -> None:
        """Make the port appear."""

    def unplug(self) -> None:
        """Pull the cable."""

    def watched(self) -> list[int]:
        """What to wait on for reading."""

    def read(self, ready: int) -> bytes:
        """What has come; nothing when that was not data."""

    def write(self, data: bytes) -> None:
        """Send; what nobody takes is lost."""


class PtyEnd:
    """A pseudo-terminal in raw mode, whose slave stays open so that programs may come and go.

    With ``link``, the port is that symbolic link, which stays the same when replugged.
    """

    def __init__(self, link: Path | None = None) -> None:
        self.port = ""
        self._link = link
        self._fds: tuple[int, int] | None = None
        self.plug()

    def plug(self) -> None:
        """Open a new pseudo-terminal."""
        if sys.platform == "win32":
            raise PortError("Windows has no pseudo-terminals: serve the mount on a socket instead.")
        import pty
        import tty

        if self._fds is not None:
            return
        master, slave = pty.openpty()
        tty.setraw(slave)
        os.set_blocking(master, False)
        self._fds = (master, slave)
        self.port = os.ttyname(slave)
        if self._link is not None:
            self._link.unlink(missing_ok=True)
            self._link.symlink_to(self.port)
            self.port = str(self._link)

    def unplug(self) -> None:
        """Close both ends: whoever has it open gets an error."""
        for fd in self._fds or ():
            os.close(fd)
        self._fds = None
        if self._link is not None:
            self._link.unlink(missing_ok=True)

    def watched(self) -> list[int]:
        """The master."""
        return [] if self._fds is None else [self._fds[0]]

    def read(self, ready: int) -> bytes:
        """What the program wrote."""
        with contextlib.suppress(BlockingIOError):
            return os.read(ready, 4096)
        return b""

    def write(self, data: bytes) -> None:
        """To the program; a full buffer loses the rest, as a wire would."""
        if self._fds is not None:
            with contextlib.suppress(BlockingIOError):
                os.write(self._fds[0], data)


class SocketEnd:
    """A TCP port on the loopback; the newest connection replaces the one before."""

    def __init__(self, number: int = 0) -> None:
        self._number = number
        self._listener: socket.socket | None = None
        self._peer: socket.socket | None = None
        self.plug()

    @property
    def port(self) -> str:
        """As pyserial's ``serial_for_url`` takes it."""
        return f"socket://127.0.0.1:{self._number}"

    def plug(self) -> None:
        """Listen, again on the same number."""
        if self._listener is not None:
            return
        listener = socket.socket()
        if sys.platform != "win32":  # there it would let two servers share the number
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind(("127.0.0.1", self._number))
        except OSError as error:
            listener.close()
            raise PortError(f"TCP port {self._number} cannot be used: {error.strerror}.") from error
        listener.listen()
        listener.setblocking(False)
        self._number = listener.getsockname()[1]
        self._listener = listener

    def unplug(self) -> None:
        """Reset the connection and stop listening."""
        self._hang_up()
        if self._listener is not None:
            self._listener.close()
            self._listener = None

    def watched(self) -> list[int]:
        """The listener, and the connection when there is one."""
        return [s.fileno() for s in (self._listener, self._peer) if s is not None]

    def read(self, ready: int) -> bytes:
        """What came on the connection; a new connection is accepted here."""
        if self._listener is not None and ready == self._listener.fileno():
            self._accept(self._listener)
            return b""
        if self._peer is None or ready != self._peer.fileno():
            return b""
        try:
            data = self._peer.recv(4096)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._hang_up()
        return data

    def write(self, data: bytes) -> None:
        """To the connection; lost when there is none."""
        if self._peer is not None:
            try:
                self._peer.sendall(data)
            except BlockingIOError:
                return
            except OSError:
                self._hang_up()

    def _accept(self, listener: socket.socket) -> None:
        with contextlib.suppress(OSError):
            peer, _ = listener.accept()
            self._hang_up()
            peer.setblocking(False)
            peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._peer = peer

    def _hang_up(self) -> None:
        if self._peer is not None:
            self._peer.close()
            self._peer = None
