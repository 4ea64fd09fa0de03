"""What one bolt has been seen to do: direction, arcseconds a turn, play."""

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

SEEN, WORTH = 4.0, 15.0
"""A change of so many sigmas is real; one of so many corrects what was known."""

SHARE_OF_PLAY = 0.8
"""It is better to stop short and go on than to come back through the play again."""

MOST_PLAY_TURNS = 0.5

TELLING_TURNS = 10.0 / 360.0
"""A hand is a degree off in any turn: what less than this did says little of the thread."""


class Knob(StrEnum):
    """The two ways a polar axis is moved."""

    ALTITUDE = "altitude"
    AZIMUTH = "azimuth"


@dataclass(frozen=True, slots=True)
class Bolt:
    """A bolt and what is known of it; clockwise, looking at its head, is positive.

    ``arcsec_a_turn`` is what a full clockwise turn adds to its own error, None before the first
    test; ``sure`` once it was seen without play. ``play_turns`` are lost at a reversal.
    ``direction`` is the sign of the last turn that was seen to move the axis, 0 before the first;
    ``taken_turns`` is how much of the play has been taken up the other way since.
    """

    knob: Knob
    name: str
    arcsec_a_turn: float | None = None
    sure: bool = False
    play_turns: float = 0.0
    direction: int = 0
    taken_turns: float = 0.0

    def needed(self, error_arcsec: float) -> float:
        """Turns that would bring its error to zero; most of its play included when it reverses."""
        if self.arcsec_a_turn is None:
            raise ValueError(f"The {self.name} has not been tested.")
        turns = -error_arcsec / self.arcsec_a_turn
        sign = 1.0 if turns > 0 else -1.0
        if self.direction != -sign:
            return turns
        return turns + sign * max(0.0, SHARE_OF_PLAY * self.play_turns - self.taken_turns)

    def learned(self, turns: float, change_arcsec: float, sigma_arcsec: float) -> "Bolt":
        """What is known after ``turns`` changed its error by ``change_arcsec`` (one sigma)."""
        sign = 1 if turns > 0 else -1
        reverses = self.direction != sign
        taken = abs(turns) + self.taken_turns * reverses
        if abs(change_arcsec) < SEEN * sigma_arcsec:
            # Still in its play, if it came back; else too little was asked for to be seen.
            lost = (
                max(self.play_turns, min(taken, MOST_PLAY_TURNS)) if reverses else self.play_turns
            )
            return replace(self, play_turns=lost, taken_turns=taken * reverses)
        after = replace(self, direction=sign, taken_turns=0.0)
        gain, own = self.arcsec_a_turn, change_arcsec / turns
        if gain is not None and abs(turns) < TELLING_TURNS:
            return self._nudged(after, taken - change_arcsec / gain * sign, gain * own > 0)
        if gain is None or gain * own < 0:
            return replace(after, arcsec_a_turn=own, sure=not reverses)
        if not self.sure:
            # Play only ever makes a turn look smaller: of two looks the larger is right.
            return replace(after, arcsec_a_turn=max(gain, own, key=abs), sure=not reverses)
        if reverses:
            lost = taken - change_arcsec / gain * sign
            return replace(after, play_turns=float(min(max(lost, 0.0), MOST_PLAY_TURNS)))
        if abs(change_arcsec) > WORTH * sigma_arcsec:
            return replace(after, arcsec_a_turn=(own + gain) / 2.0)
        return after

    def _nudged(self, after: "Bolt", lost_turns: float, as_told: bool) -> "Bolt":
        """What a very small turn teaches: that its play is taken up, and how long that took."""
        if not as_told:
            return self
        if not self.sure or self.direction == after.direction:
            return after
        return replace(after, play_turns=float(np.clip(lost_turns, 0.0, MOST_PLAY_TURNS)))


ALTITUDE_BOLT = Bolt(Knob.ALTITUDE, "altitude bolt")
AZIMUTH_BOLT = Bolt(Knob.AZIMUTH, "left azimuth bolt")
