"""The bolt tutor: which bolt, which way, how far; it learns each bolt from test nudges.

:meth:`BoltTutor.advise` takes a settled error and returns what to do next; it is called again when the axis has moved
and settled, or when the person confirms. One bolt at a time, the larger error first. A bolt that is not proved yet
(:mod:`kochab.polar.bolts`) is never given more than the size of a test, and one is never asked to go the whole way
before it has been seen to go without backlash, so that it need not come back.
"""

from dataclasses import replace
from enum import StrEnum

import numpy as np

from kochab.core.values import frozen
from kochab.polar.bolts import ALTITUDE_BOLT, AZIMUTH_BOLT, SAME_THREAD_FACTOR, SEEN, Base, Bolt
from kochab.polar.error import (
    FINER,
    FINEST_DEG,
    Knob,
    PolarError,
    angle_in_words,
    rotation_in_words,
    sayable,
    turns_in_words,
)
from kochab.text.translation import tr, tr_noop

TEXTS: dict[tuple[Base, Knob], tuple[str, ...]] = {
    (Base.BOLTS, Knob.ALTITUDE): (
        tr_noop("Altitude bolt: {turns} {way}, then wait."),
        tr_noop("Altitude bolt: {turns} {way} (backlash included), then wait."),
        tr_noop("Altitude: a touch {way}."),
    ),
    (Base.BOLTS, Knob.AZIMUTH): (
        tr_noop("Left azimuth bolt: {turns} {way}, then wait."),
        tr_noop("Left azimuth bolt: {turns} {way} (backlash included), then wait."),
        tr_noop("Left azimuth bolt: a touch {way}."),
    ),
    (Base.WEDGE, Knob.ALTITUDE): (
        tr_noop("Wedge’s altitude screw: {turns} {way}, then wait."),
        tr_noop("Wedge’s altitude screw: {turns} {way} (backlash included), then wait."),
        tr_noop("Wedge’s altitude screw: a touch {way}."),
    ),
    (Base.WEDGE, Knob.AZIMUTH): (
        tr_noop("Wedge’s azimuth screw: {turns} {way}, then wait."),
        tr_noop("Wedge’s azimuth screw: {turns} {way} (backlash included), then wait."),
        tr_noop("Wedge’s azimuth screw: a touch {way}."),
    ),
    (Base.PLATFORM, Knob.ALTITUDE): (
        tr_noop("Foot on the pole’s side: {turns} {way}, then wait."),
        tr_noop("Foot on the pole’s side: {turns} {way} (backlash included), then wait."),
        tr_noop("Foot on the pole’s side: a touch {way}."),
    ),
    (Base.PLATFORM, Knob.AZIMUTH): (
        tr_noop("Swing the platform {way}, seen from above, and watch the number: {left} to go."),
    ),
    (Base.HEAD, Knob.ALTITUDE): (tr_noop("Tilt the head {way} and watch the number: {left} to go. Then lock it."),),
    (Base.HEAD, Knob.AZIMUTH): (
        tr_noop("Pan the head {way}, seen from above, and watch the number: {left} to go. Then lock it."),
    ),
}
"""To turn, to go back through its backlash, and to nudge what has a thread; one text of what a hand moves."""

TEST_TURNS, LEAST_TEST_TURNS = (0.25, 0.125), 1.0 / 24.0
SMALL_ERROR_ARCSEC = 900.0  # for such an error the smaller test is enough
CONFIDENT = 0.9  # of the way, once a bolt is proved
WHOLE_WAY = 10.0
NEAR = 3.0  # tolerances: from here on the whole rest is asked for
NOT_WORTH_IT = 1.6  # tolerances left alone rather than turned back for
HALF_A_HAND = 0.7  # of the finest turn of a hand: less than that is left alone
ENOUGH = 1.45  # goals, when only another move would bring it nearer
WIDEST = 1.7  # tolerances, however coarse the thread
MOST_TURNS, GROWTH = 6.0, 4.0  # at a time, and times the largest turn that did what its thread says
TELLING_TURNS = 10.0 / 360.0  # less than this a hand does not turn by a number
SMALL_SHARE = 0.15  # of the other error: not worth coming back for yet, as the other bolt may drag it
MOST_REVERSALS = 4  # of one bolt, before the other one has its turn
TOO_FAR = 2  # times that a proved bolt went clearly past the pole: the hand is rough
ROUGH = 2.5  # goals, which such a hand can reach
MISTAKEN = 1.5  # turns that seem to have gone the other way or were the other bolt's: the hand needs care
WRONG_AGAIN = 0.75
"""A hand that needs care is asked for no turn which, made the other way, takes the axis farther than so much of the way
back to where it began: it may stop at any time."""
FORGIVEN = 3.2  # goals, at which such a hand had better stop: its next turn may take all away again
RETURNS = (
    0.4  # of the way home may be asked of it in any case: four turns of five as asked win, however far it has gone
)
MUCH_SMALLER = 0.35  # of the other error: such a hand's turns are not to be spent on that yet

# -- What a bolt's own move says: that it was the other bolt, or that the clock is wrong ---------

STRAY, STRAY_ARCSEC = 2.0, 60.0
"""What moved the axis so many times farther across a bolt's own direction as along it, and so far, was the other."""
TURNED_BACK = 0.3  # of what strayed: nearer than this to where it was
STUBBORN = 4
"""Turns that agree on how far they move the other axis; that it is this bolt's doing is proved as any thread is."""
STRAYED = {
    Knob.ALTITUDE: tr_noop("That moved azimuth, not altitude ({moved}). Turn it back, or take it from here."),
    Knob.AZIMUTH: tr_noop("That moved altitude, not azimuth ({moved}). Turn it back, or take it from here."),
}
TESTED = tr_noop("The number grew: the test turn shows which way this bolt moves the axis. Now the other way.")
CROSSED = tr_noop("Each bolt moves the other axis. Check the clock and time zone, and which bolt is which.")

TWIST_DEG, TWIST_SIGMAS, TWIST_ARCSEC = 12.0, 4.0, 120.0
"""A proved bolt that surely moves the axis so far beside its own direction, in so large a move, may accuse."""
SAME_TWIST_DEG = 3.0  # both bolts that do so alike accuse
TWISTED = tr_noop(
    "Each adjuster moved the axis {angle:.0f}° away from its own direction. A clock or time zone off by {hours:.1f} h"
    " does that, or a base that is not level: check both."
)


class TutorStep(StrEnum):
    """What an instruction is for."""

    TEST = "test nudge"
    TURN = "turn"
    STOP = "stop"


@frozen
class Instruction:
    """One thing to do: ``turns`` of ``knob``'s bolt, clockwise positive, or of what has none; ``words`` say it.

    ``text`` is the same with places for the error's amounts, which change while the bolt turns; ``stray`` tells that
    the turn before moved the other axis, and ``note`` is the sentence of ``words`` that says so. ``why`` says what a
    test was for that took the axis farther from the pole.
    """

    step: TutorStep
    words: str
    knob: Knob | None = None
    turns: float = 0.0
    by_hand: bool = False
    stray: bool = False
    text: str = ""
    note: str = ""
    why: str = ""

    def with_amounts(self, error: PolarError) -> str:
        """The words with the amounts of this error: those that stand on the screen beside them."""
        return (self.text or self.words).format(
            altitude=angle_in_words(error.altitude_arcsec),
            azimuth=angle_in_words(error.azimuth_arcsec),
            total=angle_in_words(error.total_arcsec),
            sigma=angle_in_words(error.with_systematics.sigma_total_arcsec),
        )


LEFT = {Knob.ALTITUDE: "{altitude}", Knob.AZIMUTH: "{azimuth}"}
"""The place of a knob's amount in an instruction's text."""


class Moved:
    """How far the axis went between two errors: along a knob's own direction and beside it, arcsec on the sky."""

    def __init__(self, knob: Knob, before: PolarError, now: PolarError, noise_arcsec: tuple[float, float]) -> None:
        altitude = now.altitude_arcsec - before.altitude_arcsec
        azimuth = now.azimuth_on_sky_arcsec - before.azimuth_on_sky_arcsec
        # Turned from azimuth to altitude, which a wrong hour does alike to both bolts' moves.
        self.along, self.beside = (altitude, -azimuth) if knob is Knob.ALTITUDE else (azimuth, altitude)
        self.noise = float(np.sqrt(2.0) * max(noise_arcsec))
        self.size = float(np.hypot(self.along, self.beside))

    @property
    def stray(self) -> bool:
        """Whether it was the other axis that moved."""
        across = abs(self.beside)
        return across > max(SEEN * self.noise, STRAY_ARCSEC) and across > STRAY * abs(self.along)

    @property
    def twist_deg(self) -> float:
        """By how much the move stands off the knob's own direction, in (-90, 90]."""
        return float(np.degrees(np.arctan2(self.beside * np.sign(self.along), abs(self.along))))

    @property
    def twist_sigma_deg(self) -> float:
        """One sigma of the same."""
        return float(np.degrees(self.noise / max(self.size, 1e-9)))


class BoltTutor:
    """Guides to the pole. ``moves`` counts the bolts' movements: a bolt going on is one move."""

    def __init__(self, goal_arcsec: float = 15.0, bolts: tuple[Bolt, Bolt] = (ALTITUDE_BOLT, AZIMUTH_BOLT)) -> None:
        self.goal_arcsec = goal_arcsec
        self.bolts = {bolt.knob: bolt for bolt in bolts}
        self.moves = 0
        self._pending: Instruction | None = None
        self._before: PolarError | None = None
        self._last: tuple[Knob | None, float] = (None, 0.0)
        self._reversals = dict.fromkeys(Knob, 0)  # since the last measurement
        self._too_far = 0
        self._strayed = 0  # turns that were of the other bolt
        self._began_arcsec: float | None = None  # the total before any turn
        # Of a bolt that was never seen to move its own axis: what its turns moved the other by, arcsec a turn on the
        # sky, and what all of them together say of that.
        self._strays: dict[Knob, tuple[float, ...]] = dict.fromkeys(Knob, ())
        self._across = {knob: self._new(knob) for knob in self.bolts}
        self._astray = 0.0  # arcsec on the sky that the last one moved it by
        self._note = ""  # what is to be said of that
        self._twists = dict.fromkeys(Knob, 0.0)  # by how much each bolt's last clear move stood off, degrees
        self.witness = ""  # what a bolt's own move says against clock and zone

    def advise(
        self, error: PolarError, turned: float | None = None, noise_arcsec: tuple[float, float] | None = None
    ) -> Instruction:
        """What to do now, from a settled ``error`` that was taken after the last instruction was followed.

        ``turned`` is how far the bolt was really turned, when that is known better than as asked. ``noise_arcsec`` are
        one-sigma errors of a change along altitude and azimuth on the sky; the error's own sigmas when not known,
        which hold much that two readings share.
        """
        self._note = ""
        if self._began_arcsec is None:
            self._began_arcsec = error.total_arcsec
        self._learn(error, turned, noise_arcsec or error.sigma_arcsec)
        instruction = self._next(error)
        if self._note and instruction.knob is not None:
            instruction = replace(instruction, words=f"{self._note} {instruction.words}", stray=True, note=self._note)
        if self._tested_away(instruction, error):
            instruction = replace(instruction, why=tr(TESTED))
        instruction = replace(instruction, text=instruction.words, words=instruction.with_amounts(error))
        self._pending, self._before = instruction, error
        if instruction.knob is not None:
            goes_on = self._goes_on(instruction)
            self.moves += not goes_on
            self._reversals[instruction.knob] += instruction.knob is self._last[0] and not goes_on
            self._last = (instruction.knob, float(np.sign(instruction.turns)))
        return instruction

    def _tested_away(self, instruction: Instruction, error: PolarError) -> bool:
        """Whether the test before took the axis away from the pole, and the same bolt is turned back now."""
        test, before, knob = self._pending, self._before, instruction.knob
        if test is None or before is None or knob is None or test.step is not TutorStep.TEST:
            return False
        farther = abs(error.knob_arcsec(knob)) > abs(before.knob_arcsec(knob))
        return knob is test.knob and instruction.turns * test.turns < 0.0 and farther

    def forget(self, knob: Knob) -> None:
        """Nothing is known of this bolt any more."""
        self.bolts[knob] = self._new(knob)

    def crosses(self, knob: Knob) -> bool:
        """Whether what turns this knob is proved to move the other axis, and was never seen to move its own."""
        return self._across[knob].proved and len(self._strays[knob]) >= STUBBORN

    def _new(self, knob: Knob) -> Bolt:
        return Bolt(knob, self.bolts[knob].name, base=self.bolts[knob].base)

    def measured_again(self) -> None:
        """A new measurement stands in for the last reading: nothing is to be learned from it."""
        self._pending = self._before = None
        self._reversals = dict.fromkeys(Knob, 0)

    def tolerance_arcsec(self, error: PolarError, knob: Knob) -> float:
        """How far off this knob may stay, on the sky: a share of the goal, or one sigma."""
        return float(max(self._goal_arcsec / np.sqrt(2.0), error.sigma_arcsec[knob is Knob.AZIMUTH]))

    @property
    def rough(self) -> bool:
        """Whether the hand goes too far again and again."""
        return self._too_far >= TOO_FAR or sum(self._reversals.values()) >= MOST_REVERSALS

    @property
    def careless(self) -> bool:
        """Whether the hand has gone the other way, or turned the other bolt, more than once."""
        return self._strayed + sum(bolt.wrong_turns for bolt in self.bolts.values()) >= MISTAKEN

    @property
    def _goal_arcsec(self) -> float:
        """The goal, or what a rough or careless hand can reach."""
        return self.goal_arcsec * (FORGIVEN if self.careless else ROUGH if self.rough else 1.0)

    def _limit(self, error: PolarError, knob: Knob) -> float:
        """The tolerance, wider for a bolt that would have to come back or is too coarse."""
        bolt, tolerance = self.bolts[knob], self.tolerance_arcsec(error, knob)
        if bolt.arcsec_a_turn is None or not bolt.direction or self.rough:
            return tolerance
        sign = float(np.sign(-error.knob_arcsec(knob) / bolt.arcsec_a_turn))
        back = sign == -bolt.direction and self._last != (knob, sign)  # else it is on its way
        hand = HALF_A_HAND * abs(bolt.arcsec_a_turn) * FINEST_DEG / 360.0 * _sky_share(error, knob)
        return float(np.clip(hand, tolerance * (NOT_WORTH_IT if back else 1.0), WIDEST * tolerance))

    def _learn(self, error: PolarError, turned: float | None, noise_arcsec: tuple[float, float]) -> None:
        done, before = self._pending, self._before
        if done is None or done.knob is None or before is None or done.by_hand:
            return  # a hand moves both at once, and what it moves has no thread
        turns = done.turns if turned is None else turned
        if not turns:
            return
        knob, moved = done.knob, Moved(done.knob, before, error, noise_arcsec)
        if moved.stray:
            self._went_astray(knob, turns, moved, before, error)
            return
        bolt = self.bolts[knob]
        # The knob turns raw azimuth: on-sky noise is larger by 1 / cos(altitude) there.
        noise = float(np.sqrt(2.0) * noise_arcsec[knob is Knob.AZIMUTH] / _sky_share(error, knob))
        now = error.knob_arcsec(knob)
        past = now * before.knob_arcsec(knob) < 0.0 and abs(now) * _sky_share(error, knob) > NEAR * self.goal_arcsec
        self._too_far += bolt.proved and past
        change = now - before.knob_arcsec(knob)
        if abs(turns) >= TELLING_TURNS:
            self._watch_clock(knob, moved)
        if abs(change) >= SEEN * noise:
            self._strays[knob], self._across[knob], self._astray = (), self._new(knob), 0.0
        self.bolts[knob] = bolt.learned(turns, change, noise)

    def _went_astray(self, knob: Knob, turns: float, moved: Moved, before: PolarError, now: PolarError) -> None:
        """The other axis moved: that is no test of this bolt, and it is said unless it only came back."""
        other = _other(knob)
        change = now.knob_arcsec(other) - before.knob_arcsec(other)
        self.bolts[other] = self.bolts[other].moved_by_mistake(change)
        if abs(self._astray + moved.beside) < TURNED_BACK * abs(moved.beside):
            self._astray = 0.0
            return
        self._strayed += 1
        if not self.bolts[knob].moves:
            a_turn = moved.beside / turns
            alike = tuple(
                one for one in self._strays[knob] if 1.0 / SAME_THREAD_FACTOR < one / a_turn < SAME_THREAD_FACTOR
            )
            self._strays[knob] = (*alike, a_turn)
            self._across[knob] = self._across[knob].learned(turns, moved.beside, moved.noise)
        self._astray = moved.beside
        self._note = tr(STRAYED[knob], moved=f"{'+' if change > 0.0 else '−'}{angle_in_words(change)}")

    def _watch_clock(self, knob: Knob, moved: Moved) -> None:
        """Accuse clock and zone when both bolts, proved, stand off their own directions alike.

        At a wrong hour the sky is taken for turned about the pole, and so is every move of the axis, by either bolt;
        one that drags the other axis along does so alone.
        """
        size, sigmas = abs(moved.twist_deg), TWIST_SIGMAS * moved.twist_sigma_deg
        if moved.size < TWIST_ARCSEC or size - sigmas < TWIST_DEG <= size + sigmas:
            return  # it may stand off or not
        self._twists[knob] = moved.twist_deg if size >= TWIST_DEG else 0.0
        own, other = self._twists[knob], self._twists[_other(knob)]
        proved = all(bolt.proved for bolt in self.bolts.values())
        if own and other and proved and abs(own - other) < SAME_TWIST_DEG + sigmas:
            angle = abs(own + other) / 2.0
            self.witness = tr(TWISTED, angle=angle, hours=angle / 15.0)

    def _next(self, error: PolarError) -> Instruction:
        if all(self.crosses(knob) for knob in Knob):
            return Instruction(TutorStep.STOP, tr(CROSSED), stray=True)
        off = {knob: abs(error.knob_arcsec(knob)) * _sky_share(error, knob) for knob in Knob}
        open_ = [k for k in Knob if off[k] > self._limit(error, k)]
        if not open_ or error.total_arcsec <= self._goal_arcsec:
            return _stop(error, self._goal_arcsec)
        chosen = self._chosen(open_, off, error)
        if not self._goes_on(chosen) and error.total_arcsec <= max(ENOUGH * self.goal_arcsec, self._goal_arcsec):
            return _stop(error, self._goal_arcsec)
        last = self._last[0]
        if last is None or last in open_:
            return chosen
        text = (
            tr("Altitude is good ({angle}). Now azimuth. {words}", angle=LEFT[last], words=chosen.words)
            if last is Knob.ALTITUDE
            else tr("Azimuth is good ({angle}). Now altitude. {words}", angle=LEFT[last], words=chosen.words)
        )
        return replace(chosen, words=text)

    def _chosen(self, open_: list[Knob], off: dict[Knob, float], error: PolarError) -> Instruction:
        """The bolt at hand first, then the larger error, and last one that went a little too far.

        To come back is a new move, and the other bolt may yet drag it home or leave the total good. A bolt that went
        to and fro too often leaves the other its turn.
        """

        def rank(offer: Instruction) -> tuple[bool, bool, int, bool, bool, float]:
            assert offer.knob is not None
            worn = self._reversals[offer.knob] // MOST_REVERSALS
            at_hand = offer.knob is self._last[0] and not self.careless
            small = off[offer.knob] < SMALL_SHARE * max(off.values()) and not (at_hand and self._obeys(offer))
            small = small or (self.careless and off[offer.knob] < MUCH_SMALLER * max(off.values()))
            return (
                self.crosses(offer.knob),
                small,
                worn,
                self._only_comes_back(offer, off, error),
                not at_hand,
                -off[offer.knob],
            )

        return min((self._instruction(knob, off[knob], error) for knob in open_), key=rank)

    def _obeys(self, offer: Instruction) -> bool:
        """Whether this bolt goes on and did move when it was turned last."""
        assert offer.knob is not None
        return self._goes_on(offer) and not self.bolts[offer.knob].unseen

    def _only_comes_back(self, offer: Instruction, off: dict[Knob, float], error: PolarError) -> bool:
        assert offer.knob is not None
        back = not self._goes_on(offer) and self.bolts[offer.knob].direction == -np.sign(offer.turns)
        return bool(back and off[offer.knob] < NEAR * self.tolerance_arcsec(error, offer.knob))

    def _goes_on(self, offer: Instruction) -> bool:
        return self._last == (offer.knob, float(np.sign(offer.turns)))

    def _home_turns(self, knob: Knob, most: float, error: PolarError) -> float:
        """A test that takes the other axis nearer to the pole, if that is what this bolt moves; 0: it is not."""
        if not self._strays[knob]:
            return 0.0
        across = error.altitude_arcsec if knob is Knob.AZIMUTH else -error.azimuth_on_sky_arcsec
        turns = -across / self._strays[knob][-1]
        return float(np.copysign(np.clip(abs(turns), LEAST_TEST_TURNS, most), turns))

    def _harmless_turns(self, bolt: Bolt, error: PolarError, test: float) -> float:
        """The most that this bolt can be turned the other way with the axis still nearer to the pole than it began.

        At least a test, or what is needed without backlash where that is less, and so much of a long way home that a
        hand which goes the other way once in five turns comes nearer.
        """
        a_turn = abs(bolt.arcsec_a_turn or 1.0)
        room = WRONG_AGAIN * ((self._began_arcsec or 0.0) - error.total_arcsec) / _sky_share(error, bolt.knob)
        off = abs(error.knob_arcsec(bolt.knob))
        return max(room, min(test * a_turn, off), RETURNS * off) / a_turn

    def _instruction(self, knob: Knob, off_arcsec: float, error: PolarError) -> Instruction:
        bolt, value = self.bolts[knob], error.knob_arcsec(knob)
        texts = TEXTS[bolt.base, knob]
        if bolt.by_hand:
            turns = bolt.needed(value)
            tilt = tr("up") if turns > 0.0 else tr("down")
            way = tilt if knob is Knob.ALTITUDE else rotation_in_words(turns)
            text = tr(texts[0], way=way, left=LEFT[knob])
            return Instruction(TutorStep.TURN, text, knob, turns, by_hand=True)
        test = TEST_TURNS[off_arcsec < SMALL_ERROR_ARCSEC]
        if bolt.arcsec_a_turn is None:
            turns = sayable(self._home_turns(knob, test, error)) or test * (bolt.direction or 1)
            text = tr(texts[0], turns=turns_in_words(turns), way=rotation_in_words(turns))
            return Instruction(TutorStep.TEST, text, knob, turns)
        near = self.rough or off_arcsec < WHOLE_WAY * self.tolerance_arcsec(error, knob)
        share = 1.0 if near else CONFIDENT
        wanted = bolt.needed(value) * share
        finest = FINEST_DEG / 360.0
        most = min(MOST_TURNS, max(test, GROWTH * bolt.seen_turns)) if bolt.proved else bolt.test_turns(wanted, test)
        if self.careless:
            most = min(most, self._harmless_turns(bolt, error, test))
        turns = sayable(float(np.clip(wanted, -most, most)), to_the_degree=self.rough)
        if abs(turns) < finest:
            turns = float(np.copysign(finest, wanted))
        reverses = bolt.direction == -np.sign(turns) and bolt.backlash_turns >= finest
        text = texts[2 if abs(turns) < TELLING_TURNS else int(reverses)]
        words = tr(text, turns=turns_in_words(turns), way=rotation_in_words(turns))
        return Instruction(TutorStep.TURN, words, knob, turns)


def _other(knob: Knob) -> Knob:
    return Knob.ALTITUDE if knob is Knob.AZIMUTH else Knob.AZIMUTH


def _sky_share(error: PolarError, knob: Knob) -> float:
    """Arcseconds on the sky for one of the knob's."""
    if knob is Knob.ALTITUDE or abs(error.azimuth_arcsec) < 1e-9:
        return 1.0 if knob is Knob.ALTITUDE else float(np.hypot(error.axis[0], error.axis[1]))
    return abs(error.azimuth_on_sky_arcsec / error.azimuth_arcsec)


def _stop(error: PolarError, goal_arcsec: float) -> Instruction:
    if error.below_uncertainty and error.total_arcsec > goal_arcsec:
        text = tr(FINER, sigma="{sigma}")
    else:
        text = tr("{total} ± {sigma} from the pole. Tighten, then check.", total="{total}", sigma="{sigma}")
    return Instruction(TutorStep.STOP, text)
