"""What carries the mount, and what each of its two adjustments has been seen to do.

:meth:`Bolt.learned` takes one turn and what it changed. A bolt is *proved* once two turns moved the axis and which way
it goes and by how much is sure; a turn against that takes the proof away until others settle it.
"""

from dataclasses import replace
from enum import StrEnum

import numpy as np

from kochab.core.values import frozen
from kochab.polar.bolt_filter import BoltFilter
from kochab.polar.error import Knob
from kochab.text.translation import tr_noop


class Base(StrEnum):
    """What carries the mount; the texts are on the screen."""

    BOLTS = tr_noop("Tripod or pier with bolts")
    WEDGE = tr_noop("Wedge")
    HEAD = tr_noop("Tripod head, by hand")
    PLATFORM = tr_noop("Equatorial platform")


BY_HAND = {(Base.PLATFORM, Knob.AZIMUTH), (Base.HEAD, Knob.ALTITUDE), (Base.HEAD, Knob.AZIMUTH)}
WHOLE_TURN_ARCSEC, HAND_ARCSEC = 1_296_000.0, 240.0  # of what has no thread; and a goal that a hand reaches without one

# -- What one bolt has been seen to do: direction, arcseconds a turn, backlash -----------------

SEEN = 4.0  # a change of so many sigmas is real
SENSE, SPREAD = (
    0.95,
    1.6,
)  # a proved bolt's surety of which way it goes, and the ratio that one sigma of its thread spans
CONTRADICTED = 0.85  # less sure than after one turn
TELLING_ARCSEC = 300.0  # are seen in any noise
PROVING_TURNS = 2  # that were seen to move the axis
SHORT, SHORT_OF_BACKLASH = 0.4, (0.25, 0.3, 0.4, 0.5, 0.75)
"""Quantiles: it is better to stop short and go on than to come back once more; after turns that moved nothing, more."""
SAME_THREAD_FACTOR = 2.0  # a turn within this factor of what the thread says did what it should


@frozen
class Bolt:
    """A bolt and what is known of it; clockwise, looking at its head, is positive.

    ``arcsec_a_turn`` is what a full clockwise turn adds to its own error, None before it was seen to move the axis;
    ``proved`` once turns agreed on it. ``backlash_turns`` are lost at a reversal. ``direction`` is the sign of the turn
    that last moved the axis, 0 before the first. ``seen_turns`` is the largest turn that did what the thread says.
    What a hand moves without a thread goes by whole turns of its own, up and clockwise from above.
    """

    knob: Knob
    name: str
    arcsec_a_turn: float | None = None
    proved: bool = False
    backlash_turns: float = 0.0
    direction: int = 0
    base: Base = Base.BOLTS
    seen_turns: float = 0.0
    moves: int = 0  # turns that were seen to move the axis
    unseen: int = 0  # turns in a row that were not
    filter: BoltFilter | None = None

    @property
    def by_hand(self) -> bool:
        """Whether a hand moves it, and no thread."""
        return (self.base, self.knob) in BY_HAND

    def needed(self, error_arcsec: float) -> float:
        """Turns that would bring its error to zero; most of its backlash included when it reverses."""
        if self.arcsec_a_turn is None:
            raise ValueError(f"The {self.name} has not been tested.")
        turns = -error_arcsec / self.arcsec_a_turn
        if self.filter is None:
            return turns
        likely, direction = self.filter.likely, 1 if turns > 0.0 else -1
        size = float(np.quantile(abs(error_arcsec) / np.abs(likely.arcsec_a_turn), SHORT))
        through = SHORT_OF_BACKLASH[min(self.unseen, len(SHORT_OF_BACKLASH) - 1)]
        return direction * (size + float(np.quantile(likely.slack_turns(direction), through)))

    def test_turns(self, turns: float, most: float) -> float:
        """How far to turn it, at most so far, to see which way it goes: less once its turns contradict each other."""
        if self.filter is None or not self.filter.has_thread or self.surety >= CONTRADICTED:
            return most
        slack = float(np.median(self.filter.slack_turns(1 if turns > 0.0 else -1)))
        return float(np.clip(slack + TELLING_ARCSEC / abs(self.arcsec_a_turn or 1.0), most / 4.0, most))

    @property
    def surety(self) -> float:
        """How surely it goes the way it is believed to, from a half to 1."""
        adds = 0.5 if self.filter is None else self.filter.clockwise_adds
        return max(adds, 1.0 - adds)

    @property
    def wrong_turns(self) -> float:
        """How many turns of it seem to have gone the other way than asked."""
        return 0.0 if self.filter is None or not self.filter.has_thread else self.filter.wrong_turns

    def learned(self, turns: float, change_arcsec: float, sigma_arcsec: float) -> "Bolt":
        """What is known after ``turns`` changed its error by ``change_arcsec`` (one sigma)."""
        before, moves = self.filter, self.moves
        if before is None:
            known = self.arcsec_a_turn
            before = BoltFilter.unknown() if known is None else BoltFilter.other_night(known)
            moves += known is not None  # another night's turns count as one
        seen = bool(abs(change_arcsec) >= SEEN * sigma_arcsec)
        now = before.turned(turns, change_arcsec, sigma_arcsec, seen)
        after = replace(self, filter=now, moves=moves + seen, unseen=0 if seen else self.unseen + 1)
        if not now.has_thread:
            return after
        likely = now.likely
        thread = float(np.median(likely.arcsec_a_turn))
        low, high = np.quantile(np.abs(likely.arcsec_a_turn), (0.16, 0.84))
        turned_over = self.arcsec_a_turn is not None and self.arcsec_a_turn * thread < 0.0
        seen_turns = 0.0 if turned_over else self.seen_turns
        alike = seen and 1.0 / SAME_THREAD_FACTOR < change_arcsec / turns / thread < SAME_THREAD_FACTOR
        return replace(
            after,
            arcsec_a_turn=thread,
            proved=bool(after.moves >= PROVING_TURNS and after.surety >= SENSE and high < SPREAD * low),
            backlash_turns=float(np.median(likely.backlash_turns)),
            direction=int(np.sign(change_arcsec * thread)) if seen else self.direction,
            seen_turns=max(seen_turns, abs(turns)) if alike else seen_turns,
        )

    def moved_by_mistake(self, change_arcsec: float) -> "Bolt":
        """The other bolt was asked for: only which way this one went is known, if it was tested before."""
        if not self.arcsec_a_turn:
            return replace(self, direction=0)
        clockwise = change_arcsec * self.arcsec_a_turn > 0.0
        after = None if self.filter is None else self.filter.moved_by_mistake(clockwise)
        return replace(self, direction=1 if clockwise else -1, filter=after)


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
