"""Evenings at the command line: every order is a ``kochab mount`` of its own, by the real time."""

import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from datetime import UTC, datetime
from math import degrees, radians

import erfa

from kochab.core.errors import KochabError

from . import SITE
from .evenings import RUNS_OUT_S, Astronomer

PATIENCE_S = 280.0
TOLD = ("cut its power", "cut the power")
FAULTS = ("Traceback", "A fault in Kochab")


def icrs_deg(place_deg, unix):
    """Of date to ICRS, but for aberration, which is 20 arcsec."""
    matrix = erfa.pnm06a(40587.0 + 2400000.5, unix / 86400.0 + 69.184 / 86400.0)
    ra, dec = erfa.c2s(matrix.T @ erfa.s2c(*map(radians, place_deg)))
    return degrees(ra) % 360.0, degrees(dec)


class AtTheCommandLine(Astronomer):
    """Who types; Ctrl-C and a closed terminal are among the mishaps."""

    def _date(self):
        return datetime.now(UTC)

    def _connect(self):
        self.guard = self  # every order connects for itself

    def _through_the_night(self):
        things = {
            self._goto: 10,
            self._sync: 4,
            self._home: 3,
            self._park: 2,
            self._simple("unpark"): 1,
            self._simple("position"): 2,
            self._simple("set-clock"): 2,
            self._stop: 2,
        }
        for _ in range(self.orders):
            if self.random.random() < 0.15:
                self._cut("between")
            (thing,) = self.random.choices(list(things), list(things.values()))
            thing()

    def _go_to_bed(self):
        pass

    # -- orders --------------------------------------------------------------------------------------

    def _simple(self, action):
        return lambda: self._do(action, lambda: self._run(action))

    def _goto(self):
        target = self._target()
        flip = ["--allow-flip"] if self.random.random() < 0.7 else []
        order = lambda: self._run("goto", *self._typed(target), *flip)  # noqa: E731 (as its neighbours)
        self._slews("goto", order, target)

    def _home(self):
        self._slews("home", lambda: self._run("home", "--yes"), None)

    def _park(self):
        self._slews("park", lambda: self._run("park", "--yes"), None)

    def _sync(self):
        arm = ["--arm"] if self.random.random() < 0.5 else []
        self._do("sync", lambda: self._run("sync", *self._typed(self.board.radec_deg()), *arm))

    def _stop(self):
        """With a hand control's key down, so that there is something to stop."""
        self.board.nudge_by_hand(1, self.random.choice((-0.5, 0.5)))
        if self.random.random() < 0.3:
            self.board.lose_stops(1)
        self._do("stop", lambda: self._run("stop"))

    def _do(self, what, order):
        self._begin_session()  # each command is one
        return super()._do(what, order)

    def _slews(self, what, order, target):
        self._begin_session()
        if self.random.random() < 0.25:
            self.board.lose_stops(1)
        super()._slews(what, order, target)

    def _typed(self, place_deg):
        ra, dec = icrs_deg(place_deg, self.board.clock.unix())
        return f"--ra-deg={ra:.5f}", f"--dec-deg={dec:.5f}", "--yes"

    def _run(self, action, *words):
        """One command, to its end; a failure is raised as what it printed."""
        site = f"--site={SITE.latitude_deg},{SITE.longitude_deg}"
        # It is at the wheel that a person says where a motor board's home is.
        home = ["--home=now"] if self.kind == "skywatcher" and self._at_home() else []
        given = [f"--port={self.board.port}", f"--driver={self.board.driver}", site]
        line = [sys.executable, "-m", "kochab", "mount", action, *words, *given, *home]
        self.process = subprocess.Popen(
            line, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env={**os.environ, "COLUMNS": "200"}
        )
        try:
            told, _ = self.process.communicate(timeout=PATIENCE_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self._against("hang", f"{action}, {PATIENCE_S:.0f} s")
            raise KochabError("killed") from None
        self._left_alone(action, told)
        if any(fault in told for fault in FAULTS):
            self._against("fault", told.strip().splitlines()[-1])
        if self.process.returncode:
            raise KochabError(" / ".join(told.replace("{", "(").split("\n")).strip(" /") or "nothing was said")

    def _left_alone(self, action, told):
        """A session has ended: whatever a person may order next, nothing must run on but what was told."""
        time.sleep(RUNS_OUT_S)
        if self.board.moving and not any(word in told.lower() for word in TOLD):
            self._against("running", f"after {action} ended: {told.strip()[-120:]}")
        with self.board.lock:
            self.board.stop()

    # -- mishaps -------------------------------------------------------------------------------------

    @contextmanager
    def _befalls(self, mishap):
        """Most strike when the board has got its order, some at any moment."""
        over, orders = threading.Event(), len(self.board.orders)
        waits = self.random.random() < 0.75
        after_s = self.random.uniform(0.0, 3.0) if waits else self.random.uniform(0.3, 6.0)

        def strike():
            while waits and len(self.board.orders) == orders and not over.wait(0.02):
                pass
            if mishap is not None and not over.wait(after_s):
                mishap()

        thread = threading.Thread(target=strike, daemon=True)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()

    def _break_off(self):
        sent = self.random.choice((signal.SIGINT, signal.SIGTERM))
        self._note(f"{sent.name}")
        self.process.send_signal(sent)
