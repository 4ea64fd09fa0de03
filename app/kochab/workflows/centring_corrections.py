"""From the solves of a centring to its next correction.

Everything is in the mount's own coordinates and adds along its two axes, as syncs do. What a large
correction achieved also shows how the mount's coordinates are rotated against the sky (a misaligned
axis rotates them, a slipping clutch shortens them); the next one allows for that.
"""

from cmath import isfinite
from dataclasses import field
from enum import StrEnum
from math import cos, radians

from kochab.core.attitude import Degrees, apart_deg, wrapped
from kochab.core.values import frozen, mutable
from kochab.text.translation import tr_noop
from kochab.workflows.sync_mount import shifted

LEARN_FROM_DEG = 0.1
SLIP_FROM_DEG = 0.2
SLIP = (0.7, 1.4)  # achieved over sent; outside, something slips
POLE_DEG = 80.0  # nearer to a pole axis angles say little about the distance
SYNC_FROM_ARCSEC = 300.0
FINE_ARCSEC = 60.0
APPROACH_DEG = 0.1
REVERSED_ARCSEC = 3.0
LEARN_RATE_ARCSEC = 15.0  # less is lost in the noise
BETTER = 0.8  # of the error before, at least, or the correction was none


class Correction(StrEnum):
    """How a correction is made."""

    SYNC = tr_noop("sync and goto")
    GOTO = tr_noop("offset goto")
    APPROACH = tr_noop("offset goto from one side")
    FINE = tr_noop("small moves")


@frozen
class MountAndSky:
    """The reported and the solved position; mount coordinates, degrees."""

    reported: Degrees
    sky: Degrees


@mutable
class Course:
    """The course of a centring on ``target``; mount coordinates, degrees."""

    target: Degrees
    tolerance_arcsec: float
    errors_arcsec: list[float] = field(default_factory=list)
    turn: complex = 1.0 + 0.0j  # came over sent, east + i north: how the coordinates are rotated and shortened
    slips: int = 0
    gain: list[float] = field(default_factory=lambda: [1.0, 1.0])
    last: MountAndSky | None = None
    _before: MountAndSky | None = None
    _fine: Degrees | None = None
    _after_goto: Degrees | None = None  # declinations reported and solved when the last goto had ended
    _dec_way: float = 0.0
    _learned_from: float = 0.0

    def add(self, sight: MountAndSky, made: int) -> float:
        """Add what a frame showed after ``made`` corrections; the error left, arcsec.

        After a correction that failed there is nothing to learn: it counts as another frame.
        """
        self.last = sight
        error = apart_deg(sight.sky, self.target) * 3600.0
        if self.errors_arcsec and made < len(self.errors_arcsec):
            self.errors_arcsec[-1] = error
            if self._before is not None:  # a goto that broke off: where the last whole one ended is history
                self._after_goto = None
            self._before = self._fine = None
            return error
        self.errors_arcsec.append(error)
        if self._before is not None or self._after_goto is None:  # only a goto sets _before
            self._after_goto = sight.reported[1], sight.sky[1]
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
        """The error left towards east and north, degrees on the sky."""
        assert self.last is not None
        return _away(self.last.sky, self.target, self.target[1])

    def how(self, may_sync: bool) -> Correction:
        """How to make the next correction.

        The RA axis always tracks, so that its backlash stays taken up; small moves of the other
        axis may be lost in its backlash, so a goto is sent.
        """
        north = 3600.0 * self.left_deg[1]
        if self.error_arcsec > SYNC_FROM_ARCSEC and may_sync:
            return Correction.SYNC
        if self.error_arcsec <= FINE_ARCSEC and abs(north) <= self.tolerance_arcsec / 2.0:
            return Correction.FINE
        return Correction.APPROACH if any(self._against) else Correction.GOTO

    @property
    def _against(self) -> tuple[bool, bool]:
        """Whether the axes have to turn against the direction that keeps their backlash taken up.

        That is with the sky for the RA axis, and as the last time for the other one.
        """
        east, north = (3600.0 * part for part in self.left_deg)
        return (east > REVERSED_ARCSEC, north * self._dec_way < 0.0 and abs(north) > REVERSED_ARCSEC)

    def command(self, synced: bool, one_side: bool) -> list[Degrees]:
        """Where to send the mount, which was just ``synced`` or reports what it did before.

        With ``one_side`` through a place east or south of there, or both.

        In declination the position after the last goto counts: gotos end alike, with the backlash
        on one side, and small moves since then may have been lost in it.
        """
        assert self.last is not None
        sky, reported = self.last.sky, self.last.reported
        if synced:
            reported = sky  # what the mount says since the sync
            self._after_goto = reported[1], sky[1]
        east, north = self.left_deg
        then = self._after_goto or (reported[1], sky[1])
        drift = then[0] - then[1] - (reported[1] - sky[1])  # lost in the backlash since then
        sent = complex(east, north) / self.turn
        self._before = MountAndSky((reported[0], reported[1] + drift), sky)
        narrow = _narrow(self.target[1])
        there = shifted((reported[0], reported[1] + drift), sent.real / narrow, sent.imag)
        hour, dec = self._against
        if abs(north) * 3600.0 > REVERSED_ARCSEC:
            self._dec_way = 1.0 if dec and one_side else north
        if not one_side:
            return [there]
        return [shifted(there, APPROACH_DEG / narrow * hour, -APPROACH_DEG * dec), there]

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

    def _learn(self, before: MountAndSky, after: MountAndSky) -> None:
        sent = complex(*_away(before.reported, after.reported, self.target[1]))
        came = complex(*_away(before.sky, after.sky, self.target[1]))
        if abs(sent) >= SLIP_FROM_DEG and abs(self.target[1]) < POLE_DEG:
            share = abs(came) / abs(sent)
            self.slips = 0 if SLIP[0] <= share <= SLIP[1] else self.slips + 1
        if abs(sent) < max(LEARN_FROM_DEG, 0.5 * self._learned_from):  # a short goto tells less than a long one before
            return
        turn = came / sent
        if isfinite(turn) and SLIP[0] <= abs(turn) <= SLIP[1]:
            self.turn, self._learned_from = turn, abs(sent)

    def _learn_fine(self, sent: Degrees) -> None:
        """Learn the guide rates, which are settings of the mount."""
        for axis, (want, left) in enumerate(zip(sent, (3600.0 * part for part in self.left_deg), strict=True)):
            if abs(want) > LEARN_RATE_ARCSEC:
                self.gain[axis] *= min(max((want - left) / want, 0.4), 2.5)


def _away(start: Degrees, end: Degrees, dec_deg: float) -> Degrees:
    return wrapped(end[0] - start[0]) * _narrow(dec_deg), end[1] - start[1]


def _narrow(dec_deg: float) -> float:
    """How much narrower a degree of right ascension is."""
    return max(cos(radians(dec_deg)), 0.01)
