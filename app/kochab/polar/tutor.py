"""The bolt tutor: which bolt, which way, how far; it learns each bolt from one test nudge.

:meth:`BoltTutor.advise` takes a settled error and returns what to do next; it is called again when the axis has moved
and settled, or when the person confirms. One bolt at a time, the larger error first; a bolt is never asked to go the
whole way before it has been seen to go without backlash, so that it need not come back.
"""

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from kochab.core import tr, tr_noop
from kochab.polar.error import FINEST_DEG, Knob, PolarError, angle_in_words, rotation_in_words, sayable, turns_in_words

# -- What carries the mount, and how its two adjustments are asked for --------------------------


class Base(StrEnum):
    """What carries the mount; the texts are on the screen."""

    BOLTS = tr_noop("Tripod or pier with bolts")
    WEDGE = tr_noop("Wedge")
    HEAD = tr_noop("Tripod head, by hand")
    PLATFORM = tr_noop("Equatorial platform")


TEXTS: dict[tuple[Base, Knob], tuple[str, ...]] = {
    (Base.BOLTS, Knob.ALTITUDE): (
        tr_noop("Turn the altitude bolt {turns} {way}. {left} to go."),
        tr_noop("Turn the altitude bolt {turns} {way} (backlash included). {left} to go."),
        tr_noop("Test: turn the altitude bolt {turns} {way}, then let go."),
    ),
    (Base.BOLTS, Knob.AZIMUTH): (
        tr_noop("Turn the left azimuth bolt {turns} {way}. {left} to go."),
        tr_noop("Turn the left azimuth bolt {turns} {way} (backlash included). {left} to go."),
        tr_noop("Test: turn the left azimuth bolt {turns} {way}, then let go."),
    ),
    (Base.WEDGE, Knob.ALTITUDE): (
        tr_noop("Turn the wedge’s altitude screw {turns} {way}. {left} to go."),
        tr_noop("Turn the wedge’s altitude screw {turns} {way} (backlash included). {left} to go."),
        tr_noop("Test: turn the wedge’s altitude screw {turns} {way}, then let go."),
    ),
    (Base.WEDGE, Knob.AZIMUTH): (
        tr_noop("Turn the wedge’s azimuth screw {turns} {way}. {left} to go."),
        tr_noop("Turn the wedge’s azimuth screw {turns} {way} (backlash included). {left} to go."),
        tr_noop("Test: turn the wedge’s azimuth screw {turns} {way}, then let go."),
    ),
    (Base.PLATFORM, Knob.ALTITUDE): (
        tr_noop("Turn the foot on the pole’s side {turns} {way}. {left} to go."),
        tr_noop("Turn the foot on the pole’s side {turns} {way} (backlash included). {left} to go."),
        tr_noop("Test: turn the foot on the pole’s side {turns} {way}, then let go."),
    ),
    (Base.PLATFORM, Knob.AZIMUTH): (
        tr_noop("Swing the platform {way}, seen from above, and watch the number: {left} to go."),
    ),
    (Base.HEAD, Knob.ALTITUDE): (tr_noop("Tilt the head {way} and watch the number: {left} to go. Then lock it."),),
    (Base.HEAD, Knob.AZIMUTH): (
        tr_noop("Pan the head {way}, seen from above, and watch the number: {left} to go. Then lock it."),
    ),
}
"""To go on, to go back through its backlash and to test it, of what has a thread; one text of what a hand moves."""
WHOLE_TURN_ARCSEC, HAND_ARCSEC = 1_296_000.0, 240.0  # of what has no thread; and a goal that a hand reaches without one

# -- What one bolt has been seen to do: direction, arcseconds a turn, backlash -----------------

SEEN, WORTH = 4.0, 15.0  # a change of so many sigmas is real; one of so many corrects what was known
SHARE_OF_BACKLASH = 0.8  # it is better to stop short and go on than to come back through the backlash again

MOST_BACKLASH_TURNS = 0.5

TELLING_TURNS = 10.0 / 360.0  # a hand is a degree off in any turn: less than this says little about the thread


@dataclass(frozen=True, slots=True)
class Bolt:
    """A bolt and what is known of it; clockwise, looking at its head, is positive.

    ``arcsec_a_turn`` is what a full clockwise turn adds to its own error, None before the first
    test; ``sure`` once it was seen without backlash. ``backlash_turns`` are lost at a reversal.
    ``direction`` is the sign of the last turn that was seen to move the axis, 0 before the first;
    ``taken_turns`` is how much of the backlash has been taken up the other way since. What a hand moves without a
    thread goes by whole turns of its own, up and clockwise from above.
    """

    knob: Knob
    name: str
    arcsec_a_turn: float | None = None
    sure: bool = False
    backlash_turns: float = 0.0
    direction: int = 0
    taken_turns: float = 0.0
    base: Base = Base.BOLTS

    @property
    def by_hand(self) -> bool:
        """Whether a hand moves it, and no thread."""
        return len(TEXTS[self.base, self.knob]) == 1

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
        if gain is not None and abs(turns) < TELLING_TURNS:
            return self._nudged(after, taken - change_arcsec / gain * sign, gain * own > 0)
        if gain is None or gain * own < 0:
            return replace(after, arcsec_a_turn=own, sure=not reverses)
        if not self.sure:
            # Backlash only ever makes a turn look smaller: of two readings the larger is right.
            return replace(after, arcsec_a_turn=max(gain, own, key=abs), sure=not reverses)
        if reverses:
            lost = taken - change_arcsec / gain * sign
            return replace(after, backlash_turns=float(min(max(lost, 0.0), MOST_BACKLASH_TURNS)))
        if abs(change_arcsec) > WORTH * sigma_arcsec:
            return replace(after, arcsec_a_turn=(own + gain) / 2.0)
        return after

    def _nudged(self, after: "Bolt", lost_turns: float, as_asked: bool) -> "Bolt":
        """What a very small turn teaches: that its backlash is taken up, and how long that took."""
        if not as_asked:
            return self
        if not self.sure or self.direction == after.direction:
            return after
        return replace(after, backlash_turns=float(np.clip(lost_turns, 0.0, MOST_BACKLASH_TURNS)))


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
        return replace(bolt, arcsec_a_turn=WHOLE_TURN_ARCSEC, sure=True)
    return replace(bolt, arcsec_a_turn=known or None)


TEST_TURNS = (0.25, 0.125)
SMALL_ERROR_ARCSEC = 900.0  # for such an error the smaller test is enough
CAUTIOUS, CONFIDENT = 0.6, 0.9  # of the way: before a bolt was seen without backlash, and after
NEAR = 3.0  # tolerances: from here on the whole rest is asked for
NOT_WORTH_IT = 1.6  # tolerances left alone rather than turned back for
HALF_A_HAND = 0.7  # of the finest turn of a hand: less than that is left alone
ENOUGH = 1.45  # goals, when only another move would bring it nearer
WIDEST = 1.7  # tolerances, however coarse the thread
MOST_TURNS, MOST_UNSEEN = 6.0, 1.0  # at a time; and of a bolt known from another night before it was seen to move


TWIST_DEG, TWIST_SIGMAS, TWIST_ARCSEC = 10.0, 4.0, 120.0
"""A bolt that moves the axis so far beside its own direction, for certain and in so large a move, is a witness."""
TWISTED = {
    Knob.ALTITUDE: tr_noop(
        "The altitude adjustment moved the axis {angle:.0f}° off the vertical. A clock or time zone wrong by"
        " {hours:.1f} h does that, or a base that is not level."
    ),
    Knob.AZIMUTH: tr_noop(
        "The azimuth adjustment moved the axis {angle:.0f}° off the horizontal. A clock or time zone wrong by"
        " {hours:.1f} h does that, or a base that is not level."
    ),
}


class TutorStep(StrEnum):
    """What an instruction is for."""

    TEST = "test nudge"
    TURN = "turn"
    STOP = "stop"


@dataclass(frozen=True, slots=True)
class Instruction:
    """One thing to do: ``turns`` of ``knob``'s bolt, clockwise positive, or of what has none; ``words`` say it."""

    step: TutorStep
    words: str
    knob: Knob | None = None
    turns: float = 0.0
    by_hand: bool = False


class BoltTutor:
    """Guides to the pole. ``moves`` counts the bolts' movements: a bolt going on is one move."""

    def __init__(self, goal_arcsec: float = 15.0, bolts: tuple[Bolt, Bolt] = (ALTITUDE_BOLT, AZIMUTH_BOLT)) -> None:
        self.goal_arcsec = goal_arcsec
        self.bolts = {bolt.knob: bolt for bolt in bolts}
        self.moves = 0
        self._pending: Instruction | None = None
        self._before: PolarError | None = None
        self._last: tuple[Knob | None, float] = (None, 0.0)
        self.witness = ""  # what a bolt's own move says against clock and zone

    def advise(
        self, error: PolarError, turned: float | None = None, noise_arcsec: tuple[float, float] | None = None
    ) -> Instruction:
        """What to do now, from a settled ``error`` that was taken after the last instruction was followed.

        ``turned`` is how far the bolt was really turned, when that is known better than as asked. ``noise_arcsec`` are
        one-sigma errors of a change along altitude and azimuth on the sky; the error's own sigmas when not known,
        which hold much that two readings share.
        """
        self._learn(error, turned, noise_arcsec or error.sigma_arcsec)
        instruction = self._next(error)
        self._pending, self._before = instruction, error
        if instruction.knob is not None:
            self.moves += not self._goes_on(instruction)
            self._last = (instruction.knob, float(np.sign(instruction.turns)))
        return instruction

    def forget(self, knob: Knob) -> None:
        """Nothing is known of this bolt any more."""
        self.bolts[knob] = Bolt(knob, self.bolts[knob].name, base=self.bolts[knob].base)

    def measured_again(self) -> None:
        """A new measurement stands in for the last reading: nothing is to be learned from it."""
        self._pending = self._before = None

    def tolerance_arcsec(self, error: PolarError, knob: Knob) -> float:
        """How far off this knob may stay, on the sky: a share of the goal, or one sigma."""
        return float(max(self.goal_arcsec / np.sqrt(2.0), error.sigma_arcsec[knob is Knob.AZIMUTH]))

    def _limit(self, error: PolarError, knob: Knob) -> float:
        """The tolerance, wider for a bolt that would have to come back or is too coarse."""
        bolt, tolerance = self.bolts[knob], self.tolerance_arcsec(error, knob)
        if bolt.arcsec_a_turn is None or not bolt.direction:
            return tolerance
        sign = float(np.sign(-error.knob_arcsec(knob) / bolt.arcsec_a_turn))
        back = sign == -bolt.direction and self._last != (knob, sign)  # else it is on its way
        hand = HALF_A_HAND * abs(bolt.arcsec_a_turn) * FINEST_DEG / 360.0 * _sky_share(error, knob)
        return float(np.clip(hand, tolerance * (NOT_WORTH_IT if back else 1.0), WIDEST * tolerance))

    def _learn(self, error: PolarError, turned: float | None, noise_arcsec: tuple[float, float]) -> None:
        done, before = self._pending, self._before
        if done is None or done.knob is None or before is None or done.by_hand:
            return  # a hand moves both at once, and what it moves has no thread
        change = error.knob_arcsec(done.knob) - before.knob_arcsec(done.knob)
        self.witness = self._twist(done.knob, before, error, noise_arcsec) or self.witness
        # The knob turns raw azimuth: on-sky noise is larger by 1 / cos(altitude) there.
        noise = noise_arcsec[done.knob is Knob.AZIMUTH] / _sky_share(error, done.knob)
        if turns := done.turns if turned is None else turned:
            self.bolts[done.knob] = self.bolts[done.knob].learned(turns, change, float(np.sqrt(2.0) * noise))

    @staticmethod
    def _twist(knob: Knob, before: PolarError, now: PolarError, noise_arcsec: tuple[float, float]) -> str:
        """What is said when a bolt moved the axis in another direction than its own; empty when it did not.

        At a wrong hour the sky is taken for turned about the pole, and so is every move of the axis.
        """
        moved = (now.altitude_arcsec - before.altitude_arcsec, now.azimuth_on_sky_arcsec - before.azimuth_on_sky_arcsec)
        along, beside = moved if knob is Knob.ALTITUDE else moved[::-1]
        size = float(np.hypot(along, beside))
        angle = float(np.degrees(np.arctan2(abs(beside), abs(along))))
        sure = TWIST_SIGMAS * np.degrees(np.sqrt(2.0) * max(noise_arcsec) / max(size, 1e-9))
        if size < TWIST_ARCSEC or angle - sure < TWIST_DEG:
            return ""
        return tr(TWISTED[knob], angle=angle, hours=angle / 15.0)

    def _next(self, error: PolarError) -> Instruction:
        off = {knob: abs(error.knob_arcsec(knob)) * _sky_share(error, knob) for knob in Knob}
        open_ = [k for k in Knob if off[k] > self._limit(error, k)]
        if not open_ or error.total_arcsec <= self.goal_arcsec:
            return _stop(error, self.goal_arcsec)
        chosen = self._chosen(open_, off, error)
        if not self._goes_on(chosen) and error.total_arcsec <= ENOUGH * self.goal_arcsec:
            return _stop(error, self.goal_arcsec)
        last = self._last[0]
        if last is None or last in open_:
            return chosen
        text = (
            tr("Altitude is good ({angle}). Now azimuth. {words}")
            if last is Knob.ALTITUDE
            else tr("Azimuth is good ({angle}). Now altitude. {words}")
        )
        return replace(chosen, words=text.format(angle=angle_in_words(error.knob_arcsec(last)), words=chosen.words))

    def _chosen(self, open_: list[Knob], off: dict[Knob, float], error: PolarError) -> Instruction:
        """The bolt at hand first, then the larger error, and last one that went a little too far.

        To come back is a new move, and the other bolt may yet drag it home or leave the total good.
        """
        order = sorted(open_, key=lambda knob: (knob is not self._last[0], -off[knob]))
        offers = [self._instruction(knob, off[knob], error) for knob in order]
        return min(offers, key=lambda one: self._only_comes_back(one, off, error))

    def _only_comes_back(self, offer: Instruction, off: dict[Knob, float], error: PolarError) -> bool:
        assert offer.knob is not None
        back = not self._goes_on(offer) and self.bolts[offer.knob].direction == -np.sign(offer.turns)
        return bool(back and off[offer.knob] < NEAR * self.tolerance_arcsec(error, offer.knob))

    def _goes_on(self, offer: Instruction) -> bool:
        return self._last == (offer.knob, float(np.sign(offer.turns)))

    def _instruction(self, knob: Knob, off_arcsec: float, error: PolarError) -> Instruction:
        bolt, value = self.bolts[knob], error.knob_arcsec(knob)
        texts = TEXTS[bolt.base, knob]
        if bolt.by_hand:
            turns = bolt.needed(value)
            tilt = tr("up") if turns > 0.0 else tr("down")
            way = tilt if knob is Knob.ALTITUDE else rotation_in_words(turns)
            words = tr(texts[0], way=way, left=angle_in_words(value))
            return Instruction(TutorStep.TURN, words, knob, turns, by_hand=True)
        if bolt.arcsec_a_turn is None:
            turns = TEST_TURNS[off_arcsec < SMALL_ERROR_ARCSEC] * (bolt.direction or 1)
            words = tr(texts[2], turns=turns_in_words(turns), way=rotation_in_words(turns))
            return Instruction(TutorStep.TEST, words, knob, turns)
        near = abs(value) < NEAR * self.tolerance_arcsec(error, knob)
        share = (1.0 if near else CONFIDENT) if bolt.sure else CAUTIOUS
        wanted = bolt.needed(value) * share
        finest = FINEST_DEG / 360.0
        most = MOST_TURNS if bolt.direction else MOST_UNSEEN
        turns = sayable(float(np.clip(wanted, -most, most)))
        if abs(turns) < finest:
            turns = float(np.copysign(finest, wanted))
        reverses = bolt.direction == -np.sign(turns) and bolt.backlash_turns >= finest
        told = {"turns": turns_in_words(turns), "way": rotation_in_words(turns), "left": angle_in_words(value)}
        return Instruction(TutorStep.TURN, tr(texts[int(reverses)], **told), knob, turns)


def _sky_share(error: PolarError, knob: Knob) -> float:
    """Arcseconds on the sky for one of the knob's."""
    if knob is Knob.ALTITUDE or abs(error.azimuth_arcsec) < 1e-9:
        return 1.0 if knob is Knob.ALTITUDE else float(np.hypot(error.axis[0], error.axis[1]))
    return abs(error.azimuth_on_sky_arcsec / error.azimuth_arcsec)


def _stop(error: PolarError, goal_arcsec: float) -> Instruction:
    total, sigma = error.total_arcsec, error.uncertainty_arcsec
    if error.below_uncertainty and total > goal_arcsec:
        text = tr("Stop: the error is within its uncertainty ({sigma}). Tighten everything, then measure again.")
    else:
        text = tr("Stop: {total} ± {sigma} from the pole. Tighten everything, then measure again.")
    words = text.format(total=angle_in_words(total), sigma=angle_in_words(sigma))
    return Instruction(TutorStep.STOP, words)
