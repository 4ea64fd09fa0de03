"""What goes wrong on a line, on demand: for the next few exchanges or with some probability.

An exchange is one batch of bytes from the computer that is answered. Faults may be switched on
and off from any thread while the line is served, and combine: late garbage, split wrong answers.
"""

import random
import threading
from collections import deque
from enum import StrEnum


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
        self._said: deque[bytes] = deque(maxlen=8)

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
        """A reason not to move, for :attr:`Responder.refusal`."""
        return "limits" if self.happens(Fault.REFUSAL) else None

    def shape(self, reply: bytes) -> list[Piece]:
        """What goes out instead of ``reply``, which is not empty, and when."""
        true_reply = reply
        if self.happens(Fault.WRONG):
            reply = self._another(reply)
        self._said.append(true_reply)
        if self.happens(Fault.GARBAGE):
            reply = self._random.randbytes(len(reply))
        if self.happens(Fault.SILENCE):
            return []
        wait = self.late_s if self.happens(Fault.LATE) else 0.0
        if not self.happens(Fault.SPLIT):
            return [(wait, reply)]
        return [(wait if k == 0 else self.gap_s, bytes([c])) for k, c in enumerate(reply)]

    def _another(self, reply: bytes) -> bytes:
        """An earlier answer unlike this one; before there is any, an echo of nothing asked."""
        earlier = [said for said in self._said if said != reply]
        return self._random.choice(earlier) if earlier else b"?#"
