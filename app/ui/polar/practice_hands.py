"""Hands for the practice telescope: they turn what a person is told to turn.

How far a turn of a bolt moves the axis, and which way, is hidden here as it is at a real mount.
"""

import random

from app.core.mount import Direction, PierSide
from app.polar.bolts import Knob
from app.polar.tutor import Instruction
from app.ui.polar.state import State
from app.ui.wiring import Practice

ARCMIN_A_TURN = (15.0, 60.0)
AXES = {
    Direction.WEST: ("ra", 1.0), Direction.EAST: ("ra", -1.0),
    Direction.NORTH: ("dec", 1.0), Direction.SOUTH: ("dec", -1.0),
}  # fmt: skip
CARELESS = 0.05  # of every turn; hands are no machines
SLACK_TURNS = 1.0 / 360.0


class PracticeHands:
    """Does what the screen asks; both ends of the practice are in this program."""

    def __init__(self, practice: Practice, seed: int | None = None) -> None:
        self._practice = practice
        self._chance = random.Random(seed)
        self._arcmin = {
            knob: self._chance.uniform(*ARCMIN_A_TURN) * self._chance.choice((-1.0, 1.0))
            for knob in Knob
        }

    def obey(self, state: State) -> str:
        """Turn what is asked for, and say what was done."""
        if state.asked is not None:
            return self._turn_axis(state)
        told = state.instruction
        if told is None or told.knob is None:
            return "There is nothing to turn now."
        return self._turn_bolt(told)

    def _turn_axis(self, state: State) -> str:
        assert state.asked is not None
        axis, sign = AXES[state.asked.direction]
        if axis == "dec" and self._practice.rig.mount.pier_side is PierSide.WEST:
            sign = -sign  # the tube hangs the other way round there
        degrees = sign * state.asked.degrees * self._chance.gauss(1.0, CARELESS)
        self._practice.do(f"{axis} {degrees:.3f}")
        name = "RA" if axis == "ra" else "declination"
        return f"The {name} axis was turned by {abs(degrees):.0f}°."

    def _turn_bolt(self, told: Instruction) -> str:
        assert told.knob is not None
        turns = told.turns * self._chance.gauss(1.0, CARELESS)
        turns += self._chance.gauss(0.0, SLACK_TURNS)
        arcmin = turns * self._arcmin[told.knob]
        name = "alt" if told.knob is Knob.ALTITUDE else "az"
        self._practice.do(f"{name} {arcmin:.5f}")
        return f"The {told.bolt} was turned."
