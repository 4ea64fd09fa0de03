"""What carries the mount, and what each of its two adjustments has been seen to do.

:meth:`Bolt.learned` takes one turn and what it changed. A bolt is *proved* once two turns in a row moved the axis the
same way, one of them without backlash; a turn against that takes the proof away until another settles it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from kochab.core import tr_noop
from kochab.polar.error import Knob


class Base(StrEnum):
    """What carries the mount; the texts are on the screen."""

    BOLTS = tr_noop("Tripod or pier with bolts")
    WEDGE = tr_noop("Wedge")
    HEAD = tr_noop("Tripod head, by hand")
    PLATFORM = tr_noop("Equatorial platform")


BY_HAND = {(Base.PLATFORM, Knob.AZIMUTH), (Base.HEAD, Knob.ALTITUDE), (Base.HEAD, Knob.AZIMUTH)}
WHOLE_TURN_ARCSEC, HAND_ARCSEC = 1_296_000.0, 240.0  # of what has no thread; and a goal that a hand reaches without one

# -- What one bolt has been seen to do: direction, arcseconds a turn, backlash -----------------

SEEN, WORTH = 4.0, 15.0  # a change of so many sigmas is real; one of so many corrects what was known
SHARE_OF_BACKLASH = 0.8  # it is better to stop short and go on than to come back through the backlash again

MOST_BACKLASH_TURNS = 0.5
HAND_TURNS = 0.02  # that a hand may be off

TELLING_TURNS = 10.0 / 360.0  # a hand is a degree off in any turn: less than this says little about the thread
FULL_TURNS, LOSSY = 0.25, 0.4  # turned, from which on a reading has its full weight; and of one that backlash shortened
PROVING_TURNS = 0.12  # less than this never takes a proof away
READINGS = 12  # of a bolt that are kept
SAME_THREAD_FACTOR = 2.0  # a first reading within this factor of another night's is of the same thread


class Reading(NamedTuple):
    """What a clockwise turn added, by one turn of so many; ``whole`` when no backlash took a part of it."""

    arcsec_a_turn: float
    turns: float
    whole: bool


@dataclass(frozen=True, slots=True)
class Bolt:
    """A bolt and what is known of it; clockwise, looking at its head, is positive.

    ``arcsec_a_turn`` is what a full clockwise turn adds to its own error, None before the first
    test; ``proved`` once two turns agreed on it. ``backlash_turns`` are lost at a reversal.
    ``direction`` is the sign of the last turn that was seen to move the axis, 0 before the first;
    ``taken_turns`` is how much of the backlash has been taken up the other way since. What a hand moves without a
    thread goes by whole turns of its own, up and clockwise from above.
    """

    knob: Knob
    name: str
    arcsec_a_turn: float | None = None
    proved: bool = False
    backlash_turns: float = 0.0
    direction: int = 0
    taken_turns: float = 0.0
    base: Base = Base.BOLTS
    readings: tuple[Reading, ...] = ()

    @property
    def by_hand(self) -> bool:
        """Whether a hand moves it, and no thread."""
        return (self.base, self.knob) in BY_HAND

    def needed(self, error_arcsec: float) -> float:
        """Turns that would bring its error to zero; most of its backlash included when it reverses."""
        if self.arcsec_a_turn is None:
            raise ValueError(f"The {self.name} has not been tested.")
        turns = -error_arcsec / self.arcsec_a_turn
        sign = 1.0 if turns > 0 else -1.0
        if self.direction != -sign:
            return turns
        return turns + sign * max(0.0, SHARE_OF_BACKLASH * self.backlash_turns - self.taken_turns)

    def learned(self, turns: float, change_arcsec: float, sigma_arcsec: float) -> "Bolt":
        """What is known after ``turns`` changed its error by ``change_arcsec`` (one sigma)."""
        sign = 1 if turns > 0 else -1
        reverses = self.direction != sign
        taken = abs(turns) + self.taken_turns * reverses
        if abs(change_arcsec) < SEEN * sigma_arcsec:
            # Still in its backlash, if it reversed; else the turn was too small to be seen.
            lost = max(self.backlash_turns, min(taken, MOST_BACKLASH_TURNS)) if reverses else self.backlash_turns
            return replace(self, backlash_turns=lost, taken_turns=taken * reverses)
        after = replace(self, direction=sign, taken_turns=0.0)
        gain, own = self.arcsec_a_turn, change_arcsec / turns
        lost = taken if gain is None else taken - change_arcsec / gain * sign
        against = gain is not None and gain * own < 0
        small = gain is not None and abs(turns) < TELLING_TURNS
        if small and against:
            return self  # a hand that lets go
        if self.proved and reverses and not against and lost > -HAND_TURNS:  # less: it went farther than it should
            after = replace(after, backlash_turns=float(np.clip(lost, 0.0, MOST_BACKLASH_TURNS)))
        if self.proved and not against and abs(change_arcsec) < WORTH * sigma_arcsec:
            return after
        if self.proved and against:
            after = replace(after, direction=-sign)  # the hand went the other way, more likely than the thread
        return after._read(Reading(own, abs(turns), not against and not reverses))

    def moved_by_mistake(self, change_arcsec: float) -> "Bolt":
        """The other bolt was asked for: only which way this one went is known, if it was tested before."""
        if not self.arcsec_a_turn:
            return replace(self, direction=0, taken_turns=0.0)
        return replace(self, direction=1 if change_arcsec * self.arcsec_a_turn > 0.0 else -1, taken_turns=0.0)

    def _read(self, new: Reading) -> "Bolt":
        """One more reading; the thread is the median of those that agree with its sense."""
        gain, kept = self.arcsec_a_turn, self.readings
        if gain is not None and not kept:  # of another night: as good as a reading, if it is of this thread
            same = (
                self.proved
                or new.turns < TELLING_TURNS
                or 1.0 / SAME_THREAD_FACTOR < new.arcsec_a_turn / gain < SAME_THREAD_FACTOR
            )
            kept, gain = ((Reading(gain, 1.0, True),), gain) if same else ((), None)
        agree = any(
            1.0 / SAME_THREAD_FACTOR < new.arcsec_a_turn / one.arcsec_a_turn < SAME_THREAD_FACTOR for one in kept[-2:]
        )
        turned = agree or not kept or kept[-1].arcsec_a_turn * new.arcsec_a_turn > 0.0
        sense = new.arcsec_a_turn if turned or gain is None else gain
        agree = any(
            1.0 / SAME_THREAD_FACTOR < new.arcsec_a_turn / one.arcsec_a_turn < SAME_THREAD_FACTOR for one in kept[-2:]
        )
        turned = agree or not kept or kept[-1].arcsec_a_turn * new.arcsec_a_turn > 0.0
        sense = new.arcsec_a_turn if turned or gain is None else gain
        kept = (*kept, new)
        if len(kept) > READINGS:
            lightest = min(kept[:-1], key=_weight)
            kept = tuple(one for one in kept if one is not lightest)
        like = [one for one in kept if one.arcsec_a_turn * sense > 0.0]
        proves = agree and any(one.whole for one in like)
        proved = self.proved if new.turns < PROVING_TURNS and self.proved else proves
        return replace(self, arcsec_a_turn=_best(like), proved=proved, readings=kept)


def _weight(one: Reading) -> float:
    """A small turn counts as much as it turned, for a hand is as far off in any; less what lost some in backlash."""
    return min(one.turns, FULL_TURNS) * (1.0 if one.whole else LOSSY)


def _best(like: Sequence[Reading]) -> float:
    """The weighted median of what agrees in sense; between two halves their mean."""
    if not any(one.whole for one in like):
        # Backlash only ever makes a turn look smaller: of such readings alone the largest is nearest.
        most = max(one.turns for one in like)
        return max((one.arcsec_a_turn for one in like if one.turns >= most / 2.0), key=abs)
    return _median(_densest(sorted(like, key=lambda one: abs(one.arcsec_a_turn))))


def _densest(ordered: list[Reading]) -> list[Reading]:
    """The readings, in order, that agree best among those that hold more than half of the weight."""
    half = sum(_weight(one) for one in ordered) / 2.0
    best, least = ordered, float("inf")
    for first in range(len(ordered)):
        weights = np.cumsum([_weight(one) for one in ordered[first:]])
        last = first + int(np.searchsorted(weights, half * (1.0 + 1e-9)))
        if last < len(ordered) and (ratio := ordered[last].arcsec_a_turn / ordered[first].arcsec_a_turn) < least:
            best, least = ordered[first : last + 1], ratio
    return best


def _median(ordered: list[Reading]) -> float:
    """The weighted median; between two halves their mean."""
    below = np.cumsum([_weight(one) for one in ordered])
    middle = below[-1] / 2.0
    low, high = (int(np.searchsorted(below, middle * (1.0 + side))) for side in (-1e-9, 1e-9))
    return (ordered[low].arcsec_a_turn + ordered[high].arcsec_a_turn) / 2.0


ALTITUDE_BOLT = Bolt(Knob.ALTITUDE, "altitude bolt")
AZIMUTH_BOLT = Bolt(Knob.AZIMUTH, "left azimuth bolt")


Pitches = tuple[float | None, float | None]
"""What a clockwise turn of the altitude and of the left azimuth bolt adds, arcsec; None if unknown."""


def bolts_of(base: Base, known: Pitches = (None, None)) -> tuple[Bolt, Bolt]:
    """Both of a base; ``known`` is what a turn of each did another night."""
    altitude, azimuth = (replace(bolt, base=base) for bolt in (ALTITUDE_BOLT, AZIMUTH_BOLT))
    return _with_pitch(altitude, known[0]), _with_pitch(azimuth, known[1])


def _with_pitch(bolt: Bolt, known: float | None) -> Bolt:
    if bolt.by_hand:
        return replace(bolt, arcsec_a_turn=WHOLE_TURN_ARCSEC, proved=True)
    return replace(bolt, arcsec_a_turn=known or None)
