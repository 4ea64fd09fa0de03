"""The bolt tutor: which bolt, which way, how far; it learns each bolt from one test nudge.

A state machine without a window. :meth:`BoltTutor.advise` takes a settled error and returns what to
do next; whoever shows it calls again when the axis has moved and settled, or when the person says
that it was done. One bolt at a time, the larger error first; a bolt is never asked to go
the whole way before it has been seen to go without play, so that it need not come back.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from app.polar.bolts import ALTITUDE_BOLT, AZIMUTH_BOLT, Bolt, Knob
from app.polar.error import PolarError
from app.polar.words import (
    FINEST_DEG,
    angle_in_words,
    rotation_in_words,
    sayable,
    turns_in_words,
)

TEST_TURNS = (0.25, 0.125)
SMALL_ERROR_ARCSEC = 900.0  # for such an error the smaller test is enough
CAUTIOUS, CONFIDENT = 0.6, 0.9
NEAR = 3.0  # tolerances: from here on the whole rest is asked for
NOT_WORTH_IT = 1.6  # tolerances left alone rather than turned back for
HALF_A_HAND = 0.7  # of the finest turn of a hand: less than that is left alone
ENOUGH = 1.45  # goals, when only another move would bring it nearer
WIDEST = 1.7  # tolerances, however coarse the thread
MOST_TURNS = 6.0  # at a time; then it looks again


class Step(StrEnum):
    """What an instruction is for."""

    TEST = "test nudge"
    TURN = "turn"
    STOP = "stop"


@dataclass(frozen=True, slots=True)
class Instruction:
    """One thing to do: ``turns`` of ``bolt``, clockwise positive; ``words`` say it."""

    step: Step
    words: str
    bolt: str = ""
    knob: Knob | None = None
    turns: float = 0.0


class BoltTutor:
    """Guides to the pole. ``moves`` counts the bolts' movements: a bolt going on is one move."""

    def __init__(
        self, goal_arcsec: float = 15.0, bolts: tuple[Bolt, Bolt] = (ALTITUDE_BOLT, AZIMUTH_BOLT)
    ) -> None:
        self.goal_arcsec = goal_arcsec
        self.bolts = {bolt.knob: bolt for bolt in bolts}
        self.moves = 0
        self._pending: Instruction | None = None
        self._before: PolarError | None = None
        self._last: tuple[Knob | None, float] = (None, 0.0)

    def advise(
        self,
        error: PolarError,
        turned: float | None = None,
        noise_arcsec: tuple[float, float] | None = None,
    ) -> Instruction:
        """What to do now.

        Parameters
        ----------
        error
            A settled error, taken after the last instruction was followed.
        turned
            How far the bolt was really turned, when that is known better than as told.
        noise_arcsec
            One-sigma errors of a change along altitude and azimuth on the sky; the error's own
            sigmas when not known, which hold much that two readings share.

        """
        self._learn(error, turned, noise_arcsec or error.sigma_arcsec)
        instruction = self._next(error)
        self._pending, self._before = instruction, error
        if instruction.knob is not None:
            self.moves += not self._goes_on(instruction)
            self._last = (instruction.knob, float(np.sign(instruction.turns)))
        return instruction

    def measured_again(self) -> None:
        """A new measurement stands in for the last reading: nothing is to be learned from it."""
        self._pending = self._before = None

    def tolerance_arcsec(self, error: PolarError, knob: Knob) -> float:
        """How far off this knob may stay, on the sky: a share of the goal, or one sigma."""
        sigma = error.sigma_arcsec[knob is Knob.AZIMUTH]
        return float(max(self.goal_arcsec / np.sqrt(2.0), sigma))

    def _limit(self, error: PolarError, knob: Knob) -> float:
        """The tolerance, wider for a bolt that would have to come back or is too coarse."""
        bolt, tolerance = self.bolts[knob], self.tolerance_arcsec(error, knob)
        if bolt.arcsec_a_turn is None or not bolt.direction:
            return tolerance
        sign = float(np.sign(-_knob_arcsec(error, knob) / bolt.arcsec_a_turn))
        back = sign == -bolt.direction and self._last != (knob, sign)  # else it is on its way
        hand = HALF_A_HAND * abs(bolt.arcsec_a_turn) * FINEST_DEG / 360.0 * _sky_share(error, knob)
        return float(np.clip(hand, tolerance * (NOT_WORTH_IT if back else 1.0), WIDEST * tolerance))

    def _learn(
        self, error: PolarError, turned: float | None, noise_arcsec: tuple[float, float]
    ) -> None:
        told, before = self._pending, self._before
        if told is None or told.knob is None or before is None:
            return
        now, then = _knob_arcsec(error, told.knob), _knob_arcsec(before, told.knob)
        scale = _sky_share(error, told.knob)
        sigma = np.sqrt(2.0) * noise_arcsec[told.knob is Knob.AZIMUTH] / scale
        turns = told.turns if turned is None else turned
        if turns:
            self.bolts[told.knob] = self.bolts[told.knob].learned(turns, now - then, float(sigma))

    def _next(self, error: PolarError) -> Instruction:
        off = {knob: abs(_knob_arcsec(error, knob)) * _sky_share(error, knob) for knob in Knob}
        open_ = [k for k in Knob if off[k] > self._limit(error, k)]
        if not open_ or error.total_arcsec <= self.goal_arcsec:
            return _stop(error, self.goal_arcsec)
        told = self._chosen(open_, off, error)
        if not self._goes_on(told) and error.total_arcsec <= ENOUGH * self.goal_arcsec:
            return _stop(error, self.goal_arcsec)
        return told

    def _chosen(self, open_: list[Knob], off: dict[Knob, float], error: PolarError) -> Instruction:
        """The bolt at hand first, then the larger error, and last one that went a little too far.

        To come back is a new move, and the other bolt may yet drag it home or leave the total good.
        """
        order = sorted(open_, key=lambda knob: (knob is not self._last[0], -off[knob]))
        told = [self._told(knob, off[knob], error) for knob in order]
        return min(told, key=lambda one: self._only_comes_back(one, off, error))

    def _only_comes_back(
        self, told: Instruction, off: dict[Knob, float], error: PolarError
    ) -> bool:
        assert told.knob is not None
        back = not self._goes_on(told) and self.bolts[told.knob].direction == -np.sign(told.turns)
        return bool(back and off[told.knob] < NEAR * self.tolerance_arcsec(error, told.knob))

    def _told(self, knob: Knob, off_arcsec: float, error: PolarError) -> Instruction:
        bolt = self.bolts[knob]
        untested = bolt.arcsec_a_turn is None
        return self._test(bolt, off_arcsec) if untested else self._turn(bolt, error)

    def _goes_on(self, told: Instruction) -> bool:
        return self._last == (told.knob, float(np.sign(told.turns)))

    def _test(self, bolt: Bolt, off_arcsec: float) -> Instruction:
        turns = TEST_TURNS[off_arcsec < SMALL_ERROR_ARCSEC] * (bolt.direction or 1)
        return Instruction(
            Step.TEST,
            f"A test: {bolt.name}, {turns_in_words(turns)} {rotation_in_words(turns)}."
            " Then let go and wait.",
            bolt.name, bolt.knob, turns,
        )  # fmt: skip

    def _turn(self, bolt: Bolt, error: PolarError) -> Instruction:
        value = _knob_arcsec(error, bolt.knob)
        near = abs(value) < NEAR * self.tolerance_arcsec(error, bolt.knob)
        share = (1.0 if near else CONFIDENT) if bolt.sure else CAUTIOUS
        wanted = bolt.needed(value) * share
        finest = FINEST_DEG / 360.0
        turns = sayable(float(np.clip(wanted, -MOST_TURNS, MOST_TURNS)))
        if abs(turns) < finest:
            turns = float(np.copysign(finest, wanted))
        reverses = bolt.direction == -np.sign(turns) and bolt.play_turns >= finest
        play = " (the first part only takes up its play)" * bool(reverses)
        return Instruction(
            Step.TURN,
            f"{bolt.name[0].upper()}{bolt.name[1:]}: {turns_in_words(turns)}"
            f" {rotation_in_words(turns)}{play}. {angle_in_words(value)} to go in"
            f" {bolt.knob.value}.",
            bolt.name, bolt.knob, turns,
        )  # fmt: skip


def _knob_arcsec(error: PolarError, knob: Knob) -> float:
    """The error a knob has to take away: altitude, or azimuth as the knob turns."""
    return error.altitude_arcsec if knob is Knob.ALTITUDE else error.azimuth_arcsec


def _sky_share(error: PolarError, knob: Knob) -> float:
    """Arcseconds on the sky for one of the knob's."""
    if knob is Knob.ALTITUDE or abs(error.azimuth_arcsec) < 1e-9:
        return 1.0 if knob is Knob.ALTITUDE else float(np.hypot(error.axis[0], error.axis[1]))
    return abs(error.azimuth_on_sky_arcsec / error.azimuth_arcsec)


def _stop(error: PolarError, goal_arcsec: float) -> Instruction:
    total, sigma = error.total_arcsec, error.uncertainty_arcsec
    if error.below_uncertainty and total > goal_arcsec:
        why = f"the error is smaller than its uncertainty ({angle_in_words(sigma)})"
    else:
        why = f"{angle_in_words(total)} ± {angle_in_words(sigma)} from the pole"
    return Instruction(Step.STOP, f"Stop: {why}. Tighten the bolts, then measure once more.")
