"""A link that follows an exact transcript: it fails on any other byte, and on leftovers."""

from contextlib import contextmanager

from kochab.core.errors import NoAnswerError
from kochab.gear.mounts.drivers.lx200 import Lx200


class ScriptedLink:
    """``script``: (sent, answered) pairs in order."""

    port, lossy = "script", False

    def __init__(self, script):
        self.script = list(script)
        self.buffer = bytearray()
        self.closed = False

    def write(self, data):
        assert self.script, f"{data!r} was sent after the end of the transcript"
        expected, answer = self.script.pop(0)
        assert data == expected, f"{data!r} was sent, {expected!r} was due"
        self.buffer += answer

    def read_exact(self, count, timeout_s):
        return self._take(count)

    def read_until(self, terminator, limit, timeout_s):
        end = self.buffer.find(terminator)
        return self._take(end + len(terminator) if 0 <= end < limit else len(self.buffer) + 1)

    def discard(self, quiet_s=0.0):
        assert not self.buffer, f"left unread: {bytes(self.buffer)!r}"
        return b""

    def close(self):
        self.closed = True

    def _take(self, count):
        if len(self.buffer) < count:
            got = bytes(self.buffer)
            self.buffer.clear()
            raise NoAnswerError(f"silent after {got!r}")
        taken = bytes(self.buffer[:count])
        del self.buffer[:count]
        return taken

    def finished(self):
        assert not self.script, f"never sent: {self.script}"
        assert not self.buffer, f"left unread: {bytes(self.buffer)!r}"


@contextmanager
def transcript(driver, script, **settings):
    """The driver over a script that must be used up when the block ends."""
    link = ScriptedLink(script)
    mount = driver(link, **settings)
    yield mount
    mount.talk.read_pending()
    link.finished()
    mount.watchdog.disarm()


CLASSIC_START = [(b":GVP#", b""), (b":GR#", b"05:30.0#"), (b":U#", b""), (b":GR#", b"05:30:00#")]
__all__ = ["CLASSIC_START", "Lx200", "ScriptedLink", "transcript"]
