"""An encoder box, written from the protocol's descriptions: [wiki] synfinatic/teensy-dsc, page DSCCommands, which
lists Tangent, BBox, Intelliscope and NGC-MAX; [indi] dsc.cpp, which reads such boxes. tests/gear/test_encoders.py lets
INDI's driver read it."""

import os
import select
import threading

import pytest

pty, tty = (pytest.importorskip(name) for name in ("pty", "tty"))  # Windows has none


class DscBox:
    """Counts ``angles()``, degrees of both axes, modulo a turn. ``ends`` is what an answer ends with (NGC-MAX: nothing).
    ``tells`` whether it answers H (Tangent does). ``says`` replaces the answers while it is not None."""

    def __init__(self, angles, in_a_turn=(8192, 10000), sense=(1, -1), ends=b"\r", tells=True):
        self.angles, self.in_a_turn, self.sense, self.ends, self.tells = angles, in_a_turn, sense, ends, tells
        self.offset, self.says, self._ending = [0, 0], None, threading.Event()

    def answer(self, byte):
        if self.says is not None:
            return self.says
        if byte == b"H" and self.tells:
            return b"%d\t%d\r" % self.in_a_turn  # [wiki]: no sign, no leading zeros
        if byte != b"Q":
            return b""
        counts = []
        for angle, turn, sense, offset in zip(self.angles(), self.in_a_turn, self.sense, self.offset, strict=True):
            count = (round(angle / 360.0 * turn) * sense + offset) % turn
            counts.append(count - turn if count > turn // 2 else count)
        return b"%+06d\t%+06d" % tuple(counts) + self.ends

    def __enter__(self):
        self._fds = list(pty.openpty())
        tty.setraw(self._fds[1])
        self.port = os.ttyname(self._fds[1])
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()
        return self

    def _serve(self):
        while not self._ending.is_set():
            if not select.select([self._fds[0]], [], [], 0.02)[0]:
                continue
            for byte in os.read(self._fds[0], 64):
                if (said := self.answer(bytes([byte]))) and select.select([], [self._fds[0]], [], 0)[1]:
                    os.write(self._fds[0], said)

    def pull(self, *_):
        """Pulls the cable, and ends it."""
        self._ending.set()
        self._thread.join(2)
        while self._fds:
            os.close(self._fds.pop())

    __exit__ = pull
