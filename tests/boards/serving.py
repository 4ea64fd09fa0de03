"""Boards behind a pseudo-terminal or a TCP port, one thread each."""

import os
import select
import socket
import threading

TICK_S = 0.025  # what is asked is answered at once; 0.01 took 40 % of all that a test behind INDI computes


class Line:
    """Serve a board until :meth:`close`; ``port`` is what a program opens."""

    def __init__(self, board, tcp=os.name == "nt"):
        self.board = board
        self._ends = []
        self._listener = None
        if tcp:
            self._listener = socket.create_server(("127.0.0.1", 0))
            self.port = f"socket://127.0.0.1:{self._listener.getsockname()[1]}"
        else:
            import tty  # not on Windows

            master, slave = os.openpty()  # the slave stays open: the port is there while the board has no power
            tty.setraw(slave)
            os.set_blocking(master, False)
            self._ends, self._slave = [master], slave
            self.port = os.ttyname(slave)
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self):
        """End the thread and give the port back."""
        self._done.set()
        self._thread.join(10)
        for end in self._ends:
            _close(end)
        if self._listener is None:
            os.close(self._slave)
        else:
            self._listener.close()

    def unplug(self):
        """Break every connection of a TCP line; the next one is taken."""
        with self.board.lock:
            for end in self._ends:
                _close(end)
            self._ends = []

    def _run(self):
        while not self._done.is_set():
            wanted = [*self._ends, *([self._listener] if self._listener else [])]
            try:
                ready = select.select(wanted, [], [], TICK_S)[0]
            except OSError:  # unplugged meanwhile
                continue
            with self.board.lock:
                for end in ready:
                    if end is self._listener:
                        accepted, _ = end.accept()
                        accepted.setblocking(False)
                        self._ends = [*self._ends, accepted]
                    elif end in self._ends:
                        self._take(end)
                self.board.advance()
                self._send()

    def _take(self, end):
        try:
            data = end.recv(4096) if isinstance(end, socket.socket) else os.read(end, 4096)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if data:
            self.board.receive(data)
        elif self._listener is not None:
            self._ends.remove(end)
            _close(end)

    def _send(self):
        for data in self.board.due():
            for end in self._ends[-1:]:  # the newest client asked
                try:
                    end.send(data) if isinstance(end, socket.socket) else os.write(end, data)
                except OSError:  # nobody reads: the bytes are lost, as on a wire
                    continue


def _close(end):
    """On Windows a socket is not a file descriptor."""
    end.close() if isinstance(end, socket.socket) else os.close(end)
