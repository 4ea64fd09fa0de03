"""A port as pyserial's that has a board at its other end, in a virtual time."""

from contextlib import contextmanager

TICK_S = 0.01
EXCHANGE_S = 0.02  # until the first byte of an answer is here; 20 characters at 9600 baud


@contextmanager
def _of_the_board(board):
    """Its own faults are not taken for those of a line."""
    try:
        with board.lock:
            yield
    except (OSError, TypeError, ValueError) as fault:
        raise RuntimeError("the board has a fault") from fault


class BoardPort:
    """As much of `serial.Serial` as Kochab uses."""

    def __init__(self, board, time, timeout_s):
        self._board, self._time, self._timeout_s = board, time, timeout_s
        self._came = b""
        self._heard_s = 0.0

    def write(self, data):
        """All of it, at once."""
        self._require_open()
        with _of_the_board(self._board):
            self._board.receive(bytes(data))
        self._heard_s = self._time.monotonic() + EXCHANGE_S
        self._fetch()

    def read(self, size):
        """What has come, or comes until the time is out."""
        end = self._time.monotonic() + self._timeout_s
        while True:
            self._require_open()
            now = self._time.monotonic()
            if now >= self._heard_s and self.in_waiting:
                data, self._came = self._came[:size], self._came[size:]
                return data
            if now >= end:
                return b""
            self._time.sleep(max(min(TICK_S, end - now), min(self._heard_s, end) - now))

    @property
    def in_waiting(self):
        """How many bytes have come."""
        self._require_open()
        self._fetch()
        return len(self._came)

    def close(self):
        """Hear no more."""
        self._board = None

    def _fetch(self):
        with _of_the_board(self._board):
            self._board.advance()
            self._came += b"".join(self._board.due())

    def _require_open(self):
        if self._board is None:
            raise OSError("closed")
