"""What a bolt's thread may be, and where it stands in its backlash: a particle filter over what its turns did.

A person who is told to turn may turn as told, the other way, not at all (or the other bolt), too far, or have the axis
spring back when the bolt is locked; backlash swallows a part of every turn that comes back. One reading cannot tell
these apart, several can: each particle is one thread, sense and backlash, and is weighted by how well every hand
together with it explains the change that was seen (Gordon, Salmond and Smith 1993, IEE Proc. F 140, 107: sequential
importance resampling). The thread is free of scale, for a motor's turn may be anything: the first turn that is seen
to move the axis gives each particle the one that fits.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from kochab.core.arrays import Floats, Ints

PARTICLES, SEED = 3000, 29
MOST_BACKLASH_TURNS, WITHOUT_BACKLASH = 0.5, 0.3  # evenly up to the one; the share of bolts that have none
HAND, HAND_TURNS = 0.1, 1.0 / 360.0  # one sigma of a turn: a share of it, and a degree
TOO_FAR_TURNS = 0.4  # at most
SPRUNG_BACK = 0.8  # of a movement is left at most
READING_ARCSEC, DRAGGED = 5.0, 0.05  # one sigma of a change beside its noise: at least, and of the change itself
OUTLIER = 1e-3  # of a mean weight, for a turn that no hand explains
THREAD_JITTER, BACKLASH_JITTER = 0.015, 0.004  # after every turn, so that particles stay apart
SAME_BOLT, SAME_THREAD, SAME_SENSE = 0.8, 0.15, 0.95
"""How surely another night's thread is this bolt's, its one sigma then, and how surely it turns the same way; else it
is up to e squared times another."""

MIRRORED = 0.003  # particles that change their sense after a turn
UNSEEN = 0.1  # the chance that a bolt which moves the axis is not seen to, before its thread is known
CHANCES = np.array([0.76, 0.06, 0.06, 0.06, 0.06])
"""Of a hand that turns as told, the other way, not or the other bolt, too far, and of an axis that springs back."""
HABIT = 10.0  # turns after which what this hand did counts as much as what hands do


@dataclass(frozen=True, slots=True, eq=False)
class BoltFilter:
    """Particles (N,) of equal weight; clockwise turns are positive.

    ``arcsec_a_turn`` is what a whole turn adds to the error, NaN before one was seen to move the axis;
    ``backlash_turns`` is the width of the backlash, and ``engaged_turns`` where in it the thread stands, from 0, where
    anticlockwise turns move the axis, to ``backlash_turns``, where clockwise ones do. ``n_turns`` seeds what is drawn;
    ``hands`` counts how often each of the hands in ``CHANCES`` seems to have been at work.
    """

    arcsec_a_turn: Floats
    backlash_turns: Floats
    engaged_turns: Floats
    n_turns: int = 0
    hands: Floats = field(default_factory=lambda: np.zeros(len(CHANCES)))

    @classmethod
    def unknown(cls) -> "BoltFilter":
        """A bolt that nobody has turned yet."""
        random = np.random.default_rng(SEED)
        backlash = random.uniform(0.0, MOST_BACKLASH_TURNS, PARTICLES)
        backlash *= random.random(PARTICLES) > WITHOUT_BACKLASH
        return cls(np.full(PARTICLES, np.nan), backlash, backlash * random.random(PARTICLES))

    @classmethod
    def other_night(cls, arcsec_a_turn: float) -> "BoltFilter":
        """One whose thread was found another night: it may be another bolt, or be looked at from its other end."""
        random, start = np.random.default_rng(SEED), cls.unknown()
        sure = random.random(PARTICLES) < SAME_BOLT
        spread = np.where(sure, random.normal(0.0, SAME_THREAD, PARTICLES), random.uniform(-2.0, 2.0, PARTICLES))
        sense = np.where(random.random(PARTICLES) < np.where(sure, SAME_SENSE, 0.5), 1.0, -1.0)
        return replace(start, arcsec_a_turn=arcsec_a_turn * sense * np.exp(spread))

    @property
    def has_thread(self) -> bool:
        """Whether a turn was seen to move the axis, or another night's is known."""
        return not bool(np.isnan(self.arcsec_a_turn[0]))

    @property
    def clockwise_adds(self) -> float:
        """The share of particles whose clockwise turn adds to the error."""
        return float(np.mean(self.arcsec_a_turn > 0.0))

    @property
    def likely(self) -> "BoltFilter":
        """The particles whose thread has the likelier sense."""
        kept = (self.arcsec_a_turn > 0.0) == (self.clockwise_adds >= 0.5)
        return replace(
            self,
            arcsec_a_turn=self.arcsec_a_turn[kept],
            backlash_turns=self.backlash_turns[kept],
            engaged_turns=self.engaged_turns[kept],
        )

    def slack_turns(self, direction: int) -> Floats:
        """The backlash (N,) that a turn in this direction crosses before the axis moves."""
        return self.backlash_turns - self.engaged_turns if direction > 0 else self.engaged_turns

    def turned(self, turns: float, change_arcsec: float, sigma_arcsec: float, seen: bool) -> "BoltFilter":
        """The filter after a bolt was turned.

        Parameters
        ----------
        turns : float
            How many turns were asked for, signed by their sense.
        change_arcsec : float
            By how much the error changed, arcseconds.
        sigma_arcsec : float
            One sigma of that change.
        seen : bool
            Whether it changed by more than noise does.
        """
        random = np.random.default_rng([SEED, self.n_turns + 1])
        asked = turns * (1.0 + random.normal(0.0, HAND, PARTICLES)) + random.normal(0.0, HAND_TURNS, PARTICLES)
        free = self.engaged_turns + np.stack(
            [
                asked,
                -asked,
                0.0 * asked,
                asked + np.copysign(random.uniform(0.0, TOO_FAR_TURNS, PARTICLES), turns),
                asked,
            ]
        )
        inside = np.clip(free, 0.0, self.backlash_turns)
        moving = free - inside  # turns that move the axis: (hands, N)
        moving[-1] *= random.uniform(0.0, SPRUNG_BACK, PARTICLES)
        first = not self.has_thread
        if first:
            # Evenly in its logarithm any thread is as likely, so all that moved fit as well.
            moves = np.abs(moving) > HAND_TURNS
            likelihood = moves * 1.0 if seen else np.where(moves, UNSEEN, 1.0)
        else:
            expected = moving * self.arcsec_a_turn
            sigma = np.hypot(1.5 * sigma_arcsec, READING_ARCSEC) + DRAGGED * np.abs(expected)
            likelihood = np.exp(-0.5 * ((change_arcsec - expected) / sigma) ** 2) / sigma
        chances = CHANCES + self.hands / HABIT
        hand, kept = _drawn(chances[:, None] * likelihood, random)
        thread = self.arcsec_a_turn[kept]
        if first and seen:
            by = moving[hand, kept]
            thread = change_arcsec / np.where(np.abs(by) > HAND_TURNS, by, turns)
        backlash = np.clip(
            self.backlash_turns[kept] + random.normal(0.0, BACKLASH_JITTER, PARTICLES), 0.0, MOST_BACKLASH_TURNS
        )
        at_end = inside[hand, kept] >= self.backlash_turns[kept]  # of its backlash, wherever that is by now
        engaged = np.where(at_end, backlash, np.minimum(inside[hand, kept], backlash))
        # A few change their sense, or the one that three mistakes in a row spoke against would be gone for good.
        mirrored = random.random(PARTICLES) < MIRRORED
        return BoltFilter(
            thread * np.exp(random.normal(0.0, THREAD_JITTER, PARTICLES)) * np.where(mirrored, -1.0, 1.0),
            backlash,
            np.where(mirrored, backlash - engaged, engaged),
            self.n_turns + 1,
            self.hands + np.bincount(hand, minlength=len(CHANCES)) / PARTICLES,
        )

    def moved_by_mistake(self, clockwise: bool) -> "BoltFilter":
        """Somebody turned this bolt instead of the other: it stands at that end of its backlash."""
        return replace(self, engaged_turns=self.backlash_turns if clockwise else 0.0 * self.backlash_turns)


def _drawn(weights: Floats, random: np.random.Generator) -> tuple[Ints, Ints]:
    """Which hand and which particle (N,) each to keep, drawn by their weights (hands, N): systematic resampling."""
    of_particle = weights.sum(axis=0)
    of_particle = of_particle + OUTLIER * of_particle.mean() + 1e-300
    steps = (np.arange(PARTICLES) + random.random()) / PARTICLES
    kept = np.searchsorted(np.cumsum(of_particle) / of_particle.sum(), steps).clip(max=PARTICLES - 1)
    chances = np.cumsum(weights[:, kept], axis=0)
    hand = (chances < random.random(PARTICLES) * chances[-1]).sum(axis=0)
    return hand.clip(max=len(weights) - 1), kept
