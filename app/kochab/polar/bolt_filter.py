"""What a bolt's thread may be, and where it stands in its backlash: a particle filter over what its turns did.

A person who is told to turn may turn as told, the other way, not at all (or the other bolt), too far, or have the axis
spring back when the bolt is locked; backlash swallows a part of every turn that comes back. One reading cannot tell
these apart, several can: each particle is one thread, sense and backlash, and is weighted by how well every hand
together with it explains the change that was seen (Gordon, Salmond and Smith 1993, IEE Proc. F 140, 107: sequential
importance resampling). The thread is free of scale, for a motor's turn may be anything: particles are drawn about what
each of the turns says by itself, and weighted so that any thread is as likely as another before all of them.

After every turn the particles are drawn anew and led through all turns from the first: whatever the first few mistakes
of a hand made unlikely is there again when later turns speak for it.
"""

from dataclasses import replace

import numpy as np

from kochab.core.arrays import Bools, Floats, Ints
from kochab.core.values import frozen

PARTICLES, SEED = 3000, 29
MOST_BACKLASH_TURNS, WITHOUT_BACKLASH = 0.5, 0.3  # evenly up to the one; the share of bolts that have none
HAND, HAND_TURNS = 0.1, 1.0 / 360.0  # one sigma of a turn: a share of it, and a degree
TOO_FAR_TURNS, TOO_FAR_SPREAD = (HAND_TURNS, 0.4), 0.15
"""By how much a hand goes too far, evenly in the logarithm, and one sigma of that from one turn to the next."""

SPRUNG_BACK = 0.8  # of a movement is left at most
READING_ARCSEC, DRAGGED = 5.0, 0.05  # one sigma of a change beside its noise: at least, and of the change itself
OUTLIER = 1e-3  # of a mean weight, for a turn that no hand explains
FEW = 0.1  # of the particles left in effect: they are drawn by their weights
DRAWN_NEAR, DRAWN_FAR = (0.6, 0.15), (0.25, 0.7)  # shares about a turn's own thread, and one sigma in its logarithm
DRAWN_ALIKE, FARTHEST = 0.75, 2.5  # share with the sense of that turn; and the rest are drawn evenly so far
THREAD_JITTER, BACKLASH_JITTER, TOO_FAR_JITTER = 0.015, 0.004, 0.03  # after every turn, so that particles stay apart
SAME_BOLT, SAME_THREAD, SAME_SENSE = 0.8, 0.15, 0.95
"""How surely another night's thread is this bolt's, its one sigma then, and how surely it turns the same way; else it
is up to e squared times another."""

UNSEEN = 0.1  # the chance that a bolt which moves the axis is not seen to, before its thread is known
AT_ALL, OTHER_WAY, TOO_FAR, SPRINGS = 0.94, 0.1, 0.07, 0.07
AS_ASKED = 1.0 - TOO_FAR - SPRINGS
CHANCES = AT_ALL * np.outer([1.0 - OTHER_WAY, OTHER_WAY], [AS_ASKED, TOO_FAR, SPRINGS]).ravel()
CHANCES = np.append(CHANCES, 1.0 - AT_ALL)
"""Of a hand that turns as far as asked, too far, or lets the axis spring back, each as told and the other way; and of
one that does not turn this bolt. Which way and how far are mistakes apart: one turn can have both."""
SPRUNG, OTHER_WAYS = [2, 5], [3, 4, 5]  # which of these
HABIT = 20.0
"""Turns after which what this hand did counts as much as what hands do; but which way it goes is no habit to learn, for
a hand that always goes the other way is a bolt of the other sense."""


@frozen
class Turn:
    """What was asked of a bolt and how the error changed, one sigma; ``seen``: by more than noise."""

    turns: float
    change_arcsec: float
    sigma_arcsec: float
    seen: bool


@frozen
class Mistaken:
    """Somebody turned this bolt instead of the other, this way."""

    clockwise: bool


@frozen(eq=False)
class BoltFilter:
    """Particles (N,) of equal weight; clockwise turns are positive.

    ``arcsec_a_turn`` is what a whole turn adds to the error, NaN before one was seen to move the axis;
    ``backlash_turns`` is the width of the backlash, and ``engaged_turns`` where in it the thread stands, from 0, where
    anticlockwise turns move the axis, to ``backlash_turns``, where clockwise ones do. ``too_far_turns`` is how far
    beyond what was asked this hand goes when it goes too far. ``hands`` (7, N) counts how often each of the hands in
    ``CHANCES`` seems to have been at work. ``events`` is all that was done to the bolt, and ``known`` what a turn of it
    was another night.
    """

    arcsec_a_turn: Floats
    backlash_turns: Floats
    engaged_turns: Floats
    too_far_turns: Floats
    hands: Floats
    events: tuple[Turn | Mistaken, ...] = ()
    known: float | None = None

    @classmethod
    def unknown(cls) -> "BoltFilter":
        """A bolt that nobody has turned yet."""
        return _believed((), None)

    @classmethod
    def other_night(cls, arcsec_a_turn: float) -> "BoltFilter":
        """One whose thread was found another night: it may be another bolt, or be looked at from its other end."""
        return _believed((), arcsec_a_turn)

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
        return self._of((self.arcsec_a_turn > 0.0) == (self.clockwise_adds >= 0.5))

    @property
    def wrong_turns(self) -> float:
        """How many turns are likely to have gone the other way."""
        return float(self.hands[OTHER_WAYS].sum(axis=0).mean())

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
        return _believed((*self.events, Turn(turns, change_arcsec, sigma_arcsec, seen)), self.known)

    def moved_by_mistake(self, clockwise: bool) -> "BoltFilter":
        """Somebody turned this bolt instead of the other: it stands at that end of its backlash."""
        return replace(self._at_end(clockwise), events=(*self.events, Mistaken(clockwise)))

    def _of(self, kept: Bools | Ints) -> "BoltFilter":
        return replace(
            self,
            arcsec_a_turn=self.arcsec_a_turn[kept],
            backlash_turns=self.backlash_turns[kept],
            engaged_turns=self.engaged_turns[kept],
            too_far_turns=self.too_far_turns[kept],
            hands=self.hands[:, kept],
        )

    def _at_end(self, clockwise: bool) -> "BoltFilter":
        return replace(self, engaged_turns=self.backlash_turns if clockwise else 0.0 * self.backlash_turns)

    def _stirred(self, random: np.random.Generator) -> "BoltFilter":
        """A little apart, as many were drawn from few."""
        backlash = self.backlash_turns + random.normal(0.0, BACKLASH_JITTER, PARTICLES)
        backlash = np.clip(backlash, 0.0, MOST_BACKLASH_TURNS)
        at_end = self.engaged_turns >= self.backlash_turns  # of its backlash, wherever that is by now
        return replace(
            self,
            arcsec_a_turn=self.arcsec_a_turn * np.exp(random.normal(0.0, THREAD_JITTER, PARTICLES)),
            backlash_turns=backlash,
            engaged_turns=np.where(at_end, backlash, np.minimum(self.engaged_turns, backlash)),
            too_far_turns=self.too_far_turns * np.exp(random.normal(0.0, TOO_FAR_JITTER, PARTICLES)),
        )

    @property
    def _chances(self) -> Floats:
        """How often (7, N) each of the hands is at work, after what this one did."""
        chances = (CHANCES[:, None] + self.hands / HABIT) / (1.0 + self.hands.sum(axis=0) / HABIT)
        either = chances[:3] + chances[3:6]
        return np.concatenate([(1.0 - OTHER_WAY) * either, OTHER_WAY * either, chances[6:]])

    def _weighed(self, turn: Turn, random: np.random.Generator) -> "tuple[BoltFilter, Floats]":
        """Each where the likeliest hands leave it, and how well (N,) all hands together explain the turn."""
        asked = turn.turns * (1.0 + random.normal(0.0, HAND, PARTICLES)) + random.normal(0.0, HAND_TURNS, PARTICLES)
        beyond = self.too_far_turns * np.exp(random.normal(0.0, TOO_FAR_SPREAD, PARTICLES))
        too_far = asked + np.copysign(beyond, turn.turns)
        free = self.engaged_turns + np.stack([asked, too_far, asked, -asked, -too_far, -asked, 0.0 * asked])
        inside = np.clip(free, 0.0, self.backlash_turns)
        moving = free - inside  # turns that move the axis: (hands, N)
        moving[SPRUNG] *= random.uniform(0.0, SPRUNG_BACK, PARTICLES)
        if self.has_thread:
            expected = moving * self.arcsec_a_turn
            sigma = np.hypot(1.5 * turn.sigma_arcsec, READING_ARCSEC) + DRAGGED * np.abs(expected)
            likelihood = np.exp(-0.5 * ((turn.change_arcsec - expected) / sigma) ** 2) / sigma
        else:
            likelihood = np.where(np.abs(moving) > HAND_TURNS, UNSEEN, 1.0)
        weights = self._chances * likelihood
        sums = np.cumsum(weights, axis=0)
        hand = (sums < random.random(PARTICLES) * sums[-1]).sum(axis=0).clip(max=len(CHANCES) - 1)
        engaged = np.take_along_axis(inside, hand[None, :], axis=0)[0]
        hands = self.hands + weights / np.maximum(sums[-1], 1e-300)
        return replace(self, engaged_turns=engaged, hands=hands), sums[-1]


def _believed(events: tuple[Turn | Mistaken, ...], known: float | None) -> BoltFilter:
    """What all that was done to a bolt says of it together."""
    random = np.random.default_rng([SEED, len(events)])
    backlash = random.uniform(0.0, MOST_BACKLASH_TURNS, PARTICLES)
    backlash *= random.random(PARTICLES) > WITHOUT_BACKLASH
    too_far = np.exp(random.uniform(np.log(TOO_FAR_TURNS[0]), np.log(TOO_FAR_TURNS[1]), PARTICLES))
    thread, weights = _threads(events, known, random)
    hands = np.zeros((len(CHANCES), PARTICLES))
    now = BoltFilter(thread, backlash, backlash * random.random(PARTICLES), too_far, hands)
    for event in events:
        if isinstance(event, Mistaken):
            now = now._at_end(event.clockwise)
            continue
        now, explains = now._weighed(event, random)
        weights = weights * (explains + OUTLIER * (weights @ explains) + 1e-300)
        weights /= weights.sum()
        kept, shares = _drawn_by_sense(weights, now.arcsec_a_turn > 0.0, random)
        if shares is not None:
            now, weights = now._of(kept)._stirred(random), shares
    return replace(now._of(_drawn(weights, random))._stirred(random), events=events, known=known)


def _threads(
    events: tuple[Turn | Mistaken, ...], known: float | None, random: np.random.Generator
) -> tuple[Floats, Floats]:
    """Threads (N,) about what each turn says by itself and about another night's, and weights (N,) that undo that."""
    seen = [event for event in events if isinstance(event, Turn) and event.seen]
    if not seen and known is None:
        return np.full(PARTICLES, np.nan), np.full(PARTICLES, 1.0 / PARTICLES)
    says = np.array([turn.change_arcsec / turn.turns for turn in seen] + ([] if known is None else [known]))
    about = random.integers(0, len(says), PARTICLES)
    kind = random.random(PARTICLES)
    apart = np.where(
        kind < DRAWN_NEAR[0],
        random.normal(0.0, DRAWN_NEAR[1], PARTICLES),
        np.where(
            kind < DRAWN_NEAR[0] + DRAWN_FAR[0],
            random.normal(0.0, DRAWN_FAR[1], PARTICLES),
            random.uniform(-FARTHEST, FARTHEST, PARTICLES),
        ),
    )
    sense = np.where(random.random(PARTICLES) < DRAWN_ALIKE, 1.0, -1.0)
    thread = says[about] * sense * np.exp(apart)
    log, alike = np.log(np.abs(thread))[:, None] - np.log(np.abs(says)), np.sign(thread)[:, None] == np.sign(says)
    drawn = sum(share * np.exp(-0.5 * (log / sigma) ** 2) / sigma for share, sigma in (DRAWN_NEAR, DRAWN_FAR))
    even = (1.0 - DRAWN_NEAR[0] - DRAWN_FAR[0]) * np.sqrt(2.0 * np.pi) / (2.0 * FARTHEST)
    density = (drawn + even * (np.abs(log) < FARTHEST)) * np.where(alike, DRAWN_ALIKE, 1.0 - DRAWN_ALIKE)
    weights = 1.0 / density.mean(axis=1)
    if known is not None:
        off, same = log[:, -1], alike[:, -1]
        sure = SAME_BOLT * np.exp(-0.5 * (off / SAME_THREAD) ** 2) / SAME_THREAD / np.sqrt(2.0 * np.pi)
        weights *= sure * np.where(same, SAME_SENSE, 1.0 - SAME_SENSE) + (1.0 - SAME_BOLT) / 8.0 * (np.abs(off) < 2.0)
    return thread, weights / weights.sum()


def _drawn(weights: Floats, random: np.random.Generator) -> Ints:
    """Which particle (N,) each to keep, drawn by their weights (N,): systematic resampling."""
    steps = (np.arange(len(weights)) + random.random()) / len(weights)
    return np.searchsorted(np.cumsum(weights) / weights.sum(), steps).clip(max=len(weights) - 1)


def _drawn_by_sense(weights: Floats, adds: Bools, random: np.random.Generator) -> tuple[Ints, Floats | None]:
    """Which particles (N,) to keep and their weights (N,); None while enough of either sense are left in effect.

    Each sense (N,) is drawn by itself and keeps its weight: whatever the first turns say, the particles of the other
    sense are there for those that follow.
    """
    kept, shares, few = np.arange(len(weights)), weights.copy(), False
    for own in (np.flatnonzero(adds), np.flatnonzero(~adds)):
        share = float(weights[own].sum())
        if share > 0.0 and share**2 / (weights[own] @ weights[own]) < FEW * len(own):
            few = True
            kept[own], shares[own] = own[_drawn(weights[own], random)], share / len(own)
    return kept, shares if few else None
