"""A simulated mount served on a pseudo-terminal or a socket, in a thread of its own.

>>> with serve_pty(Lx200(telescope)) as port: ...  # a path that any program can open
"""

import contextlib
import select
import socket
import threading
import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path

from app.simulate.line_ends import LineEnd, PtyEnd, SocketEnd
from app.simulate.line_faults import Fault, Faults
from app.simulate.responders.base import Responder

IDLE_S = 1.5  # a command that stands half-written for so long is forgotten


class Line:
    """Passes bytes between one end and a responder until :meth:`stop`.

    ``faults`` may be used while it runs. ``transcript`` keeps the last exchanges: direction
    (``<`` from the computer, ``>`` to it) and bytes.
    """

    def __init__(self, end: LineEnd, responder: Responder, faults: Faults | None = None) -> None:
        self.faults = faults or Faults()
        self.transcript: deque[tuple[str, bytes]] = deque(maxlen=1000)
        self._end, self._responder = end, responder
        responder.refusal = self.faults.refusal
        self._outgoing: deque[tuple[float, bytes]] = deque()  # when (monotonic s), what
        self._heard_at = time.monotonic()
        self._plugged, self._running = True, True
        self._ours, self._theirs = socket.socketpair()
        self._ours.setblocking(False)
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
            self._plugged = False
            self._outgoing.clear()
            self._end.unplug()
        self._wake()

    def plug(self) -> None:
        """Put the cable back."""
        with self._lock:
            self._end.plug()
            self._plugged = True
        self._wake()

    def stop(self) -> None:
        """End the thread and remove the port; may be called twice."""
        if not self._running:
            return
        self._running = False
        self._wake()
        self._thread.join(timeout=5.0)
        self.unplug()
        self._ours.close()
        self._theirs.close()

    def _wake(self) -> None:
        with contextlib.suppress(OSError):
            self._theirs.send(b"!")

    def _serve(self) -> None:
        waker = self._ours.fileno()
        while self._running:
            with self._lock:
                watched = self._end.watched()
            try:
                ready, _, _ = select.select([waker, *watched], [], [], self._patience_s())
            except (OSError, ValueError):  # unplugged while waiting
                continue
            with self._lock:
                self._send_due()
                for one in ready:
                    if one == waker:
                        self._ours.recv(64)
                    else:
                        self._hear(one)

    def _patience_s(self) -> float:
        """Until the next piece is due, or until half a command is forgotten."""
        with self._lock:
            if self._outgoing:
                return max(0.0, self._outgoing[0][0] - time.monotonic())
        return IDLE_S

    def _hear(self, ready: int) -> None:
        if ready not in self._end.watched():
            return
        try:
            data = self._end.read(ready)
        except OSError:
            return
        now = time.monotonic()
        if not data:
            return
        if now - self._heard_at > IDLE_S:
            self._responder.idle()
        self._heard_at = now
        self.transcript.append(("<", data))
        reply = self._responder.feed(data)
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


def pty_line(responder: Responder, faults: Faults | None = None, link: Path | None = None) -> Line:
    """Serve on a new pseudo-terminal; the caller stops it."""
    return Line(PtyEnd(link), responder, faults)


def socket_line(responder: Responder, faults: Faults | None = None, number: int = 0) -> Line:
    """Serve on TCP port ``number`` of the loopback, 0 for any free; the caller stops it."""
    return Line(SocketEnd(number), responder, faults)


@contextlib.contextmanager
def serve_pty(responder: Responder, faults: Faults | None = None) -> Iterator[str]:
    """The path of a pseudo-terminal on which ``responder`` answers while the block lasts."""
    line = pty_line(responder, faults)
    try:
        yield line.port
    finally:
        line.stop()


@contextlib.contextmanager
def serve_socket(responder: Responder, faults: Faults | None = None) -> Iterator[str]:
    """``socket://127.0.0.1:PORT`` on which ``responder`` answers while the block lasts."""
    line = socket_line(responder, faults)
    try:
        yield line.port
    finally:
        line.stop()
