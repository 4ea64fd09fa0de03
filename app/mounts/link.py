"""Bytes on a line: a serial port, a TCP bridge or a pseudo-terminal, all by pyserial."""

from collections.abc import Callable
from contextlib import suppress
from threading import Lock
from time import monotonic
from typing import Any, Protocol, TypeVar

from app.core.errors import LineLostError, NoAnswerError
from app.mounts.port_errors import not_opened

T = TypeVar("T")
SLICE_S = 0.05  # a read returns this often, so that a closed line is seen at once
WRITE_S = 2.0  # a line that takes no more bytes for so long is broken


class Link(Protocol):
    """A line to a mount. One thread reads; any thread may write."""

    port: str

    def write(self, data: bytes) -> None:
        """Send all of ``data`` in one piece."""

    def read_exact(self, count: int, timeout_s: float) -> bytes:
        """``count`` bytes, or `NoAnswerError`."""

    def read_until(self, terminator: bytes, limit: int, timeout_s: float) -> bytes:
        """Bytes up to and with ``terminator``, at most ``limit``, or `NoAnswerError`."""

    def discard(self, quiet_s: float = 0.0) -> bytes:
        """Throw away what has come, until the line was silent for ``quiet_s``."""

    def close(self) -> None:
        """Give the port back; never raises."""


class SerialLink:
    """A :class:`Link` over anything pyserial opens: ``/dev/ttyUSB0``, ``COM3``, ``socket://``.

    Every failure of an open line is a `LineLostError` at once: a pulled cable, a hung-up
    pseudo-terminal, a server that has gone.
    """

    def __init__(self, port: str, baud: int = 9600) -> None:
        self.port = port
        self._serial = _opened(port, baud)
        self._writing = Lock()
        self._lost = False

    def write(self, data: bytes) -> None:
        """Send all of ``data`` in one piece; the lock is held for this write alone."""
        with self._writing:
            self._guarded(lambda: self._serial.write(data))

    def read_exact(self, count: int, timeout_s: float) -> bytes:
        """``count`` bytes within ``timeout_s``."""
        return self._read(timeout_s, lambda got: len(got) >= count)

    def read_until(self, terminator: bytes, limit: int, timeout_s: float) -> bytes:
        """Bytes up to and with ``terminator``; ``limit`` bytes without it are no answer."""
        got = self._read(timeout_s, lambda got: got.endswith(terminator) or len(got) >= limit)
        if not got.endswith(terminator):
            raise NoAnswerError(f"The device on {self.port} answers without an end: {got[:24]!r}.")
        return got

    def discard(self, quiet_s: float = 0.0) -> bytes:
        """Throw away what has come; at most two seconds on a line that never falls silent."""
        stale = bytearray()
        end = monotonic() + 2.0
        quiet_since = monotonic()
        while self._guarded(lambda: self._serial.in_waiting) or (
            quiet_s > 0.0 and monotonic() - quiet_since < quiet_s
        ):
            piece = self._guarded(lambda: self._serial.read(1))
            if piece:
                stale += piece
                quiet_since = monotonic()
            if monotonic() > end:
                break
        return bytes(stale)

    def close(self) -> None:
        """Give the port back; never raises."""
        self._lost = True
        with suppress(OSError, ValueError, TypeError):
            self._serial.close()

    def _read(self, timeout_s: float, complete: Callable[[bytearray], bool]) -> bytes:
        got = bytearray()
        end = monotonic() + timeout_s
        while not complete(got):
            got += self._guarded(lambda: self._serial.read(1))
            if monotonic() > end and not complete(got):
                raise NoAnswerError(_silent(self.port, bytes(got), timeout_s))
        return bytes(got)

    def _guarded(self, action: Callable[[], T]) -> T:
        """Whatever an open line raises when it breaks, as one sentence."""
        if self._lost:
            raise LineLostError(f"The line {self.port} is closed.")
        try:
            return action()
        except (OSError, TypeError, ValueError) as error:
            # pyserial reports a port closed under it as TypeError or ValueError
            self._lost = True
            raise LineLostError(
                f"The line to the mount on {self.port} broke: check its cable and its power."
            ) from error


def _opened(port: str, baud: int) -> Any:
    import serial

    settings: dict[str, Any] = {"timeout": SLICE_S, "write_timeout": WRITE_S}
    if "://" not in port and not port.upper().startswith("COM"):  # Windows' are always exclusive
        settings["exclusive"] = True
    try:
        return serial.serial_for_url(port, baudrate=baud, **settings)
    except (OSError, ValueError) as error:
        raise not_opened(port, error) from error


def _silent(port: str, got: bytes, timeout_s: float) -> str:
    if got:
        return f"The answer on {port} stopped after {got[:24]!r}."
    return f"The device on {port} did not answer within {timeout_s:g} s."


def open_link(port: str, baud: int = 9600) -> SerialLink:
    """Open ``port`` for ourselves alone; `PortError` says what to do when it cannot be."""
    return SerialLink(port, baud)
