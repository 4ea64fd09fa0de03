"""The line to a mount: serial port, TCP or UDP, questions and answers, and Stop ahead of everything."""

import errno
import logging
import os
import select
import socket
import sys
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from threading import Lock, RLock
from time import monotonic, sleep
from typing import Any, TypeVar
from urllib.parse import urlsplit

from kochab.core.errors import DeviceError, LineLostError, NoAnswerError, PortError, StoppedError
from kochab.text.translation import tr, tr_noop

PORTS = tr_noop("a device, COM3, tcp://HOST:PORT, udp://HOST:11880 or SERVER:PORT/DEVICE")
UDP, TCP = "udp://", ("tcp://", "socket://")
BUSY = (errno.EBUSY, errno.EAGAIN, errno.EWOULDBLOCK)


def not_opened(port: str, error: Exception) -> PortError:
    """The `PortError` for what pyserial raised on opening ``port``."""
    if port.startswith((*TCP, UDP)):
        return PortError(_server(port, error))
    if "://" in port:
        return PortError("{port} is not a port: give {ports}.", port=port, ports=PORTS)
    number = getattr(error, "errno", None)
    text = str(error).lower()
    if number in (errno.EACCES, errno.EPERM) and sys.platform != "win32":
        return PortError(_permission(port))
    if number in BUSY or "access is denied" in text or "exclusively lock" in text:
        return PortError("{port} is in use: close the other program that talks to this mount.", port=port)
    if number in (errno.ENOENT, errno.ENXIO, errno.ENODEV) or "filenotfound" in text:
        return PortError(_absent(port))
    return PortError("{port} cannot be used as a serial port.", port=port)


def _server(port: str, error: Exception) -> str:
    try:
        parts = urlsplit(port)
        is_address = bool(parts.hostname) and parts.port is not None
    except ValueError:
        is_address = False
    if not is_address:
        form = f"{port.partition('://')[0]}://HOST:PORT"
        return tr("{port} is not an address: write it as {form}.", port=port, form=form)
    if "refused" in str(error).lower():
        return tr("No answer at {port}: check the address and the mount's Wi-Fi or network adapter.", port=port)
    return tr("{port} cannot be reached: check the address and the network.", port=port)


def _permission(port: str) -> str:
    group = _group(port)
    if group in ("", "root"):
        return tr("No permission to open {port}: ask this computer's administrator.", port=port)
    return tr(
        "No permission to open {port} (group {group}): run `sudo usermod -aG {group} $USER` and log in again.",
        port=port,
        group=group,
    )


def _group(port: str) -> str:
    """The group that owns the device, ``dialout`` on Debian, ``uucp`` or ``plugdev`` elsewhere."""
    try:
        import grp

        return grp.getgrgid(os.stat(port).st_gid).gr_name
    except (ImportError, OSError, KeyError):
        return ""


def _absent(port: str) -> str:
    if port.startswith("/dev/") or port.upper().startswith("COM"):
        return tr("No port {port}: plug in the USB cable and switch the mount on.", port=port)
    if Path(port).parent.is_dir():
        return tr("No port {port}: list ports with `kochab mount list`.", port=port)
    return tr("No port {port}, nor its folder: list ports with `kochab mount list`.", port=port)


def with_port(address: str, usual: int | None) -> str:
    """A TCP address with the port that its driver's mounts have, where none is given."""
    if usual is not None and address.startswith(TCP):
        with suppress(ValueError):  # no address: SerialLink says so
            parts = urlsplit(address)
            if parts.port is None and parts.hostname:
                return f"{address.rstrip('/')}:{usual}"
    return address


T = TypeVar("T")
logger = logging.getLogger(__name__)
SLICE_S = 0.05  # a read returns this often, so that a closed line is seen at once
WRITE_S = 2.0  # a line that takes no bytes for this long is broken


class UdpPort:
    """The Wi-Fi of a Sky-Watcher mount, read and written as a port of pyserial.

    A datagram holds one command, from its ``:`` to its carriage return, else the mount drops it. Some are lost.
    """

    def __init__(self, address: str) -> None:
        parts = urlsplit(address)
        if not parts.hostname or parts.port is None:
            raise ValueError(address)
        (family, kind, number, _, where), *_ = socket.getaddrinfo(parts.hostname, parts.port, type=socket.SOCK_DGRAM)
        self._socket = socket.socket(family, kind, number)
        # Connected, so that datagrams from other senders are dropped and a closed port is an error at once.
        self._socket.connect(where)
        self._came = b""
        self.close = self._socket.close

    def write(self, data: bytes) -> None:
        """Send each command in a datagram of its own."""
        for command in data.splitlines(keepends=True):
            self._socket.send(command)

    def read(self, count: int, patience_s: float = SLICE_S) -> bytes:
        """Up to ``count`` bytes."""
        if not self._came and select.select([self._socket], [], [], patience_s)[0]:
            self._came = self._socket.recv(2048)
        piece, self._came = self._came[:count], self._came[count:]
        return piece

    @property
    def in_waiting(self) -> int:
        """How many bytes have come."""
        self._came = self.read(2048, 0.0)
        return len(self._came)


class SerialLink:
    """A line over anything pyserial opens: ``/dev/ttyUSB0``, ``COM3``, ``tcp://`` (its ``socket://``); and ``udp://``.

    ``lossy``: what is sent may be lost without a sign. One thread reads; any thread may write. Every
    failure of an open line is a `LineLostError` at once: a pulled cable, a hung-up pseudo-terminal,
    a server that has gone.
    """

    def __init__(self, port: str, baud: int = 9600) -> None:
        import serial

        self.port, self.lossy = port, port.startswith(UDP)
        settings: dict[str, Any] = {"timeout": SLICE_S, "write_timeout": WRITE_S}
        if "://" not in port and not port.upper().startswith("COM"):  # Windows' are always exclusive
            settings["exclusive"] = True
        try:
            url = port.replace("tcp://", "socket://", 1)
            self._is_socket = port.startswith(TCP)
            self._serial: Any = UdpPort(port) if self.lossy else serial.serial_for_url(url, baudrate=baud, **settings)
        except (OSError, ValueError) as error:
            raise not_opened(port, error) from error
        self._writing = Lock()
        self._lost = False

    def write(self, data: bytes) -> None:
        """Send all of ``data`` in one piece; the lock is held for this write alone."""
        with self._writing:
            self._guarded(lambda: self._hand_over(data))

    def _hand_over(self, data: bytes) -> None:
        """Write; a computer that slept meanwhile has written, though its port finds the time for that gone."""
        from serial import SerialTimeoutException

        begun = monotonic()
        try:
            self._serial.write(data)
        except SerialTimeoutException:
            if monotonic() - begun < 2.0 * WRITE_S:
                raise
        if self._is_socket:
            with suppress(BlockingIOError):  # nothing has come, and nobody has hung up
                if not self._serial._socket.recv(1, socket.MSG_PEEK):
                    raise ConnectionError  # the far end has hung up, and takes one more write without a word

    def read_exact(self, count: int, timeout_s: float) -> bytes:
        """``count`` bytes within ``timeout_s``, or `NoAnswerError`."""
        return self._read(timeout_s, lambda got: len(got) >= count)

    def read_until(self, terminator: bytes, limit: int, timeout_s: float) -> bytes:
        """Bytes up to and with ``terminator``; ``limit`` bytes without it are no answer."""
        got = self._read(timeout_s, lambda got: got.endswith(terminator) or len(got) >= limit)
        if not got.endswith(terminator):
            raise NoAnswerError("The device on {port} never ends its reply: {got!r}.", port=self.port, got=got[:24])
        return got

    def discard(self, quiet_s: float = 0.0) -> bytes:
        """Throw away what has come; at most two seconds on a line that never falls silent."""
        stale, quiet_since = bytearray(), monotonic()
        end = quiet_since + 2.0
        while self._guarded(lambda: self._serial.in_waiting) or (quiet_s > 0.0 and monotonic() - quiet_since < quiet_s):
            piece = self._guarded(self._byte)
            if piece:
                stale += piece
                quiet_since = monotonic()
            if monotonic() > end:
                break
        return bytes(stale)

    def close(self) -> None:
        """Give the port back; never raises."""
        self._lost = True
        own = self._serial._socket if self._is_socket else None
        with suppress(OSError, ValueError, TypeError):
            self._serial.close()
        if own is not None:
            own.close()  # which pyserial leaves open where the far end has hung up

    def _read(self, timeout_s: float, complete: Callable[[bytearray], bool]) -> bytes:
        got = bytearray()
        end = monotonic() + timeout_s
        while not complete(got):
            # One byte at a time: a longer read would sit out its whole time slice for bytes that never come.
            got += self._guarded(self._byte)
            if monotonic() > end and not complete(got):
                if got:
                    raise NoAnswerError(
                        "The answer on {port} stopped after {bytes!r}.", port=self.port, bytes=bytes(got[:24])
                    )
                raise NoAnswerError(
                    "The device on {port} did not answer within {timeout:g} s.", port=self.port, timeout=timeout_s
                )
        return bytes(got)

    def _byte(self) -> bytes:
        """One byte, or none where nothing arrived within the time slice."""
        try:
            piece: bytes = self._serial.read(1)
        except OSError as error:
            # Windows returns nothing there, Wine its ERROR_TIMEOUT, of which pyserial keeps the number in a text.
            if "1460" not in str(error):
                raise
            return b""
        return piece

    def _guarded(self, action: Callable[[], T]) -> T:
        """Run ``action``; `LineLostError` for whatever an open line raises when it breaks."""
        if self._lost:
            raise LineLostError("Port {port} is closed.", port=self.port)
        try:
            return action()
        except (OSError, TypeError, ValueError, AttributeError) as error:
            # pyserial reports a port closed under it as TypeError or ValueError, a socket's as AttributeError.
            self._lost = True
            raise LineLostError("Lost the mount on {port}. Check its cable and power.", port=self.port) from error


# -- Question and answer on one line, with Stop ahead of everything ----------------------------
# An exchange holds the line until its answer has come. :meth:`Conversation.send_now` does not wait
# for it: it writes at once, and its answer is read later, in the order in which bytes were sent.

Reader = Callable[[SerialLink], bytes]
Command = tuple[bytes, tuple[Reader, ...]]  # bytes, and how each answer to them is read
QUIET_S = 0.3  # after a bad answer the line must be silent this long before it is trusted again
STOP_TRIES = 2  # of a Stop that is not answered: the mount may not have heard it
LOSSY_TRIES = 12  # with 25 % of datagrams lost each way, all 12 fail once in 20,000
DOUBT = 2  # exchanges: what is read after a bad answer may still be that answer, late


class ProtocolError(NoAnswerError):
    """An answer that makes no sense."""


class Conversation:
    """Exchanges over ``link``: one at a time, each with its own answer."""

    def __init__(self, link: SerialLink) -> None:
        self.link = link
        self._exchange = RLock()  # one reader
        self._order = Lock()  # held for single writes only: who was sent first
        self._pending: deque[Command] = deque()  # by :meth:`send_now`, whose answers are due
        self._doubt = 0  # exchanges before which the line must fall silent
        self._counting = Lock()
        self._stopping = 0  # Stops whose bytes are on their way: everything else waits
        self.stops = 0  # how often everything was stopped: what began before must not begin now
        self.missed = 0  # questions that stayed unanswered, on a line that loses some as often as they are asked

    def ask(self, command: bytes, read: Reader, parse: Callable[[bytes], T], since: int | None = None) -> T:
        """Send a command, read its answer and parse it.

        Parameters
        ----------
        command : bytes
            The bytes to send.
        read : Reader
            Takes the answer from the line.
        parse : Callable[[bytes], T]
            Reads the answer.
        since : int or None
            For a command that begins a motion the count of :attr:`stops` when it was decided: a Stop in between
            wins, and `StoppedError` is raised instead. None for others.
        """
        with self._exchange:
            self._send(command, since)
            try:
                value = parse(self._read(read))
            except NoAnswerError as error:
                self._doubt = DOUBT
                if isinstance(error, ProtocolError):
                    raise ProtocolError(
                        "Unexpected answer on {port}: {error}", port=self.link.port, error=error
                    ) from error
                self.missed += not self.link.lossy
                raise
            self._doubt = max(0, self._doubt - 1)
            return value

    def query(
        self,
        command: bytes,
        read: Reader,
        parse: Callable[[bytes], T],
        tries: int = 2,
        again: type[NoAnswerError] = ProtocolError,
        since: int | None = None,
    ) -> T:
        """:meth:`ask` for what may be repeated.

        Parameters
        ----------
        command : bytes
            The bytes to send.
        read : Reader
            Takes the answer from the line.
        parse : Callable[[bytes], T]
            Reads the answer.
        tries : int
            How often at most.
        again : type[NoAnswerError]
            After which error it is repeated: by default when the answer makes no sense.
        since : int or None
            As in :meth:`ask`.
        """
        for _ in range(tries - 1):
            with suppress(again):
                return self.ask(command, read, parse, since)
        try:
            return self.ask(command, read, parse, since)
        except ProtocolError:
            raise
        except NoAnswerError:
            self.missed += self.link.lossy and tries > 1  # one may be lost on the way, not all
            raise

    def send(self, command: bytes, since: int | None = None) -> None:
        """Send a command without an answer; ``since`` as for :meth:`ask`."""
        with self._exchange:
            self._send(command, since)

    def stopping(self) -> None:
        """Count a Stop, and let no other exchange begin until :meth:`stopped`."""
        with self._counting:
            self.stops += 1
            self._stopping += 1

    def stopped(self) -> None:
        """The bytes of Stop have been sent, or could not be."""
        with self._counting:
            self._stopping -= 1

    def send_now(self, *commands: Command) -> None:
        """Send now, from any thread, without waiting; answers are read later."""
        with self._order:
            for command, answers in commands:
                self.link.write(command)
                if answers:
                    self._pending.append((command, answers))
        for command, _ in commands:  # after all of them: a slow disk must not delay a Stop
            logger.debug("%s > %r", self.link.port, command)

    def read_pending(self) -> None:
        """Read the answers to :meth:`send_now` that are due; without all of them it is sent again."""
        with self._exchange:
            tries = LOSSY_TRIES if self.link.lossy else STOP_TRIES
            while self._pending:
                # Everything is sent again and every answer read anew: a repeated Stop does no harm.
                due, tries = list(self._pending), tries - 1
                # After one that is missing no other is waited for: each may take seconds on a mute line.
                answered = all(self._answered(read) for _, answers in due for read in answers)
                if not answered:
                    self._doubt = DOUBT
                if answered or tries <= 0:
                    for _ in due:
                        self._pending.popleft()
                    continue
                self.link.discard()
                for command, _ in due:
                    logger.debug("%s > %r", self.link.port, command)
                    self.link.write(command)

    def _answered(self, read: Reader) -> bool:
        try:
            self._read(read)
        except NoAnswerError:
            return False
        return True

    def _send(self, command: bytes, since: int | None = None) -> None:
        # Clear the line, let every Stop go first, then send. A Stop that slipped in leaves an answer: start over.
        while True:
            self.read_pending()
            stale = self.link.discard(QUIET_S if self._doubt else 0.0)
            if stale:
                logger.debug("%s < %r (unexpected)", self.link.port, stale)
                if self._pending and not self.link.lossy:
                    # A Stop came meanwhile, and these may be its answers: they would be waited for in vain.
                    with self._order:
                        self._pending.clear()
                    self._doubt = DOUBT
                    continue
            # A Stop may be several commands; nothing may go out between them.
            while self._stopping:
                sleep(0.001)
            # Logged before it is sent, so that a crash hides no byte; outside the lock, which a Stop needs.
            logger.debug("%s > %r", self.link.port, command)
            with self._order:
                stopped = since is not None and since != self.stops
                if not stopped and not self._pending:  # else a Stop slipped in: read its answer first
                    self.link.write(command)
                    return
            logger.debug("%s: %r was not sent, a Stop came first", self.link.port, command)
            if stopped:
                raise StoppedError("The motion was stopped before it began.")

    def _read(self, read: Reader) -> bytes:
        try:
            reply = read(self.link)
        except DeviceError as error:
            logger.debug("%s < nothing: %s", self.link.port, error)
            raise
        logger.debug("%s < %r", self.link.port, reply)
        return reply


def exactly(count: int, timeout_s: float) -> Reader:
    """Read ``count`` bytes."""
    return lambda link: link.read_exact(count, timeout_s)


def until(terminator: bytes, limit: int, timeout_s: float) -> Reader:
    """Read up to and with ``terminator``."""
    return lambda link: link.read_until(terminator, limit, timeout_s)
