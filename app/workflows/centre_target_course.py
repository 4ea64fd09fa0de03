"""From what was asked of a mount and what the sky says came of it, to the next correction.

Everything is in the mount's own coordinates and adds along its two axes, as syncs do. What a large
correction made of itself also tells how the mount's idea of the sky is turned against the sky (an
axis beside the pole turns it, a slipping clutch shortens it); the next one allows for that.
"""

from cmath import isfinite
from dataclasses import dataclass, field
from enum import StrEnum
from math import cos, radians

from app.core.attitude import apart_deg
from app.mounts.sky_frame import wrapped
from app.workflows.sync_mount import shifted

Degrees = tuple[float, float]

LEARN_FROM_DEG = 0.1
SLIP_FROM_DEG = 0.2
SLIP = (0.7, 1.4)  # achieved over asked; outside, something gives way
POLE_DEG = 80.0  # nearer to a pole axis angles are no measure of the way
SYNC_FROM_ARCSEC = 300.0
FINE_ARCSEC = 60.0
APPROACH_DEG = 0.1
REVERSED_ARCSEC = 3.0
LEARN_RATE_ARCSEC = 15.0  # less is lost in the noise
BETTER = 0.8  # of the error before, at least, or the correction was none


class How(StrEnum):
    """The ways to correct."""

    SYNC = "sync and goto"
    GOTO = "offset goto"
    APPROACH = "offset goto from one side"
    FINE = "small moves"


@dataclass(frozen=True, slots=True)
class Sight:
    """Where the mount said it pointed and where it did; its own coordinates, degrees."""

    said: Degrees
    sky: Degrees


@dataclass(slots=True)
class Course:
    """What has been seen on the way to ``target``, mount coordinates, degrees."""

    target: Degrees
    tolerance_arcsec: float
    errors_arcsec: list[float] = field(default_factory=list)
    turn: complex = 1.0 + 0.0j
    slips: int = 0
    gain: list[float] = field(default_factory=lambda: [1.0, 1.0])
    last: Sight | None = None
    _before: Sight | None = None
    _fine: Degrees | None = None
    _after_goto: Degrees | None = None  # declinations said and seen when the last goto had ended
    _dec_way: float = 0.0
    _learned_from: float = 0.0

    def add(self, sight: Sight, made: int) -> float:
        """Take in what a frame showed after ``made`` corrections; the error left, arcsec.

        After one that failed on the way there is nothing to learn: it counts as another look.
        """
        self.last = sight
        error = apart_deg(sight.sky, self.target) * 3600.0
        if self.errors_arcsec and made < len(self.errors_arcsec):
            self.errors_arcsec[-1] = error
            self._before = self._fine = None
            return error
        self.errors_arcsec.append(error)
        if self._before is not None or self._after_goto is None:
            self._after_goto = sight.said[1], sight.sky[1]
        if self._before is not None:
            self._learn(self._before, sight)
        elif self._fine is not None and made:
            self._learn_fine(self._fine)
        self._before = self._fine = None
        return error

    @property
    def error_arcsec(self) -> float:
        """The last one."""
        return self.errors_arcsec[-1]

    @property
    def left_deg(self) -> Degrees:
        """What is to be done towards east and north, degrees on the sky."""
        assert self.last is not None
        return _away(self.last.sky, self.target, self.target[1])

    def how(self, may_sync: bool) -> How:
        """The way of the next correction.

        The hour axis always turns with the sky, so that its gears are never loose; the other one
        may have play, which small moves would be lost in: it is sent.
        """
        north = 3600.0 * self.left_deg[1]
        if self.error_arcsec > SYNC_FROM_ARCSEC and may_sync:
            return How.SYNC
        if self.error_arcsec <= FINE_ARCSEC and abs(north) <= self.tolerance_arcsec / 2.0:
            return How.FINE
        return How.APPROACH if any(self._against) else How.GOTO

    @property
    def _against(self) -> tuple[bool, bool]:
        """Whether the axes have to turn against the way that keeps their gears' play taken up.

        That is with the sky for the hour axis, and as the last time for the other one.
        """
        east, north = (3600.0 * part for part in self.left_deg)
        return (
            east > REVERSED_ARCSEC,
            north * self._dec_way < 0.0 and abs(north) > REVERSED_ARCSEC,
        )

    def command(self, synced: bool, one_side: bool) -> list[Degrees]:
        """Where to send the mount, which was just ``synced`` or says what it said.

        With ``one_side`` by way of a place east or south of there, or both.

        In declination what counts is what it said after the last goto: those end alike, with the
        play of the gears on one side, and small moves since then may have been lost in it.
        """
        assert self.last is not None
        sky, said = self.last.sky, self.last.said
        if synced:
            said = sky
            self._after_goto = said[1], sky[1]
        east, north = self.left_deg
        then = self._after_goto or (said[1], sky[1])
        drift = then[0] - then[1] - (said[1] - sky[1])  # lost in the play since then
        asked = complex(east, north) / self.turn
        self._before = Sight((said[0], said[1] + drift), sky)
        narrow = _narrow(self.target[1])
        there = shifted((said[0], said[1] + drift), asked.real / narrow, asked.imag)
        hour, dec = self._against
        if abs(north) * 3600.0 > REVERSED_ARCSEC:
            self._dec_way = 1.0 if dec and one_side else north
        if not one_side:
            return [there]
        first = shifted(there, APPROACH_DEG / narrow * hour, -APPROACH_DEG * dec)
        return [first, there]

    def fine(self) -> Degrees:
        """Axis angles east and north, arcsec, for small moves; begins to learn from them."""
        east, north = (3600.0 * part for part in self.left_deg)
        self._fine = (east, north)
        if abs(north) > REVERSED_ARCSEC:
            self._dec_way = north
        return east / _narrow(self.target[1]) / self.gain[0], north / self.gain[1]

    @property
    def no_better(self) -> bool:
        """Whether the last two corrections did nothing."""
        e = self.errors_arcsec
        return len(e) > 2 and e[-1] > BETTER * e[-2] and e[-2] > BETTER * e[-3]

    def _learn(self, before: Sight, after: Sight) -> None:
        asked = complex(*_away(before.said, after.said, self.target[1]))
        came = complex(*_away(before.sky, after.sky, self.target[1]))
        if abs(asked) >= SLIP_FROM_DEG and abs(self.target[1]) < POLE_DEG:
            share = abs(came) / abs(asked)
            self.slips = 0 if SLIP[0] <= share <= SLIP[1] else self.slips + 1
        if abs(asked) < max(LEARN_FROM_DEG, 0.5 * self._learned_from):
            return
        turn = came / asked
        if isfinite(turn) and SLIP[0] <= abs(turn) <= SLIP[1]:
            self.turn, self._learned_from = turn, abs(asked)

    def _learn_fine(self, asked: Degrees) -> None:
        """Guide rates are settings of a mount: see what they are."""
        for axis, (want, left) in enumerate(
            zip(asked, (3600.0 * part for part in self.left_deg), strict=True)
        ):
            if abs(want) > LEARN_RATE_ARCSEC:
                self.gain[axis] *= min(max((want - left) / want, 0.4), 2.5)


def _away(start: Degrees, end: Degrees, dec_deg: float) -> Degrees:
    return wrapped(end[0] - start[0]) * _narrow(dec_deg), end[1] - start[1]


def _narrow(dec_deg: float) -> float:
    """How much narrower a degree of right ascension is."""
    return max(cos(radians(dec_deg)), 0.01)
