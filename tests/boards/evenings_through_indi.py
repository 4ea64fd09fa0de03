"""Evenings of the families that Kochab drives through INDI's drivers alone: by the computer's clock, for INDI's is that.

Each has a server and a network of its own. INDI's driver may end when its mount falls silent; then the astronomer gives
the server the address again and connects anew.
"""

import tempfile
from datetime import UTC, datetime

import pytest

from kochab.core.errors import LineLostError
from kochab.gear.session import Meridian as Pier
from kochab.gear.session import MountSelection, guarded, limits_at

from . import SITE, Night
from .evenings import FALSE_DEG, Astronomer
from .indi import behind_indi


class ThroughIndi(Astronomer):
    """``evening.skipped`` tells why not, where INDI or the right to a network of one's own is lacking."""

    def __init__(self, kind, seed, orders=6):
        super().__init__(kind, seed, orders)
        self.line_lost = False

    def spend(self):
        """The whole evening."""
        chance = self.random
        settings = {
            "slew_deg_s": chance.uniform(5.0, 10.0),
            "acceleration_deg_s2": chance.uniform(3.0, 9.0),
            "keeps_clock": chance.random() < 0.4,
            "clock": Night(datetime.now(UTC)),
        }
        if self.kind == "starbook":
            settings["starts"] = True  # somebody presses OK on its screen
        try:
            with (
                tempfile.TemporaryDirectory(prefix="kochab-indi-", ignore_cleanup_errors=True) as home,
                behind_indi(self.kind, home, False, **settings) as (self.board, self.indi),
            ):
                self.board.align(*self._start())
                self._play(settings)
        except pytest.skip.Exception as why:
            self.evening.skipped = str(why)
        return self.evening

    def _connect(self):
        self.indi.tell(self.board)  # a driver that was started again knows nothing
        self._begin_session()
        selection = MountSelection(f"localhost:7624/{self.indi.device}", "indi")
        limits = limits_at(self.random.choice((Pier.FLIPS, Pier.CROSSES)))
        self.guard = guarded(selection, SITE, clock=self.board.clock, limits=limits, keep=True)
        self._look()

    def _do(self, what, order):
        def noticed():
            try:
                order()
            except LineLostError:
                self.line_lost = True
                raise

        told = super()._do(what, noticed)
        if self.line_lost:
            self.line_lost, guard, self.guard = False, self.guard, None
            if guard is not None:
                super()._do("leave the lost line", guard.close)
            for _ in range(5):
                if super()._do("connect again", self._connect) is True:
                    break
                self.time.sleep(3.0)
        return told

    def _put_home(self):
        """Where it takes itself to be when it wakes up, which is the western horizon for a StarBook."""
        self._cut("put home", 0.5)
        self.time.sleep(1.0 + self.board.boot_s)
        with self.board.lock:
            home = self.board.believed_axes_deg()
            for axis, there in zip(self.board.tube.axes, home, strict=True):
                axis.at_deg = there
            self.board.set_counters(home)
        if self._do("look", self._look) is True and self.board.false_by_deg() < FALSE_DEG:
            self.guard.clock_and_site.trust()
            self._note("trusted")
