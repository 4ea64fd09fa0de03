"""What every simulated mount controller is: bytes in, bytes out, over one telescope."""

from collections.abc import Callable
from importlib import import_module
from typing import Protocol

from app.simulate.responders import RESPONDERS
from app.simulate.telescope import Telescope


class Responder(Protocol):
    """A byte machine: it neither waits, nor reads a clock, nor raises on any bytes."""

    refusal: Callable[[], str | None]

    def feed(self, data: bytes) -> bytes:
        """Take bytes off the line, whole commands or parts, and give what is answered to them."""

    def idle(self) -> None:
        """The line has been quiet for long: forget half a command, as hand controllers do."""


class Controller:
    """The common half: a buffer for the unfinished command, and motions that can be refused.

    ``refusal`` is asked before every goto and sync; a reason refuses it, in the words each
    protocol has for that.
    """

    longest = 64  # bytes that are kept of an unfinished command

    def __init__(self, telescope: Telescope) -> None:
        self.telescope = telescope
        self.refusal: Callable[[], str | None] = lambda: None
        self._pending = bytearray()

    def feed(self, data: bytes) -> bytes:
        """Answer every command that ``data`` completes, in order."""
        self._pending += data
        replies = bytearray()
        while (command := self._take()) is not None:
            replies += self._answer(command)
        return bytes(replies)

    def idle(self) -> None:
        """Forget half a command."""
        self._pending.clear()

    def _take(self) -> bytes | None:
        """Cut the next whole command off the buffer, or None until more has come."""
        raise NotImplementedError

    def _answer(self, command: bytes) -> bytes:
        raise NotImplementedError

    def _goto(self, ra_deg: float, dec_deg: float) -> str | None:
        return self.refusal() or self.telescope.goto(ra_deg % 360.0, dec_deg)

    def _sync(self, ra_deg: float, dec_deg: float) -> str | None:
        return self.refusal() or self.telescope.sync(ra_deg % 360.0, dec_deg)


def open_responder(name: str, telescope: Telescope) -> Responder:
    """The simulated controller registered as ``name``, over ``telescope``."""
    module, _, cls = RESPONDERS[name].partition(":")
    responder: Responder = getattr(import_module(module), cls)(telescope)
    return responder
