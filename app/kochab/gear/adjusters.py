"""Motorised azimuth and altitude adjusters of a mount's base: the lines of OAPA, AAPA and Avalon's, after GRBL.

``?`` is answered by ``<Idle|MPos:x,y,z|...>``, ``$J=G91G21X100F1000`` moves one motor by so many of the board's own
units, ``!`` stops; X is azimuth, Y altitude. A line that is not understood is answered ``ok``, too: only the position
tells that a motor went. GRBL itself stops a jog by 0x85; its ``!`` would hold for good what has just come to rest.
Sources: the OAPA firmware's README of 1.2.3, N.I.N.A.'s plugin Three Point Polar Alignment, which drives all three, and
GRBL 1.1's documents "Interface" and "Jogging".
"""

import logging
import re
import time
from contextlib import suppress
from enum import StrEnum

from kochab.core.errors import DeviceError, NoAnswerError, RefusedError
from kochab.core.progress import Progress, Task
from kochab.gear.mounts.serial_line import SerialLink
from kochab.text.translation import tr_noop

log = logging.getLogger(__name__)
BAUD, FEED = 115200, 1000
HELLO_S, TRIES = 0.6, 8  # a board that begins anew when its port is opened needs some seconds
ANSWER_S = 3.0  # a motion is not given up because this computer was busy
POLL_S, STALLED_S, LONGEST_S = 0.2, 3.0, 180.0
LONGEST_LINE = 200
STATUS = re.compile(rb"<(\w+)[^|>]*\|[MW]Pos:([-+]?[\d.]+),([-+]?[\d.]+)[^>]*>")


class AdjusterAxis(StrEnum):
    """A motor, by its letter on the line."""

    AZIMUTH = "X"
    ALTITUDE = "Y"


STANDS = {
    AdjusterAxis.AZIMUTH: tr_noop("The azimuth motor moved {gone:g} of {asked:g} units. Is it jammed, or at a stop?"),
    AdjusterAxis.ALTITUDE: tr_noop("The altitude motor moved {gone:g} of {asked:g} units. Is it jammed, or at a stop?"),
}


class Adjusters:
    """Two motors on one line. A motion is bounded by the board itself: it ends also when this program does."""

    def __init__(self, port: str) -> None:
        """Open the port and wait until the board answers; NoAnswerError when it does not, PortError without a port."""
        self._link, self._grbl = SerialLink(port, BAUD), False
        for _ in range(TRIES):
            with suppress(NoAnswerError):
                self._look(HELLO_S)
                return
        self.close()
        raise NoAnswerError("No motorised adjusters answer on {port}.", port=port)

    def move(self, axis: AdjusterAxis, amount: float) -> Task[None]:
        """Move a motor by so many of its board's units and wait until it rests; stopped when this is given up.

        Raises RefusedError when the board refuses, or the motor stands still or stops short of it.
        """
        begun = self._look(ANSWER_S)[1][axis]
        resting, gone, moved_at, began_at = False, 0.0, time.monotonic(), time.monotonic()
        try:
            self._order(f"$J=G91G21{axis}{amount:.3f}F{FEED}".encode())
            while not resting:
                yield Progress("turn", min(1.0, abs(gone / amount)) if amount else 1.0)
                time.sleep(POLL_S)
                state, at = self._look(ANSWER_S)
                now, before, gone = time.monotonic(), gone, at[axis] - begun
                moved_at = moved_at if gone == before else now
                if now - moved_at > STALLED_S or now - began_at > LONGEST_S:
                    break
                # A board may still say Idle before its motor turns: nothing gone yet is no rest.
                resting = state == b"Idle" and gone == before and (gone != 0.0 or amount == 0.0)
        finally:
            if not resting:
                self._see_stopped()
        if abs(gone - amount) > 0.02 * abs(amount) + 1.0:
            raise RefusedError(STANDS[axis], gone=gone, asked=amount)

    def stop(self) -> None:
        """Stop both motors, from any thread; OAPA's firmware before 1.2.1 ends its move first."""
        with suppress(DeviceError):
            self._link.write(b"\x85" if self._grbl else b"!\n")

    def _see_stopped(self) -> None:
        """Stop, and again until both are seen at rest, for some seconds."""
        with suppress(DeviceError):
            before = None
            for _ in range(round(STALLED_S / POLL_S)):
                self.stop()
                time.sleep(POLL_S)
                state, at = self._look(ANSWER_S)
                if state == b"Idle" and at == before:
                    return
                before = at
        log.warning("The adjusters on %s were not seen to stop.", self._link.port)

    def close(self) -> None:
        """Give the port back."""
        self._link.close()

    def _look(self, within_s: float) -> tuple[bytes, dict[AdjusterAxis, float]]:
        """What the board is doing, and where its motors are."""
        self._link.discard()
        self._link.write(b"?\n")
        end = time.monotonic() + within_s
        while time.monotonic() < end:
            if found := STATUS.search(self._link.read_until(b"\n", LONGEST_LINE, within_s)):
                with suppress(NoAnswerError):
                    self._link.read_until(b"\n", LONGEST_LINE, HELLO_S)  # the line's own ok
                azimuth, altitude = (float(text) for text in found.groups()[1:])
                # Only GRBL itself reports its feed; it needs the jog cancel byte (module docstring).
                self._grbl = b"|F" in found[0]
                return found[1], {AdjusterAxis.AZIMUTH: azimuth, AdjusterAxis.ALTITUDE: altitude}
        raise NoAnswerError("The adjusters don't report their position.")

    def _order(self, line: bytes) -> None:
        self._link.discard()
        self._link.write(line + b"\n")
        answer = self._link.read_until(b"\n", LONGEST_LINE, ANSWER_S).strip()
        if answer != b"ok":
            raise RefusedError("The adjusters refuse to move: {answer!r}.", answer=answer)
