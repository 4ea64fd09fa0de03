"""What one bolt has been seen to do: direction, arcseconds a turn, play."""

from dataclasses import dataclass, replace
from enum import StrEnum


SEEN, WORTH = 4.0, 15.0
"""A change of so many sigmas is real; one of so many corrects what was known."""

SHARE_OF_PLAY = 0.8
"""It is better to stop short and go on than to come back through the play again."""

MOST_PLAY_TURNS = 0.5


class Knob(StrEnum):
    """The two ways a polar axis is moved."""

    ALTITUDE = "altitude"
    AZIMUTH = "azimuth"


@dataclass(frozen=True, slots=True)
class Bolt:
    """A bolt and what is known of it; clockwise, looking at its head, is positive.

    ``arcsec_a_turn`` is what a full clockwise turn adds to its own error, None before the first
    test; ``sure`` once it was seen without play. ``play_turns`` are lost at a reversal.
    ``direction`` is the sign of the last turn, 0 when not known, with the play taken up that way.
    """

    knob: Knob
    name: str
    arcsec_a_turn: float | None = None
    sure: bool = False
    play_turns: float = 0.0
    direction: int = 0

    def needed(self, error_arcsec: float) -> float:
        """Turns that would bring its error to zero; most of its play included when it reverses."""
        if self.arcsec_a_turn is None:
            raise ValueError(f"The {self.name} has not been tested.")
        turns = -error_arcsec / self.arcsec_a_turn
        sign = 1.0 if turns > 0 else -1.0
        return turns + sign * SHARE_OF_PLAY * self.play_turns * (self.direction == -sign)

    def learned(self, turns: float, change_arcsec: float, sigma_arcsec: float) -> "Bolt":
        """What is known after ``turns`` changed its error by ``change_arcsec`` (one sigma)."""
        sign = 1 if turns > 0 else -1
        reversed_ = self.direction != sign
        after = replace(self, direction=sign)
        gain = self.arcsec_a_turn
        if abs(change_arcsec) < SEEN * sigma_arcsec:
            return replace(after, play_turns=max(self.play_turns, abs(turns))) if reversed_ else after
        own = change_arcsec / turns
        if gain is None or not self.sure:
            # Play only ever makes a turn look smaller: of two looks through it the larger is right.
            through_play = reversed_ and gain is not None and abs(gain) > abs(own)
            return replace(
                after, arcsec_a_turn=gain if through_play else own, sure=not reversed_
            )
        if reversed_:
            lost = abs(turns) - sign * change_arcsec / gain
            return replace(after, play_turns=float(min(max(lost, 0.0), MOST_PLAY_TURNS)))
        if gain * change_arcsec * sign < 0:  # not as it was thought: begin anew
            return replace(after, arcsec_a_turn=None, sure=False)
        if abs(change_arcsec) > WORTH * sigma_arcsec:
            return replace(after, arcsec_a_turn=(own + gain) / 2.0)
        return after


ALTITUDE_BOLT = Bolt(Knob.ALTITUDE, "altitude bolt")
AZIMUTH_BOLT = Bolt(Knob.AZIMUTH, "left azimuth bolt")
