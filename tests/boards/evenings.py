"""Random evenings with power cuts against the guard and the drivers: ``python -m tests.boards.evenings N --seed S``.

An astronomer who solves every picture rightly slews, syncs, nudges, parks, goes home, stops, sets the clock and
disconnects, while the mount's supply fails, answers and Stops are lost, and clocks are wrong. The boards know where the
tube truly is, and what they see there is counted: see :data:`KINDS`. One line a violation, one a board, one in all;
exit 0 when there was no violation.

Evenings pass in a virtual time of their own and take a second or two; a seed repeats its evening to the byte. At the
command line and at the window, and with ``--real-time``, they run by the computer's clock on lines of the system. So do
those of the families behind INDI's drivers, of which a few of six orders each are played after the others: INDI cannot
be given another clock, and an evening takes it one to five minutes.
"""

import argparse
import os
import re
import sys
import tempfile
import traceback
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from math import inf
from random import Random

from kochab.core.errors import KochabError
from kochab.core.mount import Direction, Home, TrackingRate
from kochab.core.progress import run
from kochab.gear.session import Meridian as Pier
from kochab.gear.session import MountSelection, guarded, limits_at
from kochab.workflows.nudge import nudge

from . import BEHIND_INDI, BOARDS, SITE, Night, RealTime, served, virtual_time
from .mechanics import HOME_DEG
from .sky import altaz_deg, apart_deg, half_turn, sidereal_deg, sun_deg

KINDS = {
    "low": "the tube below the horizon limit",
    "sun": "the tube near the Sun",
    "false": "a slew that started while the board was wrong about where it is",
    "done": "said to be done, and the tube is somewhere else",
    "running": "a motion that ran on after a Stop that was said to work, or after the session's end",
    "word": "the end of a motion that lost its power, with no word of power or a restart",
    "hang": "an order that did not end, a minute after the mount stood still",
    "fault": "an end that is no sentence of Kochab's",
}
IDLE_S, HANG_S = 60.0, 300.0  # how long an order may last while the mount stands, and at all
LOW_DEG, SUN_DEG, FALSE_DEG = 3.0, 28.0, 5.0  # two degrees for the motors to stop in
RUNS_OUT_S = 4.0
INDI_ORDERS = 6
RESTART = re.compile(r"power|switched|restart|woke", re.IGNORECASE)
THIRTEEN_YEARS_S = -13 * 31557600.0


@dataclass
class Evening:
    """What happened: what was done and told, and ``(kind, what)`` of every violation."""

    board: str
    seed: int
    diary: list[str] = field(default_factory=list)
    violations: list[tuple[str, str]] = field(default_factory=list)
    cuts: int = 0
    skipped: str = ""  # why it was not played


class Astronomer:
    """One evening at one board. ``orders`` are how many things are done; the guard is the product's own."""

    def __init__(self, kind, seed, orders=10, time=None):
        self.kind, self.orders = kind, orders
        self.virtual, self.time = time, time or RealTime
        self.random = Random(f"{kind} {seed}")
        self.evening = Evening(kind, seed)
        self.guard = None
        self.lost_before = False  # a program that begins later cannot know of a cut before
        self.left_right = False  # but the mount stood elsewhere than at its home, rightly, when the last one ended

    # -- the evening ---------------------------------------------------------------------------------

    def spend(self):
        """The whole evening; never raises."""
        chance = self.random
        start = self._date()
        settings = {
            "slew_deg_s": chance.uniform(5.0, 12.0),
            "acceleration_deg_s2": chance.uniform(3.0, 9.0),
            "keeps_clock": chance.random() < 0.4,
            "claims_home": chance.random() < 0.7,
        }
        line = {"tcp": chance.random() < 0.3}
        line |= {"time": self.virtual, "start": start} if self.virtual else {"clock": Night(start)}
        with served(self.kind, **line, **settings) as board:
            self.board = board
            if self.kind != "skywatcher":  # a motor board's evening begins at its home
                board.align(*self._start())
            if chance.random() < 0.1:
                board.clock_error_s = THIRTEEN_YEARS_S
            self._play(settings)
        return self.evening

    def _play(self, settings):
        board = self.board
        self._note(f"{board.clock():%F %H:%M}", settings, board.port, f"clock {board.clock_error_s:.0f} s")
        try:
            if self._do("connect", self._connect) is True:
                self._through_the_night()
            self._go_to_bed()
        except Hangs:
            self._against("hang", "given up")
        self.evening.cuts = len(board.cuts)

    def _date(self):
        day = datetime(2026, self.random.randint(1, 12), self.random.randint(1, 28), tzinfo=UTC)
        return day + timedelta(hours=self.random.choice((19, 20, 21, 22, 23, 0, 1, 2, 3, 8, 12, 15)))

    def _through_the_night(self):
        things = {
            self._goto: 10,
            self._sync: 5,
            self._nudge: 4,
            self._home: 3,
            self._park: 2,
            self._unpark: 2,
            self._stop: 1,
            self._track: 1,
            self._wait: 2,
            self._set_clock: 2,
            self._put_home: 1,
            self._disconnect: 2,
        }
        for _ in range(self.orders):
            if self.guard is None and self._do("connect", self._connect) is not True:
                continue
            if self.random.random() < 0.12:
                self._cut("between")
            (thing,) = self.random.choices(list(things), list(things.values()))
            thing()

    def _go_to_bed(self):
        """The end of the session, often with a motion under way and a Stop that is lost."""
        if self.guard is None:
            return
        if self.random.random() < 0.6:
            self._do("goto unattended", lambda: self.guard.goto(*self._target()))
            self.time.sleep(self.random.uniform(0.0, 1.5))
        if self.random.random() < 0.5:
            self.board.lose_stops(1)
        self._disconnect()

    # -- what is done --------------------------------------------------------------------------------

    def _connect(self):
        pier = self.random.choice((Pier.FLIPS, Pier.FLIPS, Pier.CROSSES, Pier.STAYS))
        self._begin_session()
        home = Home.NOW if self._at_home() else None  # no word of it that is not true
        selection = MountSelection(self.board.port, self.board.driver, home=home)
        self.guard = guarded(selection, SITE, clock=self.board.clock, limits=limits_at(pier), keep=True)
        self._look()  # as the window and every command do at once

    def _at_home(self):
        with self.board.lock:
            stands = [axis.at_deg for axis in self.board.tube.axes]
            return not self.board.moving and max(abs(a - b) for a, b in zip(stands, HOME_DEG, strict=True)) < 0.5

    def _disconnect(self):
        guard, self.guard = self.guard, None

        def part():
            """As the window's line does, which says what it saw."""
            try:
                guard.see_stopped()
            finally:
                guard.close()

        told = self._do("disconnect", part)
        beside_pole = abs(self.board.believed_hour_angle_dec_deg()[1]) > 90.0 - FALSE_DEG
        self.left_right = not beside_pole and self.board.lost_by_deg() < FALSE_DEG
        self.time.sleep(RUNS_OUT_S)
        if self.board.moving:
            if told is True or "power" not in told:
                self._against("running", "after the session's end")
            with self.board.lock:
                self.board.stop()

    def _goto(self):
        target = self._target()
        self._slews("goto", lambda: self._order("goto", lambda guard: guard.slew(*target)), target)

    def _order(self, _name, make):
        """A task of the guard's, to its end."""
        run(make(self.guard))

    def _home(self):
        self._slews("home", lambda: self._order("home", lambda guard: guard.rest("home")), None)

    def _park(self):
        self._slews("park", lambda: self._order("park", lambda guard: guard.rest("park")), None)

    def _slews(self, what, order, target):
        """A motion that is waited for, with what may befall it."""
        # The rest is judged here, by where the tube came to stand.
        cuts, unknowable = len(self.board.cuts), self._unknowable()
        with self._befalls(self._mishap()):
            told = self._do(what, order)
        if unknowable:
            return
        was_cut = any(was for _, was in self.board.cuts[cuts:])
        lost = self.board.false_by_deg() > FALSE_DEG
        if told is True and was_cut and lost:
            self._against("done", f"{what}, {self.board.false_by_deg():.0f} deg off")
        elif told is True and target is not None and apart_deg(self.board.radec_deg(), target) > FALSE_DEG:
            self._against("done", f"{what}, {apart_deg(self.board.radec_deg(), target):.0f} deg from the target")
        elif was_cut and lost and told is not True and self.board.heard and not RESTART.search(told):
            self._against("word", f"{what}: {told}")

    def _sync(self):
        """On the truth, as a solved picture tells it, of a tube that stands."""
        for _ in range(50):
            if self.board.moving:
                self.time.sleep(0.1)
        ra, dec = self.board.radec_deg()
        self.guard.allow_large_sync = self.random.random() < 0.5
        self._do("sync", lambda: self.guard.sync(ra, dec, by_hand=True, confirmed=True))

    def _nudge(self):
        direction = self.random.choice(list(Direction))
        rate, seconds = self.random.choice((0.1, 0.5, 2.0, 6.0)), self.random.uniform(0.3, 3.0)
        if lost := self.random.random() < 0.3:
            self.board.lose_stops(1)
        self._do(f"nudge {direction} {rate} {seconds:.1f}", lambda: self._order_nudge(direction, rate, seconds))
        if lost:
            self.time.sleep(seconds)
            if self._do("watch the nudge's end", self._look_on) is True and self.board.moving:
                self._against("running", "after a nudge, and nothing was said")
        elif self.random.random() < 0.5:
            self.time.sleep(seconds)  # and sometimes the next order comes while it runs out
        if self.random.random() < 0.3:
            self._sync()

    def _order_nudge(self, direction, rate, seconds):
        """As a person's key does, which waits for its end: nothing in Kochab moves an axis in another way."""
        run(nudge(self.guard, direction, 3600.0 * rate * seconds, rate_deg_s=rate))

    def _unpark(self):
        self._do("unpark", self.guard.unpark)

    def _track(self):
        rate = self.random.choice((TrackingRate.SIDEREAL, TrackingRate.SIDEREAL, TrackingRate.OFF))
        self._do(f"track {rate}", lambda: self.guard.track(rate))

    def _set_clock(self):
        self._do("set clock", self.guard.set_clock)

    def _stop(self):
        if self._do("stop", self._stop_and_see) is True and self.board.moving:
            self.time.sleep(RUNS_OUT_S)
            if self.board.moving:
                self._against("running", "after a Stop that was said to work")

    def _stop_and_see(self):
        self.guard.stop()
        self.guard.emergency.confirm()

    def _wait(self):
        self._do("wait", self._look_on)

    def _look_on(self):
        """As the window does, twice a second."""
        for _ in range(8):
            self.time.sleep(0.5)
            self._look()

    def _put_home(self):
        """The astronomer does as told: puts the tube home with the power off, and says so."""
        with self.board.lock:
            self.board.stop()
            for axis, home in zip(self.board.tube.axes, HOME_DEG, strict=True):
                axis.lose_power()
                axis.at_deg = home
        self._cut("put home", 0.5)
        self.time.sleep(0.6 + self.board.boot_s)
        with self.board.lock:
            self.board.parked = False
        if self.kind == "skywatcher":
            self._disconnect()
            return
        self._set_clock()
        seen = self._do("look", self._look) is True and self.board.false_by_deg() < FALSE_DEG
        if seen and abs(self.board.clock_error_s) < 600.0:  # at the pole every clock looks right
            self.guard.clock_and_site.trust()
            self._note("trusted")

    def _look(self):
        self.guard.state()
        self.guard.position()

    # -- what befalls --------------------------------------------------------------------------------

    @contextmanager
    def _befalls(self, mishap):
        """At a moment of what is done here."""
        timer = self.time.Timer(self.random.uniform(0.2, 5.0), mishap or (lambda: None))
        timer.start()
        try:
            yield
        finally:
            timer.cancel()
            timer.join()

    def _break_off(self):
        with suppress(KochabError):
            self.guard.stop()

    def _mishap(self):
        befalls = {
            None: 6,
            (lambda: self._cut("during")): 8,
            (lambda: self.board.lose_answers(self.random.randint(1, 4))): 2,
            (lambda: self.board.delay_answers(self.random.randint(1, 3), self.random.uniform(0.5, 6.0))): 2,
            self._break_off: 2,
        }
        return self.random.choices(list(befalls), list(befalls.values()))[0]

    def _cut(self, when, off_s=None):
        off_s = self.random.choice((0.1, 0.5, 2.0, 8.0)) if off_s is None else off_s
        self._note(f"POWER CUT {when}, {off_s} s")
        self.board.cut_power(off_s)

    # -- where ---------------------------------------------------------------------------------------

    def _start(self):
        """Hour angle and Dec, well up and away from the Sun."""
        while True:
            hour_angle, dec = self.random.uniform(-70.0, 70.0), self.random.uniform(0.0, 80.0)
            if self._fair(hour_angle, dec, 25.0, 60.0):
                return hour_angle, dec

    def _fair(self, hour_angle, dec, altitude, sun):
        now = self.board.clock.unix()
        ra = sidereal_deg(now, SITE.longitude_deg) - hour_angle
        up = altaz_deg(hour_angle, dec, SITE.latitude_deg)[0] > altitude
        return up and apart_deg((ra, dec), sun_deg(now)) > sun

    def _target(self):
        """RA and Dec of date: mostly fair, sometimes low or near the Sun."""
        foolish = self.random.random() < 0.15
        while True:
            hour_angle, dec = self.random.uniform(-80.0, 80.0), self.random.uniform(-20.0, 85.0)
            if foolish or self._fair(hour_angle, dec, 12.0, 35.0):
                return (sidereal_deg(self.board.clock.unix(), SITE.longitude_deg) - hour_angle) % 360.0, dec

    # -- what is seen --------------------------------------------------------------------------------

    def _do(self, what, order):
        """True when it was done, else the sentence that told why not; whatever the tube did meanwhile is judged."""
        begun, orders = self.board.clock.unix(), len(self.board.orders)
        up_before, sun_before = self._tube()
        unknowable = self._unknowable()
        told = self._outcome(order)
        self._note(what, "->", "done" if told is True else told)
        self.time.sleep(0.3)
        if unknowable:
            return told
        low = self.board.lowest_deg(begun)
        if low < LOW_DEG < up_before:
            self._against("low", f"{low:.1f} deg by {what}")
        near = self.board.nearest_sun_deg(begun)
        if near < SUN_DEG < sun_before:
            self._against("sun", f"{near:.0f} deg by {what}")
        for order_ in self.board.orders[orders:]:
            if order_.kind == "goto" and order_.false_by_deg > FALSE_DEG:
                self._against("false", f"{order_.false_by_deg:.0f} deg by {what}")
        return told

    def _begin_session(self):
        self.lost_before = self.board.lost_by_deg() > FALSE_DEG and not self.left_right

    def _unknowable(self):
        """Whether the board was wrong before this session already, with a clock and a site that are right.

        And a cut at a false home shows nothing new.
        """
        self.lost_before &= self.board.lost_by_deg() > FALSE_DEG
        return self.lost_before and abs(self.board.clock_error_s) <= 600.0

    def _tube(self):
        with self.board.lock:
            self.board.tube.advance()
            tube = self.board.tube
            return tube.altaz_deg()[0], apart_deg(tube.radec_deg(), sun_deg(tube.now))

    def _outcome(self, order):
        ended = []

        def go():
            try:
                order()
                ended.append(True)
            except KochabError as error:
                ended.append(str(error) or type(error).__name__)
            except BaseException:
                ended.append("".join(traceback.format_exc()))

        thread = self.time.start(go)
        begun = still_since = self.time.monotonic()
        while thread.is_alive():
            self.time.sleep(0.02)
            now = self.time.monotonic()
            still_since = now if self.board.moving or not self.board.powered else still_since
            if now - begun > HANG_S:
                raise Hangs
            if now - still_since > IDLE_S:
                self._against("hang", f"{now - begun:.0f} s")
                still_since = inf
        if ended[0] is not True and ended[0].startswith("Traceback"):
            self._against("fault", ended[0].strip().splitlines()[-1])
        return ended[0]

    def _note(self, *words):
        hour_angle = half_turn(self.board.tube.hour_angle_dec_deg()[0])
        stands = f"[{hour_angle:+.0f} {self.board.tube.hour_angle_dec_deg()[1]:+.0f}]"
        self.evening.diary.append(f"{self.board.clock():%H:%M:%S} {stands} {' '.join(map(str, words))}")

    def _against(self, kind, what):
        self.evening.violations.append((kind, what))
        self._note("!!", kind, what)


class Hangs(Exception):  # noqa: N818 (ends an evening)
    """An order did not come back."""


def spend(kind, seed, orders=10, where=""):
    """One evening, in a configuration of its own: in this program, at the "command line" or at the "window".

    Those two take the computer's time, and so does one ``where`` "real time" is asked for, or one "through INDI".
    """
    from .command_line import AtTheCommandLine
    from .evenings_through_indi import ThroughIndi
    from .window import AtTheWindow

    person = {"command line": AtTheCommandLine, "window": AtTheWindow}.get(where, Astronomer)
    with tempfile.TemporaryDirectory(prefix="kochab-evening-", ignore_cleanup_errors=True) as folder:
        os.environ["KOCHAB_CONFIG"] = folder
        if where == "through INDI":
            return ThroughIndi(kind, seed, orders).spend()
        with nullcontext() if where else virtual_time() as time:
            return person(kind, seed, orders, time).spend()


def main(arguments=None):
    """The command line; the number of violations, at most 1, is its exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("count", type=int, help="evenings in all, dealt round the boards")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--board", choices=[*BOARDS, *BEHIND_INDI])
    parser.add_argument("--through-indi", type=int, default=1, metavar="N", help="evenings of each of those families")
    parser.add_argument("--orders", type=int, default=10, help="things done in an evening")
    parser.add_argument("--workers", type=int, default=4, help="evenings at once: they mostly wait")
    at = parser.add_mutually_exclusive_group()
    at.add_argument("--command-line", action="store_true", help="every order by a `kochab mount` of its own")
    at.add_argument("--window", action="store_true", help="by the thread of the window's line")
    at.add_argument("--real-time", action="store_true", help="by the computer's clock, on pseudo-terminals and TCP")
    parser.add_argument("--diary", action="store_true", help="print the whole of every evening with a violation")
    options = parser.parse_args(arguments)
    where = (
        "command line"
        if options.command_line
        else "window"
        if options.window
        else "real time"
        if options.real_time
        else ""
    )
    boards = [board for board in BOARDS if options.board in (None, board)]
    deal = ((boards[k % len(boards)], options.seed + k // len(boards)) for k in range(options.count if boards else 0))
    plans = [(*plan, options.orders, where) for plan in deal]
    behind = [kind for kind in BEHIND_INDI if options.board in (None, kind)]
    seeds = range(
        options.seed, options.seed + (options.count if options.board in BEHIND_INDI else options.through_indi)
    )
    plans += [(kind, seed, INDI_ORDERS, "through INDI") for seed in seeds for kind in behind]
    return _play_all(plans, options)


def _play_all(plans, options):
    counts, skipped = {board: Counter() for board, *_ in plans}, {}
    with ProcessPoolExecutor(options.workers) as pool:
        for evening in pool.map(spend, *zip(*plans, strict=True)):
            if evening.skipped:
                skipped[evening.board] = evening.skipped
                continue
            count = counts[evening.board]
            count["evenings"] += 1
            count["cuts"] += evening.cuts
            count.update(kind for kind, _ in evening.violations)
            for kind, what in evening.violations:
                print(f"{evening.board} seed {evening.seed}: {KINDS[kind]}: {what}", flush=True)
            if options.diary and evening.violations:
                print("\n".join(f"    {line}" for line in evening.diary), flush=True)
    for board in [*counts, "in all"]:
        if board in skipped:
            print(f"{board}: not played: {skipped[board]}")
            continue
        count = sum(counts.values(), Counter()) if board == "in all" else counts[board]
        kinds = ", ".join(f"{kind} {count[kind]}" for kind in KINDS)
        wrong = sum(count[kind] for kind in KINDS)
        how = " through INDI's driver, in real time" if board in BEHIND_INDI else ""
        print(f"{board}: {count['evenings']} evenings{how}, {count['cuts']} power cuts, {wrong} violations ({kinds})")
    return min(1, sum(sum(count[kind] for kind in KINDS) for count in counts.values()))


if __name__ == "__main__":
    sys.exit(main())
