"""The box that counts a push-to telescope's encoders (digital setting circles), on a serial port or over TCP.

``Q`` is answered by both counts, ``+01234<tab>-00045<cr>``: first RA or azimuth, then Dec or altitude. ``H`` asks the
Tangent family for the counts of a turn, at which such a box begins anew; others do not answer it. Some end with no
carriage return. Sources: INDI's dsc.cpp, and "DSCCommands" of synfinatic/teensy-dsc, which compares Tangent, BBox,
Intelliscope and NGC-MAX.
"""

import re
from contextlib import suppress

from kochab.core.errors import LineLostError, NoAnswerError
from kochab.gear.mounts.serial_line import SerialLink

BAUD = 9600
ANSWER_S, PAUSE_S = 0.6, 0.3
TRIES = 8
"""An Arduino starts anew when its port is opened, and is silent for some seconds."""
LONGEST = 40
TWO_NUMBERS = re.compile(rb"\s*([-+]?\d{1,9})[\t ,]\s*([-+]?\d{1,9})\s*")


class EncoderBox:
    """Opens the port and waits until the box answers.

    Raises `PortError` without a port, and `NoAnswerError` when no two counts come.
    """

    def __init__(self, port: str) -> None:
        self.port = port
        self._link = SerialLink(port, BAUD)
        self._raw: tuple[int, int] | None = None
        self._counts = (0, 0)
        self.in_a_turn: tuple[int, int] | None = None
        """As the box says; None when it does not."""
        try:
            self._wait()
            with suppress(NoAnswerError):
                first, second = self._asked(b"H")
                self.in_a_turn = (abs(first), abs(second)) if first and second else None
        except BaseException:
            self.close()
            raise

    def counts(self) -> tuple[float, float]:
        """Of both axes, counted on over the place where the box begins anew.

        Raises `NoAnswerError` when it is silent or sends something else, `LineLostError` when the line is gone.
        """
        new = self._asked(b"Q")
        if self._raw is None:
            self._counts = new
        else:
            first, second = (
                count + _step(raw, before, turn)
                for count, raw, before, turn in zip(self._counts, new, self._raw, self.in_a_turn or (0, 0), strict=True)
            )
            self._counts = first, second
        self._raw = new
        return float(self._counts[0]), float(self._counts[1])

    def close(self) -> None:
        """Give the port back."""
        self._link.close()

    def _wait(self) -> None:
        for left in reversed(range(TRIES)):
            try:
                self._asked(b"Q")
                return
            except NoAnswerError:
                if not left:
                    raise

    def _asked(self, command: bytes) -> tuple[int, int]:
        try:
            self._link.discard()
            self._link.write(command)
            got = self._answer()
        except LineLostError:
            raise LineLostError("Lost the encoders on {port}. Check their cable and power.", port=self.port) from None
        if (found := TWO_NUMBERS.fullmatch(got)) is None:
            raise NoAnswerError(
                "The encoders on {port} sent {got!r}: no two counts. Is this an encoder box?",
                port=self.port,
                got=got[:LONGEST],
            )
        return int(found[1]), int(found[2])

    def _answer(self) -> bytes:
        got = b""
        while len(got) < LONGEST and not (got.strip() and got.endswith((b"\r", b"\n"))):
            try:
                got += self._link.read_exact(1, PAUSE_S if got else ANSWER_S)
            except NoAnswerError:
                if got.strip():
                    break
                raise NoAnswerError("No encoders answer on {port}.", port=self.port) from None
        return got


def _step(raw: int, before: int, in_a_turn: int) -> int:
    """How far an axis has turned between two looks; over the box's own end the short way."""
    step = raw - before
    return step if not in_a_turn else (step + in_a_turn // 2) % in_a_turn - in_a_turn // 2
