"""HTTP to a server nobody vouches for: a whole call has one time limit, however slowly its bytes come."""

import http.client
import socket
from collections.abc import Callable
from time import monotonic
from typing import Any


class DeadlineConnection(http.client.HTTPConnection):
    """HTTP whose connecting, sending and receiving all end at ``deadline_s`` (:func:`monotonic`)."""

    deadline_s = 0.0

    def connect(self) -> None:
        """Open the line, within the deadline."""
        self.timeout = self.left_s()
        super().connect()
        self.sock = _DeadlineSocket(self.sock.detach(), self.left_s)

    def left_s(self) -> float:
        """Seconds to the deadline; TimeoutError when it has passed."""
        left = self.deadline_s - monotonic()
        if left <= 0:
            raise TimeoutError
        return left


class _DeadlineSocket(socket.socket):
    """One time limit for many calls: a time-out for each lets a server that trickles go on for hours."""

    def __init__(self, number: int, left_s: Callable[[], float]) -> None:
        super().__init__(fileno=number)
        self._left_s = left_s

    def sendall(self, *data: Any) -> None:
        """Send it all, within the deadline."""
        self.settimeout(self._left_s())
        super().sendall(*data)

    def recv_into(self, *buffer: Any) -> int:
        """Receive what has come, within the deadline."""
        self.settimeout(self._left_s())
        return super().recv_into(*buffer)
