"""A simulated mount served on a pseudo-terminal or a socket, in a thread of its own."""

import contextlib
import math
import os
import random
import select
import socket
import sys
import threading
import time
from collections import deque
from enum import StrEnum

from kochab.core.errors import PortError
from kochab.simulate.responders import Controller

# -- The simulator's end of a line: a pseudo-terminal's master, or a listening socket ----------
# Both can be plugged, watched, read and written; when one is broken they raise OSError.


class PtyEnd:
    """A pseudo-terminal in raw mode, whose slave stays open so that programs may come and go."""

    def __init__(self) -> None:
        self.port = ""
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
        # cooked mode would echo, translate CR and eat control bytes of a binary protocol
        tty.setraw(slave)
        # a program that does not read must not stop the thread that serves it
        os.set_blocking(master, False)
        self._fds = (master, slave)
        self.port = os.ttyname(slave)

    def unplug(self) -> None:
        """Close both ends: whoever has it open gets an error."""
        for fd in self._fds or ():
            os.close(fd)
        self._fds = None

    def watched(self) -> list[int]:
        """The master."""
        return [] if self._fds is None else [self._fds[0]]

    def read(self) -> bytes:
        """What the program wrote."""
        for master in self.watched():
            with contextlib.suppress(BlockingIOError):
                return os.read(master, 4096)
        return b""

    def write(self, data: bytes) -> None:
        """To the program; a full buffer loses the rest, as a wire would."""
        for master in self.watched():
            with contextlib.suppress(BlockingIOError):
                os.write(master, data)


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
        try:
            self._listener = socket.create_server(("127.0.0.1", self._number))
        except OSError as error:
            raise PortError(
                "TCP port {number} cannot be used: {strerror}.", number=self._number, strerror=error.strerror
            ) from error
        self._listener.setblocking(False)
        self._number = self._listener.getsockname()[1]

    def unplug(self) -> None:
        """Reset the connection and stop listening."""
        self._hang_up()
        if self._listener is not None:
            self._listener.close()
            self._listener = None

    def watched(self) -> list[int]:
        """The listener, and the connection when there is one."""
        return [s.fileno() for s in (self._listener, self._peer) if s is not None]

    def read(self) -> bytes:
        """What came on the connection; a new connection is accepted here."""
        if self._listener is not None:
            self._accept(self._listener)
        if self._peer is None:
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
            # replies are a few bytes: Nagle's algorithm would hold the parts of a split one together
            peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._peer = peer

    def _hang_up(self) -> None:
        if self._peer is not None:
            self._peer.close()
            self._peer = None


# -- What goes wrong on a line, on demand: for the next few exchanges or with some probability --
# An exchange is one batch of bytes from the computer that is answered. Faults may be switched on
# and off from any thread while the line is served, and combine: late garbage, split wrong answers.


class Fault(StrEnum):
    """One thing that goes wrong with an exchange."""

    SILENCE = "silence"
    GARBAGE = "garbage"
    LATE = "late"
    SPLIT = "split"
    WRONG = "wrong"  # the answer to another command
    REFUSAL = "refusal"  # gotos and syncs, in the protocol's own words
    UNPLUG = "unplug"  # before anything is answered


Piece = tuple[float, bytes]  # seconds after the one before, bytes


class Faults:
    """The faults of one line; ``seed`` makes chances repeat.

    ``late_s`` is how late a late answer is, ``gap_s`` the pause before each byte of a split one.
    """

    def __init__(self, seed: int = 0, late_s: float = 7.0, gap_s: float = 0.02) -> None:
        self.late_s, self.gap_s = late_s, gap_s
        self.happened: dict[Fault, int] = dict.fromkeys(Fault, 0)
        self._lock = threading.Lock()
        self._random = random.Random(seed)
        self._left = dict.fromkeys(Fault, 0)
        self._chance = dict.fromkeys(Fault, 0.0)
        self._sent: deque[bytes] = deque(maxlen=8)

    def next(self, fault: Fault | str, exchanges: int = 1) -> None:
        """Let it happen to the next so many exchanges, or orders for a refusal."""
        with self._lock:
            self._left[Fault(fault)] = exchanges

    def chance(self, fault: Fault | str, probability: float) -> None:
        """Let it happen to each exchange with this probability."""
        with self._lock:
            self._chance[Fault(fault)] = probability

    def none(self) -> None:
        """All is well from now on."""
        with self._lock:
            self._left = dict.fromkeys(Fault, 0)
            self._chance = dict.fromkeys(Fault, 0.0)

    def happens(self, fault: Fault) -> bool:
        """Whether it happens now; one of its exchanges is then used up."""
        with self._lock:
            if self._left[fault] > 0:
                self._left[fault] -= 1
            elif not self._random.random() < self._chance[fault]:
                return False
            self.happened[fault] += 1
            return True

    def refusal(self) -> str | None:
        """A reason not to move, for :attr:`Controller.refusal`."""
        return "limits" if self.happens(Fault.REFUSAL) else None

    def shape(self, reply: bytes) -> list[Piece]:
        """What goes out instead of ``reply``, which is not empty, and when."""
        true_reply = reply
        if self.happens(Fault.WRONG):
            earlier = [sent for sent in self._sent if sent != reply]
            reply = self._random.choice(earlier) if earlier else b"?#"
        # the true one is kept, so that a wrong answer is always one that was right before
        self._sent.append(true_reply)
        if self.happens(Fault.GARBAGE):
            reply = self._random.randbytes(len(reply))
        if self.happens(Fault.SILENCE):
            return []
        wait = self.late_s if self.happens(Fault.LATE) else 0.0
        if not self.happens(Fault.SPLIT):
            return [(wait, reply)]
        return [(wait if k == 0 else self.gap_s, bytes([c])) for k, c in enumerate(reply)]


LOOK_S = 0.05  # how soon it is seen that the line was plugged in, or is to end
IDLE_S = 1.5  # a command that stands half-written for so long is forgotten


class Line:
    """Passes bytes between one end and a responder until :meth:`stop`.

    ``faults`` may be used while it runs. ``transcript`` keeps the last exchanges: direction
    (``<`` from the computer, ``>`` to it) and bytes.
    """

    def __init__(self, end: PtyEnd | SocketEnd, responder: Controller, faults: Faults | None = None) -> None:
        self.faults = faults or Faults()
        self.transcript: deque[tuple[str, bytes]] = deque(maxlen=1000)
        self._end, self._responder = end, responder
        responder.refusal = self.faults.refusal
        self._outgoing: deque[tuple[float, bytes]] = deque()  # when (monotonic s), what
        self._heard_at = time.monotonic()
        self._running = True
        self._lock = threading.RLock()
        self._thread = threading.Thread(target=self._serve, name="simulated line", daemon=True)
        self._thread.start()

    @property
    def port(self) -> str:
        """What a program opens; after a replug it may be another."""
        return self._end.port

    def unplug(self) -> None:
        """Pull the cable; the mount goes on doing what it does."""
        with self._lock:
            self._outgoing.clear()
            self._end.unplug()

    def plug(self) -> None:
        """Put the cable back."""
        with self._lock:
            self._end.plug()

    def stop(self) -> None:
        """End the thread and remove the port; may be called twice."""
        if not self._running:
            return
        self._running = False
        self._thread.join(timeout=5.0)
        self.unplug()

    def _serve(self) -> None:
        while self._running:
            with self._lock:
                watched = self._end.watched()
                due = self._outgoing[0][0] if self._outgoing else math.inf
            patience = min(max(0.0, due - time.monotonic()), LOOK_S)
            try:
                ready, _, _ = select.select(watched, [], [], patience)
            except (OSError, ValueError):  # unplugged while waiting; on Windows an empty list, too
                time.sleep(LOOK_S)
                continue
            with self._lock:
                self._send_due()
                if ready:
                    self._hear()

    def _hear(self) -> None:
        try:
            data = self._end.read()
        except OSError:
            return
        if not data:
            return
        now = time.monotonic()
        # a program that died in mid-command must not spoil the first command of the next
        if now - self._heard_at > IDLE_S:
            self._responder.idle()
        self._heard_at = now
        self.transcript.append(("<", data))
        reply = self._responder.feed(data)
        # the command has been carried out: only its answer is lost
        if self.faults.happens(Fault.UNPLUG):
            self.unplug()
        elif reply:
            self._queue(self.faults.shape(reply))

    def _queue(self, pieces: list[tuple[float, bytes]]) -> None:
        due = time.monotonic()
        earliest = self._outgoing[-1][0] if self._outgoing else 0.0
        for wait, data in pieces:
            due = max(due + wait, earliest)  # answers come in the order of the questions
            self._outgoing.append((due, data))
        self._send_due()

    def _send_due(self) -> None:
        while self._outgoing and self._outgoing[0][0] <= time.monotonic():
            _, data = self._outgoing.popleft()
            self.transcript.append((">", data))
            with contextlib.suppress(OSError):
                self._end.write(data)


def pty_line(responder: Controller, faults: Faults | None = None) -> Line:
    """Serve on a new pseudo-terminal; the caller stops it."""
    return Line(PtyEnd(), responder, faults)


def socket_line(responder: Controller, faults: Faults | None = None, number: int = 0) -> Line:
    """Serve on TCP port ``number`` of the loopback, 0 for any free; the caller stops it."""
    return Line(SocketEnd(number), responder, faults)


own_line = socket_line if sys.platform == "win32" else pty_line
"""The line of a mount of our own: a pseudo-terminal, and a socket where the system has none."""
